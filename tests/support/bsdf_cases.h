#pragma once
// The BSDFs that every general test runs over.
#include <memory>
#include <string>
#include <vector>

#include "limn/core/bsdf.h"

namespace limn::test {

struct BsdfCase {
  std::string name;
  std::shared_ptr<Bsdf> bsdf;
  double alpha;  // width of the lobe; 1 if diffuse
  bool beckmann;
};

// A diffuse one, and GGX and Beckmann over five orders of roughness, reflecting everything
// (F = 1) or as copper.
inline std::vector<BsdfCase> bsdf_cases(bool copper) {
  std::vector<BsdfCase> cases;
  cases.push_back({"diffuse", make_diffuse(Rgb<double>{0.2, 0.5, 0.9}), 1, false});
  for (double alpha : {0.001, 0.01, 0.1, 0.5, 1.0}) {
    for (bool beckmann : {false, true}) {
      using Distribution = RoughConductorValues::Distribution;
      RoughConductorValues v;
      v.distribution = beckmann ? Distribution::kBeckmann : Distribution::kGgx;
      v.alpha = alpha;
      if (copper) {
        v.eta = {0.2010, 0.9237, 1.1022};
        v.k = {3.9133, 2.4530, 2.1421};
        v.specular_reflectance = Rgb<double>{0.9, 0.7, 0.8};
      }
      cases.push_back({(beckmann ? "beckmann " : "ggx ") + std::to_string(alpha),
                       make_roughconductor(v), alpha, beckmann});
    }
  }
  return cases;
}

// The unit vector at polar angle theta from unit n and azimuth phi (in some frame around n).
inline Vec3d around(const Vec3d& n, double theta, double phi) {
  return Frame(n).to_world(
      {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)});
}

}  // namespace limn::test
