// `limn fit`: parameters of a scene, vertices included, from target images.
#include "limn/integrators/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "limn/core/coverage.h"
#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/backward.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/fit_folder.h"
#include "tools/limn/output_files.h"
#include "tools/limn/terminal.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

constexpr int kPictureSamples = 32;  // of a snapshot's pictures; not tuned

// All else is in the folder.
constexpr const char* kBesideResume[] = {"--resume", "--steps", "--threads", "--quiet",
                                         "--no-report"};

std::string absolute(const std::string& file) {
  return file.empty() ? file : fs::absolute(file).lexically_normal().string();
}

// A field ("SHAPE.vertex_positions:FILE") with an absolute FILE that reaches to `end`; other names
// as they are.
std::string with_absolute_field(const std::string& text, size_t end) {
  const size_t colon = text.find(':');
  if (colon >= end) return text;
  return text.substr(0, colon + 1) + absolute(text.substr(colon + 1, end - colon - 1)) +
         text.substr(end);
}

// InputError for a mesh that nothing has a distance to.
void check_truth(const std::string& file) {
  const Mesh mesh = read_mesh(file, true);
  const auto has = [&](const FaceIndices& face) { return has_area(mesh, face); };
  if (std::any_of(mesh.faces.begin(), mesh.faces.end(), has)) return;
  throw InputError({file}, "has no face with an area");
}

class FitCommand final : public Command {
 public:
  const char* name() const override { return "fit"; }
  const char* description() const override {
    return "Optimise parameters, vertices included, towards target images";
  }
  void add_options(CLI::App& app) override;
  int run(const std::string&) override;

 private:
  std::vector<ViewArguments> view_arguments() const;
  std::vector<ViewArguments> with_targets(const std::vector<ViewArguments>& views) const;
  FitArguments arguments() const;
  std::vector<FitView> read_views(const FitArguments& arguments);
  void check_resume() const;
  FitFolder open_folder();
  void warn_of_steps(const FitArguments& arguments);
  int loop(Fit& fit, FitFolder& folder, const RunSettings& settings);
  void tell(const FitRecord& record) const;

  CommonOptions common_;
  Warnings warnings_;
  const CLI::App* app_ = nullptr;
  CLI::Option* steps_option_ = nullptr;
  std::vector<std::string> targets_, masks_, alphas_, views_;
  FitArguments given_;
  std::string output_, resume_, truth_;
  bool no_report_ = false;
};

void FitCommand::add_options(CLI::App& app) {
  app_ = &app;
  add_common_options(app, common_);
  app.get_option("scene")->required(false);
  app.remove_option(app.get_option("--json"));
  app.remove_option(app.get_option("--sensor"));
  app.add_option(
         "--target", targets_,
         "Target image (.exr), one for each sensor of the scene, then of each --view (repeatable)")
      ->type_name("EXR")
      ->allow_extra_args(false);
  app.add_option("--mask", masks_,
                 "Image of weights of a target's pixels (.exr), one for each target in turn; \"-\" "
                 "for none (repeatable)")
      ->type_name("EXR")
      ->allow_extra_args(false);
  app.add_option(
         "--alpha", alphas_,
         "Mask (.exr, .png, .jpg) for the coverage of a view, one for each --target in turn; "
         "\"-\" for none. With --target - the view has a mask alone (repeatable)")
      ->type_name("IMAGE")
      ->allow_extra_args(false);
  app.add_option("--view", views_, "Further scene that shares the parameters (repeatable)")
      ->type_name("SCENE[;NAME=VALUE...]")
      ->allow_extra_args(false);
  app.add_option("--wrt", given_.options.parameters,
                 "Parameter to optimise: a scalar, SHAPE.vertex_positions, SHAPE.displacement "
                 "(along normals) or the texels EMITTER.data (repeatable)")
      ->type_name("PARAM")
      ->allow_extra_args(false);
  app.add_option("--bounds", given_.bounds, "Bounds of a scalar or of texels (repeatable)")
      ->type_name("PARAM=LEAST,MOST")
      ->allow_extra_args(false);
  steps_option_ = app.add_option("--steps", given_.steps, "Total number of steps")
                      ->check(within(int64_t{1}, int64_t{1} << 40));
  visit_options(given_.options, OptionAdder(app));
  app.add_option(
         "--snapshots", given_.snapshots,
         "Steps between snapshots of meshes, images and state (default: ten snapshots in all)")
      ->check(within(1, 1 << 30));
  app.add_option("--truth", truth_, "True mesh (.obj, .ply); distances to it are reported")
      ->type_name("MESH");
  app.add_option("-o,--output", output_, "Folder for the results (created if missing)")
      ->type_name("FOLDER");
  app.add_option("--resume", resume_,
                 "Continue the fit in this folder with the same results as one run. Allows only "
                 "--steps, --threads, --quiet and --no-report")
      ->type_name("FOLDER");
  app.add_flag("--no-report", no_report_, "Write no report.html");
}

