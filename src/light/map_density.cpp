// The quadtree over the cells of an environment map, its draws, and its density.
#include "src/light/map_density.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>

#include "limn/core/vec.h"
#include "src/base/angles.h"

namespace limn {
namespace {

constexpr double kMeanShare = 1.0 / 16;  // share of the mean that is mixed in, see MapDensity
// Limits on the excess of a leaf's second moment of importance over density: as a share of the
// sphere's, and of its own. A photographed sunset sky, 1024 x 512, has 14,000 to 24,000 leaves for
// an own share of 0.5 to 0.2, with 0.4 % excess in total; a painted sky with a sun has 600 leaves
// and 0.02 %. A third of the whole's share makes 1.4 to 2 times as many leaves.
constexpr double kExcessOfWhole = 3e-6;
constexpr double kExcess = 0.3;

template <class T>
T mix(const std::type_identity_t<T>& a, const std::type_identity_t<T>& b, const T& t) {
  return a + (b - a) * t;
}

// Samples the linear density a + (b - a) x on [0, 1], up to a factor; a + b > 0.
wide::Doubles sample_linear(const wide::Doubles& a, const wide::Doubles& b,
                            const wide::Doubles& u) {
  return wide::min(u * (a + b) / (a + sqrt(a * a * (1 - u) + b * b * u)), 1);
}

int sum_of(const std::array<uint8_t, 4>& c) { return c[0] + c[1] + c[2] + c[3]; }

}  // namespace

// Builds the leaves bottom-up, from the smallest squares.
class MapDensity::Builder {
 public:
  Builder(MapDensity& density, std::span<const float> importance)
      : d_(density),
        importance_(importance),
        rows_((d_.height_ - 2) / kSide + 1),
        chosen_(static_cast<size_t>(d_.grid_width_) * rows_) {}

