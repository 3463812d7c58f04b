// Prefix sums of a map along its meridians.
#include "integrators/contours/radiance_columns.h"

#include <algorithm>
#include <cmath>

#include "limn/core/memory.h"
#include "limn/core/parallel.h"
#include "limn/core/prefetch.h"

namespace limn {
namespace {

// Rows at most this far apart [rad]: the sums of in_row end where they are right to 3e-9.
constexpr double kWidestRow = 0.1;

}  // namespace

// n . w sin theta is (along sin 2 theta + across (1 - cos 2 theta)) / 2. In the last t of theta it
// is integrated times 1 and times the way from the row on, by the integrals of cos 2v and sin 2v
// over v from 0 to t (a, b) and of these times t - v (b / 2, c = (t - a) / 2), as sums of powers.
template <class T>
RadianceColumns::InRow<T> RadianceColumns::in_row(T t, T sine2, T cosine2, T along, T across,
                                                  T per_step) {
  const T u = t * t;
  const T c = t * u * (T(1) / 3 - u * (T(1) / 15 - u * (T(2) / 315)));
  const T a = t - 2 * c;
  const T b = u * (1 - u * (T(1) / 3 - u * (T(2) / 45)));
  const T x = along / 2, y = across / 2;
  const T one = x * (sine2 * a - cosine2 * b) + y * (t - cosine2 * a - sine2 * b);
  const T way = x * (sine2 * b / 2 - cosine2 * c) + y * (u / 2 - cosine2 * b / 2 - sine2 * c);
  return {one - way * per_step, way * per_step};
}

RadianceColumns::RadianceColumns(const Environment::Grid& grid, const Lookup& radiance, int threads)
    : grid_(grid),
      finer_(static_cast<int>(std::ceil(kPi / kWidestRow / (grid_.rows - 1)))),
      rows_((grid_.rows - 1) * finer_ + 1),
      step_(kPi / (rows_ - 1)),
      per_step_(1 / step_),
      stride_(static_cast<size_t>(grid_.columns) + 1) {
  require_memory({}, static_cast<double>(rows_) * stride_ * sizeof(Cell),
                 "the sums over the environment's map", "use a smaller map, or another method");
  cells_.reset(HugePageAllocator<Cell>().allocate(rows_ * stride_));
  for (int j = 1; j < rows_; ++j) {
    const double sine2 = std::sin(2 * step_ * j), cosine2 = std::cos(2 * step_ * j);
    whole_.push_back({in_row<double>(step_, sine2, cosine2, 1, 0, per_step_),
                      in_row<double>(step_, sine2, cosine2, 0, 1, per_step_)});
  }
  constexpr int kTogether = 16;  // columns: what is written together is near. Not tuned.
  parallel_for((grid_.columns + kTogether - 1) / kTogether, threads, [&](size_t block) {
    const int first = static_cast<int>(block) * kTogether;
    fill(radiance, first, std::min(first + kTogether, grid_.columns));
  });
  for (int j = 0; j < rows_; ++j) cells_[j * stride_ + grid_.columns] = cells_[j * stride_];
}

RadianceColumns::RadianceColumns(const Environment& environment, int threads)
    : RadianceColumns(
          environment.grid().value(),
          [&, grid = *environment.grid()](int column, double row) {
            const double phi = 2 * kPi * (column + 0.5) / grid.columns;
            const double theta = kPi * row / (grid.rows - 1);
            const Vec3d r = grid.zero * std::cos(phi) + grid.quarter * std::sin(phi);
            return environment.radiance_at(grid.pole * std::cos(theta) + r * std::sin(theta),
                                           {static_cast<double>(column), row});
          },
          threads) {}

void RadianceColumns::fill(const Lookup& radiance, int first, int last) {
  struct Sums {
    Rgb<double> pole, across, here;
  };
  std::vector<Sums> sums(last - first);
  for (int i = first; i < last; ++i) sums[i - first].here = radiance(i, 0);
  for (int j = 0; j < rows_; ++j) {
    for (int i = first; i < last; ++i) {
      auto& [pole, across, here] = sums[i - first];
      const bool ends = j + 1 == rows_;
      const Rgb<double> below = ends ? here : radiance(i, static_cast<double>(j + 1) / finer_);
      const auto pair = [](const Rgb<double>& a, const Rgb<double>& b) {
        const auto f = [](double x) { return static_cast<float>(x); };
        return Pair{f(a.r), f(a.g), f(a.b), 0, f(b.r), f(b.g), f(b.b), 0};
      };
      cells_[j * stride_ + i] = {pair(pole, across), pair(here, below)};
      if (ends) continue;
      pole += here * whole_[j].pole.here + below * whole_[j].pole.below;
      across += here * whole_[j].across.here + below * whole_[j].across.below;
      here = below;
    }
  }
}

std::vector<double> RadianceColumns::brightness() const {
  const int columns = grid_.columns;
  std::vector<double> own(columns), spread(columns);
  for (int i = 0; i < columns; ++i) {
    const Pair& sum = cells_[(rows_ - 1) * stride_ + i].integrals;
    own[i] = std::fmax(luminance(Rgb<double>{sum[4], sum[5], sum[6]}), 0.0);
  }
  // Radiance of a column reaches to the next on both sides.
  for (int i = 0; i < columns; ++i) {
    const int before = i > 0 ? i - 1 : columns - 1, next = i + 1 < columns ? i + 1 : 0;
    spread[i] = 0.25 * own[before] + 0.5 * own[i] + 0.25 * own[next];
  }
  return spread;
}

RadianceColumns::Meridian RadianceColumns::meridian(const Vec3d& r) const {
  const double turn = std::atan2(dot(r, grid_.quarter), dot(r, grid_.zero)) / (2 * kPi);
  const double columns = turn * grid_.columns - 0.5;
  return meridian(columns < 0 ? columns + grid_.columns : columns);
}

// Along the meridian between two columns the map is linear, too.
Rgb<double> RadianceColumns::up_to(const Meridian& at, double theta, double cos_theta,
                                   double sin_theta, double along, double across) const {
  const int row = std::clamp(static_cast<int>(theta * per_step_), 0, rows_ - 2);
  const InRow<double> w =
      in_row<double>(theta - step_ * row, 2 * sin_theta * cos_theta,
                     cos_theta * cos_theta - sin_theta * sin_theta, along, across, per_step_);
  const Cell* cell = &cells_[row * stride_ + at.column];
  const Pair integrals = cell->integrals + (cell[1].integrals - cell->integrals) * at.share;
  const Pair radiance = cell->radiance + (cell[1].radiance - cell->radiance) * at.share;
  Rgb<double> sum;
  for (int c = 0; c < 3; ++c) {
    sum[c] = along * integrals[c] + across * integrals[4 + c] + w.here * radiance[c] +
             w.below * radiance[4 + c];
  }
  return sum;
}

void RadianceColumns::Ends::resize(size_t size) {
  count = size;
  if (size <= cell.size()) return;
  cell.resize(size), share.resize(size), across.resize(size), sign.resize(size);
  weights.resize(size);
}

// Vectorised by the compiler. The distance from the row is right to its own last bits: the product
// of `coarse` and a row's number is exact. Sine and cosine, which it is multiplied by, are Taylor's
// sums around pi / 2, right to 1e-7.
void RadianceColumns::weigh(std::span<const float> thetas, float along, Ends& ends) const {
  int exponent;
  std::frexp(step_, &exponent);
  const auto coarse =
      static_cast<float>(std::ldexp(std::round(std::ldexp(step_, 11 - exponent)), exponent - 11));
  const auto fine = static_cast<float>(step_ - coarse), per_step = static_cast<float>(per_step_);
  const auto last = static_cast<float>(rows_ - 2);
  const int stride = static_cast<int>(stride_);
  const float *theta = thetas.data(), *across = ends.across.data(), *sign = ends.sign.data();
  uint32_t* cell = ends.cell.data();
  Ends::Weights* weights = ends.weights.data();
  for (size_t i = 0; i < thetas.size(); ++i) {
    const float angle = std::fabs(theta[i]);
    const int row = static_cast<int>(std::min(last, angle * per_step));
    const float t = (angle - row * coarse) - row * fine;
    const float y = angle - static_cast<float>(kPi / 2), v = y * y;
    float sine = 1, cosine = 1;
    for (int k = 12; k > 0; k -= 2) {
      cosine = 1 - v * cosine * (1.0f / (k * (k - 1)));
      sine = 1 - v * sine * (1.0f / (k * (k + 1)));
    }
    sine *= y;
    const InRow<float> w = in_row<float>(t, -2 * sine * cosine, 2 * sine * sine - 1,
                                         sign[i] * along, sign[i] * across[i], per_step);
    cell[i] += row * stride;
    weights[i] = {{sign[i] * along, sign[i] * across[i], w.here, w.below}};
  }
  // Waiting for these takes most of the time of large maps.
  for (size_t i = 0; i < thetas.size(); ++i) {
    prefetch(&cells_[cell[i]]);
    prefetch(&cells_[cell[i] + 1]);
  }
}

void RadianceColumns::look(const Meridian& at, double theta, Ends& ends) const {
  ends.resize(1);
  const int row = std::clamp(static_cast<int>(theta * per_step_), 0, rows_ - 2);
  const auto below = static_cast<float>(theta * per_step_ - row);
  ends.cell[0] = static_cast<uint32_t>(row * stride_ + at.column);
  ends.share[0] = at.share;
  ends.weights[0] = {{0, 0, 1 - below, below}};
}

Rgb<double> RadianceColumns::sum(const Ends& ends) const {
  constexpr size_t kInFloats = 16;  // added up, then in doubles
  std::array<double, 16> total{};
  for (size_t first = 0; first < ends.count; first += kInFloats) {
    Pair integrals{}, radiance{};
    for (size_t i = first; i < std::min(first + kInFloats, ends.count); ++i) {
      const Cell* cell = &cells_[ends.cell[i]];
      const float share = ends.share[i], *w = ends.weights[i].of;
      integrals += (cell->integrals + (cell[1].integrals - cell->integrals) * share) *
                   Pair{w[0], w[0], w[0], w[0], w[1], w[1], w[1], w[1]};
      radiance += (cell->radiance + (cell[1].radiance - cell->radiance) * share) *
                  Pair{w[2], w[2], w[2], w[2], w[3], w[3], w[3], w[3]};
    }
    for (int k = 0; k < 8; ++k) total[k] += integrals[k], total[8 + k] += radiance[k];
  }
  const auto channel = [&](int c) {
    return total[c] + total[4 + c] + total[8 + c] + total[12 + c];
  };
  return {channel(0), channel(1), channel(2)};
}

RadianceColumns::Adjoint RadianceColumns::zero_adjoint() const {
  const size_t cells = rows_ * stride_;
  require_memory({}, static_cast<double>(cells) * sizeof(Adjoint::value_type),
                 "the derivatives of the sums over the map", "use a smaller map");
  return Adjoint(cells);
}

void RadianceColumns::add(const Ends& ends, const Rgb<double>& d_sum, Adjoint& adjoint) {
  const Colour all{d_sum.r, d_sum.g, d_sum.b, 0};
  for (size_t i = 0; i < ends.count; ++i) {
    for (const bool second : {false, true}) {
      const double share = ends.share[i];
      const Colour d = all * (second ? share : 1 - share);
      for (int k = 0; k < 4; ++k) {
        adjoint[ends.cell[i] + second][k] += d * static_cast<double>(ends.weights[i].of[k]);
      }
    }
  }
}

void RadianceColumns::finish(
    Adjoint adjoint, const std::function<void(int, double, const Rgb<double>&)>& add) const {
  // Derivatives with respect to both integrals up to the next row, and to the radiance there.
  struct Next {
    Colour pole{}, across{}, radiance{};
  };
  std::vector<Next> all(grid_.columns);
  for (int j = rows_ - 1; j >= 0; --j) {
    auto* row = &adjoint[j * stride_];
    for (int k = 0; k < 4; ++k) row[0][k] += row[grid_.columns][k];
    for (int i = 0; i < grid_.columns; ++i) {
      auto& [pole, across, radiance] = all[i];
      Colour here = row[i][2], below = radiance + row[i][3];
      if (j + 1 < rows_) {
        here += pole * whole_[j].pole.here + across * whole_[j].across.here;
        below += pole * whole_[j].pole.below + across * whole_[j].across.below;
        add(i, static_cast<double>(j + 1) / finer_, {below[0], below[1], below[2]});
      }
      pole += row[i][0], across += row[i][1], radiance = here;
      if (j == 0) add(i, 0, {here[0], here[1], here[2]});
    }
  }
}

}  // namespace limn
