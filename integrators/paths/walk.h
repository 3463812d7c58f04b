#pragma once
// A path under way, over any scalar: what the path tracer (path.h) keeps of it from one step to the
// next.
#include <array>
#include <optional>
#include <type_traits>

#include "integrators/edges/edge_sides.h"
#include "integrators/edges/flat_mirrors.h"
#include "integrators/lights/mirrored_light.h"
#include "integrators/paths/direction_field.h"
#include "limn/core/lights.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/renew.h"
#include "limn/core/rng.h"
#include "limn/core/shading.h"

namespace limn {

// How a path came to a vertex.
struct PathStep {
  Vec3d from;  // the vertex before, or where the camera's ray starts
  // Of the direction from there [1/sr]; 0 for what the camera, an edge or a smooth lobe sees.
  double pdf = 0;
  FaceRef face = {};  // of the vertex before
  Vec3d before = {};  // where the path came to that from
};

// What a path has found.
template <class S>
struct PathSums {
  Rgb<S> radiance;
  Rgb<Lanes> score;  // sum of the scores: has mean zero, and belongs to the interior term
};

// The visitor of paths whose vertices no parameter moves. Their places and directions, and all that
// is drawn, are plain numbers: only colours carry derivatives, by what changes them.
struct Unmoved {
  template <class... A>
  void operator()(const A&...) const {}
};
// The scalar of places and directions, and whether it is another than that of colours, S.
template <class S, class Visitor>
using PlaceScalar = std::conditional_t<std::is_same_v<Visitor, Unmoved>, double, S>;
template <class S, class Visitor>
inline constexpr bool kColoursAlone = !std::is_same_v<PlaceScalar<S, Visitor>, S>;

// A path under way: a vertex, how it was reached, and what it needs next.
template <class S, class Visitor>
struct Walk {
  using Place = PlaceScalar<S, Visitor>;
  // scattered: how often the whole path has scattered before. visitor: see PathTracer; may be null.
  Walk(const Rng& path_key, int scattered, Visitor* at_vertices)
      : key(path_key), visitor(at_vertices), bounces(scattered) {}

  Rng key;
  Visitor* visitor;
  const DirectionField* field = nullptr;  // by which directions at the first vertex move, if any
  int bounces;
  int copies = 1;             // of paths that share the beginning, this one among them
  bool again = false;         // all but what further directions bring has been added
  bool lit = false;           // the lights at the vertex have been
  bool failed = false;        // it needed a ray that cannot be traced
  EdgeStart* edge = nullptr;  // where the surface lies, if the path starts on an edge and is there
  bool beside_edge = false;   // the path starts on an edge, or just beside it as seen, and is there
  SurfacePoint<Place> surface;
  Vec3<Place> wi;
  Rgb<S> throughput = grey(S(1.0));
  double albedo = 1;         // bounds it, by the materials of PathContext::unmoved
  double eta = 1;            // the index of refraction here over that where it started
  FlatMirrors::Chain chain;  // by which it has come since it was last rough, if smooth
  bool was_rough = false;    // before a smooth lobe
  ShapeId turned_by;         // the first shape whose smooth lobe hid edges (hides_edges), if any
  Rgb<double> before_turn;   // what it had found until there
  PathStep step;
  PathSums<S> sums;

  struct Nothing {};
  std::optional<Scattering<Place>> scattering;
  // The same with its derivatives, where it has any and places have none.
  std::conditional_t<kColoursAlone<S, Visitor>, std::optional<Scattering<S>>, Nothing> coloured;
  const DirectionMotion* motion = nullptr;  // null where directions are held
  std::conditional_t<std::is_same_v<Place, Dual>, DirectionMotion, Nothing> field_motion;

  Lights::Point lights;  // the vertex, for them
  // The vertex passes light roughly and is lifted: lights are drawn for one of its sides, with
  // probability 1/2 each; here for that which wi is not on.
  bool two_sided = false, beyond = false;
  // A light that may be seen: all of what it adds but its radiance.
  std::optional<LightSample> light;
  const DirectionMotion* light_motion = nullptr;
  Rgb<S> light_share;
  double light_weight = 1;

  // The next ray.
  std::array<double, 3> u{};       // from which its direction is drawn
  MirroredLight::Mixture mixture;  // that its direction is drawn from
  Vec3d wo;
  Vec3<Place> direction;    // the same as it moves
  double pdf = 0;           // [1/sr]; infinite of a smooth ray
  int smooth_ray = 0;       // which one, if it is
  double smooth_share = 0;  // the probability of that
  Rgb<S> before;            // the throughput before it
  bool last = false;        // only what emits counts behind it
  bool found = false;
  Hit hit;
  std::array<double, 2> sky{};  // where it leaves the scene: Environment::find

  // Where the next ray starts on an edge.
  EdgeStart* start_edge() const { return surface.lifted ? nullptr : edge; }
  // Throws as RayTracer does.
  const Rgb<S>& radiance() const {
    if (failed) throw UntraceableRay();
    return sums.radiance;
  }
};

// A ray on which a path starts: the primal one, with its skipped faces, and as it moves.
template <class S>
struct StartRay {
  Ray ray;
  Vec3<S> origin, direction;
};

}  // namespace limn
