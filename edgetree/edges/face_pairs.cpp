// Finds pairs of nearby faces by a tree over bounding boxes.
#include "limn/edgetree/face_pairs.h"

#include <algorithm>
#include <cmath>

#include "edgetree/edges/contacts.h"
#include "edgetree/edges/half_edges.h"
#include "limn/core/box_tree.h"
#include "limn/core/parallel.h"
#include "limn/core/rng.h"

namespace limn {
namespace {

using Corners = std::array<Vec3d, 3>;
constexpr uint32_t kNone = UINT32_MAX;

double longest_side(const Corners& c) {
  return std::sqrt(std::max(
      {length_squared(c[1] - c[0]), length_squared(c[2] - c[1]), length_squared(c[0] - c[2])}));
}

double blur_of(const Corners& corners, const Vec3d& viewer) {
  double squared = 0;
  for (const Vec3d& x : corners) squared = std::max(squared, length_squared(x - viewer));
  return 0x1.0p-20 * std::max(largest_coordinate(corners), std::sqrt(squared));
}

// A point near to both long sides exists, at the middle of the face.
bool is_needle(double width, double blur) { return !(width > 16 * blur); }

// Largest distance of an edge that counts as near to a face.
double reach_of(double longest_side, double blur) {
  return std::min(blur, kMostNear * longest_side);
}

// V: true if the faces around a vertex form one closed fan that covers directions once, seen along
// their mean normal, and none of them is a sliver.
class SingleFans {
 public:
  // ids: vertex ids; normals, needles: of faces
  SingleFans(const Mesh& mesh, const std::vector<VertexId>& ids, std::span<const Vec3d> normals,
             const std::vector<bool>& needles)
      : fans_(mesh.positions.size()) {
    for (size_t f = 0; f < mesh.faces.size(); ++f)
      for (const uint32_t v : mesh.faces[f]) fans_[ids[v].index()].axis += normals[f];
    for (size_t f = 0; f < mesh.faces.size(); ++f) {
      for (int k = 0; k < 3; ++k) {
        const auto id = [&](int corner) { return ids[mesh.faces[f][corner % 3]].index(); };
        const auto at = [&](int corner) { return cast<double>(mesh.positions[id(corner)]); };
        Fan& fan = fans_[id(k)];
        // A closed fan: the second corners of its faces are a permutation of the third corners.
        fan.open += mix_bits(id(k + 1) + 1) - mix_bits(id(k + 2) + 1);
        const double steep = dot(normals[f], fan.axis);
        // Steep faces are excluded: the two sides of a thin blade may be near to each other.
        fan.bad |= needles[f] || !(steep > 0) ||
                   steep * steep * 256 < length_squared(normals[f]) * length_squared(fan.axis);
        const Vec3d across = fan.across();
        const double before = dot(at(k + 1) - at(k), across),
                     after = dot(at(k + 2) - at(k), across);
        fan.covers = static_cast<uint8_t>(std::min(fan.covers + (before >= 0 && after < 0), 2));
      }
    }
  }
  bool is_single(VertexId id) const {
    const Fan& fan = fans_[id.index()];
    return fan.covers == 1 && !fan.bad && fan.open == 0;
  }

 private:
  struct Fan {
    Vec3d axis;
    uint64_t open = 0;
    uint8_t covers = 0;
    bool bad = false;
    // A rotation around the axis passes a half-plane where the product with this vector changes its
    // sign, and the opposite one where it changes back.
    Vec3d across() const {
      return std::fabs(axis.x) < std::fabs(axis.y) ? Vec3d{0, axis.z, -axis.y}
                                                   : Vec3d{-axis.z, 0, axis.x};
    }
  };
  std::vector<Fan> fans_;
};

// Corners of a leaf's faces with single fans, as global numbers; else kNone.
struct LeafFans {
  uint32_t corners[3][BoxTree::kLeaf];

  // Bit i: face i of the leaf has one of these corners.
  uint32_t share(const FaceIndices& other) const {
    uint32_t same[BoxTree::kLeaf] = {};
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j)
        for (uint32_t lane = 0; lane < BoxTree::kLeaf; ++lane)
          same[lane] |= uint32_t{corners[j][lane] == other[k]} & uint32_t{other[k] != kNone};
    uint32_t bits = 0;
    for (uint32_t lane = 0; lane < BoxTree::kLeaf; ++lane) bits |= same[lane] << lane;
    return bits;
  }
};

class PairFinder {
 public:
  PairFinder(std::span<const Mesh* const> meshes, const Vec3d& viewer, int threads)
      : meshes_(meshes), viewer_(viewer), threads_(threads) {
    size_t count = 0;
    for (const Mesh* mesh : meshes) count += mesh->faces.size();
    faces_.reserve(count), boxes_.reserve(count), fans_.reserve(count);
    uint32_t first_vertex = 0;
    for (uint32_t s = 0; s < meshes.size(); ++s) {
      add_mesh(*meshes[s], ShapeId(s), first_vertex);
      first_vertex += static_cast<uint32_t>(meshes[s]->positions.size());
    }
  }

