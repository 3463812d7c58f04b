// One sample of a pixel: its paths, the first of which carries the terms at vertices.
#include "integrators/pilot/term_estimator.h"

#include <algorithm>

#include "integrators/edges/scene_edges.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/path_log.h"
#include "integrators/pilot/vertex_terms.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"

namespace limn {
namespace {

Scene seeded(const Scene& scene, std::span<const Parameter> parameters,
             const std::optional<double>& time) {
  Scene copy = deep_copy(scene);
  for (size_t k = 0; k < parameters.size(); ++k) parameters[k].seed(copy, static_cast<int>(k));
  if (time) set_time(copy, *time);
  return copy;
}

// In a pilot directions turn at the rate of what moves. Edges that move by it alone count for so
// much less than those of the parameters: the first share for one parameter (not tuned), the second
// for several. Turns draw samples away from the parameters, whose terms the pilot then takes for
// noisier than they are: with 0.3, four at once had 1.1 to 1.2 times the squared error in a soft
// shadow, with 0.02 1.15 times in a chandelier.
constexpr double kFreeTurnShare = 0.3, kTurnShare = 0.05;

Lanes natural_steps(std::span<const Parameter> parameters) {
  // A pilot lets directions turn in lanes that are free.
  const double free = kFreeTurnShare * parameters[0].natural_step;
  Lanes steps{free, free, free, free};
  for (size_t k = 0; k < parameters.size(); ++k) {
    steps[static_cast<int>(k)] = parameters[k].natural_step;
  }
  return steps;
}

// Alike in comparable units in all lanes; with one parameter by the unit of MotionRates.
DirectionField turning_about_axes(const Lanes& steps, int lanes) {
  const double share = lanes == 1 ? kFreeTurnShare : kTurnShare;
  DirectionField field;
  for (int k = 0; k < 3; ++k) field.turn[k][k + 1] = share * steps[0] / steps[k + 1];
  field.score = field.turn;
  return field;
}

bool draws_edges(const std::vector<const TermType*>& types, const std::vector<bool>& sampled) {
  for (size_t t = 0; t < types.size(); ++t)
    if (sampled[t] && types[t]->edges) return true;
  return false;
}

}  // namespace

TermEstimator::TermEstimator(const Scene& scene, std::span<const Parameter> parameters,
                             const std::vector<const TermType*>& types,
                             const std::vector<bool>& computed, const EdgeSamplerType& sampler,
                             int threads, const TermExtras& extras)
    : changed_(changed_terms(types, computed, moved_in(scene, parameters))),
      scene_(seeded(scene, parameters, extras.time)),
      lanes_(static_cast<int>(parameters.size())),
      lane_scale_(natural_steps(parameters)),
      traced_(scene_, threads,
              {.closed = extras.closed,
               .edges = draws_edges(types, changed_) || extras.warping,
               .of_differences = extras.of_differences}),
      camera_(scene_.camera),
      filter_(scene_.film.filter),
      input_(traced_.context(), lanes_, lane_scale_, sampler, threads, extras.warping != nullptr,
             extras.kept),
      types_(types),
      moves_film_(extras.moved_film),
      rates_(scene_, lanes_, lane_scale_),
      turning_(turning_about_axes(lane_scale_, lanes_)) {
  for (size_t slot = 0; slot < types_.size(); ++slot) {
    if (types_[slot]->traces_paths) pixel_slot_ = slot;
    terms_.push_back(changed_[slot] ? types_[slot]->make(input_) : nullptr);
    if (!terms_[slot]) continue;
    paths_ = paths_ || terms_[slot]->uses_paths();
    vertices_ = vertices_ || terms_[slot]->uses_vertices();
  }
  const bool moved = moved_in(scene, parameters).any();
  if (!moved && !extras.closed) values_.reset(new ValuePaths(traced_.context(), parameters));
  if (const Warping* warping = extras.warping; warping && moved) {
    warp_field_ = std::make_unique<WarpField>(scene_, traced_.context().tracer, input_.edges(),
                                              warping->options, warping->unbiased);
  }
}

void TermEstimator::set_plan(SamplePlan plan) {
  const bool moved = !plan_.film.empty();
  plan_ = std::move(plan);
  reach_ = traced_.context().closed ? 0 : shared_reach(scene_.film, plan_.numbers);
  most_paths_ = std::max(1, static_cast<int>(plan_.uniform[pixel_slot_]));
  if (reach() > 0) plan_.share_paths(pixel_slot_, reach_, scene_.film);
  for (const PixelCounts& counts : plan_.counts) {
    most_paths_ = std::max(most_paths_, static_cast<int>(counts[pixel_slot_]));
  }
  if (!moves_film_ || (plan_.film.empty() && !moved)) return;
  FilmMotionAt motion;
  if (!plan_.film.empty()) motion = [this](int x, int y) { return film_motion(x, y); };
  for (const auto& term : terms_) {
    if (term) term->move_film(motion);
  }
}

double TermEstimator::work(size_t slot, const TermCost& cost) const {
  return terms_[slot] ? terms_[slot]->work(cost) : static_cast<double>(cost.rays);
}

double TermEstimator::first_work(size_t slot, const TermCost& cost) const {
  return terms_[slot] ? terms_[slot]->first_work(cost) : 0;
}

// Paths on their way into the sums: those of several samples go side by side, and are added in
// their order.
class TermEstimator::PathBatch {
 public:
  PathBatch(const TermEstimator& estimator, SampleSink& sink) : estimator_(estimator), sink_(sink) {
    walks_.reserve(kMost);
    vertices_.reserve(kMost);
  }

