// Warped-area sampling: the field, its boundary function, and derivatives by it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "integrators/edges/scene_edges.h"
#include "integrators/paths/warp_field.h"
#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/compare.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/statistics.h"
#include "support/block_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

Vec3d lane(const Vec3<Lanes>& v, int k) { return {v.x[k], v.y[k], v.z[k]}; }

// V by its definition, for rays that are held; their densities are those of the first direction.
Vec3d field_of(const std::vector<AuxiliaryRay>& rays, double kappa, const Vec3d& w) {
  double sum = 0;
  Vec3d moved{};
  for (const AuxiliaryRay& ray : rays) {
    const double d = std::exp(kappa * (1 - dot(w, ray.direction))) - 1 + ray.boundary;
    const double weight = std::pow(d, -3) * ray.weight;
    sum += weight;
    moved += lane(ray.velocity, 0) * weight;
  }
  const Vec3d x = moved / sum;
  return x - w * dot(w, x);
}

TEST(WarpField, DivergenceIsThatOfTheField) {
  Rng rng(5, 0, 0);
  for (const double kappa : {1e2, 1e4}) {
    for (int trial = 0; trial < 20; ++trial) {
      const Vec3d w = random_direction(rng);
      const Frame frame(w);
      std::vector<AuxiliaryRay> rays;
      WarpSums sums;
      for (int i = 0; i < 6; ++i) {
        AuxiliaryRay& ray = rays.emplace_back();
        const double angle = 2 * std::sqrt(rng.uniform() / kappa), turn = 2 * kPi * rng.uniform();
        ray.direction = frame.to_world(
            {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)});
        ray.weight = std::exp(kappa * (1 - dot(w, ray.direction)));
        ray.boundary = 0.1 + rng.uniform();
        const Vec3d v = random_direction(rng);
        ray.velocity = {{v.x, 0, 0, 0}, {v.y, 0, 0, 0}, {v.z, 0, 0, 0}};
        EXPECT_TRUE(sums.add(w, kappa, ray));
      }
      const DirectionWarp warp = sums.warp(w);
      EXPECT_LT(length(lane(warp.velocity, 0) - field_of(rays, kappa, w)), 1e-12);
      // Central differences along two tangents: truncation ~ h^2 kappa^(3/2), rounding ~ 1e-16 / h.
      const double h = 1e-4 / std::sqrt(kappa);
      double divergence = 0;
      for (const Vec3d& s : {frame.s, frame.t}) {
        const auto at = [&](double step) { return field_of(rays, kappa, normalize(w + s * step)); };
        divergence += dot(at(h) - at(-h), s) / (2 * h);
      }
      EXPECT_NEAR(warp.divergence[0], divergence, 1e-6 * std::sqrt(kappa)) << kappa;
    }
  }
}

// All that a field needs of a scene.
struct Fields {
  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  EdgeSamplerInput edges;
  WarpField field;

  Fields(const Scene& from, const std::string& parameter, const WarpOptions& options, bool unbiased)
      : scene(seeded(from, parameter)),
        tracer(make_embree_tracer(scene, 1)),
        edges(make_sampler_input(scene, 1)),
        field(scene, *tracer, edges, options, unbiased) {}

  static Scene seeded(const Scene& from, const std::string& parameter) {
    Scene scene = deep_copy(from);
    find_parameter(scene, parameter).seed(scene, 0);
    return scene;
  }
};

// A point of a floor without extent, which nothing but its place is asked of.
SurfacePoint<Dual> still_point(const Vec3d& p) {
  SurfacePoint<Dual> point;
  point.p = {p.x, p.y, p.z};
  return point;
}

