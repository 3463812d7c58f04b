#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/integrators/render.h"
#include "tools/limn/commands.h"

namespace limn {

int run_render(const CommonOptions& common, const std::string& output) {
  const Scene scene = load_scene(common);
  check_output(output);
  const RunSettings settings = make_settings(common, scene, "render");
  const RenderResult result = render(scene, settings);
  if (result.spp == 0) {
    fmt::print(stderr, "interrupted before the first pass over the image: nothing is written\n");
    return kInterrupted;
  }
  const Image image = mean_image(result.radiance, scene.film.crop_width, scene.film.crop_height);
  const std::string picture = with_ending(output, ".png");
  write_exr(output, film_channels(scene, image), scene.film.half,
            provenance(scene, settings, result.spp));
  write_png(picture, image, 1);
  if (!common.quiet) {
    fmt::print("{} and {}: {} samples per pixel, {:.2f} s, {:.3g} million rays per second\n",
               output, picture, result.spp, result.seconds, result.rays / result.seconds / 1e6);
  }
  if (!common.json.empty()) {
    const nlohmann::json report = {{"scene", scene.file},
                                   {"spp", result.spp},
                                   {"seed", settings.seed},
                                   {"threads", settings.threads},
                                   {"seconds", result.seconds},
                                   {"rays", result.rays},
                                   {"non_finite", result.non_finite.count}};
    write_json(common.json, report.dump(2));
  }
  return finish_status(result.non_finite, result.spp, settings.spp);
}

}  // namespace limn
