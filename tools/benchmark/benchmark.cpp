// Speed of the parts, per core, on a scene: rays alone, whole images, terms of the derivative.
//   limn_benchmark [SCENE] [Google Benchmark's options, such as --benchmark_out=FILE.json]
// SCENE: scenes/demo.xml by default, rendered at 128 x 128 if it takes width and height.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <vector>

#include "integrators/film/pixel_regions.h"
#include "limn/core/environment.h"
#include "limn/core/lights.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/shading.h"
#include "limn/core/visible_regions.h"
#include "limn/integrators/bake.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/render.h"

namespace limn {
namespace {

// The rays that a path tracer traces, in its order: pixel by pixel, whole paths.
struct RayTape {
  struct Traced {
    Ray ray;
    enum class Kind { kCamera, kBounce, kShadow } kind;
  };
  std::vector<Traced> rays;

  // Those of one kind.
  std::vector<Ray> of(Traced::Kind kind) const {
    std::vector<Ray> chosen;
    for (const Traced& traced : rays) {
      if (traced.kind == kind) chosen.push_back(traced.ray);
    }
    return chosen;
  }
};

// A path without its radiance.
void record_path(const Scene& scene, const RayTracer& tracer, const Lights& lights, Ray ray,
                 Rng& rng, RayTape& tape) {
  using Kind = RayTape::Traced::Kind;
  tape.rays.push_back({ray, Kind::kCamera});
  Hit hit;
  for (int bounces = 0; tracer.closest(ray, hit); ++bounces) {
    if (scene.max_depth >= 0 && bounces + 1 >= scene.max_depth) return;
    const auto surface = surface_on_ray<double>(scene, hit.face, ray.origin, ray.direction);
    const Scattering<double> scattering(surface, -ray.direction, scene.shading);
    if (scattering.black()) return;
    const auto light = lights.empty() ? std::nullopt : lights.sample(lights.at(surface.p), rng);
    if (light && light->face != hit.face && !is_black(scattering.eval(light->wo))) {
      Ray shadow{surface.p, light->wo};
      shadow.start = hit.face;
      shadow.t_max = light->distance * (1 - 0x1p-20);
      tape.rays.push_back({shadow, Kind::kShadow});
    }
    const double u1 = rng.uniform();
    const double u2 = rng.uniform();
    const auto wo = scattering.sample(u1, u2);
    if (!wo || is_black(scattering.eval(*wo))) return;
    if (bounces >= scene.rr_depth && rng.uniform() < 0.5) return;
    ray = {surface.p, *wo};
    ray.start = hit.face;
    tape.rays.push_back({ray, Kind::kBounce});
  }
}

RayTape record_rays(const Scene& scene, const RayTracer& tracer, int samples) {
  RayTape tape;
  const Lights lights(scene);
  const CameraView<double> camera(scene.camera);
  for (int pixel = 0; pixel < scene.camera.width * scene.camera.height; ++pixel) {
    for (int s = 0; s < samples; ++s) {
      Rng rng(1, static_cast<uint64_t>(pixel), static_cast<uint64_t>(s));
      const double x = pixel % scene.camera.width + rng.uniform();
      const double y = pixel / scene.camera.width + rng.uniform();
      const auto seen = camera.ray(x, y);
      record_path(scene, tracer, lights, {seen.origin, seen.direction, seen.t_min, seen.t_max}, rng,
                  tape);
    }
  }
  return tape;
}

void trace_all(const RayTracer& tracer, const RayTape& tape) {
  Hit hit;
  for (const RayTape::Traced& traced : tape.rays) {
    if (traced.kind == RayTape::Traced::Kind::kShadow) {
      benchmark::DoNotOptimize(tracer.occluded(traced.ray));
    } else {
      benchmark::DoNotOptimize(tracer.closest(traced.ray, hit));
    }
  }
}
void trace_closest(const RayTracer& tracer, const std::vector<Ray>& rays) {
  Hit hit;
  for (const Ray& ray : rays) benchmark::DoNotOptimize(tracer.closest(ray, hit));
}
void trace_occluded(const RayTracer& tracer, const std::vector<Ray>& rays) {
  for (const Ray& ray : rays) benchmark::DoNotOptimize(tracer.occluded(ray));
}

benchmark::Counter rate(double count) { return {count, benchmark::Counter::kIsRate}; }

// The time of this process, so that other work on the machine hardly counts.
class ProcessorTime {
 public:
  double seconds() const { return static_cast<double>(std::clock() - start_) / CLOCKS_PER_SEC; }