// On every edge of E(p) and every face that the edge belongs to, B is zero; inside of all faces it
// is positive.
TEST(BoundaryFunction, VanishesOnEdgesAlone) {
  const TempFiles files;
  SceneParts parts;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("stone", "0.5, 0.5, 0.5")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.6,
                         {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.3,
                         {-1, 1, 0.5}, diffuse("clay2", "0.7, 0.5, 0.3")) +
               square("lamp", 0.5, 90, {0.3, 2.4, 0.5}, area_light("glow", "6, 5, 4"));
  const Scene scene = make_scene(files, parts);
  const EdgeSamplerInput edges = make_sampler_input(scene, 1);
  const BoundaryFunction boundary(scene, edges);
  Rng rng(3, 0, 0);
  int candidates = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Vec3d p = random_direction(rng) * 4;
    for (uint32_t o = 0; o < edges.objects.size(); ++o) {
      const EdgeMesh& mesh = edges.objects[o];
      for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
        if (!is_candidate(mesh, EdgeId(e), p)) continue;
        const auto& ends = mesh.edges[e].vertices;
        const double t = rng.uniform();
        const Vec3d x = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
        for (const FaceRef face : mesh.faces_around(EdgeId(e))) {
          const auto c = face_corners<double>(scene.shape(face.shape).mesh, face.face);
          const Vec3d n = cross(c[1] - c[0], c[2] - c[0]), q = x - c[0];
          const double b1 = dot(cross(q, c[2] - c[0]), n) / dot(n, n);
          const double b2 = dot(cross(c[1] - c[0], q), n) / dot(n, n);
          EXPECT_LT(boundary.at(p, face, {1 - b1 - b2, b1, b2}), 1e-12);
          ++candidates;
        }
      }
    }
    for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
      for (uint32_t f = 0; f < scene.shapes[s].mesh.faces.size(); ++f) {
        EXPECT_GT(boundary.at(p, {ShapeId(s), FaceId(f)}, {0.2, 0.3, 0.5}), 0);
      }
    }
  }
  EXPECT_GT(candidates, 1000);
}

// The field goes over into the velocity of an edge on both of its sides.
TEST(WarpField, FollowsEdges) {
  const TempFiles files;
  SceneParts parts;
  parts.body = square("leaf", 0.5, 0, {0, 0, 2}, diffuse("white", "1, 1, 1")) +
               square("wall", 9, 0, {0, 0, -5}, diffuse("stone", "0.5, 0.5, 0.5"));
  const Fields fields(make_scene(files, parts), "leaf.rotate.z", {64, 1e3}, false);
  const SurfacePoint<Dual> from = still_point({0, 0, 4});
  for (const double across : {-1e-7, 1e-7}) {
    // The edge x = 0.5 at y = 0.2, which turns about the middle.
    const Vec3d to{0.5 + across, 0.2, -2};
    const Vec3d w = normalize(to);
    RayCount rays;
    WarpCount count;
    DirectionWarp warp;
    double mean = 0;
    constexpr int kRuns = 50;
    for (int i = 0; i < kRuns; ++i) {
      ASSERT_TRUE(fields.field.at(from, w, Rng(1, i, 0), rays, count, warp));
      mean += lane(warp.velocity, 0).x / kRuns;
    }
    // x moves by -y; as seen from there, with what the projection to w takes of it.
    const Vec3d v = Vec3d{-0.2, 0.5, 0} / length(to);
    const double edge = v.x - w.x * dot(w, v);
    EXPECT_NEAR(mean, edge, 0.01 * std::fabs(edge)) << across;
    EXPECT_EQ(rays.closest, 64u * kRuns);
  }
}

GradientResult run(const Scene& scene, const std::vector<std::string>& parameters,
                   const std::string& method, int spp, const WarpOptions& warp = {},
                   int threads = 2) {
  GradientOptions options;
  options.parameters = parameters;
  options.method = method;
  options.warp = warp;
  return run_blocks(scene, options, spp, 7, threads);
}

Scene gloss_scene(const TempFiles& files, double unit) {
  SceneParts parts;
  parts.unit = unit;
  parts.body =
      square("floor", 2.5 * unit, -90, {0, 0, 0}, conductor("gloss", 0.2)) +
      obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.6 * unit,
                Vec3d{0.2, 1, 0} * unit, diffuse("clay", "0.7, 0.5, 0.3")) +
      square("lamp", 0.5 * unit, 90, Vec3d{0.3, 2.4, 0.5} * unit, area_light("glow", "6, 5, 4")) +
      make_sky(files, "sky");
  return make_scene(files, parts);
}

