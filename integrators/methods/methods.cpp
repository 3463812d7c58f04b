// The table of methods.
#include "limn/integrators/methods.h"

#include <algorithm>

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

void check_warp(const WarpOptions& warp, const std::vector<std::string>& methods) {
  if (warp.rays == WarpOptions{}.rays && warp.kappa == WarpOptions{}.kappa) return;
  std::vector<std::string> takers;
  for (const MethodType& type : method_types()) {
    if (!type.warps) continue;
    if (std::find(methods.begin(), methods.end(), type.name) != methods.end()) return;
    takers.push_back(type.name);
  }
  const std::string whose = methods.size() > 1 ? "none of the methods " + join(methods) + " has any"
                                               : "the method \"" + join(methods) + "\" has none";
  throw InputError("auxiliary rays and their kernel (--aux, --kappa) are for the methods " +
                   join(takers) + ": " + whose);
}

}  // namespace limn
