#pragma once
// The commands of the program `limn`: each reads its scene, calls the library and prints.
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/scene.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/run.h"

namespace limn {

struct CommonOptions {
  std::string scene;
  std::map<std::string, std::string> defines;
  int spp = 0;  // 0: the scene's
  std::optional<uint64_t> seed;
  int threads = 0;  // 0: all cores
  std::string json;
  bool quiet = false;
  std::string shading = "continuous";
};

struct GradientCommand {
  std::vector<std::string> parameters;
  std::string output;
  std::string terms = "interior,camera,boundary";
  std::string sampler;
  std::string samples = "auto";  // of each term
  double step = 0;
  int block = 0;
};

struct CompareCommand {
  std::string parameter;
  std::vector<std::string> methods;
  double time = 0;  // seconds of a run, on the longest rung
  int rungs = 1;    // of the ladder of times
  int repeats = 4;
  std::string reference;      // "": made
  double reference_time = 0;  // 0: four times all runs of one method
  std::string terms = "interior,camera,boundary";
  std::string samples = "auto";  // of each term
  double step = 0;               // of finite differences; 0: found by a pilot
  std::string output;
  bool report = true;
  std::string command_line;
};

// Exit statuses.
enum Status { kSuccess = 0, kDisagree = 1, kBadInput = 2, kNonFinite = 3, kInterrupted = 130 };

int run_info(const CommonOptions& common);
int run_render(const CommonOptions& common, const std::string& output);
int run_gradient(const CommonOptions& common, const GradientCommand& command);
int run_check(const CommonOptions& common, const GradientCommand& command);
int run_compare(const CommonOptions& common, const CompareCommand& command);

// Shared by the commands.
// The EXR's header says what made it.
std::vector<ImageAttribute> provenance(const Scene& scene, const RunSettings& settings,
                                       int64_t spp);
// One channel (luminance) if the scene's film asks for it.
Image film_channels(const Scene& scene, const Image& image);
// output with another ending: "a/b.exr", "_stderr.exr" gives "a/b_stderr.exr".
std::string with_ending(const std::string& output, const std::string& ending);
// Made before long work starts: InputError if the file cannot be written.
void check_output(const std::string& file);
void write_json(const std::string& file, const std::string& text);
// Of --terms.
std::array<bool, kTermCount> parse_terms(const std::string& list);
// Of --samples; none for "auto".
std::optional<SampleCounts> parse_samples(const std::string& list);
// Makes FOLDER/report.html with Python, or says what is missing for it.
void write_report(const std::string& folder, bool quiet);
Scene load_scene(const CommonOptions& common);
RunSettings make_settings(const CommonOptions& common, const Scene& scene,
                          const std::string& label);
// Prints a warning about non-finite samples, and turns the status into kNonFinite or kInterrupted
// where that is due.
int finish_status(const NonFinite& non_finite, int64_t spp_done, int64_t spp_asked);

}  // namespace limn
