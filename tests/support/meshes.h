#pragma once
// Meshes made by formula for tests. All have `weld` filled and face normals unless told otherwise.
#include <vector>

#include "limn/core/mesh.h"
#include "limn/core/rng.h"
#include "limn/edgetree/rejection.h"

namespace limn {

struct NamedMesh {
  std::string name;
  Mesh mesh;
};

// Fills weld.
Mesh make_mesh(SharedVector<Vec3f> positions, SharedVector<FaceIndices> faces);

Mesh tetrahedron_mesh();                  // 4 faces
Mesh cube_mesh();                         // [-1, 1]^3, 12 faces, each side cut along a diagonal
Mesh icosphere_mesh(int levels);          // unit sphere, 20 * 4^levels faces
Mesh torus_mesh(int around, int tube);    // radii 1 and 0.4, 2 * around * tube faces
Mesh grid_mesh(int cells);                // [-1, 1]^2 at z = 0, facing +z, 2 * cells^2 faces, open
Mesh rod_mesh(int sides, double radius);  // about z, from -1 to 1, 2 * sides slivers, open
// Half of the icosphere: open, curved.
Mesh cap_mesh(int levels);

// Every face gets vertices of its own (the positions stay, and so does `weld`'s meaning).
Mesh seam_split(const Mesh& mesh);
Mesh reversed(Mesh mesh);
Mesh joined(const Mesh& a, const Mesh& b);
// Area-weighted vertex normals over welded positions.
Mesh with_smooth_normals(Mesh mesh);
// scale * rotation * x + offset, rounded to float; rows: 3 rows of an orthonormal matrix. Normals
// turn along.
Mesh transformed(const Mesh& mesh, const Vec3d (&rows)[3], double scale, const Vec3d& offset);
void random_rotation(Rng& rng, Vec3d (&rows)[3]);

// Lane 0: translation along x; lane 1: rotation about z; lane 2: every vertex on its own; lane 3:
// nothing.
void set_test_tangents(Mesh& mesh);

// Closed and open, smooth and flat-shaded, coarse and fine: for tests that loop.
std::vector<NamedMesh> test_meshes();

}  // namespace limn
