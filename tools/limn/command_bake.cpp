// `limn bake` and `limn relight`: what a view sees of the sky, and its image under other maps.
#include "limn/integrators/bake.h"

#include <filesystem>
#include <fstream>

#include "limn/core/error.h"
#include "limn/core/parallel.h"
#include "limn/integrators/render.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"
#include "tools/limn/output_files.h"

namespace limn {
namespace {

class BakeCommand final : public Command {
 public:
  const char* name() const override { return "bake"; }
  const char* description() const override {
    return "Keep what each point of an image sees of the sky, for `limn relight`: direct light on "
           "diffuse surfaces (max_depth 2)";
  }
  void add_options(CLI::App& app) override {
    add_common_options(app, common_);
    app.remove_option(app.get_option("--json"));
    app.add_option("-o,--output", output_, "File to write")->required();
    const OptionAdder add(app);
    add(lines_, kBakedLinesOption);
  }
  int run(const std::string&) override {
    const Scene scene = load_scene(common_, warnings_);
    check_outputs({{"-o", output_}}, scene);
    const RunSettings settings = make_settings(common_, scene, name());
    const Stopwatch watch;
    const auto [view, non_finite, complete] = BakedView::make(scene, settings, lines_);
    if (!complete) {
      fmt::print(stderr, "interrupted: nothing is written\n");
      return kInterrupted;
    }
    const std::string bytes = view.bytes();
    write_file(output_, bytes);
    if (!common_.quiet) {
      fmt::print("baked    {} ({:.3g} MB)\n{} samples per pixel in {:.2f} s\n", output_,
                 static_cast<double>(bytes.size()) / 1e6, settings.spp, watch.seconds());
    }
    return finish_status(non_finite, settings.spp, settings.spp, "");
  }

 private:
  CommonOptions common_;
  Warnings warnings_;
  int lines_ = RenderOptions().lines;
  std::string output_;
};

class RelightCommand final : public Command {
 public:
  const char* name() const override { return "relight"; }
  const char* description() const override {
    return "The image of a baked view under an environment map, or derivatives for its texels";
  }
  void add_options(CLI::App& app) override {
    add_input_options(app, common_, "view", "File of `limn bake`", "FILE");
    app.remove_option(app.get_option("--seed"));
    app.add_option("--sky", sky_, "Environment map, as of an envmap")
        ->required()
        ->type_name("IMAGE");
    app.add_option("--scale", map_.scale, "Factor on its radiance")->capture_default_str();
    app.add_option("--rotate", map_.turn,
                   "Rotation of the map, as <rotate y=\"1\"/>, within the to_world of the envmap "
                   "that was baked [degrees]")
        ->capture_default_str();
    app.add_option("--adjoint", adjoint_,
                   "Image of dLoss/dpixel (.exr): write dLoss/dtexel in place of the image");
    app.get_option("-D")->needs(
        app.add_option("--scene", scene_, "Refuse unless this scene (with -D) is what was baked")
            ->type_name("SCENE"));
    app.add_option("-o,--output", output_, "Image to write (.exr); a .png is written beside it")
        ->required();
  }
  int run(const std::string&) override {
    const Stopwatch watch;
    const std::string picture = with_ending(output_, ".png");
    check_output(output_);
    check_outputs({{"-o", output_}, {"-o", picture}}, Scene(), {common_.scene, sky_, adjoint_});
    const BakedView view = BakedView::of_bytes(read_bytes(common_.scene), common_.scene);
    if (!scene_.empty()) view.check_scene(read_scene(scene_, common_.defines, nullptr));
    map_.texels = read_image(sky_);
    check_finite(map_.texels, sky_, "the environment map");
    const Image image = adjoint_.empty() ? view.relight(map_, thread_count(common_.run.threads))
                                         : view.texel_adjoint(map_, read_image(adjoint_));
    write_exr(output_, image, false,
              {{"limn.sky", sky_}, {kOutputAttribute, output_name(output_)}});
    if (adjoint_.empty()) {
      write_png(picture, image, 1);
    } else {
      write_signed_png(picture, image, signed_scale(image));
    }
    if (!common_.quiet) {
      fmt::print("image    {}\npicture  {}\n{:.3f} s\n", output_, picture, watch.seconds());
    }
    return kSuccess;
  }

 private:
  static std::string read_bytes(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    std::error_code error;
    const auto size = std::filesystem::file_size(file, error);
    std::string bytes(error ? 0 : size, '\0');
    if (error) throw InputError({file}, "cannot read: " + error.message());
    if (!stream.read(bytes.data(), static_cast<std::streamsize>(size))) {
      throw InputError({file}, "cannot read the file");
    }
    return bytes;
  }

  CommonOptions common_;
  SkyMap map_;
  std::string sky_, adjoint_, scene_, output_;
};

}  // namespace

std::unique_ptr<Command> make_bake_command() { return std::make_unique<BakeCommand>(); }
std::unique_ptr<Command> make_relight_command() { return std::make_unique<RelightCommand>(); }

}  // namespace limn
