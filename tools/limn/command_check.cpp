// `limn check`: a gradient by any method against finite differences.
#include "limn/integrators/check.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/output_files.h"

namespace limn {
namespace {

using nlohmann::json;

// Two digits, as can be typed: 1.2, 58, 5800.
std::string two_digits(double value) {
  const double unit = std::pow(10, std::floor(std::log10(value)) - 1);
  if (!(value >= 10 && std::isfinite(value))) return fmt::format("{:.2g}", value);
  return fmt::format("{:.0f}", std::round(value / unit) * unit);
}

// What else to try where a run shows nothing.
std::string advice(const CheckResult& r, double seconds) {
  const auto spp = static_cast<double>(r.spp);
  const double more = std::max(r.needed_spp / spp, 1.1);
  if (seconds > 0 && more < 1e6) return "take about --time " + two_digits(more * seconds);
  if (seconds == 0 && more * spp < 1e9) return "take about --spp " + two_digits(more * spp);
  return fmt::format("{} samples per pixel are too few to tell how many it takes, try --spp {:.0f}",
                     spp, std::min(100 * spp, 1e9));
}

std::string percent(double part) {
  return part < 10 ? two_digits(100 * part) + " %" : "more than all";
}

// "2.1 % of the total, 1.9 % of interior, 6 % of camera"
std::string power_text(const CheckResult& r) {
  constexpr double kTold = 0.05;  // of all terms' magnitudes
  std::string text;
  for (const CheckPower& power : r.power) {
    if (!power.term.empty() && power.share < kTold) continue;
    const std::string of = power.term.empty() ? "the total" : power.term;
    text += (text.empty() ? "" : ", ") + percent(power.visible) + " of " + of;
  }
  return text;
}

void print_verdict(const CheckResult& r, double seconds) {
  if (r.verdict == Verdict::kDisagree && r.suspects.empty()) {
    fmt::print("  DISAGREE at the level {:.0e}: what is wrong looks like no single term\n",
               kCheckLevel);
  } else if (r.verdict == Verdict::kDisagree) {
    fmt::print("  DISAGREE at the level {:.0e}: suspect ", kCheckLevel);
    for (size_t k = 0; k < r.suspects.size(); ++k) {
      const Suspicion& s = r.suspicions[r.gradient.term(r.suspects[k])];
      fmt::print("{}the {} term: the differences hold {:.3g} times of it (z = {:.1f})",
                 k == 0 ? "" : ", or ", r.suspects[k], 1 + s.factor, s.z);
    }
    fmt::print("\n");
  } else if (r.verdict == Verdict::kAgree && r.is_zero()) {
    fmt::print("  agree: both are zero, without noise\n");
  } else if (r.verdict == Verdict::kAgree) {
    fmt::print("  agree: an error of {} of all terms' magnitudes would have shown\n",
               percent(r.within));
  } else if (r.verdict == Verdict::kNotComplete) {
    fmt::print("  NOT COMPLETE: no error was found, but terms are missing (see the warning)\n");
  } else if (r.bends) {
    fmt::print(
        "  CANNOT TELL: the image is not differentiable here, as where touching shapes separate or "
        "a face is edge-on\n  to a light: the gradient is one-sided, differences are the mean of "
        "both "
        "sides\n");
  } else {
    fmt::print("  CANNOT TELL: an error of {} of all terms' magnitudes could have hidden: {}\n",
               percent(r.within), advice(r, seconds));
  }
}

// Less is not printed: it would read "1 times".
constexpr double kToldWidening = 1.05;

// "errors of 9 of 64 windows for rare events, up to 3.2 times; of the sum 1.4 times"
std::string widened_text(const CheckResult& r) {
  const auto times = [](double factor) {
    return std::isfinite(factor) ? fmt::format("{:.2g} times", factor) : "from 0";
  };
  return fmt::format("errors of {} of {} windows for rare events, up to {}; of the sum {}",
                     r.widened.windows, r.windows.count, times(r.widened.most),
                     times(r.widened.total));
}

void print_check(const std::string& name, const CheckResult& r, double seconds) {
  std::string samples;
  for (const TermRun& term : r.gradient.terms) {
    samples += fmt::format("{}{} {:.3g}", samples.empty() ? "" : ", ", term.name, term.samples);
  }
  fmt::print("{}: {} samples per pixel", name, r.spp);
  if (r.difference_spp != r.spp) fmt::print(" ({} of differences)", r.difference_spp);
  fmt::print(", {} windows of {} pixels, step {:.3g}\n", r.windows.count, r.block, r.step);
  fmt::print("  samples per spp    {}\n", samples);
  fmt::print("  gradient           {:.6g} +- {:.2g} (sum over the image)\n", r.total.gradient,
             r.total.gradient_error);
  fmt::print("  differences        {:.6g} +- {:.2g}, z = {:.2f}\n", r.total.difference,
             r.total.difference_error, r.total.z);
  fmt::print("  z of windows       mean {:.2f}, deviation {:.2f}, largest {:.2f}\n", r.windows.mean,
             r.windows.deviation, r.windows.largest);
  if (std::max(r.widened.most, r.widened.total) >= kToldWidening) {
    fmt::print("  widened            {}\n", widened_text(r));
  }
  fmt::print("  p                  {:.2g} (windows, image and terms together), smallest for {}\n",
             r.p, r.found);
  if (r.confirmation) {
    fmt::print("  second run there   p = {2:.2g} ({0} samples per pixel, step {1:.3g})\n",
               r.confirmation->spp, r.confirmation->step, r.confirmation->p);
  }
  fmt::print("  detectable error   {} (95 % power)\n", power_text(r));
  print_verdict(r, seconds);
}

json figures_json(const std::string& name, const CheckResult& r) {
  json samples = json::object(), visible = json::object(), shares = json::object();
  for (const TermRun& term : r.gradient.terms) samples[term.name] = term.samples;
  for (const CheckPower& power : r.power) {
    const std::string of = power.term.empty() ? "total" : power.term;
    visible[of] = number(power.visible);
    shares[of] = power.share;
  }
  json report = {{"parameter", name},
                 {"method", r.gradient.method},
                 {"step", r.step},
                 {"spp", r.spp},
                 {"difference_spp", r.difference_spp},
                 {"samples", samples},
                 {"verdict", verdict_name(r.verdict)},
                 {"level", kCheckLevel},
                 {"p", r.p},
                 {"smallest_at", r.found},
                 {"visible", visible},
                 {"shares", shares},
                 {"within", number(r.within)},
                 {"needed_spp", number(r.needed_spp)},
                 {"bends", r.bends},
                 {"gradient_sum", r.total.gradient},
                 {"gradient_sum_stderr", r.total.gradient_error},
                 {"difference_sum", r.total.difference},
                 {"difference_sum_stderr", r.total.difference_error},
                 {"z_sum", r.total.z},
                 {"widened",
                  {{"windows", r.widened.windows},
                   {"most", number(r.widened.most)},
                   {"sum", number(r.widened.total)}}},
                 {"windows",
                  {{"count", r.windows.count},
                   {"mean", r.windows.mean},
                   {"deviation", r.windows.deviation},
                   {"largest", r.windows.largest}}}};
  if (r.confirmation) {
    report["second_run"] = {
        {"spp", r.confirmation->spp}, {"step", r.confirmation->step}, {"p", r.confirmation->p}};
  }
  if (r.verdict == Verdict::kDisagree) report["suspects"] = r.suspects;
  return report;
}

class CheckCommand final : public Command {
 public:
  const char* name() const override { return "check"; }
  const char* description() const override { return "Compare a gradient with finite differences"; }

