// What the rows of options allow.
#include "limn/integrators/options.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

#include "limn/core/error.h"
#include "limn/core/names.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

constexpr int kUnlimited = 1 << 30;  // samples per pixel

// Short where that is exact, as 1e+12; else with all digits, as the largest seed.
std::string bound_text(long double bound) {
  const std::string text = fmt::format("{:.10g}", bound);
  const bool exact = std::strtold(text.c_str(), nullptr) == bound || std::floor(bound) != bound;
  return exact ? text : fmt::format("{:.0f}", bound);
}

}  // namespace

size_t number_of(const Option& option, const std::string& word) {
  const auto found = std::find(option.words.begin(), option.words.end(), word);
  if (found == option.words.end()) {
    throw InputError(unknown_name(option.name, word, {option.words.begin(), option.words.end()}));
  }
  return static_cast<size_t>(found - option.words.begin());
}

std::string range_text(const Option& option) {
  return bound_text(option.least) + " to " + bound_text(option.most);
}

std::string range_error(const std::string& number, long double value, const Option& option) {
  // As doubles, which 0.1 is; seeds have more digits.
  const bool enough = static_cast<double>(value) >= static_cast<double>(option.least);
  if (enough && value <= option.most) return "";
  return number + " is not a number from " + range_text(option);
}

void CheckRange::operator()(double value, const Option& option) const {
  if (option.unset && value == 0) return;
  const std::string error = range_error(fmt::format("{:g}", value), value, option);
  if (!error.empty()) throw FieldError(option.name, error);
}

RunSettings settings_of(const RunRequest& request, const Scene& scene) {
  check_options(request);
  RunSettings settings;
  settings.spp = request.spp.value_or(scene.sample_count);
  settings.seed = request.seed.value_or(scene.seed);
  settings.threads = thread_count(request.threads);
  settings.store = request.store;
  if (request.seconds == 0) return settings;
  settings.seconds = request.seconds;
  settings.spp = request.spp.value_or(kUnlimited);
  settings.least_spp = 2;  // for standard errors
  return settings;
}

}  // namespace limn
