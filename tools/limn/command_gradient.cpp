#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/check.h"
#include "limn/integrators/gradient.h"
#include "tools/limn/commands.h"

namespace limn {
namespace {

using nlohmann::json;

// A parameter's name as a part of a file's name.
std::string file_part(const std::string& name) {
  std::string part = name;
  for (char& c : part) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '_';
  }
  return part;
}

double mean_magnitude(const Moments& moments) {
  double sum = 0;
  for (size_t i = 0; i < moments.size(); ++i) sum += std::fabs(moments.mean(i));
  return sum / moments.size();
}

// Of the image: the mean over pixels and channels of the squared standard error.
double mean_squared_error(const Moments& moments) {
  double sum = 0;
  for (size_t i = 0; i < moments.size(); ++i) sum += moments.variance(i);
  return sum / moments.size();
}

struct Sum {
  double value, error;
};
Sum image_sum(const Moments& sum) { return {sum.mean(0), std::sqrt(sum.variance(0))}; }

// Writes the images of one parameter; returns its figures.
json write_parameter(const Scene& scene, const ParameterGradient& g, const std::string& output,
                     std::vector<ImageAttribute> attributes, const CommonOptions& common) {
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
    errors = with_ending(output, "_stderr.exr");
    write_exr(errors, film_channels(scene, standard_error_image(g.total, width, height)), false,
              attributes);
  }
  const Sum sum = image_sum(g.image_sum);
  if (!common.quiet) {
    fmt::print("{}: {}, {}, standard error {}\n", g.name, output, picture, errors);
    fmt::print(
        "  picture: blue -{0:.4g}, white 0, red +{0:.4g}; sum over the image {1:.6g} +- {2:.2g}\n",
        scale, sum.value, sum.error);
  }
  json terms;
  for (int t = 0; t < kTermCount; ++t) {
    terms[term_name(t)] = {{"mean_magnitude", mean_magnitude(g.terms[t])},
                           {"mean_squared_error", mean_squared_error(g.terms[t])}};
  }
  return {{"name", g.name},          {"image", output},
          {"picture", picture},      {"stderr", errors},
          {"scale", scale},          {"sum", sum.value},
          {"sum_stderr", sum.error}, {"mean_squared_error", mean_squared_error(g.total)},
          {"terms", terms}};
}

void print_terms(const GradientResult& result, const std::array<bool, kTermCount>& terms) {
  double seconds = 0;
  for (const TermCost& cost : result.costs) seconds += cost.seconds;
  fmt::print("{:10} {:>7} {:>12} {:>12}", "term", "time", "rays", "samples");
  for (const auto& g : result.parameters) fmt::print("  share of {}", g.name);
  fmt::print("\n");
  for (int t = 0; t < kTermCount; ++t) {
    const TermCost& cost = result.costs[t];
    if (!terms[t] && cost.samples == 0) continue;
    fmt::print("{:10} {:5.1f} % {:>12} {:>12}", term_name(t), 100 * cost.seconds / seconds,
               cost.rays, cost.samples);
    for (const auto& g : result.parameters) {
      double all = 0;
      for (const Moments& term : g.terms) all += mean_magnitude(term);
      fmt::print("  {:>{}.1f} %", all > 0 ? 100 * mean_magnitude(g.terms[t]) / all : 0.0,
                 g.name.size() + 7);
    }
    fmt::print("\n");
  }
  const TermCost& b = result.costs[kBoundary];
  if (b.samples > 0) {
    const auto share = [&](uint64_t n) { return 100.0 * n / b.samples; };
    fmt::print(
        "boundary samples: {:.1f} % found no edge, {:.1f} % without weight, {:.1f} % occluded, "
        "{:.1f} % counted\n",
        share(b.no_edge), share(b.zero_weight), share(b.occluded), share(b.counted));
  }
}

void print_samples(const GradientResult& r) {
  fmt::print("{} samples per pixel, {:.2f} s, of which {:.2f} s set-up\n", r.spp, r.seconds,
             r.setup_seconds);
  fmt::print("each holds {} of interior, camera, boundary{}\n", to_string(r.samples),
             r.pilot_spp > 0 ? fmt::format(", chosen by {} samples per pixel", r.pilot_spp) : "");
}

json costs_json(const GradientResult& result) {
  json costs;
  for (int t = 0; t < kTermCount; ++t) {
    const TermCost& c = result.costs[t];
    costs[term_name(t)] = {{"seconds", c.seconds},         {"rays", c.rays},
                           {"samples", c.samples},         {"no_edge", c.no_edge},
                           {"zero_weight", c.zero_weight}, {"occluded", c.occluded},
                           {"counted", c.counted}};
  }
  return costs;
}

json samples_json(const SampleCounts& samples) {
  return {
      {"interior", samples.interior}, {"camera", samples.camera}, {"boundary", samples.boundary}};
}

}  // namespace

