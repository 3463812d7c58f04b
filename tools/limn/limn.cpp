// The program: one command per row of the table, chosen by the first word.
#include <fmt/format.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <sys/auxv.h>
#endif

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "tools/limn/commands.h"
#include "tools/limn/option_adder.h"
#include "tools/limn/terminal.h"
#include "tools/limn/version.h"

namespace {

// What was typed, for a shell.
std::string command_line(int argc, char** argv) {
  const std::string plain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/@%";
  std::string line = "limn";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) {
      line += " " + word;
      continue;
    }
    line += " '";
    for (const char c : word) line += c == '\'' ? "'\\''" : std::string(1, c);
    line += "'";
  }
  return line;
}

// CLI11 alone would say no more than that a command is needed.
void check_command(const CLI::App& app, int argc, char** argv) {
  const std::string first = argc > 1 ? argv[1] : "";
  if (first.starts_with('-')) return;
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands(nullptr)) {
    if (command->get_name() == first) return;
    known.push_back(command->get_name());
  }
  throw limn::InputError(
      (first.empty() ? "limn: a command is needed" : "limn " + first + ": no such command") + " (" +
      limn::known_names(known) + "; limn --help tells more)");
}

// CLI11 alone would list what it does not expect, with the values of unknown options.
void check_options(const CLI::App& command) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  for (const std::string& word : command.remaining()) {
    if (!word.starts_with('-')) continue;
    throw limn::InputError("limn " + command.get_name() + ": no such option: " + word +
                           " (nearest: " + limn::join(limn::nearest_names(word, known, 3)) +
                           "; limn " + command.get_name() + " --help tells more)");
  }
}

// Has glibc ask for pages of 2 MB wherever it takes memory, and keep arrays of up to 16 MB that are
// given back for the next ones. It settles that before main: the program starts anew, with the wish
// in its environment. Small arrays profit as well as large ones, and set-up meets a twentieth of
// the page faults (scenes/FIGURES.md). Who has other wishes in GLIBC_TUNABLES keeps them; under a
// tool that does not follow into the second start any value there prevents it. Help and version
// need none, and the malloc of sanitizers knows no such wish.
void use_huge_pages([[maybe_unused]] char** argv) {
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  constexpr const char* kName = "GLIBC_TUNABLES";
  constexpr const char* kWish =
      "glibc.malloc.hugetlb=1:glibc.malloc.mmap_threshold=16777216:"
      "glibc.malloc.trim_threshold=67108864";
  const char* wish = std::getenv(kName);
  if (wish) {
    if (std::string(wish) == kWish) unsetenv(kName);  // not for programs that this one starts
  } else if (argv[0] && argv[1] && argv[1][0] != '-' &&
             getauxval(AT_SECURE) == 0 &&  // else the wish would be taken away each time
             getauxval(AT_BASE) != 0) {    // else the loader was started, with this as its program
    setenv(kName, kWish, 1);
    std::error_code none;
    const std::string self = std::filesystem::read_symlink("/proc/self/exe", none).string();
    execv(self.c_str(), argv);  // by its own name, which tools like pkill go by
    unsetenv(kName);            // no such file: as it is, then
  }
#endif
}

int run(int argc, char** argv) {
  CLI::App app(
      "limn: a differentiable path tracer. limn COMMAND --help lists the options of a command");
  app.require_subcommand(1);
  app.set_version_flag("--version", limn::version_text(), "Print version, commit and build type");
  app.set_help_all_flag("--help-all", "Print the help of all commands");
  std::vector<std::pair<CLI::App*, std::unique_ptr<limn::Command>>> commands;
  for (const limn::CommandMaker make : limn::kCommands) {
    auto command = make();
    CLI::App* sub = app.add_subcommand(command->name(), command->description());
    command->add_options(*sub);
    commands.emplace_back(sub, std::move(command));
  }
  check_command(app, argc, argv);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ExtrasError& error) {
    for (const auto& [sub, command] : commands) check_options(*sub);
    return app.exit(error), limn::kBadInput;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? limn::kSuccess : limn::kBadInput;
  }
  for (const auto& [sub, command] : commands) {
    if (!sub->parsed()) continue;
    command->words.assign(argv + 2, argv + argc);
    return command->run(command_line(argc, argv));
  }
  return limn::kBadInput;
}

}  // namespace

int main(int argc, char** argv) {
  use_huge_pages(argv);
  std::string failed;
  try {
    return run(argc, argv);
  } catch (const limn::FieldError& error) {
    failed = fmt::format("error: {}: {}", limn::option_name(error.field), error.message);
  } catch (const limn::InputError& error) {
    failed = error.what();
  } catch (const std::exception& error) {
    failed = fmt::format("error: {}", error.what());
  }
  limn::clear_progress();
  fmt::print(stderr, "{}\n", failed);
  return limn::kBadInput;
}
