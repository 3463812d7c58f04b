#pragma once
// Overloads for Var of the functions that path tracing calls on surfaces, lights and cameras. They
// write derivatives with respect to the scene's slots to the tape.
#include <array>
#include <optional>

#include "limn/core/camera.h"
#include "limn/core/lights.h"
#include "limn/core/shading.h"
#include "limn/core/slots.h"

namespace limn {

// The adjoint of detail::interpolate_shading at a point x of a face: derivatives with respect to x,
// the face's corners and their normals.
struct ShadingAdjoint {
  Vec3d x;
  std::array<Vec3d, 3> corners, normals;
};
// of_p, of_normal: of the point that x is lifted to, seen along `direction`, and of the unit
// shading normal there.
ShadingAdjoint pull_back_shading(const Scene& scene, FaceRef face, const Vec3d& x,
                                 const Vec3d& direction, const Vec3d& of_p, const Vec3d& of_normal);

// A composite statement with six outputs (p, n_s), from the derivatives of surface_on_ray<Dual>.
template <>
SurfacePoint<Var> surface_on_ray<Var>(const Scene& scene, FaceRef face, const Vec3<Var>& origin,
                                      const Vec3<Var>& direction);

template <>
Rgb<Var> Light::drawn_radiance<Var>(const LightSample& sample) const;
template <>
Environment::Sight<Var> Lights::environment<Var>(const Point& place, const Vec3d& wo,
                                                 const std::array<double, 2>& at) const;

// Radiance from the environment in a direction that may depend on parameters.
template <class S>
Rgb<S> environment_radiance(const Environment& environment, const Vec3<S>& d) {
  return environment.radiance(d);
}
template <>
Rgb<Var> environment_radiance<Var>(const Environment& environment, const Vec3<Var>& d);

// DeltaLight::arriving in the scalar S.
template <class S>
std::optional<Arrival<S>> arrival(const DeltaLight& light, const Vec3<S>& p) {
  return light.arriving(p);
}
template <>
std::optional<Arrival<Var>> arrival<Var>(const DeltaLight& light, const Vec3<Var>& p);

// LightOrigin::v as leaves of the current tape.
Vec3<Var> light_origin(const DeltaLight& light);

// The camera, with its values as leaves of the current tape.
CameraView<Var> camera_leaves(const Camera& camera);

// The corners of a face as leaves of the current tape.
std::array<Vec3<Var>, 3> corner_leaves(const Scene& scene, FaceRef face);

}  // namespace limn
