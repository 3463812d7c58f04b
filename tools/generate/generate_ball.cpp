// A sphere of few faces, all nearly alike.
#include <cmath>
#include <map>

#include "tools/generate/generate_kinds.h"

namespace limn {
namespace {

// An icosahedron whose sides are cut into `count` pieces, its faces into count^2.
Triangles geodesic(int count) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  const Vec3d corners[] = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                           {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                           {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  const FaceIndices faces[] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                               {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                               {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                               {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  Triangles mesh;
  // By how much each corner weighs in it: shared along the sides of faces.
  std::map<std::map<uint32_t, int>, uint32_t> known;
  const auto vertex = [&](const FaceIndices& face, int i, int k) {
    std::map<uint32_t, int> weights;
    const int of_corners[] = {count - i - k, i, k};
    Vec3d p;
    for (int c = 0; c < 3; ++c) {
      if (of_corners[c] == 0) continue;
      weights[face[c]] = of_corners[c];
      p += corners[face[c]] * of_corners[c];
    }
    const auto [place, is_new] =
        known.emplace(weights, static_cast<uint32_t>(mesh.positions.size()));
    if (is_new) mesh.positions.push_back(normalize(p));
    return place->second;
  };
  for (const FaceIndices& face : faces) {
    for (int i = 0; i < count; ++i) {
      for (int k = 0; i + k < count; ++k) {
        mesh.faces.push_back({vertex(face, i, k), vertex(face, i + 1, k), vertex(face, i, k + 1)});
        if (i + k + 1 == count) continue;
        mesh.faces.push_back(
            {vertex(face, i + 1, k), vertex(face, i + 1, k + 1), vertex(face, i, k + 1)});
      }
    }
  }
  return mesh;
}

}  // namespace

Triangles make_ball(int faces) {
  return geodesic(static_cast<int>(std::lround(std::sqrt(faces / 20.0))));
}

}  // namespace limn
