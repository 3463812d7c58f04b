// Faces are cut in four until texture coordinates are linear over each part.
#include "integrators/edges/face_discontinuities.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace limn {
namespace {

using Pair = std::array<double, 2>;

Pair middle(const Pair& a, const Pair& b) { return {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])}; }

// A point of the face: barycentric and texture coordinates.
struct Point {
  Pair b, uv;
};
using Part = std::array<Point, 3>;

class CurvedFace {
 public:
  CurvedFace(const Texture& texture, const Mesh& mesh, FaceId face, size_t most,
             Texture::Discontinuities& lines)
      : texture_(texture), mesh_(mesh), face_(face), most_(most), lines_(lines) {
    angle_ = mesh.uv_source == UvSource::kSphere ? 0 : 1;
    turn_ = uv({1.0 / 3, 1.0 / 3})[angle_];
    for (int k = 0; k < 3; ++k) {
      const Vec3f& place = mesh.uv_places[mesh.uv_ids[face.index()][k]];
      if (std::hypot(double{place.x}, double{place.y}) < 1e-6) pole_ = Pair{kCorners[k]};
    }
  }

  bool add() {
    const auto sides = add({at(kCorners[0]), at(kCorners[1]), at(kCorners[2])}, 0);
    if (sides) lines_.sides |= *sides;
    return sides.has_value();
  }

 private:
  static constexpr int kMostCuts = 5;
  static constexpr Pair kCorners[3] = {{0, 0}, {1, 0}, {0, 1}};

  Pair uv(const Pair& b) const { return texture_point<double>(mesh_, face_, b).uv; }
  Point at(const Pair& b) const {
    Point point{b, uv(b)};
    point.uv[angle_] += std::round(turn_ - point.uv[angle_]);  // an angle goes on within the face
    return point;
  }

  // How far lines are off segments, in barycentric coordinates of the face.
  static double off_lines(const Part& part, const Part& middles, int cuts) {
    double most = 0;
    for (int c = 0; c < 2; ++c) {
      const auto [least, greatest] = std::minmax({part[0].uv[c], part[1].uv[c], part[2].uv[c]});
      for (int k = 0; k < 3; ++k) {
        const double off = middles[k].uv[c] - 0.5 * (part[k].uv[c] + part[(k + 1) % 3].uv[c]);
        if (off != 0) most = std::max(most, std::fabs(off) / (greatest - least));
      }
    }
    return std::ldexp(most, -cuts);
  }

  // Returns the sides along which it is discontinuous; nothing if there are too many lines.
  std::optional<uint8_t> add(Part part, int cuts) {
    // A pole has no angle: it takes the mean of the others.
    for (int k = 0; k < 3; ++k) {
      if (pole_ && part[k].b == *pole_)
        part[k].uv[angle_] = 0.5 * (part[(k + 1) % 3].uv[angle_] + part[(k + 2) % 3].uv[angle_]);
    }
    Part middles;
    for (int k = 0; k < 3; ++k) middles[k] = at(middle(part[k].b, part[(k + 1) % 3].b));
    if (cuts < kMostCuts && off_lines(part, middles, cuts) > kOffCurve)
      return add_quarters(part, middles, cuts + 1);
    Texture::Discontinuities found;
    if (!texture_.add_discontinuities({part[0].uv, part[1].uv, part[2].uv}, most_, found))
      return {};
    const auto on_face = [&](const Pair& at) {
      Pair b = part[0].b;
      for (int c = 0; c < 2; ++c) {
        b[c] += at[0] * (part[1].b[c] - part[0].b[c]) + at[1] * (part[2].b[c] - part[0].b[c]);
      }
      return b;
    };
    for (const Texture::Discontinuity& line : found.inside) {
      lines_.inside.push_back({on_face(line.from), on_face(line.to)});
    }
    if (lines_.inside.size() > most_) return {};
    return found.sides;
  }

  // middles[k]: of the side from corner k to the next.
  std::optional<uint8_t> add_quarters(const Part& part, const Part& middles, int cuts) {
    const auto inner = add({middles[0], middles[1], middles[2]}, cuts);
    uint8_t sides = 7;
    for (int k = 0; k < 3; ++k) {
      // At corner k: to the middle of its side, and of the side before.
      const int before = (k + 2) % 3;
      const auto outer = add({part[k], middles[k], middles[before]}, cuts);
      if (!inner || !outer) return {};
      if ((*outer & 1) == 0) sides &= ~(1 << k);
      if ((*outer & 4) == 0) sides &= ~(1 << before);
      // The cut between both parts, of the inner one the side from middle `before` to middle k.
      if ((*outer & 2) != 0 || (*inner >> before & 1) != 0)
        lines_.inside.push_back({middles[before].b, middles[k].b});
    }
    return sides;
  }

  const Texture& texture_;
  const Mesh& mesh_;
  FaceId face_;
  size_t most_;
  Texture::Discontinuities& lines_;
  int angle_;
  double turn_;               // of the middle
  std::optional<Pair> pole_;  // a corner on the axis
};

}  // namespace

bool add_face_discontinuities(const Texture& texture, const Mesh& mesh, FaceId face, size_t most,
                              Texture::Discontinuities& lines) {
  if (mesh.uv_source != UvSource::kPlane) return CurvedFace(texture, mesh, face, most, lines).add();
  const FaceIndices& ids = mesh.uv_ids[face.index()];
  std::array<Pair, 3> uv;
  for (int k = 0; k < 3; ++k) {
    const Vec3f& place = mesh.uv_places[ids[k]];
    uv[k] = {place.x, place.y};
  }
  return texture.add_discontinuities(uv, most, lines);
}

}  // namespace limn
