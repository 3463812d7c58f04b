// A pilot that holds lines and rays against each other.
//
// The variance of a point of the film is v_f, that of what points would see exactly, plus what its
// look around adds: v_l by lines, v_r / n by n rays. Of v_f what is linear over the pixel does not
// count: even points, two already, have little of it.
//
// Lines look from a point, its mirror image and the center of the pixel: of the square of the
// second difference a sixth is v_f + v_l. But much of v_f may be that of few points, at edges, and
// three that saw none of them mean little. Rays are cheap and tell it as well: of two looks from
// each of many points the covariance is v_f, half the squared difference v_r / n. So what rays know
// to be there is the least that lines can have.
#include "integrators/pilot/visibility_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "integrators/estimates/tiles.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

// The squared error of even points falls like this power of their number, and so of their time:
// that of a discontinuous function over a square.
constexpr double kEven = 1.5;
constexpr int kCell = 8;  // the side of a cell [pixels]; not tuned
// Rays of a look in the pilot; its points are as many as take the time of two looks by lines,
// within these. Not tuned.
constexpr int kPilotRays = 4;
constexpr double kPatchCost = 512;  // in place of that time where there are no lines
constexpr double kFewestPoints = 32, kMostPilotPoints = 1024;
constexpr std::array<int, 4> kRays = {1, 2, 4, 8};  // that a point may have
// Means are over windows of 5 by 5 and 9 by 9 cells: the few edges that make most of what a pilot
// by lines has not seen are mostly near others. With 3 by 3 cells single ones of sun.xml took
// lines, and with 10 times the standard error at the end doubled that of the image.
constexpr int kRadii[] = {2, 4};
constexpr double kWindow = 25;
constexpr double kSurely = 2;  // standard errors; not tuned
// Lines must be so much better: they can be worse than they look. Not tuned.
constexpr double kMargin = 1.5;
// Each cell has this part of the mean time of all at least: what a pilot has not seen may be there.
// Not tuned.
constexpr double kLeastTime = 0.25;
constexpr int kMostPoints = 256;  // not tuned
// See allocation.cpp.
constexpr double kRounding = 1.1;

double square(const Rgb<double>& x) { return x.r * x.r + x.g * x.g + x.b * x.b; }

// Of one point.
struct Figures {
  double lines = 0;            // v_f + v_l, as lines saw it
  double film = 0, error = 0;  // v_f, as rays saw it, and the square of its standard error
  double rays = 0;             // v_r
  double line_cost = 0;
  double point_cost = 0, ray_cost = 0;  // by rays: of a look without any, and of each
};

// What a cell takes: rays of each point (0: by lines), variance and cost of a point.
struct Choice {
  int rays = 0;
  double variance = 0, cost = 0;
  // Of the squared error after equal time.
  double product() const { return variance * std::pow(cost, kEven); }
};

// Two looks, a and b, from each of many points (x, y) of a pixel.
class Looks {
 public:
  void add(const VisibilityProbe& a, const VisibilityProbe& b) {
    const std::array<double, kSize> row = {a.x,       a.y,       a.value.r, a.value.g,
                                           a.value.b, b.value.r, b.value.g, b.value.b};
    ++count_;
    // Relative to the first point, so that little cancels.
    if (count_ == 1) first_ = row;
    for (int i = 0; i < kSize; ++i) {
      sums_[i] += row[i] - first_[i];
      for (int j = i; j < kSize; ++j) {
        products_[i][j] += (row[i] - first_[i]) * (row[j] - first_[j]);
      }
    }
  }
  // Of a and b, without what is linear in x and y. Looks are independent, so noise adds nothing.
  double curved_covariance() const {
    const double xx = covariance(0, 0), xy = covariance(0, 1), yy = covariance(1, 1);
    const double area = xx * yy - xy * xy;
    double sum = 0;
    for (int c = 2; c < 5; ++c) {
      sum += covariance(c, c + 3);
      if (!(area > 0)) continue;
      const double ax = covariance(0, c), ay = covariance(1, c);
      const double bx = covariance(0, c + 3), by = covariance(1, c + 3);
      sum -= (ax * bx * yy - (ax * by + ay * bx) * xy + ay * by * xx) / area;
    }
    return sum;
  }
  // Half the squared difference, the mean over the points (but for that of the means).
  double difference() const {
    double sum = 0;
    for (int c = 2; c < 5; ++c) {
      sum += covariance(c, c) + covariance(c + 3, c + 3) - 2 * covariance(c, c + 3);
    }
    return sum / 2;
  }