  // counts: of the terms at its vertices; null for a path without.
  void add(const PathStart& place, const Rng& key, double weight, const PixelCounts* counts) {
    if (walks_.size() == kMost) finish();
    if (counts) vertices_.emplace_back(estimator_, *counts, nullptr, nullptr, sink_);
    walks_.emplace_back(key, 0, counts ? &vertices_.back() : nullptr);
    walks_.back().field = estimator_.plan_.field_at(place.at);
    places_.push_back(estimator_.weighed(place, key));
    weights_.push_back(weight);
  }
  void finish() {
    const PathCosts costs = estimator_.trace<VertexTerms>(places_, walks_, nullptr, false);
    add_cost(costs, walks_.size(), sink_.cost(estimator_.pixel_slot_));
    for (size_t i = 0; i < walks_.size(); ++i) {
      const PathStart& start = places_[i];
      estimator_.add_path(start, estimator_.path_of(walks_[i].sums, walks_[i].failed), weights_[i],
                          sink_);
      if (walks_[i].visitor) estimator_.add_vertices(start, *walks_[i].visitor, sink_);
    }
    walks_.clear();
    vertices_.clear();
    places_.clear();
    weights_.clear();
  }

 private:
  static constexpr size_t kMost = PathTracer<Dual, VertexTerms>::kMostWalks;

  const TermEstimator& estimator_;
  SampleSink& sink_;
  std::vector<Walk<Dual, VertexTerms>> walks_;
  std::vector<VertexTerms> vertices_;  // of the paths that have them
  std::vector<PathStart> places_;
  std::vector<double> weights_;
};

TermEstimator::PathStart TermEstimator::weighed(PathStart start, const Rng& key) const {
  if (!start.shared)
    start.weight = pixel_filter_weight(scene_.film, filter_, start.at.x, start.at.y, key);
  return start;
}

void TermEstimator::add_samples(std::span<const KeyedSample> samples,
                                std::span<const SharedPlace* const> places,
                                SampleSink& sink) const {
  const auto shared = [&](size_t s, int i) {
    return places.empty() ? nullptr : places[s] + i;  // of the i-th path
  };
  if (sink.log()) {
    for (size_t s = 0; s < samples.size(); ++s) {
      add_logged(samples[s].at, samples[s].key, shared(s, 0), sink);
    }
    return;
  }
  if (values_) return add_values(samples, places, sink);
  PathBatch batch(*this, sink);
  for (size_t s = 0; s < samples.size(); ++s) {
    const auto& [at, key] = samples[s];
    const PixelCounts counts = plan_.counts_at(at);
    const int paths = paths_ ? static_cast<int>(counts[pixel_slot_]) : 1;
    const int all = paths * places_of_path();
    for (int i = 0; i < all; ++i) {
      batch.add({at, i >= paths, shared(s, i), i}, key.path(i % paths), 1.0 / all,
                i == 0 && vertices_ ? &counts : nullptr);
    }
  }
  batch.finish();
  if (places.empty()) add_moved_pixels(samples, sink);
}

// Of terms that move with positions on the film by themselves.
void TermEstimator::add_moved_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    const Term* term = terms_[slot].get();
    if (!term || !term->uses_moved_pixels()) continue;
    const Stopwatch watch;
    std::vector<MovedPixel> pixels;
    std::vector<double> weights;
    const auto finish = [&] {
      std::array<Rgb<Lanes>, kMostMovedPixels> sums{};
      term->add_at_pixels(pixels, sink.cost(slot), {sums.data(), pixels.size()});
      for (size_t i = 0; i < pixels.size(); ++i) {
        if (is_finite(sums[i])) {
          sink.add(slot, pixels[i].at, sums[i], weights[i]);
        } else {
          sink.reject(pixels[i].at, slot_name(slot));
        }
      }
      pixels.clear();
      weights.clear();
    };
    for (const auto& [at, key] : samples) {
      const FilmMotion* motion = plan_.film_motion(at.x, at.y);
      if (!motion || (is_zero(motion->x) && is_zero(motion->y))) continue;
      const double count = plan_.counts_at(at)[slot];
      if (count < 1 && key.at(Purpose::kTermRoulette, slot).uniform() >= count) continue;
      for (int i = 0; i < std::max(1, static_cast<int>(count)); ++i) {
        if (pixels.size() == kMostMovedPixels) finish();
        pixels.push_back({at, key.at(Purpose::kFilmCopy, i), *motion});
        weights.push_back(1 / count);
      }
    }
    finish();
    sink.cost(slot).seconds += watch.seconds();
  }
}

