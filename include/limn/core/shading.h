#pragma once
// The scattering function at a point of a surface, over any scalar.
//
// The default scattering function is continuous in position and in both directions wherever normals
// are interpolated, so that a gradient needs no edges but those of edges.h. With n_s the
// interpolated and n_g the geometric normal:
//
//  - the side of the surface follows n_g, which changes sides only at silhouettes;
//  - where n_s turns away from the viewer (n_s.wi < e) the BSDF is evaluated with the normal
//        n = normalize(n_s + (e - n_s.wi) wi),
//    which meets n_s at n_s.wi = e and keeps n.wi > 0;
//  - what lies below the face but above the shading normal's plane, n_g.wo <= 0 < n_s.wo, is seen
//    from a point above the face (surface_point.h), so that rays never start inside the mesh and no
//    factor has to hide them. What passes the surface is seen from a point on its other side in
//    the same way.
//
// Flat-shaded meshes have n_s = n_g, and are left as they are.
#include <optional>

#include "limn/core/slots.h"
#include "limn/core/surface_point.h"
#include "limn/core/textures_at.h"

namespace limn {

// The scattering function at a surface point for a fixed direction to the viewer.
template <class S>
class Scattering {
 public:
  // wi: unit, towards the viewer.
  Scattering(const SurfacePoint<S>& point, const Vec3<S>& wi, ShadingModel model)
      : wi_(wi), n_(point.n_s) {
    const bool mitsuba = model == ShadingModel::kMitsuba;
    front_ = dot(mitsuba ? value(point.n_s) : point.n_g, value(wi)) > 0;
    bsdf_ = point.shape->bsdf->side(front_);
    if (!front_) n_ = -n_;
    if (!mitsuba && point.shape->mesh.normal_source != NormalSource::kFace) bend();
    if (bsdf_ && bsdf_->texture_count() > 0) textures_.resolve(*bsdf_, point);
    if (bsdf_ && is_smooth()) share_by(by_);
    if constexpr (std::is_same_v<S, Dual>) {
      still_ = is_constant(n_) && is_constant(wi_) && bsdf_ && bsdf_->is_constant() &&
               textures_.constant();
    }
    if constexpr (std::is_same_v<S, Var>) {
      copies_ = Tape::current()->slots()->bsdfs[point.face.shape.index()][front_];
      still_ = is_constant(n_) && is_constant(wi_) && !copies_ && textures_.constant();
    }
  }

  bool black() const { return bsdf_ == nullptr; }
  bool front() const { return front_; }  // which side of the surface is seen
  const Bsdf& bsdf() const { return *bsdf_; }
  const Vec3<S>& normal() const { return n_; }
  const Vec3<S>& wi() const { return wi_; }
  // The values of the BSDF's textures here (see Bsdf).
  const Rgb<double>* at() const { return textures_.held(); }
  LobeSummary lobe() const { return bsdf_->lobe(at()); }
  // About which the lobe lies: that of `normal`, or a mapped one.
  Vec3d lobe_normal() const { return bsdf_->scattering_normal(value(n_), value(wi_), at()); }
  Bsdf::PassedLobe passed_lobe() const { return bsdf_->passed_lobe(value(n_), value(wi_), at()); }
  // True if there is more than smooth lobes.
  bool is_rough() const { return bsdf_->is_rough(); }
  bool is_smooth() const { return bsdf_->lobes().smooth; }
  // True if wo leaves on the other side than that which wi is on.
  bool passes(const Vec3d& wo) const { return bsdf_->lobes().through && dot(value(n_), wo) < 0; }

  // The probability with which a path goes by the rough lobes: 1 where there are no others.
  double rough_share() const { return rough_share_; }
  SmoothShares shares() const { return smooth_shares(*bsdf_, value(n_), value(wi_), at(), by_); }
  void share_by(SmoothShares::By by) {
    by_ = by;
    rough_share_ = shares().rough;
  }
  // Where shares() is not evaluated: as another has it.
  void share_as(double rough_share) { rough_share_ = rough_share; }
  // The k-th of the smooth rays.
  SmoothRay<S> smooth_ray(int k) const {
    return detail::smooth_ray<S>(*bsdf_, copies_, n_, wi_, k, textures_);
  }

  // Value times cosine [1/sr] for the unit direction wo towards the light: held fixed (double), or
  // moving as its Dual says (towards a delta light).
  template <class W>
  Rgb<S> eval(const Vec3<W>& wo) const {
    const Vec3<S> w{wo.x, wo.y, wo.z};
    return detail::eval_bsdf<S>(*bsdf_, copies_, n_, wi_, w, textures_);
  }
  // The value of eval for a direction that is held, at the cost of plain numbers; to rounding.
  Rgb<double> eval_value(const Vec3d& wo) const { return eval_value(*bsdf_, wo); }
  // The same if the surface were of another material.
  Rgb<double> eval_value(const Bsdf& bsdf, const Vec3d& wo) const {
    return bsdf.eval(value(n_), value(wi_), wo, at());
  }
  // The part of eval's derivative that comes from the motion of wo alone.
  Rgb<Lanes> eval_derivative(const Vec3<Dual>& wo) const {
    Scattering<Dual> still(*this);
    still.hold();
    Rgb<Dual> f = still.eval(wo);
    if (!bsdf_->is_constant()) f = f - still.eval(value(wo));
    Rgb<Lanes> result;
    for (int k = 0; k < kLanes; ++k) {
      if (wo.x.d[k] == 0 && wo.y.d[k] == 0 && wo.z.d[k] == 0) continue;
      for (int c = 0; c < 3; ++c) result[c][k] = f[c].d[k];
    }
    return result;
  }
  // Of directions that a path takes by the rough lobes: integrates to rough_share(), or less.
  double pdf_solid_angle(const Vec3d& wo) const {
    return rough_share_ * bsdf_->pdf_solid_angle(value(n_), value(wi_), wo, at());
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
    return held(bsdf_->eval_with_pdf(value(n_), value(wi_), wo, at()));
  }
  // From what the BSDF has there, without derivatives.
  Evaluation held(const BsdfValue& f) const {
    return {{S(f.value.r), S(f.value.g), S(f.value.b)}, rough_share_ * f.pdf};
  }
  // By the rough lobes.
  std::optional<Vec3d> sample(double u1, double u2) const {
    return bsdf_->sample(value(n_), value(wi_), u1, u2, at());
  }

 private:
  // Drops all derivatives.
  void hold() {
    const auto constant = [](const Vec3<S>& v) {
      return Vec3<S>{value(v.x), value(v.y), value(v.z)};
    };
    wi_ = constant(wi_);
    n_ = constant(n_);
    textures_.hold();
  }
  void bend() {
    const double limit = 0.01;  // e above; not tuned: any small number is continuous
    const S c = dot(n_, wi_);
    if (value(c) < limit) n_ = normalize(n_ + wi_ * (limit - c));
  }

  Vec3<S> wi_, n_;
  const Bsdf* bsdf_ = nullptr;
  TexturesAt<S> textures_;
  const SeededCopies<Bsdf>* copies_ = nullptr;  // Var: of bsdf_, if its parameters have slots
  SmoothShares::By by_ =
      std::is_same_v<S, double> ? SmoothShares::By::kWeight : SmoothShares::By::kSlope;
  double rough_share_ = 1;
  bool front_ = false;
  bool still_ = false;  // no parameter of the pass moves it while wo is held (not for double)
};

}  // namespace limn
