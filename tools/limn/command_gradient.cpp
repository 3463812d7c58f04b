// `limn gradient`: derivative images with standard errors, by any method.
#include "limn/core/memory.h"
#include "limn/integrators/gradient.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parameter.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/output_files.h"
#include "tools/limn/run_part.h"
#include "tools/limn/run_stats.h"
#include "tools/limn/table.h"

namespace limn {
namespace {

using nlohmann::json;

// From this share of the squared error in a thousandth of the pixels on. Not tuned.
constexpr double kRulingPixels = 0.5;

// 0 for a term that is not computed.
double mean_magnitude(const Moments& moments) {
  if (moments.size() == 0) return 0;
  double sum = 0;
  for (size_t i = 0; i < moments.size(); ++i) sum += std::fabs(moments.mean(i));
  return sum / moments.size();
}

// The mean over pixels and channels of the squared standard error.
double mean_squared_error(const Moments& moments) {
  double sum = 0;
  for (size_t i = 0; i < moments.size(); ++i) sum += moments.variance(i);
  return sum / moments.size();
}

// The share of the squared error in the thousandth of the pixels where it is largest.
double worst_share(const Moments& moments) {
  std::vector<double> pixels(moments.size() / 3);
  double sum = 0;
  for (size_t i = 0; i < moments.size(); ++i) {
    const double variance = moments.variance(i);
    pixels[i / 3] += variance;
    sum += variance;
  }
  const size_t few = std::max<size_t>(1, pixels.size() / 1000);
  std::partial_sort(pixels.begin(), pixels.begin() + static_cast<long>(few), pixels.end(),
                    std::greater<>());
  double worst = 0;
  for (size_t i = 0; i < few; ++i) worst += pixels[i];
  return sum > 0 ? worst / sum : 0;
}

struct Sum {
  double value, error;
};
Sum image_sum(const Moments& sum) { return {sum.mean(0), std::sqrt(sum.variance(0))}; }

std::string stderr_file(const std::string& output) { return with_ending(output, "_stderr.exr"); }

std::string percent(double share) { return fmt::format("{:.1f} %", 100 * share); }

double share_of(const ParameterGradient& g, size_t term) {
  double all = 0;
  for (const Moments& m : g.terms) all += mean_magnitude(m);
  return all > 0 ? mean_magnitude(g.terms[term]) / all : 0;
}

// Where time, rays and samples went, and each term's share of the sum of mean magnitudes.
void print_terms(const GradientResult& result) {
  double seconds = 0;
  for (const TermRun& term : result.terms) seconds += term.cost.seconds;
  std::vector<Table::Column> columns{{"term", true}, {"time"}, {"rays"}, {"samples"}, {"per spp"}};
  for (const auto& g : result.parameters) columns.push_back({"of " + g.name});
  Table table(columns);
  for (size_t t = 0; t < result.terms.size(); ++t) {
    const TermRun& term = result.terms[t];
    if (!term.computed && term.cost.samples == 0) continue;
    Table::Row row{term.name, percent(seconds > 0 ? term.cost.seconds / seconds : 0),
                   std::to_string(term.cost.rays), std::to_string(term.cost.samples),
                   fmt::format("{:.3g}", term.samples)};
    for (const auto& g : result.parameters) row.push_back(percent(share_of(g, t)));
    table.add(row);
  }
  fmt::print("\n{}", table.text());
}

// What became of the samples of each term that draws edges.
void print_boundary_samples(const GradientResult& result) {
  Table table({{"samples", true},
               {"rejected"},
               {"zero contribution"},
               {"roulette"},
               {"occluded"},
               {"contributing"}});
  bool any = false;
  for (const TermRun& term : result.terms) {
    const TermCost& c = term.cost;
    if (c.no_edge + c.zero_weight == 0) continue;
    Table::Row row{term.name};
    for (const uint64_t n : {c.no_edge, c.zero_weight, c.left_out, c.occluded, c.counted}) {
      row.push_back(percent(static_cast<double>(n) / static_cast<double>(c.samples)));
    }
    table.add(row);
    any = true;
  }
  if (any) fmt::print("\n{}", table.text());
}

void print_samples(const GradientResult& r) {
  fmt::print("\n{} samples per pixel in {:.2f} s (set-up {:.2f} s)", r.spp, r.seconds,
             r.setup_seconds);
  if (r.pilot_spp > 0) fmt::print("; terms allocated from a pilot of {} spp", r.pilot_spp);
  fmt::print("\n");
  for (const MethodSetting& setting : r.settings) fmt::print("{}\n", setting_line(setting));
}

class GradientCommand final : public Command {
 public:
  const char* name() const override { return "gradient"; }
  const char* description() const override {
    return "Compute derivative images with standard errors (forward mode)";
  }

