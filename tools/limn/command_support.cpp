// What commands share.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
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

// Short where that is exact, as 1e+12; else with all digits, as the largest seed.
std::string bound_text(long double bound) {
  const std::string text = fmt::format("{:.10g}", bound);
  const bool exact = std::strtold(text.c_str(), nullptr) == bound || std::floor(bound) != bound;
  return exact ? text : fmt::format("{:.0f}", bound);
}

}  // namespace

CLI::Validator within(long double least, long double most) {
  const std::string range = bound_text(least) + " to " + bound_text(most);
  return {[=](const std::string& text) {
            char* end = nullptr;
            const long double value = std::strtold(text.c_str(), &end);
            // As doubles, which 0.1 is; seeds have more digits.
            const bool enough = static_cast<double>(value) >= static_cast<double>(least);
            return !text.empty() && *end == 0 && enough && value <= most
                       ? std::string()
                       : text + " is not a number from " + range;
          },
          range};
}

void add_input_options(CLI::App& app, CommonOptions& common, const std::string& text,
                       const std::string& type) {
  app.add_option("scene", common.scene, text)->required()->type_name(type);
  app.add_option_function<std::vector<std::string>>(
         "-D",
         [&common](const std::vector<std::string>& defines) {
           common.defines = parse_defines(defines);
         },
         "Set the value of $NAME in the scene (repeatable)")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  app.add_option("--seed", common.seed,
                 "Seed of the random numbers (default: seed of the scene's sampler)")
      ->check(within(0, std::numeric_limits<uint64_t>::max()));
  app.add_option("--threads", common.threads, "Number of threads (default: all cores)")
      ->check(within(1, 4096));
  app.add_flag("--quiet", common.quiet, "Print only errors and warnings");
}

void add_common_options(CLI::App& app, CommonOptions& common) {
  add_input_options(app, common, "Scene file (Mitsuba 3 XML)", "SCENE");
  app.add_option("--path", common.paths,
                 "Directory where files of the scene are searched last (repeatable)")
      ->type_name("DIR")
      ->allow_extra_args(false);
  app.add_option("--sensor", common.sensor,
                 "Sensor to render: its id, or its number from 0 (default: the first)")
      ->type_name("ID|NUMBER");
  app.add_option("--spp", common.spp,
                 "Samples per pixel (default: sample_count of the scene's sampler)")
      ->check(within(1, 1 << 30));
  app.add_option("--json", common.json, "Write all results as JSON to this file");
  app.add_option("--shading", common.shading,
                 "Shading with interpolated normals: continuous, or as in Mitsuba 3, whose shading "
                 "has discontinuities that gradients miss")
      ->check(CLI::IsMember({"continuous", "mitsuba"}))
      ->capture_default_str();
}

void add_parameter_options(CLI::App& app, std::vector<std::string>& parameters) {
  app.add_option("--wrt", parameters,
                 "Parameter to differentiate; limn info lists them (repeatable)")
      ->required()
      ->type_name("PARAM")
      ->allow_extra_args(false);
}

void add_method_option(CLI::App& app, Method& method, Task task) {
  app.add_option_function<std::string>(
         "--method",
         [&method, task](const std::string& name) {
           method = name;
           check_task(method, task);
         },
         "Method: " + join(method_names(task)) + "; settings follow a colon, as in " +
             (task == Task::kImage ? "silhouettes" : "forest") + ":width=4 (limn methods --all)")
      ->default_str(Method(task).name())
      ->type_name("NAME");
  const std::string instead =
      task == Task::kImage ? "--generator sobol or independent" : "--method NAME";
  app.add_option_function<std::string>(
         "--sampler",
         [instead](const std::string& value) {
           throw InputError("--sampler " + value + ": this option is now " + instead);
         })
      ->group("");  // not in the help
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

void add_term_options(CLI::App& app, std::string& terms, std::string& samples) {
  app.add_option("--terms", terms,
                 "Terms to compute, among " + join(Method(Task::kGradient)->terms) +
                     " (default: all that the scene has)")
      ->type_name("A,B,...");
  app.add_option("--samples", samples,
                 "Samples of each term per pixel sample, in the order in which --terms lists them, "
                 "without terms that the scene lacks (1 for those not given; camera may be less "
                 "than 1). auto: a short pilot allocates them for the least error in equal time (1 "
                 "each if --spp is below 8). uniform: as auto, but the same in all pixels")
      ->capture_default_str()
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)
      ->type_name("N,N,...");
}

