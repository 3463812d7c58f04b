// How much light comes by chains of smooth lobes, and whether a parameter moves what it shows.
#include "integrators/paths/chain_light.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "integrators/estimates/tiles.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "limn/core/duplicate_faces.h"
#include "limn/core/exposure.h"
#include "limn/core/framed_light.h"
#include "limn/core/names.h"
#include "limn/core/parameter.h"

namespace limn {

ChainLight find_chain_light(const PathContext& context, uint64_t seed) {
  ChainLight result;
  const Scene& scene = context.scene;
  if (!find_smooth(scene)) return result;
  const FilterTable filter(scene.film.filter);
  const CameraView<double> camera(scene.camera);
  std::map<ShapeId, double> by_shape;
  double all = 0, by_chains = 0;
  RayCount rays;
  PathTracer<double, NoVisitor> tracer(context, rays);
  for (int i = 0; i < kChainPaths; ++i) {
    const Rng key(seed, UINT64_MAX, static_cast<uint64_t>(i));
    Rng rng = key.at(Purpose::kCamera, 0);
    const Film& film = scene.film;
    const int x = film.crop_x + static_cast<int>(rng.uniform() * film.crop_width);
    const int y = film.crop_y + static_cast<int>(rng.uniform() * film.crop_height);
    const FilmPosition at = sample_pixel_filter(film, filter, x, y, key);
    const CameraRay<double> ray = sample_ray(camera, at, key);
    const StartRay<double> start{camera_ray(scene, ray), ray.origin, ray.direction};
    Walk<double, NoVisitor> walk(key, 0, nullptr);
    tracer.follow_rays({&start, 1}, {&walk, 1});
    if (walk.failed || !is_finite(walk.sums.radiance)) continue;
    const double found = luminance(walk.sums.radiance);
    all += found;
    if (!walk.turned_by.valid()) continue;
    const double turned = found - luminance(walk.before_turn);
    by_chains += turned;
    by_shape[walk.turned_by] += turned;
  }
  if (all > 0) result.share = by_chains / all;
  for (const auto& [shape, light] : by_shape) {
    if (light > 0) result.shapes.push_back(shape);
  }
  std::stable_sort(result.shapes.begin(), result.shapes.end(),
                   [&](ShapeId a, ShapeId b) { return by_shape[a] > by_shape[b]; });
  return result;
}

namespace {

// Of a scene without meshes whose first lane is seeded.
bool values_move(const Scene& seeded) {
  if (!CameraView<Dual>(seeded.camera).is_constant()) return true;
  for (const auto& light : seeded.delta_lights) {
    if (!is_constant(light->origin().v)) return true;
    const auto* framed = dynamic_cast<const FramedLight*>(light.get());
    if (framed && !is_constant(framed->corners().front())) return true;
  }
  const Vec3<Dual> n{0.0, 0.0, 1.0}, wi{0.6, 0.0, 0.8};
  Rgb<Dual> at[kMostTextures];  // any values
  std::ranges::fill(at, grey(Dual(0.5)));
  for (const Shape& shape : seeded.shapes) {
    for (const bool front : {true, false}) {
      const Bsdf* const side = shape.bsdf->side(front);
      if (!side || !side->lobes().smooth) continue;
      SmoothRays<Dual> rays;
      const int count = side->smooth_rays(n, wi, rays, at);
      for (int k = 0; k < count; ++k) {
        if (!is_constant(rays[k].wo)) return true;
      }
    }
  }
  return false;
}

// The end of a warning where a scene has more flat mirrors and panes than edges are sampled in: the
// names of those that are. Empty where it has not.
std::string of_flat_mirrors(const PathContext& context, const Scene& scene) {
  const FlatMirrors* const flat = context.flat_mirrors;
  if (!flat || flat->left_out() == 0) return "";
  std::vector<std::string> names;
  for (const auto& mirror : flat->mirrors()) {
    const std::string name = quoted_name(scene, mirror.faces.front().shape);
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  return fmt::format(
      "; of {} flat mirrors and panes only the {} with the most area times reflectance show edges, "
      "those of {}: where another matters more, make one of these rough",
      flat->mirrors().size() + flat->left_out(), flat->mirrors().size(), join(names));
}

}  // namespace

bool moves_what_is_seen(const Scene& scene, std::span<const Parameter> parameters) {
  Scene hull = deep_copy(scene);
  for (Shape& shape : hull.shapes) shape.mesh = {};
  return std::ranges::any_of(parameters, [&](const Parameter& parameter) {
    if (parameter.texel_map(scene)) return false;
    if (moved_by({&parameter, 1}).vertices) return true;
    Scene copy = deep_copy(hull);
    parameter.seed(copy, 0);
    set_time(copy, 1);
    return values_move(copy);
  });
}

std::string missing_by_chains(const PathContext& context, const Scene& scene,
                              std::span<const Parameter> parameters) {
  if (!find_smooth(scene) || !moves_what_is_seen(scene, parameters)) return "";
  const ChainLight light = find_chain_light(context, 0);
  if (light.shapes.empty()) return "";
  constexpr size_t kMost = 8;
  std::vector<std::string> names;
  for (const ShapeId shape : light.shapes) {
    if (names.size() < kMost) names.push_back(quoted_name(scene, shape));
  }
  const size_t more = light.shapes.size() - names.size();
  return fmt::format(
      "the derivative is not complete: edges seen by way of smooth lobes of {}{} are missing; "
      "{:.3g} % of the image's light comes that way (smooth_as of 0.003 makes them rough){}",
      join(names), more > 0 ? fmt::format(" and {} more", more) : "", 100 * light.share,
      of_flat_mirrors(context, scene));
}

}  // namespace limn
