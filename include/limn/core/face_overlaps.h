#pragma once
// Faces that overlap in a plane, or lie one above the other so close that rays in floats meet
// either of them: a rule has to say which one is met, or double precision.
#include <algorithm>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "limn/core/face_copies.h"
#include "limn/core/ray_tracer.h"

namespace limn {

// Pairs of faces that lie in one plane, to the rounding of positions, and have more of it in common
// than rounding explains: one of them is met, by a rule. And pairs that lie so above each other,
// but with all of one within 2^-19 of the camera's distance from the other's plane, and within 2^-8
// of either's longest side: they are *near*, and the nearer one is met, in double precision.
class FaceOverlaps {
 public:
  enum class Of { kAllFaces, kDifferentShapes };  // whether faces of one shape are looked for
  // copies: of the scene; both must outlive it. Of copies the first alone is looked at, and near
  // faces only among all faces. InputError if there are more than kMostPairs.
  FaceOverlaps(const Scene& scene, const FaceCopies& copies, int threads, Of of = Of::kAllFaces);

  static constexpr size_t kMostPairs = 1 << 24;  // about 0.9 GB

  bool empty() const { return of_.empty(); }
  // Those in one plane, each once, in the order of the file.
  std::vector<std::pair<FaceRef, FaceRef>> pairs() const;
  // Those that overlap `face`, or the first of its copies, in its plane; none for no face.
  std::span<const FaceRef> of(FaceRef face) const { return found_of(face).first; }
  // Those, and those that are near to it.
  std::span<const FaceRef> around(FaceRef face) const {
    const auto [in_plane, near] = found_of(face);
    return {in_plane.data(), in_plane.size() + near.size()};
  }
  // Whether two faces lie in one place: copies, too.
  bool contains(FaceRef a, FaceRef b) const;
  // Faces that are asked for one by one: the time goes with the logarithm of their number.
  class Set {
   public:
    bool contains(FaceRef face) const {
      return std::binary_search(keys_.begin(), keys_.end(), key(face));
    }

   private:
    friend FaceOverlaps;
    std::vector<uint64_t> keys_;  // sorted
  };
  // Those that lie in one place with any of `faces`, as contains() says, and these themselves.
  Set in_place_of(std::span<const FaceRef> faces) const;
  // Of the faces in a hit's place, copies among them, that which the ray meets (is_met_first),
  // after near ones that are met before it.
  void settle(const Ray& ray, Hit& hit) const {
    if (has_others(hit.face) || !copies_->empty()) settle_among(ray, hit);
  }
  // The first face that the ray meets of those near to the one where it starts; `hit` is changed
  // only if that is nearer. False if there is none.
  bool leave(const Ray& ray, Hit& hit) const {
    return has_others(ray.start) && leave_near(ray, hit);
  }
  // Whether the ray meets a face near to the one where it ends before it gets there.
  bool arrives_hidden(const Ray& ray) const;
  // Whether another face is met in the place where the ray would meet `face`.
  bool is_hidden(FaceRef face, const Ray& ray) const;

 private:
  static uint64_t key(FaceRef face) {
    return uint64_t{face.shape.index()} << 32 | face.face.index();
  }
  using Found = std::pair<std::span<const FaceRef>, std::span<const FaceRef>>;  // in plane, near
  Found found_of(FaceRef face) const {
    return has_others(face) ? find(copies_->first(face)) : Found{};
  }
  bool has_others(FaceRef face) const { return face.shape.valid() && has_others_[number(face)]; }
  size_t number(FaceRef face) const {
    return first_numbers_[face.shape.index()] + face.face.index();
  }
  Found find(FaceRef face) const;
  void settle_among(const Ray& ray, Hit& hit) const;
  bool leave_near(const Ray& ray, Hit& hit) const;
  void settle_in_plane(const Ray& ray, Hit& hit) const;
  std::optional<Hit> first_of(std::span<const FaceRef> faces, const Ray& ray, double before) const;

  const Scene* scene_;
  const FaceCopies* copies_;
  std::vector<size_t> first_numbers_;  // of each shape's faces
  // Whether a face, or one that it is a copy of, is in a pair: asked twice for every ray, mostly of
  // faces that are in none.
  std::vector<bool> has_others_;
  std::vector<FaceRef> others_;
  struct Range {
    size_t begin, near, end;  // in others_: those in the plane, then those near to it
  };
  std::unordered_map<uint64_t, Range> of_;
};

// One warning for every two shapes that have faces in one place, or in one plane where they
// overlap, which face the same way: two surfaces in one place.
void warn_of_overlaps(const Scene& scene, std::vector<std::string>& warnings);

}  // namespace limn
