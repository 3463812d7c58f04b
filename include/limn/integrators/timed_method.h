#pragma once
// Methods as comparisons run them: each takes a time and returns a derivative image, or an image
// (compare.h), with what it knows of its own error. The rows of methods.h are such methods;
// others can live outside.
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/metrics.h"
#include "limn/integrators/run.h"

namespace limn {

struct MethodRun {
  std::vector<double> image;  // crop_height by crop_width by 3, per unit of the parameter
  BlockSums blocks;
  double seconds = 0;        // all of the run
  double setup_seconds = 0;  // of which before the first sample
  int64_t spp = 0;           // 0 if interrupted before the first pass over the image
  uint64_t rays = 0;         // 0 if unknown
  // Seconds of each term, as a mean over threads; empty if unknown.
  std::vector<std::pair<std::string, double>> term_seconds;
  uint64_t peak_memory_bytes = 0;  // 0: this process' own peak
  NonFinite non_finite;
  std::vector<std::string> warnings;  // of images
};

// The method cannot run here; what() says why and what to do.
class MethodMissing : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class TimedMethod {
 public:
  virtual ~TimedMethod() = default;
  virtual std::string name() const = 0;
  virtual std::string description() const = 0;
  // Takes settings.seconds and reports what it really took. May throw MethodMissing.
  virtual MethodRun run(const RunSettings& settings) = 0;
  // How the latest run was set up.
  virtual std::vector<MethodSetting> settings() const { return {}; }
};

// What every method is made for. It must outlive them.
struct MethodInput {
  const Scene& scene;
  std::string parameter;
  std::vector<std::string> terms = {};                 // none: all
  double step = 0;                                     // of finite differences; 0: found by a pilot
  int block = 8;                                       // pixels, of the block sums
  std::optional<SampleCounts> samples = std::nullopt;  // of the terms; none: chosen by a pilot
  WarpOptions warp = {};
  Blur blur = {};  // of methods that blur

  GradientOptions options(const Method& method) const;
};

// A row of the table. InputError for one without derivatives.
std::unique_ptr<TimedMethod> make_method(const MethodInput& input, const Method& method);

}  // namespace limn
