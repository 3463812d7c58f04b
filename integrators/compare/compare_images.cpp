// A reference from independent runs, and methods in turn against it.
#include "limn/integrators/compare_images.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "limn/core/error.h"
#include "limn/core/rng.h"
#include "limn/integrators/methods.h"

namespace limn {
namespace {

constexpr int kReferenceRuns = 8;  // whose differences tell their error; not tuned

// The exact film is for those that take it.
RenderOptions with_method(RenderOptions options, const Method& method) {
  check_task(method, Task::kImage);
  options.method = method;
  if (method->image->looks_around) options.exact_film = false;
  return options;
}

// Set-up, a pilot's with it, and one sample of one pixel: InputError if the method does not know
// the scene.
void try_method(const Scene& scene, const RunSettings& settings, const RenderOptions& given,
                const Method& method) {
  const RenderOptions options = with_method(given, method);
  RunSettings one = settings;
  one.progress = nullptr;
  const NonFinite::SampleId corner{scene.film.crop_x, scene.film.crop_y, 0, ""};
  trace_sample(scene, one, corner, options);
}

class ImageComparer {
 public:
  ImageComparer(const Scene& scene, const ImageCompareOptions& options, const RunSettings& settings)
      : scene_(scene), options_(options), settings_(settings) {
    for (const Method& method : options.methods) {
      try_method(scene, settings, options.render, method);
    }
    result_.reference_method = "rays";
    try {
      try_method(scene, settings, options.render, "rays");
    } catch (const InputError& error) {
      result_.reference_method = "path";
      result_.not_by_rays = error.what();
    }
    double once = 0;
    for (const double time : options.times) once += time;
    all_seconds_ = options.reference_seconds +
                   once * options.repeats * static_cast<double>(options.methods.size());
  }

  ImageComparison run() {
    if (make_reference()) {
      for (const double time : options_.times) compare_at(time);
      std::stable_sort(result_.rows.begin(), result_.rows.end(),
                       [&](const ComparedImage& a, const ComparedImage& b) {
                         return place(a.method) < place(b.method);
                       });
    }
    if (settings_.progress && !stopped()) settings_.progress(1);
    return std::move(result_);
  }

 private:
  bool stopped() const { return settings_.interrupted && settings_.interrupted->load(); }
  size_t place(const std::string& method) const {
    return std::ranges::find(options_.methods, method, &Method::name) - options_.methods.begin();
  }

  RenderResult one(const RenderOptions& options, double seconds, uint64_t number) {
    RunSettings settings = settings_;
    settings.spp = 1 << 30;
    settings.seconds = seconds;
    settings.seed = mix_bits(mix_bits(settings_.seed + 0x5eed) + number);
    if (settings_.progress) {
      const double from = done_ / all_seconds_, share = seconds / all_seconds_;
      settings.progress = [this, from, share](double part) {
        // The bar ends its line at 1.
        settings_.progress(std::min(from + share * part, 0.9999));
      };
    }
    RenderResult result = render(scene_, settings, options);
    result_.non_finite.merge(result.non_finite);
    for (const std::string& warning : result.warnings) {
      const auto& told = result_.warnings;
      const std::string line = options.method.name() + ": " + warning;
      if (std::find(told.begin(), told.end(), line) == told.end()) {
        result_.warnings.push_back(line);
      }
    }
    done_ += seconds;
    return result;
  }

  bool make_reference() {
    std::vector<std::vector<double>> runs;
    RenderOptions options = with_method(options_.render, result_.reference_method);
    options.exact_film = false;
    for (int k = 0; k < kReferenceRuns; ++k) {
      const RenderResult run = one(options, options_.reference_seconds / kReferenceRuns, k);
      if (stopped()) return false;
      runs.push_back(means(run.radiance));
      result_.reference_spp += static_cast<int>(run.spp);
    }
    reference_ = mean_of_runs(runs);
    if (!(reference_.scale > 0)) {
      throw InputError({scene_.file}, "its image is black: nothing to compare");
    }
    result_.reference = reference_.mean;
    result_.reference_squared_error = reference_.squared_error / reference_.scale;
    return true;
  }

  void compare_at(double time) {
    std::vector<ComparedImage> rows(options_.methods.size());
    std::vector<std::vector<double>> errors(rows.size());
    for (int repeat = 0; repeat < options_.repeats; ++repeat) {
      for (size_t m = 0; m < rows.size(); ++m) {
        const RenderResult run =
            one(with_method(options_.render, options_.methods[m]), time, ++number_);
        if (stopped()) break;
        rows[m].image = means(run.radiance);
        rows[m].seconds += run.seconds;
        rows[m].spp += static_cast<double>(run.spp);
        errors[m].push_back(relative_squared_error(rows[m].image, reference_));
      }
      if (stopped()) break;
    }
    for (size_t m = 0; m < rows.size(); ++m) {
      ComparedImage& row = rows[m];
      const auto count = static_cast<double>(errors[m].size());
      if (count == 0) continue;
      row.method = options_.methods[m].name();
      row.time = time;
      row.seconds /= count;
      row.spp /= count;
      double squares = 0;
      for (const double e : errors[m]) row.squared_error += e / count;
      for (const double e : errors[m]) {
        squares += (e - row.squared_error) * (e - row.squared_error);
      }
      if (count > 1) row.squared_error_stderr = std::sqrt(squares / (count * (count - 1)));
      result_.rows.push_back(std::move(row));
    }
  }

  const Scene& scene_;
  const ImageCompareOptions& options_;
  const RunSettings& settings_;
  ImageComparison result_;
  ReferenceImage reference_;
  double all_seconds_ = 0, done_ = 0;
  uint64_t number_ = 1000;
};

}  // namespace

ReferenceImage mean_of_runs(const std::vector<std::vector<double>>& runs) {
  const auto count = static_cast<double>(runs.size());
  ReferenceImage reference;
  reference.mean.resize(runs.at(0).size());
  for (size_t i = 0; i < reference.mean.size(); ++i) {
    double& mean = reference.mean[i];
    for (const std::vector<double>& run : runs) mean += run[i] / count;
    reference.scale += mean * mean;
    for (const std::vector<double>& run : runs) {
      reference.squared_error += (run[i] - mean) * (run[i] - mean) / (count * (count - 1));
    }
  }
  return reference;
}

double relative_squared_error(const std::vector<double>& image, const ReferenceImage& reference) {
  double sum = 0;
  for (size_t i = 0; i < image.size(); ++i) {
    sum += (image[i] - reference.mean[i]) * (image[i] - reference.mean[i]);
  }
  return (sum - reference.squared_error) / reference.scale;
}

ImageComparison compare_images(const Scene& scene, const ImageCompareOptions& options,
                               const RunSettings& settings) {
  return ImageComparer(scene, options, settings).run();
}

}  // namespace limn
