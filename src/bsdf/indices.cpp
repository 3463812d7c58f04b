// Named indices of refraction.
#include "src/bsdf/indices.h"

#include <fmt/format.h>

#include <cmath>

#include "limn/core/names.h"

namespace limn {
namespace {

struct Metal {
  const char* name;
  Rgb<double> eta, k;
};

// Mitsuba's spectra integrated against the CIE 1931 observer without an illuminant, per channel.
// The data of AlSb end at 590 nm: its red, where both are 0, has a k that reflects everything.
constexpr Metal kMetals[] = {
    {"a-C", {2.94405, 2.22714, 1.96816}, {0.887465, 0.799299, 0.81529}},
    {"Ag", {0.155276, 0.116728, 0.138388}, {4.82835, 3.12222, 2.1469}},
    {"Al", {1.6575, 0.880405, 0.521244}, {9.22381, 6.2695, 4.837}},
    {"AlAs", {3.6053, 3.23294, 2.21632}, {0.000679437, 0, 0.00751271}},
    {"AlSb", {0, 4.13937, 4.66925}, {0.001, 0.0940091, 1.30057}},
    {"Au", {0.143036, 0.375307, 1.44205}, {3.983, 2.38556, 1.60336}},
    {"Be", {4.18501, 3.18503, 2.78406}, {3.83547, 3.01012, 2.86899}},
    {"Cr", {4.36967, 2.91651, 1.6549}, {5.20655, 4.23131, 3.7547}},
    {"CsI", {2.1449, 1.70232, 1.66243}, {0, 0, 0}},
    {"Cu", {0.201005, 0.92375, 1.10222}, {3.91326, 2.45305, 2.14209}},
    {"Cu2O", {3.55177, 2.94987, 2.75188}, {0.114207, 0.193897, 0.606134}},
    {"Cu_palik", {0.213229, 0.919715, 1.10241}, {3.92187, 2.45733, 2.13658}},
    {"CuO", {3.24754, 2.44781, 2.21022}, {0.52109, 0.570031, 0.722179}},
    {"d-C", {2.70872, 2.31883, 2.2289}, {0, 0, 0}},
    {"Hg", {2.39894, 1.44003, 0.90957}, {6.32759, 4.37192, 3.42176}},
    {"HgTe", {4.77904, 3.2312, 2.6599}, {1.63161, 1.58081, 1.72929}},
    {"Ir", {3.0863, 2.08219, 1.61791}, {5.59215, 4.06709, 3.26731}},
    {"K", {0.0640432, 0.0464098, 0.0381849}, {2.1042, 1.34894, 0.913126}},
    {"Li", {0.265791, 0.195618, 0.220949}, {3.54015, 2.31112, 1.66861}},
    {"MgO", {2.08958, 1.65072, 1.59488}, {0, 0, 0}},
    {"Mo", {4.48397, 3.52513, 2.77631}, {4.11144, 3.42083, 3.15061}},
    {"Na_palik", {0.0602694, 0.0561409, 0.0619884}, {3.17927, 2.11249, 1.57904}},
    {"Nb", {3.42007, 2.79009, 2.39563}, {3.44139, 2.73767, 2.57975}},
    {"Ni_palik", {2.3673, 1.66337, 1.46708}, {4.49881, 3.05015, 2.34544}},
    {"Rh", {2.58579, 1.86022, 1.55426}, {6.78226, 4.70299, 3.97607}},
    {"Se", {4.05831, 2.84293, 2.82085}, {0.75405, 0.638444, 0.521807}},
    {"Se-e", {5.72285, 4.16574, 4.08134}, {0.871136, 1.10516, 1.56532}},
    {"SiC", {3.17234, 2.52597, 2.47937}, {7.53766e-07, 0, 1.01925e-05}},
    {"SnTe", {4.52425, 1.98164, 1.28159}, {0, 0, 0}},
    {"Ta", {2.06272, 2.39294, 2.62793}, {2.40836, 1.74149, 1.94703}},
    {"Te", {7.39023, 4.4821, 2.63711}, {3.25602, 3.52706, 3.29205}},
    {"Te-e", {7.50891, 4.29643, 2.36999}, {5.58393, 4.9472, 3.99759}},
    {"ThF4", {1.83071, 1.44223, 1.38765}, {0, 0, 0}},
    {"TiC", {3.70053, 2.83742, 2.58229}, {3.26564, 2.35159, 2.17279}},
    {"TiN", {1.64845, 1.15052, 1.37982}, {3.36833, 1.9435, 1.10207}},
    {"TiO2", {3.45661, 2.80174, 2.90517}, {0.000105265, 0, 0.000652886}},
    {"TiO2-e", {3.10656, 2.51317, 2.58244}, {2.97516e-05, 0, 0.000182698}},
    {"V_palik", {4.27758, 3.51295, 2.76107}, {3.4913, 2.88945, 3.11152}},
    {"VC", {3.65757, 2.75274, 2.53267}, {3.0683, 2.19869, 1.96319}},
    {"VN", {2.8656, 2.11919, 1.94009}, {3.03224, 2.05612, 1.61631}},
    {"W", {4.37082, 3.30025, 2.99841}, {3.50064, 2.60487, 2.27323}},
};

// Names with this suffix repeat the base, but for those in the table. These have no such name.
constexpr const char* kPalik = "_palik";
constexpr const char* kWithoutPalik[] = {"a-C", "Ag", "Al", "Au", "Cr", "W"};

struct Dielectric {
  const char* name;
  double ior;
};
constexpr Dielectric kDielectrics[] = {
    {"acetone", 1.36},
    {"acrylic glass", 1.49},
    {"air", 1.000277},
    {"amber", 1.55},
    {"benzene", 1.501},
    {"bk7", 1.5046},
    {"bromine", 1.661},
    {"carbon dioxide", 1.00045},
    {"carbon tetrachloride", 1.461},
    {"diamond", 2.419},
    {"ethanol", 1.361},
    {"fused quartz", 1.458},
    {"glycerol", 1.4729},
    {"helium", 1.000036},
    {"hydrogen", 1.000132},
    {"pet", 1.575},
    {"polypropylene", 1.49},
    {"pyrex", 1.47},
    {"silicone oil", 1.52045},
    {"sodium chloride", 1.544},
    {"vacuum", 1.0},
    {"water", 1.333},
    {"water ice", 1.31},
};

const Metal* find_metal(const std::string& name) {
  for (const Metal& metal : kMetals) {
    if (name == metal.name) return &metal;
  }
  if (!name.ends_with(kPalik)) return nullptr;
  const std::string base = name.substr(0, name.size() - std::string(kPalik).size());
  for (const char* without : kWithoutPalik) {
    if (base == without) return nullptr;
  }
  return base.ends_with(kPalik) ? nullptr : find_metal(base);
}

}  // namespace

std::optional<double> named_ior(const std::string& name) {
  const std::string word = lower_case(name);
  for (const Dielectric& dielectric : kDielectrics) {
    if (word == dielectric.name) return dielectric.ior;
  }
  return std::nullopt;
}

double read_ior(Properties& properties, const char* property, const std::string& absent) {
  if (properties.has(property) && !properties.has_text(property)) {
    const double ior = properties.number(property, 1);
    if (!(ior > 0)) properties.fail(property, "an index of refraction must be positive");
    return ior;
  }
  const std::string name = properties.string(property, absent);
  const std::optional<double> ior = named_ior(name);
  if (!ior) properties.fail(property, unknown_name("medium", name, names_of(kDielectrics)));
  return *ior;
}

double read_relative_ior(Properties& properties, const std::string& inside) {
  const double ior =
      read_ior(properties, "int_ior", inside) / read_ior(properties, "ext_ior", "air");
  if (!(ior >= kLeastIor && ior <= kMostIor)) {
    properties.fail("int_ior", fmt::format("int_ior / ext_ior is {:g}: it must lie in [{:g}, {:g}]",
                                           ior, kLeastIor, kMostIor));
  }
  return ior;
}

ConductorIndices read_conductor_indices(Properties& properties) {
  const std::string name = properties.string("material", "none");
  ConductorIndices read{properties.rgb("eta", grey(0.0)), properties.rgb("k", grey(1.0))};
  const double outside = read_ior(properties, "ext_eta", "vacuum");  // of formats before 2.0.0
  if (name == "none") {
    for (int i = 0; i < 3; ++i) {
      // Colours of spectra may be negative. Reflectances depend on squares alone.
      read.eta[i] = std::fabs(read.eta[i]) / outside;
      read.k[i] = std::fabs(read.k[i]) / outside;
      if (read.eta[i] == 0 && read.k[i] == 0) {
        properties.fail("k", "eta and k are both 0 in a channel");
      }
    }
    return read;
  }
  if (properties.has("eta") || properties.has("k")) {
    properties.fail("material", "give either a material or (eta, k), not both");
  }
  if (const Metal* metal = find_metal(name))
    return {metal->eta * (1 / outside), metal->k * (1 / outside)};
  std::vector<std::string> known = names_of(kMetals);
  known.insert(known.begin(), "none");
  properties.fail("material", unknown_name("material", name, known));
}

}  // namespace limn
