#pragma once
// Which BSDFs have derivatives by a run's parameters, and whether the environment has. All others
// are evaluated in plain numbers.
#include <array>
#include <span>
#include <vector>

#include "limn/core/parameter.h"
#include "limn/core/scene.h"

namespace limn {

class MovingColours {
 public:
  // scene: with these parameters seeded.
  MovingColours(const Scene& scene, std::span<const Parameter> parameters);
  // Whether parameters move the BSDF on that side of a shape.
  bool of(ShapeId shape, bool front) const { return sides_[shape.index()][front]; }
  bool of_sky() const { return sky_; }

 private:
  std::vector<std::array<bool, 2>> sides_;
  bool sky_ = false;
};

}  // namespace limn
