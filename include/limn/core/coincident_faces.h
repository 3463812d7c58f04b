#pragma once
// Duplicates and overlaps of a scene's faces, computed once and shared.
#include <memory>

#include "limn/core/duplicate_faces.h"
#include "limn/core/face_overlaps.h"
#include "limn/core/ray_tracer.h"

namespace limn {

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
