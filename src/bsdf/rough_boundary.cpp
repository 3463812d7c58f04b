// Quadrature over the normals that are visible from a direction.
//
// The part that passes is the mean over visible normals h of (1 - F(v.h)) G1(t), t refracted at h,
// if it leaves on the other side; the reflected part that of F(v.h) G1(r). The mean is taken by
// Gauss and Legendre's rule along and across lines of normals.
#include "src/bsdf/rough_boundary.h"

#include <algorithm>
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

// Visible normals of v = (sine, 0, cosine), along lines of normals.
class VisibleNormals {
 public:
  VisibleNormals(Distribution distribution, double alpha)
      : ggx_(distribution == Distribution::kGgx), alpha_(alpha) {}
  // Calls visit(h, weight), h of length 1; the weights' sum is 1. eta: of the Fresnel factor in
  // what is summed. It has a root at a critical angle, so that slopes of sums across it would be
  // noisy: lines are cut there, and nodes crowd at both ends of a piece.
  template <class Visit>
  void for_each(const Vec3d& v, double eta, const Visit& visit) const {
    static const Rule along(32), across(32);
    const double critical = eta < 1 ? std::sqrt(1 - eta * eta) : 0;
    for (size_t j = 0; j < across.nodes.size(); ++j) {
      const Line line(ggx_, alpha_, v, across.nodes[j]);
      const std::vector<double> ends =
          cuts([&](double u) { return dot(v, line.normal(u)) > critical; });
      for (size_t k = 0; k + 1 < ends.size(); ++k) {
        const double length = ends[k + 1] - ends[k];
        for (size_t i = 0; i < along.nodes.size(); ++i) {
          const double t = along.nodes[i], u = ends[k] + length * t * t * (3 - 2 * t);
          const double du = length * 6 * t * (1 - t) * along.weights[i];
          visit(line.normal(u), across.weights[j] * du * line.density(u));
        }
      }
    }
  }

 private:
  // Of normals: for GGX by one of its two numbers, for Beckmann by the slope towards v.
  class Line {
   public:
    // w: which line, from a number in [0, 1]. Both sides of the plane y = 0 are alike: of one.
    Line(bool ggx, double alpha, const Vec3d& v, double w)
        : ggx_(ggx), alpha_(alpha), v_(v), w_(w) {
      if (ggx) return;
      across_ = microfacet::gaussian_slope(w / 2);
      stretched_ = normalize(Vec3d{alpha * v.x, 0, v.z});
      const double s = stretched_.x, c = stretched_.z;
      most_ = c < kMost * s ? c / s : kMost;
      total_ = std::sqrt(kPi) * c * std::erfc(-most_) + s * std::exp(-most_ * most_);
    }
    // u in [0, 1].
    Vec3d normal(double u) const {
      return normalize(ggx_ ? microfacet::ggx_visible(v_, alpha_, alpha_, w_ / 2, u)
                            : Vec3d{-alpha_ * slope(u), -alpha_ * across_, 1});
    }
    // See beckmann_slope.
    double density(double u) const {
      if (ggx_) return 1;
      const double x = slope(u), facing = stretched_.z - x * stretched_.x;
      return 2 * (most_ + kMost) * facing * std::exp(-x * x) / total_;
    }

   private:
    static constexpr double kMost = 5;  // beyond: 1e-12 of all slopes
    double slope(double u) const { return u * (most_ + kMost) - kMost; }

    bool ggx_;
    double alpha_;
    Vec3d v_, stretched_;
    double w_, across_ = 0, most_ = 0, total_ = 1;
  };
  // 0, where in between `inside` changes, and 1.
  template <class Inside>
  static std::vector<double> cuts(const Inside& inside) {
    constexpr int kParts = 8;  // with at most one change each
    const auto place = [](int k) { return std::clamp(k / (1.0 * kParts), 1e-6, 1 - 1e-6); };
    std::vector<double> list{0};
    bool before = inside(place(0));
    for (int k = 1; k <= kParts; ++k) {
      const bool now = inside(place(k));
      if (now != before) {
        double a = place(k - 1), b = place(k);
        for (int step = 0; step < 30; ++step) {
          const double middle = 0.5 * (a + b);
          (inside(middle) == before ? a : b) = middle;
        }
        list.push_back(0.5 * (a + b));
      }
      before = now;
    }
    list.push_back(1);
    return list;
  }

  bool ggx_;
  double alpha_;
};

// Masking of a direction, on either side.
double masking(const Facets<double>& facets, double cos_v) {
  return cos_v * facets.masking_over_cos({}, cos_v);
}

double transmitted(const Facets<double>& facets, const VisibleNormals& normals, const Vec3d& v,
                   double eta) {
  double sum = 0;
  normals.for_each(v, eta, [&](const Vec3d& h, double weight) {
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
  normals.for_each(v, eta, [&](const Vec3d& h, double weight) {
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
  const VisibleNormals normals(distribution, alpha);
  Table table{};
  for (int i = 0; i < kCosines; ++i) {
    const double z = std::max(1e-6, i / (kCosines - 1.0));
    const Vec3d v{std::sqrt(1 - z * z), 0, z};
    table[i] = transmitted(facets, normals, v, eta);
    table[kCosines] += reflected(facets, normals, v, 1 / eta) * z * 2 / kCosines;
  }
  return table;
}

}  // namespace limn
