// Bump maps: normals of a surface that is displaced by the heights of a texture.
#include <fmt/format.h>

#include "limn/core/tangent.h"
#include "src/bsdf/mapped_normal.h"

namespace limn {
namespace {

class BumpMap final : public MappedNormal<BumpMap> {
 public:
  BumpMap(const std::shared_ptr<Texture>& heights, double scale, std::shared_ptr<Bsdf> nested,
          const MappedNormalOptions& options)
      : MappedNormal(std::move(nested), options), scale_(scale) {
    gradient_ = colour("bumpmap", make_surface_gradient(heights));
    outward_ = colour("bumpmap", make_outward()).texture;
    add_nested(false);
  }

  // With g the gradient of heights over the face, of normal n_g: the shading normal n leans against
  // the gradient of the same heights over the plane of n, g - n_g (g.n) / (n_g.n).
  template <class S>
  Vec3<S> normal(const Vec3<S>& n, const Rgb<S>* at) const {
    const auto vector_at = [&](int k) { return Vec3<S>{at[k].r, at[k].g, at[k].b}; };
    const Vec3<S> g = vector_at(gradient_.texture), n_g = vector_at(outward_);
    const Vec3<S> along = g - n_g * (dot(g, n) / dot(n_g, n));
    return normalize(n - along * (scale_ * turned(side_seen(n, n_g))));
  }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list;
    add_nested_parameters(list);
    return list;
  }
  std::string describe() const override {
    return fmt::format("bumpmap, {}, scale {:g}{}", text_of(gradient_), scale_, text_of_inside());
  }

 private:
  bool own_is_constant() const override { return true; }

  double scale_;
  BsdfColour gradient_;
  int outward_;  // where it stands in `at`
};

}  // namespace

std::shared_ptr<Bsdf> read_bumpmap(Properties& properties) {
  const double scale = properties.number("scale", 1);
  const std::shared_ptr<Texture> heights = properties.only_texture();
  if (!heights) properties.fail("bumpmap needs one nested texture");
  return std::make_shared<BumpMap>(heights, scale, read_nested(properties, 1, 2, 0)[0],
                                   read_mapped_normal_options(properties));
}

}  // namespace limn
