// Caustics by particles, see blurred_particles.h.
#include "integrators/paths/blurred_particles.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "integrators/paths/blurred_hits.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_directions.h"
#include "limn/core/bounds.h"
#include "limn/core/error.h"
#include "limn/core/shading.h"

namespace limn {

template <class S>
class BlurredParticles::Particle {
 public:
  Particle(const BlurredScene& scene, const Rng& key, RayCount& rays)
      : s_(scene), scene_(scene.scene()), key_(key), hits_(scene, rays) {}

  bool follow(const EmittingFace& from, const Vec3d& center, double radius, FilmSample& sample) {
    start(from, center, radius);
    if (detail::stays_black(flux_)) return false;
    for (int turns = 0; scene_.max_depth < 0 || turns + 1 < scene_.max_depth; ++turns) {
      const auto face = draw(key_.at(Purpose::kEdgeSide, turns));
      if (!face) return false;
      const SurfacePoint<S> surface = surface_on_ray<S>(scene_, *face, ray_.origin, ray_.direction);
      const Scattering<S> back(surface, -ray_.direction, scene_.shading);
      if (back.black()) return false;
      Rng rng = key_.at(Purpose::kBsdf, turns);
      const bool may_end = turns > 0 && back.is_rough();
      const double ends = !may_end ? 0 : back.is_smooth() ? 0.5 : 1;  // not tuned
      if (rng.uniform() < ends) {
        flux_ = flux_ * (1 / ends);
        return connect(surface, sample);
      }
      flux_ = flux_ * (1 / (1 - ends));
      if (!turn(surface, back, rng.uniform()) || !survives(turns)) return false;
    }
    return false;
  }

 private:
  // A point of the face, which moves with it, and a direction to where smooth surfaces are, which
  // is held.
  void start(const EmittingFace& from, const Vec3d& center, double radius) {
    const FaceRef face = s_.emitters().face(from.piece);
    const Shape& shape = scene_.shape(face.shape);
    const auto c = face_corners<S>(shape.mesh, face.face);
    const Vec3<S> e1 = c[1] - c[0], e2 = c[2] - c[0], n = cross(e1, e2);
    Rng rng = key_.at(Purpose::kEmitter, 0);
    const auto [place, share] =
        draw_point(from.piece, {value(c[0]), value(c[1]), value(c[2])}, rng);
    const double over = 1 / length_squared(value(n));
    const Vec3d q = place - value(c[0]);
    ray_.origin = c[0] + e1 * S(dot(cross(q, value(e2)), value(n)) * over) +
                  e2 * S(dot(cross(value(e1), q), value(n)) * over);
    const Vec3d axis = center - place;
    const double distance = length(axis);
    const double least = distance > radius ? std::sqrt(1 - std::pow(radius / distance, 2)) : -1;
    const double z = 1 - rng.uniform() * (1 - least), angle = 2 * kPi * rng.uniform();
    const double r = std::sqrt(std::max(0.0, 1 - z * z));
    const Vec3d wo =
        Frame(axis * (1 / distance)).to_world({r * std::cos(angle), r * std::sin(angle), z});
    ray_.direction = detail::moving<S>(wo, nullptr);
    ray_.start = face;
    ray_.bounces = 1;                            // not the camera's
    const S projected = dot(n, ray_.direction);  // the cosine times twice the face's area
    if (!(value(projected) > 0)) return;
    // Its opacity, beside those of its neighbours.
    const Vec3<S> unit = normalize(n);
    const double height = 1e-3 * s_.blur().reach();
    BlurredRay<S> onto{ray_.origin + unit * S(height), -unit, 0, 2 * height};
    onto.bounces = 1;
    const double constant = std::sqrt(over) * 2 * kPi * (1 - least) * share / from.density;
    flux_ = detail::emitter_radiance<S>(shape, face.shape) *
            (projected * constant * hits_.unhidden(onto, face));
  }
  // One of several points of a piece, drawn by its opacity, and the mean opacity over its own. A
  // small light is enlarged to much more than itself, which is nearly transparent.
  std::pair<Vec3d, double> draw_point(FaceRef piece, const std::array<Vec3d, 3>& corners,
                                      Rng& rng) const {
    constexpr int kPoints = 8;  // not tuned
    const auto c = face_corners<double>(s_.emitters().scene().shape(piece.shape).mesh, piece.face);
    Vec3d chosen;
    double own = 0, sum = 0;
    for (int k = 0; k < kPoints; ++k) {
      const double r = std::sqrt(rng.uniform()), t = rng.uniform();
      const Vec3d x = c[0] * (1 - r) + c[1] * (r * (1 - t)) + c[2] * (r * t);
      const double opacity = blur_opacity(distance_to_sides(corners, x), s_.blur().sigma);
      sum += opacity;
      if (!(rng.uniform() * sum < opacity)) continue;
      chosen = x;
      own = opacity;
    }
    return {chosen, own > 0 ? sum / (kPoints * own) : 0};
  }

  // One of the faces that the ray meets, by its weight, whose derivative is a factor.
  std::optional<FaceRef> draw(Rng rng) {
    const size_t k = hits_.draw(ray_, rng);
    const S& weight = hits_.weight(k);
    flux_ = flux_ * (weight * (1 / value(weight)));
    return hits_.face(k);
  }

