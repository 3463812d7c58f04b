#pragma once
// What `limn compare` leaves behind: pictures, images, figures, a table.
#include <map>
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/compare.h"
#include "limn/integrators/render.h"

namespace limn {

// All of a comparison, with what a reader needs to repeat it.
struct Comparison {
  std::string command;
  std::map<std::string, std::string> defines;
  std::string what;  // the images show; "": derivatives
  std::string parameter, unit, terms;
  uint64_t seed = 0;
  int threads = 1;
  CompareOptions options;
  RenderResult image;  // the plain rendering beside derivatives; no samples if interrupted
  Reference reference;
  std::string reference_file;
  std::string not_by_rays;  // why the reference of images is not by rays
  std::vector<ComparedMethod> methods;
  std::vector<std::string> warnings;  // of the scene
};

// Writes everything but the reference's EXRs into the folder, which exists.
void write_comparison(const std::string& folder, const Scene& scene, const Comparison& comparison);
// Prints the figures of the longest time.
void print_comparison(const Comparison& comparison);

}  // namespace limn