// The same, path by path.
void TermEstimator::add_logged(const PixelSample& at, const Rng& key, const SharedPlace* shared,
                               SampleSink& sink) const {
  const PixelCounts counts = plan_.counts_at(at);
  const int paths = paths_ ? static_cast<int>(counts[pixel_slot_]) : 1;
  const int all = paths * places_of_path();
  const auto add = [&](auto& visitor, int i) {
    const Rng path_key = key.path(i % paths);
    const PathStart start = weighed({at, i >= paths, shared ? shared + i : nullptr, i}, path_key);
    const Path path =
        trace_one(start, path_key, plan_.field_at(at), visitor, sink.log(), sink.cost(pixel_slot_));
    add_path(start, path, 1.0 / all, sink);
  };
  for (int i = 0; i < all; ++i) {
    if (i == 0) {
      VertexTerms vertices(*this, counts, nullptr, nullptr, sink);
      add(vertices, i);
      add_vertices(weighed({at, false, shared}, key.path(0)), vertices, sink);
    } else {
      PathLog log(*sink.log());
      add(log, i);
    }
  }
  const KeyedSample sample{at, key};
  if (!shared) add_moved_pixels({&sample, 1}, sink);
}

void TermEstimator::add_vertices(const PathStart& start, const VertexTerms& vertices,
                                 SampleSink& sink) const {
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    if (!terms_[slot] || !terms_[slot]->uses_vertices()) continue;
    if (is_finite(vertices.sum(slot))) {
      sink.add(slot, start.at, vertices.sum(slot), start.weight / vertices.counts()[slot],
               {start.shared});
    } else {
      sink.reject(start.at, slot_name(slot));
    }
  }
}

template <class Visitor>
TermEstimator::PathCosts TermEstimator::trace(std::span<const PathStart> places,
                                              std::span<Walk<Dual, Visitor>> walks, SampleLog* log,
                                              bool twice) const {
  PathCosts costs;
  using Tracer = PathTracer<Dual, Visitor>;
  Tracer tracer(traced_.context(), costs.rays);
  tracer.move_directions(rates_);
  if (splits_now(twice)) tracer.split_by(&rates_);
  std::array<StartRay<Dual>, Tracer::kMostWalks> starts;
  std::array<LensPoint, Tracer::kMostWalks> lenses;
  sample_lenses(scene_.camera, walks, lenses);
  for (size_t i = 0; i < walks.size(); ++i) {
    const PixelSample& at = places[i].at;
    const SharedPlace* shared = places[i].shared;
    FilmPosition film = shared
                            ? FilmPosition{at.x + shared->x, at.y + shared->y}
                            : sample_pixel_filter(scene_.film, filter_, at.x, at.y, walks[i].key);
    if (places[i].mirrored) film = mirrored_in_pixel(scene_.film, at.x, at.y, film);
    const auto ray = [&] {
      const FilmMotion* motion = plan_.film_motion(at.x, at.y);
      if (!motion) return ray_at(camera_, {film, lenses[i]});
      const FilmMotion here = tapered(*motion, scene_.film, at.x, at.y, film.x, film.y);
      return camera_.ray(Dual(film.x, here.x), Dual(film.y, here.y));
    }();
    starts[i] = {camera_ray(scene_, CameraRay<double>{value(ray.origin), value(ray.direction),
                                                      ray.t_min, ray.t_max}),
                 ray.origin, ray.direction};
    if (log) log_camera_ray(*log, film.x, film.y, value(ray.origin), value(ray.direction));
  }
  if (!warp_field_) {
    tracer.follow_rays({starts.data(), walks.size()}, walks);
    return costs;
  }
  for (size_t i = 0; i < walks.size(); ++i) {
    DirectionWarper warper(*warp_field_, costs.rays);
    tracer.warp_directions(warper);
    tracer.follow_rays({&starts[i], 1}, walks.subspan(i, 1));
    costs.warped.add(warper.count());
  }
  return costs;
}

