#pragma once
// `limn compare --image`: methods for images at equal time.
#include <string>
#include <vector>

#include "limn/integrators/render.h"
#include "tools/limn/command_support.h"

namespace limn {

struct ImageCompareArguments {
  std::vector<Method> methods;
  RenderOptions render;  // how methods are set up
  std::vector<double> times;
  int repeats = 4;
  double reference_time = 0;  // 0: four times all runs of one method
  std::string output;         // folder, which is there
};

// InputError for options of methods that are not among `methods` and do not make the reference.
void check_image_options(const CLI::App& app, const std::vector<Method>& methods);
// InputError if none of the methods takes the exact film.
void check_exact_film(const std::vector<Method>& methods);

// Writes reference.exr, METHOD.exr of the longest time, all with PNG, and compare.json; prints a
// table. The status of the program.
int compare_images_command(const CommonOptions& common, ImageCompareArguments arguments,
                           const Scene& scene, const RunSettings& settings, Warnings& warnings,
                           const std::string& command_line);

}  // namespace limn