int run_gradient(const CommonOptions& common, const GradientCommand& command) {
  const Scene scene = load_scene(common);
  GradientOptions options;
  options.parameters = command.parameters;
  options.terms = parse_terms(command.terms);
  options.sampler = command.sampler;
  options.samples = parse_samples(command.samples);
  for (const auto& name : options.parameters) find_parameter(scene, name);
  std::vector<std::string> outputs;
  for (const auto& name : options.parameters) {
    outputs.push_back(options.parameters.size() == 1
                          ? command.output
                          : with_ending(command.output, "_" + file_part(name) + ".exr"));
    check_output(outputs.back());
  }
  const RunSettings settings = make_settings(common, scene, "gradient");
  const GradientResult result = gradient(scene, options, settings);
  for (const auto& warning : result.warnings) fmt::print(stderr, "warning: {}\n", warning);
  if (result.spp == 0) {
    fmt::print(stderr, "interrupted before the first pass over the image: nothing is written\n");
    return kInterrupted;
  }
  auto attributes = provenance(scene, settings, result.spp);
  attributes.push_back({"limn.terms", command.terms});
  attributes.push_back({"limn.sampler", command.sampler});
  attributes.push_back({"limn.samples", to_string(result.samples)});
  json parameters = json::array();
  for (size_t k = 0; k < outputs.size(); ++k) {
    parameters.push_back(
        write_parameter(scene, result.parameters[k], outputs[k], attributes, common));
  }
  if (!common.quiet) {
    print_terms(result, options.terms);
    print_samples(result);
  }
  const json report = {{"scene", scene.file},
                       {"spp", result.spp},
                       {"seed", settings.seed},
                       {"threads", settings.threads},
                       {"sampler", command.sampler},
                       {"terms", command.terms},
                       {"samples", samples_json(result.samples)},
                       {"pilot_spp", result.pilot_spp},
                       {"seconds", result.seconds},
                       {"setup_seconds", result.setup_seconds},
                       {"costs", costs_json(result)},
                       {"non_finite", result.non_finite.count},
                       {"parameters", parameters}};
  write_json(common.json, report.dump(2));
  return finish_status(result.non_finite, result.spp, settings.spp);
}

namespace {

void print_z(const char* name, double step, const ZSummary& z) {
  fmt::print("  {:24} {:10.3g} {:7} {:8.2f} {:8.2f} {:8.2f} {:9.2g}\n", name, step, z.count, z.mean,
             z.deviation, z.largest, std::min(z.p_chi_square, z.p_largest));
}

json z_json(const ZSummary& z) {
  return {{"blocks", z.count},
          {"mean", z.mean},
          {"deviation", z.deviation},
          {"largest", z.largest},
          {"p_chi_square", z.p_chi_square},
          {"p_largest", z.p_largest}};
}

void print_check(const std::string& name, const CheckResult& r) {
  fmt::print(
      "{}: {} samples per pixel ({} of interior, camera, boundary), blocks of {} x {} pixels\n",
      name, r.gradient.spp, to_string(r.gradient.samples), r.block, r.block);
  fmt::print("  {:24} {:>10} {:>7} {:>8} {:>8} {:>8} {:>9}\n", "z against", "step", "blocks",
             "mean", "sd", "max |z|", "p");
  print_z("differences", r.step, r.at_step);
  print_z("differences, twice", 2 * r.step, r.at_double_step);
  print_z("both, extrapolated", r.step, r.extrapolated);
  fmt::print("  whole image: gradient {:.6g} +- {:.2g}, differences {:.6g} +- {:.2g}, z = {:.2f}\n",
             r.total.gradient, r.total.gradient_error, r.total.difference, r.total.difference_error,
             r.total.z);
  if (r.agree) {
    fmt::print("  agree\n");
    return;
  }
  const Suspicion& s = r.suspicions[r.suspect];
  fmt::print(
      "  DISAGREE: suspect the {} term: the differences hold {:.3g} times more of it (z = "
      "{:.1f}).\n"
      "  If the two steps disagree with each other as well, try a smaller --step.\n",
      term_name(r.suspect), 1 + s.factor, s.z);
}

}  // namespace

int run_check(const CommonOptions& common, const GradientCommand& command) {
  const Scene scene = load_scene(common);
  const auto terms = parse_terms(command.terms);
  const auto samples = parse_samples(command.samples);
  for (const auto& name : command.parameters) find_parameter(scene, name);
  json report = json::array();
  int status = kSuccess;
  for (const auto& name : command.parameters) {
    const RunSettings settings = make_settings(common, scene, "check " + name);
    if (settings.spp < 2) throw InputError("check needs --spp of at least 2, for standard errors");
    const CheckResult r = check(
        scene, {name, terms, command.sampler, command.step, command.block, samples}, settings);
    if (r.differences.spp < settings.spp) {
      fmt::print(stderr, "interrupted: no verdict\n");
      return kInterrupted;
    }
    print_check(name, r);
    report.push_back({{"parameter", name},
                      {"step", r.step},
                      {"spp", r.gradient.spp},
                      {"samples", samples_json(r.gradient.samples)},
                      {"agree", r.agree},
                      {"gradient_sum", r.total.gradient},
                      {"gradient_sum_stderr", r.total.gradient_error},
                      {"difference_sum", r.total.difference},
                      {"difference_sum_stderr", r.total.difference_error},
                      {"z_sum", r.total.z},
                      {"z_at_step", z_json(r.at_step)},
                      {"z_at_double_step", z_json(r.at_double_step)},
                      {"z_extrapolated", z_json(r.extrapolated)}});
    if (!r.agree) status = kDisagree;
    NonFinite bad = r.gradient.non_finite;
    bad.merge(r.differences.non_finite);
    if (const int s = finish_status(bad, settings.spp, settings.spp)) status = s;
  }
  write_json(common.json, report.dump(2));
  return status;
}

}  // namespace limn
