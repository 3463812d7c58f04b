// Lists of known names in messages, and what comes near to types of Mitsuba's that limn lacks.
#include "limn/core/names.h"

#include <algorithm>
#include <numeric>

namespace limn {
namespace {

// Levenshtein's.
size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i + 1;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

struct Advice {
  std::vector<std::string> types;
  const char* text;
};

const std::vector<Advice>& all_advice() {
  static const std::vector<Advice> all = {
      {{"circular", "measured_polarized", "polarizer", "retarder", "stokes"},
       "limn has no polarisation"},
      {{"constvolume", "gridvolume", "heterogeneous", "homogeneous", "medium", "volume"},
       "limn has no volumes"},
      {{"depth"}, "use path and render --what depth"},
      {{"directionalarea"},
       "use a directional emitter, and a screen with a hole of the shape's outline"},
      {{"merge"}, "put its shapes directly under <scene>"},
      {{"pplastic"}, "limn has no polarisation: roughplastic is similar"},
      {{"sdfgrid"}, "limn has no signed distances: extract a mesh"},
      {{"specfilm"}, "limn renders RGB: use hdrfilm"},
      {{"sunsky", "timed_sunsky"}, "use an envmap of the sky"},
  };
  return all;
}

}  // namespace

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string lower_case(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

std::string unknown_name(const std::string& what, const std::string& name,
                         const std::vector<std::string>& known) {
  return "unknown " + what + " \"" + name + "\" (" + known_names(known) + ")";
}

std::string known_names(const std::vector<std::string>& known, const std::string& none) {
  return known.empty() ? none : "known: " + join(known);
}

std::vector<std::string> nearest_names(const std::string& name, std::vector<std::string> known,
                                       size_t count) {
  std::stable_sort(known.begin(), known.end(), [&](const std::string& a, const std::string& b) {
    return edit_distance(name, a) < edit_distance(name, b);
  });
  known.resize(std::min(known.size(), count));
  return known;
}

std::string unknown_type(const std::string& tag, const std::string& name,
                         const std::vector<std::string>& known) {
  return unknown_name(tag + " type", name, known) + advice_on(name);
}

std::string advice_on(const std::string& type) {
  for (const Advice& advice : all_advice()) {
    if (std::find(advice.types.begin(), advice.types.end(), type) != advice.types.end()) {
      return std::string("; ") + advice.text;
    }
  }
  return "";
}

}  // namespace limn
