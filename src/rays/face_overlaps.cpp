// Finds coplanar and near faces by a tree over bounding boxes and separating lines within the
// plane.
#include "limn/core/face_overlaps.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "limn/core/box_tree.h"
#include "limn/core/parallel.h"
#include "limn/core/touch.h"

namespace limn {
namespace {

using Corners = std::array<Vec3d, 3>;
using FacePair = std::pair<FaceRef, FaceRef>;

auto place(FaceRef face) { return std::pair(face.shape, face.face); }

Corners corners_of(const Scene& scene, FaceRef ref) {
  return face_corners<double>(scene.shape(ref.shape).mesh, ref.face);
}

Vec3d normal_of(const Corners& c) { return cross(c[1] - c[0], c[2] - c[0]); }

bool lies_in_plane(const Corners& corners, const Vec3d& x, const Vec3d& n, double tolerance) {
  return std::all_of(corners.begin(), corners.end(), [&](const Vec3d& corner) {
    return std::fabs(dot(n, corner - x)) <= tolerance;
  });
}

// True if a side of `a` separates `b` from it, up to `tolerance`.
bool lies_beside(const Corners& a, const Vec3d& n, const Corners& b, double tolerance) {
  for (int k = 0; k < 3; ++k) {
    const Vec3d inward = normalize(cross(n, a[(k + 1) % 3] - a[k]));
    const auto is_out = [&](const Vec3d& x) { return dot(inward, x - a[k]) <= tolerance; };
    if (std::all_of(b.begin(), b.end(), is_out)) return true;
  }
  return false;
}

// The distance to the triangle, its boundary included: the volumes spanned by its sides and the
// direction have equal signs.
std::optional<double> meet(const Corners& corners, const Ray& ray) {
  const Vec3d a = corners[0] - ray.origin, b = corners[1] - ray.origin, c = corners[2] - ray.origin;
  const Vec3d& d = ray.direction;
  const double u = dot(cross(b, c), d), v = dot(cross(c, a), d), w = dot(cross(a, b), d);
  const bool left = u >= 0 && v >= 0 && w >= 0, right = u <= 0 && v <= 0 && w <= 0;
  const Vec3d n = normal_of(corners);
  const double slope = dot(n, d);
  if (!(left || right) || slope == 0) return std::nullopt;
  return dot(n, a) / slope;
}

double longest_side(const Corners& c) {
  return std::max({length(c[1] - c[0]), length(c[2] - c[1]), length(c[0] - c[2])});
}

// Distance at which rays from the viewer may miss points of a face: twice 2^-20 of the viewer's
// distance, for 16 roundings of origin, direction and their products.
double blur_of(const Corners& corners, const Vec3d& viewer) {
  double distance = largest_coordinate(corners);
  for (const Vec3d& x : corners) distance = std::max(distance, length(x - viewer));
  return 0x1p-19 * distance;
}
// Limit on the distance of near faces, as a share of a face's longest side. Not tuned: faces
// farther apart are no thin layer.
constexpr double kMostNear = 0x1p-8;

// Twice the rounding of positions, which covers the rounding of boxes to floats, and `reach`.
double margin_of(double size, double reach) { return 2 * touch_tolerance(size, 0) + reach; }

// A box enlarged by the margin.
FloatBox box_around(const Vec3d& lower, const Vec3d& upper, double size, double reach) {
  const double margin = margin_of(size, reach);
  FloatBox box;
  for (int k = 0; k < 3; ++k) {
    box.lower[k] = static_cast<float>(lower[k] - margin);
    box.upper[k] = static_cast<float>(upper[k] + margin);
  }
  return box;
}

FloatBox box_of(const Corners& c, double reach) {
  Bounds bounds;
  for (const Vec3d& x : c) bounds.extend(x);
  return box_around(bounds.lower, bounds.upper, largest_coordinate(c), reach);
}

FloatBox box_of(const Mesh& mesh) {
  const Bounds bounds = bounds_of(mesh);
  return box_around(bounds.lower, bounds.upper,
                    largest_coordinate(std::array{bounds.lower, bounds.upper}), 0);
}

// The boxes of a scene's shapes.
class ShapeBoxes {
 public:
  ShapeBoxes(const Scene& scene, int threads) : boxes_(all(scene)), tree_(boxes_, threads) {}

