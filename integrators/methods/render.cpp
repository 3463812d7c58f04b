#include "limn/integrators/render.h"

#include "integrators/terms/pixel_samples.h"
#include "limn/core/lights.h"
#include "limn/core/parameter.h"

namespace limn {

std::vector<Tile> make_tiles(const Film& film) {
  std::vector<Tile> tiles;
  const int right = film.crop_x + film.crop_width;
  const int bottom = film.crop_y + film.crop_height;
  for (int y = film.crop_y; y < bottom; y += kTileSize) {
    for (int x = film.crop_x; x < right; x += kTileSize) {
      tiles.push_back({x, y, std::min(x + kTileSize, right), std::min(y + kTileSize, bottom)});
    }
  }
  return tiles;
}

FilmPosition sample_film(const Film& film, int x, int y, const Rng& key) {
  Rng rng = key.at(Purpose::kFilm, 0);
  const auto columns = film.range_x(x);
  const auto rows = film.range_y(y);
  const double dx = film.filter.sample(columns.lower, columns.upper, rng);
  const double dy = film.filter.sample(rows.lower, rows.upper, rng);
  return {x + 0.5 + dx, y + 0.5 + dy};
}

namespace {

// Everything that rendering a scene needs, built once.
struct PrimalRenderer {
  PrimalRenderer(const Scene& s, const RunSettings& run)
      : scene(s),
        settings(run),
        tracer(make_embree_tracer(s, run.threads)),
        lights(s),
        context{scene, *tracer, lights} {}
  PrimalRenderer(const PrimalRenderer&) = delete;
  PrimalRenderer& operator=(const PrimalRenderer&) = delete;

  Rgb<double> sample(int x, int y, int64_t index, RayCount& rays) const {
    const Rng key = pixel_key(scene, settings.seed, x, y, index);
    const FilmPosition film = sample_film(scene.film, x, y, key);
    const auto ray = scene.camera.ray<double>(film.x, film.y);
    NoVisitor nothing;
    PathTracer<double, NoVisitor> path(context, rays, nothing);
    return path.from_ray(camera_ray(scene, ray), ray.origin, ray.direction, 0, key);
  }

