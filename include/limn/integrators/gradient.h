#pragma once
// Derivatives of the image with respect to scene parameters, in forward mode, by any method, with
// standard errors. Methods that work term by term add up
//   dI/dtheta = interior (the integrand away from discontinuities)
//             + camera   (silhouettes as the camera sees them)
//             + boundary + direct + penumbra (silhouettes as vertices of paths see them; before
//                         light sets apart, drawn from the vertex or from the light)
//             + shadow   (edges of the hard shadows of delta lights)
//             + filter   (the reconstruction filter where film samples follow the image motion)
// after Li et al. 2018, with directions fixed in world space (solid-angle measure).
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "limn/core/blur.h"
#include "limn/core/parameter.h"
#include "limn/core/scene.h"
#include "limn/edgetree/edges.h"
#include "limn/integrators/film_points.h"
#include "limn/integrators/method.h"
#include "limn/integrators/moments.h"
#include "limn/integrators/run.h"

namespace limn {

// What one sample per pixel holds of each term, in the order of the method's terms; 1 for those
// that are not given. Each term is averaged over its own, so that results have the same mean
// whatever the counts. Terms that ride on paths take whole numbers.
class SampleCounts {
 public:
  SampleCounts() = default;
  SampleCounts(std::initializer_list<double> counts) : counts_(counts) {}
  explicit SampleCounts(std::vector<double> counts) : counts_(std::move(counts)) {}

  double operator[](size_t term) const { return term < counts_.size() ? counts_[term] : 1; }
  size_t size() const { return counts_.size(); }
  bool operator==(const SampleCounts& other) const;

 private:
  std::vector<double> counts_;
};
// "3,0.5,1"
std::string to_string(const SampleCounts& samples);

// Of methods that warp directions.
struct WarpOptions {
  int rays = 8;        // auxiliary rays of a direction: an even number
  double kappa = 1e4;  // concentration of their kernel, which is kappa^(-1/2) radians wide
};

struct GradientOptions {
  std::vector<std::string> parameters;
  // Unless empty: the parameters that the names stand for, one each, in the same order, as along()
  // makes them of arrays in memory. Empty: the names are looked up in the scene.
  std::vector<Parameter> found;
  Method method{Task::kGradient};
  std::vector<std::string> terms;  // by name; none: all that the scene has
  // None: chosen for the least squared error after equal time, all parameters alike, by a pilot of
  // 4 to 32 samples per pixel with a seed of its own, which are then thrown away. One of each if
  // spp is less than 8, for one term alone, or if four samples of the pilot would take more than
  // 0.3 of what a limit of time leaves behind the set-up. The choice does not depend on clocks but
  // for that; it does on the crop.
  std::optional<SampleCounts> samples = SampleCounts{};
  // The same samples in every pixel, also where the method would spread them.
  bool uniform_samples = false;
  double step = 0;  // of finite differences; 0: found by a pilot
  int block = 0;    // also keep moments of sums over blocks of this many pixels
  // InputError for others than random where the method has no light in closed form. With faces the
  // terms are one, `faces`, and there are no samples of terms.
  FilmPoints points = FilmPoints::kRandom;
  WarpOptions warp;
  Blur blur;  // of methods that blur; 0: see resolved()
};

// options.found, or what the names stand for. InputError as find_parameter().
std::vector<Parameter> parameters_of(const Scene& scene, const GradientOptions& options);

// Derivative images of one parameter, crop_height by crop_width by 3, per unit of the parameter.
struct ParameterGradient {
  std::string name;
  Moments total;
  std::vector<Moments> terms;  // as in GradientResult::terms; empty for those not computed
  // One value per block: the sum over its pixels and channels. Empty unless requested.
  Moments total_blocks;
  std::vector<Moments> term_blocks;
  Moments image_sum;  // one value: the sum over all pixels and channels
};

// One term of a run.
struct TermRun {
  std::string name;
  bool computed = true;  // false: only what other terms need of it was done
  bool edges = true;     // it samples edges: rare events
  double samples = 1;    // in each sample of a pixel, as a mean over pixels
  // In every pixel of the crop, row by row, as a mean over passes; empty if they are all alike.
  std::vector<float> pixel_samples;
  TermCost cost;
};

// What a reader needs to know of how a method was set up.
struct MethodSetting {
  std::string name;
  std::variant<double, std::string> value;
};

// What a run was made of, for `limn gradient --stats`.
struct GradientStats {
  std::vector<std::pair<std::string, uint64_t>> edges;  // number of edges of each class
  uint64_t sampler_nodes = 0, sampler_bytes = 0;        // of the structure that chooses edges
  std::vector<std::pair<std::string, double>> setup;    // seconds of each part of the set-up
};

struct GradientResult {
  std::string method;
  std::vector<ParameterGradient> parameters;  // in the order requested
  Moments radiance;                           // the image itself, from the same samples
  std::vector<TermRun> terms;                 // all that the scene has, in the method's order
  int64_t spp = 0;                            // samples per pixel that were finished
  int planned_spp = 0;                        // where they are not those asked for (`fastest`)
  int pilot_spp = 0;                          // samples per pixel of the pilot that chose `terms`
  double seconds = 0;
  double setup_seconds = 0;  // edges, samplers, ray tracer, pilot
  NonFinite non_finite;
  std::vector<MethodSetting> settings;
  std::vector<std::string> warnings;
  // A parameter moves the scene across a kink (see warnings): the derivative is one of a side.
  bool at_kink = false;
  // It lacks edges that smooth lobes show (see warnings).
  bool incomplete = false;
  GradientStats stats;

  SampleCounts samples() const;
  // Index of the term of that name; it must be there.
  size_t term(const std::string& name) const;
};

// The magnitude of what terms of edges add to one block of g, a parameter of the result.
double edge_magnitude(const GradientResult& result, const ParameterGradient& g, size_t block);

// Parameters are differentiated in passes of kLanes over the same samples. InputError for no
// parameters, unknown parameters, methods or terms, for a method that cannot leave terms out, for
// a step that is negative or not finite, and for counts that are not positive or beyond 1024.
GradientResult gradient(const Scene& scene, const GradientOptions& options,
                        const RunSettings& settings);

// One sample of one pixel (x >= 0) or of a term's points on the film (x < 0: `term`, `sample`),
// done again with all it meets written down, line by line. options.samples must be given; settings:
// those of the run, which matter for points on the film. InputError as above and if there is no
// such sample.
std::vector<std::string> trace_sample(const Scene& scene, const GradientOptions& options,
                                      const RunSettings& settings,
                                      const NonFinite::SampleId& place);

}  // namespace limn
