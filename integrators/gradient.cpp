#include "limn/integrators/gradient.h"

#include <algorithm>

#include "camera_boundary.h"
#include "limn/core/parameter.h"
#include "pixel_samples.h"
#include "shading_boundary.h"

namespace limn {

const char* term_name(int term) {
  constexpr const char* kNames[] = {"interior", "camera", "boundary"};
  return kNames[term];
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
    input_ = make_sampler_input(scene_);
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

  static size_t steps_per_batch(const Film& film) { return make_tiles(film).size() + 1; }

  // Sums over one batch. sums[lane][term] and radiance are crop_height by crop_width by 3.
  struct Output {
    std::vector<std::array<std::vector<double>, kTermCount>> sums;
    std::vector<double> radiance;
    Costs costs;
    NonFinite non_finite;
  };
  Output run_batch(int first, int last, ProgressCounter& progress) const {
    Output output;
    output.radiance.assign(size(), 0.0);
    output.sums.resize(lanes_);
    for (auto& terms : output.sums) {
      for (auto& sums : terms) sums.assign(size(), 0.0);
    }
    if (options_.terms[kInterior] || options_.terms[kBoundary]) {
      run_paths(first, last, progress, output);
    }
    if (camera_ && !camera_->empty()) run_camera(first, last, progress, output);
    progress.step();
    return output;
  }

 private:
  static Scene seed(const Scene& scene, const std::vector<std::string>& parameters) {
    Scene copy = deep_copy(scene);
    for (size_t k = 0; k < parameters.size(); ++k) {
      seed_parameter(copy, parameters[k], static_cast<int>(k));
    }
    return copy;
  }
  size_t size() const {
    return static_cast<size_t>(scene_.film.crop_width) * scene_.film.crop_height * 3;
  }

  void run_paths(int first, int last, ProgressCounter& progress, Output& output) const {
    std::vector<Costs> costs(tiles_.size());
    std::vector<NonFinite> bad(tiles_.size());
    parallel_for(tiles_.size(), settings_.threads, [&](size_t i) {
      if (progress.stopped()) return;
      run_tile(tiles_[i], first, last, output, costs[i], bad[i]);
      progress.step();
    });
    for (size_t i = 0; i < tiles_.size(); ++i) {
      for (int term = 0; term < kTermCount; ++term) output.costs[term].merge(costs[i][term]);
      output.non_finite.merge(bad[i]);
    }
  }

  void run_tile(const Tile& tile, int first, int last, Output& output, Costs& costs,
                NonFinite& bad) const {
    const Stopwatch watch;
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        for (int s = first; s < last; ++s) run_sample(x, y, s, output, costs, bad);
      }
    }
    costs[kInterior].seconds += watch.seconds() - costs[kBoundary].seconds;
  }

  void run_sample(int x, int y, int s, Output& output, Costs& costs, NonFinite& bad) const {
    const Rng key = pixel_key(scene_, settings_.seed, x, y, s);
    const FilmPosition film = sample_film(scene_.film, x, y, key);
    const Ray primal = camera_ray(scene_, scene_.camera.ray<double>(film.x, film.y));
    const auto ray = scene_.camera.ray<Dual>(film.x, film.y);
    RayCount rays;
    Rgb<Dual> radiance;
    Rgb<Lanes> boundary;
    if (sampler_) {
      ShadingBoundary visitor(context_, input_.objects, *sampler_, costs[kBoundary]);
      PathTracer<Dual, ShadingBoundary> path(context_, rays, visitor);
      radiance = path.from_ray(primal, ray.origin, ray.direction, 0, key);
      boundary = visitor.sum();
    } else {
      NoVisitor nothing;
      PathTracer<Dual, NoVisitor> path(context_, rays, nothing);
      radiance = path.from_ray(primal, ray.origin, ray.direction, 0, key);
    }
    costs[kInterior].rays += rays.total();
    ++costs[kInterior].samples;
    const size_t index = pixel_index(scene_.film, x, y);
    const Rgb<Lanes> interior{radiance.r.d, radiance.g.d, radiance.b.d};
    if (!is_finite(value(radiance)) || !all_finite(interior)) {
      bad.add({x, y, s, term_name(kInterior)});
    } else {
      for (int c = 0; c < 3; ++c) output.radiance[index + c] += radiance[c].v;
      if (options_.terms[kInterior]) add(output, kInterior, index, interior, 1);
    }
    if (!all_finite(boundary)) {
      bad.add({x, y, s, term_name(kBoundary)});
    } else {
      add(output, kBoundary, index, boundary, 1);
    }
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

  // As many samples as the batch has paths, in strata along the summed length of all projected
  // edges.
  void run_camera(int first, int last, ProgressCounter& progress, Output& output) const {
    constexpr size_t kChunk = 1024;
    const Film& film = scene_.film;
    const size_t pixels = static_cast<size_t>(film.crop_width) * film.crop_height;
    const size_t count = pixels * (last - first);
    const size_t chunks = (count + kChunk - 1) / kChunk;
    std::vector<std::vector<FilmSample>> samples(chunks);
    std::vector<TermCost> costs(chunks);
    std::vector<NonFinite> bad(chunks);
    parallel_for(chunks, settings_.threads, [&](size_t chunk) {
      if (progress.stopped()) return;
      const Stopwatch watch;
      RayCount rays;
      for (size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
        const auto id = static_cast<int64_t>(pixels * first + i);
        const Rng key(settings_.seed, UINT64_MAX, static_cast<uint64_t>(id));
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
    const double scale = 1.0 / pixels;
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

}  // namespace

GradientResult gradient(const Scene& scene, const GradientOptions& options,
                        const RunSettings& settings) {
  const Stopwatch watch;
  const Film& film = scene.film;
  GradientResult result;
  if (scene.shading == ShadingModel::kMitsuba) {
    result.warnings.push_back(
        "shading 'mitsuba' is discontinuous where no edge is: the derivative of interpolated "
        "normals is incomplete");
  }
  for (const auto& name : options.parameters) {
    find_parameter(scene, name);
    result.parameters.push_back(empty_gradient(name, film, options.block));
  }
  result.radiance = Moments(static_cast<size_t>(film.crop_width) * film.crop_height * 3);

  std::vector<std::unique_ptr<Pass>> passes;
  for (size_t k = 0; k < options.parameters.size(); k += kLanes) {
    const auto begin = options.parameters.begin() + static_cast<std::ptrdiff_t>(k);
    const auto end = begin + std::min<std::ptrdiff_t>(kLanes, options.parameters.end() - begin);
    passes.push_back(
        std::make_unique<Pass>(scene, std::vector<std::string>(begin, end), options, settings));
  }
  result.setup_seconds = watch.seconds();

  Schedule batches(settings, watch);
  const size_t steps = Pass::steps_per_batch(film) * Schedule::batch_count(settings.spp);
  ProgressCounter progress(settings, watch, steps * passes.size());
  while (!progress.stopped() && batches.next()) {
    std::vector<Pass::Output> outputs;
    for (const auto& pass : passes) {
      outputs.push_back(pass->run_batch(batches.first_sample(), batches.end_sample(), progress));
    }
    if (progress.stopped()) break;
    for (size_t p = 0; p < passes.size(); ++p) {
      collect(outputs[p], batches.samples(), film.crop_width, film.crop_height, options.block,
              &result.parameters[p * kLanes]);
      for (int term = 0; term < kTermCount; ++term) {
        result.costs[term].merge(outputs[p].costs[term]);
      }
      result.non_finite.merge(outputs[p].non_finite);
    }
    result.radiance.add_batch(outputs[0].radiance, batches.samples());
    result.spp += batches.samples();
  }
  result.seconds = watch.seconds();
  return result;
}

}  // namespace limn
