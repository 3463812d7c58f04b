#pragma once
// Faces that overlap in a plane: rays in floats meet either of them, so that a rule has to say
// which one is met.
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "limn/core/face_copies.h"
#include "limn/core/ray_tracer.h"

namespace limn {

// Pairs of faces that lie in one plane, to the rounding of positions, and have more of it in common
// than rounding explains.
class FaceOverlaps {
 public:
  enum class Of { kAllFaces, kDifferentShapes };  // whether faces of one shape are looked for
  // copies: of the scene; both must outlive it. Of copies the first alone is looked at. InputError
  // if there are more than kMostPairs.
  FaceOverlaps(const Scene& scene, const FaceCopies& copies, int threads, Of of = Of::kAllFaces);

  static constexpr size_t kMostPairs = 1 << 24;  // 0.7 GB

  bool empty() const { return of_.empty(); }
  // Each once, in the order of the file.
  std::vector<std::pair<FaceRef, FaceRef>> pairs() const;
  // Those that overlap `face`, or the first of its copies; none for no face.
  std::span<const FaceRef> of(FaceRef face) const {
    if (!face.shape.valid() || !overlaps_[face.shape.index()]) return {};
    return found_of(copies_->first(face));
  }
  // Whether two faces lie in one place: copies, too.
  bool contains(FaceRef a, FaceRef b) const;
  // Of the faces in a hit's place, copies among them, that which the ray meets (is_met_first).
  void settle(const Ray& ray, Hit& hit) const;
  // Whether another face is met in the place where the ray would meet `face`.
  bool is_hidden(FaceRef face, const Ray& ray) const;

 private:
  static uint64_t key(FaceRef face) {
    return uint64_t{face.shape.index()} << 32 | face.face.index();
  }
  std::span<const FaceRef> found_of(FaceRef face) const;

  const Scene* scene_;
  const FaceCopies* copies_;
  std::vector<bool> overlaps_;  // shapes: whether a face of theirs is in a pair
  std::vector<FaceRef> others_;
  struct Range {
    size_t begin, end;  // in others_
  };
  std::unordered_map<uint64_t, Range> of_;
};

// One warning for every two shapes that have faces in one place, or in one plane where they
// overlap, which face the same way: two surfaces in one place.
void warn_of_overlaps(const Scene& scene, std::vector<std::string>& warnings);

}  // namespace limn