  void run() {
    for (int y = 0; y < d_.height_; ++y) {
      double line = 0;
      for (int x = 0; x < d_.width_; ++x) line += value(x, y);
      total_ += line * row_weight(y, 0, d_.height_ - 1);
    }
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < d_.grid_width_; ++column) {
        at(column, row) = uniform_leaves(column, row);
      }
    }
    for (int log = kGridLog + 1; log <= kLargestLog; ++log) merge(log);
    add_leaves();
  }

 private:
  static constexpr int kSide = 1 << kGridLog;

  uint8_t& at(int column, int row) {
    return chosen_[static_cast<size_t>(row) * d_.grid_width_ + column];
  }
  double value(int x, int y) const {
    if (x == d_.width_) x = 0;
    return importance_[static_cast<size_t>(y) * d_.width_ + x];
  }

  // Weight of row y in the trapezoidal rule over cos(theta) between two rows.
  double row_weight(int y, int first, int last) const {
    return 0.5 * (d_.cos_theta_[std::max(y - 1, first)] - d_.cos_theta_[std::min(y + 1, last)]);
  }
  // Quadrature over a leaf, by the trapezoidal rule in azimuth and cos(theta), of the importance
  // and of its square over the leaf's density.
  struct Fit {
    double mass = 0;  // times columns per radian
    Corners corners{1, 1, 1, 1};
    double excess = 0;  // of the second moment
  };
  Fit fit(const Patch& p) const {
    double weights[(1 << kLargestLog) + 1];
    Fit f;
    double area = 0;
    for (int y = p.y0; y <= p.y1; ++y) {
      weights[y - p.y0] = row_weight(y, p.y0, p.y1);
      area += weights[y - p.y0] * (p.x1 - p.x0);
      double line = -0.5 * (value(p.x0, y) + value(p.x1, y));
      for (int x = p.x0; x <= p.x1; ++x) line += value(x, y);
      f.mass += line * weights[y - p.y0];
    }
    if (!(f.mass > 0)) return f;
    f.corners = corners(p, f.mass / area);
    if (p.x1 - p.x0 == 1 && p.y1 - p.y0 == 1) return f;
    f.excess = second_moment(p, f.corners, weights) *
                   (0.25 * sum_of(f.corners) * area / (f.mass * f.mass)) -
               1;
    return f;
  }
  Corners corners(const Patch& p, double mean) const {
    const double v[4] = {value(p.x0, p.y0), value(p.x1, p.y0), value(p.x0, p.y1),
                         value(p.x1, p.y1)};
    const double largest = mix(*std::max_element(v, v + 4), mean, kMeanShare);
    Corners c;
    for (int k = 0; k < 4; ++k) {
      const double share = mix(v[k], mean, kMeanShare) / largest;
      c[k] = static_cast<uint8_t>(std::clamp(std::lround(255 * share), 1L, 255L));
    }
    return c;
  }
  double second_moment(const Patch& p, const Corners& c, const double* weights) const {
    const double inverse_width = 1.0 / (p.x1 - p.x0);
    const double top = d_.cos_theta_[p.y0], bottom = d_.cos_theta_[p.y1];
    double sum = 0;
    for (int y = p.y0; y <= p.y1; ++y) {
      const double t = (top - d_.cos_theta_[y]) / (top - bottom);
      const double left = mix(c[0], c[2], t), right = mix(c[1], c[3], t);
      double line = 0;
      for (int x = p.x0; x <= p.x1; ++x) {
        const double v = value(x, y);
        const double end = x == p.x0 || x == p.x1 ? 0.5 : 1;
        line += end * v * v / mix(left, right, (x - p.x0) * inverse_width);
      }
      sum += line * weights[y - p.y0];
    }
    return sum;
  }
  bool follows(int column, int row, int log) const {
    const Fit f = fit(d_.patch(column, row, log));
    return f.excess <= kExcess && f.excess * f.mass <= kExcessOfWhole * total_;
  }

  // The largest side, up to the grid's, that all leaves of a grid square can have.
  uint8_t uniform_leaves(int column, int row) const {
    const Patch square = d_.patch(column * kSide, row * kSide, kGridLog);
    for (int log = kGridLog; log > 0; --log) {
      bool all = true;
      for (int y = square.y0; all && y < square.y1; y += 1 << log) {
        for (int x = square.x0; all && x < square.x1; x += 1 << log) all = follows(x, y, log);
      }
      if (all) return log;
    }
    return 0;
  }
  // Merges leaves of the previous side.
  void merge(int log) {
    const int side = 1 << (log - kGridLog);
    for (int row = 0; row < rows_; row += side) {
      for (int column = 0; column < d_.grid_width_; column += side) {
        const int last_row = std::min(row + side, rows_);
        const int last_column = std::min(column + side, d_.grid_width_);
        bool all = true;
        for (int y = row; y < last_row; ++y) {
          for (int x = column; x < last_column; ++x) all = all && at(x, y) == log - 1;
        }
        if (!all || !follows(column * kSide, row * kSide, log)) continue;
        for (int y = row; y < last_row; ++y) {
          for (int x = column; x < last_column; ++x) at(x, y) = static_cast<uint8_t>(log);
        }
      }
    }
  }

  void add_leaves() {
    d_.grid_.resize(chosen_.size());
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < d_.grid_width_; ++column) add_square(column, row);
    }
  }
  void add_square(int column, int row) {
    const auto square = [&](int x, int y) -> Square& {
      return d_.grid_[static_cast<size_t>(y) * d_.grid_width_ + x];
    };
    const int log = at(column, row);
    const int side = log > kGridLog ? 1 << (log - kGridLog) : 1;
    const int first_row = row & -side, first_column = column & -side;
    if (first_row != row || first_column != column) {
      square(column, row) = square(first_column, first_row);
      return;
    }
    square(column, row) = {static_cast<uint32_t>(d_.leaves_.size()), static_cast<uint32_t>(log)};
    for (int y = row * kSide; y < (row + 1) * kSide; y += 1 << log) {
      for (int x = column * kSide; x < (column + 1) * kSide; x += 1 << log) add_leaf(x, y, log);
    }
  }
  // A square beyond the border gets an empty leaf, so that leaves can be indexed by position.
  void add_leaf(int x, int y, int log) {
    Leaf leaf{0,
              {1, 1, 1, 1},
              static_cast<uint32_t>(x),
              static_cast<uint32_t>(y),
              static_cast<uint32_t>(log)};
    if (x < d_.width_ && y + 1 < d_.height_) {
      const Patch p = d_.patch(x, y, log);
      const Fit f = fit(p);
      const double azimuth = 2 * kPi / d_.width_;
      leaf.corners = f.corners;
      leaf.scale =
          static_cast<float>(f.mass * azimuth * 4 / (d_.solid_angle(leaf) * sum_of(f.corners)));
      // Rounding must not make the scale of a leaf with mass 0.
      if (f.mass > 0) leaf.scale = std::max(leaf.scale, std::numeric_limits<float>::min());
    }
    d_.leaves_.push_back(leaf);
  }

  MapDensity& d_;
  std::span<const float> importance_;
  int rows_;                     // of the grid
  double total_ = 0;             // integral of `mass` over the sphere
  std::vector<uint8_t> chosen_;  // log2 of the side of each square's leaves
};

