#pragma once
// Methods for images side by side at equal time.
#include <string>
#include <vector>

#include "limn/integrators/render.h"

namespace limn {

struct ImageCompareOptions {
  std::vector<std::string> methods;  // of render_methods(), each once
  RenderOptions render;              // but for the method
  std::vector<double> times;         // seconds of a run, set-up included
  int repeats = 4;                   // runs of each method and time, with seeds of their own
  double reference_seconds = 0;      // of all runs of the reference together
};

struct ComparedImage {
  std::string method;
  double time = 0;  // asked for
  // Over repeats: means of the seconds, samples per pixel and of the relative squared error, and
  // the standard error of the last. It is the sum over pixels and channels of (image - reference)^2
  // over that of reference^2, less what the reference's own error is expected to add.
  double seconds = 0, spp = 0;
  double squared_error = 0, squared_error_stderr = 0;
  std::vector<double> image;  // of the last repeat
};

struct ImageComparison {
  std::string reference_method;
  int reference_spp = 0;               // of all its runs
  double reference_squared_error = 0;  // relative, as runs differ
  std::vector<double> reference;       // crop_height by crop_width by 3
  std::vector<ComparedImage> rows;     // method by method, times rising; of finished runs
  NonFinite non_finite;
};

// Runs of different methods follow each other in turn, so that what else a machine does meets all.
// The reference is rays where they know the scene's light, else paths. InputError before any run
// if a method does not know the scene.
ImageComparison compare_images(const Scene& scene, const ImageCompareOptions& options,
                               const RunSettings& settings);

}  // namespace limn
