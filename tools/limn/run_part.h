#pragma once
// `--part K/N` of commands that render: a part of the run alone, for `limn merge`.
#include <functional>
#include <string>
#include <vector>

#include "tools/limn/command_support.h"

namespace limn {

// --part
void add_part_option(CLI::App& app, CommonOptions& common);

// The command, as it is kept in a part.
struct PartRequest {
  std::string command;
  std::vector<std::string> words;  // after the command's name, without -o, --part and what only
                                   // changes how a run is reported or how fast it is
  std::string line;                // as typed, for a shell
};
std::string to_text(const PartRequest& request);
// InputError that names `file` if it is not one.
PartRequest parse_request(const std::string& text, const std::string& file);

// Makes the part that common.part states, into `output`, which must end in .part. inputs: files
// that are read beside those of the scene. run: the run with these settings; returns what was not
// finite. Returns the command's status.
int run_part(const CommonOptions& common, const Scene& scene,
             const std::vector<std::string>& inputs, const PartRequest& request,
             const std::string& output, const std::function<NonFinite(const RunSettings&)>& run);

}  // namespace limn
