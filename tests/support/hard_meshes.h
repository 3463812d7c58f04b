#pragma once
// Meshes and points that are hard for trees that reject.
#include <vector>

#include "limn/edgetree/edge_sampler.h"
#include "meshes.h"

namespace limn {

// Those of test_meshes, needles, flat, doubled, crumpled and shaken ones.
std::vector<NamedMesh> meshes_of_all_kinds(Rng& rng);
// Two objects: the mesh, turned at random, scaled and, where i is odd, moved far away; and a tenth
// of it at the origin. Every third i's first object sees its faces from both sides.
struct PlacedMeshes {
  EdgeSamplerInput input;
  double scale;  // of the first, as random_scale()
};
PlacedMeshes placed_twice(const Mesh& mesh, int i, Rng& rng);
double random_scale(Rng& rng);  // 1e-3 to 1e4
// On a plane, at a vertex, on an edge, inside, near or far; anywhere for a mesh without edges.
// scale: of the mesh.
Vec3d random_point(const EdgeMesh& mesh, double scale, Rng& rng);

}  // namespace limn
