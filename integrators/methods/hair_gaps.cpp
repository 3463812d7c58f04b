// Gaps between shapes, and within one, from a tree over the boxes of their faces.
#include "integrators/methods/hair_gaps.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <map>
#include <mutex>
#include <numeric>
#include <optional>

#include "limn/core/box_tree.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/parallel.h"
#include "limn/core/touch.h"

namespace limn {
namespace {

using Corners = std::array<Vec3d, 3>;

// Of an edge, what runs along a face at least. Not tuned.
constexpr double kLeastPart = 1.0 / 16;
// Faces with a longest side below this many widths of such a gap are passed over: their gap is no
// longer than wide. Not tuned.
constexpr double kLeastSide = 16;
// Within one shape a gap is reported where it is this long [pixels]: creases of scanned meshes,
// whose edges are shorter, would be reported in most of them. Not tuned.
constexpr double kLeastLength = 1;
// Of the tree, that one thread takes at a time. Not tuned.
constexpr size_t kLeaves = 256;

struct Gap {
  double pixels;
  double width;  // scene units
  auto operator<=>(const Gap&) const = default;
};
// The narrowest of each pair of shapes, or of one with itself.
using Gaps = std::map<std::pair<ShapeId, ShapeId>, Gap>;

void keep_narrowest(Gaps& gaps, const std::pair<ShapeId, ShapeId>& shapes, const Gap& gap) {
  const auto [found, is_new] = gaps.insert({shapes, gap});
  if (!is_new) found->second = std::min(found->second, gap);
}

// Which faces of a mesh belong to a part of its surface that is closed: every side of a face is
// that of another one, the other way round.
std::vector<bool> closed_faces(const Mesh& mesh) {
  struct Side {
    uint32_t from, to;
    auto operator<=>(const Side&) const = default;
  };
  std::vector<uint32_t> part(mesh.positions.size());  // a forest over welded vertices
  std::iota(part.begin(), part.end(), 0u);
  const auto root = [&](uint32_t v) {
    while (part[v] != v) v = part[v] = part[part[v]];
    return v;
  };
  std::vector<Side> sides, others;
  for (const FaceIndices& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = mesh.weld[face[k]], b = mesh.weld[face[(k + 1) % 3]];
      sides.push_back({a, b});
      others.push_back({b, a});
      part[root(a)] = root(b);
    }
  }
  std::sort(sides.begin(), sides.end());
  std::sort(others.begin(), others.end());
  std::vector<Side> open;
  std::set_symmetric_difference(sides.begin(), sides.end(), others.begin(), others.end(),
                                std::back_inserter(open));
  std::vector<bool> is_open(part.size());
  for (const Side& side : open) is_open[root(side.from)] = true;
  std::vector<bool> closed;
  for (const FaceIndices& face : mesh.faces) closed.push_back(!is_open[root(mesh.weld[face[0]])]);
  return closed;
}

class GapFinder {
 public:
  GapFinder(const Scene& scene, double spp, int threads)
      : scene_(scene),
        eye_(value(scene.camera.origin)),
        spp_(spp),
        once_(scene.shapes.size()),
        closed_(scene.shapes.size()) {
    const Camera& camera = scene.camera;
    pixel_ = camera.is_orthographic()
                 ? 2 * camera.half_width / camera.width
                 : 2 * camera.x_factor * std::tan(value(camera.fov) * M_PI / 360) / camera.width;
    for (uint32_t s = 0; s < scene.shapes.size(); ++s)
      for (uint32_t f = 0; f < scene.shapes[s].mesh.faces.size(); ++f)
        add_face({ShapeId(s), FaceId(f)});
    find_pairs(threads);
  }
  const Gaps& gaps() const { return gaps_; }

 private:
  Corners corners_of(FaceRef face) const {
    return face_corners<double>(scene_.shape(face.shape).mesh, face.face);
  }
  double pixel_at(double distance) const {
    return scene_.camera.is_orthographic() ? pixel_ : pixel_ * distance;
  }
  // Of gaps that are met by one sample, with this distance from the camera and this length.
  double widest(double distance, double length) const {
    const double pixel = pixel_at(distance);
    return pixel * pixel / (spp_ * length);
  }
  void add_face(FaceRef face) {
    const Corners c = corners_of(face);
    double farthest = 0, longest = 0;
    for (int k = 0; k < 3; ++k) {
      farthest = std::max(farthest, length(c[k] - eye_));
      longest = std::max(longest, length(c[(k + 1) % 3] - c[k]));
    }
    const double reach = widest(farthest, longest);
    if (!(longest > kLeastSide * reach) || !std::isfinite(longest)) return;
    FloatBox& box = boxes_.emplace_back();
    for (int k = 0; k < 3; ++k) {
      // Twice: a float's rounding is less than the second half, or the gap is none.
      box.lower[k] = static_cast<float>(std::min({c[0][k], c[1][k], c[2][k]}) - 2 * reach);
      box.upper[k] = static_cast<float>(std::max({c[0][k], c[1][k], c[2][k]}) + 2 * reach);
    }
    faces_.push_back(face);
  }

