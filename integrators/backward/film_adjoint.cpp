// Silhouettes and sharp shadows on the film: the jump of radiance, weighed by the adjoint there,
// pushes the film position along the curve's normal. Where lines from lamps end in view, edges push
// what the camera sees.
#include "integrators/backward/film_adjoint.h"

#include <fmt/format.h>

#include <cmath>

#include "integrators/backward/edge_adjoint.h"
#include "integrators/backward/path_adjoint.h"
#include "integrators/estimates/splat.h"
#include "integrators/film/film_point.h"
#include "limn/core/error.h"
#include "limn/core/reverse.h"

namespace limn {

namespace {

// A point of a face on a clip plane, between two corners.
Vec3<Var> meet_clip_plane(const CameraView<Var>& camera, const Vec3<Var>& a, const Vec3<Var>& b,
                          double clip) {
  const Var depth_a = camera.depth(a), depth_b = camera.depth(b);
  return a + (b - a) * ((clip - depth_a) / (depth_b - depth_a));
}

// The point at t of where the face meets the plane, as clip_curves.cpp lists its ends.
Vec3<Var> clip_point(const AdjointContext& context, const CameraView<Var>& view,
                     const ClipSegment& segment, double t) {
  const Camera& camera = context.scene().camera;
  const double clip = segment.at_far_plane ? camera.far_clip : camera.near_clip;
  const auto corners = corner_leaves(context.scene(), segment.face);
  Vec3<Var> ends[2];
  int count = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3<Var>&a = corners[k], &b = corners[(k + 1) % 3];
    const bool beyond_a = camera.depth(value(a)) > clip, beyond_b = camera.depth(value(b)) > clip;
    if (beyond_a != beyond_b) ends[count++] = meet_clip_plane(view, a, b, clip);
  }
  return ends[0] + (ends[1] - ends[0]) * t;
}

}  // namespace

std::vector<Rgb<double>> adjoint_pixels(const Scene& scene, const Image& adjoint) {
  const Film& film = scene.film;
  if (adjoint.width != film.crop_width || adjoint.height != film.crop_height ||
      (adjoint.channels != 1 && adjoint.channels != 3)) {
    throw InputError(fmt::format(
        "the adjoint image has {} x {} pixels of {} channels, but the film {} x {}: it must "
        "be of the film's size, with three channels or one",
        adjoint.width, adjoint.height, adjoint.channels, film.crop_width, film.crop_height));
  }
  std::vector<Rgb<double>> pixels;
  for (int y = 0; y < adjoint.height; ++y) {
    for (int x = 0; x < adjoint.width; ++x) {
      Rgb<double> a;
      for (int c = 0; c < 3; ++c) {
        Rgb<double> unit;
        unit[c] = 1;
        a[c] = adjoint.channels == 3 ? adjoint.at(x, y, c) : adjoint.at(x, y, 0) * luminance(unit);
        if (std::isfinite(a[c])) continue;
        throw InputError(fmt::format("the adjoint image is not finite in column {}, row {}", x, y));
      }
      pixels.push_back(a);
    }
  }
  return pixels;
}

Rgb<double> FilmAdjoint::at(double x, double y) const {
  Rgb<double> sum;
  for_every_pixel_of(film_, x, y, [&](int px, int py, double weight) {
    sum +=
        pixels_[static_cast<size_t>(py - film_.crop_y) * film_.crop_width + (px - film_.crop_x)] *
        weight;
  });
  return sum;
}

