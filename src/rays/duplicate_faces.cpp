// Finds duplicate faces by hashing their corners.
#include "limn/core/duplicate_faces.h"

#include <algorithm>
#include <bit>
#include <map>
#include <tuple>

#include "limn/core/rng.h"

namespace limn {
namespace {

using Corners = std::array<Vec3f, 3>;

// Corners in the face's order, starting with the least.
Corners corners_of(const Scene& scene, FaceRef ref) {
  const Mesh& mesh = scene.shape(ref.shape).mesh;
  const FaceIndices& face = mesh.face(ref.face);
  Corners corners;
  for (int k = 0; k < 3; ++k) {
    const Vec3f& x = mesh.positions[face[k]];
    corners[k] = {x.x + 0.0f, x.y + 0.0f, x.z + 0.0f};  // -0 is 0
  }
  const auto before = [](const Vec3f& a, const Vec3f& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  };
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end(), before),
              corners.end());
  return corners;
}

bool wind_alike(const Corners& a, const Corners& b) { return a == b; }
bool wind_opposite(const Corners& a, const Corners& b) {
  return a[0] == b[0] && a[1] == b[2] && a[2] == b[1];
}

// A hash that is independent of the order of corners.
uint64_t number_of(const Corners& corners) {
  uint64_t sum = 0;
  for (const Vec3f& x : corners) {
    uint64_t number = std::bit_cast<uint32_t>(x.x);
    number = mix_bits(number << 32 | std::bit_cast<uint32_t>(x.y));
    sum += mix_bits(number + std::bit_cast<uint32_t>(x.z));
  }
  return sum;
}

bool faces(const Scene& scene, FaceRef ref, const Vec3d& direction) {
  const Mesh& mesh = scene.shape(ref.shape).mesh;
  const FaceIndices& face = mesh.face(ref.face);
  const Vec3d a = cast<double>(mesh.positions[face[0]]);
  const Vec3d n =
      cross(cast<double>(mesh.positions[face[1]]) - a, cast<double>(mesh.positions[face[2]]) - a);
  return dot(n, direction) < 0;
}

auto place(FaceRef face) { return std::pair(face.shape, face.face); }

}  // namespace

bool are_duplicates(const Scene& scene, FaceRef a, FaceRef b) {
  const Corners ca = corners_of(scene, a), cb = corners_of(scene, b);
  return wind_alike(ca, cb) || wind_opposite(ca, cb);
}

bool is_hit_first(const Scene& scene, FaceRef a, FaceRef b, const Vec3d& direction) {
  const bool faces_a = faces(scene, a, direction), faces_b = faces(scene, b, direction);
  if (faces_a != faces_b) return faces_a;
  const bool shines_a = scene.shape(a.shape).is_emitter, shines_b = scene.shape(b.shape).is_emitter;
  if (shines_a != shines_b) return shines_a;
  return place(a) < place(b);
}

DuplicateFaces::DuplicateFaces(const Scene& scene) : scene_(scene) {
  std::vector<std::pair<uint64_t, FaceRef>> numbers;
  size_t count = 0;
  for (const Shape& shape : scene.shapes) count += shape.mesh.faces.size();
  numbers.reserve(count);
  // Most hashes are unique in their low bits, which bit sets detect without sorting.
  std::vector<bool> met(16 * std::bit_ceil(count)), met_again(met.size());
  const auto bits = [&](uint64_t number) { return number & (met.size() - 1); };
  for (uint32_t s = 0; s < scene.shapes.size(); ++s)
    for (uint32_t f = 0; f < scene.shapes[s].mesh.faces.size(); ++f) {
      const FaceRef face{ShapeId(s), FaceId(f)};
      const uint64_t number = number_of(corners_of(scene, face));
      (met[bits(number)] ? met_again : met)[bits(number)] = true;
      numbers.push_back({number, face});
    }
  std::erase_if(numbers, [&](const auto& one) { return !met_again[bits(one.first)]; });
  std::sort(numbers.begin(), numbers.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first, place(a.second)) < std::pair(b.first, place(b.second));
  });
  for (size_t begin = 0, end; begin < numbers.size(); begin = end) {
    end = begin + 1;
    while (end < numbers.size() && numbers[end].first == numbers[begin].first) ++end;
    if (end == begin + 1) continue;
    std::vector<FaceRef> set;  // duplicates among faces of equal hash
    for (size_t i = begin; i < end; ++i)
      if (are_duplicates(scene, numbers[begin].second, numbers[i].second))
        set.push_back(numbers[i].second);
    if (set.size() < 2) continue;
    for (const FaceRef face : set) set_of_face_[key(face)] = sets_.size();
    sets_.push_back(std::move(set));
  }
}

std::optional<FaceRef> DuplicateFaces::met(FaceRef face, const Vec3d& direction,
                                           bool skip_emitters) const {
  const auto skipped = [&](FaceRef f) { return skip_emitters && scene_.shape(f.shape).is_emitter; };
  const std::vector<FaceRef>* set = set_of(face);
  if (!set) return skipped(face) ? std::nullopt : std::optional(face);
  std::optional<FaceRef> best;
  for (const FaceRef f : *set)
    if (!skipped(f) && (!best || is_hit_first(scene_, f, *best, direction))) best = f;
  return best;
}

std::string quoted_name(const Scene& scene, ShapeId shape) {
  const std::string& id = scene.shape(shape).id;
  return id.empty() ? "shape " + std::to_string(shape.index()) : "\"" + id + "\"";
}

void warn_of_duplicates(const Scene& scene, const DuplicateFaces& copies,
                        std::vector<std::string>& warnings) {
  std::map<std::pair<ShapeId, ShapeId>, int> counts;
  for (const auto& set : copies.sets())
    for (size_t i = 0; i < set.size(); ++i)
      for (size_t j = 0; j < i; ++j) {
        if (set[i].shape == set[j].shape) continue;
        if (wind_alike(corners_of(scene, set[i]), corners_of(scene, set[j])))
          ++counts[{set[j].shape, set[i].shape}];
      }
  const auto name = [&](ShapeId id) { return quoted_name(scene, id); };
  for (const auto& [shapes, count] : counts) {
    warnings.push_back(format_warning(scene.shape(shapes.second).where,
                                      std::to_string(count) + " faces of " + name(shapes.second) +
                                          " coincide with faces of " + name(shapes.first) +
                                          ": those of an emitter are visible, else those of " +
                                          name(shapes.first) +
                                          "; if one of the two moves alone the image is not "
                                          "differentiable, and the derivative is one-sided"));
  }
}

}  // namespace limn
