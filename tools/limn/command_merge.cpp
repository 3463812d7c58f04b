// `limn merge`: joins the parts of a run that --part has made.
#include <algorithm>
#include <filesystem>

#include "limn/core/error.h"
#include "limn/integrators/parts.h"
#include "tools/limn/commands.h"
#include "tools/limn/output_files.h"
#include "tools/limn/run_part.h"

namespace limn {
namespace {

class MergeCommand final : public Command {
 public:
  const char* name() const override { return "merge"; }
  const char* description() const override {
    return "Join the shards of a run (--part K/N) into the files of one run";
  }
  void add_options(CLI::App& app) override {
    app.add_option("parts", parts_, "All .part files of the run, in any order")
        ->required()
        ->type_name("PART...");
    app.add_option("-o,--output", output_, "Output of the run, as -o of its command without --part")
        ->required()
        ->type_name("FILE|FOLDER");
    app.add_option("--json", json_, "Write all results as JSON to this file")->type_name("FILE");
    app.add_option("--threads", threads_, "Number of threads for the set-up (default: all cores)")
        ->type_name("INT");
    app.add_flag("--quiet", quiet_, "Print only errors and warnings");
  }

  int run(const std::string&) override {
    PartReader reader(parts_);
    const PartRequest request = parse_request(reader.arguments(), parts_.front());
    // Of the outputs the commands know all but that they must not be the parts. -o may be a folder.
    std::vector<PlannedFile> files{{"--json", json_}};
    if (std::filesystem::is_regular_file(output_)) files.push_back({"-o", output_});
    check_outputs(files, Scene(), parts_);
    for (const CommandMaker make : kCommands) {
      const auto command = make();
      if (command->name() != request.command || !command->join(reader)) continue;
      CLI::App app;
      command->add_options(app);
      std::vector<std::string> all = request.words;
      all.insert(all.end(), {"-o", output_});
      if (!json_.empty()) all.insert(all.end(), {"--json", json_});
      if (!threads_.empty()) all.insert(all.end(), {"--threads", threads_});
      if (quiet_) all.emplace_back("--quiet");
      std::reverse(all.begin(), all.end());  // as CLI11 takes them
      try {
        app.parse(all);
      } catch (const CLI::ParseError& error) {
        throw InputError({parts_.front()}, error.what());
      }
      return command->run(request.line);
    }
    throw InputError({parts_.front()}, "is a part of \"" + request.command +
                                           "\", which this version of limn does not join");
  }

 private:
  std::vector<std::string> parts_;
  std::string output_, json_, threads_;
  bool quiet_ = false;
};

}  // namespace

std::unique_ptr<Command> make_merge_command() { return std::make_unique<MergeCommand>(); }

}  // namespace limn
