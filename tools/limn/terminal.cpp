// Progress on a terminal, Ctrl-C, and a terminal that closes.
#include "tools/limn/terminal.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <memory>

namespace limn {
namespace {

std::atomic<bool> g_interrupted{false};
std::atomic<int64_t> g_first{0};   // when it was set [ns]
std::atomic<bool> g_drawn{false};  // a line of progress that has no end yet

// `timeout` and job schedulers send a process its signal, and then to its group, it among them:
// what comes at once is one request.
void on_interrupt(int signal) {
  constexpr int64_t kSecond = 1'000'000'000;
  timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  const int64_t now = time.tv_sec * kSecond + time.tv_nsec;
  int64_t first = 0;
  if (g_first.compare_exchange_strong(first, now)) {
    g_interrupted.store(true);
  } else if (now - first > kSecond / 2) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
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
  // Under nohup a terminal that closes ends nothing.
  if (std::signal(SIGHUP, on_interrupt) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

std::string progress_line(const std::string& label, double done, double spent) {
  const std::string line = fmt::format("{}: {:3.0f} %", label, 100 * done);
  if (done < 0.01 || done >= 1 || spent < 3) return line;
  return line + fmt::format(", {} left", duration(spent * (1 - done) / done));
}

void clear_progress() {
  if (!g_drawn.exchange(false)) return;
  fmt::print(stderr, "\r\033[K");
  std::fflush(stderr);
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
    fmt::print(stderr, "\r{}\033[K{}", progress_line(label, done, spent), done < 1 ? "" : "\n");
    std::fflush(stderr);
    g_drawn.store(done < 1);
  };
}

}  // namespace limn
