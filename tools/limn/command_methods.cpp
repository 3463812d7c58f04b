// `limn methods`: the table of methods, and what each can do.
#include <fmt/format.h>

#include "limn/integrators/methods.h"
#include "tools/limn/commands.h"

namespace limn {
namespace {

constexpr Task kTasks[] = {Task::kImage, Task::kGradient, Task::kBackward, Task::kFit,
                           Task::kCompare};

// "default" where the task takes the method unless another one is named.
std::string cell(const MethodType& type, Task task) {
  if (!type.can(task)) return "-";
  return task != Task::kCompare && Method(task).name() == type.name ? "default" : "yes";
}

void print_settings(const MethodType& type) {
  for (const Setting& setting : type.settings.list()) {
    fmt::print("    {}={}: {}\n", setting.name, fmt::join(setting.values, "|"),
               setting.description);
  }
}

class MethodsCommand final : public Command {
 public:
  const char* name() const override { return "methods"; }
  const char* description() const override { return "The methods, and what each can do"; }
  void add_options(CLI::App& app) override {
    app.add_flag("--all", all_,
                 "Also list their settings, the default value first; a name carries them as in "
                 "forest:width=4:look-ahead=none");
  }
  int run(const std::string&) override {
    fmt::print("{:12}", "method");
    for (const Task task : kTasks) fmt::print(" {:8}", kTaskNames[static_cast<int>(task)]);
    fmt::print("\n");
    for (const MethodType& type : method_types()) {
      fmt::print("{:12}", type.name);
      for (const Task task : kTasks) fmt::print(" {:8}", cell(type, task));
      fmt::print(" {}\n", type.description);
      if (all_) print_settings(type);
    }
    return kSuccess;
  }

 private:
  bool all_ = false;
};

}  // namespace

std::unique_ptr<Command> make_methods_command() { return std::make_unique<MethodsCommand>(); }

}  // namespace limn
