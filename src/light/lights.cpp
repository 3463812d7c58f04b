// Light selection, and code shared by all kinds of lights.
#include "limn/core/lights.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/check.h"
#include "limn/core/renew.h"
#include "src/base/wide.h"

namespace limn {
namespace {

// Probability of a uniform choice: the light with the largest estimate may be occluded.
constexpr double kAny = 0.25;

}  // namespace

std::optional<LightSample> DeltaLight::sample(const Vec3d& p, double probability,
                                              const LightNumbers&) const {
  const auto arrival = arriving(p);
  if (!arrival) return {};
  const LightOrigin from = origin();
  const double distance =
      from.infinite ? std::numeric_limits<double>::infinity() : length(value(from.v) - p);
  return LightSample{arrival->wo, distance, probability, {}, this};
}

std::optional<LightSample> Environment::light_sample(const Drawn& drawn, double probability) const {
  const double density = drawn.pdf * probability;
  if (!(density > 0)) return {};
  return LightSample{drawn.direction, std::numeric_limits<double>::infinity(), density, {}, this,
                     drawn.place};
}

Lights::Lights(const Scene& scene, const Lights* chosen_by)
    : of_shape_(scene.shapes.size()), environment_(scene.environment.get()), chosen_by_(chosen_by) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (!scene.shapes[s].is_emitter) continue;
    area_lights_.push_back(make_area_light(scene, ShapeId(s)));
    of_shape_[s] = all_.size();
    all_.push_back(area_lights_.back().get());
  }
  if (environment_) all_.push_back(environment_);
  for (const auto& light : scene.delta_lights) all_.push_back(light.get());
  of_any_ = 1 / static_cast<double>(std::max<size_t>(1, all_.size()));
  for (const auto& light : area_lights_) reaches_.push_back(reach_of(*light));
  if (environment_) {
    Reach& reach = reaches_.emplace_back();
    reach.constant = kPi * std::fabs(environment_->mean_luminance());
  }
}

Lights::Reach Lights::reach_of(const Light& light) {
  std::vector<LightTriangle> triangles;
  light.add_triangles(triangles);
  Reach reach;
  double area = 0;
  for (const LightTriangle& triangle : triangles) {
    const auto& c = triangle.corners;
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]) * 0.5;
    reach.facing = reach.facing + n;
    reach.center = reach.center + (c[0] + c[1] + c[2]) * (length(n) / 3);
    reach.luminance = triangle.luminance;
    area += length(n);
  }
  reach.center = reach.center / area;
  reach.rest = (area - length(reach.facing)) / 4;
  reach.spread = area / kPi;
  return reach;
}

// Estimated irradiance on a surface that faces the light, unoccluded. Exact on the axis of a disk
// and far from a sphere. Clamped at 0, since finite differences may make radiance negative.
double Lights::estimate(size_t light, const Vec3d& p) const {
  if (chosen_by_) return chosen_by_->estimate(light, p);
  if (light >= reaches_.size()) {
    const auto arrival = all_[light]->delta()->arriving(p);
    return arrival ? std::fabs(luminance(arrival->irradiance)) : 0;
  }
  return estimate(reaches_[light], p);
}

template <class S>
S Lights::estimate(const Reach& reach, const Vec3<S>& p) {
  using std::max, std::sqrt;
  if (reach.luminance == 0) return reach.constant;
  const Vec3<S> to = p - reach.center;
  const S squared = length_squared(to);
  constexpr double kTiny = 1e-300;  // at the very center `shown` is 0
  const S shown = max(dot(reach.facing, to), S(0.0)) / sqrt(squared + kTiny);
  return reach.constant +
         std::fabs(reach.luminance) * (shown + reach.rest) / (squared + reach.spread);
}

Lights::Point Lights::at(const Vec3d& p) const {
  Point place{p};
  if (all_.size() < 2) return place;
  for (size_t k = 0; k < all_.size(); ++k) {
    const double of_light = estimate(k, p);
    if (k < place.first.size()) place.first[k] = of_light;
    place.sum += of_light;
  }
  if (!std::isfinite(place.sum)) place.sum = 0;
  return place;
}

void Lights::at(std::span<const Vec3d* const> p, std::span<Point* const> places) const {
  if (chosen_by_) {
    chosen_by_->at(p, places);
    return;
  }
  if (all_.size() < 2) {
    for (size_t i = 0; i < p.size(); ++i) *places[i] = Point{*p[i]};
    return;
  }
  wide::for_blocks(p.size(), [&](size_t first, size_t last) {
    const auto of = [&](int i) { return p[std::min(first + i, last - 1)]; };
    const wide::Vec points = wide::gather_vectors(of);
    Point some[wide::kWidth];
    for (size_t k = 0; k < all_.size(); ++k) {
      const auto of_light = [&] {
        if (k < reaches_.size()) return estimate(reaches_[k], points);
        return wide::gather([&](int i) { return estimate(k, *of(i)); });
      }();
      for (int i = 0; i < wide::kWidth; ++i) {
        if (k < some[i].first.size()) some[i].first[k] = of_light[i];
        some[i].sum += of_light[i];
      }
    }
    for (size_t i = first; i < last; ++i) {
      Point& place = some[i - first];
      if (!std::isfinite(place.sum)) place.sum = 0;
      place.p = *p[i];
      *places[i] = place;
    }
  });
}

double Lights::probability(const Point& place, size_t light) const {
  if (!(place.sum > 0)) return of_any_;
  return kAny * of_any_ + (1 - kAny) * estimate(light, place) / place.sum;
}

size_t Lights::choose(const Point& place, double u) const {
  if (all_.size() == 1) return 0;
  const double any = place.sum > 0 ? kAny : 1;
  const size_t last = all_.size() - 1;
  if (u < any) {
    return std::min(static_cast<size_t>(u / any * static_cast<double>(all_.size())), last);
  }
  size_t light = 0;
  double left = (u - any) / (1 - any) * place.sum;
  while (light < last && (left -= estimate(light, place)) >= 0) ++light;
  return light;
}

void Lights::sample(std::span<const Draw> draws, std::span<const Numbers> u) const {
  DCHECK_LE(draws.size(), kMostDraws);
  DCHECK_EQ(draws.size(), u.size());
  // Samples of the environment are collected and drawn as one batch.
  Environment::Numbers numbers[kMostDraws];
  Environment::Drawn drawn[kMostDraws];
  size_t of[kMostDraws], count = 0;
  for (size_t i = 0; i < draws.size(); ++i) {
    const Point& place = *draws[i].place;
    const size_t light = choose(place, u[i][0]);
    if (environment_ && light == area_lights_.size()) {
      of[count] = i;
      numbers[count++] = {u[i][1], u[i][2]};
    } else {
      renew(*draws[i].sample, [&] {
        return all_[light]->sample(place.p, probability(place, light), {u[i][1], u[i][2], u[i][3]});
      });
    }
  }
  if (count == 0) return;
  environment_->sample_directions({numbers, count}, {drawn, count});
  for (size_t k = 0; k < count; ++k) {
    const Draw& draw = draws[of[k]];
    const double share = probability(*draw.place, area_lights_.size());
    renew(*draw.sample, [&] { return environment_->light_sample(drawn[k], share); });
  }
}

std::optional<LightSample> Lights::sample(const Point& place, Rng& rng) const {
  Numbers u;
  for (double& number : u) number = rng.uniform();
  std::optional<LightSample> sample;
  const Draw draw{&place, &sample};
  this->sample({&draw, 1}, {&u, 1});
  return sample;
}

}  // namespace limn
