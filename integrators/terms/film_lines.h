#pragma once
// Edges that lie behind others in one line, as the camera sees them.
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "limn/core/camera.h"
#include "limn/core/ids.h"

namespace limn {

struct FilmEdge;

// A segment of the film.
struct FilmLine {
  double x0, y0, x1, y1;  // its ends [pixels]
  double nx, ny;          // unit, across it
  double length;          // [pixels]
  double depth0, depth1;  // of its ends
  ShapeId shape = {};     // whose it is; none: of a face that is seen edge-on (Viewpoint)
};

struct EdgesInLine {
  // Of each edge whether it is in one line with another one.
  std::vector<bool> in_line;
  // Whose they are, of two that move past each other, across their line, and have a sixteenth of
  // the film's width in common: the image has a kink if both are seen. In order; faces that are
  // seen edge-on are left out.
  std::optional<std::array<ShapeId, 2>> parting;
};

// Which of the `moving` edges are in the same line on the film as another one, or as one of the
// `resting` ones, as far as rays in floats resolve, for a part of it, at a depth that differs by a
// five-hundredth. (What is less far apart hardly differs from a place aside of the camera,
// too: such edges are both seen.) No face need be edge-on for that: sheets or open vessels whose
// rims are as high as the camera. (What touches is in one place, and is not meant.)
EdgesInLine find_edges_in_line(std::span<const FilmEdge> moving, std::span<const FilmLine> resting,
                               const Camera& camera);

}  // namespace limn
