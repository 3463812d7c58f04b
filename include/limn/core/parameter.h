#pragma once
// Scene parameters that can be differentiated, by name:
//
//   SHAPE.translate.x|y|z         scene units
//   SHAPE.rotate.x|y|z            radians, world axes through the center of its bounds
//   SHAPE.scale                   factor - 1, about the center of its bounds; in fits not below
//                                 -0.99
//   SHAPE.vertex_positions        scene units: an array, the V by 3 coordinates of its vertices
//   SHAPE.vertex_positions.V.x|y|z  one of them: vertex V (from 0) with its copies
//   SHAPE.vertex_positions:FILE   moves every vertex by the parameter times its vector in FILE
//   SHAPE.displacement            scene units: an array, how far each of its V vertices goes along
//                                 its normal (displacement.h)
//   SHAPE.displacement.V          one of them: vertex V (from 0) with its copies
//   sensor.translate.x|y|z        scene units
//   sensor.rotate.x|y|z           radians, world axes through the pinhole
//   sensor.fov                    degrees
//   EMITTER.data                  an array, the H by W by 3 texels of an envmap, without its scale
//   EMITTER.data.ROW.COLUMN.r|g|b one of them, counted from 0, row 0 on top
//   EMITTER.data:FILE             moves every texel by the parameter times that of an EXR
//   BSDF.NAME, EMITTER.NAME       see their parameters(); a colour: all channels alike
//   BSDF.NAME.r|g|b, EMITTER.NAME.r|g|b  one channel of a colour
//
// Capitals stand for the id of an element, or for what the user writes.
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/scene.h"

namespace limn {

class Motion;

// How a shape as a whole has moved since a parameter was found: the point that it turns about and
// is scaled about by `moved` [scene units], and its size by the factor 1 + `grown`.
struct ShapePose {
  Vec3d moved;
  double grown = 0;
};

// What a name stands for in a scene, resolved once. It holds indices and ids, no pointers into the
// scene, so it serves every deep copy of that scene as well, also after it has moved on: what a
// shape turns about (but see at()), and the normals that its vertices are displaced along, stay as
// they were. Copies of a Parameter are cheap.
// `component` counts the numbers of an array, row by row (vertex 2's y: 2 * 3 + 1); of a scalar it
// is 0.
struct Parameter {
  std::string name;
  std::string unit;
  double natural_step = 0;  // a small step: about a hundredth of what changes the picture a lot
  size_t size = 1;  // numbers: 1 of a scalar, 3 V of vertex_positions, V of displacement, 3 H W of
                    // texels
  std::shared_ptr<const Motion> motion;
  // What its numbers may be, both ends included: what assign() takes.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  // Its value has three channels. They move alike (along grey), as one number; reverse mode tells
  // them apart all the same. NAME.r, NAME.g and NAME.b move one of them each.
  bool colour = false;
  std::vector<size_t> array = {};  // {V, 3}, {V}, {H, W, 3}; {} of scalars
  // Its derivative is that of another array in other coordinates (displacement: of
  // vertex_positions): where all parameters are asked for it is left out.
  bool repeats = false;

  // Of its derivative in reverse mode: {} of a number, {3} of a colour, `array` of an array.
  std::vector<size_t> shape() const;
  size_t numbers() const { return colour ? 3 : size; }  // in that shape

  // Adds derivative lane `lane` of everything in the scene that the parameter moves.
  void seed(Scene& scene, int lane, size_t component = 0) const;

  // A deep copy of the scene with the parameter moved by `step`; exact for large steps (rotations
  // rotate). Tangents are kept as they are.
  Scene moved(const Scene& scene, double step, size_t component = 0) const;

  // The same in place.
  void move(Scene& scene, double step, size_t component = 0) const;

  // The numbers themselves, where the scene holds them: one, the three channels of a colour, all of
  // an array. Empty for what only moves things from where they are: rotations, translations and
  // scales of shapes, fields, single coordinates and texels.
  std::vector<double> value(const Scene& scene) const;
  // Sets them in place, with all that depends on them; one number sets all channels of a colour.
  // Positions make the mesh that a file with them would, see moved_mesh(). InputError if there are
  // none, for another number of them, and for values that the reader of scenes would not take; the
  // scene is then as it was.
  void assign(Scene& scene, const std::vector<double>& value,
              std::vector<std::string>* warnings = nullptr) const;

  // V by 3: the derivative of the positions of a shape's vertices; empty where the parameter moves
  // none of that shape.
  std::vector<Vec3d> velocities(const Scene& scene, ShapeId shape, size_t component = 0) const;

  // V vectors along which the vertices of the shape go that the parameter displaces; empty of
  // others.
  std::vector<Vec3d> directions(const Scene& scene) const;

  // How one unit of it moves the shape as a whole: the unit vector of translations, a grown of 1 of
  // scales, else nothing.
  ShapePose pose_per_unit(ShapeId shape) const;
  // The same parameter where the shape that it moves has another pose than where it was found:
  // rotations and scales go about the point that is taken along, scales in sizes of then. So steps
  // of translations, of turns about one axis and of scales add up, in whatever order they come.
  Parameter at(const ShapePose& pose) const;

  // H by W by 3: the derivative of the environment's texels; empty where the parameter moves none.
  Image texel_velocities(const Scene& scene, size_t component = 0) const;
};

// All parameters of the scene, scalars and arrays; a part (one component of an array, a field, a
// channel of a colour) is not listed apart.
std::vector<Parameter> list_parameters(const Scene& scene);

// The scalar called `name`. UnknownParameter that lists the nearest known names if there is none;
// InputError that says how to name a part if it is an array; also if FILE cannot be read or does
// not fit the mesh.
Parameter find_parameter(const Scene& scene, const std::string& name);

// The same, arrays included.
Parameter find_parameter_or_array(const Scene& scene, const std::string& name);

// Moves every vertex of a shape by the parameter times its vector in `field` (V by 3), as
// SHAPE.vertex_positions:FILE does. Copies of a vertex must have the same vector.
Parameter vertex_field(const Scene& scene, ShapeId shape, std::vector<Vec3d> field);

// Moves every texel of the environment's map by the parameter times its value in `field` (H by W by
// 3), as EMITTER.data:FILE does.
Parameter texel_field(const Scene& scene, const Image& field);

}  // namespace limn
