#include "limn/integrators/gradient.h"

#include <fmt/format.h>

#include <algorithm>

#include "integrators/estimates/allocation.h"
#include "integrators/terms/camera_boundary.h"
#include "integrators/terms/pixel_samples.h"
#include "integrators/terms/shading_boundary.h"
#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {

const char* term_name(int term) {
  constexpr const char* kNames[] = {"interior", "camera", "boundary"};
  return kNames[term];
}

std::string to_string(const SampleCounts& samples) {
  return fmt::format("{},{},{}", samples.interior, samples.camera, samples.boundary);
}

void TermCost::merge(const TermCost& other) {
  seconds += other.seconds;
  rays += other.rays;
  samples += other.samples;
  no_edge += other.no_edge;
  zero_weight += other.zero_weight;
  occluded += other.occluded;
  counted += other.counted;
}

namespace {

using Costs = std::array<TermCost, kTermCount>;

// Samples [first, last) of every pixel.
struct Batch {
  uint64_t seed;
  int first, last;
  SampleCounts samples;
  int count() const { return last - first; }
};

// A pass differentiates up to kLanes parameters of one scene.
class Pass {
 public:
  Pass(const Scene& scene, const std::vector<std::string>& parameters,
       const GradientOptions& options, const RunSettings& settings)
      : scene_(seed(scene, parameters)),
        lanes_(static_cast<int>(parameters.size())),
        options_(options),
        settings_(settings),
        tracer_(make_embree_tracer(scene_, settings.threads)),
        lights_(scene_),
        context_{scene_, *tracer_, lights_},
        tiles_(make_tiles(scene_.film)) {
    if (options.terms[kBoundary] || options.terms[kCamera]) input_ = make_sampler_input(scene_);
    for (int k = 0; k < lanes_; ++k) {
      input_.lane_scale[k] = find_parameter(scene, parameters[k]).natural_step;
    }
    if (options.terms[kBoundary]) {
      sampler_ = make_edge_sampler(options.sampler, input_, settings.threads);
    }
    if (options.terms[kCamera]) {
      camera_ = std::make_unique<CameraBoundary>(context_, input_.objects, lanes_);
    }
  }
  Pass(const Pass&) = delete;
  Pass& operator=(const Pass&) = delete;

  double draw_cost() const { return sampler_ ? sampler_->draw_cost() : 0; }
  static size_t steps_per_batch(const Film& film) { return make_tiles(film).size() + 1; }

  // Sums over one batch. sums[lane][term] and radiance are crop_height by crop_width by 3.
  struct Output {
    std::vector<std::array<std::vector<double>, kTermCount>> sums;
    std::vector<double> radiance;
    Costs costs;
    NonFinite non_finite;
  };
  Output run_batch(const Batch& batch, ProgressCounter& progress) const {
    Output output;
    output.radiance.assign(size(), 0.0);
    output.sums.resize(lanes_);
    for (auto& terms : output.sums) {
      for (auto& sums : terms) sums.assign(size(), 0.0);
    }
    if (options_.terms[kInterior] || options_.terms[kBoundary]) {
      run_paths(batch, progress, output);
    }
    if (camera_ && !camera_->empty()) run_camera(batch, progress, output);
    progress.step();
    return output;
  }

 private:
  static Scene seed(const Scene& scene, const std::vector<std::string>& parameters) {
    Scene copy = deep_copy(scene);
    for (size_t k = 0; k < parameters.size(); ++k) {
      find_parameter(scene, parameters[k]).seed(copy, static_cast<int>(k));
    }
    return copy;
  }
  size_t size() const {
    return static_cast<size_t>(scene_.film.crop_width) * scene_.film.crop_height * 3;
  }

  void run_paths(const Batch& batch, ProgressCounter& progress, Output& output) const {
    std::vector<Costs> costs(tiles_.size());
    std::vector<NonFinite> bad(tiles_.size());
    parallel_for(tiles_.size(), settings_.threads, [&](size_t i) {
      if (progress.stopped()) return;
      run_tile(tiles_[i], batch, output, costs[i], bad[i]);
      progress.step();
    });
    for (size_t i = 0; i < tiles_.size(); ++i) {
      for (int term = 0; term < kTermCount; ++term) output.costs[term].merge(costs[i][term]);
      output.non_finite.merge(bad[i]);
    }
  }