  void add_options(CLI::App& app) override {
    app_ = &app;
    add_common_options(app, common_);
    add_what_option(app, common_);
    add_parameter_options(app, parameters_);
    visit_options(options_, OptionAdder(app));
    add_samples_option(app, samples_);
    add_time_option(app, common_);
    app.add_flag("--reverse", reverse_,
                 "Compare reverse mode with forward mode instead, by the sum over pixels of the "
                 "derivative times a random image. An array parameter moves along a random "
                 "direction. --method is then one of backward (default: adaptive)")
        ->excludes("--time");
    app.add_flag("--same-paths", same_paths_,
                 "Compare with differences along the same paths instead, up to depth 8, without "
                 "noise: finds errors of a thousandth in the derivatives of values, texels and "
                 "lights. Refuses parameters that move edges or paths")
        ->excludes("--time")
        ->excludes("--reverse");
  }

  int run(const std::string&) override {
    const Scene scene = load_scene(common_, warnings_);
    check_outputs({{"--json", common_.json}}, scene, field_files(parameters_));
    check_warp(options_.warp, {reverse_ ? reverse_method() : options_.method});
    check_blur(options_.blur, {reverse_ ? reverse_method() : options_.method});
    refuse_samples(*app_, options_.points, {"--spp", "--time", "--samples", "--reverse"}, options_);
    if (options_.points == FilmPoints::kFaces) return run_faces(scene);
    if (reverse_) return run_reverse(scene);
    if (same_paths_) return run_paths(scene);
    options_.samples = parse_samples(samples_);
    for (const auto& parameter : parameters_) find_parameter(scene, parameter);
    return check_each(scene, [&](const RunSettings& settings) -> std::optional<Checked> {
      if (settings.spp < 2) {
        throw InputError("check needs --spp of at least 2, for standard errors");
      }
      const CheckResult r = check(scene, options_, settings);
      if (r.interrupted) return std::nullopt;
      warnings_.add_all(r.gradient.warnings);
      print_check(options_.parameter, r, settings.seconds);
      NonFinite bad = r.gradient.non_finite;
      bad.merge(r.differences.non_finite);
      return Checked{figures_json(options_.parameter, r), r.verdict, bad};
    });
  }

