#pragma once
// The contract of a term: one part of a derivative image, with an estimator of its own. A method
// that works term by term adds up, for every sample of a pixel,
//   what finished paths add (add_path), what the vertices of the first path add (add_at_vertex),
//   and what points on curves of the film add (sample_film), splatted through the filter.
// A term does what it needs of the three. All are unbiased on their own, so terms can be left out
// and can have any number of samples. Boundary samples go to sinks: forward and reverse mode take
// the same terms. Objects are made once per pass and used by all threads at once.
#include <memory>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/lights/light_regions.h"
#include "integrators/paths/path.h"
#include "integrators/terms/boundary_sample.h"
#include "integrators/terms/penumbra.h"
#include "limn/core/dual.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/integrators/gradient.h"

namespace limn {

// Where a path scatters, in plain numbers, with how it moves as edges are drawn by it.
struct PathVertex {
  SurfacePoint<double> surface;
  Scattering<double> scattering;
  Rgb<double> throughput;  // of the path up to here
  Vec3<Lanes> velocity;    // of the surface point
  DirectionTurn turn;      // of directions here, see direction_field.h
  int bounces;             // how often the path has scattered before
  PathStep step;           // how it came here
  const Rng& key;          // of the path
  // It stands for what passes the surface, which it lies beyond; else for what is reflected.
  bool below = false;

  // Value times cosine [1/sr], of the directions that it stands for.
  Rgb<double> scattered(const Vec3d& wo) const {
    return scattering.passes(wo) == below ? scattering.eval_value(wo) : Rgb<double>{};
  }
};
// A vertex of a path over any scalar, of throughput one. at: beyond() the surface of `scattering`,
// with `below` set then.
template <class S>
PathVertex plain_vertex(const SurfacePoint<S>& at, const Scattering<S>& scattering,
                        ShadingModel model, int bounces, const PathStep& step, const Rng& key,
                        bool below = false) {
  const SurfacePoint<double> surface = value(at);
  PathVertex vertex{
      surface, {surface, value(scattering.wi()), model}, grey(1.0), {}, {}, bounces, step, key};
  vertex.below = below;
  vertex.scattering.share_as(scattering.rough_share());
  if constexpr (std::is_same_v<S, Dual>) vertex.velocity = {at.p.x.d, at.p.y.d, at.p.z.d};
  return vertex;
}

// A sample of a pixel whose positions on the film move.
struct MovedPixel {
  PixelSample at;
  Rng key;
  const FilmMotion& motion;
};
inline constexpr size_t kMostMovedPixels = 8;

class Term {
 public:
  virtual ~Term() = default;

  // What a finished path adds: made of its radiance with its derivative. Averaged over the paths of
  // a sample, as many as the term that traces them has samples.
  virtual bool uses_paths() const { return false; }
  virtual Rgb<Lanes> add_path(const Rgb<Dual>& /*radiance*/) const { return {}; }

  // Whether the vertices of a sample's first path add something. add_at_vertex takes `samples`
  // samples there and hands them on, to be summed (not averaged).
  virtual bool uses_vertices() const { return false; }
  virtual void add_at_vertex(const PathVertex& /*vertex*/, int /*samples*/,
                             BoundarySink& /*sink*/) const {}

  // Whether moving positions of a pixel's samples add something by themselves. add_at_pixels takes
  // one sample for each of at most kMostMovedPixels pixels, and sets sums[i] to that of pixels[i].
  virtual bool uses_moved_pixels() const { return false; }
  virtual void add_at_pixels(std::span<const MovedPixel> /*pixels*/, TermCost& /*cost*/,
                             std::span<Rgb<Lanes>> /*sums*/) const {}
  // How positions on the film move from now on; an empty function: they are held.
  virtual void move_film(const FilmMotionAt& /*motion*/) {}

  // Whether the film holds curves to sample. sample_film draws a point and hands it on, if it adds
  // anything: u in [0, 1), stratified over a batch, chooses the curve and the point on it; `key` is
  // for everything else.
  virtual bool uses_film() const { return false; }
  virtual void sample_film(double /*u*/, const Rng& /*key*/, FilmSink& /*sink*/) const {}

  // What the samples behind `cost` cost, in units of one ray with the shading at its end: the same
  // on every machine, so that choices that follow from it are.
  virtual double work(const TermCost& cost) const { return static_cast<double>(cost.rays); }
  // What of it is the first sample's at each vertex alone, where each took one.
  virtual double first_work(const TermCost& /*cost*/) const { return 0; }

