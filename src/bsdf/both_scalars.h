#pragma once
// A BSDF that writes each formula once, as a template over the scalar.
#include <memory>

#include "src/bsdf/sides.h"

namespace limn {

// Own derives from this and has, for any S, what Bsdf has for double and Dual:
//   Rgb<S> evaluate(n, wi, wo, at), which is eval, and
//   int rays(n, wi, rays, at), which is smooth_rays;
// over a Base with two sides `front` may come first. What Own lacks stays as Base has it.
template <class Own, class Base = SidedBsdf>
class BothScalars : public Base {
 public:
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<Own>(own()); }

 protected:
  using Base::Base;

 private:
  const Own& own() const { return static_cast<const Own&>(*this); }

  template <class S>
  Rgb<S> evaluated(bool front, const Vec3<S>& n, const Vec3<S>& wi, const Vec3<S>& wo,
                   const Rgb<S>* at) const {
    if constexpr (requires { own().evaluate(front, n, wi, wo, at); }) {
      return own().evaluate(front, n, wi, wo, at);
    } else if constexpr (requires { own().evaluate(n, wi, wo, at); }) {
      return own().evaluate(n, wi, wo, at);
    } else {
      return Base::eval_from(front, n, wi, wo, at);
    }
  }
  template <class S>
  int rays_of(bool front, const Vec3<S>& n, const Vec3<S>& wi, SmoothRays<S>& rays,
              const Rgb<S>* at) const {
    if constexpr (requires { own().rays(front, n, wi, rays, at); }) {
      return own().rays(front, n, wi, rays, at);
    } else if constexpr (requires { own().rays(n, wi, rays, at); }) {
      return own().rays(n, wi, rays, at);
    } else {
      return Base::smooth_from(front, n, wi, rays, at);
    }
  }

  Rgb<double> eval_from(bool front, const Vec3<double>& n, const Vec3<double>& wi,
                        const Vec3<double>& wo, const Rgb<double>* at) const final {
    return evaluated(front, n, wi, wo, at);
  }
  Rgb<Dual> eval_from(bool front, const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                      const Rgb<Dual>* at) const final {
    return evaluated(front, n, wi, wo, at);
  }
  int smooth_from(bool front, const Vec3<double>& n, const Vec3<double>& wi,
                  SmoothRays<double>& rays, const Rgb<double>* at) const final {
    return rays_of(front, n, wi, rays, at);
  }
  int smooth_from(bool front, const Vec3<Dual>& n, const Vec3<Dual>& wi, SmoothRays<Dual>& rays,
                  const Rgb<Dual>* at) const final {
    return rays_of(front, n, wi, rays, at);
  }
};

// Over a Base of the front alone.
template <class Own>
class BothScalars<Own, Bsdf> : public Bsdf {
 public:
  Rgb<double> eval(const Vec3<double>& n, const Vec3<double>& wi, const Vec3<double>& wo,
                   const Rgb<double>* at) const final {
    return own().evaluate(n, wi, wo, at);
  }
  Rgb<Dual> eval(const Vec3<Dual>& n, const Vec3<Dual>& wi, const Vec3<Dual>& wo,
                 const Rgb<Dual>* at) const final {
    return own().evaluate(n, wi, wo, at);
  }
  std::shared_ptr<Bsdf> clone() const override { return std::make_shared<Own>(own()); }

 private:
  const Own& own() const { return static_cast<const Own&>(*this); }
};

}  // namespace limn
