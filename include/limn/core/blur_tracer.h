#pragma once
// The blurred faces that a ray meets.
#include <memory>
#include <optional>
#include <vector>

#include "limn/core/blur.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/scene.h"

namespace limn {

struct BlurHit {
  FaceRef face;
  double t = 0;  // along the ray, to the face's plane
  double opacity = 0;
  bool front = false;
};

// The blurred faces of a scene. One-sided closed meshes (no boundary, black behind) are met from
// the front alone.
class BlurFaces {
 public:
  // The scene must outlive this. blur: as resolved() has it.
  BlurFaces(const Scene& scene, const Blur& blur);

  const Scene& scene() const { return scene_; }
  const Blur& blur() const { return blur_; }

  // Whether and how a ray meets a face. It never meets the face that it starts on, nor faces in
  // that face's plane, nor those that share a vertex with it and lie behind it as the ray leaves:
  // else convex edges would darken themselves.
  std::optional<BlurHit> meet(const Ray& ray, FaceRef face) const;
  // Whether two faces share a welded vertex.
  bool touch(FaceRef a, FaceRef b) const;
  // Brings the hits of a ray, in any order, repeated or not, into that of t, and leaves out what
  // lies behind the first opaque face, but its neighbours, which are put in.
  void settle(const Ray& ray, std::vector<BlurHit>& hits) const;

 private:
  struct MeshFaces {
    bool front_only = false;
    std::vector<Vec3d> normals;   // of each face, twice its area long
    std::vector<uint32_t> first;  // of each vertex that stands for its copies, in `around`
    std::vector<uint32_t> around;
    std::vector<bool> alone;  // of each face: where it is opaque, none around it is met behind it
  };
  static bool is_alone(const Mesh& mesh, const MeshFaces& own, uint32_t face);
  // The opacity of a face where a ray meets its plane, at x. n: the face's normal, of any length.
  double opacity_at(const std::array<Vec3d, 3>& corners, const Vec3d& n, const Vec3d& x) const;
  bool is_beside_start(const Ray& ray, FaceRef face, const std::array<Vec3d, 3>& corners) const;

  const Scene& scene_;
  Blur blur_;
  double reach_;
  std::vector<MeshFaces> meshes_;
};

class BlurTracer {
 public:
  virtual ~BlurTracer() = default;
  // All blurred faces that the ray meets, settled. Thread-safe. Throws UntraceableRay as RayTracer
  // does, and InputError for a ray that meets more than kMostBlurHits.
  virtual void hits(const Ray& ray, std::vector<BlurHit>& hits) const = 0;
};
inline constexpr size_t kMostBlurHits = 512;

// A second Embree scene, of enlarged faces. `faces` must outlive it.
std::unique_ptr<BlurTracer> make_blur_tracer(const BlurFaces& faces, int threads);

// A convex polygon in the plane of a face around all that is no farther than `reach` from it:
// mitres are cut at three times that.
std::vector<Vec3d> enlarged_face(const std::array<Vec3d, 3>& corners, double reach);

// The median length of the sides of a scene's faces; 0 without faces.
double median_side(const Scene& scene);

// With what 0 stands for: sigma is then the square of a sixteenth of the median side, and gamma of
// kPublished a sixteenth of the scene's diagonal, the least that it takes: where surfaces are
// farther apart than about 16 gamma, what is in front would end at once where its opacity does.
// InputError for less, and for a scene without faces.
Blur resolved(Blur blur, const Scene& scene);

}  // namespace limn
