// One sample of a pixel: its paths, the first of which carries the terms at vertices.
#include "integrators/methods/term_estimator.h"

#include <limits>

#include "integrators/terms/camera_path.h"
#include "integrators/terms/path_log.h"

namespace limn {
namespace {

Scene seeded(const Scene& scene, std::span<const Parameter> parameters) {
  Scene copy = deep_copy(scene);
  for (size_t k = 0; k < parameters.size(); ++k) parameters[k].seed(copy, static_cast<int>(k));
  return copy;
}

// With one parameter the other lanes are free: a pilot lets directions turn there, at the rate of
// what moves. Edges that move by it alone count for so much less than those of the parameter. Not
// tuned.
constexpr double kTurnShare = 0.3;

// What a sample comes to that asks for a ray which cannot be traced.
const double kNan = std::numeric_limits<double>::quiet_NaN();
const Lanes kNotFinite{kNan, kNan, kNan, kNan};

Lanes natural_steps(std::span<const Parameter> parameters) {
  const double free = parameters.size() == 1 ? kTurnShare * parameters[0].natural_step : 1;
  Lanes steps{free, free, free, free};
  for (size_t k = 0; k < parameters.size(); ++k) {
    steps[static_cast<int>(k)] = parameters[k].natural_step;
  }
  return steps;
}

}  // namespace

std::vector<const TermType*> terms_of(const Scene& scene, const EdgeSamplerType& sampler) {
  std::vector<const TermType*> types;
  for (const TermType& type : term_types()) {
    if (type.regions && !sampler.regions) continue;
    if (type.applies(scene)) types.push_back(&type);
  }
  return types;
}

TermEstimator::TermEstimator(const Scene& scene, std::span<const Parameter> parameters,
                             const std::vector<bool>& computed, const EdgeSamplerType& sampler,
                             int threads)
    : scene_(seeded(scene, parameters)),
      lanes_(static_cast<int>(parameters.size())),
      lane_scale_(natural_steps(parameters)),
      tracer_([&] {
        const Stopwatch watch;
        auto tracer = make_embree_tracer(scene_, threads);
        tracer_seconds_ = watch.seconds();
        return tracer;
      }()),
      lights_(scene_),
      context_{scene_, *tracer_, lights_},
      camera_(scene_.camera),
      input_(context_, lanes_, lane_scale_, sampler, threads),
      types_(terms_of(scene, sampler)),
      rates_(scene_, lanes_) {
  for (size_t slot = 0; slot < types_.size(); ++slot) {
    if (types_[slot]->traces_paths) pixel_slot_ = slot;
    terms_.push_back(computed[slot] ? types_[slot]->make(input_) : nullptr);
    if (!terms_[slot]) continue;
    paths_ = paths_ || terms_[slot]->uses_paths();
    vertices_ = vertices_ || terms_[slot]->uses_vertices();
  }
}

double TermEstimator::work(size_t slot, const TermCost& cost) const {
  return terms_[slot] ? terms_[slot]->work(cost) : static_cast<double>(cost.rays);
}

// The terms at vertices, as the visitor of a path.
class TermEstimator::VertexTerms {
 public:
  VertexTerms(const TermEstimator& estimator, const PixelCounts& counts, SampleSink& sink)
      : estimator_(estimator), counts_(counts), sink_(sink), sums_() {}

  void operator()(const SurfacePoint<Dual>& surface, const Scattering<Dual>& scattering,
                  const Rgb<Dual>& throughput, const DirectionMotion* motion, int bounces,
                  const Rng& key) {
    const Rgb<double> weight = value(throughput);
    const PathVertex vertex{surface, scattering, weight,     motion ? motion->turn : Vec3<Lanes>{},
                            bounces, key,        sink_.log()};
    if (vertex.log) log_vertex(*vertex.log, surface, scattering, weight, bounces);
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      const Term* term = estimator_.terms_[slot].get();
      if (!term || !term->uses_vertices()) continue;
      if (skipped(slot, key)) continue;
      const Stopwatch watch;
      TermCost& cost = sink_.cost(slot);
      const int samples = std::max(1, static_cast<int>(counts_[slot]));
      try {
        term->add_at_vertex(vertex, samples, cost, sums_[slot]);
      } catch (const UntraceableRay&) {
        sums_[slot] = grey(kNotFinite);
      }
      cost.seconds += watch.seconds();
    }
  }

  const Rgb<Lanes>& sum(size_t slot) const { return sums_[slot]; }

 private:
  // One decision for all vertices of a path.
  bool skipped(size_t slot, const Rng& key) const {
    return counts_[slot] < 1 && key.at(Purpose::kTermRoulette, slot).uniform() >= counts_[slot];
  }

  const TermEstimator& estimator_;
  const PixelCounts& counts_;
  SampleSink& sink_;
  std::array<Rgb<Lanes>, kMostTerms> sums_;
};

