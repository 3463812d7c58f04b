// `limn render`: an image as EXR and PNG.
#include <algorithm>

#include "limn/integrators/methods.h"
#include "limn/integrators/render.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/compare_images.h"
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
        ->required();
    options_.generator = kGenerators[0];
    visit_options(options_, OptionAdder(app));
    add_debug_option(app, debug_);
    add_part_option(app, common_);
  }
  bool join(BatchStore& store) override {
    common_.run.store = &store;
    return true;
  }

  int run(const std::string& command_line) override {
    check_options();
    const Scene scene = load_scene(common_, warnings_);
    const RunSettings settings =
        settings_for(options_.points, make_settings(common_, scene, name()));
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
    return finish_status(result.non_finite, result.spp, settings.spp, command_line);
  }

 private:
  void check_options() const {
    check_image_options(*app_, {options_.method});
    refuse_samples(*app_, options_.points, {"--spp", "--part"}, options_);
    if (!has_generator() && options_.points == FilmPoints::kRandom) {
      refuse_options(*app_, {"--generator"},
                     fmt::format("the method {} has its own", options_.method.name()));
    }
  }
  const char* what() const { return kRenderWhat[static_cast<int>(options_.what)]; }
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
    write_exr(output_, film_channels(scene, image), scene.film.half, attributes);
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
  std::string output_, debug_;
};

}  // namespace

std::unique_ptr<Command> make_render_command() { return std::make_unique<RenderCommand>(); }

}  // namespace limn
