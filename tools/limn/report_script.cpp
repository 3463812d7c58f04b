// The call of tools/report.py, or what is missing for it.
#include "tools/limn/report_script.h"

#include <fmt/format.h>

#include "tools/limn/child_process.h"

namespace limn {
namespace {

constexpr const char* kScript = "report.py";

// A Python that has matplotlib: Debian's first. "" if there is none.
std::string find_python() {
  for (const char* python : {"/usr/bin/python3", "python3"}) {
    if (run_child({python, "-c", "import matplotlib"}).status == 0) return python;
  }
  return "";
}

void print_missing(const std::string& folder, const std::string& what) {
  fmt::print(stderr, "no report.html: {}\nAll data is in {}\n", what, folder);
}

}  // namespace

void write_report(const std::string& folder, bool quiet) {
  const std::string script = tool_script(kScript);
  if (script.empty()) {
    print_missing(folder, "tools/report.py is not beside the program's folder");
    return;
  }
  const std::string python = find_python();
  if (python.empty()) {
    print_missing(
        folder,
        "it needs Python 3 with matplotlib (Debian: apt install python3-matplotlib); then "
        "run\n  python3 " +
            script + " " + folder);
    return;
  }
  const ChildOutcome outcome = run_child({python, script, folder});
  if (outcome.status != 0) {
    print_missing(folder, script + " failed:\n" + outcome.errors);
  } else if (!quiet) {
    fmt::print("{}/report.html: pictures and charts\n", folder);
  }
}

}  // namespace limn
