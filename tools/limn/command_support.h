#pragma once
// What commands share: options, scenes, settings of a run, files.
#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/scene.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/run.h"
#include "tools/limn/command.h"
#include "tools/limn/option_adder.h"

namespace limn {

struct CommonOptions {
  std::string scene;
  std::map<std::string, std::string> defines;
  std::vector<std::string> paths;  // directories where files are searched last
  std::string sensor;              // "": the first of the scene
  RunRequest run;
  std::string json;
  bool quiet = false;
  std::string shading = "continuous";
  double smooth_as = 0;        // 0: smooth
  std::string part;            // "K/N" of --part; "": the whole run
  std::string what = "image";  // or "alpha": the scene is that of coverage_of()
};

// Scene or mesh, -D, --seed, --threads, --quiet. name, text, type: of the input.
void add_input_options(CLI::App& app, CommonOptions& common, const std::string& name,
                       const std::string& text, const std::string& type);
// These and --spp, --json, --shading, --smooth-as.
void add_common_options(CLI::App& app, CommonOptions& common);
// --wrt
void add_parameter_options(CLI::App& app, std::vector<std::string>& parameters);
// "a,b": each once, all of which do the task. InputError that names the option.
std::vector<Method> parse_methods(const std::vector<std::string>& names, Task task);
// --time, in place of --spp
void add_time_option(CLI::App& app, CommonOptions& common);
// --samples
void add_samples_option(CLI::App& app, std::string& samples);
// --what, in place of the image: its coverage
void add_what_option(CLI::App& app, CommonOptions& common);
// --debug-sample
void add_debug_option(CLI::App& app, std::string& place);

// The EXR's header says what made it.
std::vector<ImageAttribute> provenance(const Scene& scene, const RunSettings& settings,
                                       int64_t spp);
// One channel (luminance) if the scene's film asks for it.
Image film_channels(const Scene& scene, const Image& image);
// What the method was set up with, as "name value, ..."; none where there is nothing to say.
std::vector<ImageAttribute> settings_attributes(const std::vector<MethodSetting>& settings);
nlohmann::json number(double value);  // null for what JSON has not: infinities, NaN
nlohmann::json settings_json(const std::vector<MethodSetting>& settings);
// "1.5 +- 0.02", without the standard error where there is none.
std::string with_error(double value, double error);
// For people, "NAME: VALUE"; numbers to six digits, those of JSON are exact.
std::string setting_line(const MethodSetting& setting);
// output with another ending: "a/b.exr", "_stderr.exr" gives "a/b_stderr.exr".
std::string with_ending(const std::string& output, const std::string& ending);
// Made before long work starts: InputError if the file cannot be written.
void check_output(const std::string& file);
void write_json(const std::string& file, const std::string& text);  // nothing for ""
void copy_json(const std::string& from, const std::string& to);     // likewise
// "a,b" of --terms; none for "".
std::vector<std::string> parse_terms(const std::string& list);
// The counts of --samples; none for "auto".
std::optional<SampleCounts> parse_samples(const std::string& list);
// "X,Y,S", or "TERM,N" for a term's samples on the film.
NonFinite::SampleId parse_place(const std::string& text);
// What is printed once on standard error and again under "warnings" of --json, by every command
// whose result it concerns.
class Warnings {
 public:
  // A whole line, as read_scene() makes them; nothing if it was printed before.
  void add(const std::string& line);
  // Texts without the word "warning".
  void add_all(const std::vector<std::string>& texts);
  const std::vector<std::string>& lines() const { return lines_; }

 private:
  std::vector<std::string> lines_;
};
// InputError also if --json cannot be written.
Scene load_scene(const CommonOptions& common, Warnings& shown);
RunSettings make_settings(const CommonOptions& common, const Scene& scene,
                          const std::string& label);

// The command that does one sample again.
std::string repeat_command(const std::string& command_line, const NonFinite::SampleId& place);
// Prints a warning about non-finite samples and the command that does the first again, and turns
// the status into kNonFinite or kInterrupted where that is due. command_line: "" for commands that
// cannot do one sample alone.
int finish_status(const NonFinite& non_finite, int64_t spp_done, int64_t spp_asked,
                  const std::string& command_line);

}  // namespace limn
