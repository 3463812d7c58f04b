// Bump maps: normals of a surface that is displaced by the heights of a texture.
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
    add_nested_textures();
  }

  // With g the gradient of heights over the face, of normal n_g: the shading normal n leans against
  // the gradient of the same heights over the plane of n, g - n_g (g.n) / (n_g.n).
  template <class S>
  Vec3<S> normal(const Vec3<S>& n, const Rgb<S>* at) const {
    const auto vector_at = [&](int k) { return Vec3<S>{at[k].r, at[k].g, at[k].b}; };
    const Vec3<S> g = vector_at(gradient_.texture), n_g = vector_at(outward_);
    const Vec3<S> along = g - n_g * (dot(g, n) / dot(n_g, n));
    return normalize(n - along * (scale_ * turned(side_of(n, n_g))));
  }

  bool map_is_constant() const { return true; }
  std::vector<ParameterRef> parameters() override { return nested()[0]->parameters(); }
  std::shared_ptr<Bsdf> clone() const override {
    const auto copy = std::make_shared<BumpMap>(*this);
    copy->clone_nested();
    return copy;
  }
  std::string describe() const override {
    return "bumpmap, " + text_of(gradient_) + " (" + inside().describe() + ")";
  }

 private:
  double scale_;
  BsdfColour gradient_;
  int outward_;  // where it stands in `at`
};

}  // namespace

std::shared_ptr<Bsdf> read_bumpmap(Properties& properties) {
  const double scale = properties.number("scale", 1);
  const std::shared_ptr<Texture> heights = properties.only_texture();
  if (!heights) properties.fail("bumpmap needs one nested texture");
  return std::make_shared<BumpMap>(heights, scale, read_mapped_bsdf(properties, 2),
                                   read_mapped_normal_options(properties));
}

}  // namespace limn
