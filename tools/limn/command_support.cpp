#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "limn/core/error.h"
#include "limn/core/parallel.h"
#include "tools/limn/commands.h"
#include "tools/limn/terminal.h"

namespace limn {

Scene load_scene(const CommonOptions& common) {
  std::vector<std::string> warnings;
  Scene scene = read_scene(common.scene, common.defines, &warnings);
  for (const std::string& warning : warnings) fmt::print(stderr, "{}\n", warning);
  if (common.shading == "mitsuba") scene.shading = ShadingModel::kMitsuba;
  return scene;
}

RunSettings make_settings(const CommonOptions& common, const Scene& scene,
                          const std::string& label) {
  RunSettings settings;
  settings.spp = common.spp > 0 ? common.spp : scene.sample_count;
  settings.seed = common.seed.value_or(scene.seed);
  settings.threads = thread_count(common.threads);
  settings.progress = progress_bar(label, common.quiet);
  settings.interrupted = &interrupt_flag();
  watch_interrupt();
  return settings;
}

std::vector<ImageAttribute> provenance(const Scene& scene, const RunSettings& settings,
                                       int64_t spp) {
  return {{"limn.scene", scene.file},
          {"limn.spp", std::to_string(spp)},
          {"limn.seed", std::to_string(settings.seed)},
          {"limn.shading", scene.shading == ShadingModel::kMitsuba ? "mitsuba" : "continuous"}};
}

Image film_channels(const Scene& scene, const Image& image) {
  if (!scene.film.luminance) return image;
  Image grey(image.width, image.height, 1);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      grey.at(x, y, 0) =
          luminance(Rgb<float>{image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)});
    }
  }
  return grey;
}

std::string with_ending(const std::string& output, const std::string& ending) {
  return std::filesystem::path(output).replace_extension("").string() + ending;
}

void check_output(const std::string& file) {
  if (std::filesystem::path(file).extension() != ".exr") {
    throw InputError({file}, "the output is an OpenEXR image: its name must end in .exr");
  }
  const auto folder = std::filesystem::absolute(file).parent_path();
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  const bool existed = std::filesystem::exists(file);
  if (failed || !std::ofstream(file, std::ios::app)) {
    throw InputError({file}, "cannot be written");
  }
  if (!existed) std::filesystem::remove(file);
}

void write_json(const std::string& file, const std::string& text) {
  if (file.empty()) return;
  std::ofstream stream(file);
  stream << text << "\n";
  if (!stream) throw InputError({file}, "cannot be written");
}

std::array<bool, kTermCount> parse_terms(const std::string& list) {
  std::array<bool, kTermCount> terms = {false, false, false};
  std::stringstream stream(list);
  for (std::string name; std::getline(stream, name, ',');) {
    bool known = false;
    for (int term = 0; term < kTermCount; ++term) {
      if (name != term_name(term)) continue;
      terms[term] = known = true;
    }
    if (!known) {
      throw InputError("--terms: unknown term \"" + name +
                       "\" (known: interior, camera, boundary; several with commas)");
    }
  }
  return terms;
}

std::optional<SampleCounts> parse_samples(const std::string& list) {
  if (list == "auto") return std::nullopt;
  constexpr int kMost = 1024;
  std::istringstream stream(list);
  SampleCounts samples;
  char comma[2] = {};
  stream >> samples.interior >> comma[0] >> samples.camera >> comma[1] >> samples.boundary;
  const auto in_range = [](double count) { return count > 0 && count <= kMost; };
  if (stream.fail() || !stream.eof() || comma[0] != ',' || comma[1] != ',' ||
      !in_range(samples.interior) || !in_range(samples.camera) || !in_range(samples.boundary)) {
    throw InputError(fmt::format(
        "--samples: \"{}\" is neither auto nor three counts of at most {}, for the interior, the "
        "camera (which may be less than 1) and the boundary, as in 3,0.5,1",
        list, kMost));
  }
  return samples;
}

int finish_status(const NonFinite& non_finite, int64_t spp_done, int64_t spp_asked) {
  if (non_finite.count > 0) {
    fmt::print(stderr, "error: {}\n", non_finite.message());
    return kNonFinite;
  }
  if (spp_done < spp_asked) {
    fmt::print(stderr, "interrupted: {} of {} samples per pixel are done\n", spp_done, spp_asked);
    return kInterrupted;
  }
  return kSuccess;
}

}  // namespace limn