  // Adds warnings of kinks (non-differentiable points) that the parameters move this term across.
  virtual void warn_of_kinks(const Scene& /*scene*/, std::vector<std::string>& /*warnings*/) const {
  }
  // What the term built, for people to read.
  virtual void describe(GradientStats& /*stats*/) const {}
};

struct FreeMotion;
class KeptEdges;
struct Moved;
struct Parameter;

// What the terms of a pass are made from. It outlives them.
class TermInput {
 public:
  TermInput(const PathContext& path_context, int lane_count, const Lanes& lane_scales,
            const EdgeSamplerType& sampler_type, int thread_count, bool warped = false,
            KeptEdges* kept_edges = nullptr)
      : context(path_context),
        lanes(lane_count),
        lane_scale(lane_scales),
        sampler(sampler_type),
        threads(thread_count),
        warps(warped),
        kept(kept_edges) {}

  const PathContext& context;  // the scene with its parameters seeded
  int lanes;                   // how many derivative lanes are in use
  Lanes lane_scale;            // what makes speeds of the parameters comparable
  EdgeSamplerType sampler;     // how shading points choose an edge
  int threads;
  bool warps;       // whether directions are warped, see warp_field.h
  KeptEdges* kept;  // of the scene at other times; null where there are none
  // In reverse mode: what may move, each vertex by itself. Else null.
  const FreeMotion* free = nullptr;

  // Edges of all shapes (object i is shape i), as an edge sampler takes them; light polygons and
  // the environment, without the regions of light, once edge_sampler() was called. Made when a term
  // first needs them.
  const EdgeSamplerInput& edges();
  // The regions of light; null if the sampler has none apart, or the scene has none.
  const LightRegions* regions();
  // The edges before them; null if there are no regions.
  const EmitterEdges* emitter_edges();
  // The edges that shading points choose among: all, but for those that warped directions follow.
  const EdgeSamplerInput& chosen_edges();
  // What shading points choose edges by, shared by all terms. Made when a term first needs it.
  const EdgeSampler& edge_sampler();
  double edge_sampler_seconds() const { return edge_sampler_seconds_; }
  // Null if no term needed them.
  const EdgeSamplerInput* made_edges() const { return edges_.get(); }
  double edges_seconds() const { return edges_seconds_; }

 private:
  std::unique_ptr<EdgeSamplerInput> edges_, unfollowed_;
  std::unique_ptr<LightRegions> regions_;
  std::unique_ptr<EmitterEdges> emitter_edges_;
  std::unique_ptr<EdgeSampler> edge_sampler_;
  double edges_seconds_ = 0, edge_sampler_seconds_ = 0;
};

// One row per term.
struct TermType {
  const char* name;
  const char* description;
  std::unique_ptr<Term> (*make)(TermInput& input);
  bool (*applies)(const Scene& scene);  // whether the scene has anything that the term could be of
  bool (*changes)(const Moved& moved);  // whether it can differ from zero where this moves
  // The least number of samples in a sample of a pixel: whole numbers from 1 where they belong to
  // paths, less than 1 where they belong to the film.
  double least_samples = 1;
  // Paths are this term's samples, and what it takes to trace them is booked on it even if only
  // others are computed. One row.
  bool traces_paths = false;
  bool edges = false;                  // it samples edges: rare events
  bool moved_with_directions = false;  // its mean changes where directions move, direction_field.h
  int film_stream = 0;                 // distinguishes the random numbers of terms on the film
  bool regions = false;     // it is of samplers that keep regions of light apart, and of no others
  bool moved_film = false;  // it is of methods that move positions on the film, and of no others

  // None of its samples belongs to a path.
  bool on_film_alone() const { return least_samples < 1; }
};
// In the order of --samples and of all tables.
std::span<const TermType> term_types();
// Whether a sampler has a term. closed: light is known in closed form, which holds whatever
// vertices see. moved_film: positions on the film may move.
bool has_term(const EdgeSamplerType& sampler, const TermType& type, bool closed, bool moved_film);
// The rows that the sampler has and that apply to the scene, in their order: forward and reverse
// mode, fits and comparisons ask here.
std::vector<const TermType*> terms_of(const Scene& scene, const EdgeSamplerType& sampler,
                                      bool closed = false, bool moved_film = false);
// What any of the parameters moves.
Moved moved_in(const Scene& scene, std::span<const Parameter> parameters);
// Of those that are computed, the ones that can differ from zero, by index.
std::vector<bool> changed_terms(std::span<const TermType* const> types,
                                const std::vector<bool>& computed, const Moved& moved);
// The row that is on the film alone.
const TermType& film_term();
// Sums of all terms are kept on the stack: room for them, and for one more.
inline constexpr size_t kMostTerms = 8;

}  // namespace limn
