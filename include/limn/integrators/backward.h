#pragma once
// Reverse mode: from the derivative of a loss with respect to every pixel to its derivative with
// respect to every parameter of the scene at once, all vertices of all shapes included, with
// standard errors. One pass costs about as much as a forward pass, however many parameters there
// are.
//   dLoss/dtheta = sum over pixels and channels of A dI/dtheta,
// A the adjoint image. dI/dtheta is that of gradient.h: its terms with directions held fixed, each
// unbiased, so that the sum is unbiased if A and the samples of the pass are independent.
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/parameter.h"
#include "limn/core/scene.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/moments.h"
#include "limn/integrators/run.h"

namespace limn {

struct BackwardOptions {
  // Names as in parameter.h, arrays included (SHAPE.vertex_positions); none: all parameters of the
  // scene but those that repeat others (Parameter::repeats).
  std::vector<std::string> parameters;
  // In place of names: parameters that were found before, in this scene or where it was then.
  std::vector<Parameter> found;
  // interior, camera, boundary, shadow, and direct and penumbra of samplers that keep regions of
  // light apart; none: all that the scene has.
  std::vector<std::string> terms;
  // Every pixel gets the same number of paths. Else a quarter of them is spread evenly and the rest
  // in proportion to |A|, summed over channels.
  bool uniform_pixels = false;
  // How edges are sampled at vertices of paths (adaptive: by a pilot, with numbers of samples, in
  // long runs that leave both to it), or (analytic) light in closed form in their place, in the
  // scenes that the method takes. InputError for one that has no reverse mode.
  Method method{Task::kBackward};
  // With "analytic" and faces there is one term, `faces`, and no numbers of samples, no batches and
  // no standard errors but 0; InputError for faces with another method, and in parts.
  FilmPoints points = FilmPoints::kRandom;
  // Positions on the film follow what they see (README.md of integrators/backward) where at least
  // this share of pairs of rays of a pixel meets surfaces apart; above 1: nowhere. Not tuned.
  double least_detail = 0.5;
  int edge_samples = 1;  // at every vertex of a path, of each term of edges; 65536 at most
  // Points on the film, per path, of `camera`; 65536 at most. 0: as a pilot chooses, one without a
  // pilot. Numbers of samples other than the defaults: no pilot.
  double camera_samples = 0;
  double shadow_samples = 1;  // the same of each of `shadow` and `penumbra`, but more than 0
  int batches = 16;           // at most, for standard errors; each ends with the adjoint of normals
  // Called with every finished batch, in their order: its samples per pixel, and times these what
  // the parameters came to, number by number.
  std::function<void(int samples, const std::vector<std::vector<double>>& sums)> each_batch;
  // Warnings of gaps that samples miss. To look for them takes a tree over all faces; runs that
  // follow each other need it once.
  bool find_gaps = true;
};

// dLoss/dtheta of one parameter, per unit of the parameter (that of the loss over `unit`).
struct ParameterAdjoint {
  std::string name;
  std::string unit;  // of the parameter; "" for plain numbers
  // {} of a number, {3} of a colour (of each channel; their sum is along grey), {V, 3} of
  // vertex_positions, {V} of displacement.
  std::vector<size_t> shape;
  // One value per number of the array, row by row. Copies of a welded vertex share its derivative
  // equally: the derivative with respect to the position that they share is the sum of theirs.
  Moments moments;
};

struct BackwardResult {
  std::vector<ParameterAdjoint> parameters;  // in the order requested
  std::string method;                        // that ran: of adaptive the one that it chose
  std::string decision;                      // what its pilot found, or why numbers kept it off
  std::vector<TermRun> terms;                // all that the scene has
  int64_t spp = 0;                           // paths per pixel that were finished, on average
  int batches = 0;                           // that they came in, all of one size to a sample
  double seconds = 0;
  double setup_seconds = 0;  // edges, samplers, ray tracer
  NonFinite non_finite;      // such contributions count as zero, and the run must end with an error
  std::vector<std::string> warnings;
  GradientStats stats;
  uint64_t contributions = 0;  // numbers that were added to the gradient
  uint64_t tape_bytes = 0;     // of the largest path: memory of one thread