  // Replaces `others` by those that overlap the box of `shape`, but for its own.
  void find_others(ShapeId shape, std::vector<FloatBox>& others) const {
    const FloatBox& own = boxes_[shape.index()];
    others.clear();
    std::vector<uint32_t> leaves;
    tree_.find_leaves(own, 0, leaves);
    for (const uint32_t leaf : leaves) {
      for (uint32_t bits = tree_.boxes(leaf).overlaps(own); bits != 0; bits &= bits - 1) {
        const uint32_t other = tree_.leaf(leaf)[static_cast<size_t>(std::countr_zero(bits))];
        if (other != shape.index()) others.push_back(boxes_[other]);
      }
    }
  }

 private:
  static std::vector<FloatBox> all(const Scene& scene) {
    std::vector<FloatBox> boxes;
    for (const Shape& shape : scene.shapes) boxes.push_back(box_of(shape.mesh));
    return boxes;
  }

  std::vector<FloatBox> boxes_;
  BoxTree tree_;
};

struct FoundPair {
  FacePair faces;
  bool near = false;  // near, not coplanar
};

class OverlapFinder {
 public:
  OverlapFinder(const Scene& scene, const DuplicateFaces& copies, FaceOverlaps::Of of,
                int threads) {
    const bool all = of == FaceOverlaps::Of::kAllFaces;
    std::optional<ShapeBoxes> shapes;
    if (all) {
      reserve(scene);
    } else {
      shapes.emplace(scene, threads);
    }
    std::vector<FloatBox> others;
    for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
      if (!all) {
        shapes->find_others(ShapeId(s), others);
        if (others.empty()) continue;
      }
      const Mesh& mesh = scene.shapes[s].mesh;
      for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
        const FaceRef face{ShapeId(s), FaceId(f)};
        const Corners corners = corners_of(scene, face);
        const double blur = all ? blur_of(corners, value(scene.camera.origin)) : 0;
        const double most = kMostNear * longest_side(corners);
        const FloatBox box = box_of(corners, std::min(blur, most));
        const auto meets = [&](const FloatBox& other) { return other.overlaps(box); };
        if (!all && std::none_of(others.begin(), others.end(), meets)) continue;
        if (copies.first(face) != face || !has_area(mesh, mesh.faces[f])) continue;
        faces_.push_back({face, corners, normalize(normal_of(corners)), blur, most,
                          largest_coordinate(corners)});
        boxes_.push_back(box);
      }
    }
  }

  std::vector<FoundPair> find(int threads) {
    const auto inside = [&](uint32_t i) {
      const Face& face = faces_[i];
      return std::pair(face.corners, margin_of(face.size, std::min(face.blur, face.most)));
    };
    return BoxTree(boxes_, threads, inside)
        .find_pairs<FoundPair>(
            threads, [](uint32_t, uint32_t) { return 0u; },
            [&](uint32_t i, uint32_t j, std::vector<FoundPair>& pairs) {
              const Relation relation = relation_of(faces_[i], faces_[j]);
              if (relation == Relation::kApart) return;
              pairs.push_back({{faces_[i].ref, faces_[j].ref}, relation == Relation::kNear});
              check_count(++count_);
            });
  }

 private:
  enum class Relation { kApart, kCoplanar, kNear };
  // A face with nonzero area.
  struct Face {
    FaceRef ref;
    Corners corners;
    Vec3d normal;             // unit
    double blur, most, size;  // most: largest distance of near faces; size: see touch_tolerance
  };

  void reserve(const Scene& scene) {
    size_t count = 0;
    for (const Shape& shape : scene.shapes) count += shape.mesh.faces.size();
    faces_.reserve(count);
    boxes_.reserve(count);
  }

  static Relation relation_of(const Face& a, const Face& b) {
    const double tolerance = touch_tolerance(a.size, b.size);
    const double reach = std::min({std::max(a.blur, b.blur), a.most, b.most});
    const auto in_plane = [](const Face& face, const Face& other, double distance) {
      return lies_in_plane(other.corners, face.corners[0], face.normal, distance);
    };
    const double near = std::max(reach, tolerance);
    if (!in_plane(a, b, near) && !in_plane(b, a, near)) return Relation::kApart;
    const double most = kShortestTouch * tolerance;
    if (lies_beside(a.corners, a.normal, b.corners, most) ||
        lies_beside(b.corners, b.normal, a.corners, most))
      return Relation::kApart;
    if (in_plane(a, b, tolerance) && in_plane(b, a, tolerance)) return Relation::kCoplanar;
    return reach > 0 ? Relation::kNear : Relation::kApart;
  }

