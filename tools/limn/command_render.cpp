// `limn render`: an image as EXR and PNG.
#include <algorithm>
#include <sstream>

#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/image.h"
#include "limn/core/names.h"
#include "limn/integrators/layers.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/render.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/output_files.h"
#include "tools/limn/run_part.h"

namespace limn {
namespace {

class RenderCommand final : public Command {
 public:
  const char* name() const override { return "render"; }
  const char* description() const override { return "Render an image"; }
  void add_options(CLI::App& app) override {
    app_ = &app;
    add_common_options(app, common_);
    app.add_option("-o,--output", output_, "Image to write (.exr); a .png is written beside it")
        ->required()
        ->type_name("FILE");
    options_.generator = kGenerators[0];
    const OptionAdder add(app);
    visit_options(options_, all_but({"what"}, add));
    app.add_option("--what", what_,
                   "What the image shows: all light (image), direct light, ambient occlusion (ao) "
                   "or openness of the sky (both need the method silhouettes, lines or rays); or "
                   "layers of one file, with commas: " +
                       limn::join(layer_names()))
        ->capture_default_str();
    app.add_flag("--alpha", alpha_,
                 "Also write channel A of the same file: the share of each pixel that surfaces "
                 "cover, by as many rays as there are samples");
    add_time_option(app, common_);
    add_debug_option(app, debug_);
    app.get_option("--debug-sample")->excludes("--time");
    add_part_option(app, common_);
    app.get_option("--part")->excludes("--time");
    app.get_option("--part")->excludes("--alpha");
  }
  bool join(BatchStore& store) override {
    common_.run.store = &store;
    return true;
  }

  int run(const std::string& command_line) override {
    const bool layers = check_what();
    check_options();
    const Scene scene = load_scene(common_, warnings_);
    if (alpha_) check_still(scene, "--alpha");
    const RunSettings settings =
        settings_for(options_.points, make_settings(common_, scene, name()));
    if (layers) return write_layers(scene, settings, command_line);
    if (!debug_.empty()) {
      for (const auto& line : trace_sample(scene, settings, parse_place(debug_), options_)) {
        fmt::print("{}\n", line);
      }
      return kSuccess;
    }
    if (!common_.part.empty()) {
      return run_part(
          common_, scene, {}, {name(), words, command_line}, output_,
          [&](const RunSettings& part) { return render(scene, part, options_).non_finite; });
    }
    check_output(output_);
    check_outputs({{"-o", output_}, {"-o", with_ending(output_, ".png")}, {"--json", common_.json}},
                  scene);
    const RenderResult result = render(scene, settings, options_);
    if (result.spp == 0) {
      fmt::print(stderr, "interrupted before the first pass over the image: nothing is written\n");
      return kInterrupted;
    }
    warnings_.add_all(result.warnings);
    write(scene, settings, result);
    const bool timed = settings.seconds > 0, all = timed && !settings.interrupted->load();
    return finish_status(result.non_finite, result.spp, all ? result.spp : settings.spp,
                         timed ? "" : command_line);
  }

