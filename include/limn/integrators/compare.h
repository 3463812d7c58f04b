#pragma once
// Images or derivative images of several methods at equal time, against one reference.
#include <memory>
#include <string>
#include <vector>

#include "limn/integrators/metrics.h"
#include "limn/integrators/reference.h"
#include "limn/integrators/render.h"
#include "limn/integrators/timed_method.h"

namespace limn {

struct CompareOptions {
  std::vector<double> times;  // time budgets: seconds of a run, ascending
  int repeats = 4;
};

struct ComparedRun {
  size_t budget = 0;  // index into the times
  int repeat = 0;
  uint64_t seed = 0;
  MethodRun run;  // the image is kept for the method's shown run only
  ImageErrors errors;
};

// Over the repeats of one budget.
struct BudgetSummary {
  size_t budget = 0;
  double seconds = 0, setup_seconds = 0, spp = 0, rays = 0;  // means
  Uncertain mse, relative_mse, trimmed_mse;
  ZSummary bias;  // count 0: unknown
  std::vector<std::pair<std::string, double>> term_seconds;
  uint64_t peak_memory_bytes = 0;  // 0: unknown
};

enum class MethodStatus { kDone, kInterrupted, kMissing };

struct ComparedMethod {
  std::string name, description;
  MethodStatus status = MethodStatus::kInterrupted;
  std::string message;  // why it is missing or not complete
  std::vector<MethodSetting> settings;
  std::vector<ComparedRun> runs;
  std::vector<std::string> warnings;  // of the runs, each once
  // The first repeat of the longest budget that has one; empty without runs.
  std::vector<double> image;
  std::vector<BudgetSummary> summary;  // of the budgets with a run
  std::optional<Uncertain> slope;
  // Time for the error that the first method has after equal time, over that method's, with the
  // longest budget that both have.
  std::optional<Uncertain> time_ratio;
};

// reference: of at least two batches. Runs are interleaved: for every time, for every repeat, for
// every method; each with a seed of its own. settings: threads, seed, progress over all runs,
// interruption; samples and seconds do not count. Interrupted, the result holds all runs that were
// finished.
std::vector<ComparedMethod> compare(const CompareOptions& options, const Reference& reference,
                                    const std::vector<std::unique_ptr<TimedMethod>>& methods,
                                    const RunSettings& settings);

// Samples that are not finite, of all runs.
NonFinite non_finite_of(const Reference& reference, const std::vector<ComparedMethod>& methods);
// Pixels of a side of the blocks whose sums show bias: eight along the film's longer side.
int block_size(const Film& film);
// The seed of one run: a different one for each purpose, whatever the other runs are.
uint64_t derived_seed(uint64_t seed, const std::string& purpose);

// Renders by `method` with what `options` has besides.
// Makes one sample first, by `settings`: InputError if the method does not know the scene, which
// must outlive it. block: pixels, of the block sums.
std::unique_ptr<TimedMethod> make_image_method(const Scene& scene, RenderOptions options,
                                               const Method& method, int block,
                                               const RunSettings& settings);

// The mean of eight runs, in settings.seconds together, whose differences tell its variance. The
// method is rays where they know the scene's light, else path, and not_by_rays says why. Without
// samples if interrupted. InputError for a black image.
Reference make_image_reference(const Scene& scene, RenderOptions options, int block,
                               const RunSettings& settings, std::string& not_by_rays);

}  // namespace limn