  std::vector<FacePair> find() const {
    const BoxTree tree(boxes_, threads_, [&](uint32_t i) {
      const FaceRef face = faces_[i];
      const Corners c = face_corners<double>(*meshes_[face.shape.index()], face.face);
      return std::pair(c, 2 * margin_of(c));
    });
    std::vector<LeafFans> fans(tree.leaf_count());
    for (uint32_t leaf = 0; leaf < tree.leaf_count(); ++leaf)
      for (size_t i = 0; i < tree.leaf(leaf).size(); ++i)
        for (int k = 0; k < 3; ++k) fans[leaf].corners[k][i] = fans_[tree.leaf(leaf)[i]][k];
    return tree.find_pairs<FacePair>(
        threads_, [&](uint32_t i, uint32_t leaf) { return fans[leaf].share(fans_[i]); },
        [&](uint32_t i, uint32_t j, std::vector<FacePair>& pairs) {
          pairs.push_back({faces_[i], faces_[j]});
        });
  }

 private:
  void add_mesh(const Mesh& mesh, ShapeId shape, uint32_t first_vertex) {
    const auto count = static_cast<uint32_t>(mesh.faces.size());
    std::vector<Vec3d> normals(count);
    std::vector<bool> needles(count);
    for (uint32_t f = 0; f < count; ++f) {
      const Corners c = face_corners<double>(mesh, FaceId(f));
      normals[f] = cross(c[1] - c[0], c[2] - c[0]);
      needles[f] = is_needle(length(normals[f]) / longest_side(c), blur_of(c, viewer_));
      add_box(c, margin_of(c));
      faces_.push_back({shape, FaceId(f)});
    }
    const std::vector<VertexId> ids = edge_vertex_ids(mesh);
    const SingleFans fans(mesh, ids, normals, needles);
    for (const FaceIndices& face : mesh.faces) {
      FaceIndices& single = fans_.emplace_back();
      for (int k = 0; k < 3; ++k) {
        const VertexId id = ids[face[k]];
        single[k] = fans.is_single(id) ? first_vertex + id.index() : kNone;
      }
    }
  }

  double margin_of(const Corners& c) const {
    return std::max(reach_of(longest_side(c), blur_of(c, viewer_)),
                    touch_tolerance(largest_coordinate(c), 0));
  }
  // Enlarged by twice the margin, which covers its own rounding to floats.
  void add_box(const Corners& c, double margin) {
    FloatBox& box = boxes_.emplace_back();
    for (int k = 0; k < 3; ++k) {
      box.lower[k] = static_cast<float>(std::min({c[0][k], c[1][k], c[2][k]}) - 2 * margin);
      box.upper[k] = static_cast<float>(std::max({c[0][k], c[1][k], c[2][k]}) + 2 * margin);
    }
  }

  std::span<const Mesh* const> meshes_;
  Vec3d viewer_;
  int threads_;
  std::vector<FaceRef> faces_;     // of all meshes
  std::vector<FloatBox> boxes_;    // boxes of the faces
  std::vector<FaceIndices> fans_;  // see LeafFans
};

}  // namespace

std::vector<FacePair> find_face_pairs(std::span<const Mesh* const> meshes, const Vec3d& viewer,
                                      int threads) {
  return PairFinder(meshes, viewer, threads).find();
}

double size_of(const Mesh& mesh, FaceId face) {
  return largest_coordinate(face_corners<double>(mesh, face));
}

double width_of(const Mesh& mesh, FaceId face) {
  const Corners c = face_corners<double>(mesh, face);
  return length(cross(c[1] - c[0], c[2] - c[0])) / longest_side(c);
}

double blur_of(const Mesh& mesh, FaceId face, const Vec3d& viewer) {
  return blur_of(face_corners<double>(mesh, face), viewer);
}

double reach_of(const Mesh& mesh, FaceId face, const Vec3d& viewer) {
  const Corners c = face_corners<double>(mesh, face);
  return reach_of(longest_side(c), blur_of(c, viewer));
}

bool is_needle(const Mesh& mesh, FaceId face, const Vec3d& viewer) {
  return is_needle(width_of(mesh, face), blur_of(mesh, face, viewer));
}

}  // namespace limn
