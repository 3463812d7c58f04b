// `limn compare`: derivative images of several methods at equal time, with a report.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"
#include "limn/core/parameter.h"
#include "limn/integrators/compare.h"
#include "limn/integrators/methods.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/compare_output.h"
#include "tools/limn/output_files.h"
#include "tools/mitsuba/mitsuba_method.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

constexpr int kImageSamples = 256;  // of the plain rendering, at most

struct CompareArguments {
  std::string parameter;
  std::vector<std::string> methods;
  double time = 0;  // seconds of a run, the longest budget
  int budgets = 1;  // each half of the next
  int repeats = 4;
  std::string reference;         // "": made
  double reference_time = 0;     // 0: four times all runs of one method
  GradientOptions gradient;      // but for parameter and method
  std::string samples = "auto";  // of each term
  std::string output;
  bool report = true;
  bool images = false;  // not derivatives
  RenderOptions render;
};

// The methods of limn among these, or those of Mitsuba, which live outside.
std::vector<std::string> own_names(const std::vector<std::string>& names) {
  std::vector<std::string> own;
  for (const std::string& name : names) {
    if (!is_mitsuba(name)) own.push_back(name);
  }
  return own;
}

void check_methods_of_images(const CLI::App& app, const CompareArguments& command) {
  std::vector<Method> methods = parse_methods(command.methods, Task::kImage);
  check_blur(command.render.blur, methods);
  methods.emplace_back("rays");  // makes the reference
  check_image_options(app, methods);
}

// Before any work.
std::vector<Method> check_methods(const std::vector<std::string>& names,
                                  const std::vector<std::string>& terms) {
  for (size_t i = 0; i < names.size(); ++i) {
    if (is_mitsuba(names[i]) && std::count(names.begin(), names.end(), names[i]) > 1) {
      throw InputError("--methods: \"" + names[i] + "\" is given twice");
    }
  }
  const std::vector<Method> own = parse_methods(own_names(names), Task::kGradient);
  if (terms.empty()) return own;
  const auto refuse = [](const std::string& name) {
    throw InputError("--terms: \"" + name +
                     "\" has all terms in one: leave it out of --methods, or leave out --terms");
  };
  for (const std::string& name : names) {
    if (is_mitsuba(name)) refuse(name);
  }
  for (const Method& method : own) {
    if (!method->terms_can_be_left_out) refuse(method.name());
  }
  return own;
}

void make_folder(const std::string& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) throw InputError({folder}, "cannot make this folder: " + failed.message());
  check_output((fs::path(folder) / "reference.exr").string());
}

CompareOptions make_options(const CompareArguments& command) {
  CompareOptions options;
  options.repeats = command.repeats;
  for (int budget = command.budgets; budget-- > 0;) {
    options.times.push_back(std::ldexp(command.time, -budget));
  }
  return options;
}

// Shares the progress bar among jobs in proportion to their seconds.
class Stages {
 public:
  Stages(const RunSettings& settings, double total) : settings_(settings), total_(total) {}

  // Settings of the next job.
  RunSettings next(double seconds) {
    RunSettings stage = settings_;
    stage.seconds = seconds;
    const double from = done_ / total_;
    const double share = seconds / total_;
    done_ += seconds;
    if (settings_.progress) {
      // The bar ends its line at 1, which is for the end of all stages.
      stage.progress = [this, from, share](double done) {
        settings_.progress(std::min(from + share * done, 0.9999));
      };
    }
    return stage;
  }
  // Ends the bar's line.
  void finish() const {
    if (!settings_.progress) return;
    if (settings_.interrupted->load()) {
      fmt::print(stderr, "\n");
    } else {
      settings_.progress(1);
    }
  }

 private:
  const RunSettings& settings_;
  double total_;
  double done_ = 0;
};

// A whole comparison, step by step.
class Comparer {
 public:
  Comparer(const CommonOptions& common, const CompareArguments& command, const Scene& scene,
           const RunSettings& settings, const std::string& command_line)
      : common_(common),
        command_(command),
        scene_(scene),
        settings_(settings),
        input_{scene,
               command.images ? "image" : command.parameter,
               command.images ? std::vector{what()} : command.gradient.terms,
               command.gradient.step,
               block_size(scene.film),
               parse_samples(command.samples),
               command.gradient.warp,
               command.gradient.blur},
        identity_(identify(input_, common.defines)),
        kept_file_((fs::path(command.output) / "reference.exr").string()) {
    result_.command = command_line;
    result_.defines = common.defines;
    result_.parameter = input_.parameter;
    if (command.images) {
      result_.what = what();
    } else {
      result_.unit = find_parameter(scene, command.parameter).unit;
    }
    result_.terms = input_.terms.empty() ? "all" : fmt::format("{}", fmt::join(input_.terms, ","));
    result_.seed = settings.seed;
    result_.threads = settings.threads;
    result_.options = make_options(command);
    double runs = 0;
    for (const double time : result_.options.times) runs += time * command.repeats;
    reference_seconds_ = command.reference_time > 0 ? command.reference_time : 4 * runs;
    methods_seconds_ = runs * static_cast<double>(command.methods.size());
    for (const std::string& name : command.methods) methods_.push_back(method_of(name));
    take_reference();
  }
  Comparer(const Comparer&) = delete;
  Comparer& operator=(const Comparer&) = delete;