 private:
  static int no_verdict() {
    fmt::print(stderr, "interrupted: no verdict\n");
    return kInterrupted;
  }

  struct Checked {
    json figures;
    Verdict verdict;
    NonFinite bad;
  };
  // one: of options_.parameter; nothing if interrupted.
  int check_each(const Scene& scene,
                 const std::function<std::optional<Checked>(const RunSettings&)>& one) {
    json report = json::array();
    int status = kSuccess;
    for (const auto& parameter : parameters_) {
      options_.parameter = parameter;
      const auto checked = one(make_settings(common_, scene, "check " + parameter));
      if (!checked) return no_verdict();
      report.push_back(checked->figures);
      report.back()["sensor"] = sensor_name(scene);
      report.back()["warnings"] = warnings_.lines();
      // What is wrong comes before what is not known.
      const Verdict verdict = checked->verdict;
      if (verdict == Verdict::kDisagree) status = kDisagree;
      const bool open = verdict == Verdict::kCannotTell || verdict == Verdict::kNotComplete;
      if (open && status == kSuccess) status = kCannotTell;
      if (const int s = finish_status(checked->bad, 1, 1, "")) status = s;
    }
    write_json(common_.json, report.dump(2));
    return status;
  }

  // What checks without noise say.
  template <class Check>
  json sums_json(const Check& r, Verdict verdict) const {
    return {{"parameter", options_.parameter},    {"step", r.step},
            {"verdict", verdict_name(verdict)},   {"gradient_sum", r.gradient_sum},
            {"difference_sum", r.difference_sum}, {"error", r.error}};
  }

