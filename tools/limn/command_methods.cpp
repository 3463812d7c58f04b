// `limn methods`: the table of methods, and what each can do.
#include <fmt/format.h>

#include <algorithm>

#include "limn/integrators/methods.h"
#include "tools/limn/commands.h"
#include "tools/limn/table.h"

namespace limn {
namespace {

constexpr Task kTasks[] = {Task::kImage, Task::kGradient, Task::kBackward, Task::kFit,
                           Task::kCompare};

std::string text_of(const Setting& setting) {
  return fmt::format("{}={}", setting.name, fmt::join(setting.values, "|"));
}

// "default" where the task takes the method unless another one is named.
std::string cell(const MethodType& type, Task task) {
  if (!type.can(task)) return "-";
  return task != Task::kCompare && Method(task).name() == type.name ? "default" : "yes";
}

// Their longest name with values, of all methods.
size_t settings_width() {
  size_t width = 0;
  for (const MethodType& type : method_types()) {
    for (const Setting& setting : type.settings.list())
      width = std::max(width, text_of(setting).size());
  }
  return width;
}

class MethodsCommand final : public Command {
 public:
  const char* name() const override { return "methods"; }
  const char* description() const override { return "List the methods and what each can compute"; }
  void add_options(CLI::App& app) override {
    app.add_flag("--all", all_,
                 "Also list the settings of each method, with the default value first. Append "
                 "settings to a name, as in forest:width=4:look-ahead=none");
  }
  int run(const std::string&) override {
    std::vector<Table::Column> columns = {{"method", true}};
    for (const Task task : kTasks) columns.push_back({kTaskNames[static_cast<int>(task)], true});
    columns.push_back({"what it computes", true});
    Table table(columns);
    const size_t width = settings_width();
    for (const MethodType& type : method_types()) {
      Table::Row row = {type.name};
      for (const Task task : kTasks) row.push_back(cell(type, task));
      row.emplace_back(type.description);
      table.add(row);
      if (!all_) continue;
      for (const Setting& setting : type.settings.list())
        table.add_line(fmt::format("    {:{}}  {}", text_of(setting), width, setting.description));
    }
    fmt::print("{}", table.text());
    return kSuccess;
  }

 private:
  bool all_ = false;
};

}  // namespace

std::unique_ptr<Command> make_methods_command() { return std::make_unique<MethodsCommand>(); }

}  // namespace limn
