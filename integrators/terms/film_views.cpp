// The camera's images in mirrors, and the parts of the film where they are seen.
#include "integrators/terms/film_views.h"

#include <limits>
#include <optional>

namespace limn {
namespace {

// Points of the lens whose views bound those of all; a camera without one has one view.
std::vector<CameraView<double>> outermost_views(const Camera& camera) {
  const CameraView<double> view(camera);
  if (!camera.has_lens()) return {view};
  return {view.at({1, 0}), view.at({-1, 0}), view.at({0, 1}), view.at({0, -1})};
}

// Of a mirror as a camera sees it, within a window; none if it sees nothing of it.
std::optional<FilmWindow> window_of(const Scene& scene, const FlatMirrors::Mirror& mirror,
                                    const Camera& camera, FilmWindow within) {
  FilmWindow seen{within.x1, within.y1, within.x0, within.y0};
  size_t before = 0, behind = 0;
  const std::vector<CameraView<double>> views = outermost_views(camera);
  for (const FaceRef face : mirror.faces) {
    for (const Vec3d& corner : face_corners<double>(scene.shape(face.shape).mesh, face.face)) {
      const double depth = camera.depth(corner);
      if (!(depth > 0x1p-20 * length(corner - value(camera.origin)))) {
        ++behind;
        continue;
      }
      ++before;
      for (const CameraView<double>& view : views) {
        const auto at = view.project(corner);
        seen.x0 = std::min(seen.x0, at.x), seen.x1 = std::max(seen.x1, at.x);
        seen.y0 = std::min(seen.y0, at.y), seen.y1 = std::max(seen.y1, at.y);
      }
    }
  }
  if (before == 0) return std::nullopt;
  if (behind > 0) return within;
  seen = {std::max(seen.x0, within.x0), std::max(seen.y0, within.y0), std::min(seen.x1, within.x1),
          std::min(seen.y1, within.y1)};
  if (!(seen.x0 < seen.x1 && seen.y0 < seen.y1)) return std::nullopt;
  return seen;
}

// As the scene's own camera has it.
std::unique_ptr<const Viewpoint> viewpoint_of(const Scene& scene, const Camera& image) {
  if (image.has_lens()) return std::make_unique<const Viewpoint>(value(image.origin));
  const bool parallel = image.is_orthographic();
  const LightOrigin origin{parallel ? image.forward : image.origin, parallel};
  return std::make_unique<const Viewpoint>(scene, origin);
}

}  // namespace

FilmWindow sampled_window(const Film& film) {
  const double border = film.sample_border ? film.filter.radius : 0;
  return {film.crop_x - border, film.crop_y - border, film.crop_x + film.crop_width + border,
          film.crop_y + film.crop_height + border};
}

bool clip_range(double a, double d, double lower, double upper, double& s0, double& s1) {
  if (d == 0) return a >= lower && a <= upper;
  double enter = (lower - a) / d;
  double leave = (upper - a) / d;
  if (enter > leave) std::swap(enter, leave);
  s0 = std::max(s0, enter);
  s1 = std::min(s1, leave);
  return s0 < s1;
}

// Nearer than 16 roundings of a distance there is nothing but what touches the mirror.
bool FilmView::clip_to_mirror(const Vec3d& origin, const Vec3d& a, const Vec3d& b, double& t0,
                              double& t1) const {
  if (direct()) return true;
  const MirrorPlane<double> plane = mirrors->plane(last_mirror());
  const Vec3d eye = camera.is_orthographic() ? eye_before(camera, plane.point) : origin;
  const double side = plane.distance(eye) < 0 ? 1 : -1;
  const double from = side * plane.distance(a), to = side * plane.distance(b);
  const double touching = 0x1p-20 * (length(a - eye) + length(b - eye));
  return clip_range(from, to - from, touching, std::numeric_limits<double>::infinity(), t0, t1);
}

std::vector<FilmView> list_film_views(const PathContext& context, bool held) {
  const Scene& scene = context.scene;
  std::vector<FilmView> views;
  views.push_back(
      {{}, scene.camera, &context.viewpoints->camera, nullptr, sampled_window(scene.film)});
  if (!context.flat_mirrors) return views;
  for (const FlatMirrors::Chain& chain : context.flat_mirrors->chains()) {
    if (scene.max_depth >= 0 && static_cast<int>(chain.count) >= scene.max_depth) continue;
    Camera camera = scene.camera;
    std::optional<FilmWindow> window = views[0].window;
    for (uint32_t k = 0; k < chain.count && window; ++k) {
      const FlatMirrors::Mirror& mirror = context.flat_mirrors->mirrors()[chain.mirrors[k]];
      window = window_of(scene, mirror, camera, *window);
      const MirrorPlane<double> still = context.flat_mirrors->plane(chain.mirrors[k]);
      // A plane that cuts the lens has points of it on both sides.
      const Vec3d eye = eye_before(camera, still.point);
      if (!context.flat_mirrors->reflects_to(chain.mirrors[k], eye) &&
          std::fabs(still.distance(eye)) > camera.aperture_radius.v) {
        window.reset();
      }
      camera = image_of(camera, held ? at_rest(still) : mirror.plane);
    }
    if (!window) continue;
    FilmView view{chain, camera, nullptr, nullptr, *window, context.flat_mirrors};
    view.own_viewpoint = viewpoint_of(scene, camera);
    view.viewpoint = view.own_viewpoint.get();
    views.push_back(std::move(view));
  }
  for (const FlatMirrors::Chain& chain : context.flat_mirrors->panes()) {
    auto refracted = std::make_unique<const RefractedView>(context, chain, held);
    const FlatMirrors::Mirror& plane = context.flat_mirrors->mirrors()[chain.mirrors[0]];
    const auto window = window_of(scene, plane, scene.camera, views[0].window);
    if (!window || !refracted->is_seen()) continue;
    views.push_back({chain, scene.camera, &context.viewpoints->camera, nullptr, *window,
                     context.flat_mirrors, std::move(refracted)});
  }
  return views;
}

}  // namespace limn