 private:
  static constexpr int kSize = 8;
  double covariance(int i, int j) const {
    return (products_[i][j] - sums_[i] * sums_[j] / count_) / (count_ - 1);
  }
  double count_ = 0;
  std::array<double, kSize> first_{}, sums_{};
  std::array<std::array<double, kSize>, kSize> products_{};  // i <= j
};

class Pilot {
 public:
  Pilot(const Film& film, std::span<const VisibilityPart> parts, const VisibilityProbing& probe)
      : film_(film), parts_(parts.begin(), parts.end()), probe_(probe) {
    const double pixels = static_cast<double>(film.crop_width) * film.crop_height;
    grid_ = PlanGrid(film, static_cast<size_t>(std::ceil(pixels / (kCell * kCell))));
    figures_.resize(grid_.size() * parts_.size());
  }

  void look(int threads, const std::atomic<bool>* interrupted) {
    std::vector<PixelSample> probes;
    for (int y = film_.crop_y; y < film_.crop_y + film_.crop_height; ++y) {
      for (int x = film_.crop_x; x < film_.crop_x + film_.crop_width; ++x) {
        if (grid_.is_probe(film_, x, y)) probes.push_back({x, y, 0});
      }
    }
    parallel_for(probes.size(), threads, [&](size_t i) {
      for (size_t part = 0; part < parts_.size(); ++part) {
        if (interrupted && interrupted->load(std::memory_order_relaxed)) return;
        figures(grid_.index(probes[i].x, probes[i].y), part) = look_at(probes[i], parts_[part]);
      }
    });
  }

  VisibilityPlan plan() {
    VisibilityPlan plan{parts_, grid_, {}};
    std::vector<Choice> choices(figures_.size());
    for (size_t part = 0; part < parts_.size(); ++part) {
      smooth(part);
      for (size_t i = 0; i < grid_.size(); ++i) {
        choices[i * parts_.size() + part] = choose(figures(i, part));
      }
    }
    for (const Choice& choice : choices) plan.looks.push_back({choice.rays, 1});
    spread(choices, plan.looks);
    return plan;
  }

 private:
  Figures& figures(size_t cell, size_t part) { return figures_[cell * parts_.size() + part]; }

  // As a run has it, where a sample that is not finite adds nothing: it must not become the mean of
  // all.
  VisibilityProbe probe(const PixelSample& at, VisibilityPart part, int rays, uint64_t number,
                        uint64_t replicate, double reach) const {
    VisibilityProbe result = probe_(at, part, rays, number, replicate, reach);
    if (!is_finite(result.value)) result.value = {};
    return result;
  }

  Figures look_at(const PixelSample& at, VisibilityPart part) const {
    Figures result;
    if (part == VisibilityPart::kPatches) {
      result.lines = std::numeric_limits<double>::infinity();
      result.line_cost = kPatchCost;
    } else {
      const VisibilityProbe a = probe(at, part, 0, 0, 0, -1), b = probe(at, part, 0, 0, 1, 0),
                            c = probe(at, part, 0, 0, 2, 1);
      result.lines = square(a.value + c.value - b.value * 2) / 6;
      result.line_cost = (a.cost + b.cost + c.cost) / 3;
    }
    Looks looks;
    double cost = 0, of_points = 0, count = 0, wanted = kFewestPoints;
    while (count < wanted) {
      const auto number = static_cast<uint64_t>(count++);
      const VisibilityProbe a = probe(at, part, kPilotRays, number, 0, 1);
      const VisibilityProbe b = probe(at, part, kPilotRays, number, 1, 1);
      looks.add(a, b);
      cost += (a.cost + b.cost) / 2;
      of_points += (a.point_cost + b.point_cost) / 2;
      if (count == kFewestPoints) {
        wanted = std::clamp(result.line_cost * count / cost, kFewestPoints, kMostPilotPoints);
      }
    }
    result.film = looks.curved_covariance();
    result.rays = kPilotRays * looks.difference();
    result.error = std::pow(looks.difference() + std::fmax(result.film, 0), 2) / count;
    result.point_cost = of_points / count;
    result.ray_cost = (cost - of_points) / count / kPilotRays;
    return result;
  }

