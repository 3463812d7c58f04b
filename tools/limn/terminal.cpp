// Progress on a terminal, and Ctrl-C.
#include "tools/limn/terminal.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <memory>

namespace limn {
namespace {

std::atomic<bool> g_interrupted{false};

void on_interrupt(int) {
  g_interrupted.store(true);
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

std::string duration(double seconds) {
  const int s = static_cast<int>(std::lround(seconds));
  if (s < 60) return fmt::format("{}s", s);
  if (s < 3600) return fmt::format("{}m{:02}s", s / 60, s % 60);
  return fmt::format("{}h{:02}m", s / 3600, s / 60 % 60);
}

}  // namespace

const std::atomic<bool>& interrupt_flag() { return g_interrupted; }

void watch_interrupt() {
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
}

std::function<void(double)> progress_bar(const std::string& label, bool quiet) {
  if (quiet || !isatty(STDERR_FILENO)) return nullptr;
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  auto drawn = std::make_shared<Clock::time_point>(start);
  return [=](double done) {
    const auto now = Clock::now();
    if (done < 1 && now - *drawn < std::chrono::milliseconds(200)) return;
    *drawn = now;
    const double spent = std::chrono::duration<double>(now - start).count();
    fmt::print(stderr, "\r{}: {:3.0f} %, {} left   {}", label, 100 * done,
               duration(spent * (1 - done) / done), done < 1 ? "" : "\n");
    std::fflush(stderr);
  };
}

}  // namespace limn
