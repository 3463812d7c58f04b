// Directions of growing u over a surface.
//
// On a face uv is a function of the barycentric coordinates b, whose Jacobian at a corner gives the
// direction in which u grows while v stays. At a vertex these unit directions are summed, weighted
// by the angles of the faces at the corner, over faces that agree there in uv (modulo 1, as texture
// coordinates repeat) and in orientation. Flat shading keeps those of each face apart, as do faces
// with coordinates of their own: there u grows from the first corner to the second.
#include "limn/core/tangent.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <tuple>

#include "limn/core/texture.h"

namespace limn {
namespace {

// The steps of b at each corner of a face along which u grows by 1; zero where there is none.
struct Steps {
  std::array<std::array<double, 2>, 3> at{};
  bool mirrored = false;
};

// d uv / d b at a point of a face: rows u and v.
struct Jacobian {
  double m[2][2];
  double det() const { return m[0][0] * m[1][1] - m[0][1] * m[1][0]; }
};
Jacobian jacobian(const Mesh& mesh, FaceId face, double b1, double b2) {
  const std::array<Dual, 2> b = {Dual(b1, {1, 0, 0, 0}), Dual(b2, {0, 1, 0, 0})};
  const auto uv = texture_point<Dual>(mesh, face, b).uv;
  return {{{uv[0].d[0], uv[0].d[1]}, {uv[1].d[0], uv[1].d[1]}}};
}

Steps steps_of(const Mesh& mesh, FaceId face) {
  constexpr double kCorners[3][2] = {{0, 0}, {1, 0}, {0, 1}};
  Steps steps;
  steps.mirrored = jacobian(mesh, face, 1.0 / 3, 1.0 / 3).det() < 0;
  for (int c = 0; c < 3; ++c) {
    const Jacobian j = jacobian(mesh, face, kCorners[c][0], kCorners[c][1]);
    const double det = j.det();
    const auto& m = j.m;
    const double size =
        (std::fabs(m[0][0]) + std::fabs(m[0][1])) * (std::fabs(m[1][0]) + std::fabs(m[1][1]));
    if (!(std::fabs(det) > 0x1p-40 * size)) continue;  // rounding
    steps.at[c] = {m[1][1] / det, -m[1][0] / det};
  }
  return steps;
}

// At each corner p of a face: its unit direction, times its angle.
template <class S>
std::array<Vec3<S>, 3> weighted_directions(const std::array<Vec3<S>, 3>& p, const Steps& steps) {
  std::array<Vec3<S>, 3> directions;
  if (!has_area(value(p[0]), value(p[1]), value(p[2]))) return directions;
  const Vec3<S> e1 = p[1] - p[0], e2 = p[2] - p[0];
  const S size = length(cross(e1, e2));
  for (int c = 0; c < 3; ++c) {
    const auto& step = steps.at[c];
    if (step[0] == 0 && step[1] == 0) continue;
    using std::atan2;
    const S angle = atan2(size, dot(p[(c + 1) % 3] - p[c], p[(c + 2) % 3] - p[c]));
    directions[c] = normalize(e1 * step[0] + e2 * step[1]) * angle;
  }
  return directions;
}

// Welded vertices move together: positions are those of the first copy.
template <class S>
std::array<Vec3<S>, 3> corners_of(const Mesh& mesh, uint32_t face) {
  std::array<Vec3<S>, 3> p;
  for (int c = 0; c < 3; ++c) {
    p[c] = as<S>(mesh.position(VertexId(mesh.weld[mesh.faces[face][c]])));
  }
  return p;
}

void assign_ids(Mesh& mesh) {
  mesh.u_ids.resize(mesh.faces.size());
  // Place in the world, in the texture, orientation.
  using Key = std::tuple<uint32_t, double, double, double, bool>;
  std::map<Key, uint32_t> ids;
  uint32_t count = 0;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const bool mirrored = steps_of(mesh, FaceId(f)).mirrored;
    for (int c = 0; c < 3; ++c) {
      if (mesh.normal_source == NormalSource::kFace || mesh.uv_source == UvSource::kFaces) {
        mesh.u_ids[f][c] = count++;
        continue;
      }
      Vec3d place = cast<double>(mesh.uv_places[mesh.uv_ids[f][c]]);
      if (mesh.uv_source == UvSource::kPlane) {
        for (int k = 0; k < 2; ++k) place[k] -= std::floor(place[k]);
      }
      const Key key{mesh.weld[mesh.faces[f][c]], place.x, place.y, place.z, mirrored};
      const auto [entry, is_new] = ids.try_emplace(key, count);
      if (is_new) ++count;
      mesh.u_ids[f][c] = entry->second;
    }
  }
  mesh.u_directions.assign(count, Vec3d{});
}

template <class S>
std::vector<Vec3<S>> sums(const Mesh& mesh) {
  std::vector<Vec3<S>> directions(mesh.u_directions.size());
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto at = weighted_directions(corners_of<S>(mesh, f), steps_of(mesh, FaceId(f)));
    for (int c = 0; c < 3; ++c) directions[mesh.u_ids[f][c]] += at[c];
  }
  return directions;
}

