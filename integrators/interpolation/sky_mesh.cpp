// Faces cut into triangles until the sky of their vertices stands for that between.
#include "integrators/interpolation/sky_mesh.h"

#include <algorithm>
#include <cmath>

#include "limn/core/parallel.h"
#include "limn/core/rng.h"

namespace limn {
namespace {

// Vertices lie this part of the way from their place on a flat face to its center, where nothing
// that touches the face's border touches them. Not tuned.
constexpr double kInward = 1e-3;

// The triangle of a face's grid with this number, row by row, as corners (i, j).
std::array<std::array<int, 2>, 3> cell_corners(int i, int j, bool upper) {
  if (!upper) return {{{i, j}, {i + 1, j}, {i, j + 1}}};
  return {{{i + 1, j + 1}, {i, j + 1}, {i + 1, j}}};
}

}  // namespace

void view_of(const SkyPolygons& sky, const Vec3d& p, DirectionLoops& loops) {
  loops.clear();
  look_at(sky.corners, p, loops.directions);
  loops.starts = sky.starts;
}

size_t SkyMesh::HashKey::operator()(const Key& key) const {
  return mix_bits(mix_bits(mix_bits(key[0]) + key[1]) + key[2]);
}

SkyMesh::SkyMesh(const Scene& scene, const Contours& contours, std::span<const SeenSide> sides,
                 const SkyMeshOptions& options)
    : scene_(scene), contours_(contours) {
  refine(sides, options);
  triples_ = find_correspondence(skies_, patches_, options.triples);
}

SkyMesh::Vertex SkyMesh::vertex_at(const SeenSide& side, const std::array<double, 2>& b) const {
  const Mesh& mesh = scene_.shape(side.face.shape).mesh;
  const auto c = face_corners<double>(mesh, side.face.face);
  const Vec3d p = c[0] + (c[1] - c[0]) * b[0] + (c[2] - c[0]) * b[1];
  const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0])) * (side.front ? 1 : -1);
  const auto surface = surface_on_ray<double>(scene_, side.face, p + n * length(c[1] - c[0]), -n);
  const Vec3d n_s = surface.n_s * (side.front ? 1 : -1);
  return {contours_.at(surface, is_lifted(scene_, side.face.shape) ? n_s : n), n_s};
}

// Shared by all faces that have it in common.
uint32_t SkyMesh::vertex(const SeenSide& side, int i, int j, int cells) {
  std::array<double, 2> b{static_cast<double>(i) / cells, static_cast<double>(j) / cells};
  if (!is_lifted(scene_, side.face.shape)) {
    for (double& x : b) x += kInward * (1.0 / 3 - x);
  }
  const Vertex vertex = vertex_at(side, b);
  std::array<float, 6> key;
  for (int k = 0; k < 3; ++k) {
    key[k] = static_cast<float>(vertex.at.p[k]);
    key[3 + k] = static_cast<float>(std::round(vertex.at.up[k] * 1e5));
  }
  const auto [found, fresh] = known_.try_emplace(key, static_cast<uint32_t>(vertices_.size()));
  if (fresh) vertices_.push_back(vertex);
  return found->second;
}

void SkyMesh::bake(int threads) {
  const size_t first = skies_.size();
  skies_.resize(vertices_.size());
  parallel_for(skies_.size() - first, threads, [&](size_t i) {
    skies_[first + i] = find_sky_polygons(contours_, vertices_[first + i].at);
  });
}

bool SkyMesh::is_close(const SkyPatch& patch, const Vertex& center, double tolerance) const {
  DirectionLoops loops;
  const auto open = [&](const SkyPolygons& sky) {
    view_of(sky, center.at.p, loops);
    return dot(center.n, mean_direction(loops)) / kPi;
  };
  double mean = 0;
  for (const uint32_t v : patch.vertices) mean += open(skies_[v]) / 3;
  return std::fabs(open(find_sky_polygons(contours_, center.at)) - mean) <= tolerance;
}