  // The parameter of that name; it must be there.
  const ParameterAdjoint& of(const std::string& name) const;
};

// adjoint: crop_height by crop_width, three channels, or one that stands for the luminance.
// settings.spp paths per pixel, in batches that give the standard errors; interruption
// drops the batch in progress. With settings.seconds as many batches of one size as fit, two at
// least, and no fewer than a pilot needs where one has run: a run without limit with the samples
// and batches that the result names has the same bits.
// The same seed gives the same bits on any number of threads; memory does not grow with samples.
// InputError for unknown parameters or terms, numbers of samples out of range, and for an adjoint
// of another size or one that is not finite.
BackwardResult backward(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                        const RunSettings& settings);

// One number from both modes.
struct ReverseCheck {
  std::string parameter;
  double forward = 0, forward_error = 0;  // the sum of A dI/dtheta by forward mode, standard error
  double reverse = 0, reverse_error = 0;
  // The difference over its standard error; 0 where both are exactly the same.
  double z = 0;
};
// Reverse mode against forward mode, with a random adjoint image and independent samples: all have
// z of N(0, 1). An array stands for a smooth random field of velocities. settings.spp samples per
// pixel in both modes, two at least. Memory does not grow with batches. Empty if interrupted.
std::vector<ReverseCheck> check_reverse(const Scene& scene, const BackwardOptions& options,
                                        const RunSettings& settings);

// How far an image is from a target, each a mean over pixels and channels.
enum class LossKind {
  kL2,          // (I - T)^2
  kRelativeL2,  // (I - T)^2 / (T^2 + 0.01): weights from the target alone
  // I: the mean of both images. These losses and their adjoints are biased where the noise of I is
  // not small beside I - T.
  kL1,      // |I - T|
  kL1Srgb,  // |e(I) - e(T)|, e: sRGB's transfer function, not clamped
  kSmape,   // |I - T| / (|I| + |T| + 0.01)
};
inline constexpr const char* kLosses[] = {"l2", "relative-l2", "l1", "l1-srgb",
                                          "smape"};  // by their numbers
inline bool is_unbiased(LossKind kind) { return kind <= LossKind::kRelativeL2; }
// Coverage is no radiance, whose dark values the other losses stress.
inline bool suits_coverage(LossKind kind) { return kind == LossKind::kL2 || kind == LossKind::kL1; }
// The warning about a loss that is biased.
std::string bias_warning(LossKind kind);

struct LossResult {
  double value = 0;  // l2 and relative-l2, unbiased, may be negative where they are near zero
  double error = 0;  // standard error, from the pixels' own; NaN with fewer than two batches
  Image adjoint;     // dLoss/dI, crop_height by crop_width by 3
  int64_t spp = 0;   // of each of the two images; 0: interrupted before there was one
};

struct LossOptions {
  LossKind kind = LossKind::kL2;
  // Of a pyramid: the mean over the loss of the images as they are, at half the size, a quarter,
  // and so on. The coarse levels tell a shape far away where to go, and noise less. Their pixels
  // are means of those below, weighed by the mask; so what is unbiased stays so.
  int levels = 1;
  Method method{Task::kImage};              // of render(), but for those that look around
  FilmPoints points = FilmPoints::kRandom;  // of faces there is one image
  // One image in place of two, of the samples of settings.seed: those that backward() takes, too,
  // with uniform pixels and one batch. Where light is known in closed form the loss is then a
  // function of the scene, and backward() gives its derivative. It is larger than that of the
  // image's mean by what these samples miss.
  bool same_samples = false;
  bool one_image() const { return same_samples || points == FilmPoints::kFaces; }
};

// The way to the images of a loss whose derivative is `backward`'s: the same where it makes images.
Method loss_method(const Method& backward);

// Renders the scene twice with settings.spp samples per pixel each, with seeds of their own that
// are derived from settings.seed. For l2 and relative-l2 the loss is the mean of w (I - T)(I' - T),
// and the adjoint 2 w ((I + I') / 2 - T) / N has the mean of dLoss/dI; backward() with
// settings.seed itself is independent of both, so that the product of both is unbiased. target:
// crop_height by crop_width, of three channels or one. mask: what the pixels weigh in the mean, of
// the same size with one channel, or three that are alike; without pixels: all alike.
// InputError as check_loss_images(), for other methods, and for fewer levels than 1 or more than
// most_pyramid_levels(). settings.seconds: of each image, with half of the set-up.
LossResult image_loss(const Scene& scene, const Image& target, const LossOptions& options,
                      const RunSettings& settings, const Image& mask = {});
// Down to one pixel.
int most_pyramid_levels(const Scene& scene);

// InputError for a target or a mask of another size than the film, for a target that is not finite
// where the mask is not zero, and for a mask with values that are negative or not finite, or all
// zero, or with channels that differ. target_place, mask_place: where they are from (a file, say),
// which the message begins with.
void check_loss_images(const Scene& scene, const Image& target, const Image& mask,
                       const std::string& target_place = "", const std::string& mask_place = "");

// As trace_sample() of gradient.h: one path of a pixel (x >= 0), by the number that the run gave
// it, or one of a term's points on the film, with what it adds to every parameter. settings: those
// of the run, without a limit of time. InputError if the run has no such sample.
std::vector<std::string> trace_backward(const Scene& scene, const Image& adjoint,
                                        const BackwardOptions& options, const RunSettings& settings,
                                        const NonFinite::SampleId& place);

}  // namespace limn
