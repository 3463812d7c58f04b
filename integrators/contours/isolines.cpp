// Lines through contours: azimuths of ends, crossings, their order.
#include "integrators/contours/isolines.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// The angle of (x, y) in turns, in [0, 1], to 1e-10 of a turn: a function of these two numbers
// alone, so that arcs that meet agree about their common end, and free of branches, so that many go
// at once.
double turns(double x, double y) {
  // atan(q) / (2 pi q) in q^2 up to 1, at Chebyshev's nodes.
  constexpr double kAtan[] = {0x1.45f306da80e40p-3,   -0x1.b2995638c2552p-5, 0x1.04c1129078b29p-5,
                              -0x1.7456f62a4f7bcp-6,  0x1.203ce68dcba0fp-6,  -0x1.cabbf29fc846ap-7,
                              0x1.5df1f4a0511e3p-7,   -0x1.cdca865df2f4ep-8, 0x1.cf2e4dc55986ap-9,
                              -0x1.2afbb62673c10p-10, 0x1.69f93323740e0p-13};
  const double ax = std::fabs(x), ay = std::fabs(y);
  const double large = ax > ay ? ax : ay, small = ax > ay ? ay : ax;
  const double q = large > 0 ? small / large : 0, q2 = q * q;
  double sum = kAtan[10];
  for (int i = 9; i >= 0; --i) sum = sum * q2 + kAtan[i];
  double turn = sum * q;
  turn = ax > ay ? turn : 0.25 - turn;
  turn = x < 0 ? 0.5 - turn : turn;
  return y < 0 ? 1 - turn : turn;
}

}  // namespace

AzimuthWarp::AzimuthWarp(std::span<const double> weights) {
  double sum = 0;
  for (const double w : weights) sum += w;
  const double count = static_cast<double>(weights.size());
  double before = 0;
  for (const double w : weights) {
    before_.push_back(before);
    densities_.push_back(sum > 0 ? 0.5 + 0.5 * w * count / sum : 1);
    before += densities_.back() / count;
  }
  before_.push_back(1);
}

double AzimuthWarp::share(double turn) const {
  const size_t i = part(turn);
  const double into = turn - static_cast<double>(i) / static_cast<double>(densities_.size());
  return std::fmin(before_[i] + into * densities_[i], before_[i + 1]);
}

double AzimuthWarp::turn(double share) const {
  const auto above = std::upper_bound(before_.begin() + 1, before_.end() - 1, share);
  const auto i = static_cast<size_t>(above - before_.begin()) - 1;
  return static_cast<double>(i) / static_cast<double>(densities_.size()) +
         (share - before_[i]) / densities_[i];
}

double Isolines::in_lines(double turn) const {
  return (pencil_.warp ? pencil_.warp->share(turn) : turn) * size() - offset_;
}

void Isolines::build(const Pencil& pencil, int count, double offset, const ContourPoint& at,
                     std::span<const ContourArc> arcs) {
  pencil_ = pencil;
  offset_ = offset;
  lines_.resize(count);
  cosines_.resize(count);
  sines_.resize(count);
  for (int j = 0; j < count; ++j) {
    const double share = (j + offset) / count;
    const double turn = pencil.warp ? pencil.warp->turn(share) : share;
    const double step = 2 * kPi / (count * (pencil.warp ? pencil.warp->density(turn) : 1));
    const double psi = 2 * kPi * turn;
    const double c = cosines_[j] = std::cos(psi), s = sines_[j] = std::sin(psi);
    const double x = pencil.su * c, y = pencil.sv * s, size2 = x * x + y * y;
    lines_[j] = {(pencil.u * x + pencil.v * y) / std::sqrt(size2),
                 step * pencil.su * pencil.sv / size2};
  }
  azimuths_.resize(2 * arcs.size());
  for (size_t i = 0; i < arcs.size(); ++i) {
    for (const bool end : {false, true}) {
      const Vec3d& w = end ? arcs[i].w1 : arcs[i].w0;
      azimuths_[2 * i + end] = turns(dot(pencil.u, w) * pencil.sv, dot(pencil.v, w) * pencil.su);
    }
  }
  found_.clear();
  for (size_t i = 0; i < arcs.size(); ++i) {
    cross(arcs[i], azimuths_[2 * i], azimuths_[2 * i + 1], at);
  }
  // By line, then outward.
  starts_.assign(count + 1, 0);
  for (const Found& f : found_) ++starts_[f.line + 1];
  for (int j = 0; j < count; ++j) starts_[j + 1] += starts_[j];
  sorted_.resize(found_.size());
  for (const Found& f : found_) sorted_[starts_[f.line]++] = {f.cot, f.change};
  for (int j = count; j > 0; --j) starts_[j] = starts_[j - 1];
  starts_[0] = 0;
  for (int j = 0; j < count; ++j) {
    std::sort(sorted_.begin() + starts_[j], sorted_.begin() + starts_[j + 1],
              [](const Crossing& a, const Crossing& b) {
                return a.cot > b.cot || (a.cot == b.cot && a.change < b.change);
              });
  }
}

// The arc runs the short way around the pole and meets the lines with numbers above the one end's
// and up to the other's.
void Isolines::cross(const ContourArc& arc, double turn0, double turn1, const ContourPoint& at) {
  const int count = size();
  double way = turn1 - turn0;
  if (way > 0.5) way -= 1;
  if (way < -0.5) way += 1;
  // Past the pole to rounding: on the side that a count of faces at the pole saw it.
  if (std::fabs(way) > 0.499999) {
    const double turned =
        side_of_edge(at.p + arc.w0, at.p + arc.w1, at.p, pencil_.pole) * std::fabs(way);
    if (turned * way < 0) way = turned > 0 ? way + 1 : way - 1;
  }
  if (way == 0) return;
  // What starts outward on the side s . pole > 0 ends on the other.
  const int change = way > 0 ? -arc.change : arc.change;
  const double from = way > 0 ? turn0 : turn1, to = way > 0 ? turn1 : turn0;
  const double first = in_lines(from), last = in_lines(to) + (to < from ? count : 0);
  if (std::floor(first) + 1 > last) return;
  const double a0 = dot(pencil_.pole, arc.w0), a1 = dot(pencil_.pole, arc.w1);
  const double x0 = dot(pencil_.u, arc.w0), x1 = dot(pencil_.u, arc.w1);
  const double y0 = dot(pencil_.v, arc.w0), y1 = dot(pencil_.v, arc.w1);
  for (int64_t k = static_cast<int64_t>(std::floor(first)) + 1; k <= last; ++k) {
    const auto line = static_cast<uint32_t>((k % count + count) % count);
    const Vec3d& r = lines_[line].r;
    const double c = cosines_[line] * pencil_.su, s = sines_[line] * pencil_.sv;
    const double m0 = c * y0 - s * x0, m1 = c * y1 - s * x1;
    const double t = m0 == m1 ? 0.5 : std::fmin(std::fmax(m0 / (m0 - m1), 0), 1);
    const double out = dot(r, arc.w0) * (1 - t) + dot(r, arc.w1) * t;
    const double up = a0 * (1 - t) + a1 * t;
    // At the pole itself or its opposite, to rounding.
    const double cot = out > 0 ? up / out : std::copysign(1e300, up);
    found_.push_back({line, change, cot});
  }
}

}  // namespace limn
