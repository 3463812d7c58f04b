#pragma once
// The path tracer, written once for any scalar: double gives radiance, Dual gives radiance and the
// interior term of its derivative, Var writes a tape of it. Sampled directions, their densities and
// MIS weights are constants while the parameters move (solid-angle measure, everywhere), but for
// directions that move on purpose (direction_field.h, warp_field.h), the one direction of a light
// without extent and the rays of smooth lobes, which follow the parameters. No light is drawn for
// what smooth lobes see: there an emitter counts fully where a path meets it.
#include <span>
#include <type_traits>

#include "integrators/edges/near_faces.h"
#include "integrators/edges/viewpoint.h"
#include "integrators/lights/closed_light.h"
#include "integrators/paths/moving_colours.h"
#include "integrators/paths/path_context.h"
#include "integrators/paths/walk.h"
#include "integrators/paths/warp_field.h"
#include "limn/core/lights.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/reverse.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"
#include "limn/core/shading.h"
#include "limn/integrators/run.h"

namespace limn {

// Where S and Visitor are chosen, path_follow.h is included, which has what is declared here.
// Visitor: called as visitor(surface, scattering, throughput, motion, step, bounces, key) at every
// vertex where the path scatters. motion: how directions move there, null where they are held.
template <class S, class Visitor>
class PathTracer {
 public:
  using Walk = limn::Walk<S, Visitor>;
  using Place = PlaceScalar<S, Visitor>;
  static constexpr bool kPlain = std::is_same_v<Place, double>;
  // Side by side, see path_follow.h.
  static constexpr size_t kMostWalks = kPlain ? 64 : 8;

  PathTracer(const PathContext& context, RayCount& rays) : c_(context), rays_(rays) {}

  // By the fields of paths that have one. Must outlive the tracer. For places with derivatives.
  void move_directions(const MotionRates& rates) {
    static_assert(std::is_same_v<Place, Dual>);
    rates_ = &rates;
  }
  // The directions of all vertices move, on one path at a time. Must outlive the tracer.
  void warp_directions(DirectionWarper& warper) {
    static_assert(std::is_same_v<Place, Dual>);
    warper_ = &warper;
  }
  // Takes more light samples and directions at vertices that slide fast. Must outlive the tracer.
  void split_by(const MotionRates* rates) { splitting_ = rates; }
  // Many paths are followed, hardly ever one or two: their steps are taken in eight lanes, which
  // changes rounding. Scattering functions only where `glossy`: of diffuse ones alone images took
  // 1.01 to 1.05 of the time.
  void work_wide(bool glossy) {
    static_assert(kPlain);
    wide_ = true;
    scatters_wide_ = glossy;
  }
  // Where colours alone carry derivatives: what has any. Must outlive the tracer.
  void colour_by(const MovingColours& colours) {
    static_assert(kColoursAlone<S, Visitor>);
    colours_ = &colours;
  }

  // Radiance that arrives at the origins of rays against their directions; rays[i] belongs to
  // walks[i], at most kMostWalks of them. What cannot be traced has `failed`.
  void follow_rays(std::span<const StartRay<Place>> rays, std::span<Walk> walks);
  Rgb<S> escaped(const Vec3<Place>& direction, int bounces) const;

  // A path that starts on a surface: the radiance that leaves it along wi, emission and everything
  // scattered within the scene's depth, by the estimate of path_follow.h.
  void place(Walk& walk, const SurfacePoint<Place>& surface, const Vec3<Place>& wi) const;
  void follow_one(Walk& walk) {
    Walk* const one = &walk;
    follow({&one, 1});
  }
  // Adds all that is scattered along paths that have been placed, at most kMostWalks.
  void follow(std::span<Walk* const> walks);

