// One sample of a pixel: its paths, the first of which carries the terms at vertices.
#include "integrators/methods/term_estimator.h"

#include <array>

#include "integrators/terms/camera_path.h"
#include "integrators/terms/path_log.h"

namespace limn {
namespace {

Scene seeded(const Scene& scene, std::span<const Parameter> parameters) {
  Scene copy = deep_copy(scene);
  for (size_t k = 0; k < parameters.size(); ++k) parameters[k].seed(copy, static_cast<int>(k));
  return copy;
}

Lanes natural_steps(std::span<const Parameter> parameters) {
  Lanes steps{1, 1, 1, 1};
  for (size_t k = 0; k < parameters.size(); ++k) {
    steps[static_cast<int>(k)] = parameters[k].natural_step;
  }
  return steps;
}

}  // namespace

std::vector<const TermType*> terms_of(const Scene& scene) {
  std::vector<const TermType*> types;
  for (const TermType& type : term_types()) {
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
      types_(terms_of(scene)) {
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
  VertexTerms(const TermEstimator& estimator, SampleSink& sink)
      : estimator_(estimator), sink_(sink), sums_() {}

  void operator()(const SurfacePoint<Dual>& surface, const Scattering<Dual>& scattering,
                  const Rgb<Dual>& throughput, int bounces, const Rng& key) {
    const Rgb<double> weight = value(throughput);
    const PathVertex vertex{surface, scattering, weight, bounces, key, sink_.log()};
    if (vertex.log) log_vertex(*vertex.log, surface, scattering, weight, bounces);
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      const Term* term = estimator_.terms_[slot].get();
      if (!term || !term->uses_vertices()) continue;
      const Stopwatch watch;
      TermCost& cost = sink_.cost(slot);
      term->add_at_vertex(vertex, static_cast<int>(estimator_.samples_[slot]), cost, sums_[slot]);
      cost.seconds += watch.seconds();
    }
  }

  const Rgb<Lanes>& sum(size_t slot) const { return sums_[slot]; }

 private:
  const TermEstimator& estimator_;
  SampleSink& sink_;
  std::array<Rgb<Lanes>, kMostTerms> sums_;
};

void TermEstimator::add_pixel(const PixelSample& at, const Rng& key, SampleSink& sink) const {
  const int paths = paths_ ? static_cast<int>(samples_[pixel_slot_]) : 1;
  for (int i = 0; i < paths; ++i) {
    const Rng path_key = key.copy(Purpose::kPathCopy, i);
    if (i == 0 && (vertices_ || sink.log())) {
      VertexTerms vertices(*this, sink);
      add_path(at, path_key, vertices, 1.0 / paths, sink);
      add_vertices(at, vertices, sink);
    } else if (sink.log()) {
      PathLog log(*sink.log());
      add_path(at, path_key, log, 1.0 / paths, sink);
    } else {
      NoVisitor nothing;
      add_path(at, path_key, nothing, 1.0 / paths, sink);
    }
  }
}

void TermEstimator::add_vertices(const PixelSample& at, const VertexTerms& vertices,
                                 SampleSink& sink) const {
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    if (!terms_[slot] || !terms_[slot]->uses_vertices()) continue;
    if (is_finite(vertices.sum(slot))) {
      sink.add(slot, at, vertices.sum(slot), 1.0 / static_cast<int>(samples_[slot]));
    } else {
      sink.reject(at, slot_name(slot));
    }
  }
}

// One path: radiance, and what the terms make of it.
template <class Visitor>
void TermEstimator::add_path(const PixelSample& at, const Rng& key, Visitor& visitor, double weight,
                             SampleSink& sink) const {
  const FilmPosition film = sample_pixel_filter(scene_.film, at.x, at.y, key);
  const auto ray = camera_.ray(film.x, film.y);
  const Ray primal = camera_ray(
      scene_, CameraRay<double>{value(ray.origin), value(ray.direction), ray.t_min, ray.t_max});
  if (sink.log()) log_camera_ray(*sink.log(), film.x, film.y, primal.origin, primal.direction);
  RayCount rays;
  PathTracer<Dual, Visitor> path(context_, rays, visitor);
  const Rgb<Dual> radiance = path.from_ray(primal, ray.origin, ray.direction, 0, key);
  sink.cost(pixel_slot_).add(rays);
  ++sink.cost(pixel_slot_).samples;
  bool finite = is_finite(value(radiance));
  for (const auto& term : terms_) {
    if (term && term->uses_paths()) finite = finite && is_finite(term->add_path(radiance));
  }
  if (!finite) {
    sink.reject(at, slot_name(pixel_slot_));
    return;
  }
  sink.add_radiance(at, value(radiance), weight);
  for (size_t slot = 0; slot < terms_.size(); ++slot) {
    if (terms_[slot] && terms_[slot]->uses_paths()) {
      sink.add(slot, at, terms_[slot]->add_path(radiance), weight);
    }
  }
}

void TermEstimator::describe(GradientStats& stats) const {
  stats.setup.emplace_back("ray tracer", tracer_seconds_);
  if (const EdgeSamplerInput* edges = input_.made_edges()) {
    stats.setup.emplace_back("edges", input_.edges_seconds());
    for (const EdgeClass c : {EdgeClass::kSmooth, EdgeClass::kSharp, EdgeClass::kBorder,
                              EdgeClass::kIrregular, EdgeClass::kFlat}) {
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
