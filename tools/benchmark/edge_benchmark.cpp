// Measures the edge forest: hit rates, costs and build times over meshes and variants. One table to
// standard output; seeds are fixed.
//   edge_benchmark [MESH.obj|MESH.ply ...]
// Without meshes: tori of 1k to 1M edges.
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

#include "limn/core/mesh.h"
#include "limn/core/parallel.h"
#include "limn/core/ray_tracer.h"
#include "limn/edgetree/contribution_bound.h"
#include "limn/edgetree/edge_forest.h"

namespace limn {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Of one thread, so that other work on the machine hardly counts.
class Stopwatch {
 public:
  double seconds() const { return static_cast<double>(std::clock() - start_) / CLOCKS_PER_SEC; }

 private:
  std::clock_t start_ = std::clock();
};

struct Variant {
  std::string name;
  ForestConfig config;
};
std::vector<Variant> variants() {
  std::vector<Variant> list{{"forest", {}}};
  const auto add = [&](const std::string& name, bool ForestConfig::*option) {
    ForestConfig config;
    config.*option = false;
    list.push_back({name, config});
  };
  add("arbitrary axes", &ForestConfig::principal_axes);
  add("no soft weights", &ForestConfig::soft_weights);
  add("no concave culling", &ForestConfig::cull_concave);
  const auto add_choice = [&](const std::string& name, uint32_t width, int look_ahead) {
    ForestConfig config;
    config.width = width;
    config.look_ahead = look_ahead;
    list.push_back({name, config});
  };
  add_choice("edges ahead", 8, 0);
  add_choice("none ahead", 8, -1);
  add_choice("all ahead", 8, ForestConfig::kAnyHeight);
  add_choice("4-wide", 4, -1);
  add_choice("4-wide, all ahead", 4, ForestConfig::kAnyHeight);
  add_choice("2-wide", 2, -1);
  ForestConfig config;
  config.look_ahead = -1;
  config.principal_axes = config.soft_weights = false;
  list.push_back({"boxes alone", config});
  return list;
}

// A torus with bumps, about 6 tube^2 edges.
Mesh bumpy_torus(int tube) {
  Mesh mesh;
  const int around = 2 * tube;
  const auto id = [&](int i, int j) {
    return static_cast<uint32_t>((i % around) * tube + j % tube);
  };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < tube; ++j) {
      const double u = 2 * kPi * i / around, v = 2 * kPi * j / tube;
      const double small = 0.4 + 0.03 * std::sin(7 * u) * std::cos(5 * v);
      const double r = 1 + small * std::cos(v);
      mesh.positions.push_back(
          cast<float>(Vec3d{r * std::cos(u), r * std::sin(u), small * std::sin(v)}));
      mesh.faces.push_back({id(i, j), id(i + 1, j), id(i + 1, j + 1)});
      mesh.faces.push_back({id(i, j), id(i + 1, j + 1), id(i, j + 1)});
    }
  weld_positions(mesh);
  return mesh;
}

Mesh smoothed(Mesh mesh) {
  mesh.normal_source = NormalSource::kComputed;
  update_shading_normals(mesh);
  return mesh;
}

