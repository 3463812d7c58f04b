// Free memory, the error for too large an allocation, and the peak of resident memory.
#include "limn/core/memory.h"

#include <sys/resource.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>

namespace limn {

namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

// The number after `key` in a file of lines "KEY NUMBER ..."; the first word if `key` is "".
// Returns `absent` if there is no number (for example "max").
double number_in(const std::string& file, const std::string& key, double absent) {
  std::ifstream stream(file);
  std::string word;
  while (!key.empty() && stream >> word && word != key) {
  }
  double number = 0;
  return stream >> number ? number : absent;
}

double machine_free() { return 1024 * number_in("/proc/meminfo", "MemAvailable:", kUnlimited); }

// The page cache counts as used there, but is released on demand.
double container_free() {
  const std::string folder = "/sys/fs/cgroup/";
  const double limit = number_in(folder + "memory.max", "", kUnlimited);
  const double taken = number_in(folder + "memory.current", "", 0);
  const double files = number_in(folder + "memory.stat", "active_file", 0) +
                       number_in(folder + "memory.stat", "inactive_file", 0);
  return limit - std::max(0.0, taken - files);
}

double address_space_free() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnlimited;
  const double pages = number_in("/proc/self/statm", "", 0);
  return static_cast<double>(limit.rlim_cur) - pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}

std::string in_gigabytes(double bytes) {
  const double gigabytes = bytes * 1e-9;
  const auto tenths = static_cast<int64_t>(std::min(gigabytes * 10 + 0.5, 1e18));
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " GB";
}

}  // namespace

double free_memory() {
  return std::max(0.0, std::min({machine_free(), container_free(), address_space_free()}));
}

void require_memory(const SourceLocation& where, double bytes, const std::string& what,
                    const std::string& remedy) {
  constexpr double kWorthAsking = 0x1p26;  // not tuned: a query takes 50 microseconds
  if (bytes < kWorthAsking) return;
  double free = free_memory();
#ifdef __GLIBC__
  // The C library may still hold memory that this program has freed.
  if (bytes > free && malloc_trim(0) != 0) free = free_memory();
#endif
  if (bytes <= free) return;
  throw InputError(where, what + " takes " + in_gigabytes(bytes) + " of memory, and " +
                              in_gigabytes(free) + " are free: " + remedy);
}

void reset_peak_memory() {
  std::ofstream("/proc/self/clear_refs") << "5";  // without it the peak is that of all runs so far
}

uint64_t peak_memory_bytes() {
  return static_cast<uint64_t>(1024 * number_in("/proc/self/status", "VmHWM:", 0));
}

}  // namespace limn
