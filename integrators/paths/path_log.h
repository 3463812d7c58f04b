#pragma once
// A path, vertex by vertex, for people to read.
#include <fmt/format.h>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/path.h"

namespace limn {

inline std::string to_text(const Vec3d& v) {
  return fmt::format("({:.6g}, {:.6g}, {:.6g})", v.x, v.y, v.z);
}

inline void log_camera_ray(SampleLog& log, double x, double y, const Vec3d& origin,
                           const Vec3d& direction) {
  log.push_back(fmt::format("film position ({:.6f}, {:.6f}), ray from {} along {}", x, y,
                            to_text(origin), to_text(direction)));
}

template <class S>
void log_vertex(SampleLog& log, const SurfacePoint<S>& surface, const Scattering<S>& scattering,
                const Rgb<double>& throughput, int bounces) {
  const std::string& id = surface.shape->id;
  log.push_back(fmt::format(
      "vertex {}: face {} of shape {}{} at {}, normal {}, to the viewer {}, throughput ({:.6g}, "
      "{:.6g}, {:.6g})",
      bounces, surface.face.face.index(), surface.face.shape.index(),
      id.empty() ? "" : " \"" + id + "\"", to_text(value(surface.p)),
      to_text(value(scattering.normal())), to_text(value(scattering.wi())), throughput.r,
      throughput.g, throughput.b));
}

// Visitor of a PathTracer.
class PathLog {
 public:
  explicit PathLog(SampleLog& log) : log_(log) {}
  template <class S>
  void operator()(const SurfacePoint<S>& surface, const Scattering<S>& scattering,
                  const Rgb<S>& throughput, const DirectionMotion*, const PathStep&, int bounces,
                  const Rng&) {
    log_vertex(log_, surface, scattering, value(throughput), bounces);
  }

 private:
  SampleLog& log_;
};

}  // namespace limn
