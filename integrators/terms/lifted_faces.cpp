// Lifted points of a face are a piecewise quadratic patch, which a line may meet several times.
//
// As the line sees it, the patch maps the triangle to a plane, and crossings are zeros of the map.
// Where the gains of surface_lift.h stay the same it is F(b) = sum of b_i b_j q_ij, so that
// F(a) - F(b) = J((a + b) / 2) (a - b): where det J has one sign over a triangle there is at most
// one zero. Triangles are split in four until Newton's method finds that one, or zero lies outside
// of the hull of the q_ij.
#include "integrators/terms/lifted_faces.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "limn/core/surface_point.h"

namespace limn {
namespace {

using Triangle = std::array<Vec3d, 3>;  // barycentric coordinates of its corners
constexpr Triangle kWhole = {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}};

// F(b) = sum of b_i b_j q_ij, in the frame of a line along z.
struct Quadratic {
  Vec3d q[3][3];  // symmetric

  Vec3d polar(const Vec3d& a, const Vec3d& b) const {
    Vec3d sum;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum += q[i][j] * (a[i] * b[j]);
    return sum;
  }
  // The same map over a triangle within.
  Quadratic over(const Triangle& corners) const {
    Quadratic part;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j) part.q[i][j] = part.q[j][i] = polar(corners[i], corners[j]);
    return part;
  }
  bool may_vanish(double far) const;
  std::array<double, 2> determinants() const;
  double extent() const;
  std::optional<Vec3d> zero() const;
};

double turn(const Vec3d& a, const Vec3d& b) { return a.x * b.y - a.y * b.x; }

// Whether the line may meet the patch at 0 < z <= far.
bool Quadratic::may_vanish(double far) const {
  const std::array<Vec3d, 6> hull = {q[0][0], q[1][1], q[2][2], q[0][1], q[1][2], q[2][0]};
  double low = hull[0].z, high = low, size = 0;
  for (const Vec3d& v : hull) {
    low = std::min(low, v.z), high = std::max(high, v.z);
    size = std::max(size, std::fabs(v.x) + std::fabs(v.y));
  }
  constexpr double kRounding = 1e-8;  // of crossings on sides, and more
  const double margin = kRounding * (size + std::fabs(low) + std::fabs(high));
  if (high < -margin || low > far + margin) return false;
  // The line is outside if, as seen from it, all points lie to the left of one of them, or before
  // it, as those of a patch that is seen edge-on.
  for (size_t i = 0; i < hull.size(); ++i) {
    bool left = true, before = true;
    for (size_t j = 0; (left || before) && j < hull.size(); ++j) {
      left = left && (i == j || turn(hull[i], hull[j]) > margin * size);
      before = before && hull[i].x * hull[j].x + hull[i].y * hull[j].y > margin * size;
    }
    if (left || before) return false;
  }
  return true;
}

// Bounds of det J, by the coefficients of a quadratic.
std::array<double, 2> Quadratic::determinants() const {
  double low = INFINITY, high = -INFINITY;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double d =
          turn(q[1][i] - q[0][i], q[2][j] - q[0][j]) + turn(q[1][j] - q[0][j], q[2][i] - q[0][i]);
      low = std::min(low, d), high = std::max(high, d);
    }
  }
  return {low, high};
}

// The square of its size, across the line.
double Quadratic::extent() const {
  double most = 0;
  for (int i = 0; i < 3; ++i) {
    const Vec3d side = q[i][i] - q[(i + 1) % 3][(i + 1) % 3];
    const Vec3d bow = q[i][(i + 1) % 3] * 2 - q[i][i] - q[(i + 1) % 3][(i + 1) % 3];
    most = std::max({most, side.x * side.x + side.y * side.y, bow.x * bow.x + bow.y * bow.y});
  }
  return most;
}

