// Fits linearly transformed cosines to the rough conductor's lobes and writes the table that
// edgetree/lobe/ltc.cpp compiles in:  fit_ltc OUTPUT.inc
//
// A lobe f (Smith's separable masking, F = 1, cosine included) is known by weighted directions: w_j
// from visible normals, with weights f / pdf = G1(w_j). The fit minimises the cross entropy
// -E_f[log g] of g = (1 - kLtcFloor) LTC + kLtcFloor cos / pi, which is what LtcLobe evaluates; it
// needs no grid on the sphere, so it works at any roughness. What it cannot follow costs variance,
// never bias.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "edgetree/lobe/ltc_table.h"
#include "src/bsdf/microfacet.h"

namespace limn {
namespace {

struct WeightedDirection {
  Vec3d w;        // frame of the normal, +x towards the viewer
  double weight;  // f / (norm * pdf), mean 1
  double f;       // normalised lobe [1/sr]
};

struct SampledLobe {
  std::vector<WeightedDirection> directions;
  double norm = 0;  // integral of f
  double alpha, cos_i, sin_i;
};

// R2 sequence (Roberts 2018), n points: every fit sees the same ones.
constexpr int kPoints = 4096;
constexpr double kR2[2] = {0.7548776662466927, 0.5698402909980532};

SampledLobe sample_lobe(bool ggx, double alpha, double cos_i) {
  SampledLobe lobe{{}, 0, alpha, cos_i, std::sqrt(std::max(0.0, 1 - cos_i * cos_i))};
  const Vec3d v{lobe.sin_i, 0, cos_i};
  const auto g1 = [&](double c) {
    return c * (ggx ? microfacet::ggx_g1_over_cos(c, alpha)
                    : microfacet::beckmann_g1_over_cos(c, alpha));
  };
  for (int i = 0; i < kPoints; ++i) {
    const double u1 = std::fmod((i + 0.5) * kR2[0], 1.0), u2 = std::fmod((i + 0.5) * kR2[1], 1.0);
    const Vec3d h = normalize(ggx ? microfacet::ggx_visible(v, alpha, alpha, u1, u2)
                                  : microfacet::beckmann_visible(v, alpha, alpha, u1, u2));
    const Vec3d w = normalize(h * (2 * dot(v, h)) - v);
    if (!(w.z > 0)) continue;
    const double cos2 = h.z * h.z, sin2 = h.x * h.x + h.y * h.y;
    const double d =
        ggx ? microfacet::ggx_d(cos2, sin2, alpha) : microfacet::beckmann_d(cos2, sin2, alpha);
    const double masking = g1(w.z);
    lobe.directions.push_back({w, masking, 0.25 * d * g1(cos_i) / cos_i * masking});
    lobe.norm += masking / kPoints;
  }
  for (WeightedDirection& s : lobe.directions) {
    s.weight /= lobe.norm * kPoints;
    s.f /= lobe.norm;
  }
  return lobe;
}

// The density of the transformed cosine in the frame of the normal.
class Transformed {
 public:
  Transformed(const SampledLobe& lobe, const LtcShape& shape)
      : shape_(shape),
        cos_(lobe.cos_i * std::cos(shape.tilt) - lobe.sin_i * std::sin(shape.tilt)),
        sin_(lobe.sin_i * std::cos(shape.tilt) + lobe.cos_i * std::sin(shape.tilt)) {}
  double density(const Vec3d& w) const {
    const double z = cos_ * w.z - sin_ * w.x;
    if (z <= 0) return 0;
    const double x = (-cos_ * w.x - sin_ * w.z - shape_.skew * z) / shape_.width_x;
    const double y = w.y / shape_.width_y;
    const double r2 = x * x + y * y + z * z;
    return z / (kPi * shape_.width_x * shape_.width_y * r2 * r2);
  }

