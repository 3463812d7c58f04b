// Measures edge samplers, all rows of their table: hit rate (the share of draws that end on an edge
// of E(p)), cost of a draw, time of the build. One table to standard output; seeds are fixed.
//   edge_benchmark MESH.obj|MESH.ply ... [--only SAMPLER ...]
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/core/error.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/mesh.h"
#include "limn/core/parallel.h"
#include "limn/core/ray_tracer.h"
#include "limn/edgetree/contribution_bound.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/edgetree/rejection.h"

namespace limn {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The time of one thread, so that other work on the machine hardly counts.
class Stopwatch {
 public:
  double seconds() const { return static_cast<double>(std::clock() - start_) / CLOCKS_PER_SEC; }

 private:
  std::clock_t start_ = std::clock();
};

Mesh smoothed(Mesh mesh) {
  mesh.normal_source = NormalSource::kComputed;
  update_shading_normals(mesh);
  return mesh;
}

// Points around the mesh that look at it from all sides and move.
std::vector<EdgeQuery> queries_with(const EdgeMesh& mesh, const LobeSummary& lobe) {
  Rng rng(1, 1, 0);
  std::vector<EdgeQuery> queries = queries_around(mesh, 500, 1);
  for (EdgeQuery& q : queries) {
    do q.wi = random_direction(rng);
    while (dot(q.wi, q.n) < 0.2);
    q.lobe = lobe;
  }
  return queries;
}

struct Draws {
  double hit_rate = 0, nanoseconds = 0;
};
// repeat: draws of each query.
Draws measure_draws(const EdgeSampler& sampler, const std::vector<EdgeQuery>& queries, int repeat) {
  uint64_t hits = 0;
  Rng rng(2, 0, 0);
  const Stopwatch watch;
  for (int k = 0; k < repeat; ++k)
    for (const EdgeQuery& q : queries) hits += sampler.sample(q, rng).has_value();
  const double draws = static_cast<double>(queries.size()) * repeat;
  return {static_cast<double>(hits) / draws, watch.seconds() * 1e9 / draws};
}

// (sum b)^2 / sum of b^2 / P, b the bound of an edge's contribution: 1 if edges are drawn in
// proportion to it, the inverse of the number of draws that one ideal draw is worth. Mean over
// queries of the numerator over that of the denominator.
double efficiency(const EdgeSampler& sampler, const EdgeMesh& mesh,
                  const std::vector<EdgeQuery>& queries) {
  double squares = 0, seconds = 0;
  for (const EdgeQuery& q : queries) {
    const LobeBound lobe(q.n, q.wi, q.lobe);
    double sum = 0, second = 0;
    for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
      if (!is_candidate(mesh, EdgeId(e), q.p)) continue;
      const double b = EdgeBound(lobe, segment_of(mesh, EdgeId(e), q)).total();
      if (!(b > 0)) continue;
      sum += b;
      second += b * b / sampler.probability(q, {ShapeId(0), EdgeId(e)});
    }
    squares += sum * sum;
    seconds += second;
  }
  return squares / seconds;
}

// Rejection tests (of nodes and of edges) to find all of E(p), over its size; 0 without a tree.
double tests_per_silhouette(const EdgeSamplerInput& input, const EdgeSampler& sampler,
                            const std::vector<EdgeQuery>& queries) {
  const auto tree = sampler.rejection_tree();
  if (!tree) return 0;
  const ReachCounts counts = count_reach(input, *tree, queries, 2);
  uint64_t tests = 0;
  for (const DepthCounts& depth : counts.by_depth) tests += depth.tested;
  return static_cast<double>(tests) / static_cast<double>(counts.silhouettes);
}