// The scene and those of --view, each with all its sensors, in turn: a target for each.
std::vector<ViewArguments> FitCommand::view_arguments() const {
  std::vector<ViewArguments> scenes{
      {absolute(common_.scene), common_.defines, "", "", "", false, {}}};
  for (const std::string& text : views_) {
    ViewArguments view;
    std::stringstream stream(text);
    std::getline(stream, view.scene, ';');
    view.scene = absolute(view.scene);
    for (std::string define; std::getline(stream, define, ';');) {
      const size_t equals = define.find('=');
      if (equals == define.npos || equals == 0) {
        throw InputError("--view " + text + ": expected SCENE;NAME=VALUE;...");
      }
      view.defines[define.substr(0, equals)] = define.substr(equals + 1);
    }
    scenes.push_back(view);
  }
  std::vector<ViewArguments> views;
  for (const ViewArguments& scene : scenes) {
    const size_t sensors = count_sensors(scene.scene, scene.defines, common_.paths);
    for (size_t i = 0; i < sensors; ++i) {
      views.push_back(scene);
      views.back().sensor = std::to_string(i);
    }
  }
  if (targets_.size() != views.size()) {
    throw InputError(fmt::format(
        "{} --target for {} views: each sensor of the scene needs one, then each of --view in turn",
        targets_.size(), views.size()));
  }
  if (masks_.size() > targets_.size()) throw InputError("there are more --mask than --target");
  if (alphas_.size() > targets_.size()) throw InputError("there are more --alpha than --target");
  return with_targets(views);
}

// A view for each target, and for each --alpha behind it.
std::vector<ViewArguments> FitCommand::with_targets(const std::vector<ViewArguments>& views) const {
  std::vector<ViewArguments> all;
  const auto given = [](const std::vector<std::string>& list, size_t v) {
    return v < list.size() && list[v] != "-" ? absolute(list[v]) : "";
  };
  for (size_t v = 0; v < views.size(); ++v) {
    const size_t before = all.size();
    ViewArguments view = views[v];
    view.mask = given(masks_, v);
    view.target = given(targets_, v);
    if (!view.target.empty()) all.push_back(view);
    view.target = given(alphas_, v);
    view.alpha = true;
    view.mask.clear();
    if (!view.target.empty()) all.push_back(view);
    if (all.size() == before) throw InputError("--target - needs an --alpha of this view");
  }
  return all;
}

FitArguments FitCommand::arguments() const {
  const auto need = [](bool there, const char* what) {
    if (!there) throw InputError(std::string("give ") + what);
  };
  need(!common_.scene.empty(), "a scene, or --resume FOLDER");
  need(!given_.options.parameters.empty(), "--wrt");
  need(steps_option_->count() > 0, "--steps");
  need(!output_.empty(), "-o FOLDER");
  FitArguments a = given_;
  a.shading = common_.shading;
  a.truth = absolute(truth_);
  for (std::string& name : a.options.parameters) name = with_absolute_field(name, name.size());
  for (std::string& text : a.bounds) {
    text = with_absolute_field(text, std::min(text.size(), text.rfind('=')));
  }
  a.views = view_arguments();
  if (!alphas_.empty() && !suits_coverage(a.options.loss)) {
    throw InputError("--alpha: coverage is not radiance: --loss l2 or l1");
  }
  refuse_samples(*app_, a.options.backward.points, {"--spp"}, a.options);
  if (a.options.optimiser == OptimiserKind::kLbfgs) {
    if (app_->get_option("--pixels")->count() > 0 && !a.options.backward.uniform_pixels) {
      throw InputError("--pixels adjoint: lbfgs takes the same samples in all pixels, --pixels " +
                       std::string(kPixels[1]));
    }
    a.options.backward.uniform_pixels = true;
  }
  if (a.snapshots == 0) a.snapshots = static_cast<int>(std::max<int64_t>(1, a.steps / 10));
  return a;
}

std::vector<FitView> FitCommand::read_views(const FitArguments& arguments) {
  std::vector<FitView> views;
  Scene scene;
  for (size_t v = 0; v < arguments.views.size(); ++v) {
    const ViewArguments& view = arguments.views[v];
    const auto same_scene = [&](const ViewArguments& other) {
      return other.scene == view.scene && other.defines == view.defines;
    };
    FitView read;
    if (v > 0 && same_scene(arguments.views[v - 1])) {  // by another of its sensors
      use_sensor(scene, view.sensor);
    } else {
      CommonOptions common;
      common.scene = view.scene;
      common.defines = view.defines;
      common.sensor = view.sensor;
      common.shading = arguments.shading;
      scene = load_scene(common, warnings_);
    }
    read.scene = view.alpha ? coverage_of(scene) : deep_copy(scene);
    read.target = view.alpha ? read_coverage(view.target) : read_image(view.target);
    if (!view.mask.empty()) read.mask = read_image(view.mask);
    check_loss_images(read.scene, read.target, read.mask, view.target, view.mask);
    views.push_back(std::move(read));
  }
  return views;
}