  int run_faces(const Scene& scene) {
    return check_each(scene, [&](const RunSettings& settings) -> std::optional<Checked> {
      const FacesCheck r = check_faces(scene, options_, settings);
      if (r.interrupted) return std::nullopt;
      warnings_.add_all(r.gradient.warnings);
      fmt::print(
          "{}: sum over the image: gradient {:.8g}, differences {:.8g} (step {:.3g})\n"
          "  they differ by {:.2g} of the derivative, of which differences know all but {:.2g}: "
          "{}\n",
          options_.parameter, r.gradient_sum, r.difference_sum, r.step, r.error, r.known,
          verdict_name(r.verdict));
      json figures = sums_json(r, r.verdict);
      figures["method"] = r.gradient.method;
      figures["points"] = name_of(options_.points);
      figures["known"] = number(r.known);
      return Checked{figures, r.verdict, r.non_finite};
    });
  }

  int run_paths(const Scene& scene) {
    refuse_options(*app_, {"--method", "--terms", "--samples", "--block", "--points"},
                   "not with --same-paths, which has paths of its own");
    for (const auto& parameter : parameters_) refuse_moved_paths(scene, parameter);
    return check_each(scene, [&](const RunSettings& settings) -> std::optional<Checked> {
      const PathsCheck r = check_paths(scene, options_.parameter, options_.step, settings);
      if (r.interrupted) return std::nullopt;
      const Verdict verdict = r.agrees() ? Verdict::kAgree : Verdict::kDisagree;
      fmt::print(
          "{}: sum over the image: gradient {:.8g}, differences along the same paths {:.8g} (step "
          "{:.3g})\n  pixels differ by {:.2g} of the derivative: {}\n",
          options_.parameter, r.gradient_sum, r.difference_sum, r.step, r.error,
          r.is_zero() ? "agree: both are zero" : verdict_name(verdict));
      return Checked{sums_json(r, verdict), verdict, r.non_finite};
    });
  }

  // The one requested, else the default of reverse mode.
  Method reverse_method() const {
    return app_->count("--method") > 0 ? options_.method : Method(Task::kBackward);
  }

  int run_reverse(const Scene& scene) {
    BackwardOptions options;
    options.parameters = parameters_;
    options.terms = options_.terms;
    options.method = reverse_method();
    const RunSettings settings = make_settings(common_, scene, "check --reverse");
    const std::vector<ReverseCheck> checks = check_reverse(scene, options, settings);
    if (checks.empty()) return no_verdict();
    json report = json::array();
    bool agree = true;
    for (const ReverseCheck& c : checks) {
      // Of all parameters together (Bonferroni).
      const double p = std::min(1.0, std::erfc(std::fabs(c.z) / std::sqrt(2.0)) * checks.size());
      fmt::print("{}: forward {:.6g} +- {:.2g}, reverse {:.6g} +- {:.2g}, z = {:.2f}{}\n",
                 c.parameter, c.forward, c.forward_error, c.reverse, c.reverse_error, c.z,
                 p < kCheckLevel ? ": DISAGREE" : "");
      agree = agree && p >= kCheckLevel;
      report.push_back({{"parameter", c.parameter},
                        {"sensor", sensor_name(scene)},
                        {"forward", c.forward},
                        {"forward_stderr", number(c.forward_error)},
                        {"reverse", c.reverse},
                        {"reverse_stderr", number(c.reverse_error)},
                        {"z", number(c.z)},
                        {"p", p},
                        {"verdict", p < kCheckLevel ? "disagree" : "agree"}});
    }
    write_json(common_.json, report.dump(2));
    return agree ? kSuccess : kDisagree;
  }

  CommonOptions common_;
  Warnings warnings_;
  CLI::App* app_ = nullptr;
  CheckOptions options_;
  bool reverse_ = false, same_paths_ = false;
  std::vector<std::string> parameters_;
  std::string samples_ = "auto";
};

}  // namespace

std::unique_ptr<Command> make_check_command() { return std::make_unique<CheckCommand>(); }

}  // namespace limn