  void add_options(CLI::App& app) override {
    app_ = &app;
    add_common_options(app, common_);
    add_what_option(app, common_);
    add_parameter_options(app, options_.parameters);
    visit_options(options_, OptionAdder(app));
    add_samples_option(app, samples_);
    add_time_option(app, common_);
    app.add_option("-o,--output", output_,
                   "Derivative image to write (.exr); _stderr.exr and .png are written beside it. "
                   "With several --wrt each name gets a suffix")
        ->required()
        ->type_name("FILE");
    app.add_flag("--sample-images", sample_images_,
                 "Also write the samples of each term per pixel sample to OUTPUT_samples_TERM.exr");
    app.add_flag("--stats", stats_,
                 "Print statistics: edges, nodes, bytes, rays by kind, time by phase");
    add_debug_option(app, debug_);
    add_part_option(app, common_);
    app.get_option("--part")->excludes("--time");
  }
  bool join(BatchStore& store) override {
    common_.run.store = &store;
    return true;
  }

  int run(const std::string& command_line) override {
    const Scene scene = load_scene(common_, warnings_);
    refuse_samples(*app_, options_.points,
                   {"--spp", "--time", "--samples", "--sample-images", "--part"}, options_);
    options_.samples = parse_samples(samples_);
    options_.uniform_samples = samples_ == "uniform";
    if (!debug_.empty()) return trace(scene);
    for (const auto& parameter : options_.parameters) find_parameter(scene, parameter);
    if (!common_.part.empty()) {
      check_memory(scene);
      return run_part(
          common_, scene, field_files(options_.parameters), {name(), words, command_line}, output_,
          [&](const RunSettings& part) { return gradient(scene, options_, part).non_finite; });
    }
    for (const auto& parameter : options_.parameters) {
      outputs_.push_back(options_.parameters.size() == 1
                             ? output_
                             : with_ending(output_, "_" + file_part(parameter) + ".exr"));
      check_output(outputs_.back());
    }
    check_outputs(planned_files(), scene, field_files(options_.parameters));
    check_memory(scene);
    const RunSettings settings =
        settings_for(options_.points, make_settings(common_, scene, name()));
    const GradientResult result = gradient(scene, options_, settings);
    warnings_.add_all(result.warnings);
    if (result.spp == 0) {
      fmt::print(stderr, "interrupted before the first pass over the image: nothing is written\n");
      return kInterrupted;
    }
    write(scene, settings, result);
    if (!common_.quiet) {
      print_terms(result);
      print_boundary_samples(result);
      print_samples(result);
      print_largest(result.terms, result.spp, command_line, stats_);
    }
    if (stats_) print_stats(result.stats, result.terms);
    const bool all = settings.seconds > 0 && !settings.interrupted->load();
    return finish_status(result.non_finite, result.spp,
                         all ? result.spp : std::max(settings.spp, result.planned_spp),
                         command_line);
  }

 private:
  int trace(const Scene& scene) {
    common_.run.seconds = 0;
    const RunSettings settings = make_settings(common_, scene, name());
    for (const auto& line : trace_sample(scene, options_, settings, parse_place(debug_))) {
      fmt::print("{}\n", line);
    }
    return kSuccess;
  }

  // All that may be written, before the run.
  std::vector<PlannedFile> planned_files() const {
    std::vector<PlannedFile> files;
    for (size_t k = 0; k < outputs_.size(); ++k) {
      const std::string option = outputs_.size() > 1 ? "-o, --wrt " + options_.parameters[k] : "-o";
      for (const std::string& file :
           {outputs_[k], with_ending(outputs_[k], ".png"), stderr_file(outputs_[k])}) {
        files.push_back({option, file});
      }
    }
    if (sample_images_) {
      for (const std::string& term : options_.method->terms) {
        files.push_back({"--sample-images", samples_file(term)});
      }
    }
    files.push_back({"--json", common_.json});
    return files;
  }

  // Moments and sums of batches: numbers of each pixel and channel.
  void check_memory(const Scene& scene) const {
    const double terms = static_cast<double>(options_.method->terms.size());
    const double parameters = static_cast<double>(options_.parameters.size());
    const double numbers = parameters * (3 * (terms + 1) + terms) + 5;
    const double bytes = numbers * sizeof(double) * 3 * scene.film.crop_width *
                         static_cast<double>(scene.film.crop_height);
    require_memory({scene.file}, bytes,
                   fmt::format("a run with {:.0f} --wrt of {} x {} pixels", parameters,
                               scene.film.crop_width, scene.film.crop_height),
                   "take fewer --wrt in one run, or a smaller film or crop");
  }

  std::string samples_file(const std::string& term) const {
    return with_ending(output_, "_samples_" + term + ".exr");
  }

  // What this run leaves: older files of the same name are none of it.
  void remove_older(const GradientResult& result) const {
    std::vector<std::string> written = outputs_;
    for (size_t k = 0; k < outputs_.size(); ++k) {
      if (result.parameters[k].total.batches() > 1) written.push_back(stderr_file(outputs_[k]));
    }
    for (const TermRun& term : result.terms) {
      if (sample_images_ && term.computed) written.push_back(samples_file(term.name));
    }
    remove_stale(output_, written);
  }

