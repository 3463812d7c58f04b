// Mitsuba 3's gradient by the script beside this file, run as a program of its own.
#include "tools/mitsuba/mitsuba_method.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/integrators/moments.h"
#include "tools/limn/child_process.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScript = "mitsuba/mitsuba_gradient.py";
constexpr const char* kNotCounted = "setup_not_counted_seconds";
constexpr int kNotInstalled = 3;  // exit status of the script

std::string python() {
  const char* chosen = std::getenv("LIMN_MITSUBA_PYTHON");
  return chosen && *chosen ? chosen : "python3";
}

// The last lines: where Python says what happened.
std::string ending(const std::string& text) {
  constexpr size_t kMost = 400;
  return text.size() <= kMost ? text : "..." + text.substr(text.size() - kMost);
}

class MitsubaMethod final : public TimedMethod {
 public:
  MitsubaMethod(const std::string& name, const MethodInput& input,
                const std::map<std::string, std::string>& defines, const std::string& folder)
      : name_(name),
        input_(input),
        defines_(defines),
        image_((fs::path(folder) / "mitsuba_run.exr").string()),
        report_((fs::path(folder) / "mitsuba_run.json").string()) {}

  std::string name() const override { return name_; }
  std::string description() const override {
    return std::string("Mitsuba 3's prb_projective with octree guiding, where it is installed") +
           (after_setup() ? "; its set-up is not counted" : "");
  }

  MethodRun run(const RunSettings& settings) override {
    const ChildOutcome outcome = run_child(command(settings));
    if (settings.interrupted && settings.interrupted->load()) {
      remove_files();
      return {};
    }
    if (outcome.status == kNotInstalled) throw MethodMissing(outcome.errors);
    if (outcome.status != 0) {
      throw MethodMissing(fmt::format("{} failed (status {}): {}", kScript, outcome.status,
                                      ending(outcome.errors)));
    }
    try {
      MethodRun run = read_run();
      run.peak_memory_bytes = outcome.peak_memory_bytes;
      remove_files();
      return run;
    } catch (const std::exception& error) {
      throw MethodMissing(fmt::format("{} left no usable result: {}", kScript, error.what()));
    }
  }

  std::vector<MethodSetting> settings() const override { return settings_; }

 private:
  bool after_setup() const { return name_ == kMitsubaAfterSetup; }

  std::vector<std::string> command(const RunSettings& settings) const {
    const std::string script = tool_script(kScript);
    if (script.empty()) {
      throw MethodMissing(fmt::format("tools/{} is not beside the program's folder", kScript));
    }
    std::vector<std::string> words = {python(),
                                      script,
                                      input_.scene.file,
                                      "--wrt",
                                      input_.parameter,
                                      "--time",
                                      fmt::format("{}", settings.seconds),
                                      "--threads",
                                      std::to_string(settings.threads),
                                      "--seed",
                                      std::to_string(settings.seed)};
    for (const auto& [name, value] : defines_) {
      words.insert(words.end(), {"-D", name + "=" + value});
    }
    if (after_setup()) words.emplace_back("--after-setup");
    words.insert(words.end(), {"-o", image_, "--json", report_});
    return words;
  }

  MethodRun read_run() {
    std::ifstream stream(report_);
    const nlohmann::json report = nlohmann::json::parse(stream);
    MethodRun run;
    run.seconds = report.at("seconds");
    run.setup_seconds = report.at("setup_seconds");
    run.spp = report.at("spp");
    settings_.clear();
    for (const char* key : {"version", "message"}) {
      const auto found = report.find(key);
      if (found == report.end() || !found->is_string() || found->empty()) continue;
      settings_.push_back({key, found->get<std::string>()});
    }
    if (after_setup()) {
      settings_.push_back({kNotCounted, report.at(kNotCounted).get<double>()});
    }
    const Film& film = input_.scene.film;
    const Image image = read_exr(image_);
    if (image.width != film.crop_width || image.height != film.crop_height || image.channels != 3) {
      throw InputError(fmt::format("the image is {} x {}, not {} x {}", image.width, image.height,
                                   film.crop_width, film.crop_height));
    }
    run.image.assign(image.data.begin(), image.data.end());
    run.blocks.sums = sum_blocks(run.image, image.width, image.height, input_.block);
    return run;
  }

  void remove_files() const {
    std::error_code ignored;
    fs::remove(image_, ignored);
    fs::remove(report_, ignored);
  }

  std::string name_;
  const MethodInput& input_;
  std::map<std::string, std::string> defines_;
  std::string image_, report_;
  std::vector<MethodSetting> settings_;
};

}  // namespace

bool is_mitsuba(const std::string& name) { return name == kMitsuba || name == kMitsubaAfterSetup; }

std::unique_ptr<TimedMethod> make_mitsuba_method(const std::string& name, const MethodInput& input,
                                                 const std::map<std::string, std::string>& defines,
                                                 const std::string& folder) {
  return std::make_unique<MitsubaMethod>(name, input, defines, folder);
}

}  // namespace limn
