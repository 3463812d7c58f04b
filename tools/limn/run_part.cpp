// Parts of runs.
#include "tools/limn/run_part.h"

#include <algorithm>
#include <filesystem>

#include "limn/core/error.h"
#include "limn/integrators/parts.h"
#include "tools/limn/output_files.h"

namespace limn {

using nlohmann::json;

namespace {

// Options that a run in parts takes from where it is joined, with a word behind them or without.
constexpr const char* kOwn[] = {"--part", "-o", "--output", "--json", "--threads"};
constexpr const char* kOwnFlags[] = {"--quiet"};

std::vector<std::string> without_own(const std::vector<std::string>& words) {
  std::vector<std::string> kept;
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    const auto is = [&](const char* option) { return word == option; };
    if (std::any_of(std::begin(kOwnFlags), std::end(kOwnFlags), is)) continue;
    if (std::any_of(std::begin(kOwn), std::end(kOwn), is)) {
      ++i;
      continue;
    }
    const auto begins = [&](const std::string& option) {
      return word.starts_with(option.starts_with("--") ? option + "=" : option);
    };
    if (std::any_of(std::begin(kOwn), std::end(kOwn), begins)) continue;
    kept.push_back(word);
  }
  return kept;
}

}  // namespace

void add_part_option(CLI::App& app, CommonOptions& common) {
  app.add_option("--part", common.part,
                 "Compute only shard K of N of this run, and write it to the .part file that -o "
                 "names. Any machine can compute the others; limn merge joins them")
      ->type_name("K/N")
      ->excludes("--json");
}

std::string to_text(const PartRequest& request) {
  return json{
      {"command", request.command}, {"words", without_own(request.words)}, {"line", request.line}}
      .dump();
}

PartRequest parse_request(const std::string& text, const std::string& file) {
  const json request = json::parse(text, nullptr, false);
  if (request.is_discarded() || !request.contains("words")) {
    throw InputError({file}, "was not made by the program: join it where it was made");
  }
  return {request["command"], request["words"], request["line"]};
}

int run_part(const CommonOptions& common, const Scene& scene,
             const std::vector<std::string>& inputs, const PartRequest& request,
             const std::string& output, const std::function<NonFinite(const RunSettings&)>& run) {
  const Part part = parse_part(common.part);
  if (std::filesystem::path(output).extension() != ".part") {
    throw InputError({output},
                     "with --part the output is a part of a run: its name must end in "
                     ".part");
  }
  check_outputs({{"-o", output}}, scene, inputs);
  PartWriter writer(part, to_text(request), output);
  RunSettings settings = make_settings(common, scene, request.command);
  settings.store = &writer;
  const NonFinite bad = run(settings);
  if (settings.interrupted->load()) {
    fmt::print(stderr,
               "interrupted: {} samples per pixel of this part are done; the same command goes on "
               "from there\n",
               writer.samples());
    return kInterrupted;
  }
  writer.finish();
  if (!common.quiet) {
    fmt::print("{}: part {}, {} of {} samples per pixel, {:.3g} MB\n", output, common.part,
               writer.samples(), writer.spp(),
               static_cast<double>(std::filesystem::file_size(output)) / 1e6);
  }
  return finish_status(bad, 0, 0, request.line);
}

}  // namespace limn
