// The peak of resident memory, as Linux reports it.
#include "integrators/estimates/peak_memory.h"

#include <fstream>
#include <sstream>
#include <string>

namespace limn {

void reset_peak_memory() {
  std::ofstream("/proc/self/clear_refs") << "5";  // without it the peak is that of all runs so far
}

uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    std::istringstream words(line);
    std::string name;
    uint64_t kilobytes = 0;
    if (words >> name >> kilobytes && name == "VmHWM:") return kilobytes * 1024;
  }
  return 0;
}

}  // namespace limn