// By Newton's method from the middle; none if it does not end inside.
std::optional<Vec3d> Quadratic::zero() const {
  constexpr int kMostSteps = 12;
  constexpr double kStep = 1e-12, kInside = 1e-9;  // of barycentric coordinates
  Vec3d b = {1.0 / 3, 1.0 / 3, 1.0 / 3};
  for (int i = 0; i < kMostSteps; ++i) {
    std::array<Vec3d, 3> rows;
    for (int k = 0; k < 3; ++k) rows[k] = q[k][0] * b.x + q[k][1] * b.y + q[k][2] * b.z;
    const Vec3d f = rows[0] * b.x + rows[1] * b.y + rows[2] * b.z;
    const Vec3d by_1 = (rows[1] - rows[0]) * 2, by_2 = (rows[2] - rows[0]) * 2;
    const double d = turn(by_1, by_2);
    const double step_1 = -turn(f, by_2) / d, step_2 = -turn(by_1, f) / d;
    b.y += step_1, b.z += step_2, b.x = 1 - b.y - b.z;
    if (!(std::fabs(b.y) + std::fabs(b.z) < 8)) return {};
    if (std::fabs(step_1) + std::fabs(step_2) > kStep) continue;
    if (std::min({b.x, b.y, b.z}) < -kInside) return {};
    return b;
  }
  return {};
}

// Zeros with 0 < z <= far.
struct Zeros {
  double far;
  std::array<Vec3d, 4> found{};  // two conics meet in four points
  size_t count = 0;

  void find(const Quadratic& map, const Triangle& corners, int depth);
  void add(const Vec3d& b) {
    constexpr double kSame = 1e-7;  // of barycentric coordinates
    for (size_t i = 0; i < count; ++i)
      if (std::fabs(found[i].y - b.y) + std::fabs(found[i].z - b.z) <= kSame) return;
    if (count < found.size()) found[count++] = b;
  }
};

void Zeros::find(const Quadratic& map, const Triangle& corners, int depth) {
  constexpr int kDeepest = 7;        // a hundredth of a side: zeros are double ones there
  constexpr double kEdgeOn = 1e-10;  // of det J over the square of its size: rounding
  if (!map.may_vanish(far)) return;
  const auto zero = map.zero();
  if (zero) add(corners[0] * zero->x + corners[1] * zero->y + corners[2] * zero->z);
  const auto [low, high] = map.determinants();
  if ((zero && (low >= 0 || high <= 0)) || depth == kDeepest) return;
  // The patch is seen edge-on: it is met nowhere, or along curves, of which no point counts.
  if (std::max(-low, high) <= kEdgeOn * map.extent()) return;
  const Triangle middle = {Vec3d{0, 0.5, 0.5}, Vec3d{0.5, 0, 0.5}, Vec3d{0.5, 0.5, 0}};
  for (int i = 0; i < 4; ++i) {
    Triangle part = middle;
    if (i < 3) part[i] = kWhole[i];
    Triangle of_whole;
    for (int k = 0; k < 3; ++k)
      of_whole[k] = corners[0] * part[k].x + corners[1] * part[k].y + corners[2] * part[k].z;
    find(map.over(part), of_whole, depth + 1);
  }
}

// What the points of a face are lifted to on one side.
class Patch {
 public:
  // Derivatives of p by the barycentric coordinates b1 and b2 of x.
  struct Point {
    Vec3d x, p, by_1, by_2;
  };

  Patch(const Mesh& mesh, FaceId face, double side)
      : corners_(face_corners<double>(mesh, face)),
        normals_(detail::corner_normals<double>(mesh, face)),
        e1_(corners_[1] - corners_[0]),
        e2_(corners_[2] - corners_[0]),
        size_(length(cross(e1_, e2_))),
        n_(cross(e1_, e2_) / size_),
        side_(side) {}