MapDensity::MapDensity(int width, int height, std::span<const float> importance)
    : width_(width), height_(height), grid_width_(((width - 1) >> kGridLog) + 1) {
  for (int row = 0; row < height; ++row) {
    cos_theta_.push_back(std::cos(kPi * row / (height - 1)));
  }
  Builder(*this, importance).run();
  int log = kLargestLog;
  while (1 << log < std::max(width_, height_ - 1)) ++log;
  const auto [root, total] = grow(0, 0, log);
  root_ = root;
  inverse_total_ = 1 / total;
}

MapDensity::Patch MapDensity::patch(int column, int row, int log) const {
  const int x0 = column & -(1 << log), y0 = row & -(1 << log);
  return {x0, y0, std::min(x0 + (1 << log), width_), std::min(y0 + (1 << log), height_ - 1)};
}

const MapDensity::Leaf& MapDensity::leaf(const Square& square, int column, int row) const {
  const int log = static_cast<int>(square.log);
  if (log >= kGridLog) return leaves_[square.first];
  constexpr int kMask = (1 << kGridLog) - 1;
  const int index = ((row & kMask) >> log << (kGridLog - log)) + ((column & kMask) >> log);
  return leaves_[square.first + static_cast<uint32_t>(index)];
}

double MapDensity::solid_angle(const Leaf& leaf) const {
  const Patch p = patch(leaf.column, leaf.row, leaf.log);
  return (cos_theta_[p.y0] - cos_theta_[p.y1]) * (p.x1 - p.x0) * (2 * kPi / width_);
}

double MapDensity::mass(const Leaf& leaf) const {
  if (!(leaf.scale > 0)) return 0;
  return 0.25 * sum_of(leaf.corners) * leaf.scale * solid_angle(leaf);
}

MapDensity::Grown MapDensity::grow(int column, int row, int log) {
  if (column >= width_ || row + 1 >= height_) return {0, 0};
  const Square& here = square(column, row);
  if (static_cast<int>(here.log) == log) {
    const Leaf& only = leaf(here, column, row);
    return {~static_cast<int32_t>(&only - leaves_.data()), mass(only)};
  }
  const size_t index = nodes_.size();
  nodes_.push_back({});
  const int half = 1 << (log - 1);
  Grown parts[4];
  for (int k = 0; k < 4; ++k) {
    parts[k] = grow(column + k / 2 * half, row + k % 2 * half, log - 1);
    nodes_[index].quarter[k] = parts[k].node;
  }
  const auto share = [](double a, double b) { return a > 0 ? a / (a + b) : 0; };
  const double left = parts[0].mass + parts[1].mass, right = parts[2].mass + parts[3].mass;
  nodes_[index].left = share(left, right);
  nodes_[index].upper[0] = share(parts[0].mass, parts[1].mass);
  nodes_[index].upper[1] = share(parts[2].mass, parts[3].mass);
  return {static_cast<int32_t>(index), left + right};
}