void add_points_option(CLI::App& app, FilmPoints& points) {
  app.add_option_function<std::string>(
         "--points", [&points](const std::string& name) { points = film_points(name); },
         "Points at which the method analytic evaluates light. random: random points of each "
         "pixel. faces: one point per visible face of each pixel, weighted by its visible area. "
         "Faces has no noise and needs a box filter; its gradient is exact for its own image, "
         "which ignores how light varies within a pixel's part of a face")
      ->check(
          CLI::IsMember(std::vector<std::string>(std::begin(kFilmPoints), std::end(kFilmPoints))))
      ->default_str(kFilmPoints[0]);
}

void refuse_samples(const CLI::App& app, FilmPoints points,
                    const std::vector<std::string>& options) {
  if (points != FilmPoints::kFaces) return;
  for (const std::string& name : options) {
    if (app.count(name) == 0) continue;
    throw InputError(name + ": --points faces takes no samples");
  }
}

void add_film_option(CLI::App& app, std::string& film) {
  app.add_option("--film", film,
                 "Visibility from the camera (in gradients, of the edges that it sees): by rays, "
                 "or by the exact visible regions of every pixel, which needs a box filter")
      ->check(CLI::IsMember({"rays", "exact"}))
      ->capture_default_str();
}

void add_reverse_options(CLI::App& app, BackwardOptions& options, Task task) {
  app.add_option_function<std::string>(
      "--terms", [&options](const std::string& list) { options.terms = parse_terms(list); },
      "Terms to compute, as in interior,camera (default: all that the scene has)");
  app.add_option_function<std::string>(
         "--pixels",
         [&options](const std::string& pixels) {
           options.uniform_pixels = pixels == kUniformPixels;
         },
         "Pixels in which paths start: adjoint (more where the loss depends more on the pixel) or "
         "uniform")
      ->check(CLI::IsMember({kAdjointPixels, kUniformPixels}))
      ->default_str(kAdjointPixels);
  add_method_option(app, options.method, task);
  add_points_option(app, options.points);
  app.add_option("--edge-samples", options.edge_samples, "Boundary samples per path vertex")
      ->check(within(1, 1 << 16))
      ->capture_default_str();
  app.add_option("--camera-samples", options.camera_samples,
                 "Boundary samples on the film per path (term camera)")
      ->check(within(1e-6, 1 << 16))
      ->default_str("0.25, 1 with --method analytic");
  app.add_option(
         "--shadow-samples", options.shadow_samples,
         "Boundary samples on the edges of visible shadows per path (terms shadow and penumbra)")
      ->check(within(1e-6, 1 << 16))
      ->capture_default_str();
}

void add_warp_options(CLI::App& app, WarpOptions& warp) {
  app.add_option(
         "--aux", warp.rays,
         "Auxiliary rays per direction (method was): an even number. More rays reduce the bias")
      ->check(within(2, 1 << 20))
      ->capture_default_str()
      ->type_name("N");
  app.add_option("--kappa", warp.kappa,
                 "Concentration K of the kernel of auxiliary rays, which is K^(-1/2) radians wide "
                 "(method was)")
      ->check(within(1.0, 1e12))
      ->capture_default_str()
      ->type_name("K");
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
  Scene scene = read_scene(common.scene, common.defines, &warnings, common.paths);
  for (const std::string& warning : warnings) shown.add(warning);
  if (!common.sensor.empty()) use_sensor(scene, common.sensor);
  if (common.shading == "mitsuba") scene.shading = ShadingModel::kMitsuba;
  return scene;
}

RunSettings make_settings(const CommonOptions& common, const Scene& scene,
                          const std::string& label) {
  RunSettings settings;
  settings.spp = common.spp > 0 ? common.spp : scene.sample_count;
  settings.seed = common.seed.value_or(scene.seed);
  settings.threads = thread_count(common.threads);
  settings.progress = progress_bar(label, common.quiet);
  settings.interrupted = &interrupt_flag();
  settings.store = common.store;
  watch_interrupt();
  return settings;
}

std::vector<ImageAttribute> provenance(const Scene& scene, const RunSettings& settings,
                                       int64_t spp) {
  return {{"limn.scene", scene.file},
          {"limn.sensor", sensor_name(scene)},
          {"limn.spp", std::to_string(spp)},
          {"limn.seed", std::to_string(settings.seed)},
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

double available_memory() {
  std::ifstream stream("/proc/meminfo");
  std::string name, unit;
  double kilobytes = 0;
  while (stream >> name >> kilobytes) {
    if (name == "MemAvailable:") return 1024 * kilobytes;
    std::getline(stream, unit);
  }
  return 0;
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
