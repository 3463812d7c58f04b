// The table of what comes near to types of Mitsuba's that limn lacks.
#include "limn/core/advice.h"

#include <algorithm>

#include "limn/core/names.h"

namespace limn {

namespace {

struct Advice {
  std::vector<std::string> types;
  const char* text;
};

const std::vector<Advice>& all_advice() {
  static const std::vector<Advice> all = {
      {{"catmullrom", "lanczos", "mitchell"},
       "filters with negative weights are not supported: use gaussian"},
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