  void run_tile(const Tile& tile, const Batch& batch, Output& output, Costs& costs,
                NonFinite& bad) const {
    const Stopwatch watch;
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        for (int s = batch.first; s < batch.last; ++s) {
          run_sample(batch, x, y, s, output, costs, bad);
        }
      }
    }
    costs[kInterior].seconds += watch.seconds() - costs[kBoundary].seconds;
  }

  void run_sample(const Batch& batch, int x, int y, int s, Output& output, Costs& costs,
                  NonFinite& bad) const {
    const Rng key = pixel_key(scene_, batch.seed, x, y, s);
    const int paths = options_.terms[kInterior] ? batch.samples.interior : 1;
    int first_without = 0;
    if (sampler_) {
      ShadingBoundary visitor(context_, input_.objects, *sampler_, batch.samples.boundary,
                              costs[kBoundary]);
      add_path({x, y, s}, key, visitor, 1.0 / paths, output, costs, bad);
      if (all_finite(visitor.sum())) {
        add(output, kBoundary, pixel_index(scene_.film, x, y), visitor.sum(),
            1.0 / batch.samples.boundary);
      } else {
        bad.add({x, y, s, term_name(kBoundary)});
      }
      first_without = 1;
    }
    for (int i = first_without; i < paths; ++i) {
      NoVisitor nothing;
      add_path({x, y, s}, key.copy(Purpose::kPathCopy, i), nothing, 1.0 / paths, output, costs,
               bad);
    }
  }

  struct PixelSample {
    int x, y, s;
  };

  // Radiance and the interior term of one path.
  template <class Visitor>
  void add_path(const PixelSample& at, const Rng& key, Visitor& visitor, double weight,
                Output& output, Costs& costs, NonFinite& bad) const {
    const FilmPosition film = sample_film(scene_.film, at.x, at.y, key);
    const Ray primal = camera_ray(scene_, scene_.camera.ray<double>(film.x, film.y));
    const auto ray = scene_.camera.ray<Dual>(film.x, film.y);
    RayCount rays;
    PathTracer<Dual, Visitor> path(context_, rays, visitor);
    const Rgb<Dual> radiance = path.from_ray(primal, ray.origin, ray.direction, 0, key);
    costs[kInterior].rays += rays.total();
    ++costs[kInterior].samples;
    const Rgb<Lanes> interior{radiance.r.d, radiance.g.d, radiance.b.d};
    if (!is_finite(value(radiance)) || !all_finite(interior)) {
      bad.add({at.x, at.y, at.s, term_name(kInterior)});
      return;
    }
    const size_t index = pixel_index(scene_.film, at.x, at.y);
    for (int c = 0; c < 3; ++c) output.radiance[index + c] += radiance[c].v * weight;
    if (options_.terms[kInterior]) add(output, kInterior, index, interior, weight);
  }

  static bool all_finite(const Rgb<Lanes>& value) {
    for (int k = 0; k < kLanes; ++k) {
      if (!is_finite({value.r[k], value.g[k], value.b[k]})) return false;
    }
    return true;
  }

  void add(Output& output, int term, size_t index, const Rgb<Lanes>& value, double weight) const {
    for (int k = 0; k < lanes_; ++k) {
      double* out = &output.sums[k][term][index];
      for (int c = 0; c < 3; ++c) out[c] += value[c][k] * weight;
    }
  }

  // Samples in strata along the summed length of all projected edges. The same whole number per
  // sample per pixel in every batch, so that all batches weigh alike.
  void run_camera(const Batch& batch, ProgressCounter& progress, Output& output) const {
    constexpr size_t kChunk = 1024;
    const Film& film = scene_.film;
    const auto per_sample =
        static_cast<size_t>(std::ceil(batch.samples.camera * film.crop_width * film.crop_height));
    const size_t count = per_sample * batch.count();
    const size_t first = per_sample * batch.first;
    const size_t chunks = (count + kChunk - 1) / kChunk;
    std::vector<std::vector<FilmSample>> samples(chunks);
    std::vector<TermCost> costs(chunks);
    std::vector<NonFinite> bad(chunks);
    parallel_for(chunks, settings_.threads, [&](size_t chunk) {
      if (progress.stopped()) return;
      const Stopwatch watch;
      RayCount rays;
      for (size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
        const auto id = static_cast<int64_t>(first + i);
        const Rng key(batch.seed, UINT64_MAX, static_cast<uint64_t>(id));
        const double u = (i + key.at(Purpose::kCamera, 0).uniform()) / count;
        FilmSample sample;
        if (!camera_->sample(u, key, rays, sample)) continue;
        if (all_finite(sample.value)) {
          samples[chunk].push_back(sample);
        } else {
          bad[chunk].add({-1, -1, id, term_name(kCamera)});
        }
      }
      costs[chunk].counted = samples[chunk].size();
      costs[chunk].rays = rays.total();
      costs[chunk].seconds = watch.seconds();
    });
    const double scale = 1.0 / static_cast<double>(per_sample);
    for (size_t chunk = 0; chunk < chunks; ++chunk) {
      for (const FilmSample& sample : samples[chunk]) splat(sample, scale, output);
      output.costs[kCamera].merge(costs[chunk]);
      output.non_finite.merge(bad[chunk]);
    }
    output.costs[kCamera].samples += count;
    output.costs[kCamera].occluded += count - output.costs[kCamera].counted;
  }

  // A batch's sum is its number of samples per pixel times its mean; `scale` turns sums over film
  // samples into that.
  void splat(const FilmSample& sample, double scale, Output& output) const {
    const Film& film = scene_.film;
    const double radius = film.filter.radius;
    const int x0 = std::max(film.crop_x, static_cast<int>(std::floor(sample.x - 0.5 - radius)));
    const int y0 = std::max(film.crop_y, static_cast<int>(std::floor(sample.y - 0.5 - radius)));
    const int x1 = std::min(film.crop_x + film.crop_width - 1,
                            static_cast<int>(std::ceil(sample.x - 0.5 + radius)));
    const int y1 = std::min(film.crop_y + film.crop_height - 1,
                            static_cast<int>(std::ceil(sample.y - 0.5 + radius)));
    const auto weight = [&](double offset, Film::Range range) {
      if (offset < range.lower || offset > range.upper) return 0.0;
      return film.filter.eval(offset) /
             (film.filter.integral(range.upper) - film.filter.integral(range.lower));
    };
    for (int y = y0; y <= y1; ++y) {
      const double wy = weight(sample.y - (y + 0.5), film.range_y(y));
      if (wy == 0) continue;
      for (int x = x0; x <= x1; ++x) {
        const double wx = weight(sample.x - (x + 0.5), film.range_x(x));
        if (wx != 0) {
          add(output, kCamera, pixel_index(film, x, y), sample.value, wx * wy * scale);
        }
      }
    }
  }

  Scene scene_;
  int lanes_;
  const GradientOptions& options_;
  const RunSettings& settings_;
  std::unique_ptr<RayTracer> tracer_;
  Lights lights_;
  PathContext context_;
  std::vector<Tile> tiles_;
  EdgeSamplerInput input_;
  std::unique_ptr<EdgeSampler> sampler_;
  std::unique_ptr<CameraBoundary> camera_;
};

