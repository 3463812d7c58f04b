#pragma once
// A point on a surface and the scattering function there, over any scalar.
//
// The default scattering function is continuous in position and in both directions wherever normals
// are interpolated, so that a gradient needs no edges but those of edges.h. With n_s the
// interpolated and n_g the geometric normal, and s = `horizon`:
//
//  - the side of the surface follows n_g, which changes sides only at silhouettes;
//  - where n_s turns away from the viewer (n_s.wi < e) the BSDF is evaluated with the normal
//        n = normalize(n_s + (e - n_s.wi) wi),
//    which meets n_s at n_s.wi = e and keeps n.wi > 0;
//  - a factor reaches zero before wo does reach the geometric horizon n_g.wo = 0, below which the
//    ray would start inside the mesh:
//        clamp((n_s.wo - s) / (s (1 - s)), 0, 1).
//    The usual factors (Chiang, Li and Burley 2019) are functions of n_g and jump from triangle to
//    triangle. Here every vertex stores the sine of the largest tilt between n_s and n_g over the
//    faces around it. Its interpolation s is continuous and at any point at least the sine of the
//    tilt there, so n_s.wo > s implies n_g.wo > 0.
//
// Flat-shaded meshes have n_s = n_g and s = 0, and are left as they are.
#include <algorithm>
#include <optional>

#include "limn/core/ray_tracer.h"
#include "limn/core/scene.h"
#include "limn/core/slots.h"

namespace limn {

template <class S>
struct SurfacePoint {
  const Shape* shape = nullptr;
  FaceRef face;
  Vec3<S> p;
  Vec3d n_g;    // unit geometric normal, outward by the winding
  Vec3<S> n_s;  // unit shading normal, on the side of n_g unless the file's normals say otherwise
  S horizon{};  // s above; 0 for flat shading

