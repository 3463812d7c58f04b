#pragma once
// What `limn --version` prints.
#include <string>

namespace limn {

// "limn 0.3.0 (commit 0123456789ab, Release)"; the commit is "unknown" outside a git checkout.
std::string version_text();

}  // namespace limn
