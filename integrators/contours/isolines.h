#pragma once
// Visibility along lines: half great circles from a pole, cut where contours cross them.
//
//   w(theta) = pole cos theta + r sin theta,   r of unit length, across the pole,
//
// at N azimuths. On each of them W (contours.h) starts as it is at the pole and changes by a known
// number at every crossing; the sky is open where it is zero. Places on a line are given by
// cot theta = (pole . w) / (r . w), which falls from infinity to -infinity and needs no root.
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "integrators/contours/contours.h"

namespace limn {

// Azimuths spread by a density that is constant over equal parts of a turn.
class AzimuthWarp {
 public:
  // weights: of each part, not negative; half of the density goes by them, half is uniform
  // (not tuned).
  explicit AzimuthWarp(std::span<const double> weights);
  // The share of the density before an azimuth [turns, 0 to 1]; its inverse; the density there.
  double share(double turn) const;
  double turn(double share) const;
  double density(double turn) const { return densities_[part(turn)]; }

 private:
  size_t part(double turn) const {
    const auto i = static_cast<size_t>(turn * static_cast<double>(densities_.size()));
    return i < densities_.size() ? i : densities_.size() - 1;
  }
  std::vector<double> densities_, before_;
};

// The pole, and how azimuths are spread: psi in [0, 1) turns stands for the direction of
// u su cos psi + v sv sin psi, so that lines are dense where a long region of directions ends far
// from the pole. Unit vectors, right-handed: u x v = pole.
struct Pencil {
  Vec3d pole, u, v;
  double su = 1, sv = 1;
  const AzimuthWarp* warp = nullptr;  // of psi; null: none
};

class Isolines {
 public:
  struct Line {
    Vec3d r;        // unit
    double weight;  // azimuth that it stands for [rad]
  };
  struct Crossing {
    double cot;
    int change;  // of W, away from the pole
  };

  // Lines at psi = (j + offset) / count, or where the warp puts these, 0 <= offset < 1, and all
  // crossings, in their order.
  void build(const Pencil& pencil, int count, double offset, const ContourPoint& at,
             std::span<const ContourArc> arcs);

  int size() const { return static_cast<int>(lines_.size()); }
  const Line& line(int j) const { return lines_[j]; }
  std::span<const Crossing> crossings(int j) const {
    return {sorted_.data() + starts_[j], sorted_.data() + starts_[j + 1]};
  }

  // visit(from, to) for all ranges of cot, from > to, from `start` down to `end`, where W is zero
  // (`open`) or where it is not. w: its value at the pole.
  template <class Visit>
  void for_ranges(int j, int w, double start, double end, bool open, const Visit& visit) const {
    double from = start;
    for (const Crossing& crossing : crossings(j)) {
      if (crossing.cot <= end) break;
      const int next = w + crossing.change;
      if ((w == 0) != (next == 0)) {
        if ((w == 0) == open && from > crossing.cot) visit(from, crossing.cot);
        from = std::fmin(start, crossing.cot);
      }
      w = next;
    }
    if ((w == 0) == open && from > end) visit(from, end);
  }

 private:
  struct Found {
    uint32_t line;
    int change;
    double cot;
  };
  void cross(const ContourArc& arc, double turn0, double turn1, const ContourPoint& at);
  double in_lines(double turn) const;

  Pencil pencil_;
  double offset_ = 0;
  std::vector<Line> lines_;
  std::vector<double> cosines_, sines_;  // of psi
  std::vector<double> azimuths_;         // of both ends of every arc [turns]
  std::vector<Found> found_;
  std::vector<uint32_t> starts_;  // size() + 1
  std::vector<Crossing> sorted_;
};

}  // namespace limn
