// `limn backward`: from a loss, or its derivative by pixels, to its derivative for every parameter.
#include "limn/integrators/backward.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "limn/core/coverage.h"
#include "limn/core/error.h"
#include "tools/limn/backward_output.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/output_files.h"
#include "tools/limn/run_part.h"
#include "tools/limn/run_stats.h"

namespace limn {
namespace {

using nlohmann::json;

class BackwardCommand final : public Command {
 public:
  const char* name() const override { return "backward"; }
  const char* description() const override {
    return "Compute the derivatives of a loss with respect to all parameters (reverse mode)";
  }

  void add_options(CLI::App& app) override {
    app_ = &app;
    add_common_options(app, common_);
    add_what_option(app, common_);
    auto* adjoint =
        app.add_option("--adjoint", adjoint_, "Image of dLoss/dpixel (.exr), in place of --target")
            ->type_name("FILE");
    auto* target = app.add_option("--target", target_, "Image with which the loss compares (.exr)")
                       ->type_name("FILE");
    adjoint->excludes(target);
    const OptionAdder add(app);
    visit_options(loss_, all_but({"method", "points"}, add));
    for (const char* name : {"--loss", "--pyramid"}) app.get_option(name)->needs(target);
    app.add_option("--wrt", options_.parameters,
                   "Parameter, a scalar or an array such as SHAPE.vertex_positions (repeatable; "
                   "default: all parameters except displacements)")
        ->type_name("PARAM")
        ->allow_extra_args(false);
    visit_options(options_, add);
    add_time_option(app, common_);
    app.add_flag("--loss-only", loss_only_,
                 "With --target: write only the loss and its derivative per pixel (an image for "
                 "--adjoint)")
        ->needs(target);
    app.add_option("-o,--output", output_, "Folder for the results (created if missing)")
        ->required()
        ->type_name("FOLDER");
    add_part_option(app, common_);
    app.get_option("--part")->excludes("--time");
    add_debug_option(app, debug_);
    app.get_option("--debug-sample")->excludes("--time");
    app.add_flag("--stats", stats_,
                 "Print statistics: edges, nodes, bytes, rays by kind, time by phase");
  }

  bool join(BatchStore& store) override {
    common_.run.store = &store;
    return true;
  }

  int run(const std::string& command_line) override {
    const Scene scene = load_scene(common_, warnings_);
    if (adjoint_.empty() && target_.empty()) throw InputError("give --adjoint or --target");
    // Reported before the loss is rendered.
    check_points(options_.points, options_.method->closed_light, options_.method.name());
    refuse_samples(*app_, options_.points, {"--spp", "--time", "--part"}, options_);
    if (!debug_.empty()) return trace(scene);
    if (!common_.part.empty()) return make_part(scene, command_line);
    files_ = plan_files(scene, options_.parameters, output_);
    if (target_.empty()) files_.adjoint = files_.adjoint_picture = "";
    std::filesystem::create_directories(output_);
    check_outputs(files_.planned(common_.json), scene, {adjoint_.empty() ? target_ : adjoint_});
    const RunSettings settings = settings_of(scene);
    const LossResult loss = loss_of(scene, settings);
    if (interrupted(settings) && !target_.empty()) return report_interrupted(scene, settings, loss);
    if (loss_only_) return write_loss_alone(scene, settings, loss);
    const BackwardResult result = backward(scene, loss.adjoint, options_, rest_of(settings));
    warnings_.add_all(result.warnings);
    if (result.spp == 0) return report_interrupted(scene, settings, loss);
    write(scene, settings, loss, result);
    // No other run has the batches of one in limited time.
    const std::string line = settings.seconds > 0 ? "" : command_line;
    if (!common_.quiet) print_largest(result.terms, result.spp, line, stats_);
    const bool all = settings.seconds > 0 && !interrupted(settings);
    return finish_status(result.non_finite, result.spp, all ? result.spp : settings.spp, line);
  }

 private:
  // A loss stays, and a run from its adjoint on needs no images.
  int report_interrupted(const Scene& scene, const RunSettings& settings,
                         const LossResult& loss) const {
    const bool kept = loss.spp > 0;
    if (kept) write_loss_alone(scene, settings, loss);
    fmt::print(stderr, "interrupted before the first batch was done: {}\n",
               kept ? "the loss alone is written; --adjoint " + files_.adjoint + " goes on from it"
                    : "nothing is written");
    return kInterrupted;
  }

  std::string loss_name() const { return word_of(loss_.kind, kLossOption); }
  bool over_faces() const { return options_.points == FilmPoints::kFaces; }
  std::string work_of(int64_t spp) const {
    return over_faces() ? "visible faces" : fmt::format("{} samples per pixel", spp);
  }

  static bool interrupted(const RunSettings& settings) { return settings.interrupted->load(); }

  int make_part(const Scene& scene, const std::string& command_line) {
    if (adjoint_.empty()) {
      throw InputError(
          "--part needs --adjoint, since every part would make the images of the loss again: "
          "limn backward ... --target T.exr --loss-only -o FOLDER writes FOLDER/adjoint.exr");
    }
    const Image adjoint = read_exr(adjoint_);
    return run_part(common_, scene, {adjoint_}, {name(), words, command_line}, output_,
                    [&](const RunSettings& part) {
                      const BackwardResult result = backward(scene, adjoint, options_, part);
                      warnings_.add_all(result.warnings);
                      return result.non_finite;
                    });
  }