class Tangent final : public Texture {
 public:
  Rgb<double> eval(const TexturePoint<double>& point) const override { return interpolate(point); }
  Rgb<Dual> eval(const TexturePoint<Dual>& point) const override { return interpolate(point); }
  std::shared_ptr<Texture> for_numbers() const override { return clone(); }
  Rgb<double> mean() const override { return {}; }
  Range range() const override { return {-kPi, kPi}; }
  bool is_tangent() const override { return true; }
  bool has_period_one() const override { return true; }
  TexelWeights texel_weights(const TexturePoint<double>& point) const override {
    const FaceIndices& ids = point.mesh->u_ids[point.face.index()];
    return {{{ids[0], 1 - point.b[0] - point.b[1]}, {ids[1], point.b[0]}, {ids[2], point.b[1]}}};
  }
  std::vector<ParameterRef> parameters() override { return {}; }
  std::shared_ptr<Texture> clone() const override { return std::make_shared<Tangent>(*this); }
  std::string describe() const override { return "tangent"; }

 private:
  template <class S>
  static Rgb<S> interpolate(const TexturePoint<S>& point) {
    const Mesh& mesh = *point.mesh;
    const FaceIndices& ids = mesh.u_ids[point.face.index()];
    const std::array<S, 3> b = {1.0 - point.b[0] - point.b[1], point.b[0], point.b[1]};
    Rgb<S> sum;
    for (int c = 0; c < 3; ++c) {
      const Vec3d& v = mesh.u_directions[ids[c]];
      Rgb<S> direction{v.x, v.y, v.z};
      if constexpr (std::is_same_v<S, Dual>) {
        for (int k = 0; k < 3 && !mesh.u_tangents.empty(); ++k) {
          direction[k].d = mesh.u_tangents[ids[c]][k];
        }
      }
      sum += direction * b[c];
    }
    return sum;
  }
};

// A constant vector of a face.
class OfFace : public Texture {
 public:
  Rgb<Dual> eval(const TexturePoint<Dual>& point) const final {
    const Rgb<double> v = eval(TexturePoint<double>{
        point.mesh, point.face, {point.b[0].v, point.b[1].v}, {point.uv[0].v, point.uv[1].v}});
    return {v.r, v.g, v.b};
  }
  Rgb<double> eval(const TexturePoint<double>& point) const override = 0;
  std::shared_ptr<Texture> for_numbers() const final { return clone(); }
  Rgb<double> mean() const final { return {}; }
  std::vector<ParameterRef> parameters() final { return {}; }

 protected:
  // The edges from the first corner, and their cross product.
  struct Sides {
    Vec3d e1, e2, n;
    explicit Sides(const TexturePoint<double>& point) {
      const auto p = face_corners<double>(*point.mesh, point.face);
      e1 = p[1] - p[0];
      e2 = p[2] - p[0];
      n = cross(e1, e2);
    }
  };
};