TermEstimator::Path TermEstimator::path_of(const PathSums<Dual>& found, bool failed) const {
  Path path{found, !failed};
  path.finite = path.finite && is_finite(value(found.radiance)) && is_finite(found.score);
  for (const auto& term : terms_) {
    if (term && term->uses_paths()) {
      path.finite = path.finite && is_finite(term->add_path(found.radiance));
    }
  }
  return path;
}

template <class Visitor>
TermEstimator::Path TermEstimator::trace_one(const PathStart& place, const Rng& key,
                                             const DirectionField* field, Visitor& visitor,
                                             SampleLog* log, TermCost& cost, bool twice) const {
  Walk<Dual, Visitor> walk(key, 0, &visitor);
  walk.field = field;
  const PathCosts costs = trace<Visitor>({&place, 1}, {&walk, 1}, log, twice);
  add_cost(costs, 1, cost);
  return path_of(walk.sums, walk.failed);
}

void TermEstimator::add_cost(const PathCosts& costs, size_t paths, TermCost& cost) {
  cost.add(costs.rays);
  cost.samples += paths;
  cost.warped += costs.warped.fields;
  cost.dominated += costs.warped.dominated;
  cost.dropped += costs.warped.dropped;
}

// Radiance, and what the terms make of it.
void TermEstimator::add_path(const PathStart& start, const Path& path, double weight,
                             SampleSink& sink) const {
  const PixelSample& at = start.at;
  weight *= start.weight;
  if (!path.finite) {
    sink.reject(at, slot_name(pixel_slot_));
    return;
  }
  const SharedPath shared{start.shared, start.number,
                          static_cast<int>(plan_.counts_at(at)[pixel_slot_]),
                          plan_.taken.counts.empty() ? nullptr : &plan_.taken};
  sink.add_radiance(at, value(path.found.radiance), weight, shared);
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    if (terms_[slot] && terms_[slot]->uses_paths()) {
      sink.add(slot, at, terms_[slot]->add_path(path.found.radiance) + path.found.score, weight,
               shared);
    }
  }
}

bool TermEstimator::sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                                FilmSample& sample) const {
  try {
    FilmLanes lanes(scene_, !plan_.film.empty(), plan_.fields.empty() ? nullptr : &rates_, sample);
    terms_[slot]->sample_film(u, key, lanes);
    rays.closest += lanes.cost().rays - lanes.cost().shadow_rays;
    rays.shadow += lanes.cost().shadow_rays;
    return lanes.added();
  } catch (const UntraceableRay&) {
    sample.value = grey(kNotFinite);
    return true;
  }
}

Lanes TermEstimator::turned(const Lanes& turning, const Lanes& held) const {
  Lanes result;
  for (int k = 0; k < 3; ++k) {
    result[k] = (turning[k + 1] - held[k + 1]) / turning_.turn[k][k + 1];
  }
  return result;
}
Rgb<Lanes> TermEstimator::turned(const Rgb<Lanes>& turning, const Rgb<Lanes>& held) const {
  return {turned(turning.r, held.r), turned(turning.g, held.g), turned(turning.b, held.b)};
}
Rgb<Lanes> TermEstimator::at_rest(const Rgb<Lanes>& turning, const Rgb<Lanes>& turned) const {
  Rgb<Lanes> result = turning;
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < 3; ++k) result[c][k + 1] -= turning_.turn[k][k + 1] * turned[c][k];
  }
  return result;
}

