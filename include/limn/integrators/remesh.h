#pragma once
// Isotropic remeshing: the same surface by triangles of one size.
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

struct Remeshed {
  std::vector<Vec3f> positions;
  std::vector<FaceIndices> faces;
};

// Botsch and Kobbelt 2004, "A Remeshing Approach to Multiresolution Modeling", Sec. 4: long edges
// are split, short ones collapse, edges flip towards six neighbours, vertices slide along the
// surface and are put back onto it. length: of the edges, scene units; most end within 4/5 to 4/3
// of it. Vertices of borders stay where they are, and edges between them are not split.
// Deterministic. InputError (at `where`) for meshes that are not manifold, and where limn was built
// without OpenMesh.
Remeshed remesh(const Mesh& mesh, double length, const SourceLocation& where);

// Whether there is one; without OpenMesh remesh() always fails.
bool can_remesh();

}  // namespace limn