  // Over a cell and its surroundings.
  void smooth(size_t part) {
    for (const auto member : {&Figures::lines, &Figures::film, &Figures::error, &Figures::rays,
                              &Figures::line_cost, &Figures::point_cost, &Figures::ray_cost}) {
      std::vector<double> values;
      for (size_t i = 0; i < grid_.size(); ++i) values.push_back(figures(i, part).*member);
      for (size_t i = 0; i < grid_.size(); ++i) figures(i, part).*member = 0;
      for (const int radius : kRadii) {
        const std::vector<double> means = window_means(grid_, values, radius);
        for (size_t i = 0; i < grid_.size(); ++i) {
          figures(i, part).*member += means[i] / std::size(kRadii);
        }
      }
    }
  }

  // f: means over cells.
  static Choice choose(const Figures& f) {
    const double film = std::fmax(f.film - kSurely * std::sqrt(f.error / kWindow), 0);
    Choice best;
    for (const int rays : kRays) {
      const Choice one{rays, film + f.rays / rays, f.point_cost + f.ray_cost * rays};
      if (best.rays == 0 || one.product() < best.product()) best = one;
    }
    const Choice lines{0, std::fmax(f.lines, film), f.line_cost};
    return kMargin * lines.product() < best.product() ? lines : best;
  }

  // After equal time the sum of variance / points^kEven is least where the time of a cell goes with
  // product^(1 / (1 + kEven)).
  static void spread(const std::vector<Choice>& of, std::vector<VisibilityLook>& looks) {
    double mean = 0;
    const auto time_of = [](const Choice& c) { return std::pow(c.product(), 1 / (1 + kEven)); };
    for (const Choice& c : of) mean += time_of(c) / static_cast<double>(of.size());
    if (!(mean > 0)) return;
    std::vector<double> shares;
    for (const Choice& c : of) {
      shares.push_back(std::fmax(time_of(c), kLeastTime * mean) / std::fmax(c.cost, 1));
    }
    const double largest = *std::max_element(shares.begin(), shares.end());
    const auto count = [&](size_t i, double scale) {
      return std::clamp(std::round(scale * shares[i]), 1.0, double{kMostPoints});
    };
    std::vector<double> scales, products;
    for (double most = 1; most <= kMostPoints; most *= std::sqrt(2.0)) {
      scales.push_back(most / largest);
      double error = 0, cost = 0;
      for (size_t i = 0; i < of.size(); ++i) {
        const double n = count(i, scales.back());
        error += of[i].variance / std::pow(n, kEven);
        cost += of[i].cost * n;
      }
      products.push_back(error * std::pow(cost, kEven));
    }
    const double least = *std::min_element(products.begin(), products.end());
    size_t k = 0;
    while (products[k] > kRounding * least) ++k;
    for (size_t i = 0; i < looks.size(); ++i) {
      looks[i].points = static_cast<int>(count(i, scales[k]));
    }
  }

  const Film& film_;
  std::vector<VisibilityPart> parts_;
  const VisibilityProbing& probe_;
  PlanGrid grid_;
  std::vector<Figures> figures_;
};

}  // namespace

VisibilityPlan plan_visibility(const Film& film, std::span<const VisibilityPart> parts, int threads,
                               const std::atomic<bool>* interrupted,
                               const VisibilityProbing& probe) {
  Pilot pilot(film, parts, probe);
  pilot.look(threads, interrupted);
  return pilot.plan();
}

}  // namespace limn
