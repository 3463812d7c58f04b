#pragma once
// A mesh in grey clay, seen through a pinhole, with edges drawn over it.
#include <functional>
#include <span>

#include "limn/core/ray_tracer.h"
#include "limn/edgetree/edges.h"
#include "tools/limn/reject/canvas.h"

namespace limn {

// A square picture that shows all of some points, as large as they fit. towards_camera: any length
// but 0.
Camera camera_for(std::span<const Vec3d> points, const Vec3d& towards_camera, const Vec3d& up,
                  int size);

class MeshView {
 public:
  // scene: one shape, which must outlive the view, as the tracer does.
  MeshView(const Scene& scene, const RayTracer& tracer, const Camera& camera, int threads)
      : mesh_(scene.shapes[0].mesh), tracer_(tracer), camera_(camera), threads_(threads) {}

  const Camera& camera() const { return camera_; }
  Ray ray(double x, double y) const;
  // The first surface along a ray; `distance` is infinite, and the colour the background's, where
  // there is none.
  struct Surface {
    Color color;
    double distance;
  };
  Surface surface(const Ray& ray) const;
  // Means of the colour along 4 by 4 rays per pixel.
  Image picture(const std::function<Color(const Ray&)>& color) const;
  Image picture() const;

  PixelPoint project(const Vec3d& x) const;
  // Draws edges, cut into short pieces: a piece that the mesh hides goes to `hidden`.
  void draw_edge(const EdgeMesh& edges, EdgeId edge, double width, Layer& visible,
                 Layer& hidden) const;
  void draw_line(const Vec3d& a, const Vec3d& b, double width, Layer& visible,
                 Layer& hidden) const {
    draw_line(a, b, width, {}, visible, hidden);
  }

 private:
  void draw_line(const Vec3d& a, const Vec3d& b, double width, std::span<const FaceRef> skip_faces,
                 Layer& visible, Layer& hidden) const;
  Vec3d normal_at(FaceId face, const Vec3d& x) const;

  const Mesh& mesh_;
  const RayTracer& tracer_;
  Camera camera_;
  int threads_;
};

}  // namespace limn