// Collects batches of one pass into the moments of its parameters.
void collect(const Pass::Output& output, int samples, int width, int height, int block,
             ParameterGradient* parameters) {
  for (size_t k = 0; k < output.sums.size(); ++k) {
    std::vector<double> edges(output.radiance.size());
    std::vector<double> total = output.sums[k][kInterior];
    for (size_t i = 0; i < total.size(); ++i) {
      edges[i] = output.sums[k][kCamera][i] + output.sums[k][kBoundary][i];
      total[i] += edges[i];
    }
    parameters[k].events.add_batch(edges);
    for (int term = 0; term < kTermCount; ++term) {
      const auto& sums = output.sums[k][term];
      parameters[k].terms[term].add_batch(sums, samples);
      if (block > 0) {
        parameters[k].term_blocks[term].add_batch(sum_blocks(sums, width, height, block), samples);
      }
    }
    parameters[k].total.add_batch(total, samples);
    parameters[k].image_sum.add_batch(sum_blocks(total, width, height, std::max(width, height)),
                                      samples);
    if (block > 0) {
      parameters[k].total_blocks.add_batch(sum_blocks(total, width, height, block), samples);
    }
  }
}

ParameterGradient empty_gradient(const std::string& name, const Film& film, int block) {
  ParameterGradient g;
  g.name = name;
  const size_t size = static_cast<size_t>(film.crop_width) * film.crop_height * 3;
  g.total = Moments(size);
  g.terms.fill(Moments(size));
  g.image_sum = Moments(1);
  if (block > 0) {
    const Moments blocks(block_count(film.crop_width, film.crop_height, block));
    g.total_blocks = blocks;
    g.term_blocks.fill(blocks);
  }
  return g;
}

using Passes = std::vector<std::unique_ptr<Pass>>;

