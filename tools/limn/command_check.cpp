// `limn check`: a gradient by any method against finite differences.
#include "limn/integrators/check.h"

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"

namespace limn {
namespace {

using nlohmann::json;

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
  std::string samples;
  for (const TermRun& term : r.gradient.terms) {
    samples += fmt::format("{}{:.3g} {}", samples.empty() ? "" : ", ", term.samples, term.name);
  }
  fmt::print("{}: {} samples per pixel ({}), blocks of {} x {} pixels\n", name, r.gradient.spp,
             samples, r.block, r.block);
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
  const Suspicion& s = r.suspicions[r.gradient.term(r.suspect)];
  fmt::print(
      "  DISAGREE: suspect the {} term: the differences hold {:.3g} times more of it (z = "
      "{:.1f}).\n"
      "  If the two steps disagree with each other as well, try a smaller --step.\n",
      r.suspect, 1 + s.factor, s.z);
}

json check_json(const std::string& name, const CheckResult& r) {
  json samples = json::object();
  for (const TermRun& term : r.gradient.terms) samples[term.name] = term.samples;
  return {{"parameter", name},
          {"method", r.gradient.method},
          {"step", r.step},
          {"spp", r.gradient.spp},
          {"samples", samples},
          {"agree", r.agree},
          {"gradient_sum", r.total.gradient},
          {"gradient_sum_stderr", r.total.gradient_error},
          {"difference_sum", r.total.difference},
          {"difference_sum_stderr", r.total.difference_error},
          {"z_sum", r.total.z},
          {"z_at_step", z_json(r.at_step)},
          {"z_at_double_step", z_json(r.at_double_step)},
          {"z_extrapolated", z_json(r.extrapolated)}};
}

class CheckCommand final : public Command {
 public:
  const char* name() const override { return "check"; }
  const char* description() const override { return "Compare a gradient with finite differences"; }

  void add_options(CLI::App& app, bool all) override {
    add_common_options(app, common_);
    add_parameter_options(app, parameters_, options_.method, all);
    add_term_options(app, terms_, samples_);
    app.add_option("--step", options_.step,
                   "Step of the differences (default: the parameter's own)")
        ->check(CLI::PositiveNumber);
    app.add_option("--block", options_.block,
                   "Compare blocks of this many pixels (default: an eighth of the longer side)")
        ->check(CLI::Range(1, 1 << 20));
  }

  int run(const std::string&) override {
    const Scene scene = load_scene(common_);
    options_.terms = parse_terms(terms_);
    options_.samples = parse_samples(samples_);
    for (const auto& parameter : parameters_) find_parameter(scene, parameter);
    json report = json::array();
    int status = kSuccess;
    for (const auto& parameter : parameters_) {
      const RunSettings settings = make_settings(common_, scene, "check " + parameter);
      if (settings.spp < 2) {
        throw InputError("check needs --spp of at least 2, for standard errors");
      }
      options_.parameter = parameter;
      const CheckResult r = check(scene, options_, settings);
      if (r.differences.spp < settings.spp) {
        fmt::print(stderr, "interrupted: no verdict\n");
        return kInterrupted;
      }
      print_check(parameter, r);
      report.push_back(check_json(parameter, r));
      if (!r.agree) status = kDisagree;
      NonFinite bad = r.gradient.non_finite;
      bad.merge(r.differences.non_finite);
      if (const int s = finish_status(bad, settings.spp, settings.spp, "")) status = s;
    }
    write_json(common_.json, report.dump(2));
    return status;
  }

 private:
  CommonOptions common_;
  CheckOptions options_;
  std::vector<std::string> parameters_;
  std::string terms_, samples_ = "auto";
};

}  // namespace

std::unique_ptr<Command> make_check_command() { return std::make_unique<CheckCommand>(); }

}  // namespace limn
