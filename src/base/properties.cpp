// Errors of Properties.
#include "limn/core/properties.h"

namespace limn {

void Properties::fail(const std::string& message) const {
  throw InputError(where(), tag() + " \"" + type() + "\": " + message);
}

void Properties::fail(const std::string& property, const std::string& message) const {
  throw InputError(where(property), tag() + " \"" + type() + "\": " + property + ": " + message);
}

}  // namespace limn