void SkyMesh::refine(std::span<const SeenSide> sides, const SkyMeshOptions& options) {
  std::vector<SeenSide> rest(sides.begin(), sides.end());
  for (int level = 0; !rest.empty(); ++level) {
    const int cells = 1 << level;
    std::vector<std::vector<SkyPatch>> patches(rest.size());
    std::vector<std::vector<Origin>> origins(rest.size());
    for (size_t s = 0; s < rest.size(); ++s) {
      for (int i = 0; i < cells; ++i) {
        for (int j = 0; i + j < cells; ++j) {
          for (const bool upper : {false, true}) {
            if (upper && i + j + 2 > cells) continue;
            SkyPatch patch;
            Origin origin{rest[s], {}};
            const auto corners = cell_corners(i, j, upper);
            for (int k = 0; k < 3; ++k) {
              const auto [x, y] = corners[k];
              patch.vertices[k] = vertex(rest[s], x, y, cells);
              origin.b[k] = {static_cast<double>(x) / cells, static_cast<double>(y) / cells};
              patch.center += vertices_[patch.vertices[k]].at.p * (1.0 / 3);
            }
            patches[s].push_back(patch);
            origins[s].push_back(origin);
          }
        }
      }
    }
    bake(options.triples.threads);
    std::vector<size_t> failed(rest.size());
    parallel_for(options.tolerance > 0 ? rest.size() : 0, options.triples.threads, [&](size_t s) {
      for (size_t i = 0; i < patches[s].size(); ++i) {
        std::array<double, 2> b{};
        for (const auto& corner : origins[s][i].b) b[0] += corner[0] / 3, b[1] += corner[1] / 3;
        failed[s] += !is_close(patches[s][i], vertex_at(rest[s], b), options.tolerance);
        if (failed[s] > 0 && level < options.most_halvings) return;
      }
    });
    std::vector<SeenSide> next;
    for (size_t s = 0; s < rest.size(); ++s) {
      if (failed[s] > 0 && level < options.most_halvings) {
        next.push_back(rest[s]);
        continue;
      }
      coarse_ += failed[s];
      grids_[rest[s].key()] = {cells, static_cast<uint32_t>(patches_.size())};
      patches_.insert(patches_.end(), patches[s].begin(), patches[s].end());
      origins_.insert(origins_.end(), origins[s].begin(), origins[s].end());
    }
    rest = std::move(next);
  }
}

void SkyMesh::outline(const Spot& spot, const Vec3d& p, DirectionLoops& loops) const {
  static thread_local std::vector<Vec3d> seen;
  seen.clear();
  for (const uint32_t v : patches_[spot.patch].vertices) look_at(skies_[v].corners, p, seen);
  const SkyTriples& triples = triples_[spot.patch];
  loops.clear();
  loops.starts = triples.starts;
  const auto& [a, b, c] = spot.weights;
  for (const auto& triple : triples.triples) {
    const Vec3d w = seen[triple[0]] * a + seen[triple[1]] * b + seen[triple[2]] * c;
    const double size = length(w);
    loops.directions.push_back(size > 0 ? w / size : seen[triple[0]]);
  }
}

std::optional<SkyMesh::Spot> SkyMesh::find(const SeenSide& side,
                                           const std::array<double, 2>& b) const {
  const auto found = grids_.find(side.key());
  if (found == grids_.end()) return std::nullopt;
  const int cells = found->second.cells;
  std::array<double, 2> inner = b;
  if (!is_lifted(scene_, side.face.shape)) {
    for (double& x : inner) x = (x - kInward / 3) / (1 - kInward);
  }
  const double x = std::clamp(inner[0], 0.0, 1.0) * cells;
  const double y = std::clamp(inner[1], 0.0, 1.0) * cells;
  const int i = std::min(static_cast<int>(x), cells - 1);
  const int j = std::min(static_cast<int>(y), cells - 1 - i);
  const double u = x - i, v = y - j;
  const bool upper = u + v > 1 && i + j + 2 <= cells;
  // Triangles of the rows before, two for each cell but one for the last of a row.
  const int before = i * (2 * cells - i), in_row = 2 * j + upper;
  Spot spot{found->second.first + static_cast<uint32_t>(before + in_row), {1 - u - v, u, v}};
  if (upper) spot.weights = {u + v - 1, 1 - u, 1 - v};
  return spot;
}

}  // namespace limn
