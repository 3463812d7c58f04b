// Other programs, run and waited for.
#include "tools/limn/child_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX leaves it to us

namespace limn {
namespace {

namespace fs = std::filesystem;

std::string read_all(int descriptor) {
  std::string text;
  std::array<char, 4096> buffer;
  for (;;) {
    const ssize_t size = read(descriptor, buffer.data(), buffer.size());
    if (size > 0) text.append(buffer.data(), static_cast<size_t>(size));
    if (size == 0 || (size < 0 && errno != EINTR)) break;
  }
  text.erase(text.find_last_not_of(" \n\r\t") + 1);
  return text;
}

// 0, or an error number.
int spawn(const std::vector<std::string>& command, const int errors[2], pid_t& child) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, errors[1], STDERR_FILENO);
  const int failed =
      posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return failed;
}

}  // namespace

ChildOutcome run_child(const std::vector<std::string>& command) {
  ChildOutcome outcome;
  int errors[2];
  if (pipe2(errors, O_CLOEXEC) != 0) {
    outcome.errors = std::strerror(errno);
    return outcome;
  }
  pid_t child = 0;
  const int failed = spawn(command, errors, child);
  close(errors[1]);
  if (failed == 0) {
    outcome.errors = read_all(errors[0]);
    int status = 0;
    rusage usage{};
    while (wait4(child, &status, 0, &usage) < 0 && errno == EINTR) {
    }
    if (WIFEXITED(status)) outcome.status = WEXITSTATUS(status);
    outcome.peak_memory_bytes = static_cast<uint64_t>(usage.ru_maxrss) * 1024;
  } else {
    outcome.errors = command[0] + ": " + std::strerror(failed);
  }
  close(errors[0]);
  return outcome;
}

std::string tool_script(const std::string& name) {
  std::error_code failed;
  const fs::path program = fs::read_symlink("/proc/self/exe", failed);
  if (failed) return "";
  // In the source's build folder, and where it was installed.
  for (const char* place : {"tools", "share/limn"}) {
    const fs::path script = (program.parent_path() / ".." / place / name).lexically_normal();
    if (fs::exists(script, failed)) return script.string();
  }
  return "";
}

}  // namespace limn