  // False if interrupted before there is something to write.
  bool run() {
    const bool made = result_.reference.spp == 0;
    const double image_seconds = command_.images ? 0 : command_.time;
    Stages stages(settings_, image_seconds + methods_seconds_ + (made ? reference_seconds_ : 0));
    if (!command_.images) {
      RunSettings image = stages.next(image_seconds);
      image.spp = kImageSamples;
      result_.image = render(scene_, image);
    }
    const bool ready = !made || make_reference_file(stages.next(reference_seconds_));
    if (ready) {
      result_.methods =
          compare(result_.options, result_.reference, methods_, stages.next(methods_seconds_));
    }
    stages.finish();
    return ready;
  }

  void write(const std::vector<std::string>& warnings) {
    result_.warnings = warnings;
    write_comparison(command_.output, scene_, result_);
  }

  const Comparison& result() const { return result_; }
  std::vector<std::string> warnings() const {
    std::vector<std::string> all;
    for (const ComparedMethod& m : result_.methods) {
      for (const std::string& warning : m.warnings) all.push_back(m.name + ": " + warning);
    }
    return all;
  }

  NonFinite non_finite() const {
    NonFinite all = result_.image.non_finite;
    all.merge(non_finite_of(result_.reference, result_.methods));
    return all;
  }

 private:
  std::string what() const { return kRenderWhat[static_cast<int>(command_.render.what)]; }

  std::unique_ptr<TimedMethod> method_of(const std::string& name) const {
    if (command_.images) {
      return make_image_method(scene_, command_.render, name, input_.block, settings_);
    }
    if (is_mitsuba(name)) {
      return make_mitsuba_method(name, input_, common_.defines, command_.output);
    }
    return make_method(input_, name);
  }

  // Reads the reference, if there is one to read.
  void take_reference() {
    const Film& film = scene_.film;
    if (!command_.reference.empty()) {
      result_.reference_file = command_.reference;
      result_.reference = read_reference(command_.reference, identity_, film);
      // The folder holds all that its report shows.
      if (!fs::exists(kept_file_) || !fs::equivalent(kept_file_, command_.reference)) {
        write_reference(kept_file_, result_.reference, identity_, film, input_.block);
      }
      return;
    }
    result_.reference_file = kept_file_;
    std::string why;
    if (auto kept = find_reference(kept_file_, identity_, film, reference_seconds_, why)) {
      result_.reference = std::move(*kept);
    } else if (!why.empty() && !common_.quiet) {
      fmt::print("{}\nmaking a new reference\n", why);
    }
  }

  bool make_reference_file(RunSettings settings) {
    settings.spp = 1 << 30;
    settings.seed = derived_seed(settings_.seed, "reference");
    result_.reference = command_.images
                            ? make_image_reference(scene_, command_.render, input_.block, settings,
                                                   result_.not_by_rays)
                            : make_reference(input_, settings);
    if (result_.reference.spp < 2) return false;
    write_reference(kept_file_, result_.reference, identity_, scene_.film, input_.block);
    return true;
  }

  const CommonOptions& common_;
  const CompareArguments& command_;
  const Scene& scene_;
  const RunSettings& settings_;
  MethodInput input_;
  Identity identity_;
  std::string kept_file_;  // the reference's place in the folder
  double reference_seconds_ = 0, methods_seconds_ = 0;
  std::vector<std::unique_ptr<TimedMethod>> methods_;
  Comparison result_;
};

class CompareCommand final : public Command {
 public:
  const char* name() const override { return "compare"; }
  const char* description() const override {
    return "Compare methods at equal time, and write a report";
  }
  void add_options(CLI::App& app) override;
  int run(const std::string& command_line) override;

 private:
  void check_images();
  std::vector<Method> check_derivatives() const;

  CommonOptions common_;
  CompareArguments command_;
  CLI::App* app_ = nullptr;
};