  static void check_count(size_t count) {
    if (count <= FaceOverlaps::kMostPairs) return;
    throw InputError("more than " + std::to_string(FaceOverlaps::kMostPairs) +
                     " pairs of faces overlap in a plane, which is the limit: are shapes in the "
                     "scene more than once?");
  }

  std::vector<Face> faces_;      // in file order
  std::vector<FloatBox> boxes_;  // boxes of the faces
  std::atomic<size_t> count_{0};
};

}  // namespace

FaceOverlaps::FaceOverlaps(const Scene& scene, const DuplicateFaces& copies, int threads, Of of)
    : scene_(&scene), copies_(&copies) {
  size_t faces = 0;
  for (const Shape& shape : scene.shapes) {
    first_numbers_.push_back(faces);
    faces += shape.mesh.faces.size();
  }
  has_others_.resize((faces + 63) / 64);
  std::vector<FoundPair> pairs = OverlapFinder(scene, copies, of, threads).find(threads);
  const size_t count = pairs.size();
  pairs.reserve(2 * count);
  for (size_t i = 0; i < count; ++i)
    pairs.push_back({{pairs[i].faces.second, pairs[i].faces.first}, pairs[i].near});
  std::sort(pairs.begin(), pairs.end(), [](const FoundPair& a, const FoundPair& b) {
    const auto order = [](const FoundPair& pair) {
      return std::tuple(place(pair.faces.first), pair.near, place(pair.faces.second));
    };
    return order(a) < order(b);
  });
  const auto mark = [&](FaceRef face) {
    const size_t i = number(face);
    has_others_[i / 64] |= uint64_t{1} << i % 64;
  };
  for (const FoundPair& pair : pairs) mark(pair.faces.first);
  for (const std::vector<FaceRef>& alike : copies.sets()) {
    if (has_others(alike.front())) std::for_each(alike.begin(), alike.end(), mark);
  }
  size_t marked = 0;
  for (const uint64_t word : has_others_) {
    before_.push_back(marked);
    marked += static_cast<size_t>(std::popcount(word));
  }
  ranges_.resize(marked);
  others_.reserve(pairs.size());
  for (const FoundPair& pair : pairs) {
    Range& range = ranges_[range_of(pair.faces.first)];
    if (range.end == 0) range = {others_.size(), others_.size(), 0};
    others_.push_back(pair.faces.second);
    range.end = others_.size();
    if (!pair.near) range.near = range.end;
  }
  for (const std::vector<FaceRef>& alike : copies.sets()) {
    if (!has_others(alike.front())) continue;
    for (const FaceRef copy : alike) ranges_[range_of(copy)] = ranges_[range_of(alike.front())];
  }
}

size_t FaceOverlaps::range_of(FaceRef face) const {
  const size_t i = number(face);
  const uint64_t earlier = has_others_[i / 64] & ((uint64_t{1} << i % 64) - 1);
  return before_[i / 64] + static_cast<size_t>(std::popcount(earlier));
}

FaceOverlaps::Found FaceOverlaps::find(FaceRef face) const {
  const auto [begin, near, end] = ranges_[range_of(face)];
  const std::span<const FaceRef> all(others_);
  return {all.subspan(begin, near - begin), all.subspan(near, end - near)};
}

std::vector<FacePair> FaceOverlaps::pairs() const {
  std::vector<FacePair> pairs;
  for (uint32_t s = 0; s < scene_->shapes.size(); ++s) {
    for (uint32_t f = 0; f < scene_->shapes[s].mesh.faces.size(); ++f) {
      const FaceRef face{ShapeId(s), FaceId(f)};
      if (!has_others(face) || copies_->first(face) != face) continue;
      for (const FaceRef other : of(face))
        if (place(face) < place(other)) pairs.push_back({face, other});
    }
  }
  return pairs;
}

bool FaceOverlaps::contains(FaceRef a, FaceRef b) const {
  const auto others = of(a);
  const FaceRef first = copies_->first(b);
  return copies_->first(a) == first ||
         std::find(others.begin(), others.end(), first) != others.end();
}

FaceOverlaps::Set FaceOverlaps::in_place_of(std::span<const FaceRef> faces) const {
  Set set;
  const auto sort = [&] {
    std::sort(set.keys_.begin(), set.keys_.end());
    set.keys_.erase(std::unique(set.keys_.begin(), set.keys_.end()), set.keys_.end());
  };
  for (const FaceRef face : faces) {
    set.keys_.push_back(key(copies_->first(face)));
    for (const FaceRef other : of(face)) set.keys_.push_back(key(other));
  }
  sort();
  std::vector<uint64_t> copies;
  for (const auto& alike : copies_->sets()) {
    if (!set.contains(alike.front())) continue;
    for (const FaceRef face : alike) copies.push_back(key(face));
  }
  set.keys_.insert(set.keys_.end(), copies.begin(), copies.end());
  sort();
  return set;
}

