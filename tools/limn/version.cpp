// The version, the commit and the build type: the only file that a new commit compiles again.
#include "tools/limn/version.h"

#include <limn_commit.h>

namespace limn {

std::string version_text() {
  return "limn " LIMN_VERSION " (commit " LIMN_COMMIT ", " LIMN_BUILD_TYPE ")";
}

}  // namespace limn
