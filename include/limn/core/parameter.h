#pragma once
// Scene parameters that can be differentiated, by name:
//
//   SHAPE.translate.x|y|z         scene units
//   SHAPE.rotate.x|y|z            radians, world axes through its pivot: the center of its bounds
//                                 as it was read, moved along by translations
//   SHAPE.scale                   factor - 1 of the size as it was read, about the pivot; in fits
//                                 that size stays at least 0.01
//   SHAPE.vertex_positions        scene units: an array, the V by 3 coordinates of its vertices
//   SHAPE.vertex_positions.V.x|y|z  one of them: vertex V (from 0) with its copies
//   SHAPE.vertex_positions:FILE   moves every vertex by the parameter times its vector in FILE
//   SHAPE.displacement            scene units: an array, how far each of its V vertices goes along
//                                 its normal (mesh.h)
//   SHAPE.displacement.V          one of them: vertex V (from 0) with its copies
//   SHAPE.velocity.x|y|z          scene units per unit of time, where a shutter stays open: what is
//                                 added to its course (exposure.h)
//   SHAPE.spin.x|y|z              radians per unit of time, the same, about its center
//   sensor.translate.x|y|z        scene units
//   sensor.rotate.x|y|z           radians, world axes through the pinhole
//   sensor.velocity.x|y|z         as of shapes
//   sensor.spin.x|y|z             as of shapes, about the pinhole
//   sensor.shutter_open|close     units of time
//   sensor.fov                    degrees
//   sensor.aperture_radius        scene units, of a sensor with a lens
//   sensor.focus_distance         scene units, the same
//   EMITTER.data                  an array, the H by W by 3 texels of an envmap, without its scale
//   EMITTER.data.ROW.COLUMN.r|g|b one of them, counted from 0, row 0 on top
//   EMITTER.data:FILE             moves every texel by the parameter times that of an EXR
//   BSDF.NAME.data, ...           the same of the texture that gives a colour or number of a BSDF
//   BSDF.NAME, EMITTER.NAME       see their parameters(); a colour: all channels alike
//   BSDF.NAME.r|g|b, EMITTER.NAME.r|g|b  one channel of a colour
//
// Capitals stand for the id of an element, or for what the user writes.
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/scene.h"

namespace limn {

class Motion;

// A differentiable parameter, resolved once from its name. It holds indices and
// ids, no pointers into the scene. So it applies to every deep copy of that scene,
// also after changes: the normals of a displacement stay those of the original. Copies are cheap.
// `component` is a row-major index into an array's numbers (y of vertex 2: 2 * 3 + 1); 0 for
// scalars.
struct Parameter {
  std::string name;
  std::string unit;
  double natural_step = 0;  // of differences: about a hundredth of a large visible change
  size_t size = 1;          // scalar: 1; vertex_positions: 3 V; displacement: V;
                            // EMITTER.data: 3 H W
  std::shared_ptr<const Motion> motion;
  // Range of valid values, inclusive; assign() enforces it.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  // The value is a colour. The parameter changes all channels alike (along grey); reverse mode
  // returns one derivative per channel. NAME.r, NAME.g and NAME.b change one channel each.
  bool colour = false;
  std::vector<size_t> array = {};  // {V, 3}, {V}, {H, W, 3}; {} of scalars
  // True if the derivative repeats that of another parameter in different coordinates (displacement
  // that of vertex_positions, the velocity of what is at rest that of its translation). Such a
  // parameter is skipped when all are requested.
  bool repeats = false;

  // Shape of the reverse-mode derivative: {} for a number, {3} for a colour, else `array`.
  std::vector<size_t> shape() const;
  size_t numbers() const { return colour ? 3 : size; }  // of the reverse-mode derivative

  // Seeds derivative `lane` of all quantities in the scene that depend on the parameter.
  void seed(Scene& scene, int lane, size_t component = 0) const;