static bool is_skipped(FaceRef face, const Ray& ray) {
  return face == ray.start || face == ray.end ||
         std::find(ray.skip_faces.begin(), ray.skip_faces.end(), face) != ray.skip_faces.end();
}

void FaceOverlaps::settle_in_plane(std::span<const FaceRef> others, const Ray& ray,
                                   Hit& hit) const {
  const auto met = [&](FaceRef face) {
    return copies_->met(face, ray.direction, ray.skip_emitters);
  };
  if (!copies_->empty()) hit.face = met(hit.face).value_or(hit.face);
  for (const FaceRef other : others) {
    const auto face = met(other);
    if (!face || is_skipped(*face, ray)) continue;
    if (!is_hit_first(*scene_, *face, hit.face, ray.direction)) continue;
    if (const auto t = meet(corners_of(*scene_, *face), ray)) hit = {*face, *t};
  }
}

// The closest hit among `faces` between the ray's t_min and `before`.
std::optional<Hit> FaceOverlaps::first_of(std::span<const FaceRef> faces, const Ray& ray,
                                          double before) const {
  std::optional<Hit> first;
  for (const FaceRef one : faces) {
    const auto face = copies_->met(one, ray.direction, ray.skip_emitters);
    if (!face || is_skipped(*face, ray)) continue;
    const auto t = meet(corners_of(*scene_, *face), ray);
    if (t && *t > ray.t_min && *t < (first ? first->t : before)) first = Hit{*face, *t};
  }
  return first;
}

void FaceOverlaps::settle_among(const Ray& ray, Hit& hit) const {
  // A near face in front may itself have near faces in front of it; each is closer than the last.
  std::span<const FaceRef> in_plane, near;
  for (;;) {
    std::tie(in_plane, near) = found_of(hit.face);
    if (near.empty()) break;
    const auto own = meet(corners_of(*scene_, hit.face), ray);
    const auto first = first_of(near, ray, own.value_or(hit.t));
    if (!first) break;
    hit = *first;
  }
  settle_in_plane(in_plane, ray, hit);
}

bool FaceOverlaps::leave_near(const Ray& ray, Hit& hit) const {
  const auto first = first_of(found_of(ray.start).second, ray, hit.t);
  if (!first) return false;
  hit = *first;
  settle_in_plane(of(hit.face), ray, hit);
  return true;
}

bool FaceOverlaps::arrives_hidden(const Ray& ray) const {
  const auto near = found_of(ray.end).second;
  if (near.empty()) return false;
  const auto end = meet(corners_of(*scene_, ray.end), ray);
  return end && first_of(near, ray, *end);
}

bool FaceOverlaps::is_hidden(FaceRef face, const Ray& ray) const {
  Hit hit{face, 0};
  settle_in_plane(of(face), ray, hit);
  return hit.face != face;
}

void warn_of_overlaps(const Scene& scene, std::vector<std::string>& warnings) {
  const DuplicateFaces copies(scene);
  warn_of_duplicates(scene, copies, warnings);
  std::map<std::pair<ShapeId, ShapeId>, int> counts;
  const FaceOverlaps overlaps(scene, copies, thread_count(0), FaceOverlaps::Of::kDifferentShapes);
  for (const auto& [a, b] : overlaps.pairs()) {
    if (a.shape == b.shape) continue;
    if (dot(normal_of(corners_of(scene, a)), normal_of(corners_of(scene, b))) > 0)
      ++counts[{a.shape, b.shape}];
  }
  for (const auto& [shapes, count] : counts) {
    const auto& [a, b] = shapes;
    const bool second = scene.shape(b).is_emitter && !scene.shape(a).is_emitter;
    warnings.push_back(format_warning(
        scene.shape(b).where,
        std::to_string(count) + (count == 1 ? " pair" : " pairs") + " of faces of " +
            quoted_name(scene, a) + " and " + quoted_name(scene, b) +
            " overlap in a plane: those of " + quoted_name(scene, second ? b : a) +
            " are visible there; if one of the two moves out of the plane alone the image is "
            "discontinuous, and no derivative accounts for it"));
  }
}

}  // namespace limn
