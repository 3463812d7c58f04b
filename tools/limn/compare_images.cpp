// `limn compare --image`: what it runs, prints and writes.
#include "tools/limn/compare_images.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "limn/core/error.h"
#include "limn/integrators/compare_images.h"
#include "tools/limn/output_files.h"
#include "tools/limn/table.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

// What rounding of a difference, or a reference that is no better, leaves below zero counts as
// zero.
double relative_error(double squared) { return std::sqrt(std::fmax(squared, 0)); }

// With its standard error, from that of its square.
std::string error_in_text(const ImageComparison& result, const ComparedImage& row) {
  if (!(row.squared_error > 0)) {
    return fmt::format("< {:.2g}", relative_error(result.reference_squared_error));
  }
  const double error = relative_error(row.squared_error);
  return fmt::format("{:.3g} +- {:.1g}", error, row.squared_error_stderr / (2 * error));
}

void print_images(const ImageComparison& result) {
  fmt::print("reference: {}, {} samples per pixel, relative error {:.2g}\n",
             result.reference_method, result.reference_spp,
             relative_error(result.reference_squared_error));
  if (!result.not_by_rays.empty()) fmt::print("(not rays: {})\n", result.not_by_rays);
  Table table({{"method", true},
               {"given [s]"},
               {"taken [s]"},
               {"spp"},
               {"relative error +- std. error"},
               {"over that of " + result.rows[0].method}});
  for (const ComparedImage& row : result.rows) {
    double first = 0;
    for (const ComparedImage& other : result.rows) {
      if (other.method == result.rows[0].method && other.time == row.time) {
        first = other.squared_error;
      }
    }
    const bool known = first > 0 && row.squared_error > 0;
    table.add({row.method, fmt::format("{:.3g}", row.time), fmt::format("{:.3g}", row.seconds),
               fmt::format("{:.3g}", row.spp), error_in_text(result, row),
               known ? fmt::format("{:.3g}", relative_error(row.squared_error / first)) : "-"});
  }
  fmt::print("\n{}", table.text());
}

void write_images(const ImageCompareArguments& arguments, const Scene& scene,
                  const RunSettings& settings, const ImageComparison& result,
                  const Warnings& warnings, const std::string& command_line) {
  const auto path = [&](const std::string& name) {
    return (fs::path(arguments.output) / name).string();
  };
  const std::string what = kRenderWhat[static_cast<int>(arguments.render.what)];
  const auto write_image = [&](const std::string& name, const std::vector<double>& values,
                               const std::string& method, int64_t spp) {
    const Image image = to_image(values, scene.film);
    auto attributes = provenance(scene, settings, spp);
    attributes.push_back({"limn.method", method});
    attributes.push_back({"limn.what", what});
    write_exr(path(name + ".exr"), film_channels(scene, image), false, attributes);
    write_png(path(name + ".png"), image, 1);
  };
  write_image("reference", result.reference, result.reference_method, result.reference_spp);
  nlohmann::json rows = nlohmann::json::array();
  for (size_t i = 0; i < result.rows.size(); ++i) {
    const ComparedImage& row = result.rows[i];
    rows.push_back({{"method", row.method},
                    {"time", row.time},
                    {"seconds", row.seconds},
                    {"spp", row.spp},
                    {"relative_squared_error", row.squared_error},
                    {"standard_error", row.squared_error_stderr}});
    const bool longest = i + 1 == result.rows.size() || result.rows[i + 1].method != row.method;
    if (longest) write_image(row.method, row.image, row.method, std::llround(row.spp));
  }
  const nlohmann::json report = {{"command", command_line},
                                 {"scene", scene.file},
                                 {"what", what},
                                 {"generator", arguments.render.generator},
                                 {"film", kFilms[arguments.render.exact_film]},
                                 {"lines", arguments.render.lines},
                                 {"tolerance", arguments.render.tolerance},
                                 {"rays", arguments.render.rays},
                                 {"repeats", arguments.repeats},
                                 {"seed", settings.seed},
                                 {"threads", settings.threads},
                                 {"reference",
                                  {{"method", result.reference_method},
                                   {"spp", result.reference_spp},
                                   {"relative_squared_error", result.reference_squared_error}}},
                                 {"rows", rows},
                                 {"warnings", warnings.lines()},
                                 {"non_finite", result.non_finite.count}};
  write_json(path("compare.json"), report.dump(2));
}

}  // namespace

void check_image_options(const CLI::App& app, const std::vector<Method>& methods) {
  const auto any = [&](auto&& has) {
    return std::ranges::any_of(methods, [&](const Method& m) { return has(*m->image); });
  };
  if (!any([](const ImageMethod& image) { return image.by_lines; })) {
    refuse_options(app, {"--lines", "--tolerance"},
                   "an option of the methods silhouettes and lines alone");
  }
  const auto by_rays = [](const ImageMethod& image) {
    return image.looks_around && !image.by_lines;
  };
  if (!any(by_rays)) refuse_options(app, {"--rays"}, "an option of the method rays alone");
}

void check_exact_film(const std::vector<Method>& methods) {
  for (const Method& method : methods) {
    if (!method->image->looks_around) return;
  }
  throw InputError("--film exact: none of --methods takes it; path and analytic do");
}

int compare_images_command(const CommonOptions& common, ImageCompareArguments arguments,
                           const Scene& scene, const RunSettings& settings, Warnings& warnings,
                           const std::string& command_line) {
  ImageCompareOptions options;
  options.methods = arguments.methods;
  options.render = arguments.render;
  options.times = arguments.times;
  options.repeats = arguments.repeats;
  double once = 0;
  for (const double time : options.times) once += time;
  options.reference_seconds =
      arguments.reference_time > 0 ? arguments.reference_time : 4 * once * options.repeats;
  const ImageComparison result = compare_images(scene, options, settings);
  const bool interrupted = settings.interrupted && settings.interrupted->load();
  if (interrupted) fmt::print(stderr, "\n");
  warnings.add_all(result.warnings);
  if (result.rows.empty()) {
    fmt::print(stderr, "interrupted before a method's first run: nothing is written\n");
    return kInterrupted;
  }
  if (!common.quiet) print_images(result);
  write_images(arguments, scene, settings, result, warnings, command_line);
  copy_json((fs::path(arguments.output) / "compare.json").string(), common.json);
  if (result.non_finite.count > 0) return finish_status(result.non_finite, 0, 0, "");
  if (interrupted) {
    fmt::print(stderr, "interrupted: {} holds all runs that were finished\n", arguments.output);
    return kInterrupted;
  }
  return kSuccess;
}

}  // namespace limn
