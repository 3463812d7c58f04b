// Normal maps: normals from a texture, in the frame of tangent, bitangent and shading normal.
#include "limn/core/tangent.h"
#include "src/bsdf/mapped_normal.h"
#include "src/bsdf/tangent_frame.h"

namespace limn {
namespace {

class NormalMap final : public MappedNormal<NormalMap> {
 public:
  NormalMap(const ConstantOrTexture& map, std::shared_ptr<Bsdf> nested,
            const MappedNormalOptions& options)
      : MappedNormal(std::move(nested), options) {
    if (map.texture) map.texture->set_mixes_channels();
    map_ = colour("normalmap", map);
    tangent_ = add_tangent("normalmap");
    outward_ = colour("normalmap", make_outward()).texture;
    add_nested(false);
  }

  // The colour t stands for 2 t - 1. Seen from the back, tangent and bitangent stay, or both turn.
  template <class S>
  Vec3<S> normal(const Vec3<S>& n, const Rgb<S>* at) const {
    const auto vector_at = [&](int k) { return Vec3<S>{at[k].r, at[k].g, at[k].b}; };
    const Rgb<S> t = map_.of(at);
    const Vec3<S> m = Vec3<S>{t.r, t.g, t.b} * 2.0 - Vec3<S>{1.0, 1.0, 1.0};
    const Vec3<S> s = along_surface(n, vector_at(tangent_));
    const double side = side_seen(n, vector_at(outward_));
    const Vec3<S> sum =
        s * (m.x * turned(side)) + cross(n, s) * (m.y * side * turned(side)) + n * m.z;
    return value(length_squared(sum)) > 0 ? normalize(sum) : n;
  }

  std::vector<ParameterRef> parameters() override {
    std::vector<ParameterRef> list, own;
    add_nested_parameters(list);
    add_parameter("normalmap", map_, 0, 1, own);
    for (ParameterRef& p : own) p.mixes_channels = true;
    list.insert(list.end(), own.begin(), own.end());
    return list;
  }
  std::string describe() const override { return "normalmap, " + text_of(map_) + text_of_inside(); }

 private:
  bool own_is_constant() const override { return limn::is_constant(map_.constant); }

  BsdfColour map_;
  int tangent_, outward_;  // where they stand in `at`
};

}  // namespace

MappedNormalOptions read_mapped_normal_options(Properties& properties) {
  MappedNormalOptions options;
  options.flips = properties.boolean("flip_invalid_normals", true);
  options.shadows = properties.boolean("use_shadowing_function", true);
  return options;
}

std::shared_ptr<Bsdf> read_normalmap(Properties& properties) {
  const auto texture = properties.texture("normalmap");
  if (!texture && !properties.has("normalmap"))
    properties.fail("a normalmap needs a texture \"normalmap\"");
  const ConstantOrTexture map =
      texture ? ConstantOrTexture(texture) : properties.rgb("normalmap", {});
  return std::make_shared<NormalMap>(map, read_nested(properties, 1, 3, 0)[0],
                                     read_mapped_normal_options(properties));
}

}  // namespace limn
