// The boundary term of a lamp at one point, without chance: outlines cut where they cross as seen
// from the point, one ray through the middle of each part, and the integral along it in closed
// form. A second opinion on the term "direct" at diffuse points under lamps of one radiance.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "integrators/terms/edge_difference.h"
#include "integrators/terms/lane_sinks.h"
#include "integrators/terms/term_table.h"
#include "limn/core/parameter.h"
#include "limn/integrators/statistics.h"
#include "support/meshes.h"
#include "support/scenes.h"
#include "support/test_names.h"

namespace limn {
namespace {

// Part of an edge, its ends minus p, and m . v there for the first lane, m being the unit normal of
// the plane through p and the edge.
struct Segment {
  EdgeRef id;
  double t0 = 0, t1 = 1;
  Vec3d w0, w1;
  double v0 = 0, v1 = 0;
};

// The integral over the segment of w (m . v) |w_0 x w_1| / |w|^4 ds, s in [0, 1], times n. With
// e_2 along it, h e_1 the foot of p's perpendicular, y = h tan(psi) along e_2 and m . v = A + B tan
// (psi), |w_0 x w_1| ds = h dy = |w|^2 dpsi: what is left is the integral of
//   (e_1 cos + e_2 sin)(A cos + B sin) / h dpsi.
double integral(const Segment& s, const Vec3d& n) {
  const Vec3d along = s.w1 - s.w0;
  const double size = length(along);
  if (size == 0) return 0;
  const Vec3d e2 = along / size;
  const double y0 = dot(s.w0, e2), y1 = y0 + size;
  const Vec3d foot = s.w0 - e2 * y0;
  const double h = length(foot);
  if (h == 0) return 0;
  const Vec3d e1 = foot / h;
  const double psi0 = std::atan2(y0, h), psi1 = std::atan2(y1, h);
  const double slope = (s.v1 - s.v0) / size, a = s.v0 - slope * y0, b = slope * h;
  const double sines = 0.25 * (std::sin(2 * psi1) - std::sin(2 * psi0));
  const double c = 0.5 * (psi1 - psi0) + sines, q = 0.5 * (psi1 - psi0) - sines;
  const double mixed = 0.25 * (std::cos(2 * psi0) - std::cos(2 * psi1));
  return (dot(n, e1) * (a * c + b * mixed) + dot(n, e2) * (a * mixed + b * q)) / h;
}

TEST(ExactDirect, IntegralIsThatOfQuadrature) {
  Rng rng(41, 0, 0);
  for (int i = 0; i < 100; ++i) {
    Segment s;
    s.w0 = random_direction(rng) * (0.1 + rng.uniform());
    s.w1 = random_direction(rng) * (0.1 + rng.uniform());
    s.v0 = rng.uniform() - 0.5;
    s.v1 = rng.uniform() - 0.5;
    const Vec3d n = random_direction(rng);
    double sum = 0;
    constexpr int kSteps = 100000;
    const double area = length(cross(s.w0, s.w1));
    for (int k = 0; k < kSteps; ++k) {
      const double u = (k + 0.5) / kSteps, w2 = length_squared(s.w0 * (1 - u) + s.w1 * u);
      sum += dot(n, s.w0 * (1 - u) + s.w1 * u) * (s.v0 * (1 - u) + s.v1 * u) * area / (w2 * w2);
    }
    EXPECT_NEAR(integral(s, n), sum / kSteps, 1e-4 * (1 + std::fabs(sum / kSteps)));
  }
}

// Everything at one point of a scene whose first parameter is seeded.
class ExactDirect {
 public:
  ExactDirect(const PathContext& context, const EdgeSamplerInput& edges,
              const LightRegions& regions)
      : context_(context), edges_(edges), regions_(regions) {}

  // For a diffuse point of albedo 1.
  Rgb<double> at(const EdgeQuery& query) const {
    Rgb<double> sum;
    for (size_t k = 0; k < regions_.size(); ++k) {
      const auto cone = regions_.cone(k, query.p, query.n);
      if (!cone) continue;
      const std::vector<Segment> segments = list(query, *cone);
      for (const Segment& segment : segments) {
        for (const Segment& part : cut(segment, segments)) {
          sum += jump(part, query, k) * (integral(part, query.n) / kPi);
        }
      }
    }
    return sum;
  }

