// Quadrature over the normals that are visible from a direction.
//
// The part that passes is the mean over visible normals h of (1 - F(v.h)) G1(t), t refracted at h,
// if it leaves on the other side; the reflected part that of F(v.h) G1(r). The mean is taken by
// Gauss and Legendre's rule over the two numbers that sample h: the integrand stays smooth.
#include "src/bsdf/rough_boundary.h"

#include <cmath>
#include <vector>

#include "src/bsdf/fresnel.h"

namespace limn {
namespace {

using microfacet::Distribution, microfacet::Facets;

// Nodes in [0, 1] and weights of sum 1, by Newton's method on Legendre's polynomial.
struct Rule {
  std::vector<double> nodes, weights;
  explicit Rule(int n) : nodes(n), weights(n) {
    for (int i = 0; i < n; ++i) {
      double x = std::cos(kPi * (i + 0.75) / (n + 0.5)), slope = 0;
      for (int step = 0; step < 8; ++step) {
        double p = 1, before = 0;
        for (int k = 1; k <= n; ++k) {
          const double next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
          before = p;
          p = next;
        }
        slope = n * (x * p - before) / (x * x - 1);
        x -= p / slope;
      }
      nodes[i] = 0.5 * (1 + x);
      weights[i] = 1 / ((1 - x * x) * slope * slope);
    }
  }
};

// Visible normals of v = (sine, 0, cosine), for numbers of a grid.
class VisibleNormals {
 public:
  // Both sides of the plane y = 0 are alike: `across` are nodes of one of them.
  VisibleNormals(Distribution distribution, double alpha, const Rule& rule, const Rule& half)
      : ggx_(distribution == Distribution::kGgx), alpha_(alpha), rule_(rule), half_(half) {
    for (const double u : half.nodes)
      slopes_.push_back(ggx_ ? 0 : microfacet::gaussian_slope(u / 2));
  }
  // Calls visit(h, weight), h of length 1; the weights' sum is 1.
  template <class Visit>
  void for_each(const Vec3d& v, const Visit& visit) const {
    const Vec3d stretched = normalize(Vec3d{alpha_ * v.x, 0, v.z});
    for (size_t i = 0; i < rule_.nodes.size(); ++i) {
      const double along =
          ggx_ ? 0 : microfacet::beckmann_slope(stretched.z, stretched.x, rule_.nodes[i]);
      for (size_t j = 0; j < half_.nodes.size(); ++j) {
        const Vec3d h =
            ggx_ ? microfacet::ggx_visible(v, alpha_, alpha_, half_.nodes[j] / 2, rule_.nodes[i])
                 : Vec3d{-alpha_ * along, -alpha_ * slopes_[j], 1};
        visit(normalize(h), rule_.weights[i] * half_.weights[j]);
      }
    }
  }

 private:
  bool ggx_;
  double alpha_;
  const Rule &rule_, &half_;
  std::vector<double> slopes_;
};

// So many nodes resolve the critical angle inside, where the integrand has a kink. Not tuned.
const Rule& rule_for(double eta, bool half) {
  static const Rule outside(32), outside_half(16), inside(64), inside_half(32);
  return eta > 1 ? (half ? outside_half : outside) : (half ? inside_half : inside);
}

// Masking of a direction, on either side.
double masking(const Facets<double>& facets, double cos_v) {
  return cos_v * facets.masking_over_cos({}, cos_v);
}

double transmitted(const Facets<double>& facets, const VisibleNormals& normals, const Vec3d& v,
                   double eta) {
  double sum = 0;
  normals.for_each(v, [&](const Vec3d& h, double weight) {
    const double cos_h = dot(v, h), cos2_t = 1 - (1 - cos_h * cos_h) / (eta * eta);
    if (!(cos_h > 0 && cos2_t > 0)) return;
    const double height = (v.z - h.z * cos_h) / eta + h.z * std::sqrt(cos2_t);
    if (!(height > 0)) return;
    sum +=
        weight * (1 - fresnel_dielectric<double>(cos_h, eta).reflected) * masking(facets, height);
  });
  return sum;
}

double reflected(const Facets<double>& facets, const VisibleNormals& normals, const Vec3d& v,
                 double eta) {
  double sum = 0;
  normals.for_each(v, [&](const Vec3d& h, double weight) {
    const double cos_h = dot(v, h), height = 2 * cos_h * h.z - v.z;
    if (!(cos_h > 0 && height > 0)) return;
    sum += weight * fresnel_dielectric<double>(cos_h, eta).reflected * masking(facets, height);
  });
  return sum;
}

}  // namespace

RoughBoundary::RoughBoundary(Distribution distribution, double alpha, double eta)
    : values_(table(distribution, alpha, eta)) {
  // Central differences. Inside, the critical angle crosses one cosine after another as eta grows,
  // and on smooth boundaries each makes a stair: the differences span exactly one. Slopes of inner
  // reflectances are then within 2 % of exact ones, for indices from 1.3 to 2.4.
  constexpr double kStep = 0.02;
  const double stair = eta > 1 ? eta * eta * std::sqrt(eta * eta - 1) / (kCosines - 1) : 0;
  const double step_eta = stair > 0 && stair < eta - 1 ? stair / 2 : kStep * eta;
  const auto slopes = [&](double by_alpha, double by_eta, double step) {
    const Table more = table(distribution, alpha + by_alpha, eta + by_eta);
    const Table less = table(distribution, alpha - by_alpha, eta - by_eta);
    Table slope;
    for (size_t i = 0; i < slope.size(); ++i) slope[i] = (more[i] - less[i]) / (2 * step);
    return slope;
  };
  by_alpha_ = slopes(kStep * alpha, 0, kStep * alpha);
  by_eta_ = slopes(0, step_eta, step_eta);
}

RoughBoundary::Table RoughBoundary::table(Distribution distribution, double alpha, double eta) {
  const Facets<double> facets{distribution, alpha};
  const VisibleNormals outside(distribution, alpha, rule_for(eta, false), rule_for(eta, true));
  const VisibleNormals inside(distribution, alpha, rule_for(1 / eta, false),
                              rule_for(1 / eta, true));
  Table table{};
  for (int i = 0; i < kCosines; ++i) {
    const double z = std::max(1e-6, i / (kCosines - 1.0));
    const Vec3d v{std::sqrt(1 - z * z), 0, z};
    table[i] = transmitted(facets, outside, v, eta);
    table[kCosines] += reflected(facets, inside, v, 1 / eta) * z * 2 / kCosines;
  }
  return table;
}

}  // namespace limn