// All that turns change is linear in them. With one parameter they have lanes of their own. With
// more a path is traced twice, first with directions at rest; but terms at vertices draw edges by
// how fast these move, so they evaluate both at once.
TermEstimator::Sample TermEstimator::sample(const PixelSample& at, const Rng& key, bool turns,
                                            bool again, SampleSink& sink) const {
  PixelCounts ones;
  ones.fill(1);
  const bool twice = turns && lanes_ > 1;
  VertexMotions motions;
  Path held;
  if (twice) {
    const DirectionField rest;  // as a field, so that both take the same steps
    TermCost uncounted;
    held = trace_one({at}, key, &rest, motions, nullptr, uncounted, twice);
  }
  TracedDraws traced;
  VertexTerms vertices(*this, ones, twice ? &motions : nullptr, &traced, sink);
  if (again) vertices.draw_twice();
  const auto trace_at = [&](bool mirrored) {
    return trace_one({at, mirrored}, key, turns ? &turning_ : nullptr, vertices, nullptr,
                     sink.cost(pixel_slot_), twice);
  };
  Path path = trace_at(false);
  if (places_of_path() == 2) {  // no terms are at its vertices, and no directions turn
    const Path other = trace_at(true);
    path.found.radiance = (path.found.radiance + other.found.radiance) * 0.5;
    path.finite = path.finite && other.finite;
  }
  const double weight = weighed({at}, key).weight;
  if (weight != 1) {
    for (PathSums<Dual>* sums : {&path.found, &held.found}) {
      sums->radiance = sums->radiance * weight;
      sums->score = sums->score * weight;
    }
    vertices.scale(weight);
  }
  const auto split = [&](const Rgb<Lanes>& turning, const Rgb<Lanes>& resting) {
    if (!turns) return TurnedSample{turning, {}, {}};
    return TurnedSample{twice ? resting : turning, turned(turning, resting), {}};
  };
  Sample sample{
      value(path.found.radiance), {}, {}, {}, traced, path.finite && (!twice || held.finite)};
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    const Term* term = terms_[slot].get();
    if (!term) continue;
    TurnedSample& to = sample.terms[slot];
    if (term->uses_paths())
      to = split(term->add_path(path.found.radiance), term->add_path(held.found.radiance));
    if (term->uses_vertices()) {
      const Rgb<Lanes>& sum = vertices.sum(slot);
      to = twice ? TurnedSample{at_rest(sum, vertices.turned(slot)), vertices.turned(slot), {}}
                 : split(sum, {});
      sample.pair[slot] = {sum, vertices.again(slot)};
      sample.listing[slot] = vertices.listing(slot);
    }
    if (term->uses_moved_pixels()) to.value = sample_moved_pixel(slot, at, key, sink);
    if (turns && slot == pixel_slot_) to.scores = turned(path.found.score, {});
    sample.finite = sample.finite && is_finite(to.value) && is_finite(to.turned);
  }
  return sample;
}

Rgb<Lanes> TermEstimator::sample_moved_pixel(size_t slot, const PixelSample& at, const Rng& key,
                                             SampleSink& sink) const {
  Rgb<Lanes> sum;
  const FilmMotion& motion = *film_motion(at.x, at.y);
  if (is_zero(motion.x) && is_zero(motion.y)) return sum;
  const MovedPixel pixel{at, key.at(Purpose::kFilmCopy, 0), motion};
  terms_[slot]->add_at_pixels({&pixel, 1}, sink.cost(slot), {&sum, 1});
  return sum;
}

void TermEstimator::warn_of_kinks(std::vector<std::string>& warnings) const {
  std::vector<std::string> more;
  warn_of_contacts(scene_, edges(), more);
  for (const auto& term : terms_)
    if (term) term->warn_of_kinks(scene_, more);
  for (const std::string& text : more)
    if (std::find(warnings.begin(), warnings.end(), text) == warnings.end())
      warnings.push_back(text);
}

void TermEstimator::describe(GradientStats& stats) const {
  stats.setup.emplace_back("ray tracer", traced_.tracer_seconds());
  if (const EdgeSamplerInput* edges = input_.made_edges()) {
    stats.setup.emplace_back("edges", input_.edges_seconds());
    for (const EdgeClass c :
         {EdgeClass::kSmooth, EdgeClass::kSharp, EdgeClass::kBoundary, EdgeClass::kIrregular,
          EdgeClass::kFlat, EdgeClass::kIntersection, EdgeClass::kTexture}) {
      uint64_t count = 0;
      for (const EdgeMesh& object : edges->objects) count += object.count(c);
      stats.edges.emplace_back(edge_class_name(c), count);
    }
  }
  for (const auto& term : terms_) {
    if (term) term->describe(stats);
  }
}

}  // namespace limn