 private:
  static Segment part_of(const Segment& s, double u0, double u1) {
    const auto mix = [](const auto& a, const auto& b, double u) { return a * (1 - u) + b * u; };
    return {s.id,
            mix(s.t0, s.t1, u0),
            mix(s.t0, s.t1, u1),
            mix(s.w0, s.w1, u0),
            mix(s.w0, s.w1, u1),
            mix(s.v0, s.v1, u0),
            mix(s.v0, s.v1, u1)};
  }

  std::vector<Segment> list(const EdgeQuery& query, const DirectionCone& cone) const {
    std::vector<Segment> segments;
    for (uint32_t o = 0; o < edges_.objects.size(); ++o) {
      const EdgeMesh& mesh = edges_.objects[o];
      for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
        const EdgeRef id{ShapeId(o), EdgeId(e)};
        if (!is_outline(mesh, id.edge, query.p) || is_own_edge(edges_, query, id)) continue;
        const auto [i, j] = mesh.edge(id.edge).vertices;
        const Vec3d w0 = mesh.position(i) - query.p, w1 = mesh.position(j) - query.p;
        double t0 = 0, t1 = 1;
        if (!DirectionCone::clip_by(dot(query.n, w0), dot(query.n, w1), t0, t1)) continue;
        if (!cone.clip(w0, w1, t0, t1)) continue;
        const Vec3d side = cross(w0, w1);
        if (length(side) == 0) continue;
        const Vec3d m = normalize(side);
        const auto across = [&](VertexId vertex) {
          const Vec3<Lanes> v = relative_velocity(mesh, vertex, query);
          return m.x * v.x[0] + m.y * v.y[0] + m.z * v.z[0];
        };
        segments.push_back(part_of({id, 0, 1, w0, w1, across(i), across(j)}, t0, t1));
      }
    }
    return segments;
  }

  // At the directions where others cross it.
  static std::vector<Segment> cut(const Segment& s, const std::vector<Segment>& others) {
    std::vector<double> at{0, 1};
    const Vec3d m = cross(s.w0, s.w1);
    for (const Segment& other : others) {
      const Vec3d n = cross(other.w0, other.w1);
      const double a0 = dot(n, s.w0), a1 = dot(n, s.w1);
      const double b0 = dot(m, other.w0), b1 = dot(m, other.w1);
      if ((a0 < 0) == (a1 < 0) || (b0 < 0) == (b1 < 0)) continue;
      const double u = a0 / (a0 - a1), v = b0 / (b0 - b1);
      const Vec3d here = s.w0 * (1 - u) + s.w1 * u, there = other.w0 * (1 - v) + other.w1 * v;
      if (dot(here, there) > 0) at.push_back(u);
    }
    std::sort(at.begin(), at.end());
    std::vector<Segment> parts;
    for (size_t i = 0; i + 1 < at.size(); ++i) {
      if (at[i + 1] > at[i]) parts.push_back(part_of(s, at[i], at[i + 1]));
    }
    return parts;
  }

  Rgb<double> jump(const Segment& part, const EdgeQuery& query, size_t region) const {
    const EdgeMesh& mesh = edges_.object(part.id.object);
    EdgeView view;
    RayCount rays;
    Rgb<double> result;
    if (!view_edge(mesh, part.id, 0.5 * (part.t0 + part.t1), query.p, view)) return {};
    const Rng key(0, 0, 0);
    const EdgeViewer viewer{query.face, 1, key, {&regions_, region}};
    const bool seen = edge_difference(context_, mesh, view, viewer, rays, result);
    return seen ? result : Rgb<double>{};
  }

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const LightRegions& regions_;
};

struct World {
  World(const Scene& original, const std::string& parameter)
      : scene(deep_copy(original)),
        tracer((find_parameter(scene, parameter).seed(scene, 0), make_embree_tracer(scene, 1))),
        lights(scene),
        context{scene, *tracer, lights},
        input(context, 1, {1, 1, 1, 1}, edge_sampler_type("silhouettes"), 1),
        term(make_direct_term(input)) {}

  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  Lights lights;
  PathContext context;
  TermInput input;
  std::unique_ptr<Term> term;
};

// A ball and a leaf before a lamp with a smaller lamp before it, over a white floor.
Scene scene_of(const TempFiles& files) {
  SceneParts parts;
  const Mesh leaf =
      make_mesh({{-1, 0, 0}, {0, -0.5f, 0.3f}, {0, 0.5f, 0.3f}, {1, 0, 0}}, {{0, 1, 2}, {2, 1, 3}});
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "1, 1, 1")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), true, 0.4,
                         {0.2, 0.8, 0.1}, diffuse("clay", "0.5, 0.5, 0.5")) +
               obj_shape("leaf", write_mesh(files, "leaf.obj", leaf), true, 0.5, {0, 1.5, 0.3},
                         diffuse("green", "0.3, 0.6, 0.2")) +
               square("lamp", 0.6, 90, {0.4, 2.5, -0.3}, area_light("glow", "9, 8, 6")) +
               square("small", 0.15, 90, {0.2, 2.1, -0.1}, area_light("dim", "3, 4, 5"));
  return make_scene(files, parts);
}