 private:
  std::clock_t start_ = std::clock();
};

// A RayTracer and what it traces, kept for all benchmarks.
struct Bench {
  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  RayTape tape;
};

void add_ray_benchmarks(const Bench& bench) {
  const auto add = [](const char* name, auto trace, size_t rays) {
    benchmark::RegisterBenchmark(name, [=](benchmark::State& state) {
      for (auto _ : state) trace();
      state.counters["rays"] = rate(static_cast<double>(rays * state.iterations()));
    })->Unit(benchmark::kMillisecond);
  };
  using Kind = RayTape::Traced::Kind;
  const RayTracer& tracer = *bench.tracer;
  const RayTape& tape = bench.tape;
  for (const auto& [name, kind] :
       {std::pair{"embree/camera", Kind::kCamera}, std::pair{"embree/bounce", Kind::kBounce}}) {
    const std::vector<Ray> rays = tape.of(kind);
    add(
        name, [&tracer, rays] { trace_closest(tracer, rays); }, rays.size());
  }
  const std::vector<Ray> shadow = tape.of(Kind::kShadow);
  add(
      "embree/shadow", [&tracer, shadow] { trace_occluded(tracer, shadow); }, shadow.size());
  add(
      "embree/paths", [&] { trace_all(tracer, tape); }, tape.rays.size());
}

RunSettings one_thread(int spp) {
  RunSettings settings;
  settings.spp = spp;
  settings.threads = 1;
  return settings;
}

// Whole images, and in turn the rays alone, so that other work on the machine weighs on both alike.
// of_embree: rays per second of rendering over those of Embree alone, which is also the share of
// the time that rendering would spend in Embree if nothing else used the caches.
void add_render_benchmark(const Bench& bench) {
  benchmark::RegisterBenchmark(
      "render",
      [&](benchmark::State& state) {
        double rays = 0, seconds = 0, bare_rays = 0, bare_seconds = 0;
        for (auto _ : state) {
          const ProcessorTime whole;
          rays += static_cast<double>(render(bench.scene, one_thread(64)).rays);
          state.SetIterationTime(whole.seconds());
          seconds += whole.seconds();
          const ProcessorTime bare;
          trace_all(*bench.tracer, bench.tape);
          bare_rays += static_cast<double>(bench.tape.rays.size());
          bare_seconds += bare.seconds();
        }
        state.counters["rays"] = rate(rays);
        state.counters["embree_rays"] = bare_rays / bare_seconds;
        state.counters["of_embree"] = rays / seconds * bare_seconds / bare_rays;
      })
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime();
}

// Samples per second of one term by one method: its share of the run, by the terms' own clocks, in
// processor time.
void add_term_benchmark(const Bench& bench, const std::string& method, const std::string& term,
                        const std::string& parameter) {
  benchmark::RegisterBenchmark(
      fmt::format("gradient/{}/{}", method, term).c_str(),
      [=, &bench](benchmark::State& state) {
        GradientOptions options;
        options.parameters = {parameter};
        options.method = method;
        options.terms = {term};
        TermCost cost;
        bool edges = false;
        for (auto _ : state) {
          const GradientResult result = gradient(bench.scene, options, one_thread(1));
          const TermRun& run = result.terms[result.term(term)];
          state.SetIterationTime(run.cost.seconds);
          cost.merge(run.cost);
          edges = run.edges;
        }
        state.counters["samples"] = rate(static_cast<double>(cost.samples));
        state.counters["rays"] = rate(static_cast<double>(cost.rays));
        state.counters["counted"] = edges ? static_cast<double>(cost.counted) / cost.samples : 1.0;
      })
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime();
}

// Every term that the scene has, by every method that computes terms one by one.
void add_gradient_benchmarks(const Bench& bench, const std::string& parameter) {
  GradientOptions options;
  options.parameters = {parameter};
  const GradientResult by_default = gradient(bench.scene, options, one_thread(1));
  for (const MethodType& method : method_types()) {
    if (!method.terms_can_be_left_out || method.check) continue;
    for (const TermRun& term : by_default.terms) {
      add_term_benchmark(bench, method.name, term.name, parameter);
    }
  }
}

Scene read_at_size(const std::string& file, const std::string& size) {
  std::vector<std::string> warnings;
  try {
    return read_scene(file, {{"width", size}, {"height", size}}, &warnings);
  } catch (const InputError&) {  // a scene without these two names
    return read_scene(file, {}, &warnings);
  }
}

size_t count_regions(const Scene& scene) {
  const CoincidentFaces faces(scene, 1);
  const PixelRegions pixels(scene, faces, 1);
  size_t count = 0;
  for (size_t t = 0; t < pixels.tiles().size(); ++t) {
    pixels.for_each_pixel(
        t, nullptr, [](int, int) { return true; },
        [&](int, int, const VisibleRegions& regions) { count += regions.size(); });
  }
  return count;
}

// The visible regions of the scene's film at 256 x 256, and in turn paths of two bounces at most.
// of_paths: their time over that of one such path a pixel.
void add_film_benchmark(const std::string& file) {
  benchmark::RegisterBenchmark(
      "regions/film",
      [file](benchmark::State& state) {
        Scene scene = read_at_size(file, "256");
        scene.film.filter = {Filter::Kind::kBox, 0.5};
        scene.max_depth = 2;
        constexpr int kSamples = 8;
        double regions = 0, places = 0, paths = 0;
        for (auto _ : state) {
          const ProcessorTime before;
          benchmark::DoNotOptimize(CoincidentFaces(scene, 1).overlaps.empty());
          places += before.seconds();
          const ProcessorTime film;
          benchmark::DoNotOptimize(count_regions(scene));
          state.SetIterationTime(film.seconds());
          regions += film.seconds();
          const ProcessorTime one;
          render(scene, one_thread(1));
          const double set_up = one.seconds();
          const ProcessorTime more;
          render(scene, one_thread(1 + kSamples));
          paths += (more.seconds() - set_up) / kSamples;
        }
        // Faces in one place are found for every tracer, and shared with it.
        state.counters["of_paths"] = (regions - places) / paths;
      })
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime();
}

// A sphere with bumps that fills a window.
void insert_bumpy_sphere(int around, VisibleRegions& regions) {
  const PlaneView view({0, 0, 4}, {0.25, 0, 0}, {0, 0.25, 0}, {0, 0, -1}, 0.1, 100);
  const auto corner = [&](int i, int j) {
    const double phi = 2 * kPi * i / around, theta = 2 * kPi * j / around;
    const double r = 1 + 0.05 * std::sin(20 * phi) * std::sin(20 * theta);
    return Vec3d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                 std::cos(theta)} *
           r;
  };
  std::vector<SeenFace> faces;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < around / 2; ++j) {
      const Vec3d a = corner(i, j), b = corner(i + 1, j), c = corner(i + 1, j + 1),
                  d = corner(i, j + 1);
      for (const std::array<Vec3d, 3>& face : {std::array{a, b, c}, std::array{a, c, d}}) {
        const auto seen = view.face(static_cast<uint32_t>(faces.size()), face);
        if (seen) faces.push_back(*seen);
      }
    }
  }
  std::sort(faces.begin(), faces.end(),
            [](const SeenFace& a, const SeenFace& b) { return a.nearest > b.nearest; });
  for (const SeenFace& face : faces) regions.insert(face);
}

