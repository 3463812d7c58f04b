// A mesh in grey clay, seen through a pinhole, with edges drawn over it.
#include "tools/limn/reject/mesh_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/parallel.h"
#include "limn/core/shading.h"

namespace limn {
namespace {

constexpr int kRaysPerSide = 4;  // of a pixel
constexpr double kPiece = 3;     // pixels

Vec3<Dual> constant(const Vec3d& v) { return {v.x, v.y, v.z}; }

}  // namespace

Camera camera_for(std::span<const Vec3d> points, const Vec3d& towards_camera, const Vec3d& up,
                  int size) {
  const Vec3d back = normalize(towards_camera);
  // Looking straight along `up`, any other direction will do.
  Vec3d right = cross(up, back);
  right = length(right) < 1e-3 * length(up) ? Frame(back).s : normalize(right);
  const Vec3d top = cross(back, right);
  // A camera at (x, y, distance) along (right, top, back) sees a point (r, t, b) if |r - x| and
  // |t - y| are at most slope (distance - b).
  constexpr double kFov = 28, kFilled = 0.94;  // degrees; of the width
  const double slope = kFilled * std::tan(kFov * kPi / 360);
  constexpr double kLeast = -std::numeric_limits<double>::infinity();
  double rights = kLeast, lefts = kLeast, tops = kLeast, bottoms = kLeast;
  for (const Vec3d& p : points) {
    const double r = dot(p, right) / slope, t = dot(p, top) / slope, b = dot(p, back);
    rights = std::max(rights, b + r);
    lefts = std::max(lefts, b - r);
    tops = std::max(tops, b + t);
    bottoms = std::max(bottoms, b - t);
  }
  const double distance = 0.5 * std::max(rights + lefts, tops + bottoms);
  Camera camera;
  camera.origin = constant(right * (0.5 * slope * (rights - lefts)) +
                           top * (0.5 * slope * (tops - bottoms)) + back * distance);
  camera.left = constant(-right);
  camera.up = constant(top);
  camera.forward = constant(-back);
  camera.fov = kFov;
  camera.width = camera.height = size;
  return camera;
}

Ray MeshView::ray(double x, double y) const {
  const CameraRay<double> from = camera_.ray<double>(x, y);
  return {.origin = from.origin, .direction = from.direction};
}

// The shading normal, or that of the face.
Vec3d MeshView::normal_at(FaceId face, const Vec3d& x) const {
  const auto corners = face_corners<double>(mesh_, face);
  const Vec3d area = cross(corners[1] - corners[0], corners[2] - corners[0]);
  Vec3d n = area;
  if (!mesh_.normal_ids.empty()) {
    n = {};
    for (int k = 0; k < 3; ++k) {
      const Vec3d part = cross(corners[(k + 1) % 3] - x, corners[(k + 2) % 3] - x);
      n += mesh_.normals[mesh_.normal_ids[face.index()][k]] * dot(part, area);
    }
  }
  return length(n) > 0 ? normalize(n) : Vec3d{0, 0, 1};
}

MeshView::Surface MeshView::surface(const Ray& ray) const {
  static const Color background = srgb(0xffffff), clay = srgb(0xdedbd6);
  Hit hit;
  if (!tracer_.closest(ray, hit)) return {background, std::numeric_limits<double>::infinity()};
  Vec3d n = normal_at(hit.face.face, ray.origin + ray.direction * hit.t);
  if (dot(n, ray.direction) > 0) n = -n;
  // A soft light from above on the left behind the camera.
  const Vec3d light =
      normalize(value(camera_.left) * 0.6 + value(camera_.up) * 0.9 - value(camera_.forward) * 0.9);
  const double wrapped = 0.5 + 0.5 * dot(n, light);
  return {clay * (0.12 + 0.88 * wrapped * wrapped), hit.t};
}

Image MeshView::picture(const std::function<Color(const Ray&)>& color) const {
  Image image(camera_.width, camera_.height, 3);
  constexpr double kStep = 1.0 / kRaysPerSide;
  parallel_for(camera_.height, threads_, [&](size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < image.width; ++x) {
      Color sum;
      for (int k = 0; k < kRaysPerSide * kRaysPerSide; ++k) {
        const double dx = kStep * (k % kRaysPerSide + 0.5), dy = kStep * (k / kRaysPerSide + 0.5);
        sum += color(ray(x + dx, y + dy));
      }
      set_pixel(image, x, y, sum * (kStep * kStep));
    }
  });
  return image;
}

Image MeshView::picture() const {
  return picture([this](const Ray& ray) { return surface(ray).color; });
}

PixelPoint MeshView::project(const Vec3d& x) const {
  const auto film = camera_.project<double>(x);
  return {film.x, film.y};
}

void MeshView::draw_edge(const EdgeMesh& edges, EdgeId edge, double width, Layer& visible,
                         Layer& hidden) const {
  const auto [a, b] = edges.edge(edge).vertices;
  draw_line(edges.position(a), edges.position(b), width, edges.faces_around(edge), visible, hidden);
}

void MeshView::draw_line(const Vec3d& a, const Vec3d& b, double width,
                         std::span<const FaceRef> skip_faces, Layer& visible, Layer& hidden) const {
  const PixelPoint from = project(a), to = project(b);
  const int pieces =
      std::max(1, static_cast<int>(std::hypot(to.x - from.x, to.y - from.y) / kPiece));
  for (int i = 0; i < pieces; ++i) {
    const auto at = [&](double k) { return a + (b - a) * (k / pieces); };
    Ray sight;
    sight.origin = value(camera_.origin);
    const Vec3d w = at(i + 0.5) - sight.origin;
    sight.t_max = length(w);
    sight.direction = w / sight.t_max;
    sight.skip_faces = skip_faces;
    Layer& layer = tracer_.occluded(sight) ? hidden : visible;
    layer.line(project(at(i)), project(at(i + 1)), width);
  }
}

}  // namespace limn