Vec3d random_direction(Rng& rng) {
  const double z = 2 * rng.uniform() - 1, phi = 2 * kPi * rng.uniform();
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

// Points at 1.5 times the bounding radius that look at the mesh and move.
std::vector<EdgeQuery> queries_around(const Mesh& mesh, int count, const LobeSummary& lobe) {
  Rng rng(1, 0, 0);
  const Bounds bounds = bounds_of(mesh);
  double radius = 0;
  for (const Vec3f& x : mesh.positions)
    radius = std::max(radius, length(cast<double>(x) - bounds.center()));
  std::vector<EdgeQuery> queries;
  for (int i = 0; i < count; ++i) {
    const Vec3d d = random_direction(rng);
    EdgeQuery q;
    q.p = bounds.center() + d * (1.5 * radius);
    q.n = -d;
    do q.wi = random_direction(rng);
    while (dot(q.wi, q.n) < 0.2);
    q.lobe = lobe;
    const Vec3d v = random_direction(rng);
    for (int k = 0; k < 3; ++k) q.velocity[k][0] = v[k];
    queries.push_back(q);
  }
  return queries;
}

struct Draws {
  double hit_rate = 0, nanoseconds = 0;
};
Draws measure_draws(const EdgeForest& forest, const std::vector<EdgeQuery>& queries, int repeat) {
  uint64_t hits = 0;
  Rng rng(2, 0, 0);
  const Stopwatch watch;
  for (int k = 0; k < repeat; ++k)
    for (const EdgeQuery& q : queries) {
      EdgeSample sample;
      hits += forest.sample(q, rng, sample);
    }
  const double draws = static_cast<double>(queries.size()) * repeat;
  return {static_cast<double>(hits) / draws, watch.seconds() * 1e9 / draws};
}

// (sum b)^2 / sum of b^2 / P, b the bound of an edge's contribution: 1 if edges are drawn in
// proportion to it, the inverse of the number of draws that one ideal draw is worth. Mean over
// queries of the numerator over that of the denominator.
double efficiency(const EdgeForest& forest, const EdgeMesh& mesh,
                  const std::vector<EdgeQuery>& queries) {
  double squares = 0, seconds = 0;
  for (const EdgeQuery& q : queries) {
    std::vector<EdgeId> edges;
    forest.list_silhouettes(q.p, edges);
    const LobeBound lobe(q.n, q.wi, q.lobe);
    double sum = 0, second = 0;
    for (EdgeId id : edges) {
      const double b = EdgeBound(lobe, segment_of(mesh, id.edge, q)).total();
      if (!(b > 0)) continue;
      sum += b;
      second += b * b / forest.probability(q, id);
    }
    squares += sum * sum;
    seconds += second;
  }
  return squares / seconds;
}

double nodes_per_silhouette(const EdgeForest& forest, const std::vector<EdgeQuery>& queries) {
  uint64_t nodes = 0, found = 0;
  for (const EdgeQuery& q : queries) {
    std::vector<EdgeId> edges;
    nodes += forest.list_silhouettes(q.p, edges);
    found += edges.size();
  }
  return static_cast<double>(nodes) / static_cast<double>(found);
}

double ray_nanoseconds(const Mesh& mesh) {
  Scene scene;
  scene.shapes.resize(1);
  scene.shapes[0].mesh = mesh;
  scene.shapes[0].bsdf = make_diffuse({0.5, 0.5, 0.5});
  const auto tracer = make_embree_tracer(scene, 1);
  Rng rng(3, 0, 0);
  const Bounds bounds = bounds_of(mesh);
  std::vector<Ray> rays(200000);
  for (Ray& ray : rays) {
    ray.origin = bounds.center() + random_direction(rng) * (0.75 * bounds.diagonal());
    const Vec3d target = bounds.center() + random_direction(rng) * (0.25 * bounds.diagonal());
    ray.direction = normalize(target - ray.origin);
  }
  Hit hit;
  uint64_t hits = 0;
  const Stopwatch watch;
  for (const Ray& ray : rays) hits += tracer->closest(ray, hit);
  const double time = watch.seconds();
  return hits > 0 ? time * 1e9 / static_cast<double>(rays.size()) : 0;
}

void measure(const std::string& name, const Mesh& mesh, bool all_variants) {
  EdgeSamplerInput input;
  input.objects.push_back(build_edge_mesh(mesh, true));
  const EdgeMesh& edges = input.objects[0];
  const double count = static_cast<double>(edges.edges.size());
  const auto concave = std::count_if(edges.edges.begin(), edges.edges.end(),
                                     [](const Edge& edge) { return edge.concave; });
  fmt::print("{}: {} edges, {:.0f} % concave, {}; a ray takes {:.0f} ns\n", name, count,
             100 * static_cast<double>(concave) / count,
             edges.one_sided_closed ? "closed" : "not closed", ray_nanoseconds(mesh));
  fmt::print("  {:<20} {:>8} {:>8} {:>6} {:>6} {:>6} {:>6} {:>8} {:>8} {:>8}\n", "variant",
             "build 1", "build 2", "B/edge", "hits", "effic.", "nodes/", "draw", "glossy",
             "glossy");
  fmt::print("  {:<20} {:>8} {:>8} {:>6} {:>6} {:>6} {:>6} {:>8} {:>8} {:>8}\n", "", "[ms]", "[ms]",
             "", "", "", "silh.", "[ns]", "[ns]", "effic.");
  const auto queries = queries_around(mesh, 500, {LobeSummary::Kind::kDiffuse, 1, 0.8});
  const auto glossy = queries_around(mesh, 500, {LobeSummary::Kind::kGgx, 0.1, 0.8});
  for (const Variant& variant : variants()) {
    double build[2];
    for (int threads = 1; threads <= 2; ++threads) {
      const auto start = Clock::now();
      EdgeForest::build(input, threads, variant.config);
      build[threads - 1] = seconds_since(start) * 1e3;
    }
    const auto forest = EdgeForest::build(input, 2, variant.config);
    const Draws draws = measure_draws(*forest, queries, 200);
    const Draws glossy_draws = measure_draws(*forest, glossy, 200);
    fmt::print("  {:<20} {:8.1f} {:8.1f} {:6.0f} {:6.3f} {:6.3f} {:6.2f} {:8.0f} {:8.0f} {:8.3f}\n",
               variant.name, build[0], build[1], static_cast<double>(forest->bytes()) / count,
               draws.hit_rate, efficiency(*forest, edges, queries),
               nodes_per_silhouette(*forest, queries), draws.nanoseconds, glossy_draws.nanoseconds,
               efficiency(*forest, edges, glossy));
    if (!all_variants) break;
  }
}

}  // namespace
}  // namespace limn

int main(int argc, char** argv) {
  using namespace limn;
  for (int i = 1; i < argc; ++i) {
    const std::string file = argv[i];
    measure(file.substr(file.find_last_of('/') + 1), smoothed(read_mesh(file, false)), true);
  }
  if (argc > 1) return 0;
  for (int tube : {13, 41, 129, 408})
    measure(fmt::format("torus {}", tube), smoothed(bumpy_torus(tube)), false);
}