  // A deep copy of the scene with the parameter changed by `step`: exact also for large steps (a
  // rotation rotates). Tangents are kept.
  Scene moved(const Scene& scene, double step, size_t component = 0) const;

  // Changes the parameter in place.
  void move(Scene& scene, double step, size_t component = 0) const;

  // The same for a step that a user gives. InputError, with the scene unchanged, if the step is not
  // finite, if the value would leave the valid range, or if the shape would collapse to a point or
  // reach beyond kLargestCoordinate.
  void move_checked(Scene& scene, double step) const;

  // The current value in the scene: one number, three channels of a colour, or all numbers of an
  // array. Empty for parameters that are relative to the current state: rotations, translations and
  // scales of shapes, fields, single coordinates and texels.
  std::vector<double> value(const Scene& scene) const;
  // Sets the value in place, with everything that depends on it. One number sets all channels of a
  // colour. Positions rebuild the mesh as if read from a file, see moved_mesh(). InputError, with
  // the scene unchanged, if the parameter has no value, for a wrong count, and for values outside
  // the valid range.
  void assign(Scene& scene, const std::vector<double>& value,
              std::vector<std::string>* warnings = nullptr) const;

  // V by 3: derivatives of the shape's vertex positions; empty if the parameter does not move the
  // shape.
  std::vector<Vec3d> velocities(const Scene& scene, ShapeId shape, size_t component = 0) const;

  // V displacement directions, for a displacement parameter; else
  // empty.
  std::vector<Vec3d> directions(const Scene& scene) const;

  // The texels that the parameter changes: of the environment or of a texture; null if none.
  TexelMap* texel_map(Scene& scene) const;
  const TexelMap* texel_map(const Scene& scene) const;
  // H by W by 3: their derivatives; empty if the parameter changes none.
  Image texel_velocities(const Scene& scene, size_t component = 0) const;
};

// All scalar and array parameters of the scene. Components of arrays, fields and channels of
// colours are not listed.
std::vector<Parameter> list_parameters(const Scene& scene);

// Finds a scalar parameter. A name may be Mitsuba's, with ".value", ".brdf_0" or ".nested_bsdf".
// UnknownParameter lists the nearest known names if there is none of this name. InputError for an
// array (the message says how to name a component), and if FILE does not fit the mesh.
Parameter find_parameter(const Scene& scene, const std::string& name);

// Like find_parameter, but accepts arrays, too.
Parameter find_parameter_or_array(const Scene& scene, const std::string& name);

// A parameter that moves every vertex of a shape by its vector in `field` (V by 3), like
// SHAPE.vertex_positions:FILE. Copies of a vertex must have equal vectors.
Parameter vertex_field(const Scene& scene, ShapeId shape, std::vector<Vec3d> field);

// A parameter that changes every texel of the array `texels` by its value in `field` (H by W by 3),
// like EMITTER.data:FILE.
Parameter texel_field(const Scene& scene, const Parameter& texels, const Image& field);

// The parameter that changes all numbers of an array or colour at once, each by the step times its
// number in `direction`, row by row; it has the name of the whole. InputError for another count,
// numbers that are not finite, and copies of a vertex that move apart.
Parameter along(const Scene& scene, const Parameter& whole, const std::vector<double>& direction);

// What parameters move. Values (colours, roughness, radiance, texels) are none of it: where nothing
// moves, no edge of what is seen does, and derivatives need none.
struct Moved {
  bool vertices = false;
  bool camera = false;
  bool delta_lights = false;  // positions, and directions of those at infinity
  // Where paths go on from smooth lobes, as an index of refraction changes. moved_by leaves it
  // open; moved_in (integrators/terms/term.h) has it.
  bool rays = false;

  bool any() const { return vertices || camera || delta_lights || rays; }
  Moved operator|(const Moved& o) const {
    return {vertices || o.vertices, camera || o.camera, delta_lights || o.delta_lights,
            rays || o.rays};
  }
};

// The union of what the parameters move.
Moved moved_by(std::span<const Parameter> parameters);

}  // namespace limn