  void write(const Scene& scene, const RunSettings& settings, const GradientResult& result) {
    remove_older(result);
    std::string terms;
    json samples = json::object();
    for (const TermRun& term : result.terms) {
      samples[term.name] = term.samples;
      if (term.computed) terms += (terms.empty() ? "" : ",") + term.name;
    }
    auto attributes = provenance(scene, settings, result.spp);
    attributes.push_back({"limn.terms", terms});
    attributes.push_back({"limn.method", result.method});
    attributes.push_back({"limn.samples", to_string(result.samples())});
    for (const ImageAttribute& a : settings_attributes(result.settings)) attributes.push_back(a);
    attributes.push_back({kOutputAttribute, output_name(output_)});
    json parameters = json::array();
    for (size_t k = 0; k < outputs_.size(); ++k) {
      parameters.push_back(
          write_parameter(scene, result.parameters[k], result.terms, outputs_[k], attributes));
    }
    if (sample_images_) write_sample_images(scene, result, attributes);
    const json report = {{"scene", scene.file},
                         {"sensor", sensor_name(scene)},
                         {"spp", result.spp},
                         {"seed", settings.seed},
                         {"threads", settings.threads},
                         {"method", result.method},
                         {"settings", settings_json(result.settings)},
                         {"terms", terms},
                         {"samples", samples},
                         {"pilot_spp", result.pilot_spp},
                         {"seconds", result.seconds},
                         {"setup_seconds", result.setup_seconds},
                         {"costs", costs_json(result.terms)},
                         {"stats", stats_json(result.stats)},
                         {"non_finite", result.non_finite.count},
                         {"parameters", parameters},
                         {"warnings", warnings_.lines()}};
    write_json(common_.json, report.dump(2));
  }

  // Writes the images of one parameter; returns its figures.
  json write_parameter(const Scene& scene, const ParameterGradient& g,
                       const std::vector<TermRun>& terms, const std::string& output,
                       std::vector<ImageAttribute> attributes) {
    attributes.push_back({"limn.parameter", g.name});
    const int width = scene.film.crop_width;
    const int height = scene.film.crop_height;
    const Image image = mean_image(g.total, width, height);
    const double scale = signed_scale(image);
    // Signed derivatives are always written in full precision.
    write_exr(output, film_channels(scene, image), false, attributes);
    const std::string picture = with_ending(output, ".png");
    write_signed_png(picture, image, scale);
    std::string errors = "none (one batch only)";
    if (g.total.batches() > 1) {
      errors = stderr_file(output);
      write_exr(errors, film_channels(scene, standard_error_image(g.total, width, height)), false,
                attributes);
    }
    const Sum sum = image_sum(g.image_sum);
    const size_t pixels = g.total.size() / 3;
    if (const double share = worst_share(g.total); pixels >= 1000 && share >= kRulingPixels) {
      warnings_.add_all(
          {fmt::format("{}: {} of {} pixels have {:.0f} % of the squared error: few samples "
                       "dominate the standard "
                       "errors",
                       g.name, pixels / 1000, pixels, 100 * share)});
    }
    if (!common_.quiet) {
      fmt::print("{}\n", g.name);
      fmt::print("  derivative      {}\n", output);
      fmt::print("  picture         {0} (blue -{1:.4g}, white 0, red +{1:.4g})\n", picture, scale);
      fmt::print("  standard error  {}\n", errors);
      fmt::print("  image sum       {:.6g} +- {:.2g}\n", sum.value, sum.error);
    }
    json term_figures = json::object();
    for (size_t t = 0; t < terms.size(); ++t) {
      if (!terms[t].computed) continue;
      term_figures[terms[t].name] = {{"mean_magnitude", mean_magnitude(g.terms[t])},
                                     {"mean_squared_error", mean_squared_error(g.terms[t])}};
    }
    return {{"name", g.name},
            {"image", output},
            {"picture", picture},
            {"stderr", errors},
            {"scale", scale},
            {"sum", sum.value},
            {"sum_stderr", sum.error},
            {"mean_squared_error", mean_squared_error(g.total)},
            {"worst_share", worst_share(g.total)},
            {"terms", term_figures}};
  }

  void write_sample_images(const Scene& scene, const GradientResult& result,
                           const std::vector<ImageAttribute>& attributes) const {
    for (const TermRun& term : result.terms) {
      if (!term.computed) continue;
      Image image(scene.film.crop_width, scene.film.crop_height, 1);
      image.data = term.pixel_samples;
      image.data.resize(static_cast<size_t>(image.width) * image.height,
                        static_cast<float>(term.samples));
      write_exr(samples_file(term.name), image, false, attributes);
    }
  }

  CommonOptions common_;
  Warnings warnings_;
  CLI::App* app_ = nullptr;
  GradientOptions options_;
  std::string samples_ = "auto", output_, debug_;
  bool stats_ = false, sample_images_ = false;
  std::vector<std::string> outputs_;  // of each parameter
};

}  // namespace

std::unique_ptr<Command> make_gradient_command() { return std::make_unique<GradientCommand>(); }

}  // namespace limn
