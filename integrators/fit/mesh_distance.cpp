// Distances between surfaces, faces turned inside out, crossings.
#include "limn/integrators/mesh_distance.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "integrators/fit/surface_tree.h"
#include "limn/core/parallel.h"
#include "limn/core/rng.h"
#include "limn/edgetree/crossing_curves.h"

namespace limn {

namespace {

Vec3d unit_normal(const Mesh& mesh, uint32_t face) {
  const auto c = corners_of(mesh, face);
  return normalize(cross(c[1] - c[0], c[2] - c[0]));
}

struct SurfacePoint {
  Vec3d p;
  uint32_t face = 0;
};

// One point in each of as many parts of equal area.
std::vector<SurfacePoint> points_on(const Mesh& mesh, const std::vector<uint32_t>& faces,
                                    size_t samples, uint64_t seed) {
  std::vector<double> sums;
  double sum = 0;
  for (const uint32_t f : faces) {
    const auto c = corners_of(mesh, f);
    sums.push_back(sum += length(cross(c[1] - c[0], c[2] - c[0])));
  }
  std::vector<SurfacePoint> points;
  for (size_t i = 0; i < samples; ++i) {
    Rng rng(seed, i, 0);
    const double at = (static_cast<double>(i) + rng.uniform()) / static_cast<double>(samples) * sum;
    const auto found = std::upper_bound(sums.begin(), sums.end(), at);
    const uint32_t face = faces[std::min<size_t>(found - sums.begin(), faces.size() - 1)];
    const auto c = corners_of(mesh, face);
    const double r = std::sqrt(rng.uniform()), s = rng.uniform();
    points.push_back({c[0] * (1 - r) + c[1] * (r * (1 - s)) + c[2] * (r * s), face});
  }
  return points;
}

struct Surface {
  const Mesh& mesh;
  SurfaceTree tree{mesh};
};

// Of points on one surface to the other.
MeshDistance one_way(const Surface& from, const Surface& to, size_t samples, uint64_t seed,
                     int threads) {
  const auto points = points_on(from.mesh, from.tree.faces(), samples, seed);
  std::vector<double> distances(samples), angles(samples);
  parallel_for(samples, threads, [&](size_t i) {
    const SurfaceTree::Nearest nearest = to.tree.nearest(points[i].p);
    const Vec3d a = unit_normal(from.mesh, points[i].face);
    const Vec3d b = unit_normal(to.mesh, static_cast<uint32_t>(nearest.face.index()));
    distances[i] = nearest.distance;
    angles[i] = std::atan2(length(cross(a, b)), dot(a, b));
  });
  MeshDistance result;
  for (size_t i = 0; i < samples; ++i) {
    result.chamfer += distances[i] / static_cast<double>(samples);
    result.normal_angle += angles[i] / static_cast<double>(samples);
  }
  std::sort(distances.begin(), distances.end());
  result.hausdorff_95 = distances[static_cast<size_t>(0.95 * static_cast<double>(samples - 1))];
  result.hausdorff = distances.back();
  return result;
}

// Every side of a face is that of another one, in the other direction, as often.
bool is_closed(const Mesh& mesh) {
  std::map<std::pair<uint32_t, uint32_t>, int> sides;
  for (const FaceIndices& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = mesh.weld[face[k]], b = mesh.weld[face[(k + 1) % 3]];
      a < b ? ++sides[{a, b}] : --sides[{b, a}];
    }
  }
  return std::all_of(sides.begin(), sides.end(), [](const auto& side) { return side.second == 0; });
}

}  // namespace

MeshDistance mesh_distance(const Mesh& mesh, const Mesh& truth, size_t samples, uint64_t seed,
                           int threads) {
  const Surface found{mesh}, wanted{truth};
  const MeshDistance a = one_way(found, wanted, samples, seed, threads);
  const MeshDistance b = one_way(wanted, found, samples, seed + 1, threads);
  return {0.5 * (a.chamfer + b.chamfer), std::max(a.hausdorff_95, b.hausdorff_95),
          std::max(a.hausdorff, b.hausdorff), 0.5 * (a.normal_angle + b.normal_angle)};
}

std::optional<size_t> count_inside_out(const Mesh& mesh, int threads) {
  if (!is_closed(mesh)) return std::nullopt;
  const SurfaceTree tree(mesh);
  std::vector<uint8_t> wrong(tree.faces().size());
  parallel_for(wrong.size(), threads, [&](size_t i) {
    const uint32_t face = tree.faces()[i];
    const auto c = corners_of(mesh, face);
    // Off the normal, so that rays of regular meshes meet no edge.
    const Vec3d direction = unit_normal(mesh, face) + Vec3d{0.0917, -0.0553, 0.0731};
    wrong[i] = tree.crossings((c[0] + c[1] + c[2]) / 3.0, direction, FaceId(face)) != 0;
  });
  return std::count(wrong.begin(), wrong.end(), 1);
}

size_t count_crossings(const Mesh& mesh, int threads) {
  const Mesh* meshes[] = {&mesh};
  const auto pairs = find_face_pairs(meshes, bounds_of(mesh).center(), threads);
  return find_intersections(meshes, pairs, threads).size();
}

}  // namespace limn
