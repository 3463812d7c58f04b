#pragma once
// Light selection: all lights of a scene, one of which is chosen per sample.
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "limn/core/light.h"
#include "limn/core/light_tree.h"
#include "limn/core/scene.h"

namespace limn {

// Chooses one light at a shading point, mostly in proportion to its estimated unoccluded
// irradiance, sometimes uniformly (lights.cpp). Many lights are chosen by a tree.
// The order is: emitting shapes, the environment,
// delta lights as in the file. The scene must outlive it.
class Lights {
 public:
  // chosen_by: lights of the unperturbed scene whose probabilities are used instead, and faces are
  // drawn by area; null: its own. Finite differences use the same choice in both scenes. Otherwise
  // another light or face would be chosen in a few samples, whose large contributions, divided by
  // the step, would carry all of that derivative (high variance). They must outlive it.
  // environment: drawn in place of the scene's, with the same radiance (mis_compensation.h); null:
  // the scene's.
  explicit Lights(const Scene& scene, const Lights* chosen_by = nullptr,
                  DrawFaces draw = DrawFaces::kByLight,
                  std::shared_ptr<const Environment> environment = nullptr);

  bool empty() const { return all_.empty(); }
  // True if any shape emits.
  bool on_shapes() const { return !area_lights_.empty(); }
  // The environment as it is drawn; null if there is none.
  const Environment* drawn_environment() const { return environment_.get(); }
  std::span<const Light* const> all() const { return all_; }

  // A shading point with the estimated unoccluded irradiance of all lights [W / m^2, luminance].
  // Computed once per point.
  struct Point {
    Vec3d p;
    double sum = 0;
    // Estimates of the first lights, as many as that (not tuned); with a tree, its own alone.
    std::array<double, 4> first{};
  };
  Point at(const Vec3d& p) const;
  // `at` for many points, eight at a time (SIMD).
  void at(std::span<const Vec3d* const> p, std::span<Point* const> places) const;
  // Estimated unoccluded irradiance at p from a light (an index into all()), for a surface that
  // faces it [W / m^2, luminance]. With a tree, lights are not chosen in proportion to it.
  double estimate(size_t light, const Vec3d& p) const;

  // One number selects the light, the others sample it.
  using Numbers = std::array<double, 1 + std::tuple_size_v<LightNumbers>>;
  // A request for a sample at a place. Nothing means a sample of value zero (see Light::sample).
  struct Draw {
    const Point* place;
    std::optional<LightSample>* sample;
  };
  // draws[i] is sampled from u[i]; at most kMostDraws.
  static constexpr size_t kMostDraws = 64;
  void sample(std::span<const Draw> draws, std::span<const Numbers> u) const;
  std::optional<LightSample> sample(const Point& place, Rng& rng) const;
  // The density [1/sr] with which `sample` draws a hit on an emitting shape, or, for a ray that
  // leaves the scene, on the environment (which must exist).
  double pdf(const Point& place, ShapeId shape, const LightView& view) const {
    const size_t light = of_shape_[shape.index()];
    return all_[light]->pdf(place.p, view, probability(place, light));
  }
  double pdf_environment(const Point& place, const Vec3d& wo) const {
    return environment_->pdf_solid_angle(wo) * probability(place, area_lights_.size());
  }
  // Radiance and density of the environment in the static direction wo. at: Environment::find.
  template <class S>
  Environment::Sight<S> environment(const Point& place, const Vec3d& wo,
                                    const std::array<double, 2>& at) const {
    Environment::Sight<S> sight;
    environment_->look(wo, at, sight);
    sight.pdf *= probability(place, area_lights_.size());
    return sight;
  }

 private:
  // What the irradiance estimate needs of a light.
  struct Reach {
    Vec3d center;          // of the emitter's area
    Vec3d facing;          // sum of face normals times areas
    double rest = 0;       // a quarter of the area that cancels in `facing`
    double spread = 0;     // area / pi; keeps the estimate finite close to the light
    double luminance = 0;  // of its radiance
    double constant = 0;   // irradiance that is the same everywhere
  };
  static Reach reach_of(const Light& emitter);
  template <class S>
  static S estimate(const Reach& reach, const Vec3<S>& p);
  double estimate(size_t light, const Point& place) const {
    return light < place.first.size() && !grows() ? place.first[light] : estimate(light, place.p);
  }
  void grow_tree();
  bool grows() const { return !tree_.empty(); }
  size_t choose(const Point& place, double u) const;
  double probability(const Point& place, size_t light) const;

  std::vector<std::unique_ptr<Light>> area_lights_;
  std::vector<const Light*> all_;
  std::vector<Reach> reaches_;    // of all lights but delta lights
  std::vector<size_t> of_shape_;  // index of a shape's light; unspecified if it does not emit
  double of_any_ = 1;             // 1 / number of lights
  LightTree tree_;                // of many lights at finite places; else empty
  std::vector<size_t> in_tree_;   // its lights
  std::vector<size_t> listed_;    // with a tree, all others
  static constexpr size_t kListed = SIZE_MAX;
  std::vector<size_t> of_light_;  // with a tree, the place of each light there, or kListed
  std::shared_ptr<const Environment> environment_;  // null if none
  const Lights* chosen_by_;                         // null: this
};

}  // namespace limn
