#pragma once
// Duplicate faces: faces with the same three corners, in one shape or in several, of either
// winding.
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

// True if two faces have the same three corners.
bool are_duplicates(const Scene& scene, FaceRef a, FaceRef b);

// True if a ray along `direction` hits `a` rather than its duplicate `b`: a front face wins over a
// back face, then an emitter over a non-emitter, then the earlier face in the file.
bool is_hit_first(const Scene& scene, FaceRef a, FaceRef b, const Vec3d& direction);

// All sets of duplicate faces of a scene.
class DuplicateFaces {
 public:
  explicit DuplicateFaces(const Scene& scene);

  bool empty() const { return sets_.empty(); }
  const std::vector<std::vector<FaceRef>>& sets() const {
    return sets_;
  }  // each in the file's order
  // The representative of a face's duplicates: the first in the file. A unique face is its own.
  FaceRef first(FaceRef face) const {
    const std::vector<FaceRef>* set = set_of(face);
    return set ? set->front() : face;
  }
  // The duplicate that a ray hits; nothing if emitters are skipped and all duplicates are emitters.
  std::optional<FaceRef> met(FaceRef face, const Vec3d& direction, bool skip_emitters) const;

 private:
  static uint64_t key(FaceRef face) {
    return uint64_t{face.shape.index()} << 32 | face.face.index();
  }
  const std::vector<FaceRef>* set_of(FaceRef face) const {
    const auto found = set_of_face_.find(key(face));
    return found == set_of_face_.end() ? nullptr : &sets_[found->second];
  }

  const Scene& scene_;
  std::vector<std::vector<FaceRef>> sets_;
  std::unordered_map<uint64_t, size_t> set_of_face_;
};

// One warning for each pair of shapes with duplicate faces of equal winding.
void warn_of_duplicates(const Scene& scene, const DuplicateFaces& copies,
                        std::vector<std::string>& warnings);
// The shape's id in quotes, or its number.
std::string quoted_name(const Scene& scene, ShapeId shape);

}  // namespace limn