 private:
  // True for layers; else sets what the image shows.
  bool check_what() {
    std::vector<std::string> known(std::begin(kRenderWhat), std::end(kRenderWhat));
    const auto image = std::find(known.begin(), known.end(), what_);
    if (image != known.end()) {
      options_.what = static_cast<RenderWhat>(image - known.begin());
      return false;
    }
    const std::vector<std::string> layers = layer_names();
    known.insert(known.end(), layers.begin(), layers.end());
    for (const std::string& name : split_names(what_)) {
      if (std::find(layers.begin(), layers.end(), name) != layers.end()) continue;
      throw InputError("--what: " + unknown_name("word", name, known));
    }
    refuse_options(
        *app_,
        {"--method", "--generator", "--points", "--part", "--debug-sample", "--time", "--alpha"},
        "not for layers (--what)");
    return true;
  }
  static std::vector<std::string> split_names(const std::string& text) {
    std::vector<std::string> names;
    std::istringstream stream(text);
    for (std::string name; std::getline(stream, name, ',');) names.push_back(name);
    return names;
  }
  int write_layers(const Scene& scene, const RunSettings& settings,
                   const std::string& command_line) {
    check_output(output_);
    check_outputs({{"-o", output_}}, scene);
    const LayersResult result = render_layers(scene, split_names(what_), settings);
    if (result.spp == 0) {
      fmt::print(stderr, "interrupted before the first pass over the image: nothing is written\n");
      return kInterrupted;
    }
    auto attributes = provenance(scene, settings, result.spp);
    attributes.push_back({"limn.what", what_});
    attributes.push_back({kOutputAttribute, output_name(output_)});
    remove_stale(output_, {output_});
    write_exr_layers(output_, result.layers, attributes);
    if (!common_.quiet) {
      fmt::print("layers   {}\n{} samples per pixel in {:.2f} s\n", output_, result.spp,
                 result.seconds);
    }
    return finish_status(result.non_finite, result.spp, settings.spp, command_line);
  }
  void check_options() const {
    check_image_options(*app_, {options_.method});
    if (alpha_ && options_.points == FilmPoints::kFaces) {
      throw InputError("--alpha takes a ray per sample, points \"faces\" have no samples");
    }
    refuse_samples(*app_, options_.points, {"--spp", "--time", "--part"}, options_);
    if (!has_generator() && options_.points == FilmPoints::kRandom) {
      refuse_options(*app_, {"--generator"},
                     fmt::format("the method {} has its own", options_.method.name()));
    }
  }
  const char* what() const { return kRenderWhat[static_cast<int>(options_.what)]; }
  static Image alpha_of(const Scene& scene, RunSettings settings, int64_t spp) {
    settings.spp = static_cast<int>(spp);
    settings.seconds = 0;
    settings.progress = nullptr;
    settings.interrupted = nullptr;
    return render_layers(scene, {"alpha"}, settings).layers.at(0).image;
  }
  bool has_points() const { return options_.method->image->closed_light; }
  bool has_generator() const {
    return options_.points != FilmPoints::kFaces && !options_.method->image->looks_around;
  }
  void write(const Scene& scene, const RunSettings& settings, const RenderResult& result) const {
    const Image image = mean_image(result.radiance, scene.film.crop_width, scene.film.crop_height);
    const std::string picture = with_ending(output_, ".png");
    auto attributes = provenance(scene, settings, result.spp);
    attributes.push_back({"limn.method", options_.method.name()});
    if (what() != kRenderWhat[0]) attributes.push_back({"limn.what", what()});
    if (has_generator()) attributes.push_back({"limn.generator", options_.generator});
    if (has_points()) attributes.push_back({"limn.points", name_of(options_.points)});
    attributes.push_back({kOutputAttribute, output_name(output_)});
    remove_stale(output_, {output_});
    const Image colours = film_channels(scene, image);
    if (alpha_) {
      write_exr_with_alpha(output_, colours, alpha_of(scene, settings, result.spp), scene.film.half,
                           attributes);
    } else {
      write_exr(output_, colours, scene.film.half, attributes);
    }
    write_png(picture, image, 1);
    if (!common_.quiet) print(picture, result);
    if (common_.json.empty()) return;
    nlohmann::json report = {{"scene", scene.file},
                             {"sensor", sensor_name(scene)},
                             {"spp", result.spp},
                             {"method", options_.method.name()},
                             {"what", what()},
                             {"seed", settings.seed},
                             {"threads", settings.threads},
                             {"seconds", result.seconds},
                             {"rays", result.rays},
                             {"warnings", warnings_.lines()},
                             {"non_finite", result.non_finite.count}};
    if (has_generator()) report["generator"] = options_.generator;
    if (has_points()) report["points"] = name_of(options_.points);
    write_json(common_.json, report.dump(2));
  }

  void print(const std::string& picture, const RenderResult& result) const {
    fmt::print("image    {}\npicture  {}\n", output_, picture);
    if (options_.points == FilmPoints::kFaces) {
      fmt::print("visible faces in {:.2f} s\n", result.seconds);
      return;
    }
    fmt::print("{} samples per pixel in {:.2f} s, {:.3g} million rays per second\n", result.spp,
               result.seconds, static_cast<double>(result.rays) / result.seconds / 1e6);
  }

  CommonOptions common_;
  Warnings warnings_;
  RenderOptions options_;
  CLI::App* app_ = nullptr;
  std::string output_, debug_, what_ = kRenderWhat[0];
  bool alpha_ = false;
};

}  // namespace

std::unique_ptr<Command> make_render_command() { return std::make_unique<RenderCommand>(); }

}  // namespace limn
