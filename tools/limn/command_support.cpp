// What commands share.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "limn/core/coverage.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
#include "limn/core/scene.h"
#include "tools/limn/command_support.h"
#include "tools/limn/output_files.h"
#include "tools/limn/terminal.h"

namespace limn {
namespace {

std::map<std::string, std::string> parse_defines(const std::vector<std::string>& defines) {
  std::map<std::string, std::string> parsed;
  for (const std::string& define : defines) {
    const size_t equals = define.find('=');
    if (equals == std::string::npos || equals == 0) {
      throw InputError("-D " + define + ": expected NAME=VALUE");
    }
    parsed[define.substr(0, equals)] = define.substr(equals + 1);
  }
  return parsed;
}

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> parts;
  std::stringstream stream(list);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  return parts;
}

}  // namespace

void add_input_options(CLI::App& app, CommonOptions& common, const std::string& name,
                       const std::string& text, const std::string& type) {
  app.add_option(name, common.scene, text)->required()->type_name(type);
  app.add_option_function<std::vector<std::string>>(
         "-D",
         [&common](const std::vector<std::string>& defines) {
           common.defines = parse_defines(defines);
         },
         "Set the value of $NAME in the scene (repeatable)")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  visit_options(common.run, all_but({"spp", "seconds"}, OptionAdder(app)));
  app.add_flag("--quiet", common.quiet, "Print only errors and warnings");
}

void add_common_options(CLI::App& app, CommonOptions& common) {
  add_input_options(app, common, "scene", "Scene file (Mitsuba 3 XML)", "SCENE");
  app.add_option("--path", common.paths,
                 "Directory where files of the scene are searched last (repeatable)")
      ->type_name("DIR")
      ->allow_extra_args(false);
  app.add_option("--sensor", common.sensor,
                 "Sensor to render: its id, or its number from 0 (default: the first)")
      ->type_name("ID|NUMBER");
  visit_options(common.run, only("spp", OptionAdder(app)));
  app.add_option("--json", common.json, "Write all results as JSON to this file")
      ->type_name("FILE");
  app.add_option("--shading", common.shading,
                 "Shading with interpolated normals: continuous, or as in Mitsuba 3, whose shading "
                 "has discontinuities that gradients miss")
      ->check(CLI::IsMember({"continuous", "mitsuba"}))
      ->capture_default_str();
  app.add_option("--smooth-as", common.smooth_as,
                 "Make smooth conductors, dielectrics and plastics rough (GGX), so that "
                 "derivatives have all edges: another image, by about this roughness (0.003), and "
                 "plastics a few percent darker")
      ->check(within(1e-4, 1))
      ->type_name("ALPHA");
}

void add_parameter_options(CLI::App& app, std::vector<std::string>& parameters) {
  app.add_option("--wrt", parameters,
                 "Parameter to differentiate; limn info lists them (repeatable)")
      ->required()
      ->type_name("PARAM")
      ->allow_extra_args(false);
}

std::vector<Method> parse_methods(const std::vector<std::string>& names, Task task) {
  std::vector<Method> methods;
  for (const std::string& name : names) {
    const Method method(name);
    check_task(method, task);
    if (std::ranges::find(methods, method.name(), &Method::name) != methods.end()) {
      throw InputError("--methods: \"" + name + "\" is given twice");
    }
    methods.push_back(method);
  }
  return methods;
}

void add_time_option(CLI::App& app, CommonOptions& common) {
  visit_options(common.run, only("seconds", OptionAdder(app)));
  app.get_option("--time")->excludes("--spp");
}

void add_what_option(CLI::App& app, CommonOptions& common) {
  app.add_option("--what", common.what,
                 "Of what: the image, or alpha, the share of each pixel that surfaces cover "
                 "(whatever their material), in each channel")
      ->check(CLI::IsMember({"image", "alpha"}))
      ->capture_default_str();
}

void add_samples_option(CLI::App& app, std::string& samples) {
  app.add_option("--samples", samples,
                 "Samples of each term per pixel sample, in the order in which --terms lists them, "
                 "without terms that the scene lacks (1 for those not given; camera may be less "
                 "than 1). auto: a short pilot allocates them for the least error in equal time (1 "
                 "each if --spp is below 8). uniform: as auto, but the same in all pixels")
      ->capture_default_str()
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)
      ->type_name("N,N,...");
}

void add_debug_option(CLI::App& app, std::string& place) {
  app.add_option("--debug-sample", place,
                 "Trace one sample and print its path. Give pixel and sample number, or a term and "
                 "the number of its film sample")
      ->type_name("X,Y,S|TERM,N");
}

void Warnings::add(const std::string& line) {
  if (std::find(lines_.begin(), lines_.end(), line) != lines_.end()) return;
  fmt::print(stderr, "{}\n", line);
  lines_.push_back(line);
}

void Warnings::add_all(const std::vector<std::string>& texts) {
  for (const std::string& text : texts) add("warning: " + text);
}

Scene load_scene(const CommonOptions& common, Warnings& shown) {
  check_json(common.json);
  std::vector<std::string> warnings;
  Scene scene = read_scene(common.scene, common.defines, &warnings, common.paths, common.smooth_as);
  for (const std::string& warning : warnings) shown.add(warning);
  if (scene.smooth_as > 0) {
    shown.add(fmt::format("warning: smooth lobes are rough, of alpha {:g} (--smooth-as)",
                          scene.smooth_as));
  }
  if (!common.sensor.empty()) use_sensor(scene, common.sensor);
  if (common.shading == "mitsuba") set_shading(scene, ShadingModel::kMitsuba);
  if (common.what == "alpha") return coverage_of(scene);
  return scene;
}

