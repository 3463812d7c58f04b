#pragma once
// All lights of a scene, one of which is chosen at a time.
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "limn/core/light.h"
#include "limn/core/scene.h"

namespace limn {

// Chooses one light at a point, mostly in proportion to what each would send there if nothing were
// in the way, now and then any (lights.cpp). Every emitting shape is one, in their order, then the
// environment, then the delta lights in the order of the file. The scene must outlive it.
class Lights {
 public:
  // chosen_by: lights of the same scene as it was before it moved, by which one is chosen; null: by
  // these. Differences choose alike in both scenes: else a light is another one now and then, by
  // much for one over the step, and what is as much in all other samples is the whole derivative
  // as long as that has not happened. They must outlive it.
  explicit Lights(const Scene& scene, const Lights* chosen_by = nullptr);

  bool empty() const { return all_.empty(); }
  // Whether any shape emits.
  bool on_shapes() const { return !area_lights_.empty(); }
  std::span<const Light* const> all() const { return all_; }

  // A point, and what all lights together would send there [W / m^2, of luminance]. What is asked
  // for often at one point needs it once.
  struct Place {
    Vec3d p;
    double sum = 0;
    std::array<double, 4> first{};  // of the first lights, each by itself; how many is not tuned
  };
  Place at(const Vec3d& p) const;
  // Eight at a time.
  void at(std::span<const Vec3d* const> p, std::span<Place* const> places) const;
  // About what a surface at p that faces a light (its number in all()) would get from it, if
  // nothing were in the way [W / m^2, of luminance].
  double estimate(size_t light, const Vec3d& p) const;

  // One number for the choice of a light, the others for what it draws.
  using Numbers = std::array<double, 1 + std::tuple_size_v<LightNumbers>>;
  // A light to be drawn at a place. None: a sample of value zero (see Light::sample).
  struct Draw {
    const Place* place;
    std::optional<LightSample>* sample;
  };
  // draws[i] from u[i]; at most kMostDraws of them.
  static constexpr size_t kMostDraws = 64;
  void sample(std::span<const Draw> draws, std::span<const Numbers> u) const;
  std::optional<LightSample> sample(const Place& place, Rng& rng) const;
  // The density [1/sr] with which `sample` draws what a ray from there sees: an emitting shape, or,
  // where it leaves the scene, the environment (there must be one).
  double pdf(const Place& place, ShapeId shape, const LightView& view) const {
    const size_t light = of_shape_[shape.index()];
    return all_[light]->pdf(view, probability(place, light));
  }
  double pdf_environment(const Place& place, const Vec3d& wo) const {
    return environment_->pdf_solid_angle(wo) * probability(place, area_lights_.size());
  }
  // With the radiance that a ray along the held direction wo sees there. at: Environment::find.
  template <class S>
  Environment::Sight<S> environment(const Place& place, const Vec3d& wo,
                                    const std::array<double, 2>& at) const {
    Environment::Sight<S> sight;
    environment_->look(wo, at, sight);
    sight.pdf *= probability(place, area_lights_.size());
    return sight;
  }

 private:
  // What an estimate of a light's irradiance takes.
  struct Reach {
    Vec3d center;          // of its area
    Vec3d facing;          // sum of its faces' normals times their areas
    double rest = 0;       // a quarter of the area that this leaves: what all sides see of it
    double spread = 0;     // its area over pi, so that nothing is infinite near it
    double luminance = 0;  // of its radiance
    double constant = 0;   // irradiance, alike everywhere
  };
  static Reach reach_of(const Light& lamp);
  template <class S>
  static S estimate(const Reach& reach, const Vec3<S>& p);
  double estimate(size_t light, const Place& place) const {
    return light < place.first.size() ? place.first[light] : estimate(light, place.p);
  }
  size_t choose(const Place& place, double u) const;
  double probability(const Place& place, size_t light) const;

  std::vector<std::unique_ptr<Light>> area_lights_;
  std::vector<const Light*> all_;
  std::vector<Reach> reaches_;      // of all but delta lights
  std::vector<size_t> of_shape_;    // which light it is; any number where a shape emits nothing
  double of_any_ = 1;               // one over how many they are
  const Environment* environment_;  // null if none
  const Lights* chosen_by_;         // null if these
};

}  // namespace limn
