#pragma once
// The table of methods: one row for each way to an image or to a derivative. `--method` names a row
// in all commands, `method=` in Python; none of them knows a row by its name.
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/blur.h"
#include "limn/core/settings.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/method.h"
#include "limn/integrators/render.h"

namespace limn {

class SampleEstimator;

// How a method makes images.
struct ImageMethod {
  bool closed_light = false;  // light that is scattered once, in closed form
  // One vertex that looks around: direct light, and how open its sky is.
  bool looks_around = false;
  bool by_lines = false;       // between silhouettes
  bool uniform_lines = false;  // through a map at equal azimuths
  bool from_lights = false;    // also particles, see light_traced_estimator.h
  // Makes the estimator of a method that has its own, for biased images of direct light.
  std::unique_ptr<SampleEstimator> (*make)(const Scene&, const RunSettings&,
                                           const Settings&) = nullptr;
};

// How a method computes in reverse mode.
struct ReverseMethod {
  EdgeSamplerType sampler;
  bool closed = false;   // light in closed form
  bool chooses = false;  // a pilot chooses between `forest` and this sampler
};

struct MethodType {
  std::string name;  // with the settings that are not the defaults
  std::string description;
  std::vector<Task> defaults = {};  // of these tasks it is the default
  Settings settings = {};
  // Fills in all below from the settings.
  std::function<void(MethodType&)> set_up = nullptr;

  std::vector<std::string> terms = {};  // in the order of --samples and all tables
  bool terms_can_be_left_out = false;
  // The single terms depend on choices that the run makes; their sum does not.
  bool only_sum_fixed = false;
  bool closed_light = false;                        // it takes GradientOptions::points
  bool warps = false;                               // it takes GradientOptions::warp
  std::optional<BlurWeights> blurs = std::nullopt;  // its faces are blurred: it takes a Blur
  bool particles = false;                           // Blur::particles
  bool differs = false;  // it takes finite differences, or may: `check` refuses it
  bool biased = false;   // its mean is not the derivative, however many samples it takes
  // InputError, with the place, for a scene that the method cannot take; null: it takes all.
  void (*check)(const Scene&) = nullptr;
  // What it can do: images, derivative images, reverse mode (and fits by it).
  std::optional<ImageMethod> image = std::nullopt;
  std::function<GradientResult(const MethodType&, const Scene&, const GradientOptions&,
                               const RunSettings&)>
      run = nullptr;
  std::optional<ReverseMethod> reverse = std::nullopt;
  // As trace_sample() in gradient.h; none for methods that cannot.
  std::function<std::vector<std::string>(const MethodType&, const Scene&, const GradientOptions&,
                                         const RunSettings&, const NonFinite::SampleId&)>
      trace = nullptr;

  bool can(Task task) const;
  bool is_variant() const { return !settings.text().empty(); }
  // With the weights of a method that blurs, and its way to caustics.
  Blur blurred_by(Blur blur) const {
    blur.weights = *blurs;
    blur.particles = particles;
    return blur;
  }
};

const std::vector<MethodType>& method_types();
// Names of those that do a task.
std::vector<std::string> method_names(Task task);

// InputError for a method that takes finite differences, or may: `check` would compare these with
// themselves.
void refuse_differences(const Method& method);
// InputError if the options are not the defaults and none of the methods takes them.
void check_warp(const WarpOptions& warp, const std::vector<Method>& methods);
void check_blur(const Blur& blur, const std::vector<Method>& methods);

}  // namespace limn