bool add_camera_adjoint(const AdjointContext& context, const FilmAdjoint& film, double u,
                        const Rng& key, double share, Tape& tape, TermCost& cost,
                        std::vector<Contribution>& contributions) {
  tape.clear();
  ++cost.samples;
  const FilmEdgePoint point = context.camera->choose(u);
  const Rgb<double> adjoint = film.at(point.x, point.y);
  if (is_black(adjoint)) {
    ++cost.zero_weight;
    return true;
  }
  RayCount rays;
  Rgb<double> jump;
  const bool visible = context.camera->jump_at(point, key, rays, jump);
  cost.add(rays);
  if (!visible) {
    ++cost.occluded;
    return true;
  }
  ++cost.counted;
  const double weight = weighed(adjoint, jump) * share / point.density;
  const FilmEdge& edge = *point.edge;
  const double t = context.camera->t_of(point);
  const CameraView<Var> view = camera_leaves(context.scene().camera);
  Seeds seeds;
  const Vec3<Var> x = edge.clip == FilmEdge::kNoClip
                          ? seeds.point_of(context, edge.id, t)
                          : clip_point(context, view, context.camera->clip_of(edge), t);
  const auto position = view.project(x);
  seeds.add(position.x.node, weight * edge.nx);
  seeds.add(position.y.node, weight * edge.ny);
  seeds.sweep(context, tape);
  return append_finite(tape, contributions);
}

bool add_shadow_adjoint(const AdjointContext& context, const FilmAdjoint& film, double u,
                        const Rng& key, double share, Tape& tape, TermCost& cost,
                        std::vector<Contribution>& contributions) {
  tape.clear();
  ++cost.samples;
  double probability;
  const ShadowEdge& edge = context.shadows->choose(u, probability);
  RayCount rays;
  const auto point = context.shadows->cast(edge, key.at(Purpose::kShadow, 0).uniform(), rays);
  const auto seen = point ? film_point(context.scene(), point->face, point->x) : std::nullopt;
  Rgb<double> amount;
  if (seen) {
    amount = film.at(seen->x, seen->y) *
             context.shadows->jump(edge, *point, value(seen->ray.origin), seen->omega);
  }
  const bool counts =
      !is_black(amount) &&
      !is_hidden(context.path, aimed_at(*seen, point->target(value(seen->ray.origin))), point->face,
                 rays);
  cost.add(rays);
  if (!counts) {
    ++cost.occluded;
    return true;
  }
  ++cost.counted;
  const auto ray = camera_leaves(context.scene().camera).ray(seen->x, seen->y);
  Seeds seeds;
  const Var swept =
      shadow_sweep(context, edge, *point, ray.origin, ray.direction, seen->distance, seeds);
  const double scale = film_per_solid_angle(context.scene().camera, seen->omega) / probability;
  seeds.add(swept.node, (amount.r + amount.g + amount.b) * scale * share);
  seeds.sweep(context, tape);
  return append_finite(tape, contributions);
}

bool add_penumbra_adjoint(const AdjointContext& context, const FilmAdjoint& film, double u,
                          const Rng& key, double share, Tape& tape, TermCost& cost,
                          std::vector<Contribution>& contributions) {
  tape.clear();
  ++cost.samples;
  const PenumbraLines& lines = context.regions->lines;
  RayCount rays;
  Rng rng = key.at(Purpose::kShadow, 0);
  auto drawn = lines.draw(u, rng, rays);
  const auto seen = drawn ? film_point(context.scene(), drawn->face, drawn->line.p) : std::nullopt;
  const Rgb<double> adjoint = seen ? film.at(seen->x, seen->y) : Rgb<double>{};
  const bool counts = !is_black(adjoint) && lines.complete(*drawn, {}, 0, rng) &&
                      !is_hidden(context.path, *seen, drawn->face, rays);
  cost.add(rays);
  if (!counts) {
    ++cost.zero_weight;
    return true;
  }
  drawn->edge.probability /= film_per_solid_angle(context.scene().camera, seen->omega);
  const auto ray = camera_leaves(context.scene().camera).ray(seen->x, seen->y);
  Seeds seeds;
  add_penumbra_line(context, *drawn, ray.origin, ray.direction, adjoint * share, 0, key, tape,
                    seeds, cost);
  seeds.sweep(context, tape);
  return append_finite(tape, contributions);
}

}  // namespace limn