class ExactDirectOf : public testing::TestWithParam<std::string> {};

// Many points, of which groups are compared: drawing has an error at each of them.
TEST_P(ExactDirectOf, IsWhatIsDrawn) {
  const TempFiles files;
  World world(scene_of(files), GetParam());
  const ExactDirect exact(world.context, world.input.edges(), *world.input.regions());
  constexpr int kGroups = 50, kPoints = 200, kRepeats = 4;
  std::vector<double> z;
  double total = 0, squares = 0;
  Rng rng(42, 0, 0);
  for (int g = 0; g < kGroups; ++g) {
    double residual = 0, variance = 0;
    for (int k = 0; k < kPoints; ++k) {
      const Vec3<Dual> origin{3 * rng.uniform() - 1.5, 0.01, 3 * rng.uniform() - 1.5};
      Hit hit;
      ASSERT_TRUE(world.tracer->closest({value(origin), {0, -1, 0}}, hit));
      const auto surface =
          surface_on_ray<Dual>(world.scene, hit.face, origin, Vec3<Dual>{0.0, -1.0, 0.0});
      const Scattering<Dual> scattering(surface, {0.0, 1.0, 0.0}, world.scene.shading);
      double values[kRepeats], mean = 0;
      EdgeQuery query;
      query.p = value(surface.p);
      query.n = value(scattering.normal());
      query.wi = query.n;
      query.velocity = {surface.p.x.d, surface.p.y.d, surface.p.z.d};
      query.face = surface.face;
      for (int r = 0; r < kRepeats; ++r) {
        const Rng key(43, static_cast<uint64_t>(g * kPoints + k), static_cast<uint64_t>(r));
        const PathVertex vertex =
            plain_vertex(surface, scattering, world.scene.shading, 1, {}, key);
        TermCost cost;
        const VertexLanes::Setting setting{world.scene};
        VertexLanes lanes(setting, vertex, surface, nullptr);
        lanes.start(cost, {});
        world.term->add_at_vertex(vertex, 1, lanes);
        values[r] = lanes.sum().g[0];
        mean += values[r] / kRepeats;
      }
      for (const double v : values)
        variance += (v - mean) * (v - mean) / (kRepeats * (kRepeats - 1));
      const double truth = exact.at(query).g;
      residual += mean - truth;
      total += std::fabs(truth);
      squares += (mean - truth) * (mean - truth);
    }
    z.push_back(residual / std::sqrt(variance));
  }
  const ZSummary summary = summarize(z);
  fmt::print(
      "{:18} mean |value| {:.4f}, rms difference {:.4f}; z: mean {:.2f}, sd {:.2f}, max {:.2f}\n",
      GetParam(), total / (kGroups * kPoints), std::sqrt(squares / (kGroups * kPoints)),
      summary.mean, summary.deviation, summary.largest);
  EXPECT_GT(total, 0);
  EXPECT_TRUE(summary.plausible(1e-4));
}

INSTANTIATE_TEST_SUITE_P(, ExactDirectOf,
                         testing::Values("ball.translate.x", "leaf.rotate.z", "lamp.translate.y",
                                         "lamp.rotate.x", "small.translate.x", "floor.rotate.x"),
                         name_of_string);

}  // namespace
}  // namespace limn
