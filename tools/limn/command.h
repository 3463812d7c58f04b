#pragma once
// The contract of a command of the program: it says what it takes, then does it.
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace limn {

class BatchStore;

// Exit statuses.
enum Status {
  kSuccess = 0,
  kDisagree = 1,
  kBadInput = 2,
  kNonFinite = 3,
  kCannotTell = 4,  // a check whose samples were too few for a verdict, or that is not complete
  kInterrupted = 130
};

class Command {
 public:
  virtual ~Command() = default;
  virtual const char* name() const = 0;
  virtual const char* description() const = 0;
  // What the command line says goes into the command itself.
  virtual void add_options(CLI::App& app) = 0;
  // After parsing. command_line: what was typed, for a shell. Returns an exit status.
  virtual int run(const std::string& command_line) = 0;
  // Before run(): the batches of the run are those of the store. False for commands that no part is
  // made of.
  virtual bool join(BatchStore& /*store*/) { return false; }

  std::vector<std::string> words;  // after the command's name, as typed
};

}  // namespace limn
