// Arguments of Python's functions.
#include "tools/python/arguments.h"

#include <fmt/format.h>

#include <algorithm>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/methods.h"

namespace limn::python {

namespace {

std::string quoted(const std::string& word) { return "'" + word + "'"; }

// What to write in place of arguments that other programs have; "" of others.
std::string advice_on_argument(const std::string& name, const std::vector<std::string>& known) {
  if (name == "sensor") return "use scene.view(sensor)";
  if (name == "integrator") {
    return "the scene has it, as \"integrator\": {\"type\": \"path\", \"max_depth\": 8}";
  }
  const bool steps = std::find(known.begin(), known.end(), "step") != known.end();
  if (!steps || (name != "lr" && name != "learning_rate")) return "";
  return "use step, in natural steps: step=5 is about 5 % of a value";
}

}  // namespace

void Arguments::add_row(const Option& option, const char* type, std::string standard,
                        std::function<void(nb::handle)> set) {
  const char* name = option.flag ? option.flag : option.name;
  if (option.of_samples) of_samples_.emplace_back(name);
  std::string help = option.help;
  if (option.unset) help += fmt::format("; 0: {}", option.unset);
  if (option.least < option.most && option.most < 1e15) help += " (" + range_text(option) + ")";
  help += ".";
  add({name, type, std::move(standard), std::move(help), std::move(set)});
}

void Arguments::operator()(Method& method, const Option& option) {
  const std::string help = "Method: " + join(method_names(option.task)) +
                           "; settings follow a colon, as in \"forest:width=4\"";
  Option row = option;
  row.help = help.c_str();
  add_row(row, "str", quoted(method.name()), [&method, task = option.task](nb::handle given) {
    method = nb::cast<std::string>(given);
    check_task(method, task);
  });
}
void Arguments::add_choice(const Option& option, const std::string& standard,
                           std::function<void(nb::handle)> set) {
  if (option.flag) {
    const bool on = standard == option.words[1];
    return add_row(option, "bool", on ? "True" : "False", std::move(set));
  }
  add_row(option, "str", quoted(standard), std::move(set));
}

void Arguments::add_former(const char* name, const char* instead) {
  add({name, "object", "None", "",
       [=](nb::handle given) {
         if (given.is_none()) return;
         throw InputError(fmt::format("{}: this argument is now {}", name, instead));
       },
       true});
}

std::string Arguments::list() const {
  std::string text;
  for (size_t i = 0; i < list_.size(); ++i) {
    const Argument& a = list_[i];
    if (a.hidden) continue;
    if (i == positional_) text += ", *";
    text += fmt::format("{}{}: {}", i > 0 ? ", " : "", a.name, a.type);
    if (!a.standard.empty()) text += " = " + a.standard;
  }
  return text;
}

std::string Arguments::documentation() const {
  std::string text;
  for (const Argument& a : list_) {
    if (!a.hidden && !a.help.empty()) text += fmt::format("{}: {}\n", a.name, a.help);
  }
  return text;
}

void Arguments::set(Argument& argument, nb::handle value) const {
  if (argument.given) {
    throw nb::type_error(
        fmt::format("{}() got two values for '{}'", function_, argument.name).c_str());
  }
  argument.given = true;
  try {
    argument.set(value);
  } catch (const nb::cast_error&) {
    std::string wrong = nb::type_name(value.type()).c_str();
    if (wrong == "int" && argument.type.starts_with("int")) {
      wrong = nb::cast<std::string>(nb::str(value));
      if (wrong.starts_with("-")) wrong += ": from 0 on";
    }
    throw nb::type_error(
        fmt::format("{}(): {} must be {}, not {}", function_, argument.name, argument.type, wrong)
            .c_str());
  }
}

void Arguments::read(const nb::args& positional, const nb::kwargs& named) {
  if (positional.size() > positional_) {
    throw nb::type_error(fmt::format("{}() takes {} arguments by their places, {} are given",
                                     function_, positional_, positional.size())
                             .c_str());
  }
  for (size_t i = 0; i < positional.size(); ++i) set(list_[i], positional[i]);
  for (const auto& [key, value] : named) {
    const auto name = nb::cast<std::string>(key);
    const auto found =
        std::find_if(list_.begin(), list_.end(), [&](const Argument& a) { return a.name == name; });
    if (found == list_.end()) {
      std::vector<std::string> known;
      for (const Argument& a : list_) {
        if (!a.hidden) known.push_back(a.name);
      }
      std::string advice = advice_on_argument(name, known);
      if (advice.empty()) advice = "nearest: " + join(nearest_names(name, known, 3));
      throw nb::type_error(
          fmt::format("{}() has no argument '{}' ({})", function_, name, advice).c_str());
    }
    set(*found, value);
  }
  for (const Argument& a : list_) {
    if (a.given || !a.standard.empty()) continue;
    throw nb::type_error(fmt::format("{}() needs the argument '{}'", function_, a.name).c_str());
  }
}

void Arguments::refuse_samples(FilmPoints points, const std::vector<std::string>& names) const {
  if (points == FilmPoints::kRandom) return;
  for (const Argument& a : list_) {
    const auto is = [&](const std::string& name) { return name == a.name; };
    if (!a.given || (std::none_of(of_samples_.begin(), of_samples_.end(), is) &&
                     std::none_of(names.begin(), names.end(), is))) {
      continue;
    }
    throw InputError(fmt::format("{}: points \"{}\" take no samples", a.name, name_of(points)));
  }
}

void add_scene(Arguments& arguments, const SceneHandle*& scene) {
  arguments.add({"scene", "Scene", "", "",
                 [&scene](nb::handle given) { scene = &nb::cast<const SceneHandle&>(given); }});
}

void add_store(Arguments& arguments, RunRequest& run) {
  arguments.add({"_store", "object", "None", "",
                 [&run](nb::handle given) {
                   run.store = given.is_none() ? nullptr : nb::cast<BatchStore*>(given);
                 },
                 true});
}

void add_run(Arguments& arguments, RunRequest& run, nb::object& progress, bool seconds) {
  visit_options(run, all_but({"threads", "seconds"}, arguments));
  arguments.end_positional();
  visit_options(run, all_but({"spp", "seed", seconds ? "" : "seconds"}, arguments));
  arguments.add("progress", "collections.abc.Callable[[float], object] | None", "None", progress,
                "called with the fraction done. Ctrl-C raises KeyboardInterrupt.");
}

}  // namespace limn::python