class Outward final : public OfFace {
 public:
  Rgb<double> eval(const TexturePoint<double>& point) const override {
    const Vec3d n = Sides(point).n;
    return {n.x, n.y, n.z};
  }
  Range range() const override { return {-1, 1}; }
  bool needs_uv() const override { return false; }
  bool has_period_one() const override { return true; }
  std::shared_ptr<Texture> clone() const override { return std::make_shared<Outward>(); }
  std::string describe() const override { return "outward"; }
};

// Of heights h(b): the sum of dh/db_k and the gradient of b_k over the face's plane,
// e2 x n / n^2 and n x e1 / n^2.
class SurfaceGradient final : public OfFace {
 public:
  explicit SurfaceGradient(std::shared_ptr<Texture> heights) : heights_(std::move(heights)) {}
  Rgb<double> eval(const TexturePoint<double>& point) const override {
    const std::array<Dual, 2> b = {Dual(point.b[0], {1, 0, 0, 0}), Dual(point.b[1], {0, 1, 0, 0})};
    const Dual h = heights_->eval(texture_point<Dual>(*point.mesh, point.face, b)).r;
    const Sides sides(point);
    const Vec3d g = (cross(sides.e2, sides.n) * h.d[0] + cross(sides.n, sides.e1) * h.d[1]) /
                    length_squared(sides.n);
    return {g.x, g.y, g.z};
  }
  Range range() const override { return {-1, 1}; }
  bool needs_uv() const override { return heights_->needs_uv(); }
  std::string attribute() const override { return heights_->attribute(); }
  double attribute_scale() const override { return heights_->attribute_scale(); }
  bool discontinuous_between_texels() const override {
    return heights_->discontinuous_between_texels();
  }
  bool discontinuous_between_faces() const override { return true; }
  bool has_period_one() const override { return heights_->has_period_one(); }
  std::shared_ptr<Texture> clone() const override {
    return std::make_shared<SurfaceGradient>(heights_->clone());
  }
  std::string describe() const override { return heights_->describe(); }

 private:
  std::shared_ptr<Texture> heights_;
};

}  // namespace

std::shared_ptr<Texture> make_tangent() { return std::make_shared<Tangent>(); }

std::shared_ptr<Texture> make_outward() { return std::make_shared<Outward>(); }
std::shared_ptr<Texture> make_surface_gradient(std::shared_ptr<Texture> heights) {
  return std::make_shared<SurfaceGradient>(heights->for_numbers());
}

void update_u_directions(Mesh& mesh) {
  if (!mesh.has_tangents) return;
  assign_ids(mesh);
  mesh.u_directions = sums<double>(mesh);
  update_u_tangents(mesh);
}

void update_u_tangents(Mesh& mesh) {
  mesh.u_tangents.clear();
  if (!mesh.has_tangents || mesh.position_tangents.all_alike()) return;
  for (const Vec3<Dual>& v : sums<Dual>(mesh)) mesh.u_tangents.push_back({v.x.d, v.y.d, v.z.d});
}

void pull_back_u_directions(const Mesh& mesh, const std::vector<Vec3d>& directions,
                            std::vector<Vec3d>& positions) {
  if (!mesh.has_tangents) return;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceIndices& ids = mesh.u_ids[f];
    const auto is_zero = [&](uint32_t id) { return directions[id] == Vec3d{}; };
    if (is_zero(ids[0]) && is_zero(ids[1]) && is_zero(ids[2])) continue;
    const Steps steps = steps_of(mesh, FaceId(f));
    const std::array<Vec3d, 3> p = corners_of<double>(mesh, f);
    for (int moving = 0; moving < 3; ++moving) {
      std::array<Vec3<Dual>, 3> q;
      for (int c = 0; c < 3; ++c) {
        q[c] = {p[c].x, p[c].y, p[c].z};
        for (int k = 0; k < 3 && c == moving; ++k) q[c][k].d[k] = 1;
      }
      const auto at = weighted_directions(q, steps);
      Dual sum = 0;
      for (int c = 0; c < 3; ++c) sum = sum + dot(at[c], directions[ids[c]]);
      positions[mesh.weld[mesh.faces[f][moving]]] += Vec3d{sum.d[0], sum.d[1], sum.d[2]};
    }
  }
}

}  // namespace limn