// Whether u is below the share. Where `changes` holds, u becomes its place in that part, in [0, 1).
LIMN_WIDE wide::Mask is_below(const wide::Doubles& share, const wide::Mask& changes,
                              wide::Doubles& u) {
  const wide::Mask below = u < share;
  const wide::Doubles part = select(below, u, u - share), size = select(below, share, 1 - share);
  u = select(changes, wide::min(part / size, 1 - 0x1p-53), u);
  return below;
}

MapDensity::Drawn MapDensity::sample(const wide::Doubles& u1, const wide::Doubles& u2) const {
  using wide::Doubles, wide::gather, wide::gather_ints, wide::Ints, wide::Mask, wide::to_doubles;
  Doubles down = u1, along = u2;
  Ints at = Ints{} + root_;
  const auto inner = [&](int i) { return at[i] >= 0; };
  for (;;) {
    bool any = false;
    for (int i = 0; i < wide::kWidth; ++i) any |= inner(i);
    if (!any) break;
    const auto node = [&](int i) -> const Node& { return nodes_[inner(i) ? at[i] : 0]; };
    const Mask changes = __builtin_convertvector(at >= 0, Mask);
    // Masks are -1 where they hold, 0 elsewhere.
    const Mask left = is_below(gather([&](int i) { return node(i).left; }), changes, along);
    const Mask upper =
        is_below(gather([&](int i) { return node(i).upper[left[i] + 1]; }), changes, down);
    at = gather_ints(
        [&](int i) { return inner(i) ? node(i).quarter[3 + 2 * left[i] + upper[i]] : at[i]; });
  }
  const auto l = [&](int i) { return static_cast<size_t>(~at[i]); };
  const auto leaf = [&](int i) { return leaves_[l(i)]; };
  // The leaf's extent, as in `patch`.
  const Ints log = gather_ints([&](int i) { return static_cast<int32_t>(leaf(i).log); });
  const Ints side = (Ints{} + 1) << log;
  const Ints x0 = -side & gather_ints([&](int i) { return static_cast<int32_t>(leaf(i).column); });
  const Ints y0 = -side & gather_ints([&](int i) { return static_cast<int32_t>(leaf(i).row); });
  const Ints x1 = wide::min(x0 + side, Ints{} + width_);
  const Ints y1 = wide::min(y0 + side, Ints{} + (height_ - 1));
  const auto cosine = [&](const Ints& row) {
    return gather([&](int i) { return cos_theta_[static_cast<size_t>(row[i])]; });
  };
  static_assert(std::endian::native == std::endian::little);
  const Ints corners = gather_ints([&](int i) { return std::bit_cast<int32_t>(leaf(i).corners); });
  const auto corner = [&](int k) { return to_doubles(corners >> 8 * k & 255); };
  const Doubles c0 = corner(0), c1 = corner(1), c2 = corner(2), c3 = corner(3);
  const Doubles t = sample_linear(c0 + c1, c2 + c3, down);
  const Doubles left = mix(c0, c2, t), right = mix(c1, c3, t);
  const Doubles s = sample_linear(left, right, along);
  const Doubles scale = gather([&](int i) { return leaf(i).scale; });
  return {to_doubles(x0) + s * to_doubles(x1 - x0), mix(cosine(y0), cosine(y1), t),
          mix(left, right, s) * scale * inverse_total_};
}

double MapDensity::pdf(int column, int row, double x, double cos_theta) const {
  const Square& s = square(column, row);
  const Leaf& l = leaf(s, column, row);
  const Patch p = patch(column, row, static_cast<int>(s.log));
  const double along = (x - p.x0) / (p.x1 - p.x0);
  const double top = cos_theta_[p.y0], bottom = cos_theta_[p.y1];
  const double down = std::clamp((top - cos_theta) / (top - bottom), 0.0, 1.0);
  const Corners& c = l.corners;
  return mix(mix(c[0], c[1], along), mix(c[2], c[3], along), down) * l.scale * inverse_total_;
}

}  // namespace limn