  void find_pairs(int threads) {
    if (faces_.empty()) return;
    const BoxTree tree(boxes_, threads);
    const size_t parts = (tree.leaf_count() + kLeaves - 1) / kLeaves;
    std::mutex merging;
    parallel_for(parts, threads, [&](size_t part) {
      Gaps found;
      const uint32_t first = static_cast<uint32_t>(part * kLeaves);
      const uint32_t last = std::min<uint32_t>(first + kLeaves, tree.leaf_count());
      std::vector<uint32_t> leaves;
      for (uint32_t leaf = first; leaf < last; ++leaf) add_pairs(tree, leaf, leaves, found);
      // The least of all, whatever their order.
      const std::lock_guard lock(merging);
      for (const auto& [shapes, gap] : found) keep_narrowest(gaps_, shapes, gap);
    });
  }

  void add_pairs(const BoxTree& tree, uint32_t leaf, std::vector<uint32_t>& leaves,
                 Gaps& gaps) const {
    tree.find_leaves(tree.leaf_box(leaf), leaf, leaves);
    for (const uint32_t other : leaves) {
      for (const uint32_t i : tree.leaf(leaf)) {
        uint32_t lanes = tree.boxes(other).overlaps(boxes_[i]);
        for (; lanes != 0; lanes &= lanes - 1) {
          const uint32_t j = tree.leaf(other)[std::countr_zero(lanes)];
          if (i == j || are_neighbours(faces_[i], faces_[j])) continue;
          add_gap(faces_[i], faces_[j], gaps);
          if (other != leaf) add_gap(faces_[j], faces_[i], gaps);
        }
      }
    }
  }

  // Whether two faces of one shape share a vertex. Copies of it have several normals or places in a
  // texture.
  bool are_neighbours(FaceRef a, FaceRef b) const {
    if (a.shape != b.shape) return false;
    const Mesh& mesh = scene_.shape(a.shape).mesh;
    const auto& of_b = mesh.face(b.face);
    const auto is_of_b = [&](uint32_t v) {
      return std::any_of(of_b.begin(), of_b.end(),
                         [&](uint32_t w) { return mesh.weld[w] == mesh.weld[v]; });
    };
    return std::any_of(mesh.face(a.face).begin(), mesh.face(a.face).end(), is_of_b);
  }

  bool is_closed(FaceRef face) const {
    const size_t s = face.shape.index();
    std::call_once(once_[s], [&] { closed_[s] = closed_faces(scene_.shape(face.shape).mesh); });
    return closed_[s][face.face.index()];
  }

  // Whether what lies between the edges of one face and another one, of the same shape, is the
  // inside of a body that the first or the other bounds. height: of the edges above the other face.
  bool is_inside(FaceRef of_edges, FaceRef along, double height, double rounding) const {
    const auto normal = [](const Corners& c) { return cross(c[1] - c[0], c[2] - c[0]); };
    const Corners c = corners_of(of_edges);
    const Vec3d n = normal(c), m = normalize(normal(corners_of(along)));
    double longest = 0;
    for (int k = 0; k < 3; ++k) longest = std::max(longest, length(c[(k + 1) % 3] - c[k]));
    // Of the faces around an edge one at least looks towards what is in front of it. One that looks
    // along the other face does not: rounding tilts it by so much over its width.
    const bool looks_there = dot(n, m) * (height > 0 ? -1 : 1) > rounding * longest;
    return (height < 0 && is_closed(along)) || (!looks_there && is_closed(of_edges));
  }

