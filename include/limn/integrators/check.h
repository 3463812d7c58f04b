#pragma once
// A gradient against finite differences.
#include <algorithm>
#include <functional>

#include "limn/integrators/differences.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/statistics.h"

namespace limn {

struct CheckOptions {
  std::string parameter;
  Method method{Task::kGradient};
  std::vector<std::string> terms;  // by name; none: all that the scene has
  double step = 0;                 // of the finite differences; 0: found by a pilot
  int block = 0;                   // pixels between windows; 0: an eighth of the longer side
  std::optional<SampleCounts> samples = SampleCounts{};  // of the gradient
  WarpOptions warp;
  Blur blur;  // of methods that blur: of the gradient and of the differences
  FilmPoints points = FilmPoints::kRandom;  // faces: for check_faces() alone
};

// A disagreement needs a p-value below kCheckStageLevel in two runs of their own, the second one in
// the place and direction that the first one accuses.
constexpr double kCheckStageLevel = 0.01;
// The chance that a right gradient is accused.
constexpr double kCheckLevel = kCheckStageLevel * kCheckStageLevel;
// A check that could not have seen an error of this part of the derivative, whichever term it looks
// like, cannot tell whether the gradient is right.
constexpr double kCheckWanted = 0.1;

// A whole image summed: gradient and differences, each with its standard error.
struct TotalComparison {
  double gradient = 0, gradient_error = 0;
  double difference = 0, difference_error = 0;
  double z = 0;
};

// Where few events make an error up, those that rule it may not have come: such errors are widened
// by events as large as any that came elsewhere. Factors are over the errors of batches.
struct WidenedErrors {
  int windows = 0;   // how many
  double most = 1;   // the largest factor of a window; infinite where batches do not differ at all
  double total = 1;  // of the whole image
};

// How much of a term the residual (differences minus gradient) looks like: the residual's
// regression on the term's image.
struct Suspicion {
  double factor =
      0;         // 0 for a right term; 1 if the whole term is missing, -1 if it is counted twice
  double z = 0;  // of the factor
};

// What a check could have seen.
struct CheckPower {
  std::string term;    // "": all terms together
  double share = 0;    // of the sum of all terms' magnitudes, without what noise adds to them
  double visible = 0;  // the error, as a part of the term, that is found with 95 %; may be infinite
  // The same as a part of the sum of all terms' magnitudes.
  double of_whole() const { return share > 0 ? share * visible : 0; }
};

// The run that had to confirm what the first one found.
struct Confirmation {
  int64_t spp = 0;
  double step = 0;
  double p = 1;  // one-sided
};

// kNotComplete: in place of kAgree, where the gradient lacks edges that smooth lobes show.
enum class Verdict { kAgree, kDisagree, kCannotTell, kNotComplete };
// "agree", "disagree", "cannot tell" or "not complete".
const char* verdict_name(Verdict verdict);

struct CheckResult {
  Verdict verdict = Verdict::kCannotTell;
  bool interrupted = false;  // nothing below is complete
  double step = 0;
  int64_t spp = 0, difference_spp = 0;  // of the first run
  int block = 0;
  // z = (gradient - differences) / combined error: of the windows, and of the whole image. Windows
  // are tents, `block` pixels apart, that add up to one: what moves over the border of two changes
  // both smoothly, and a step keeps its bias small.
  ZSummary windows;
  TotalComparison total;
  WidenedErrors widened;
  double p = 1;       // of the whole first run: windows, image and terms, paid for all of them
  std::string found;  // where it is smallest: "the whole image", "the camera term", ...
  std::vector<CheckPower> power;  // all terms together, then each
  double within = 0;              // the largest CheckPower::of_whole()
  double needed_spp = 0;          // for `within` to be kCheckWanted
  // Whether no term has any magnitude.
  bool is_zero() const {
    return std::ranges::all_of(power, [](const CheckPower& part) { return part.share == 0; });
  }
  std::optional<Confirmation> confirmation;  // if p < kCheckStageLevel
  // What would disagree is no more than half of what the image's slopes before and after the
  // parameter's value differ by, and they do: shapes that touch and part, a face edge-on to a
  // light. The gradient is that of one side, and the verdict kCannotTell.
  bool bends = false;
  std::vector<Suspicion> suspicions;  // of each term of the gradient, if they disagree
  // The term with the largest |z| of these, and those that explain what is wrong almost as well, a
  // likelihood of a twentieth or more, in this order; none where it looks like no term.
  std::vector<std::string> suspects;
  GradientResult gradient;  // of the last run
  DifferenceResult differences;
};

// A gradient to be checked, in place of gradient().
using GradientRun =
    std::function<GradientResult(const Scene&, const GradientOptions&, const RunSettings&)>;

// Differences use other seeds than the gradient, so that both are independent, and so does the
// second run, which takes twice the samples at half the step: a step's bias would shrink there.
// Only what still disagrees, and where the image does not bend, is accused.
// settings.seconds: instead of settings.spp samples for both, as many for each as reduce the error
// most, until an error of kCheckWanted would show or the time is over. A second run takes longer.
CheckResult check(const Scene& scene, const CheckOptions& options, const RunSettings& settings,
                  const GradientRun& run = gradient);

// A derivative against central differences along the very paths, up to a depth of 8, without noise:
// only where no edge moves. What is left is the differences' own error, and the few paths that a
// step leads elsewhere, as where a roughness changes what a smooth lobe weighs.
struct PathsCheck {
  double step = 0;
  double gradient_sum = 0, difference_sum = 0;  // over the image
  double error = 0;  // the sum over pixels of |gradient - differences|, over that of their means
  bool interrupted = false;
  NonFinite non_finite;
  bool agrees() const { return error <= kMostError; }
  bool is_zero() const { return error == 0 && gradient_sum == 0 && difference_sum == 0; }
  static constexpr double kMostError = 1e-3;  // an error of a derivative is hardly ever smaller
};
// step: 0 for the second best of four: one alone may agree by chance. InputError where edges or
// times move.
PathsCheck check_paths(const Scene& scene, const std::string& parameter, double step,
                       const RunSettings& settings);
// Throws the InputError of check_paths(), before any work.
void refuse_moved_paths(const Scene& scene, const std::string& parameter);

// Where a pixel is made of its faces (FilmPoints::kFaces) nothing is left to chance: the gradient
// is held against central differences of the very image, at steps from options.step (0: the natural
// one) down, of which the one is taken where they change least from step to step. They agree where
// these change by less than a thousandth and the gradient is off by no more than twice as much;
// where they change by more the check cannot tell, but for what is farther off.
struct FacesCheck {
  GradientResult gradient;
  double step = 0;
  double gradient_sum = 0, difference_sum = 0;  // over the image
  // The root of the squared difference of both images, and of how the differences change from one
  // step to the next or are rounded, summed over the image; over that of the larger one.
  double error = 0, known = 0;
  Verdict verdict = Verdict::kCannotTell;
  bool interrupted = false;
  NonFinite non_finite;  // of the gradient and all images
};
// Takes no notice of samples, blocks and warps.
FacesCheck check_faces(const Scene& scene, const CheckOptions& options, const RunSettings& settings,
                       const GradientRun& run = gradient);

}  // namespace limn
