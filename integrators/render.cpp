#include "limn/integrators/render.h"

#include "limn/core/lights.h"
#include "limn/core/parameter.h"
#include "pixel_samples.h"

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

// Sums over samples [first, last) of every pixel. False if interrupted.
bool render_batch(const PrimalRenderer& renderer, int first, int last, ProgressCounter& progress,
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
        for (int s = first; s < last; ++s) {
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

// Sums behind DifferenceResult::event_*.
struct EventSize {
  double cubes = 0;
  double squares = 0;
  // Three channels per pixel.
  void add(const std::vector<double>& sums) {
    for (size_t i = 0; i < sums.size(); i += 3) {
      const double x = std::fabs(sums[i] + sums[i + 1] + sums[i + 2]);
      squares += x * x;
      cubes += x * x * x;
    }
  }
  double value() const { return squares > 0 ? cubes / squares : 0; }
};

}  // namespace

RenderResult render(const Scene& scene, const RunSettings& settings) {
  const Stopwatch watch;
  const PrimalRenderer renderer(scene, settings);
  const Batches batches(settings.spp);
  RenderResult result;
  result.radiance =
      Moments(static_cast<size_t>(scene.film.crop_width) * scene.film.crop_height * 3);
  ProgressCounter progress(settings, make_tiles(scene.film).size() * batches.count);
  for (int b = 0; b < batches.count; ++b) {
    BatchOutput output;
    if (!render_batch(renderer, batches.first_sample(b), batches.first_sample(b + 1), progress,
                      output)) {
      break;
    }
    result.radiance.add_batch(output.sums, batches.samples(b));
    result.rays += output.rays;
    result.non_finite.merge(output.non_finite);
    result.spp += batches.samples(b);
  }
  result.seconds = watch.seconds();
  return result;
}

DifferenceResult finite_differences(const Scene& scene, const std::string& parameter, double step,
                                    int block, const RunSettings& settings) {
  const Stopwatch watch;
  const double offsets[4] = {step, -step, 2 * step, -2 * step};
  std::vector<Scene> moved;
  moved.reserve(4);
  for (const double offset : offsets) moved.push_back(perturbed(scene, parameter, offset));
  std::vector<std::unique_ptr<PrimalRenderer>> renderers;
  for (const Scene& s : moved) renderers.push_back(std::make_unique<PrimalRenderer>(s, settings));

  const int width = scene.film.crop_width;
  const int height = scene.film.crop_height;
  const size_t size = static_cast<size_t>(width) * height * 3;
  const size_t block_size = sum_blocks(std::vector<double>(size), width, height, block).size();
  DifferenceResult result;
  result.at_step = result.at_double_step = result.extrapolated = Moments(size);
  result.blocks_at_step = result.blocks_at_double_step = result.blocks_extrapolated =
      Moments(block_size);
  result.image_sum = Moments(1);
  EventSize events[3];
  const Batches batches(settings.spp);
  ProgressCounter progress(settings, make_tiles(scene.film).size() * batches.count * 4);
  for (int b = 0; b < batches.count; ++b) {
    BatchOutput output[4];
    for (int i = 0; i < 4; ++i) {
      render_batch(*renderers[i], batches.first_sample(b), batches.first_sample(b + 1), progress,
                   output[i]);
    }
    if (progress.stopped()) break;
    std::vector<double> single(size);
    std::vector<double> twice(size);
    std::vector<double> combined(size);
    for (size_t i = 0; i < size; ++i) {
      single[i] = (output[0].sums[i] - output[1].sums[i]) / (2 * step);
      twice[i] = (output[2].sums[i] - output[3].sums[i]) / (4 * step);
      combined[i] = (4 * single[i] - twice[i]) / 3;
    }
    events[0].add(single);
    events[1].add(twice);
    events[2].add(combined);
    const int n = batches.samples(b);
    result.at_step.add_batch(single, n);
    result.at_double_step.add_batch(twice, n);
    result.extrapolated.add_batch(combined, n);
    result.blocks_at_step.add_batch(sum_blocks(single, width, height, block), n);
    result.blocks_at_double_step.add_batch(sum_blocks(twice, width, height, block), n);
    result.blocks_extrapolated.add_batch(sum_blocks(combined, width, height, block), n);
    result.image_sum.add_batch(sum_blocks(combined, width, height, std::max(width, height)), n);
    for (const BatchOutput& o : output) {
      result.rays += o.rays;
      result.non_finite.merge(o.non_finite);
    }
    result.spp += n;
  }
  result.event_at_step = events[0].value();
  result.event_at_double_step = events[1].value();
  result.event_extrapolated = events[2].value();
  result.seconds = watch.seconds();
  return result;
}

}  // namespace limn
