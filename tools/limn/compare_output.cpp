// Pictures, images, JSON and CSV of a comparison.
#include "tools/limn/compare_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tools/limn/command_support.h"
#include "tools/limn/output_files.h"
#include "tools/limn/table.h"

namespace limn {
namespace {

using json = nlohmann::ordered_json;

// Common to all pictures of one kind: white is 0, saturated is +-scale.
struct Scales {
  double derivative = 1;
  double error = 1;
};

std::vector<double> minus(std::vector<double> a, const std::vector<double>& b) {
  for (size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return a;
}

// The middle one of the methods' own scales (of two, the smaller): neither the worst method nor the
// best makes the others' errors invisible.
double error_scale(const Comparison& c, const Film& film) {
  std::vector<double> scales;
  for (const ComparedMethod& m : c.methods) {
    if (!m.image.empty()) {
      scales.push_back(signed_scale(to_image(minus(m.image, c.reference.image), film)));
    }
  }
  if (scales.empty()) return 1;
  std::sort(scales.begin(), scales.end());
  return scales[(scales.size() - 1) / 2];
}

std::string in_folder(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).string();
}

// Attributes of the image that is shown: the first repeat of the longest time.
std::vector<ImageAttribute> image_attributes(const Scene& scene, const Comparison& c,
                                             const ComparedMethod& m) {
  const auto shown = std::find_if(m.runs.rbegin(), m.runs.rend(),
                                  [](const ComparedRun& r) { return r.repeat == 0; });
  RunSettings settings;
  settings.seed = shown->seed;
  auto attributes = provenance(scene, settings, shown->run.spp);
  if (c.what.empty()) {
    attributes.push_back({"limn.parameter", c.parameter});
    attributes.push_back({"limn.terms", c.terms});
  } else {
    attributes.push_back({"limn.what", c.what});
  }
  attributes.push_back({"limn.method", m.name});
  for (const ImageAttribute& a : settings_attributes(m.settings)) attributes.push_back(a);
  return attributes;
}

void write_pictures(const std::string& folder, const Scene& scene, const Comparison& c,
                    const Scales& scales) {
  const Film& film = scene.film;
  const auto write_picture = [&](const std::string& file, const Image& image) {
    c.what.empty() ? write_signed_png(file, image, scales.derivative) : write_png(file, image, 1);
  };
  if (c.image.spp > 0) {
    write_png(in_folder(folder, "image.png"),
              mean_image(c.image.radiance, film.crop_width, film.crop_height), 1);
  }
  write_picture(in_folder(folder, "reference.png"), to_image(c.reference.image, film));
  for (const ComparedMethod& m : c.methods) {
    if (m.image.empty()) continue;
    const std::string stem = in_folder(folder, file_part(m.name));
    const Image image = to_image(m.image, film);
    write_exr(stem + ".exr", film_channels(scene, image), false, image_attributes(scene, c, m));
    write_picture(stem + ".png", image);
    write_signed_png(stem + "_error.png", to_image(minus(m.image, c.reference.image), film),
                     scales.error);
  }
}

json terms_json(const std::vector<std::pair<std::string, double>>& seconds) {
  json terms = json::object();
  for (const auto& [name, s] : seconds) terms[name] = s;
  return terms;
}

// 0: unknown.
template <class Number>
json or_null(Number value) {
  return value > 0 ? json(value) : json(nullptr);
}

json run_json(const ComparedRun& r, const std::vector<double>& times) {
  return {{"time", times[r.budget]},
          {"repeat", r.repeat},
          {"seconds", r.run.seconds},
          {"setup_seconds", r.run.setup_seconds},
          {"spp", r.run.spp},
          {"rays", or_null(r.run.rays)},
          {"mse", r.errors.mse},
          {"relative_mse", r.errors.relative_mse},
          {"trimmed_mse", r.errors.trimmed_mse},
          {"terms", terms_json(r.run.term_seconds)},
          {"peak_memory_bytes", or_null(r.run.peak_memory_bytes)}};
}

json bias_json(const ZSummary& z) {
  if (z.count == 0) return nullptr;
  return {{"blocks", z.count},
          {"mean", z.mean},
          {"deviation", z.deviation},
          {"largest", z.largest},
          {"p", p_value(z)}};
}

json summary_json(const BudgetSummary& s, const std::vector<double>& times) {
  return {{"time", times[s.budget]},
          {"seconds", s.seconds},
          {"setup_seconds", s.setup_seconds},
          {"spp", s.spp},
          {"rays", or_null(s.rays)},
          {"mse", s.mse.value},
          {"mse_stderr", s.mse.error},
          {"relative_mse", s.relative_mse.value},
          {"relative_mse_stderr", s.relative_mse.error},
          {"trimmed_mse", s.trimmed_mse.value},
          {"trimmed_mse_stderr", s.trimmed_mse.error},
          {"bias", bias_json(s.bias)},
          {"terms", terms_json(s.term_seconds)},
          {"peak_memory_bytes", or_null(s.peak_memory_bytes)}};
}

const char* status_name(MethodStatus status) {
  constexpr const char* kNames[] = {"done", "interrupted", "missing"};
  return kNames[static_cast<int>(status)];
}

json method_json(const ComparedMethod& m, const std::vector<double>& times) {
  const auto file = [&](const char* ending) {
    return m.image.empty() ? "" : file_part(m.name) + ending;
  };
  json object = {{"name", m.name},
                 {"description", m.description},
                 {"status", status_name(m.status)},
                 {"message", m.message},
                 {"image", file(".exr")},
                 {"picture", file(".png")},
                 {"error_picture", file("_error.png")},
                 {"settings", settings_json(m.settings)},
                 {"runs", json::array()},
                 {"summary", json::array()},
                 {"slope", nullptr},
                 {"time_ratio", nullptr},
                 {"time_ratio_stderr", nullptr}};
  for (const ComparedRun& run : m.runs) object["runs"].push_back(run_json(run, times));
  for (const BudgetSummary& s : m.summary) object["summary"].push_back(summary_json(s, times));
  if (m.slope) object["slope"] = {{"value", m.slope->value}, {"stderr", m.slope->error}};
  if (m.time_ratio) {
    object["time_ratio"] = m.time_ratio->value;
    object["time_ratio_stderr"] = m.time_ratio->error;
  }
  return object;
}

json comparison_json(const Scene& scene, const Comparison& c, const Scales& scales) {
  json object = {{"kind", c.what.empty() ? "compare" : "compare_images"},
                 {"command", c.command},
                 {"scene", scene.file},
                 {"sensor", sensor_name(scene)},
                 {"defines", c.defines},
                 {"what", c.what},
                 {"parameter", c.parameter},
                 {"unit", c.unit},
                 {"warnings", c.warnings},
                 {"width", scene.film.crop_width},
                 {"height", scene.film.crop_height},
                 {"seed", c.seed},
                 {"threads", c.threads},
                 {"repeats", c.options.repeats},
                 {"times", c.options.times},
                 {"scale", scales.derivative},
                 {"error_scale", scales.error},
                 {"image", c.image.spp > 0 ? "image.png" : ""}};
  object["reference"] = {{"image", "reference.exr"},
                         {"picture", "reference.png"},
                         {"method", c.reference.method},
                         {"spp", c.reference.spp},
                         {"seconds", c.reference.seconds},
                         {"seed", c.reference.seed},
                         {"cached", c.reference.cached},
                         {"file", c.reference_file},
                         {"mean_squared_error", mean_of(c.reference.variance)}};
  object["methods"] = json::array();
  for (const ComparedMethod& m : c.methods) {
    object["methods"].push_back(method_json(m, c.options.times));
  }
  return object;
}

// "1.23e-05 +- 4e-07"
std::string uncertain(const Uncertain& u) {
  return std::isnan(u.error) ? fmt::format("{:.3g}", u.value)
                             : fmt::format("{:.3g} +- {:.1g}", u.value, u.error);
}

Table::Row row_of(const ComparedMethod& m) {
  const BudgetSummary& s = m.summary.back();
  const std::string bias =
      s.bias.count > 0 ? fmt::format("{:.2g} ({:.2g})", p_value(s.bias), s.bias.largest) : "-";
  return {m.name,
          fmt::format("{:.3g}", s.seconds),
          s.setup_seconds > 0 ? fmt::format("{:.2g}", s.setup_seconds) : "-",
          fmt::format("{:.4g}", s.spp),
          s.rays > 0 ? fmt::format("{:.3g}", s.rays / 1e6) : "-",
          uncertain(s.mse),
          fmt::format("{:.3g}", s.relative_mse.value),
          fmt::format("{:.3g}", s.trimmed_mse.value),
          bias,
          m.time_ratio ? uncertain(*m.time_ratio) : "-",
          m.slope ? uncertain(*m.slope) : "-"};
}

void add_method(const ComparedMethod& m, size_t budgets, Table& table) {
  if (m.summary.empty() || m.summary.back().budget + 1 != budgets) {
    const bool missing = m.status == MethodStatus::kMissing;
    table.add_line(m.name + (missing ? " missing: " : ": ") + m.message);
    return;
  }
  table.add(row_of(m));
  if (m.status != MethodStatus::kDone) table.add_line("  " + m.message);
  for (const MethodSetting& setting : m.settings) table.add_line("  " + setting_line(setting));
}

// What the columns are.
void print_legend(const Comparison& c) {
  const size_t pixels = c.reference.image.size() / 3, left_out = trimmed_pixels(pixels);
  fmt::print(
      "\nMSE: mean squared error against the reference; relative: over its mean square; trimmed:\n"
      "without the {} of {} pixels with the largest errors ({:.2g} %). Bias: p of no bias, and "
      "the\n"
      "largest |z| of blocks of pixels. Time ratio: time for the error of {}, over its time.\n"
      "Slope: of log MSE over log time.\n",
      left_out, pixels, 100.0 * static_cast<double>(left_out) / static_cast<double>(pixels),
      c.methods[0].name);
}

}  // namespace

void write_comparison(const std::string& folder, const Scene& scene, const Comparison& comparison) {
  Scales scales;
  scales.derivative = signed_scale(to_image(comparison.reference.image, scene.film));
  scales.error = error_scale(comparison, scene.film);
  write_pictures(folder, scene, comparison, scales);
  write_json(in_folder(folder, "compare.json"), comparison_json(scene, comparison, scales).dump(2));
}

void print_comparison(const Comparison& c) {
  fmt::print("reference: {}, {} samples per pixel, {:.3g} s{}, MSE of its own {:.3g}\n",
             c.reference.method, c.reference.spp, c.reference.seconds,
             c.reference.cached ? " (kept)" : "", mean_of(c.reference.variance));
  if (!c.not_by_rays.empty()) fmt::print("(not rays: {})\n", c.not_by_rays);
  Table table({{"method", true},
               {"time [s]"},
               {"set-up [s]"},
               {"spp"},
               {"million rays"},
               {"MSE +- std. error"},
               {"relative MSE"},
               {"trimmed MSE"},
               {"bias: p (max |z|)"},
               {"time ratio"},
               {"slope"}});
  for (const ComparedMethod& m : c.methods) add_method(m, c.options.times.size(), table);
  fmt::print("\n{}", table.text());
  print_legend(c);
}

}  // namespace limn