  // Radiance that the surface itself emits towards the unit direction wi.
  Rgb<S> emission(const Vec3d& wi, ShadingModel model) const {
    if (!shape->is_emitter) return {};
    const double side = model == ShadingModel::kMitsuba ? dot(value(n_s), wi) : dot(n_g, wi);
    return side > 0 ? detail::emitter_radiance<S>(*shape, face.shape) : Rgb<S>{};
  }
};

// Corners of a face as the scalar P.
template <class P>
std::array<Vec3<P>, 3> face_corners(const Mesh& mesh, FaceId face) {
  std::array<Vec3<P>, 3> corners;
  for (int k = 0; k < 3; ++k) {
    const VertexId vertex(mesh.face(face)[k]);
    if constexpr (std::is_same_v<P, double>) {
      corners[k] = cast<double>(mesh.positions[vertex.index()]);
    } else {
      corners[k] = mesh.position(vertex);
    }
  }
  return corners;
}

namespace detail {

template <class S>
S interpolate(const S& b0, const S& b1, const S& b2, const S& a0, const S& a1, const S& a2) {
  return b0 * a0 + b1 * a1 + b2 * a2;
}

// Shading normal and horizon from the barycentric coordinates (b1, b2) of the second and third
// corner.
template <class S>
void interpolate_shading(const Mesh& mesh, S b1, S b2, SurfacePoint<S>& point) {
  // A face that is narrower than the rounding of its points has no coordinates across: its middle
  // stands for all.
  if (!(std::fabs(value(b1)) <= 2 && std::fabs(value(b2)) <= 2)) b1 = b2 = S(1.0 / 3);
  const S b0 = 1.0 - b1 - b2;
  const FaceIndices& ids = mesh.normal_ids[point.face.face.index()];
  const FaceIndices& vertices = mesh.face(point.face.face);
  Vec3<S> n[3];
  S h[3];
  for (int k = 0; k < 3; ++k) {
    const Vec3d& a = mesh.normals[ids[k]];
    n[k] = {a.x, a.y, a.z};
    h[k] = mesh.horizon[vertices[k]];
    if constexpr (!std::is_same_v<S, double>) {
      if (!mesh.normal_tangents.empty()) {
        const Vec3<Lanes>& d = mesh.normal_tangents[ids[k]];
        n[k] = {{a.x, d.x}, {a.y, d.y}, {a.z, d.z}};
      }
      if (!mesh.horizon_tangents.empty()) h[k].d = mesh.horizon_tangents[vertices[k]];
    }
  }
  point.n_s = normalize(Vec3<S>{interpolate(b0, b1, b2, n[0].x, n[1].x, n[2].x),
                                interpolate(b0, b1, b2, n[0].y, n[1].y, n[2].y),
                                interpolate(b0, b1, b2, n[0].z, n[1].z, n[2].z)});
  point.horizon = interpolate(b0, b1, b2, h[0], h[1], h[2]);
}

// Brings what interpolate_shading reads into the cache, while the plane is still to be met.
template <class S>
void fetch_shading(const Mesh& mesh, FaceId face) {
  const auto fetch = [](const auto& values, uint32_t i) {
    const char* begin = reinterpret_cast<const char*>(&values[i]);
    __builtin_prefetch(begin);
    if (sizeof(values[i]) > 64) __builtin_prefetch(begin + sizeof(values[i]) - 1);
  };
  const FaceIndices& ids = mesh.normal_ids[face.index()];
  const FaceIndices& vertices = mesh.face(face);
  for (int k = 0; k < 3; ++k) {
    fetch(mesh.normals, ids[k]);
    fetch(mesh.horizon, vertices[k]);
    if constexpr (!std::is_same_v<S, double>) {
      if (!mesh.position_tangents.empty()) fetch(mesh.position_tangents, vertices[k]);
      if (!mesh.normal_tangents.empty()) fetch(mesh.normal_tangents, ids[k]);
      if (!mesh.horizon_tangents.empty()) fetch(mesh.horizon_tangents, vertices[k]);
    }
  }
}

template <class S, class P>
void place_on_plane(const Mesh& mesh, const Vec3<S>& origin, const Vec3<S>& direction,
                    SurfacePoint<S>& point) {
  if (mesh.normal_source != NormalSource::kFace) fetch_shading<S>(mesh, point.face.face);
  const auto corners = face_corners<P>(mesh, point.face.face);
  const Vec3<P> e1 = corners[1] - corners[0];
  const Vec3<P> e2 = corners[2] - corners[0];
  const Vec3<P> n = cross(e1, e2);
  const S t = dot(corners[0] - origin, n) / dot(n, direction);
  point.p = origin + direction * t;
  const P n_length = length(n);
  point.n_g = value(n) / value(n_length);
  if (mesh.normal_source == NormalSource::kFace) {
    const Vec3<P> unit = n / n_length;
    point.n_s = {S(unit.x), S(unit.y), S(unit.z)};
    return;
  }
  const Vec3<S> q = point.p - corners[0];
  const P inverse = 1.0 / dot(n, n);
  interpolate_shading<S>(mesh, dot(cross(q, e2), n) * inverse, dot(cross(e1, q), n) * inverse,
                         point);
}

// A point that no parameter moves.
inline SurfacePoint<Dual> as_dual(const SurfacePoint<double>& point) {
  const auto still = [](const Vec3d& v) { return Vec3<Dual>{v.x, v.y, v.z}; };
  return {point.shape, point.face, still(point.p), point.n_g, still(point.n_s), point.horizon};
}

}  // namespace detail

// Where the line origin + t direction meets the plane of the face: the point that slides along the
// ray while the face moves and the ray is held (or moves as its Dual says).
template <class S>
SurfacePoint<S> surface_on_ray(const Scene& scene, FaceRef face, const Vec3<S>& origin,
                               const Vec3<S>& direction) {
  SurfacePoint<S> point;
  point.shape = &scene.shape(face.shape);
  point.face = face;
  const Mesh& mesh = point.shape->mesh;
  if constexpr (std::is_same_v<S, Dual>) {
    if (!mesh.position_tangents.empty()) {
      detail::place_on_plane<S, Dual>(mesh, origin, direction, point);
      return point;
    }
    if (is_still(origin) && is_still(direction) && mesh.normal_tangents.empty()) {
      return detail::as_dual(surface_on_ray<double>(scene, face, value(origin), value(direction)));
    }
  }
  detail::place_on_plane<S, double>(mesh, origin, direction, point);
  return point;
}

// The scattering function at a surface point for a fixed direction to the viewer.
template <class S>
class Scattering {
 public:
  // wi: unit, towards the viewer.
  Scattering(const SurfacePoint<S>& point, const Vec3<S>& wi, ShadingModel model)
      : wi_(wi), n_s_(point.n_s), horizon_(point.horizon) {
    const bool mitsuba = model == ShadingModel::kMitsuba;
    const bool front = dot(mitsuba ? value(point.n_s) : point.n_g, value(wi)) > 0;
    bsdf_ = point.shape->bsdf->side(front);
    if (!front) n_s_ = -n_s_;
    n_ = n_s_;
    limited_ = !mitsuba && point.shape->mesh.normal_source != NormalSource::kFace;
    if (limited_) bend();
    if constexpr (std::is_same_v<S, Dual>) {
      still_ = is_still(n_s_) && is_still(wi_) && is_still(horizon_) && bsdf_ && bsdf_->is_still();
    }
    if constexpr (std::is_same_v<S, Var>) {
      copies_ = Tape::current()->slots()->bsdfs[point.face.shape.index()][front];
      still_ = is_still(n_s_) && is_still(wi_) && is_still(horizon_) && !copies_;
    }
  }