RunSettings make_settings(const CommonOptions& common, const Scene& scene,
                          const std::string& label) {
  RunSettings settings = settings_of(common.run, scene);
  settings.progress = progress_bar(label, common.quiet);
  settings.interrupted = &interrupt_flag();
  watch_interrupt();
  return settings;
}

std::vector<ImageAttribute> provenance(const Scene& scene, const RunSettings& settings,
                                       int64_t spp) {
  return {{"limn.scene", scene.file},
          {"limn.sensor", sensor_name(scene)},
          {"limn.spp", std::to_string(spp)},
          {"limn.seed", std::to_string(settings.seed)},
          {"limn.smooth_as", fmt::format("{:g}", scene.smooth_as)},
          {"limn.shading", scene.shading == ShadingModel::kMitsuba ? "mitsuba" : "continuous"}};
}

std::vector<ImageAttribute> settings_attributes(const std::vector<MethodSetting>& settings) {
  std::string text;
  for (const MethodSetting& s : settings) {
    std::visit(
        [&](const auto& value) {
          text += fmt::format("{}{} {}", text.empty() ? "" : ", ", s.name, value);
        },
        s.value);
  }
  if (text.empty()) return {};
  return {{"limn.settings", text}};
}

std::string with_error(double value, double error) {
  return std::isfinite(error) ? fmt::format("{:.6g} +- {:.2g}", value, error)
                              : fmt::format("{:.6g}", value);
}

std::string setting_line(const MethodSetting& setting) {
  const auto* number = std::get_if<double>(&setting.value);
  return setting.name + ": " +
         (number ? fmt::format("{:.6g}", *number) : std::get<std::string>(setting.value));
}

nlohmann::json number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json settings_json(const std::vector<MethodSetting>& settings) {
  nlohmann::json object = nlohmann::json::object();
  for (const MethodSetting& s : settings) {
    std::visit([&](const auto& value) { object[s.name] = value; }, s.value);
  }
  return object;
}

Image film_channels(const Scene& scene, const Image& image) {
  if (!scene.film.luminance) return image;
  Image grey(image.width, image.height, 1);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      grey.at(x, y, 0) =
          luminance(Rgb<float>{image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)});
    }
  }
  return grey;
}

std::string with_ending(const std::string& output, const std::string& ending) {
  return std::filesystem::path(output).replace_extension("").string() + ending;
}

void check_output(const std::string& file) {
  if (std::filesystem::path(file).extension() != ".exr") {
    throw InputError({file}, "the output is an OpenEXR image: its name must end in .exr");
  }
  check_writable(file);
}

void write_json(const std::string& file, const std::string& text) {
  if (!file.empty()) write_file(file, text + "\n");
}

void copy_json(const std::string& from, const std::string& to) {
  if (to.empty()) return;
  std::filesystem::copy_file(from, to, std::filesystem::copy_options::overwrite_existing);
}

std::vector<std::string> parse_terms(const std::string& list) { return split(list); }

std::optional<SampleCounts> parse_samples(const std::string& list) {
  if (list == "auto" || list == "uniform") return std::nullopt;
  constexpr double kMost = 1024;
  std::vector<double> counts;
  bool good = !list.empty() && list.back() != ',';
  for (const std::string& part : split(list)) {
    char* end = nullptr;
    counts.push_back(std::strtod(part.c_str(), &end));
    good = good && !part.empty() && *end == 0 && counts.back() > 0 && counts.back() <= kMost;
  }
  if (good) return SampleCounts(counts);
  throw InputError(fmt::format(
      "--samples: \"{}\" is neither auto nor uniform nor counts of at most {}, one for each term, "
      "as in 3,0.5,1",
      list, kMost));
}

NonFinite::SampleId parse_place(const std::string& text) {
  const std::vector<std::string> parts = split(text);
  const auto number = [&](size_t i) {
    size_t used = 0;
    const int64_t value = std::stoll(parts[i], &used);
    if (used != parts[i].size()) throw std::invalid_argument(parts[i]);
    return value;
  };
  try {
    if (parts.size() == 2) return {-1, -1, number(1), parts[0]};
    if (parts.size() == 3) {
      return {static_cast<int>(number(0)), static_cast<int>(number(1)), number(2), ""};
    }
  } catch (const std::logic_error&) {  // no number, or too large a one
  }
  throw InputError("--debug-sample: \"" + text +
                   "\" is neither X,Y,S (a pixel and the number of its sample) nor TERM,N");
}

std::string repeat_command(const std::string& command_line, const NonFinite::SampleId& place) {
  return command_line + " --debug-sample " +
         (place.x >= 0 ? fmt::format("{},{},{}", place.x, place.y, place.sample)
                       : fmt::format("{},{}", place.term, place.sample));
}

int finish_status(const NonFinite& non_finite, int64_t spp_done, int64_t spp_asked,
                  const std::string& command_line) {
  if (non_finite.count > 0) {
    fmt::print(stderr, "error: {}\n", non_finite.message());
    if (!command_line.empty()) {
      fmt::print(stderr, "  to see the first: {}\n",
                 repeat_command(command_line, non_finite.first[0]));
    }
    return kNonFinite;
  }
  if (spp_done < spp_asked) {
    fmt::print(stderr, "interrupted: {} of {} samples per pixel are done\n", spp_done, spp_asked);
    return kInterrupted;
  }
  return kSuccess;
}

}  // namespace limn
