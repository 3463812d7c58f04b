#pragma once
// One function for every row of the tables in generate_files.cpp.
#include "tools/generate/generate.h"

namespace limn {

Triangles make_pebble(int faces);
Triangles make_knot(int faces);
Triangles make_pretzel(int faces);
Triangles make_tetrapod(int faces);
Triangles make_creature(int faces);
Triangles make_harp(int faces);
Triangles make_chandelier(int faces);
Triangles make_bracket(int faces);
Triangles make_plant(int faces);
Triangles make_tree(int faces);
Triangles make_gear(int faces);
Triangles make_pinion(int faces);
Triangles make_ball(int faces);

Image make_soft_sky();
Image make_sun_sky();

}  // namespace limn