void TermEstimator::add_pixel(const PixelSample& at, const Rng& key, SampleSink& sink) const {
  const PixelCounts counts = plan_.counts_at(at);
  const DirectionField* field = plan_.field_at(at);
  const int paths = paths_ ? static_cast<int>(counts[pixel_slot_]) : 1;
  for (int i = 0; i < paths; ++i) {
    const Rng path_key = key.copy(Purpose::kPathCopy, i);
    if (i == 0 && (vertices_ || sink.log())) {
      VertexTerms vertices(*this, counts, sink);
      add_path(at, trace(at, path_key, field, vertices, sink), 1.0 / paths, sink);
      add_vertices(at, vertices, counts, sink);
    } else if (sink.log()) {
      PathLog log(*sink.log());
      add_path(at, trace(at, path_key, field, log, sink), 1.0 / paths, sink);
    } else {
      NoVisitor nothing;
      add_path(at, trace(at, path_key, field, nothing, sink), 1.0 / paths, sink);
    }
  }
}

void TermEstimator::add_vertices(const PixelSample& at, const VertexTerms& vertices,
                                 const PixelCounts& counts, SampleSink& sink) const {
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    if (!terms_[slot] || !terms_[slot]->uses_vertices()) continue;
    if (is_finite(vertices.sum(slot))) {
      sink.add(slot, at, vertices.sum(slot), 1.0 / counts[slot]);
    } else {
      sink.reject(at, slot_name(slot));
    }
  }
}

template <class Visitor>
TermEstimator::Path TermEstimator::trace(const PixelSample& at, const Rng& key,
                                         const DirectionField* field, Visitor& visitor,
                                         SampleSink& sink) const {
  const FilmPosition film = sample_pixel_filter(scene_.film, at.x, at.y, key);
  const auto ray = camera_.ray(film.x, film.y);
  const Ray primal = camera_ray(
      scene_, CameraRay<double>{value(ray.origin), value(ray.direction), ray.t_min, ray.t_max});
  if (sink.log()) log_camera_ray(*sink.log(), film.x, film.y, primal.origin, primal.direction);
  RayCount rays;
  PathTracer<Dual, Visitor> tracer(context_, rays, visitor);
  if (field) tracer.move_directions(rates_, *field);
  tracer.take_light_samples(plan_.light_samples);
  Path path;
  try {
    path.radiance = tracer.from_ray(primal, ray.origin, ray.direction, 0, key);
  } catch (const UntraceableRay&) {
    path.radiance = grey(Dual(kNotFinite[0]));
  }
  path.score = tracer.score();
  path.light_difference = tracer.light_difference();
  path.later_lights = tracer.later_lights();
  sink.cost(pixel_slot_).add(rays);
  ++sink.cost(pixel_slot_).samples;
  path.finite = is_finite(value(path.radiance)) && is_finite(path.score);
  for (const auto& term : terms_) {
    if (term && term->uses_paths()) {
      path.finite = path.finite && is_finite(term->add_path(path.radiance));
    }
  }
  return path;
}

// Radiance, and what the terms make of it.
void TermEstimator::add_path(const PixelSample& at, const Path& path, double weight,
                             SampleSink& sink) const {
  if (!path.finite) {
    sink.reject(at, slot_name(pixel_slot_));
    return;
  }
  sink.add_radiance(at, value(path.radiance), weight);
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    if (terms_[slot] && terms_[slot]->uses_paths()) {
      sink.add(slot, at, terms_[slot]->add_path(path.radiance) + path.score, weight);
    }
  }
}

bool TermEstimator::sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                                FilmSample& sample) const {
  try {
    return terms_[slot]->sample_film(u, key, rays, sample);
  } catch (const UntraceableRay&) {
    sample.value = grey(kNotFinite);
    return true;
  }
}

TermEstimator::Sample TermEstimator::sample(const PixelSample& at, const Rng& key,
                                            const DirectionField* field, SampleSink& sink) const {
  PixelCounts ones;
  ones.fill(1);
  VertexTerms vertices(*this, ones, sink);
  const Path path = trace(at, key, field, vertices, sink);
  const Rgb<Dual>& light = path.light_difference;
  Sample sample{value(path.radiance), {},         path.score, {light.r.d, light.g.d, light.b.d},
                path.later_lights,    path.finite};
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    const Term* term = terms_[slot].get();
    if (!term) continue;
    if (term->uses_paths()) sample.terms[slot] = term->add_path(path.radiance);
    if (term->uses_vertices()) sample.terms[slot] = vertices.sum(slot);
    sample.finite = sample.finite && is_finite(sample.terms[slot]);
  }
  return sample;
}

void TermEstimator::describe(GradientStats& stats) const {
  stats.setup.emplace_back("ray tracer", tracer_seconds_);
  if (const EdgeSamplerInput* edges = input_.made_edges()) {
    stats.setup.emplace_back("edges", input_.edges_seconds());
    for (const EdgeClass c : {EdgeClass::kSmooth, EdgeClass::kSharp, EdgeClass::kBorder,
                              EdgeClass::kIrregular, EdgeClass::kFlat, EdgeClass::kCrossing}) {
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
