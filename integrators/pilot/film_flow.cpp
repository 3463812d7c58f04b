// Motion on the film of the first points of camera rays.
#include "integrators/pilot/film_flow.h"

#include <algorithm>
#include <limits>

#include "integrators/paths/camera_path.h"
#include "integrators/paths/straight_way.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

constexpr int kAcross = 3;  // rays through a cell, along each axis; not tuned

double mean_of(const Rgb<double>& c) { return (c.r + c.g + c.b) / 3; }

// A place of a face, moving with it.
Vec3<Dual> moving_with(const Mesh& mesh, FaceId face, const Vec3d& p) {
  const Vec3<Dual> still{p.x, p.y, p.z};
  if (mesh.position_tangents.empty()) return still;
  const auto corners = face_corners<Dual>(mesh, face);
  const Vec3d e1 = value(corners[1]) - value(corners[0]),
              e2 = value(corners[2]) - value(corners[0]);
  const Vec3d n = cross(e1, e2), q = p - value(corners[0]);
  const double b1 = dot(cross(q, e2), n) / dot(n, n), b2 = dot(cross(e1, q), n) / dot(n, n);
  return corners[0] * Dual(1 - b1 - b2) + corners[1] * Dual(b1) + corners[2] * Dual(b2);
}

// Sums of what rays see.
struct Seen {
  FilmMotion sum, nearest;
  double weight = 0, depth = std::numeric_limits<double>::infinity();

  void add(const FilmMotion& motion, double share, double at_depth) {
    sum.x += motion.x * share;
    sum.y += motion.y * share;
    weight += share;
    if (!(at_depth < depth)) return;
    depth = at_depth;
    nearest = motion;
  }
};

class FlowRays {
 public:
  explicit FlowRays(const TermEstimator& estimator)
      : context_(estimator.context()),
        scene_(estimator.scene()),
        view_(scene_.camera),
        moving_(scene_.camera),
        far_(1e6 * std::max(bounds_of(scene_).diagonal(), length(value(scene_.camera.origin)))) {}

  // A ray that cannot be traced is left out; the samples count it.
  void add(double x, double y, Seen& seen) const {
    try {
      trace(x, y, seen);
    } catch (const UntraceableRay&) {
    }
  }

 private:
  void trace(double x, double y, Seen& seen) const {
    Ray ray = camera_ray(scene_, view_.ray(x, y));
    StraightWay way{ray.origin, ray.start};
    Hit hit;
    while (context_.tracer.closest(ray, hit)) {
      const double before = mean_of(way.share);
      const Vec3d p = ray.origin + ray.direction * hit.t;
      const bool passes = context_.straight_ways && way.pass(context_, hit.face, ray.direction);
      const double share = before - (passes ? mean_of(way.share) : 0);
      if (share > 0) {
        const Mesh& mesh = scene_.shape(hit.face.shape).mesh;
        seen.add(motion_of(moving_with(mesh, hit.face.face, p)), share, scene_.camera.depth(p));
      }
      if (!passes) return;
      way.go_on(ray);
    }
    const Vec3d far = ray.origin + ray.direction * far_;
    seen.add(motion_of({far.x, far.y, far.z}), mean_of(way.share),
             std::numeric_limits<double>::max());
  }

  FilmMotion motion_of(const Vec3<Dual>& p) const {
    const auto at = moving_.project(p);
    return {at.x.d, at.y.d};
  }

  const PathContext& context_;
  const Scene& scene_;
  CameraView<double> view_;
  CameraView<Dual> moving_;
  double far_;  // so far away, motions of the camera's place are not seen
};

}  // namespace

FilmFlows film_flows(const TermEstimator& estimator, const PlanGrid& grid, int threads) {
  FilmFlows flows;
  for (auto& flow : flows) flow.resize(grid.size());
  const FlowRays rays(estimator);
  const double step = static_cast<double>(grid.cell) / kAcross;
  parallel_for(static_cast<size_t>(grid.rows), threads, [&](size_t row) {
    for (int column = 0; column < grid.columns; ++column) {
      const double x0 = grid.x0 + column * grid.cell;
      const double y0 = grid.y0 + static_cast<double>(row) * grid.cell;
      Seen seen;
      for (int i = 0; i < kAcross * kAcross; ++i)
        rays.add(x0 + step * (i % kAcross + 0.5), y0 + step * (i / kAcross + 0.5), seen);
      const size_t cell = row * grid.columns + column;
      if (!(seen.weight > 0)) continue;
      flows[0][cell] = {seen.sum.x * (1 / seen.weight), seen.sum.y * (1 / seen.weight)};
      flows[1][cell] = seen.nearest;
    }
  });
  return flows;
}

bool moves_textures(const Scene& scene) {
  return std::ranges::any_of(scene.shapes, [](const Shape& shape) {
    return !shape.mesh.position_tangents.empty() &&
           (shape.bsdf->texture_count() > 0 || shape.radiance_texture);
  });
}

size_t in_grid(const PlanGrid& other, const PlanGrid& grid, size_t cell) {
  const int column = static_cast<int>(cell) % grid.columns;
  const int row = static_cast<int>(cell) / grid.columns;
  return other.index(grid.x0 + column * grid.cell, grid.y0 + row * grid.cell);
}

void refine(SamplePlan& plan, const PlanGrid& grid) {
  const PlanGrid from = plan.grid;
  const auto spread = [&](auto& values) {
    if (values.empty()) return;
    auto finer = values;
    finer.resize(grid.size());
    for (size_t cell = 0; cell < grid.size(); ++cell) {
      finer[cell] = values[in_grid(from, grid, cell)];
    }
    values = std::move(finer);
  };
  spread(plan.counts);
  spread(plan.fields);
  plan.grid = grid;
}

}  // namespace limn
