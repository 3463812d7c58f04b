// Area lights: the front of every face of a shape emits.

#include "limn/core/surface_point.h"
#include "src/light/face_groups.h"
#include "src/light/types.h"

namespace limn {
namespace {

class AreaLight final : public Light {
 public:
  AreaLight(const Scene& scene, ShapeId id, DrawFaces draw)
      : shape_(scene.shape(id)), id_(id), faces_(shape_.mesh, draw) {}

  std::optional<LightSample> sample(const Vec3d& p, double probability,
                                    const LightNumbers& u) const override {
    const auto [face, of_area] = faces_.draw(p, u[0]);
    const double root = std::sqrt(u[1]);
    const double b2 = root * u[2];
    const auto c = face_corners<double>(shape_.mesh, face);
    const Vec3d y = c[0] + (c[1] - c[0]) * (1 - root) + (c[2] - c[0]) * b2;
    const double distance = length(y - p);
    if (distance == 0) return {};
    const Vec3d wo = (y - p) * (1 / distance);
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    const double facing = -dot(n, wo);
    if (!(facing > 0)) return {};
    // Equal to `pdf`, without normalising the normal.
    const double density = distance * distance * of_area * length(n) * probability / facing;
    if (!(density > 0)) return {};
    return LightSample{wo, distance, density, FaceRef{id_, face}, this};
  }
  double pdf(const Vec3d& p, const LightView& view, double probability) const override {
    const double cosine = std::fabs(dot(view.n_g, view.wo));
    return view.distance * view.distance * faces_.density(p, view.face) * probability / cosine;
  }

  Rgb<double> radiance(const Vec3<double>&) const override { return value(shape_.radiance); }
  Rgb<Dual> radiance(const Vec3<Dual>&) const override { return shape_.radiance; }

  void add_triangles(std::vector<LightTriangle>& triangles) const override {
    for (uint32_t f = 0; f < shape_.mesh.faces.size(); ++f) {
      const auto c = face_corners<double>(shape_.mesh, FaceId(f));
      triangles.push_back({{c[0], c[1], c[2]}, luminance(value(shape_.radiance))});
    }
  }

 private:
  const Shape& shape_;
  ShapeId id_;
  FaceGroups faces_;
};

}  // namespace

std::unique_ptr<Light> make_area_light(const Scene& scene, ShapeId shape, DrawFaces draw) {
  return std::make_unique<AreaLight>(scene, shape, draw);
}

void read_area(Properties& properties, Scene&, Shape* shape) {
  shape->is_emitter = true;
  shape->emitter_id = properties.id();
  shape->radiance_texture = read_emission(properties, "radiance");
  if (shape->radiance_texture) return;
  const Rgb<double> radiance = properties.rgb("radiance", grey(1.0));
  for (int i = 0; i < 3; ++i) {
    if (!(radiance[i] >= 0)) properties.fail("radiance", "must not be negative");
    shape->radiance[i] = radiance[i];
  }
}

}  // namespace limn
