#pragma once
// Edges that lie behind others in one line, as the camera sees them.
#include <span>
#include <vector>

#include "limn/core/camera.h"

namespace limn {

struct FilmEdge;

// For each edge whether another one, at another depth, is in the same line on the film to what rays
// in floats can tell, for a part of it. No face need be edge-on for that: sheets or open vessels
// whose rims are as high as the camera. (What touches is in one place, and is not meant.)
std::vector<bool> find_edges_in_line(std::span<const FilmEdge> edges, const Camera& camera);

}  // namespace limn
