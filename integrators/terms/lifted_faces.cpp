// Lifted points of a face are a piecewise quadratic patch. A line that grazes it meets it twice.
#include "integrators/terms/lifted_faces.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "limn/core/surface_point.h"

namespace limn {
namespace {

// What the points of a face are lifted to on one side.
class Patch {
 public:
  // Derivatives of p by the barycentric coordinates b1 and b2 of x.
  struct Point {
    double b1, b2;
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
  bool is_raised() const {
    constexpr double kTie = 0x1p-20;  // as for detail::lift_of
    double most = 0;
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) most = std::max(most, std::fabs(depth(j, k)));
    return most > kTie * std::sqrt(size_);
  }
  FloatBox box() const;
  void add_crossings(const ShadowLine& line, double s_max, FaceRef face,
                     std::vector<LiftedCrossing>& found) const;

 private:
  Point point(double b1, double b2) const;
  std::array<double, 3> starts(const ShadowLine& line, double s_max) const;
  std::optional<LiftedCrossing> meet(const ShadowLine& line, double s, double& b1,
                                     double& b2) const;
  // The barycentric coordinates of a point's foot in the plane of the face.
  std::array<double, 2> foot(const Vec3d& x) const {
    const Vec3d q = x - corners_[0];
    return {determinant(q, e2_, n_) / size_, determinant(e1_, q, n_) / size_};
  }
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

Patch::Point Patch::point(double b1, double b2) const {
  const std::array<double, 3> b = {1 - b1 - b2, b1, b2};
  Point at{b1, b2, corners_[0] + e1_ * b1 + e2_ * b2, {}, e1_, e2_};
  std::array<double, 3> depth;
  for (int k = 0; k < 3; ++k) depth[k] = dot(at.x - corners_[k], normals_[k]);
  const detail::Lift lift = detail::lift_of(normals_, b, depth, n_, side_, size_, at.x);
  at.p = at.x;
  for (int k = 0; k < 3; ++k) {
    const Vec3d n = normals_[k] * lift.gain[k];
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

// Where the line passes over the face, and in between: the ends of the part whose foot lies in the
// triangle, widened by half of itself, since normals lean.
std::array<double, 3> Patch::starts(const ShadowLine& line, double s_max) const {
  const auto at = foot(line.y), then = foot(line.y + line.w);
  const std::array<double, 3> b = {1 - at[0] - at[1], at[0], at[1]};
  const std::array<double, 3> slope = {at[0] + at[1] - then[0] - then[1], then[0] - at[0],
                                       then[1] - at[1]};
  constexpr double kBeyond = 0.5;
  double low = 0, high = s_max;
  for (int k = 0; k < 3; ++k) {
    if (slope[k] == 0) continue;
    const double s = (-kBeyond - b[k]) / slope[k];
    if (slope[k] > 0) low = std::max(low, s);
    if (slope[k] < 0) high = std::min(high, s);
  }
  if (!(low <= high)) low = high = 0.5 * (low + high);
  return {low, high, 0.5 * (low + high)};
}

// By Newton's method from the foot of the line's point at s; none if it does not end inside.
std::optional<LiftedCrossing> Patch::meet(const ShadowLine& line, double s, double& b1,
                                          double& b2) const {
  constexpr int kMostSteps = 20;
  constexpr double kStep = 1e-12, kInside = 1e-9;  // of barycentric coordinates
  const auto start = foot(line.y + line.w * s);
  b1 = std::clamp(start[0], -0.5, 1.5), b2 = std::clamp(start[1], -0.5, 1.5);
  for (int i = 0; i < kMostSteps; ++i) {
    const Point at = point(b1, b2);
    const Vec3d step = solve(at, line.w, line.y - at.p);
    if (!std::isfinite(step.x + step.y + step.z)) return {};
    if (std::fabs(step.x) + std::fabs(step.y) <= kStep) {
      if (!(b1 >= -kInside && b2 >= -kInside && b1 + b2 <= 1 + kInside)) return {};
      const double m = measure(line, at, -step.z);
      if (!std::isfinite(m)) return {};
      const Vec3d n = normals_[0] * (1 - b1 - b2) + normals_[1] * b1 + normals_[2] * b2;
      const double cosine = -side_ * dot(n, line.w) / (length(n) * length(line.w));
      return LiftedCrossing{{}, side_, at.x, at.p, -step.z, m, cosine};
    }
    // Lifts mean nothing far from the face.
    b1 = std::clamp(b1 + step.x, -0.5, 1.5);
    b2 = std::clamp(b2 + step.y, -0.5, 1.5);
  }
  return {};
}

void Patch::add_crossings(const ShadowLine& line, double s_max, FaceRef face,
                          std::vector<LiftedCrossing>& found) const {
  constexpr double kSame = 1e-7;  // of barycentric coordinates
  std::array<std::array<double, 2>, 3> known;
  size_t count = 0;
  for (const double s : starts(line, s_max)) {
    double b1, b2;
    auto crossing = meet(line, s, b1, b2);
    if (!crossing || !(crossing->s > 0 && crossing->s <= s_max)) continue;
    bool again = false;
    for (size_t i = 0; i < count; ++i)
      again = again || std::fabs(known[i][0] - b1) + std::fabs(known[i][1] - b2) <= kSame;
    if (again) continue;
    known[count++] = {b1, b2};
    crossing->face = face;
    found.push_back(*crossing);
  }
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
  for (const uint32_t leaf : leaves) {
    for (const uint32_t i : tree_.leaf(leaf)) {
      const Face& of = faces_[i];
      Patch(scene_.shape(of.face.shape).mesh, of.face.face, of.side)
          .add_crossings(line, s_max, of.face, found);
    }
  }
}

}  // namespace limn