  // Goes on by a smooth ray. Flux does not change with the square of the index of refraction;
  // radiance does, and back the other way.
  bool turn(const SurfacePoint<S>& surface, const Scattering<S>& back, double u) {
    using std::sqrt;
    if (!back.is_smooth()) return false;
    const SmoothShares shares = back.shares();
    const std::optional<int> k = detail::choose_smooth(shares, u);
    if (!k || !(shares.ray[*k] > 0)) return false;
    const SmoothRay<S> ray = back.smooth_ray(*k);
    const Scattering<S> front(surface, ray.wo, scene_.shading);
    if (front.black()) return false;
    const SmoothRay<S> there = front.smooth_ray(*k);
    // Not where a mapped normal is bent for one of its viewers alone.
    if (!(dot(value(there.wo), value(ray_.direction)) < -0.999)) return false;
    for (int c = 0; c < 3; ++c) {
      flux_[c] = flux_[c] * sqrt(ray.weight[c] * there.weight[c]) * (1 / shares.ray[*k]);
    }
    ray_.origin = surface.p;
    ray_.direction = ray.wo;
    ray_.start = surface.face;
    return !detail::stays_black(flux_);
  }
  bool survives(int turns) {
    constexpr double kSurvival = 0.95;  // not tuned
    if (turns < scene_.rr_depth) return true;
    flux_ = flux_ * (1 / kSurvival);
    return key_.at(Purpose::kRoulette, turns).uniform() < kSurvival;
  }

  // From the surface to the camera.
  bool connect(const SurfacePoint<S>& surface, FilmSample& sample) {
    using std::fabs;
    const Camera& camera = scene_.camera;
    const CameraView<S> view = CameraView<S>(camera).at(sample_lens(camera, key_));
    const S depth = view.depth(surface.p);
    if (depth < camera.near_clip || depth > camera.far_clip) return false;
    if (scene_.hide_emitters && surface.shape->is_emitter) return false;
    const Vec3<S> to = surface.p - view.origin();
    const S distance = length(to);
    const Vec3<S> seen = to * (1.0 / distance);
    const Scattering<S> front(surface, -seen, scene_.shading);
    if (front.black()) return false;
    // The density of the surface on the film [1/area per pixel^2], over the light's cosine.
    const auto plane = view.plane(0, 0);
    const S cosines = dot(surface.n_s, seen) / dot(surface.n_s, ray_.direction);
    const S density =
        cosines * distance / (length(cross(plane.u, plane.v)) * depth * depth * depth);
    // Up to the near plane: what is before it is not seen.
    BlurredRay<S> way{surface.p, -seen};
    way.t_max = value(distance) * (1 - camera.near_clip / value(depth));
    way.start = surface.face;
    const S scale = (value(density) < 0 ? -density : density) * hits_.unhidden(way, {});
    const Rgb<S> light = flux_ * front.eval(-ray_.direction) * scale;
    const auto place = view.project(surface.p);
    sample.x = value(place.x);
    sample.y = value(place.y);
    sample.radiance = value(light);
    if constexpr (std::is_same_v<S, Dual>) {
      sample.value = {light.r.d, light.g.d, light.b.d};
      sample.moves = {place.x.d, place.y.d};
    }
    return !detail::stays_black(light);
  }

  const BlurredScene& s_;
  const Scene& scene_;
  const Rng& key_;
  BlurredHits<S> hits_;
  BlurredRay<S> ray_;
  Rgb<S> flux_;
};

BlurredParticles::BlurredParticles(const BlurredScene& scene) : scene_(scene) {
  if (!scene.blur().particles) return;
  if (scene.scene().camera.is_orthographic()) {
    throw InputError({scene.scene().file}, "particles need a perspective or thinlens sensor");
  }
  Bounds smooth;
  for (const Shape& shape : scene.scene().shapes) {
    const auto is_smooth = [&](bool front) {
      const Bsdf* side = shape.bsdf->side(front);
      return side && side->lobes().smooth;
    };
    if (!is_smooth(true) && !is_smooth(false)) continue;
    for (const Vec3f& x : shape.mesh.positions) smooth.extend(cast<double>(x));
  }
  if (!(smooth.lower.x <= smooth.upper.x)) return;
  center_ = smooth.center();
  radius_ = 0.5 * smooth.diagonal() + 3 * scene.blur().reach();  // as mitres are cut
  double sum = 0;
  const Scene& emitters = scene.emitters().scene();
  for (uint32_t s = 0; s < emitters.shapes.size(); ++s) {
    const Mesh& mesh = emitters.shapes[s].mesh;
    const auto radiance = detail::emitter_radiance<Dual>(emitters.shapes[s], ShapeId(s));
    if (mesh.faces.empty() || detail::stays_black(radiance)) continue;
    // A light that is black may have a radiance that grows.
    const double bright = luminance(value(radiance)) > 0 ? luminance(value(radiance)) : 1;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const auto c = face_corners<double>(mesh, FaceId(f));
      const double area = 0.5 * length(cross(c[1] - c[0], c[2] - c[0]));
      if (!(area > 0)) continue;
      sum += area * bright;
      faces_.push_back({{ShapeId(s), FaceId(f)}, bright, sum});
    }
  }
  for (EmittingFace& f : faces_) {
    f.density /= sum;
    f.upto /= sum;
  }
}

template <class S>
bool BlurredParticles::follow(double u, const Rng& key, RayCount& rays, FilmSample& sample) const {
  const auto from = std::lower_bound(faces_.begin(), faces_.end() - 1, u,
                                     [](const EmittingFace& f, double x) { return f.upto < x; });
  return Particle<S>(scene_, key, rays).follow(*from, center_, radius_, sample);
}

template bool BlurredParticles::follow<double>(double u, const Rng& key, RayCount& rays,
                                               FilmSample& sample) const;
template bool BlurredParticles::follow<Dual>(double u, const Rng& key, RayCount& rays,
                                             FilmSample& sample) const;

}  // namespace limn
