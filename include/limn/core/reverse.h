#pragma once
// Overloads for Var of the functions that path tracing calls on surfaces, lights and cameras. They
// write derivatives with respect to the scene's slots to the tape.
#include <optional>

#include "limn/core/camera.h"
#include "limn/core/lights.h"
#include "limn/core/shading.h"
#include "limn/core/slots.h"

namespace limn {

// A composite statement with seven outputs (p, n_s, horizon), from the derivatives of
// surface_on_ray<Dual>.
template <>
SurfacePoint<Var> surface_on_ray<Var>(const Scene& scene, FaceRef face, const Vec3<Var>& origin,
                                      const Vec3<Var>& direction);

template <>
Rgb<Var> Light::drawn_radiance<Var>(const LightSample& sample) const;
template <>
Environment::Sight<Var> Lights::environment<Var>(const Place& place, const Vec3d& wo,
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