  int trace(const Scene& scene) {
    const RunSettings settings = settings_of(scene);
    const LossResult loss = loss_of(scene, settings);
    const auto place = parse_place(debug_);
    for (const auto& line : trace_backward(scene, loss.adjoint, options_, settings, place)) {
      fmt::print("{}\n", line);
    }
    return kSuccess;
  }

  RunSettings settings_of(const Scene& scene) const {
    return settings_for(options_.points, make_settings(common_, scene, name()));
  }
  // Of the time what the loss has left.
  RunSettings rest_of(RunSettings settings) const {
    const double all = settings.seconds;
    if (all > 0) settings.seconds = std::max(1e-3, all - watch_.seconds());
    return settings;
  }

  LossResult loss_of(const Scene& scene, RunSettings settings) {
    LossResult loss;
    if (target_.empty()) {
      loss.adjoint = read_exr(adjoint_);
      return loss;
    }
    settings.seconds *= kImageShare;
    const bool alpha = common_.what == "alpha";
    if (alpha && !suits_coverage(loss_.kind)) {
      throw InputError("--what alpha: coverage is not radiance: --loss l2 or l1");
    }
    const Image target = alpha ? read_coverage(target_) : read_image(target_);
    check_loss_images(scene, target, {}, target_);
    loss_.method = loss_method(options_.method);
    loss_.points = options_.points;
    loss = image_loss(scene, target, loss_, settings);
    if (!is_unbiased(loss_.kind) && !over_faces()) warnings_.add_all({bias_warning(loss_.kind)});
    if (loss.spp == 0 || !debug_.empty()) return loss;
    auto attributes = provenance(scene, settings, loss.spp);
    attributes.push_back({"limn.loss", loss_name()});
    attributes.push_back({"limn.target", target_});
    attributes.push_back({"limn.pyramid", std::to_string(loss_.levels)});
    write_exr(files_.adjoint, loss.adjoint, false, attributes);
    write_signed_png(files_.adjoint_picture, loss.adjoint, signed_scale(loss.adjoint));
    return loss;
  }

  json loss_json(const LossResult& loss) const {
    return {{"kind", loss_name()},
            {"pyramid", loss_.levels},
            {"target", target_},
            {"value", loss.value},
            {"stderr", std::isfinite(loss.error) ? json(loss.error) : json(nullptr)},
            {"adjoint", files_.adjoint}};
  }
  void print_loss(const LossResult& loss) const {
    if (common_.quiet) return;
    fmt::print("loss ({})  {}\n", loss_name(), with_error(loss.value, loss.error));
  }

  int write_loss_alone(const Scene& scene, const RunSettings& settings,
                       const LossResult& loss) const {
    print_loss(loss);
    const json report = {{"scene", scene.file},     {"sensor", sensor_name(scene)},
                         {"spp", loss.spp},         {"seed", settings.seed},
                         {"loss", loss_json(loss)}, {"warnings", warnings_.lines()}};
    write_json(common_.json, report.dump(2));
    if (!common_.quiet) fmt::print("adjoint  {}\n{}\n", files_.adjoint, work_of(loss.spp));
    return kSuccess;
  }

  void write(const Scene& scene, const RunSettings& settings, const LossResult& loss,
             const BackwardResult& result) const {
    json report = {{"scene", scene.file},
                   {"sensor", sensor_name(scene)},
                   {"spp", result.spp},
                   {"batches", result.batches},
                   {"seed", settings.seed},
                   {"threads", settings.threads},
                   {"seconds", result.seconds},
                   {"setup_seconds", result.setup_seconds},
                   {"method", over_faces() ? options_.method.name() : result.method},
                   {"points", name_of(options_.points)},
                   {"warnings", warnings_.lines()},
                   {"non_finite", result.non_finite.count}};
    if (!over_faces()) {  // of a film seen by its faces every pixel is looked at
      report["pixels"] = kPixels[options_.uniform_pixels];
    }
    if (!target_.empty()) {
      report["loss"] = loss_json(loss);
      print_loss(loss);
    }
    report["parameters"] = write_parameters(scene, files_, result, common_.quiet);
    if (stats_) {
      json stats = stats_json(result.stats);
      stats["terms"] = costs_json(result.terms);
      for (const TermRun& term : result.terms)
        if (term.computed) stats["samples"][term.name] = term.samples;
      if (!result.decision.empty()) stats["pilot"] = result.decision;
      stats["contributions"] = result.contributions;
      stats["tape_bytes"] = result.tape_bytes;
      report["stats"] = stats;
    }
    write_json(files_.json, report.dump(2));
    if (!common_.json.empty()) write_json(common_.json, report.dump(2));
    if (!common_.quiet) {
      fmt::print("figures: {}\n{} in {:.2f} s (set-up {:.2f} s)\n", files_.json,
                 work_of(result.spp), result.seconds, result.setup_seconds);
    }
    if (!stats_) return;
    print_stats(result.stats, result.terms);
    if (!result.decision.empty()) fmt::print("{}\n", result.decision);
    fmt::print("{} numbers added to the gradient; the longest tape: {} bytes\n",
               result.contributions, result.tape_bytes);
  }

  // Of the time, for each of the two images of a loss; not tuned.
  static constexpr double kImageShare = 0.25;

  Stopwatch watch_;
  CLI::App* app_ = nullptr;
  CommonOptions common_;
  Warnings warnings_;
  BackwardOptions options_;
  BackwardFiles files_;
  std::string adjoint_, target_, output_, debug_;
  LossOptions loss_;
  bool stats_ = false, loss_only_ = false;
};

}  // namespace

std::unique_ptr<Command> make_backward_command() { return std::make_unique<BackwardCommand>(); }

}  // namespace limn