  bool black() const { return bsdf_ == nullptr; }
  const Bsdf& bsdf() const { return *bsdf_; }
  const Vec3<S>& normal() const { return n_; }
  const Vec3<S>& wi() const { return wi_; }

  // Value times cosine [1/sr] for the unit direction wo towards the light: held fixed (double), or
  // moving as its Dual says (towards a delta light).
  template <class W>
  Rgb<S> eval(const Vec3<W>& wo) const {
    const Vec3<S> w{wo.x, wo.y, wo.z};
    if (!limited_) return detail::eval_bsdf<S>(*bsdf_, copies_, n_, wi_, w);
    const S factor = horizon_factor(wo);
    if (value(factor) == 0) return {};
    return detail::eval_bsdf<S>(*bsdf_, copies_, n_, wi_, w) * factor;
  }
  // The value of eval for a direction that is held, at the cost of plain numbers; to rounding.
  Rgb<double> eval_value(const Vec3d& wo) const {
    const double factor = limited_ ? horizon_value(wo) : 1;
    return factor == 0 ? Rgb<double>{} : bsdf_->eval(value(n_), value(wi_), wo) * factor;
  }
  // The part of eval's derivative that comes from the motion of wo alone.
  Rgb<Lanes> eval_derivative(const Vec3<Dual>& wo) const {
    Scattering<Dual> still(*this);
    still.hold();
    Rgb<Dual> f = still.eval(wo);
    if (!bsdf_->is_still()) f = f - still.eval(value(wo));
    Rgb<Lanes> result;
    for (int k = 0; k < kLanes; ++k) {
      if (wo.x.d[k] == 0 && wo.y.d[k] == 0 && wo.z.d[k] == 0) continue;
      for (int c = 0; c < 3; ++c) result[c][k] = f[c].d[k];
    }
    return result;
  }
  double pdf_solid_angle(const Vec3d& wo) const {
    return bsdf_->pdf_solid_angle(value(n_), value(wi_), wo);
  }
  // Both at once.
  struct Evaluation {
    Rgb<S> value;
    double pdf;
  };
  Evaluation eval_with_pdf(const Vec3d& wo) const {
    if constexpr (!std::is_same_v<S, double>) {
      if (!still_) return {eval(wo), pdf_solid_angle(wo)};
    }
    const double factor = limited_ ? value(horizon_factor(wo)) : 1.0;
    const BsdfValue f = bsdf_->eval_with_pdf(value(n_), value(wi_), wo);
    const Rgb<double> c = f.value * factor;
    return {{S(c.r), S(c.g), S(c.b)}, f.pdf};
  }
  std::optional<Vec3d> sample(double u1, double u2) const {
    return bsdf_->sample(value(n_), value(wi_), u1, u2);
  }

 private:
  // Drops all derivatives.
  void hold() {
    const auto constant = [](const Vec3<S>& v) {
      return Vec3<S>{value(v.x), value(v.y), value(v.z)};
    };
    wi_ = constant(wi_);
    n_s_ = constant(n_s_);
    n_ = constant(n_);
    horizon_ = S(value(horizon_));
  }
  void bend() {
    const double limit = 0.01;  // e above; not tuned: any small number is continuous
    const S c = dot(n_s_, wi_);
    if (value(c) < limit) n_ = normalize(n_s_ + wi_ * (limit - c));
  }
  template <class W>
  S horizon_factor(const Vec3<W>& wo) const {
    const S c = dot(n_s_, wo);
    if (value(c) <= value(horizon_)) return S(0.0);
    const S width = horizon_ * (1.0 - horizon_);
    const S above = c - horizon_;
    if (value(above) >= value(width)) return S(1.0);
    return above / width;
  }

  // horizon_factor without derivatives.
  double horizon_value(const Vec3d& wo) const {
    const double c = dot(value(n_s_), wo), h = value(horizon_);
    if (c <= h) return 0;
    return std::min(1.0, (c - h) / (h * (1 - h)));
  }

  Vec3<S> wi_, n_s_, n_;
  S horizon_;
  const Bsdf* bsdf_ = nullptr;
  const SeededCopies<Bsdf>* copies_ = nullptr;  // Var: of bsdf_, if its parameters have slots
  bool limited_ = false;
  bool still_ = false;  // no parameter of the pass moves it while wo is held (not for double)
};

}  // namespace limn
