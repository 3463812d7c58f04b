// `limn reconstruct`: an object from photographs. It is part of the Python module, which this
// starts where the build has it.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "limn/core/error.h"
#include "tools/limn/commands.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

class ReconstructCommand final : public Command {
 public:
  const char* name() const override { return "reconstruct"; }
  const char* description() const override {
    return "Shape, colours and light of an object from photographs (with the Python module)";
  }
  void add_options(CLI::App& app) override {
    app.set_help_flag();  // that of the module, which reads all words
    app.prefix_command();
  }
  int run(const std::string&) override;
};

int ReconstructCommand::run(const std::string&) {
  std::error_code none;
  const fs::path build = fs::read_symlink("/proc/self/exe", none).parent_path();
  const fs::path module = build / "python";
  if (!fs::exists(module / "limn" / "__main__.py")) {
    throw InputError(
        "limn reconstruct: this build has no Python module: pip install . in limn's folder, then "
        "python -m limn reconstruct");
  }
  const char* known = std::getenv("PYTHONPATH");
  setenv("PYTHONPATH", (module.string() + (known ? ":" + std::string(known) : "")).c_str(), 1);
  const fs::path own = build / "venv" / "bin" / "python";
  const std::string python = fs::exists(own) ? own.string() : "python3";
  std::vector<std::string> line = {python, "-m", "limn", name()};
  line.insert(line.end(), words.begin(), words.end());
  std::vector<char*> argv;
  for (std::string& word : line) argv.push_back(word.data());
  argv.push_back(nullptr);
  execvp(argv[0], argv.data());
  throw InputError("limn reconstruct: cannot start " + python);
}

}  // namespace

std::unique_ptr<Command> make_reconstruct_command() {
  return std::make_unique<ReconstructCommand>();
}

}  // namespace limn
