// Reports a failed CHECK and aborts.
#include "limn/core/check.h"

#include <cstdio>
#include <cstdlib>

namespace limn::detail {

void check_failed(const char* file, int line, const std::string& what) {
  std::fprintf(stderr, "%s:%d: check failed: %s\n", file, line, what.c_str());
  std::fflush(stderr);
  std::abort();
}

}  // namespace limn::detail
