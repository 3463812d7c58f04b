#pragma once
// Faces in one place: with the same three corners, in one shape or in several, whichever way they
// wind.
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

// Whether two faces have the same corners.
bool are_copies(const Scene& scene, FaceRef a, FaceRef b);

// Of two copies, whether a ray along `direction` meets `a`: that which faces it, then an emitter,
// then the earlier one of the file.
bool is_met_first(const Scene& scene, FaceRef a, FaceRef b, const Vec3d& direction);

// All copies of a scene, each with its like.
class FaceCopies {
 public:
  explicit FaceCopies(const Scene& scene);

  bool empty() const { return sets_.empty(); }
  const std::vector<std::vector<FaceRef>>& sets() const {
    return sets_;
  }  // each in the file's order
  // The one that stands for a face and its copies: itself if it is alone.
  FaceRef first(FaceRef face) const {
    const std::vector<FaceRef>* set = set_of(face);
    return set ? set->front() : face;
  }
  // Which of them a ray meets; none if emitters are skipped and there are no others.
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

// One warning for every two shapes with copies that wind the same way: two surfaces in one place.
void warn_of_copies(const Scene& scene, const FaceCopies& copies,
                    std::vector<std::string>& warnings);
// The shape's id in quotes, or its number.
std::string name_in_text(const Scene& scene, ShapeId shape);

}  // namespace limn
