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
Triangles make_vase(int faces);
Triangles make_bowl(int faces);
Triangles make_goblet(int faces);
Triangles make_bottle(int faces);
Triangles make_orange(int faces);
Triangles make_lemon(int faces);
Triangles make_pear(int faces);
Triangles make_grapes(int faces);
Triangles make_twigs(int faces);
Triangles make_cloth(int faces);
Triangles make_word(int faces);

Image make_soft_sky();
Image make_sun_sky();
Image make_boards();
Image make_linen();

}  // namespace limn
