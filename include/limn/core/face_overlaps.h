#pragma once
// Coplanar overlapping faces, and faces so close together that float rays cannot resolve which is
// in front. A rule, or double precision, decides which of them a ray hits.
#include <algorithm>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "limn/core/duplicate_faces.h"
#include "limn/core/ray_tracer.h"

namespace limn {

// Pairs of *coplanar* faces overlap by more than the rounding of positions explains; a rule chooses
// the face that is hit. Pairs of *near* faces overlap in projection, with all of one within 2^-19
// of the camera's distance from the other's plane and within 2^-8 of either's longest side. Of
// these the nearer one is hit, computed in double precision.
class FaceOverlaps {
 public:
  enum class Of { kAllFaces, kDifferentShapes };  // kDifferentShapes: no pairs within one shape
  // copies: of the same scene; both must outlive this. Of duplicates only the first is tested.
  // kDifferentShapes finds no near faces. InputError if there are more than kMostPairs.
  FaceOverlaps(const Scene& scene, const DuplicateFaces& copies, int threads,
               Of of = Of::kAllFaces);

  static constexpr size_t kMostPairs = 1 << 24;  // about 0.9 GB

  bool empty() const { return others_.empty(); }
  // Coplanar pairs, each once, in file order.
  std::vector<std::pair<FaceRef, FaceRef>> pairs() const;
  // Faces coplanar with `face` (or with its first duplicate) that overlap it; none for no face.
  std::span<const FaceRef> of(FaceRef face) const { return found_of(face).first; }
  // Coplanar faces and near faces.
  std::span<const FaceRef> around(FaceRef face) const {
    const auto [in_plane, near] = found_of(face);
    return {in_plane.data(), in_plane.size() + near.size()};
  }
  // True if two faces are duplicates or overlap in a plane.
  bool contains(FaceRef a, FaceRef b) const;
  // A set of faces with lookup by binary search.
  class Set {
   public:
    bool contains(FaceRef face) const {
      return std::binary_search(keys_.begin(), keys_.end(), key(face));
    }

   private:
    friend FaceOverlaps;
    std::vector<uint64_t> keys_;  // sorted
  };
  // `faces`, their duplicates, and all faces that overlap any of them in a plane.
  Set in_place_of(std::span<const FaceRef> faces) const;
  // Replaces the hit by the face that the rule (is_hit_first) selects among its duplicates and
  // coplanar faces, after near faces that lie in front of it.
  void settle(const Ray& ray, Hit& hit) const {
    if (has_others(hit.face) || !copies_->empty()) settle_among(ray, hit);
  }
  // Finds the first hit among the faces near the ray's start face. Updates `hit` and returns true
  // only if that hit is nearer.
  bool leave(const Ray& ray, Hit& hit) const {
    return has_others(ray.start) && leave_near(ray, hit);
  }
  // True if a face near the ray's end face occludes it.
  bool arrives_hidden(const Ray& ray) const;
  // True if the ray would hit a coplanar face or a duplicate instead of `face`.
  bool is_hidden(FaceRef face, const Ray& ray) const;

 private:
  static uint64_t key(FaceRef face) {
    return uint64_t{face.shape.index()} << 32 | face.face.index();
  }
  using Found = std::pair<std::span<const FaceRef>, std::span<const FaceRef>>;  // coplanar, near
  Found found_of(FaceRef face) const { return has_others(face) ? find(face) : Found{}; }
  bool has_others(FaceRef face) const {
    if (!face.shape.valid()) return false;
    const size_t i = number(face);
    return (has_others_[i / 64] >> i % 64 & 1) != 0;
  }
  size_t number(FaceRef face) const {
    return first_numbers_[face.shape.index()] + face.face.index();
  }
  // For a face that has others.
  Found find(FaceRef face) const;
  size_t range_of(FaceRef face) const;
  void settle_among(const Ray& ray, Hit& hit) const;
  bool leave_near(const Ray& ray, Hit& hit) const;
  // others: of(hit.face).
  void settle_in_plane(std::span<const FaceRef> others, const Ray& ray, Hit& hit) const;
  std::optional<Hit> first_of(std::span<const FaceRef> faces, const Ray& ray, double before) const;

  const Scene* scene_;
  const DuplicateFaces* copies_;
  std::vector<size_t> first_numbers_;  // first face number of each shape
  // True for a face in any pair, or a duplicate of one. Queried twice per ray; most faces are in no
  // pair.
  std::vector<uint64_t> has_others_;  // a bit for each face
  std::vector<size_t> before_;        // for each of the words: the number of bits before it
  std::vector<FaceRef> others_;
  struct Range {
    size_t begin = 0, near = 0, end = 0;  // in others_: coplanar faces, then near ones
  };
  std::vector<Range> ranges_;  // of each face that has others
};

// One warning for each pair of shapes with duplicate or coplanar overlapping faces that face the
// same way.
void warn_of_overlaps(const Scene& scene, std::vector<std::string>& warnings);

// Duplicates and overlaps of a scene's faces, computed once and shared.
// The scene must outlive it.
struct CoincidentFaces {
  CoincidentFaces(const Scene& scene, int threads)
      : copies(scene), overlaps(scene, copies, threads) {}
  CoincidentFaces(const CoincidentFaces&) = delete;
  CoincidentFaces& operator=(const CoincidentFaces&) = delete;
  DuplicateFaces copies;
  FaceOverlaps overlaps;
};

// make_embree_tracer with overlaps that were computed for the same positions; null: computes them.
std::unique_ptr<RayTracer> make_embree_tracer(const Scene& scene, int threads,
                                              std::shared_ptr<const CoincidentFaces> faces);

}  // namespace limn