void CompareCommand::add_options(CLI::App& app) {
  app_ = &app;
  add_common_options(app, common_);
  app.remove_option(app.get_option("--sensor"));  // Mitsuba's methods take the first
  auto* wrt =
      app.add_option("--wrt", command_.parameter, "Parameter to differentiate")->type_name("PARAM");
  app.add_flag("--image", command_.images,
               "Compare images instead of derivatives. The methods are then: " +
                   limn::join(method_names(Task::kImage)))
      ->excludes(wrt);
  const OptionAdder add(app);
  command_.render.generator = kGenerators[0];
  visit_options(command_.render, all_but({"method", "generator", "points", "sigma", "gamma"}, add));
  app.add_option("--methods", command_.methods,
                 "Methods to compare; ratios are relative to the first: " +
                     limn::join(method_names(Task::kGradient)) + ", " + kMitsuba + ", " +
                     kMitsubaAfterSetup +
                     " (the last two run Mitsuba 3 if it is installed); settings follow a colon, "
                     "as in forest:width=4 (limn methods --all)")
      ->delimiter(',')
      ->required()
      ->type_name("A,B,...");
  app.add_option("--time", command_.time, "Time budget of each run in seconds, set-up included")
      ->required()
      ->check(within(1e-6, 1e7))
      ->type_name("SECONDS");
  app.add_option("--sweep", command_.budgets,
                 "Measure error against time with N time budgets, each twice the one before, up to "
                 "--time (N is 5 if not given; without --sweep there is one budget)")
      ->expected(0, 1)
      ->default_str("5")
      ->check(within(1, 30))
      ->type_name("N");
  app.add_option("--repeats", command_.repeats,
                 "Runs of each method and time budget, from which error bars come")
      ->check(within(1, 1 << 20))
      ->capture_default_str();
  app.add_option("--reference", command_.reference,
                 "Reference that limn compare wrote for the same scene and task (default: the "
                 "one in the output folder, else a new one)")
      ->type_name("FILE.exr");
  app.add_option(
         "--reference-time", command_.reference_time,
         "Time budget of a new reference in seconds (default: four times all runs of one method)")
      ->check(within(1e-6, 1e7))
      ->type_name("SECONDS");
  visit_options(command_.gradient, all_but({"method", "points"}, add));
  add_samples_option(app, command_.samples);
  app.add_option("-o,--output", command_.output, "Folder for images, report and results")
      ->required()
      ->type_name("FOLDER");
  app.add_flag_callback(
      "--no-report", [this] { command_.report = false; },
      "Write no report.html (--image writes none)");
}

void CompareCommand::check_images() {
  refuse_options(*app_, {"--terms", "--samples", "--step", "--aux", "--kappa", "--no-report"},
                 "derivatives alone have that: not with --image");
  command_.render.blur = command_.gradient.blur;
  command_.report = false;
  check_methods_of_images(*app_, command_);
}

std::vector<Method> CompareCommand::check_derivatives() const {
  refuse_options(*app_, {"--what", "--lines", "--tolerance", "--rays"},
                 "images alone have that: only with --image");
  if (command_.parameter.empty()) {
    throw InputError("--wrt: say which parameter's derivatives to compare, or --image");
  }
  const std::vector<Method> methods = check_methods(command_.methods, command_.gradient.terms);
  check_warp(command_.gradient.warp, methods);
  check_blur(command_.gradient.blur, methods);
  return methods;
}

int CompareCommand::run(const std::string& command_line) {
  std::vector<Method> methods;
  if (command_.images) {
    check_images();
  } else {
    methods = check_derivatives();
  }
  if (common_.run.spp) {
    throw InputError("--spp: methods are compared at equal time: say how long with --time");
  }
  Warnings warnings;
  const Scene scene = load_scene(common_, warnings);
  if (!command_.images) {
    find_parameter(scene, command_.parameter);
  }
  make_folder(command_.output);
  check_outputs(
      {{"-o", (fs::path(command_.output) / "compare.json").string()}, {"--json", common_.json}},
      scene, field_files({command_.parameter}));
  const RunSettings settings = make_settings(common_, scene, name());
  Comparer comparer(common_, command_, scene, settings, command_line);
  if (!comparer.run()) {
    fmt::print(stderr, "interrupted before there was a reference: nothing is written\n");
    return kInterrupted;
  }
  warnings.add_all(comparer.warnings());
  comparer.write(warnings.lines());
  if (!common_.quiet) print_comparison(comparer.result());
  copy_json((fs::path(command_.output) / "compare.json").string(), common_.json);
  const NonFinite non_finite = comparer.non_finite();
  if (command_.report) write_report(command_.output, common_.quiet);
  if (non_finite.count > 0) return finish_status(non_finite, 0, 0, "");
  if (settings.interrupted->load()) {
    fmt::print(stderr, "interrupted: {} holds all runs that were finished\n", command_.output);
    return kInterrupted;
  }
  return kSuccess;
}

}  // namespace

std::unique_ptr<Command> make_compare_command() { return std::make_unique<CompareCommand>(); }

}  // namespace limn
