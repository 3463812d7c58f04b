#pragma once
// Scripts beside the program, run as child processes.
#include <cstdint>
#include <string>
#include <vector>

namespace limn {

struct ChildOutcome {
  int status = -1;     // exit status; -1 if it could not be started or was ended by a signal
  std::string errors;  // standard error, without white space at the end
  uint64_t peak_memory_bytes = 0;
};
// Runs a program (found in PATH) and waits for its end. Its standard output is dropped.
ChildOutcome run_child(const std::vector<std::string>& command);

// A script of tools/, beside the build folder or installed with the program; "" if it is not there.
std::string tool_script(const std::string& name);

}  // namespace limn
