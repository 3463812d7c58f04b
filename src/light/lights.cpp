// Light selection, and code shared by all kinds of lights.
#include "limn/core/lights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "limn/core/check.h"
#include "limn/core/renew.h"
#include "src/base/wide.h"

namespace limn {
namespace {

// Probability of a uniform choice: the light with the largest estimate may be occluded.
constexpr double kAny = 0.25;
// Of fewer lights all estimates are made. Not tuned.
constexpr size_t kMany = 32;

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

Lights::Lights(const Scene& scene, const Lights* chosen_by, DrawFaces draw,
               std::shared_ptr<const Environment> environment)
    : of_shape_(scene.shapes.size()),
      environment_(environment ? std::move(environment) : scene.environment),
      chosen_by_(chosen_by) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (!scene.shapes[s].is_emitter) continue;
    area_lights_.push_back(
        make_area_light(scene, ShapeId(s), chosen_by_ ? DrawFaces::kByArea : draw));
    of_shape_[s] = all_.size();
    all_.push_back(area_lights_.back().get());
  }
  if (environment_) all_.push_back(environment_.get());
  for (const auto& light : scene.delta_lights) all_.push_back(light.get());
  of_any_ = 1 / static_cast<double>(std::max<size_t>(1, all_.size()));
  for (const auto& light : area_lights_) reaches_.push_back(reach_of(*light));
  if (environment_) {
    Reach& reach = reaches_.emplace_back();
    reach.constant = kPi * std::fabs(environment_->mean_luminance());
  }
  if (all_.size() > kMany && !chosen_by_) grow_tree();
}

// Of the lights that have a place.
void Lights::grow_tree() {
  std::vector<LightTree::Emitter> emitters;
  for (size_t k = 0; k < all_.size(); ++k) {
    const DeltaLight* delta = all_[k]->delta();
    of_light_.push_back(emitters.size());
    if (k < area_lights_.size()) {
      const Reach& reach = reaches_[k];
      const double luminance = std::fabs(reach.luminance);
      emitters.push_back({reach.center, reach.facing * luminance, reach.rest * luminance,
                          reach.spread, luminance * reach.spread * kPi});
    } else if (delta && !delta->origin().infinite) {
      const double power = std::fabs(delta->power());
      emitters.push_back({value(delta->origin().v), {}, power, 0, power});
    } else {
      of_light_.back() = kListed;
      listed_.push_back(k);
      continue;
    }
    in_tree_.push_back(k);
  }
  if (emitters.size() > kMany) tree_ = LightTree(emitters);
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
  if (chosen_by_) return chosen_by_->at(p);
  Point place{p};
  if (all_.size() < 2) return place;
  if (grows()) {
    place.first[0] = place.sum = tree_.irradiance(p);
    for (const size_t light : listed_) place.sum += estimate(light, p);
    if (!std::isfinite(place.sum)) place.sum = 0;
    return place;
  }
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
  if (grows()) {
    for (size_t i = 0; i < p.size(); ++i) *places[i] = at(*p[i]);
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
  if (chosen_by_) return chosen_by_->probability(place, light);
  const bool in_tree = grows() && of_light_[light] != kListed;
  const double estimated = in_tree ? place.first[0] * tree_.probability(place.p, of_light_[light])
                                   : estimate(light, place);
  return kAny * of_any_ + (1 - kAny) * estimated / place.sum;
}

size_t Lights::choose(const Point& place, double u) const {
  if (all_.size() == 1) return 0;
  if (chosen_by_) return chosen_by_->choose(place, u);
  const double any = place.sum > 0 ? kAny : 1;
  const size_t last = all_.size() - 1;
  if (u < any) {
    return std::min(static_cast<size_t>(u / any * static_cast<double>(all_.size())), last);
  }
  double left = (u - any) / (1 - any) * place.sum;
  if (grows()) {
    if (left < place.first[0] || listed_.empty()) {
      const double u_in_tree = std::min(left / place.first[0], 1 - 0x1p-53);
      return in_tree_[tree_.choose(place.p, u_in_tree)];
    }
    left -= place.first[0];
    size_t i = 0;
    while (i + 1 < listed_.size() && (left -= estimate(listed_[i], place)) >= 0) ++i;
    return listed_[i];
  }
  size_t light = 0;
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
    // The first two numbers, which alone fill every square evenly (rng.cpp), place on the light.
    const size_t light = choose(place, u[i][3]);
    if (environment_ && light == area_lights_.size()) {
      of[count] = i;
      numbers[count++] = {u[i][0], u[i][1]};
    } else {
      renew(*draws[i].sample, [&] {
        return all_[light]->sample(place.p, probability(place, light), {u[i][2], u[i][0], u[i][1]});
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
