// The table of methods.
#include "limn/integrators/methods.h"

#include "integrators/methods/method_table.h"
#include "limn/core/error.h"
#include "limn/core/names.h"

namespace limn {

const std::vector<MethodType>& method_types() {
  static const std::vector<MethodType> types = [] {
    std::vector<MethodType> all = term_methods();
    for (MethodType& row : other_methods()) all.push_back(std::move(row));
    return all;
  }();
  return types;
}

const MethodType& find_method(const std::string& name) {
  if (name.empty()) return method_types().front();
  for (const MethodType& type : method_types()) {
    if (type.name == name) return type;
  }
  throw InputError(unknown_name("method", name, names_of(method_types())));
}

}  // namespace limn
