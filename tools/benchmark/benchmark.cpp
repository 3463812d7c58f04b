// Speed of the parts, per core, on a scene: rays alone, whole images, terms of the derivative.
//   limn_benchmark [SCENE] [Google Benchmark's options, such as --benchmark_out=FILE.json]
// SCENE: scenes/demo.xml by default, rendered at 128 x 128 if it takes width and height.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <ctime>
#include <vector>

#include "limn/core/lights.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/shading.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/render.h"

namespace limn {
namespace {

// The rays that a path tracer traces for the first surfaces it meets.
struct RayTape {
  std::vector<Ray> camera, bounce, shadow;
};

RayTape record_rays(const Scene& scene, const RayTracer& tracer, size_t count) {
  RayTape tape;
  const Lights lights(scene);
  for (uint64_t i = 0; i < count; ++i) {
    Rng rng(1, i, 0);
    const double x = rng.uniform() * scene.camera.width;
    const double y = rng.uniform() * scene.camera.height;
    const auto seen = scene.camera.ray<double>(x, y);
    const Ray ray{seen.origin, seen.direction, seen.t_min, seen.t_max};
    tape.camera.push_back(ray);
    Hit hit;
    if (!tracer.closest(ray, hit)) continue;
    const auto surface = surface_on_ray<double>(scene, hit.face, ray.origin, ray.direction);
    const Scattering<double> scattering(surface, -ray.direction, scene.shading);
    if (scattering.black()) continue;
    const auto light = lights.empty() ? std::nullopt : lights.sample(surface.p, rng);
    if (light && !is_black(scattering.eval(light->wo))) {
      Ray shadow{surface.p, light->wo};
      shadow.start = hit.face;
      shadow.t_max = light->distance * (1 - 0x1p-20);
      tape.shadow.push_back(shadow);
    }
    const double u1 = rng.uniform();
    const double u2 = rng.uniform();
    const auto wo = scattering.sample(u1, u2);
    if (!wo) continue;
    Ray bounce{surface.p, *wo};
    bounce.start = hit.face;
    tape.bounce.push_back(bounce);
  }
  return tape;
}

void trace_closest(const RayTracer& tracer, const std::vector<Ray>& rays) {
  Hit hit;
  for (const Ray& ray : rays) benchmark::DoNotOptimize(tracer.closest(ray, hit));
}
void trace_occluded(const RayTracer& tracer, const std::vector<Ray>& rays) {
  for (const Ray& ray : rays) benchmark::DoNotOptimize(tracer.occluded(ray));
}

benchmark::Counter rate(double count) { return {count, benchmark::Counter::kIsRate}; }

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
  const RayTracer& tracer = *bench.tracer;
  const RayTape& tape = bench.tape;
  add(
      "embree/camera", [&] { trace_closest(tracer, tape.camera); }, tape.camera.size());
  add(
      "embree/bounce", [&] { trace_closest(tracer, tape.bounce); }, tape.bounce.size());
  add(
      "embree/shadow", [&] { trace_occluded(tracer, tape.shadow); }, tape.shadow.size());
  const size_t all = tape.camera.size() + tape.bounce.size() + tape.shadow.size();
  const auto mixed = [&] {
    trace_closest(tracer, tape.camera);
    trace_closest(tracer, tape.bounce);
    trace_occluded(tracer, tape.shadow);
  };
  add("embree/mixed", mixed, all);
}

RunSettings one_thread(int spp) {
  RunSettings settings;
  settings.spp = spp;
  settings.threads = 1;
  return settings;
}

void add_render_benchmark(const Bench& bench) {
  benchmark::RegisterBenchmark("render", [&](benchmark::State& state) {
    uint64_t rays = 0;
    for (auto _ : state) rays += render(bench.scene, one_thread(32)).rays;
    state.counters["rays"] = rate(static_cast<double>(rays));
  })->Unit(benchmark::kMillisecond);
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
    if (method.ablation || !method.terms_can_be_left_out) continue;
    for (const TermRun& term : by_default.terms) {
      add_term_benchmark(bench, method.name, term.name, parameter);
    }
  }
}

Scene read_at_fixed_size(const std::string& file) {
  std::vector<std::string> warnings;
  try {
    return read_scene(file, {{"width", "128"}, {"height", "128"}}, &warnings);
  } catch (const InputError&) {  // a scene without these two names
    return read_scene(file, {}, &warnings);
  }
}

int run(const std::string& file) {
  Bench bench{read_at_fixed_size(file), nullptr, {}};
  bench.tracer = make_embree_tracer(bench.scene, 1);
  bench.tape = record_rays(bench.scene, *bench.tracer, 200000);
  const std::string parameter = bench.scene.shapes.empty() || bench.scene.shapes.front().id.empty()
                                    ? "sensor.translate.y"
                                    : bench.scene.shapes.front().id + ".translate.y";
  add_ray_benchmarks(bench);
  add_render_benchmark(bench);
  add_gradient_benchmarks(bench, parameter);
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