Passes make_passes(const Scene& scene, const GradientOptions& options,
                   const RunSettings& settings) {
  Passes passes;
  for (size_t k = 0; k < options.parameters.size(); k += kLanes) {
    const auto begin = options.parameters.begin() + static_cast<std::ptrdiff_t>(k);
    const auto end = begin + std::min<std::ptrdiff_t>(kLanes, options.parameters.end() - begin);
    passes.push_back(
        std::make_unique<Pass>(scene, std::vector<std::string>(begin, end), options, settings));
  }
  return passes;
}

// Without samples yet.
GradientResult empty_result(const Scene& scene, const GradientOptions& options) {
  const Film& film = scene.film;
  GradientResult result;
  for (const auto& name : options.parameters) {
    find_parameter(scene, name);
    result.parameters.push_back(empty_gradient(name, film, options.block));
  }
  result.radiance = Moments(static_cast<size_t>(film.crop_width) * film.crop_height * 3);
  return result;
}

// False if it was stopped; the result is then as before.
bool add_batch(const Passes& passes, const Batch& batch, const Film& film, int block,
               ProgressCounter& progress, GradientResult& result) {
  std::vector<Pass::Output> outputs;
  for (const auto& pass : passes) outputs.push_back(pass->run_batch(batch, progress));
  if (progress.stopped()) return false;
  for (size_t p = 0; p < passes.size(); ++p) {
    collect(outputs[p], batch.count(), film.crop_width, film.crop_height, block,
            &result.parameters[p * kLanes]);
    for (int term = 0; term < kTermCount; ++term) {
      result.costs[term].merge(outputs[p].costs[term]);
    }
    result.non_finite.merge(outputs[p].non_finite);
  }
  result.radiance.add_batch(outputs[0].radiance, batch.count());
  result.spp += batch.count();
  return true;
}

// Chooses the samples of each term. watch: since the job began.
SampleCounts choose_samples(const Passes& passes, const Scene& scene,
                            const GradientOptions& options, const RunSettings& settings,
                            const Stopwatch& watch, int& pilot_spp) {
  const Film& film = scene.film;
  const int spp =
      pilot_samples(static_cast<size_t>(film.crop_width) * film.crop_height, settings.spp);
  if (spp == 0 || std::count(options.terms.begin(), options.terms.end(), true) < 2) return {};
  RunSettings quiet = settings;
  quiet.progress = nullptr;
  ProgressCounter progress(quiet, watch, 1);
  GradientResult pilot = empty_result(scene, options);
  // Another stream of random numbers: a choice that depends on the samples it is made for would
  // bias them.
  const uint64_t seed = mix_bits(settings.seed + 0x9110);
  const double began = watch.seconds();
  while (pilot.spp < spp) {
    const int s = static_cast<int>(pilot.spp);
    if (!add_batch(passes, {seed, s, s + 1, {}}, film, options.block, progress, pilot)) return {};
    if (settings.seconds > 0 && watch.seconds() - began > settings.seconds / 8) break;
  }
  pilot_spp = static_cast<int>(pilot.spp);
  if (pilot.spp < 2) return {};
  return best_samples(pilot_figures(pilot, passes[0]->draw_cost()));
}

void check_samples(const SampleCounts& samples) {
  if (samples.interior >= 1 && samples.camera > 0 && std::isfinite(samples.camera) &&
      samples.boundary >= 1) {
    return;
  }
  throw InputError("samples of the terms: " + to_string(samples) + " are not all positive");
}

}  // namespace

GradientResult gradient(const Scene& scene, const GradientOptions& options,
                        const RunSettings& settings) {
  const Stopwatch watch;
  GradientResult result = empty_result(scene, options);
  if (scene.shading == ShadingModel::kMitsuba) {
    result.warnings.push_back(
        "shading 'mitsuba' is discontinuous where no edge is: the derivative of interpolated "
        "normals is incomplete");
  }
  if (options.samples) check_samples(*options.samples);
  const Passes passes = make_passes(scene, options, settings);
  result.samples = options.samples
                       ? *options.samples
                       : choose_samples(passes, scene, options, settings, watch, result.pilot_spp);
  result.setup_seconds = watch.seconds();

  Schedule batches(settings, watch);
  const size_t steps = Pass::steps_per_batch(scene.film) * Schedule::batch_count(settings.spp);
  ProgressCounter progress(settings, watch, steps * passes.size());
  while (!progress.stopped() && batches.next()) {
    const Batch batch{settings.seed, batches.first_sample(), batches.end_sample(), result.samples};
    if (!add_batch(passes, batch, scene.film, options.block, progress, result)) break;
  }
  result.seconds = watch.seconds();
  return result;
}

}  // namespace limn