// Where nothing moves no direction is warped, and the terms are those of any method.
TEST(WarpedArea, HoldsDirectionsWhereNothingMoves) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 1);
  const GradientResult plain = run(scene, {"gloss.alpha"}, "forest", 8);
  const GradientResult warped = run(scene, {"gloss.alpha"}, "was", 8);
  const size_t term = plain.term("interior");
  EXPECT_EQ(warped.terms[term].cost.warped, 0u);
  EXPECT_EQ(warped.terms[term].cost.rays, plain.terms[term].cost.rays);
  for (size_t i = 0; i < plain.radiance.size(); ++i) {
    EXPECT_EQ(plain.radiance.mean(i), warped.radiance.mean(i));
    EXPECT_EQ(plain.parameters[0].terms[term].mean(i), warped.parameters[0].terms[term].mean(i));
  }
}

TEST(WarpedArea, HasTheSameBitsOnAnyThreads) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 1);
  for (const char* method : {"was", "was:bias=off"}) {
    const GradientResult one = run(scene, {"ball.translate.x"}, method, 2, {}, 1);
    const GradientResult three = run(scene, {"ball.translate.x"}, method, 2, {}, 3);
    for (size_t i = 0; i < one.radiance.size(); ++i) {
      EXPECT_EQ(one.parameters[0].total.mean(i), three.parameters[0].total.mean(i));
    }
  }
}

// With another unit of length, a power of two, the same random numbers make the same bits.
TEST(WarpedArea, HasNoUnitOfLength) {
  const TempFiles files;
  const auto of = [&](double unit) {
    return run(gloss_scene(files, unit), {"ball.translate.x"}, "was", 4).parameters[0].total;
  };
  const Moments plain = of(1);
  for (const double unit : {0x1p-10, 0x1p10}) {
    const Moments scaled = of(unit);
    for (size_t i = 0; i < plain.size(); ++i) EXPECT_EQ(scaled.mean(i) * unit, plain.mean(i));
  }
}

struct ClosedForm {
  Scene scene;
  std::vector<double> exact;

  ClosedForm(const std::string& file, const std::string& parameter) {
    const std::string folder = std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/";
    scene = read_scene(folder + file, {}, nullptr);
    std::ifstream stream(folder + "references.json");
    const nlohmann::json references = nlohmann::json::parse(stream);
    for (const auto& s : references["scenes"]) {
      if (s["file"] != file) continue;
      for (const auto& p : s["parameters"]) {
        if (p["name"] == parameter) exact = p["total"].get<std::vector<double>>();
      }
    }
  }
};

// A lamp of two triangles, whose corners all lie on outlines. With few rays the result is wrong,
// and scores see it; with more it comes to the exact one.
TEST(WarpedArea, BiasFallsWithRays) {
  const std::string parameter = "lamp.translate.x";
  const ClosedForm form("lamp_over_plane.xml", parameter);
  const double exact = std::accumulate(form.exact.begin(), form.exact.end(), 0.0);
  std::vector<double> biases, errors;
  for (const int rays : {8, 32, 128}) {
    const Moments sum =
        run(form.scene, {parameter}, "was", 1024, {rays, 1e4}).parameters[0].image_sum;
    biases.push_back(sum.mean(0) - exact);
    errors.push_back(std::sqrt(sum.variance(0)));
    fmt::print("{:3} rays: {:.4f} +- {:.4f} of {:.4f} too much\n", rays, biases.back(),
               errors.back(), exact);
    EXPECT_GT(biases.back(), 5 * errors.back());
  }
  // By less than 1 / N, since the kernel diverges at edges; by more than if B vanished on faces,
  // where the bias would stay.
  for (size_t i = 1; i < biases.size(); ++i) {
    EXPECT_LT(biases[i] + 5 * errors[i], biases[i - 1]);
  }
  EXPECT_LT(biases[2] + 5 * errors[2], 0.25 * exact);
}

TEST(WarpedArea, BadOptionsAreRefused) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 1);
  for (const WarpOptions& options :
       {WarpOptions{7, 1e4}, WarpOptions{0, 1e4}, WarpOptions{8, 0.5}, WarpOptions{8, NAN}}) {
    EXPECT_THROW(run(scene, {"ball.translate.x"}, "was", 1, options), InputError);
  }
}

}  // namespace
}  // namespace limn