 private:
  LtcShape shape_;
  double cos_, sin_;
};

double cross_entropy(const SampledLobe& lobe, const LtcShape& shape) {
  const Transformed ltc(lobe, shape);
  double sum = 0;
  for (const WeightedDirection& s : lobe.directions) {
    sum -= s.weight * std::log((1 - kLtcFloor) * ltc.density(s.w) + kLtcFloor * s.w.z / kPi);
  }
  return sum;
}

// L1 distance of the normalised lobes, 2 E_f[max(0, 1 - g / f)], and the second moment E_g[(f /
// g)^2] of importance sampling with the mixture.
struct Quality {
  double l1 = 0, l1_mixture = 0, second_moment = 0;
};

Quality quality(const SampledLobe& lobe, const LtcShape& shape) {
  const Transformed ltc(lobe, shape);
  Quality q;
  for (const WeightedDirection& s : lobe.directions) {
    const double g = ltc.density(s.w);
    const double mixture = (1 - kLtcFloor) * g + kLtcFloor * s.w.z / kPi;
    q.l1 += 2 * s.weight * std::max(0.0, 1 - g / s.f);
    q.l1_mixture += 2 * s.weight * std::max(0.0, 1 - mixture / s.f);
    q.second_moment += s.weight * s.f / mixture;
  }
  return q;
}

using Point = std::array<double, 4>;

// Nelder and Mead 1965, with the usual coefficients, until the simplex' values agree to 1e-9.
template <class F>
Point minimise(F f, const Point& start, double step) {
  constexpr int n = 4;
  std::array<std::pair<double, Point>, n + 1> simplex;
  for (int i = 0; i <= n; ++i) {
    Point p = start;
    if (i > 0) p[i - 1] += step;
    simplex[i] = {f(p), p};
  }
  for (int iteration = 0; iteration < 400; ++iteration) {
    std::sort(simplex.begin(), simplex.end());
    if (simplex[n].first - simplex[0].first < 1e-9) break;
    const auto along = [&](double factor) {
      Point p{};
      for (int k = 0; k < n; ++k) {
        double mean = 0;
        for (int i = 0; i < n; ++i) mean += simplex[i].second[k] / n;
        p[k] = mean + factor * (simplex[n].second[k] - mean);
      }
      return std::pair<double, Point>{f(p), p};
    };
    auto next = along(-1);
    if (next.first < simplex[0].first) {
      next = std::min(next, along(-2));
    } else if (next.first >= simplex[n - 1].first) {
      next = std::min(along(next.first < simplex[n].first ? -0.5 : 0.5), next);
    }
    if (next.first < simplex[n].first) {
      simplex[n] = next;
      continue;
    }
    for (int i = 1; i <= n; ++i) {
      for (int k = 0; k < n; ++k) {
        simplex[i].second[k] = 0.5 * (simplex[i].second[k] + simplex[0].second[k]);
      }
      simplex[i].first = f(simplex[i].second);
    }
  }
  return std::min_element(simplex.begin(), simplex.end())->second;
}

// Entries are what the table stores; widths enter the search by their logarithms.
LtcEntry entry_of(const Point& p, double norm) {
  return {static_cast<float>(p[0]), static_cast<float>(std::exp(p[1])),
          static_cast<float>(std::exp(p[2])), static_cast<float>(p[3]), static_cast<float>(norm)};
}

// In a narrow lobe tilt and skew do the same: a small weight on the skew makes the choice unique.
constexpr double kSkewPenalty = 1e-4;

Point fit(const SampledLobe& lobe, const Point& start) {
  const bool symmetric = lobe.sin_i == 0;
  const auto objective = [&](Point p) {
    if (symmetric) p = {0, p[1], p[1], 0};
    const LtcEntry entry = entry_of(p, 1);
    return cross_entropy(lobe, scaled(entry, lobe.alpha, lobe.cos_i)) + kSkewPenalty * p[3] * p[3];
  };
  Point p = minimise(objective, minimise(objective, start, 0.2), 0.05);
  if (symmetric) p = {0, p[1], p[1], 0};
  return p;
}

struct Report {
  Quality worst, mean;
  int count = 0;
  void add(const Quality& q) {
    worst.l1 = std::max(worst.l1, q.l1);
    worst.l1_mixture = std::max(worst.l1_mixture, q.l1_mixture);
    worst.second_moment = std::max(worst.second_moment, q.second_moment);
    mean.l1 += q.l1;
    mean.l1_mixture += q.l1_mixture;
    mean.second_moment += q.second_moment;
    ++count;
  }
  void print(const std::string& name) const {
    fmt::print(
        "{}: L1 mean {:.3f} worst {:.3f}; with floor mean {:.3f} worst {:.3f}; second moment mean "
        "{:.3f} worst {:.3f}\n",
        name, mean.l1 / count, worst.l1, mean.l1_mixture / count, worst.l1_mixture,
        mean.second_moment / count, worst.second_moment);
  }
};

struct Table {
  std::vector<LtcEntry> entries;
  double worst = 0;  // L1 distance over entries and middles of cells
};

Table fit_table(bool ggx) {
  std::vector<LtcEntry> table(kLtcSize * kLtcSize);
  Report report;
  std::array<Point, kLtcSize> row;
  row.fill({0, std::log(2.0), std::log(2.0), 0});
  for (int a = 0; a < kLtcSize; ++a) {
    const double alpha = ltc_alpha(a / (kLtcSize - 1.0));
    for (int c = kLtcSize - 1; c >= 0; --c) {
      const SampledLobe lobe = sample_lobe(ggx, alpha, ltc_cosine(c / (kLtcSize - 1.0), alpha));
      const Point& start = a == 0 && c + 1 < kLtcSize ? row[c + 1] : row[c];
      row[c] = fit(lobe, start);
      const LtcEntry entry = entry_of(row[c], lobe.norm);
      table[a * kLtcSize + c] = entry;
      report.add(quality(lobe, scaled(entry, alpha, lobe.cos_i)));
    }
  }
  report.print(ggx ? "ggx, nodes" : "beckmann, nodes");
  return {table, report.worst.l1};
}

// The interpolated table at the middle of every cell, where it is worst.
void add_cells(bool ggx, Table& table) {
  Report all;
  for (int a = 0; a + 1 < kLtcSize; ++a) {
    Report row;
    const double alpha = ltc_alpha((a + 0.5) / (kLtcSize - 1));
    for (int c = 0; c + 1 < kLtcSize; ++c) {
      const double cos_i = ltc_cosine((c + 0.5) / (kLtcSize - 1), alpha);
      const SampledLobe lobe = sample_lobe(ggx, alpha, cos_i);
      const Quality q =
          quality(lobe, scaled(interpolate(table.entries.data(), alpha, cos_i), alpha, cos_i));
      row.add(q);
      all.add(q);
    }
    if (a % 4 == 0) row.print(fmt::format("  alpha {:.4f}", alpha));
  }
  all.print(ggx ? "ggx, middles of cells" : "beckmann, middles of cells");
  table.worst = std::max(table.worst, all.worst.l1);
}

void write_table(std::FILE* file, const char* name, const Table& table) {
  fmt::print(file, "constexpr double kLtcWorst{} = {:.3f};\n", name, table.worst);
  fmt::print(file, "constexpr LtcEntry k{}Table[kLtcSize * kLtcSize] = {{\n", name);
  for (size_t i = 0; i < table.entries.size(); ++i) {
    const LtcEntry& e = table.entries[i];
    fmt::print(file, "{{{:.4g}, {:.4g}, {:.4g}, {:.4g}, {:.4g}}},{}", e.tilt, e.width_x, e.width_y,
               e.skew, e.norm, i % 2 == 1 ? "\n" : " ");
  }
  fmt::print(file, "}};\n");
}

}  // namespace
}  // namespace limn

int main(int argc, char** argv) {
  using namespace limn;
  if (argc != 2) {
    fmt::print(stderr, "usage: fit_ltc OUTPUT.inc\n");
    return 2;
  }
  Table ggx = fit_table(true), beckmann = fit_table(false);
  add_cells(true, ggx);
  add_cells(false, beckmann);
  std::FILE* file = std::fopen(argv[1], "w");
  if (!file) {
    fmt::print(stderr, "error: cannot write {}\n", argv[1]);
    return 1;
  }
  fmt::print(
      file,
      "// Written by tools/fit_ltc/fit_ltc.cpp; meaning in ltc_table.h. kLtcWorst...: the largest "
      "L1 "
      "distance of\n"
      "// normalised lobe and LTC over entries and middles of cells.\n// clang-format off\n");
  write_table(file, "Ggx", ggx);
  write_table(file, "Beckmann", beckmann);
  return std::fclose(file) == 0 ? 0 : 1;
}
