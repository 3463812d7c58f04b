// Rows of the table of options as options of a command.
#include "tools/limn/option_adder.h"

#include <fmt/format.h>

#include <cstdlib>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/integrators/methods.h"
#include "tools/limn/command_support.h"

namespace limn {

std::string help_of(const Option& option) {
  const std::string text =
      option.unset ? fmt::format("{} (default: {})", option.help, option.unset) : option.help;
  std::string help;
  for (size_t at = 0; at < text.size();) {
    const size_t begin = text.find('`', at), end = text.find('`', begin + 1);
    help += text.substr(at, begin - at);
    if (begin == text.npos) break;
    help += option_name(text.substr(begin + 1, end - begin - 1));
    at = end + 1;
  }
  return help;
}

std::string option_name(std::string field) {
  if (field == "auxiliary rays") return "--aux";
  if (field == "seconds") return "--time";
  std::replace(field.begin(), field.end(), '_', '-');
  return "--" + field;
}

CLI::Validator within(const Option& option) {
  return {[=](const std::string& text) {
            char* end = nullptr;
            const long double value = std::strtold(text.c_str(), &end);
            const bool number = !text.empty() && *end == 0;
            return range_error(text, number ? value : std::nanl(""), option);
          },
          range_text(option)};
}
CLI::Validator within(long double least, long double most) {
  return within(Option{"", "", least, most});
}

template <class T>
void OptionAdder::operator()(T& value, const Option& option) const {
  CLI::Option* added = app_.add_option(option_name(option.name), value, help_of(option));
  added->check(within(option));
  if (std::same_as<T, std::vector<int64_t>>) added->delimiter(',');
  if (option.type) added->type_name(option.type);
  if (std::is_arithmetic_v<T> && !option.unset) added->capture_default_str();
}
template void OptionAdder::operator()(int&, const Option&) const;
template void OptionAdder::operator()(double&, const Option&) const;
template void OptionAdder::operator()(std::optional<int>&, const Option&) const;
template void OptionAdder::operator()(std::optional<uint64_t>&, const Option&) const;
template void OptionAdder::operator()(std::vector<int64_t>&, const Option&) const;

void OptionAdder::operator()(std::vector<std::string>& terms, const Option& option) const {
  const std::string known = option.task == Task::kGradient
                                ? "among " + join(Method(option.task)->terms)
                                : "as in interior,camera";
  app_.add_option_function<std::string>(
          option_name(option.name),
          [&terms](const std::string& list) { terms = parse_terms(list); },
          "Terms to compute, " + known + " (default: all that the scene has)")
      ->type_name("A,B,...");
}

void OptionAdder::operator()(Method& method, const Option& option) const {
  const Task task = option.task;
  app_.add_option_function<std::string>(
          option_name(option.name),
          [&method, task](const std::string& name) {
            method = name;
            check_task(method, task);
          },
          "Method: " + join(method_names(task)) + "; settings follow a colon, as in " +
              (task == Task::kImage ? "lines:azimuths=uniform" : "forest:width=4") +
              " (limn methods --all)")
      ->default_str(Method(task).name())
      ->type_name("NAME");
  const std::string instead =
      task == Task::kImage ? "--generator sobol or independent" : "--method NAME";
  app_.add_option_function<std::string>(
          "--sampler",  // as it once was
          [instead](const std::string& value) {
            throw InputError("--sampler " + value + ": this option is now " + instead);
          })
      ->group("");  // not in the help
}

void OptionAdder::add_choice(const Option& option, const std::string& standard,
                             const std::function<void(const std::string&)>& set) const {
  std::string name = option_name(option.name);
  if (name == "--optimiser") name += ",--optimizer";
  app_.add_option_function<std::string>(name, set, help_of(option))
      ->type_name(fmt::format("{{{}}}", fmt::join(option.words, ",")))
      ->default_str(standard);
}

void refuse_options(const CLI::App& app, const std::vector<std::string>& names,
                    const std::string& why) {
  for (const std::string& name : names) {
    if (app.count(name) > 0) throw InputError(name + ": " + why);
  }
}

void check_image_options(const CLI::App& app, const std::vector<Method>& methods) {
  const auto any = [&](auto&& has) {
    return std::ranges::any_of(methods, [&](const Method& m) { return has(*m->image); });
  };
  if (!any([](const ImageMethod& image) { return image.by_lines; })) {
    refuse_options(app, {"--lines", "--tolerance"},
                   "an option of the methods silhouettes and lines alone");
  }
  const auto by_rays = [](const ImageMethod& image) {
    return image.looks_around && !image.by_lines && !image.make;
  };
  if (!any(by_rays)) refuse_options(app, {"--rays"}, "an option of the method rays alone");
}

}  // namespace limn
