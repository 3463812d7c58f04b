#pragma once
// Ways to a derivative image that can be compared: each takes a scene, a parameter and a time, and
// returns an image with what it knows of its own error.
#include <array>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/gradient.h"
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
  // Seconds of the run, as a mean over threads; empty for methods that do not work term by term.
  std::vector<double> term_seconds;
  uint64_t peak_memory_bytes = 0;  // 0: this process' own peak
  NonFinite non_finite;
};

// What a reader needs to know of how a method was set up.
struct MethodSetting {
  std::string name;
  std::variant<double, std::string> value;
};

// The method cannot run here; what() says why and what to do.
class MethodMissing : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class DerivativeMethod {
 public:
  virtual ~DerivativeMethod() = default;
  virtual std::string name() const = 0;
  virtual std::string description() const = 0;
  // Takes settings.seconds and reports what it really took. May throw MethodMissing.
  virtual MethodRun run(const RunSettings& settings) = 0;
  // Of the latest run.
  virtual std::vector<MethodSetting> settings() const { return {}; }
};

// What every method is made for. It must outlive them.
struct MethodInput {
  const Scene& scene;
  std::string parameter;
  std::array<bool, kTermCount> terms = {true, true, true};
  double step = 0;                                     // of finite differences; 0: found by a pilot
  int block = 8;                                       // pixels, of the block sums
  std::optional<SampleCounts> samples = std::nullopt;  // of the samplers; none: chosen by a pilot
};

// One method per sampler of the registry, which computes the terms by gradient(); and "fd", central
// differences with common random numbers at one step, of all terms at once. Without a step of the
// user's, a pilot takes a tenth of the time of every kind of run to find one, see
// difference_method.cpp.
struct MethodName {
  std::string name;
  std::string description;
};
std::vector<MethodName> method_names();
// InputError that lists the known names if there is none of this name.
std::unique_ptr<DerivativeMethod> make_method(const MethodInput& input, const std::string& name);

}  // namespace limn