void FitCommand::check_resume() const {
  std::vector<std::string> other;
  for (const CLI::Option* option : app_->get_options()) {
    const auto is = [&](const char* name) { return option->get_name() == name; };
    if (option->count() == 0) continue;
    if (std::any_of(std::begin(kBesideResume), std::end(kBesideResume), is)) continue;
    other.push_back(option->get_name());
  }
  if (other.empty()) return;
  throw InputError("--resume goes on with what its folder says: leave out " + limn::join(other));
}

void FitCommand::warn_of_steps(const FitArguments& arguments) {
  for (const int64_t step : arguments.options.remesh) {
    if (step <= arguments.steps) continue;
    warnings_.add_all(
        {fmt::format("--remesh {}: the fit ends before, after {} steps", step, arguments.steps)});
  }
  const int blurred = arguments.options.blur_steps;
  if (blurred > 0 && blurred >= arguments.steps) {
    warnings_.add_all({fmt::format(
        "--blur-steps {}: the fit ends after {} steps, before its first with exact derivatives",
        blurred, arguments.steps)});
  }
}

FitFolder FitCommand::open_folder() {
  if (resume_.empty()) return {output_, arguments()};
  check_resume();
  FitFolder folder = FitFolder::read(resume_);
  if (steps_option_->count() > 0) folder.set_steps(given_.steps);
  return folder;
}

int FitCommand::run(const std::string&) {
  FitFolder folder = open_folder();
  std::vector<FitView> views = read_views(folder.arguments());
  RunSettings settings = make_settings(common_, views[0].scene, name());
  const FolderLock lock(folder.name());
  if (resume_.empty()) {
    folder.set_samples(settings.spp, settings.seed);
    folder.prepare(views);
  } else {
    folder.check_inputs(views);
  }
  settings.spp = folder.arguments().spp;
  settings.seed = folder.arguments().seed;
  // A wrong file is reported before hours of work.
  if (!folder.arguments().truth.empty()) check_truth(folder.arguments().truth);
  const Fit* running = nullptr;
  int64_t started = 0;
  if (const auto bar = settings.progress) {
    settings.progress = [&, bar](double done) {
      const auto all = static_cast<double>(folder.arguments().steps - started);
      bar((static_cast<double>(running->steps() - started) + done) / all);
    };
  }
  Fit fit(std::move(views), folder.arguments().all_options(), settings);
  running = &fit;
  warnings_.add_all(fit.warnings());
  warn_of_steps(folder.arguments());
  if (!resume_.empty()) folder.restore(fit);
  started = fit.steps();
  const int status = loop(fit, folder, settings);
  if (!no_report_) write_report(folder.name(), common_.quiet);
  return status;
}

int FitCommand::loop(Fit& fit, FitFolder& folder, const RunSettings& settings) {
  const FitArguments& a = folder.arguments();
  if (fit.steps() == 0) folder.add_snapshot(fit, settings, kPictureSamples, common_.quiet);
  if (folder.at_rest(fit)) {
    fmt::print(stderr, "the fit has converged: no step is left to take\n");
  } else if (fit.steps() >= a.steps) {
    fmt::print(stderr, "{} steps are done, and --steps asks for {}: give more to go on\n",
               fit.steps(), a.steps);
  }
  while (fit.steps() < a.steps && !folder.at_rest(fit)) {
    std::optional<FitRecord> record;
    try {
      record = fit.step();
    } catch (const InputError&) {
      // Before the first step there is nothing to go on with, and the folder stays free.
      if (fit.steps() > 0) folder.write(fit, "failed", warnings_.lines());
      throw;
    }
    if (!record) {
      folder.add_snapshot(fit, settings, 0, common_.quiet);
      folder.write(fit, "interrupted", warnings_.lines());
      clear_progress();
      fmt::print(stderr, "interrupted: {} of {} steps are done; limn fit --resume {} goes on\n",
                 fit.steps(), a.steps, folder.name());
      return kInterrupted;
    }
    folder.add(*record, fit);
    tell(*record);
    const bool last = fit.steps() >= a.steps || folder.at_rest(fit);
    if (!last && fit.steps() % a.snapshots != 0) continue;
    folder.add_snapshot(fit, settings, kPictureSamples, common_.quiet);
    folder.write(fit, last ? "done" : "running", warnings_.lines());
  }
  return kSuccess;
}

void FitCommand::tell(const FitRecord& record) const {
  if (common_.quiet) return;
  if (record.at_rest || record.halvings > 0 || record.remeshed) clear_progress();
  if (record.at_rest) {
    fmt::print("step {}: converged, no lower loss was found along the gradient\n", record.step);
  }
  if (record.halvings > 0) {
    fmt::print(stderr, "step {}: halved {} times, so that no face loses its area\n", record.step,
               record.halvings);
  }
  if (record.remeshed) fmt::print("step {}: remeshed\n", record.step + 1);
}

}  // namespace

std::unique_ptr<Command> make_fit_command() { return std::make_unique<FitCommand>(); }

}  // namespace limn