double ray_nanoseconds(const Mesh& mesh) {
  Scene scene;
  scene.shapes.resize(1);
  scene.shapes[0].mesh = mesh;
  scene.shapes[0].bsdf = make_diffuse(Rgb<double>{0.5, 0.5, 0.5});
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

// A row of the table while it is measured.
struct Row {
  EdgeSamplerType type;
  std::unique_ptr<EdgeSampler> sampler = nullptr;
  double build[2] = {};  // [ms], on one and two threads
  Draws draws = {}, glossy = {};
};

void build(std::vector<Row>& rows, const EdgeSamplerInput& input) {
  for (Row& row : rows)
    for (int threads = 1; threads <= 2; ++threads) {
      const auto start = Clock::now();
      row.sampler = row.type.make(input, threads);
      row.build[threads - 1] = seconds_since(start) * 1e3;
    }
}

// All rows in turn: what else the machine does then hits all alike. The least time of each counts.
void measure_draws(std::vector<Row>& rows, const std::vector<EdgeQuery>& queries,
                   const std::vector<EdgeQuery>& glossy) {
  constexpr int kRounds = 5;
  for (int round = 0; round < kRounds; ++round) {
    for (Row& row : rows) {
      // Slow ones draw less often.
      const EdgeSampler& sampler = *row.sampler;
      const double count = 1000.0 / kRounds / (sampler.query_cost() + sampler.draw_cost());
      const int repeat = static_cast<int>(std::clamp(count, 1.0, 40.0));
      const auto take = [&](const std::vector<EdgeQuery>& from, Draws& best) {
        const Draws draws = measure_draws(sampler, from, repeat);
        if (round == 0 || draws.nanoseconds < best.nanoseconds) best = draws;
      };
      take(queries, row.draws);
      take(glossy, row.glossy);
    }
  }
}

void print_draws(const std::vector<Row>& rows, const EdgeSamplerInput& input,
                 const std::vector<EdgeQuery>& queries, const std::vector<EdgeQuery>& glossy) {
  const EdgeMesh& edges = input.objects[0];
  const char* head = "  {:<34} {:>8} {:>8} {:>6} {:>6} {:>6} {:>6} {:>8} {:>8} {:>8}\n";
  fmt::print(fmt::runtime(head), "sampler", "build 1", "build 2", "B/edge", "hits", "effic.",
             "tests/", "draw", "glossy", "glossy");
  fmt::print(fmt::runtime(head), "", "[ms]", "[ms]", "", "", "", "silh.", "[ns]", "[ns]", "effic.");
  for (const Row& row : rows) {
    const EdgeSampler& sampler = *row.sampler;
    fmt::print("  {:<34} {:8.1f} {:8.1f} {:6.2f} {:6.3f} {:6.3f} {:6.2f} {:8.0f} {:8.0f} {:8.3f}\n",
               row.type.name, row.build[0], row.build[1],
               static_cast<double>(sampler.size().bytes) / static_cast<double>(edges.edges.size()),
               row.draws.hit_rate, efficiency(sampler, edges, queries),
               tests_per_silhouette(input, sampler, queries), row.draws.nanoseconds,
               row.glossy.nanoseconds, efficiency(sampler, edges, glossy));
  }
}

void measure(const std::string& name, const Mesh& mesh, std::span<const EdgeSamplerType> types) {
  EdgeSamplerInput input;
  input.objects.push_back(build_edge_mesh(mesh, true));
  const EdgeMesh& edges = input.objects[0];
  const double count = static_cast<double>(edges.edges.size());
  const auto concave = std::count_if(edges.edges.begin(), edges.edges.end(),
                                     [](const Edge& edge) { return edge.concave; });
  fmt::print("{}: {} edges, {:.0f} % concave, {}; a ray takes {:.0f} ns\n", name, count,
             100 * static_cast<double>(concave) / count,
             edges.one_sided_closed ? "closed" : "not closed", ray_nanoseconds(mesh));
  std::vector<Row> rows;
  for (const EdgeSamplerType& type : types) rows.push_back({type});
  build(rows, input);
  const auto queries = queries_with(edges, {});
  const auto glossy = queries_with(edges, {ggx_lobe(), 0.1, 1});
  measure_draws(rows, queries, glossy);
  print_draws(rows, input, queries, glossy);
}

}  // namespace
}  // namespace limn

int main(int argc, char** argv) try {
  using namespace limn;
  std::vector<std::string> files;
  std::vector<EdgeSamplerType> rows;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--only" && i + 1 < argc)
      rows.push_back(edge_sampler_type(argv[++i]));
    else
      files.push_back(word);
  }
  if (files.empty()) throw InputError("needs a mesh");
  if (rows.empty()) rows.assign(edge_sampler_types().begin(), edge_sampler_types().end());
  for (const std::string& file : files)
    measure(file.substr(file.find_last_of('/') + 1), smoothed(read_mesh(file, false)), rows);
} catch (const std::exception& error) {
  fmt::print(stderr, "edge_benchmark: {}\n", error.what());
  return 2;
}
