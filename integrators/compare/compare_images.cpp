// Methods of images in a comparison, and a reference from independent runs.

#include <fmt/format.h>

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/integrators/compare.h"
#include "limn/integrators/methods.h"

namespace limn {
namespace {

constexpr int kReferenceRuns = 8;  // whose differences tell their error; not tuned

class ImageRuns final : public TimedMethod {
 public:
  ImageRuns(const Scene& scene, RenderOptions options, const Method& method, int block)
      : scene_(scene), options_(std::move(options)), block_(block) {
    check_task(method, Task::kImage);
    options_.method = method;
    if (!method->blurs) options_.blur = {};
  }

  // Set-up, a pilot's with it, and one sample of one pixel, or of each where something moves.
  void try_once(RunSettings settings) const {
    settings.progress = nullptr;
    if (is_moving(scene_)) {  // traces of samples have no times
      settings.spp = 1;
      settings.seconds = 0;
      render(scene_, settings, options_);
      return;
    }
    const NonFinite::SampleId corner{scene_.film.crop_x, scene_.film.crop_y, 0, ""};
    trace_sample(scene_, settings, corner, options_);
  }

  std::string name() const override { return options_.method.name(); }
  std::string description() const override { return options_.method->description; }

  MethodRun run(const RunSettings& settings) override {
    RenderResult result = render(scene_, settings, options_);
    MethodRun run;
    run.spp = result.spp;
    if (run.spp == 0) return run;
    const Film& film = scene_.film;
    run.image = means(result.radiance);
    run.blocks.sums = sum_blocks(run.image, film.crop_width, film.crop_height, block_);
    run.seconds = result.seconds;
    run.rays = result.rays;
    run.non_finite = result.non_finite;
    run.warnings = std::move(result.warnings);
    return run;
  }

  std::vector<MethodSetting> settings() const override {
    if (options_.method->image->by_lines) {
      return {{"lines", double(options_.lines)}, {"tolerance", options_.tolerance}};
    }
    if (options_.method->image->make) return {};
    if (looks_around()) return {{"rays", double(options_.rays)}};
    return {{"generator", options_.generator}};
  }

 private:
  bool looks_around() const { return options_.method->image->looks_around; }

  const Scene& scene_;
  RenderOptions options_;
  int block_;
};

// Mean and variance of the mean, number by number.
void average(const std::vector<std::vector<double>>& runs, std::vector<double>& mean,
             std::vector<double>& variance) {
  std::vector<double> values(runs.size());
  for (size_t i = 0; i < runs[0].size(); ++i) {
    for (size_t k = 0; k < runs.size(); ++k) values[k] = runs[k][i];
    const Uncertain all = mean_of_repeats(values);
    mean.push_back(all.value);
    variance.push_back(all.error * all.error);
  }
}

}  // namespace

std::unique_ptr<TimedMethod> make_image_method(const Scene& scene, RenderOptions options,
                                               const Method& method, int block,
                                               const RunSettings& settings) {
  auto runs = std::make_unique<ImageRuns>(scene, std::move(options), method, block);
  runs->try_once(settings);
  return runs;
}

Reference make_image_reference(const Scene& scene, RenderOptions options, int block,
                               const RunSettings& settings, std::string& not_by_rays) {
  std::unique_ptr<TimedMethod> method;
  try {
    method = make_image_method(scene, options, "rays", block, settings);
  } catch (const InputError& error) {
    not_by_rays = error.what();
    method = make_image_method(scene, options, "path", block, settings);
  }
  Reference reference;
  std::vector<std::vector<double>> images, blocks;
  for (int k = 0; k < kReferenceRuns; ++k) {
    RunSettings part = settings;
    part.seconds /= kReferenceRuns;
    part.seed = derived_seed(settings.seed, fmt::format("part {}", k));
    if (settings.progress) {
      part.progress = [&](double done) { settings.progress((k + done) / kReferenceRuns); };
    }
    MethodRun run = method->run(part);
    if (run.spp == 0 || (settings.interrupted && settings.interrupted->load())) return {};
    images.push_back(std::move(run.image));
    blocks.push_back(std::move(run.blocks.sums));
    reference.spp += run.spp;
    reference.seconds += run.seconds;
    reference.non_finite.merge(run.non_finite);
  }
  average(images, reference.image, reference.variance);
  average(blocks, reference.blocks.sums, reference.blocks.variances);
  reference.blocks.degrees = kReferenceRuns - 1;
  reference.edges.resize(blocks[0].size());
  reference.method = method->name();
  reference.seed = settings.seed;
  reference.asked_seconds = settings.seconds;
  if (mean_square(reference.image) > 0) return reference;
  throw InputError({scene.file}, "its image is black: nothing to compare");
}

}  // namespace limn
