// Random nasty scenes: reads, renders and differentiates each in a process of its own.
//
//   nasty_scenes FIRST COUNT [SECONDS]
//
// The scene of a seed is the same everywhere. A scene fails if its process ends by a signal (an
// abort, a sanitizer's report), takes more than SECONDS (20) of processor time, throws anything but
// InputError, or if an image holds what is not finite. Refused scenes and runs that report samples
// which are not finite are counted. The scenes of failures stay, and their places are printed; with
// NASTY_SHOW in the environment all scenes stay, and errors are printed.
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "limn/core/scene.h"
#include "limn/integrators/render.h"
#include "tests/fuzz/nasty/nasty_scene.h"

namespace limn::nasty {
namespace {

enum Outcome { kFinite = 0, kRefused = 1, kReported = 2, kWrong = 3 };
constexpr const char* kOutcomes[] = {"finite", "refused with an error",
                                     "with samples reported as not finite"};

bool is_finite(const Moments& moments) {
  for (size_t i = 0; i < moments.size(); ++i)
    if (!std::isfinite(moments.mean(i)) ||
        (moments.batches() > 1 && !std::isfinite(moments.variance(i))))
      return false;
  return true;
}

Outcome run_scene(uint64_t seed, const std::string& folder) {
  Die die(seed);
  const std::string file = write_scene(die, folder);
  std::string asked = "render";
  try {
    Scene scene = read_scene(file, {}, nullptr);
    if (die.chance(0.1)) scene.shading = ShadingModel::kMitsuba;
    const Request request = nasty_request(die, scene, folder);
    const RenderResult image = render(scene, request.settings);
    asked = fmt::format("gradient, method \"{}\", {} samples, wrt", request.options.method.name(),
                        request.settings.spp);
    for (const auto& parameter : request.options.parameters) asked += " " + parameter;
    const GradientResult result = gradient(scene, request.options, request.settings);
    bool finite = is_finite(image.radiance) && is_finite(result.radiance);
    for (const auto& parameter : result.parameters) finite = finite && is_finite(parameter.total);
    if (!finite) {
      fmt::print("  an image is not finite: {}\n", asked);
      return kWrong;
    }
    const uint64_t bad = image.non_finite.count + result.non_finite.count;
    if (bad > 0) fmt::print("seed {}: {} ({})\n", seed, result.non_finite.message(), asked);
    return bad > 0 ? kReported : kFinite;
  } catch (const InputError& e) {
    if (getenv("NASTY_SHOW")) fmt::print("seed {}: {}\n", seed, e.what());
    return kRefused;
  } catch (const std::exception& e) {
    fmt::print("  exception: {} ({})\n", e.what(), asked);
    return kWrong;
  }
}

// The child's exit status, or -1 if a signal ended it; it is stopped after `seconds`.
int run_in_child(uint64_t seed, const std::string& folder, unsigned seconds) {
  const pid_t child = fork();
  if (child == 0) {
    // Of processor time, so that a busy machine fails nothing; a signal ends it.
    const rlimit limit{seconds, seconds};
    setrlimit(RLIMIT_CPU, &limit);
    alarm(60 * seconds);  // what waits for ever
    const Outcome outcome = run_scene(seed, folder);
    fflush(stdout);
    _exit(outcome);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int run_all(uint64_t first, uint64_t count, unsigned seconds) {
  namespace fs = std::filesystem;
  const fs::path root = fs::temp_directory_path() / fmt::format("nasty_scenes_{}", getpid());
  uint64_t outcomes[3] = {0, 0, 0}, failures = 0;
  for (uint64_t seed = first; seed < first + count; ++seed) {
    const fs::path folder = root / fmt::format("seed_{}", seed);
    fs::create_directories(folder);
    const int status = run_in_child(seed, folder.string(), seconds);
    if (status >= 0 && status < kWrong) {
      ++outcomes[status];
      if (!getenv("NASTY_SHOW")) fs::remove_all(folder);
    } else {
      ++failures;
      fmt::print("seed {} fails{}: {}\n", seed, status < 0 ? " by a signal" : "", folder.string());
    }
    fflush(stdout);
  }
  if (failures == 0 && !getenv("NASTY_SHOW")) fs::remove_all(root);
  for (int i = 0; i < 3; ++i) fmt::print("{} {}\n", outcomes[i], kOutcomes[i]);
  fmt::print("{} failures of {} scenes, seeds from {} on\n", failures, count, first);
  return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace limn::nasty

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: nasty_scenes FIRST COUNT [SECONDS]\n");
    return EXIT_FAILURE;
  }
  const auto number = [&](int i) { return std::strtoull(argv[i], nullptr, 10); };
  return limn::nasty::run_all(number(1), number(2), argc > 3 ? number(3) : 20);
}