  const Scene& scene;
  const RunSettings& settings;
  std::unique_ptr<RayTracer> tracer;
  Lights lights;
  PathContext context;
};

struct BatchOutput {
  std::vector<double> sums;
  uint64_t rays = 0;
  NonFinite non_finite;
};

// Sums over a batch's samples of every pixel. False if interrupted.
bool render_batch(const PrimalRenderer& renderer, const Schedule& batch, ProgressCounter& progress,
                  BatchOutput& output) {
  const Film& film = renderer.scene.film;
  const std::vector<Tile> tiles = make_tiles(film);
  output.sums.assign(static_cast<size_t>(film.crop_width) * film.crop_height * 3, 0.0);
  std::vector<RayCount> rays(tiles.size());
  std::vector<NonFinite> bad(tiles.size());
  parallel_for(tiles.size(), renderer.settings.threads, [&](size_t i) {
    if (progress.stopped()) return;
    for (int y = tiles[i].y0; y < tiles[i].y1; ++y) {
      for (int x = tiles[i].x0; x < tiles[i].x1; ++x) {
        Rgb<double> sum{};
        for (int s = batch.first_sample(); s < batch.end_sample(); ++s) {
          const Rgb<double> radiance = renderer.sample(x, y, s, rays[i]);
          if (is_finite(radiance)) {
            sum += radiance;
          } else {
            bad[i].add({x, y, s, "radiance"});
          }
        }
        double* out = &output.sums[pixel_index(film, x, y)];
        for (int c = 0; c < 3; ++c) out[c] = sum[c];
      }
    }
    progress.step();
  });
  for (size_t i = 0; i < tiles.size(); ++i) {
    output.rays += rays[i].total();
    output.non_finite.merge(bad[i]);
  }
  return !progress.stopped();
}

// A weighted sum of central differences. outputs: images at +steps[0], -steps[0], +steps[1], ...
std::vector<double> combine(const std::vector<BatchOutput>& outputs,
                            const std::vector<double>& steps, const std::vector<double>& weights) {
  std::vector<double> sums(outputs[0].sums.size());
  for (size_t j = 0; j < steps.size(); ++j) {
    const std::vector<double>& forward = outputs[2 * j].sums;
    const std::vector<double>& back = outputs[2 * j + 1].sums;
    const double factor = weights[j] / (2 * steps[j]);
    if (factor == 0) continue;
    for (size_t i = 0; i < sums.size(); ++i) sums[i] += factor * (forward[i] - back[i]);
  }
  return sums;
}

}  // namespace

DifferenceEstimate::DifferenceEstimate(const Film& film, int block)
    : total(static_cast<size_t>(film.crop_width) * film.crop_height * 3),
      blocks(block_count(film.crop_width, film.crop_height, block)),
      image_sum(1) {}

void DifferenceEstimate::add_batch(const std::vector<double>& sums, const Film& film, int block,
                                   int samples) {
  const int width = film.crop_width;
  const int height = film.crop_height;
  total.add_batch(sums, samples);
  events.add_batch(sums);
  blocks.add_batch(sum_blocks(sums, width, height, block), samples);
  image_sum.add_batch(sum_blocks(sums, width, height, std::max(width, height)), samples);
}

RenderResult render(const Scene& scene, const RunSettings& settings) {
  const Stopwatch watch;
  const PrimalRenderer renderer(scene, settings);
  RenderResult result;
  result.radiance =
      Moments(static_cast<size_t>(scene.film.crop_width) * scene.film.crop_height * 3);
  const size_t steps = make_tiles(scene.film).size() * Schedule::batch_count(settings.spp);
  ProgressCounter progress(settings, watch, steps);
  Schedule batches(settings, watch);
  while (batches.next()) {
    BatchOutput output;
    if (!render_batch(renderer, batches, progress, output)) break;
    result.radiance.add_batch(output.sums, batches.samples());
    result.rays += output.rays;
    result.non_finite.merge(output.non_finite);
    result.spp += batches.samples();
  }
  result.seconds = watch.seconds();
  return result;
}

CentralDifferences central_differences(const Scene& scene, const std::string& parameter,
                                       const std::vector<double>& steps,
                                       const std::vector<std::vector<double>>& combinations,
                                       int block, const RunSettings& settings) {
  const Stopwatch watch;
  const Parameter resolved = find_parameter(scene, parameter);
  std::vector<Scene> moved;
  for (const double step : steps) {
    moved.push_back(resolved.moved(scene, step));
    moved.push_back(resolved.moved(scene, -step));
  }
  std::vector<std::unique_ptr<PrimalRenderer>> renderers;
  for (const Scene& s : moved) renderers.push_back(std::make_unique<PrimalRenderer>(s, settings));
  CentralDifferences result;
  result.estimates.assign(combinations.size(), DifferenceEstimate(scene.film, block));
  result.setup_seconds = watch.seconds();

  const size_t tiles = make_tiles(scene.film).size() * renderers.size();
  ProgressCounter progress(settings, watch, tiles * Schedule::batch_count(settings.spp));
  Schedule batches(settings, watch);
  while (!progress.stopped() && batches.next()) {
    std::vector<BatchOutput> outputs(renderers.size());
    for (size_t i = 0; i < renderers.size(); ++i) {
      render_batch(*renderers[i], batches, progress, outputs[i]);
    }
    if (progress.stopped()) break;
    for (size_t k = 0; k < combinations.size(); ++k) {
      const std::vector<double> sums = combine(outputs, steps, combinations[k]);
      result.estimates[k].add_batch(sums, scene.film, block, batches.samples());
    }
    for (const BatchOutput& o : outputs) {
      result.rays += o.rays;
      result.non_finite.merge(o.non_finite);
    }
    result.spp += batches.samples();
  }
  result.seconds = watch.seconds();
  return result;
}

DifferenceResult finite_differences(const Scene& scene, const std::string& parameter, double step,
                                    int block, const RunSettings& settings) {
  CentralDifferences run = central_differences(
      scene, parameter, {step, 2 * step}, {{1, 0}, {0, 1}, {4.0 / 3, -1.0 / 3}}, block, settings);
  return {std::move(run.estimates[0]),
          std::move(run.estimates[1]),
          std::move(run.estimates[2]),
          run.spp,
          run.rays,
          run.seconds,
          std::move(run.non_finite)};
}

}  // namespace limn