  // How far corner j lies above the tangent plane of corner k.
  double depth(int j, int k) const { return dot(corners_[j] - corners_[k], normals_[k]); }
  double tie() const { return 0x1p-20 * std::sqrt(size_); }  // as for detail::lift_of
  bool is_raised() const {
    double most = 0;
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) most = std::max(most, std::fabs(depth(j, k)));
    return most > tie();
  }
  FloatBox box() const;
  // line: of the frame's n.
  void add_crossings(const ShadowLine& line, const Frame& frame, double s_max, FaceRef face,
                     std::vector<LiftedCrossing>& found) const;

 private:
  Point point(double b1, double b2, const std::array<double, 3>& gain) const;
  std::array<double, 3> depths(const Vec3d& x) const {
    return {dot(x - corners_[0], normals_[0]), dot(x - corners_[1], normals_[1]),
            dot(x - corners_[2], normals_[2])};
  }
  std::optional<LiftedCrossing> crossing(const ShadowLine& line, const Vec3d& b,
                                         const std::array<double, 3>& gain,
                                         const std::array<bool, 3>& bends) const;
  // (a, b, c) with by_1 a + by_2 b + w c = v.
  static Vec3d solve(const Point& at, const Vec3d& w, const Vec3d& v) {
    const double d = determinant(at.by_1, at.by_2, w);
    return {determinant(v, at.by_2, w) / d, determinant(at.by_1, v, w) / d,
            determinant(at.by_1, at.by_2, v) / d};
  }
  // The m of LiftedCrossing.
  double measure(const ShadowLine& line, const Point& at, double s) const {
    const Vec3d moves = solve(at, line.w, line.along * (line.infinite ? 1 : 1 + s));
    const Vec3d normal = cross(line.w0, line.along);
    return size_ * std::hypot(moves.x, moves.y) /
           std::hypot(dot(normal, at.by_1), dot(normal, at.by_2));
  }

  std::array<Vec3d, 3> corners_, normals_;
  Vec3d e1_, e2_;
  double size_;  // twice the area
  Vec3d n_;
  double side_;
};

Patch::Point Patch::point(double b1, double b2, const std::array<double, 3>& gain) const {
  const std::array<double, 3> b = {1 - b1 - b2, b1, b2};
  Point at{corners_[0] + e1_ * b1 + e2_ * b2, {}, e1_, e2_};
  const std::array<double, 3> depth = depths(at.x);
  at.p = at.x;
  for (int k = 0; k < 3; ++k) {
    const Vec3d n = normals_[k] * gain[k];
    at.p += n * (b[k] * depth[k]);
    at.by_1 += n * ((k == 0 ? -1 : k == 1) * depth[k] + b[k] * dot(normals_[k], e1_));
    at.by_2 += n * ((k == 0 ? -1 : k == 2) * depth[k] + b[k] * dot(normals_[k], e2_));
  }
  return at;
}

// b_k d_k lies between the least and the largest d_k over four, and 0.
FloatBox Patch::box() const {
  Vec3d low = corners_[0], high = corners_[0];
  for (int i = 0; i < 3; ++i) {
    low[i] = std::min({corners_[0][i], corners_[1][i], corners_[2][i]});
    high[i] = std::max({corners_[0][i], corners_[1][i], corners_[2][i]});
  }
  for (int k = 0; k < 3; ++k) {
    double most = 0;
    for (int j = 0; j < 3; ++j) {
      const double above = side_ * depth(j, k);
      most = std::max(most, above < 0 ? -above : detail::kHollowLift * above);
    }
    for (int i = 0; i < 3; ++i) {
      const double moved = side_ * normals_[k][i] * most / 4;
      low[i] += std::min(moved, 0.0);
      high[i] += std::max(moved, 0.0);
    }
  }
  FloatBox box;
  for (int i = 0; i < 3; ++i) {
    const double rounding = 0x1p-20 * (std::fabs(low[i]) + std::fabs(high[i]) + high[i] - low[i]);
    box.lower[i] = static_cast<float>(low[i] - rounding);
    box.upper[i] = static_cast<float>(high[i] + rounding);
  }
  return box;
}

// None where the gains are not those of the point.
std::optional<LiftedCrossing> Patch::crossing(const ShadowLine& line, const Vec3d& b,
                                              const std::array<double, 3>& gain,
                                              const std::array<bool, 3>& bends) const {
  const Point at = point(b.y, b.z, gain);
  const std::array<double, 3> depth = depths(at.x);
  for (int k = 0; k < 3; ++k)
    if (bends[k] && gain[k] == (side_ * depth[k] < 0 ? detail::kHollowLift : -1)) return {};
  const bool flat = gain == std::array<double, 3>{};
  const detail::Lift lift =
      detail::lift_of(normals_, {b.x, b.y, b.z}, depth, n_, side_, size_, at.x);
  if (flat != (lift.gain == std::array<double, 3>{})) return {};
  const double s = dot(at.p - line.y, line.w) / dot(line.w, line.w), m = measure(line, at, s);
  if (!std::isfinite(m)) return {};
  const Vec3d n = normals_[0] * b.x + normals_[1] * b.y + normals_[2] * b.z;
  const double cosine = -side_ * dot(n, line.w) / (length(n) * length(line.w));
  return LiftedCrossing{{}, side_, at.x, at.p, s, m, cosine};
}