 private:
  using Evaluation = typename Scattering<S>::Evaluation;
  template <class Step>
  static bool guarded(Walk& walk, const Step& step) {
    try {
      return step();
    } catch (const UntraceableRay&) {
      walk.failed = true;
      return false;
    }
  }
  // Whether a path that has scattered so often scatters no more.
  bool is_complete(int bounces) const {
    return c_.scene.max_depth >= 0 && bounces + 1 >= c_.scene.max_depth;
  }
  // Whether a ray that meets nothing sees any light.
  bool shows_sky(int bounces) const {
    return c_.scene.environment && !(bounces == 0 && c_.scene.hide_emitters);
  }
  // path_follow.h
  void place(Walk& walk, const Vec3<Place>& wi) const;
  void follow_seen(std::span<const StartRay<Place>> rays, std::span<Walk> walks);
  void split(Walk& walk, int more);
  // path_vertices.h. Those that return bool say whether the path goes on.
  bool begin_vertex(Walk& walk);
  void draw_numbers(std::span<Walk* const> walks) const;
  void colour(Walk& walk) const;
  Evaluation evaluate(const Walk& walk, const Vec3d& wo, const DirectionMotion* motion,
                      const Vec3<Place>& direction) const;
  Evaluation coloured(const Walk& walk, const typename Scattering<Place>::Evaluation& evaluation,
                      const Vec3d& wo) const;
  template <class W>
  Rgb<S> scattered_into(const Walk& walk, const Vec3<W>& wo) const;
  SmoothRay<S> smooth_ray(const Walk& walk) const;
  bool goes_on(Walk& walk, double pdf) const;
  bool draw_mirrored(Walk& walk) const;
  bool choose_direction(Walk& walk);
  bool scatter(Walk& walk);
  bool scatter(Walk& walk, const Evaluation& evaluation);
  void set_motion(Walk& walk) const;
  int splits(const SurfacePoint<Place>& surface, int copies) const;
  // The density of the next direction at w, of which scattering alone has this one.
  double density(const Walk& walk, const Vec3d& w, double scattered) const {
    return c_.mirrored ? MirroredLight::pdf(walk.mixture, w, scattered) : scattered;
  }
  // path_arrive.h
  void escape(std::span<Walk* const> walks) const;
  void escape(Walk& walk) const;
  Environment::Sight<S> sight(const Walk& walk) const;
  bool arrive(Walk& walk);
  Rgb<S> emitted(const Walk& walk) const;
  double unmoved_albedo(const Walk& walk) const;
  bool survives_roulette(Walk& walk) const;
  // path_smooth.h
  bool turns_smoothly(Walk& walk) const;
  bool turn_smoothly(Walk& walk) const;
  bool hides_edges(Walk& walk, const Vec3d& wo) const;
  size_t turn_smoothly(Walk** walks, size_t& count, Walk** turned) const;
  void leave_straight(Walk& walk) const;
  void leave_surface(Walk& walk, double eta) const;
  // path_wide.h. For plain numbers.
  size_t weigh_lights_wide(std::span<Walk* const> walks, Walk** lit) const;
  size_t scatter_wide(std::span<Walk*> walks);
  void place_lights_wide(std::span<Walk* const> walks) const;
  template <class Direction, class Then>
  void evaluate_wide(std::span<Walk*> walks, const Direction& direction, const Then& then) const;
  template <class Rest>
  void see_sky_wide(std::span<const StartRay<Place>> rays, std::span<Walk> walks,
                    const Rest& rest) const;
  // path_rays.h
  bool next_hit(Walk& walk);
  void take_hit(Walk& walk, const RayQuery& query) const;
  void next_hits(std::span<Walk* const> walks);
  template <class Put, class Trace, class Read>
  void trace_together(std::span<Walk* const> walks, const Put& put, const Trace& trace,
                      const Read& read);
  bool shadowed(const Walk& walk);
  size_t find_unshadowed(std::span<Walk*> walks);
  std::optional<FaceSide> blocked_at_start(const Walk& walk, const Vec3d& direction) const;
  void move_along_edge(SurfacePoint<Place>& surface, FaceRef face, const Vec3d& direction) const;
  void fetch_face(FaceRef face) const;
  void fetch_corners(const Walk& walk) const;
  void fetch_textures(std::span<Walk* const> walks) const;
  void find_sky(std::span<Walk* const> walks) const;
  // path_lights.h
  void choose_side(Walk& walk) const;
  void keep_side(Walk& walk) const;
  double light_pdf(const Walk& walk, double pdf) const { return walk.two_sided ? 0.5 * pdf : pdf; }
  void draw_lights(std::span<Walk* const> walks) const;
  void draw_light(Walk& walk, const Rng& key) const;
  void shine(std::span<Walk* const> walks);
  size_t weigh_lights(std::span<Walk* const> walks, Walk** lit) const;
  void add_light(Walk& walk) const;
  void add_lights(Walk& walk, int count);
  Rgb<S> direct_light(Walk& walk, const Rng& key);
  // path_light_value.h
  void weigh_light(Walk& walk) const;
  bool weigh_light(Walk& walk, const Evaluation& evaluation) const;
  void draw_delta(Walk& walk, const DeltaLight& delta) const;
  Rgb<S> light_value(const Walk& walk) const;
  Rgb<S> drawn_radiance(const LightSample& light) const;
  Rgb<S> emitted(const Walk& walk, const DirectionMotion* motion) const;
  Rgb<S> warped_light(const Walk& walk, const Rng& key);

  // 64 multiplied squared error times rays by 1.5 under a moving camera, by 1 elsewhere.
  static constexpr int kMostSplits = 16;
  static constexpr int kMostPaths = 64;  // of a sample, see allocation.cpp
  const PathContext& c_;
  RayCount& rays_;
  const MotionRates* rates_ = nullptr;
  const MotionRates* splitting_ = nullptr;
  DirectionWarper* warper_ = nullptr;
  const MovingColours* colours_ = nullptr;
  bool wide_ = false;
  bool scatters_wide_ = false;
};

}  // namespace limn