  // Of the edges of a face along the other one.
  void add_gap(FaceRef of_edges, FaceRef along, Gaps& gaps) const {
    const Corners edges = corners_of(of_edges), face = corners_of(along);
    const double rounding = touch_tolerance(largest_coordinate(edges), largest_coordinate(face));
    const bool within = of_edges.shape == along.shape;
    for (int k = 0; k < 3; ++k) {
      const auto gap = gap_along(edges[k], edges[(k + 1) % 3], face, rounding, within);
      if (!gap) continue;
      if (within &&
          (gap->length < kLeastLength || is_inside(of_edges, along, gap->height, rounding))) {
        continue;
      }
      keep_narrowest(gaps, std::minmax(of_edges.shape, along.shape),
                     {gap->pixels, std::fabs(gap->height)});
    }
  }

  struct Beside {
    double pixels;
    double height;  // of the segment above the face; below zero behind it
    double length;  // of what they share [pixels]
  };
  // Between the segment and the face that lies beside it, in the middle of what they share. Within
  // one shape the segment lies above or below the face itself: what runs along it a little farther
  // out may be the next but one of a fine surface.
  std::optional<Beside> gap_along(const Vec3d& a, const Vec3d& b, const Corners& face,
                                  double rounding, bool within) const {
    const Vec3d normal = cross(face[1] - face[0], face[2] - face[0]);
    const double area = length(normal);
    if (!(area > 0)) return std::nullopt;
    const Vec3d n = normal / area;
    const double reach = widest(std::max(length(a - eye_), length(b - eye_)), length(b - a));
    double from = 0, to = 1;
    // What lies where value0 + t (value1 - value0) is at least `least`.
    const auto clip = [&](double value0, double value1, double least) {
      const double d0 = value0 - least, d1 = value1 - least;
      if (d0 < 0 && d1 < 0) to = -1;
      if (d0 < 0 && d1 >= 0) from = std::max(from, d0 / (d0 - d1));
      if (d0 >= 0 && d1 < 0) to = std::min(to, d0 / (d0 - d1));
    };
    const double height0 = dot(n, a - face[0]), height1 = dot(n, b - face[0]);
    clip(height0, height1, -reach);
    clip(-height0, -height1, -reach);
    for (int k = 0; k < 3; ++k) {
      const Vec3d side = face[(k + 1) % 3] - face[k];
      const Vec3d inward = cross(n, side) / length(side);
      clip(dot(inward, a - face[k]), dot(inward, b - face[k]), within ? 0 : -reach);
    }
    if (to - from < kLeastPart) return std::nullopt;
    const double middle = 0.5 * (from + to);
    const double height = height0 + middle * (height1 - height0);
    // Where they part from a common corner, some of it is within rounding, and the rest is wider;
    // where one passes through the other there is none.
    const double first = height0 + from * (height1 - height0);
    const double last = height0 + to * (height1 - height0);
    if (first * last <= 0 || std::min(std::fabs(first), std::fabs(last)) <= rounding)
      return std::nullopt;
    const double pixel = pixel_at(length(a + middle * (b - a) - eye_));
    return Beside{std::fabs(height) / pixel, height, (to - from) * length(b - a) / pixel};
  }

  const Scene& scene_;
  Vec3d eye_;
  double spp_;
  double pixel_ = 0;  // of the film, at a distance of 1; of parallel rays at any
  std::vector<FaceRef> faces_;
  std::vector<FloatBox> boxes_;
  // Of each shape that closed_faces() was called for.
  mutable std::vector<std::once_flag> once_;
  mutable std::vector<std::vector<bool>> closed_;
  Gaps gaps_;
};

}  // namespace

void warn_of_hair_gaps(const Scene& scene, double spp, int threads,
                       std::vector<std::string>& warnings) {
  if (!(spp >= 1)) return;
  const GapFinder finder(scene, spp, threads);
  constexpr size_t kMost = 8;
  size_t reported = 0;
  for (const auto& [shapes, gap] : finder.gaps()) {
    if (++reported > kMost) break;
    warnings.push_back(fmt::format(
        "{} a gap of {:.2g} between {}, {:.2g} of a pixel, which {:.0f} samples per pixel can "
        "miss: derivatives there may be off by more than their errors say; close the gap, or take "
        "many more samples",
        shapes.first == shapes.second ? quoted_name(scene, shapes.first) + " has"
                                      : quoted_name(scene, shapes.first) + " and " +
                                            quoted_name(scene, shapes.second) + " have",
        gap.width, shapes.first == shapes.second ? "its own faces" : "them", gap.pixels, spp));
  }
  if (finder.gaps().size() > kMost) {
    warnings.push_back(
        fmt::format("{} more pairs of shapes have such gaps", finder.gaps().size() - kMost));
  }
}

}  // namespace limn
