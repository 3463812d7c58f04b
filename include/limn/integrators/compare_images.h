#pragma once
// Methods for images side by side at equal time.
#include <string>
#include <vector>

#include "limn/integrators/render.h"

namespace limn {

struct ImageCompareOptions {
  std::vector<Method> methods;   // that make images, each once
  RenderOptions render;          // but for the method
  std::vector<double> times;     // seconds of a run, set-up included
  int repeats = 4;               // runs of each method and time, with seeds of their own
  double reference_seconds = 0;  // of all runs of the reference together
};

// The mean of independent runs' images, the squared error that it is expected to have by their
// differences, and the sum of its own squares.
struct ReferenceImage {
  std::vector<double> mean;
  double squared_error = 0, scale = 0;
};
ReferenceImage mean_of_runs(const std::vector<std::vector<double>>& runs);  // two at least
// The sum over pixels and channels of (image - reference)^2 over that of reference^2, less what the
// reference's own error is expected to add: below 0 at times for images that are better than it.
double relative_squared_error(const std::vector<double>& image, const ReferenceImage& reference);

struct ComparedImage {
  std::string method;
  double time = 0;  // asked for
  // Over repeats: means of the seconds, samples per pixel and of relative_squared_error, and the
  // standard error of the last.
  double seconds = 0, spp = 0;
  double squared_error = 0, squared_error_stderr = 0;
  std::vector<double> image;  // of the last repeat
};

struct ImageComparison {
  std::string reference_method;
  std::string not_by_rays;             // why the reference is not by rays; empty if it is
  int reference_spp = 0;               // of all its runs
  double reference_squared_error = 0;  // relative, as runs differ
  std::vector<double> reference;       // crop_height by crop_width by 3
  std::vector<ComparedImage> rows;     // method by method, times rising; of finished runs
  NonFinite non_finite;
  std::vector<std::string> warnings;  // of the runs, each once
};

// Runs of different methods follow each other in turn, so that what else a machine does meets all.
// The reference is rays where they know the scene's light, else paths. InputError before any run
// if a method does not know the scene.
ImageComparison compare_images(const Scene& scene, const ImageCompareOptions& options,
                               const RunSettings& settings);

}  // namespace limn
