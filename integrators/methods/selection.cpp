// Which terms a run computes.
#include "integrators/methods/selection.h"

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/names.h"

namespace limn {

std::vector<std::string> selected_terms(const std::vector<std::string>& known,
                                        const std::vector<std::string>& chosen,
                                        const std::string& file) {
  for (const std::string& name : chosen) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    throw InputError({file},
                     "no term \"" + name + "\" here (terms of this scene: " + join(known) + ")");
  }
  return chosen.empty() ? known : chosen;
}

}  // namespace limn
