// The table of methods.
#include "limn/integrators/methods.h"

#include <algorithm>
#include <array>

#include "integrators/methods/method_table.h"
#include "limn/core/error.h"
#include "limn/core/names.h"

namespace limn {
namespace {

// Names of earlier versions, and what they are called.
struct Renamed {
  const char *old_name, *name;
};
constexpr auto kRenamed = std::to_array<Renamed>({
    {"moving-directions", "silhouettes:directions=moving"},
    {"random-directions", "silhouettes:directions=random:film=moving"},
    {"independent-numbers", "adaptive:generator=independent"},
    {"held-positions", "adaptive:film=fixed:generator=independent"},
    {"was-unbiased", "was:bias=off"},
    {"dual-bvh", "brute:search=dual-bvh"},
    {"li2019-solid", "li2019:sphere=solid"},
    {"quadric-box", "quadric:quadrics=off"},
    {"quadric-no-lights", "quadric:lights=off"},
    {"quadric-concave", "quadric:concave=on"},
    {"forest-look-ahead-none", "forest:look-ahead=none"},
    {"forest-look-ahead-edges", "forest:look-ahead=edges"},
    {"forest-look-ahead-all", "forest:look-ahead=all"},
    {"forest-width-2-look-ahead-none", "forest:width=2:look-ahead=none"},
    {"forest-width-4-look-ahead-none", "forest:width=4:look-ahead=none"},
    {"forest-width-4-look-ahead-all", "forest:width=4:look-ahead=all"},
    {"forest-closed", "forest:expansion=off"},
    {"forest-any-axes", "forest:axes=any"},
    {"forest-hard-weights", "forest:weights=hard"},
    {"forest-plain", "forest:look-ahead=none:expansion=off:axes=any:weights=hard"},
    {"forest-any-motion", "forest:motion=any"},
    {"forest-concave", "forest:concave=on"},
    {"forest-no-lights", "forest:lights=off"},
    {"forest-no-environment", "forest:environment=off"},
    {"forest-quadrics", "quadric (pairs of quadrics within the forest never paid and are gone)"},
});

// A row lives as long as the program.
std::shared_ptr<const MethodType> keep(const MethodType& row) {
  return {std::shared_ptr<const MethodType>(), &row};
}

std::shared_ptr<const MethodType> find_method(const std::string& name) {
  for (const MethodType& type : method_types()) {
    if (type.name == name) return keep(type);
  }
  for (const Renamed& renamed : kRenamed) {
    if (renamed.old_name != name) continue;
    throw InputError("the method \"" + name + "\" is called " + renamed.name);
  }
  MethodType row = find_row("method", name, method_types());
  if (row.set_up) row.set_up(row);
  return std::make_shared<const MethodType>(std::move(row));
}

std::shared_ptr<const MethodType> find_default(Task task) {
  for (const MethodType& type : method_types()) {
    if (std::find(type.defaults.begin(), type.defaults.end(), task) != type.defaults.end()) {
      return keep(type);
    }
  }
  throw std::logic_error("a task without a default");
}

}  // namespace

Method::Method(Task task) : type_(find_default(task)) {}
Method::Method(const std::string& name) : type_(find_method(name)) {}

const std::string& Method::name() const { return type_->name; }

bool MethodType::can(Task task) const {
  switch (task) {
    case Task::kImage:
      return image.has_value();
    case Task::kGradient:
      return run != nullptr;
    case Task::kBackward:
    case Task::kFit:
      return reverse.has_value();
    case Task::kCompare:
      break;
  }
  return image || run;
}

const std::vector<MethodType>& method_types() {
  static const std::vector<MethodType> types = [] {
    std::vector<MethodType> all = term_methods();
    for (MethodType& row : other_methods()) all.push_back(std::move(row));
    for (MethodType& row : all) {
      if (row.set_up) row.set_up(row);
    }
    return all;
  }();
  return types;
}

std::vector<std::string> method_names(Task task) {
  std::vector<std::string> names;
  for (const MethodType& type : method_types()) {
    if (type.can(task)) names.push_back(type.name);
  }
  return names;
}

void check_task(const Method& method, Task task) {
  if (method->can(task)) return;
  throw InputError("the method \"" + method.name() + "\" is not available for " +
                   kTaskNames[static_cast<int>(task)] + " (" + known_names(method_names(task)) +
                   ")");
}

void refuse_differences(const Method& method) {
  if (!method->differs) return;
  throw InputError("the method \"" + method.name() +
                   "\" takes finite differences (or may), and a check would compare them with "
                   "themselves: choose another method, for example " +
                   Method(Task::kGradient).name());
}

void check_blur(const Blur& blur, const std::vector<Method>& methods) {
  if (blur.sigma == 0 && blur.gamma == 0) return;
  const auto blurs = [](const Method& method) { return method->blurs.has_value(); };
  if (std::ranges::any_of(methods, blurs)) return;
  throw InputError("sigma and gamma are for the methods blurred and blurred-published");
}

void check_warp(const WarpOptions& warp, const std::vector<Method>& methods) {
  if (warp.rays == WarpOptions{}.rays && warp.kappa == WarpOptions{}.kappa) return;
  std::vector<std::string> names, takers;
  for (const Method& method : methods) {
    if (method->warps) return;
    names.push_back(method.name());
  }
  for (const MethodType& type : method_types()) {
    if (type.warps) takers.push_back(type.name);
  }
  const std::string whose = names.size() > 1 ? "none of the methods " + join(names) + " has any"
                                             : "the method \"" + join(names) + "\" has none";
  throw InputError("auxiliary rays and their kernel (kappa) are for the method " + join(takers) +
                   ": " + whose);
}

}  // namespace limn