void Patch::add_crossings(const ShadowLine& line, const Frame& frame, double s_max, FaceRef face,
                          std::vector<LiftedCrossing>& found) const {
  std::array<Vec3d, 3> corner, normal;
  double above[3][3];
  bool turned = false;  // a normal to the other side, which may not lift
  std::array<bool, 3> below{}, over{}, bends;
  for (int k = 0; k < 3; ++k) {
    corner[k] = frame.to_local(corners_[k] - line.y);
    normal[k] = frame.to_local(normals_[k]);
    turned = turned || dot(normals_[k], n_) < 0;
    for (int j = 0; j < 3; ++j) {
      above[j][k] = depth(j, k);
      below[k] = below[k] || side_ * above[j][k] < -tie();
      over[k] = over[k] || side_ * above[j][k] > tie();
    }
    bends[k] = below[k] && over[k];
  }
  const auto add = [&](const std::array<double, 3>& gain) {
    Quadratic map;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        map.q[i][j] = (corner[i] + corner[j] + normal[j] * (gain[j] * above[i][j]) +
                       normal[i] * (gain[i] * above[j][i])) *
                      0.5;
      }
    }
    Zeros zeros{s_max * length(line.w)};
    zeros.find(map, kWhole, 0);
    for (size_t i = 0; i < zeros.count; ++i) {
      auto at = crossing(line, zeros.found[i], gain, bends);
      if (!at || !(at->s > 0 && at->s <= s_max)) continue;
      at->face = face;
      found.push_back(*at);
    }
  };
  for (int signs = 0; signs < 8; ++signs) {
    std::array<double, 3> gain;
    bool possible = true;
    for (int k = 0; k < 3; ++k) {
      const bool hollow = signs >> k & 1;
      gain[k] = hollow ? detail::kHollowLift : -1;
      possible = possible && (hollow ? over[k] : below[k] || !over[k]);
    }
    if (possible) add(gain);
  }
  if (turned) add({});
}

}  // namespace

LiftedFaces::LiftedFaces(const Scene& scene)
    : scene_(scene), raised_(scene.shapes.size()), tree_({}, 1) {
  for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
    if (!is_lifted(scene, ShapeId(i))) continue;
    const Mesh& mesh = scene.shapes[i].mesh;
    raised_[i].resize(mesh.faces.size());
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      for (const bool front : {true, false}) {
        const Patch patch(mesh, FaceId(f), front ? 1 : -1);
        if (!has_area(mesh, mesh.faces[f]) || !patch.is_raised()) break;
        raised_[i][f] = true;
        if (!scene.shapes[i].bsdf->side(front)) continue;
        faces_.push_back({{ShapeId(i), FaceId(f)}, front ? 1.0 : -1.0});
        boxes_.push_back(patch.box());
      }
    }
  }
  tree_ = BoxTree(boxes_, 1);
}

void LiftedFaces::cross(const ShadowLine& line, double s_max,
                        std::vector<LiftedCrossing>& found) const {
  found.clear();
  static thread_local std::vector<uint32_t> leaves;
  tree_.find_leaves(line.y, line.w, s_max, leaves);
  const Frame frame(line.w * (1 / length(line.w)));
  for (const uint32_t leaf : leaves) {
    for (const uint32_t i : tree_.leaf(leaf)) {
      const Face& of = faces_[i];
      Patch(scene_.shape(of.face.shape).mesh, of.face.face, of.side)
          .add_crossings(line, frame, s_max, of.face, found);
    }
  }
}

}  // namespace limn