// A whole mesh in one window: how the time grows with its faces.
void add_window_benchmarks() {
  for (const int around : {100, 316, 1000}) {
    benchmark::RegisterBenchmark(
        fmt::format("regions/window/{}", around * around).c_str(),
        [around](benchmark::State& state) {
          for (auto _ : state) {
            const ProcessorTime time;
            VisibleRegions regions({}, static_cast<size_t>(around) * around);
            insert_bumpy_sphere(around, regions);
            state.SetIterationTime(time.seconds());
            state.counters["us_per_face"] = 1e6 * time.seconds() / (around * around);
          }
        })
        ->Unit(benchmark::kMillisecond)
        ->UseManualTime();
  }
}

// A view baked once, under a map of 1024 x 512 texels with a sun, and in turn the method whose
// image it keeps. over_lines: how many times as fast relighting is; sums: the share of its time for
// sums over the map, however large the image; apart: the largest difference over the mean [2^-24].
void add_relight_benchmark(const std::string& name) {
  benchmark::RegisterBenchmark(
      ("relight/" + name).c_str(),
      [name](benchmark::State& state) {
        Scene scene = read_at_size(LIMN_SOURCE_DIR "/scenes/" + name, "64");
        scene.max_depth = 2;
        const SkyMap map{read_image(LIMN_SOURCE_DIR "/build/generated/sky_sun.exr")};
        scene.environment = make_map_environment(map.texels, map.scale, map.turn, "map");
        RenderOptions options;
        options.method = "lines:azimuths=uniform";
        const BakedView view = BakedView::make(scene, one_thread(4), options.lines).view;
        scene.film.crop_width = scene.film.crop_height = 1;
        const BakedView pixel = BakedView::make(scene, one_thread(1), options.lines).view;
        scene.film.crop_width = view.width(), scene.film.crop_height = view.height();
        double lines = 0, relit = 0, sums = 0, apart = 0, mean = 0;
        for (auto _ : state) {
          const ProcessorTime by_lines;
          const Moments truth = render(scene, one_thread(4), options).radiance;
          lines += by_lines.seconds();
          const ProcessorTime again;
          const Image image = view.relight(map, 1);
          state.SetIterationTime(again.seconds());
          relit += again.seconds();
          const ProcessorTime hardly_any;
          benchmark::DoNotOptimize(pixel.relight(map, 1).data[0]);
          sums += hardly_any.seconds();
          for (size_t i = 0; i < image.data.size(); ++i) {
            apart = std::fmax(apart, std::fabs(image.data[i] - truth.mean(i)));
            mean += truth.mean(i) / static_cast<double>(image.data.size() * state.max_iterations);
          }
        }
        state.counters["over_lines"] = lines / relit;
        state.counters["sums"] = sums / relit;
        state.counters["apart"] = apart / mean * 0x1p24;
      })
      ->Unit(benchmark::kMillisecond)
      ->Iterations(3)
      ->UseManualTime();
}

int run(const std::string& file) {
  Bench bench{read_at_size(file, "128"), nullptr, {}};
  bench.tracer = make_embree_tracer(bench.scene, 1);
  bench.tape = record_rays(bench.scene, *bench.tracer, 4);
  const std::string parameter = bench.scene.shapes.empty() || bench.scene.shapes.front().id.empty()
                                    ? "sensor.translate.y"
                                    : bench.scene.shapes.front().id + ".translate.y";
  add_ray_benchmarks(bench);
  add_render_benchmark(bench);
  add_gradient_benchmarks(bench, parameter);
  add_film_benchmark(file);
  add_window_benchmarks();
  for (const char* name : {"sun.xml", "soft_shadow.xml", "plant.xml"}) add_relight_benchmark(name);
  benchmark::AddCustomContext("scene", file);
  benchmark::AddCustomContext("parameter", parameter);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace
}  // namespace limn

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  try {
    return limn::run(argc > 1 ? argv[1] : LIMN_SOURCE_DIR "/scenes/demo.xml");
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}
