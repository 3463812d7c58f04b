// Faces nearer to an edge than a ray of floats can tell: found, and met where they are.
#include "integrators/edges/near_faces.h"

#include <gtest/gtest.h>

#include <cmath>

#include "limn/edgetree/touching.h"
#include "support/brute_force_tracer.h"
#include "support/edge_mesh_fault.h"
#include "support/meshes.h"

namespace limn {
namespace {

// A wall with an edge along x = z = 0 that goes up from there, and a floor under it that begins at
// x = `beside`, `below` the edge. The ends of the edge are not aligned with the floor's.
Scene wall_and_floor(float beside, float below) {
  Scene scene;
  scene.shapes.resize(2);
  scene.shapes[0].mesh = make_mesh({{0, -0.875f, 0}, {0, 0.75f, 0}, {0, 0.75f, 1}}, {{0, 1, 2}});
  scene.shapes[1].mesh = make_mesh({{beside, -1, -below},
                                    {beside + 2, -1, -below},
                                    {beside + 2, 1, -below},
                                    {beside, 1, -below}},
                                   {{0, 1, 2}, {0, 2, 3}});
  return scene;
}

struct United {
  EdgeMesh mesh;  // of the wall
  EdgeId edge;    // its lower one
};

United united(const Scene& scene, const Vec3d& viewer) {
  std::vector<EdgeMesh> objects;
  std::vector<TouchingShape> shapes;
  std::vector<const Mesh*> meshes;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    meshes.push_back(&scene.shapes[s].mesh);
    shapes.push_back({meshes[s], s});
    objects.push_back(build_edge_mesh(*meshes[s], false, ShapeId(s)));
  }
  unite_touching_edges(shapes, find_face_pairs(meshes, viewer, 1), viewer, 1, objects);
  for (const EdgeMesh& object : objects) EXPECT_EQ(fault_of(object), "");
  United result{objects[0], EdgeId(0)};
  while (result.mesh.position(result.mesh.edge(result.edge).vertices[0]).z != 0 ||
         result.mesh.position(result.mesh.edge(result.edge).vertices[1]).z != 0)
    result.edge = EdgeId(result.edge.index() + 1);
  return result;
}

TEST(NearFaces, AreThoseThatRaysFromTheViewerCannotTell) {
  const auto count = [](float below, double distance) {
    const United wall = united(wall_and_floor(-0.5f, below), {0, 0, distance});
    const FacesAround around = wall.mesh.around(wall.edge);
    EXPECT_EQ(around.faces.size(), 1u);
    EXPECT_EQ(around.all.size(), around.faces.size() + around.near.size());
    return around.near.size();
  };
  EXPECT_EQ(count(1.5e-6f, 1), 2u);  // on both sides of the floor's diagonal
  EXPECT_EQ(count(1e-4f, 1), 0u);
  EXPECT_EQ(count(1e-4f, 200), 2u);
  EXPECT_EQ(count(0.01f, 200), 0u);
  // Beyond what is near to all of its like.
  EXPECT_EQ(count(0.02f, 1e9), 0u);
}

TEST(NearFaces, AreMetOnTheSideWhereTheyLie) {
  Rng rng(1, 2, 3);
  const Vec3d viewer{2, -3, 2.5};
  int floats_err = 0;
  for (const float least : {3e-6f, 2e-6f}) {
    // Seen from as far away as the camera is; and from farther, where rays from the camera would
    // tell, and the floor is not among the near faces.
    for (const int kind : {0, 1, 2, 3}) {
      const bool beside = kind % 2 == 1;
      const bool is_far = kind >= 2;
      const float gap = is_far ? 40 * least : least;
      // Below the edge, or beginning behind it.
      Scene scene = beside ? wall_and_floor(0.4f * gap, -gap / 2) : wall_and_floor(-0.5f, gap);
      scene.camera.origin = {viewer.x, viewer.y, viewer.z};
      const United wall = united(scene, viewer);
      const FacesAround around = wall.mesh.around(wall.edge);
      ASSERT_EQ(around.near.empty(), is_far);
      const auto tracer = make_embree_tracer(scene, 1);
      for (int i = 0; i < 500; ++i) {
        const Vec3d y{0, 1.4 * rng.uniform() - 0.7, 0};
        const Vec3d p = (viewer + random_direction(rng)) * (is_far ? 1000 : 1);
        Ray ray{p, normalize(y - p)};
        ray.skip_faces = around.all;
        Hit hit;
        const double distance = length(y - p);
        const bool found = closest_at_edge(*tracer, scene, around, y, distance, ray, hit);
        // Where the ray meets the floor's plane.
        const double t = scene.shapes[1].mesh.positions[0].z / ray.direction.z;
        const double inside = t * ray.direction.x - scene.shapes[1].mesh.positions[0].x;
        const bool expected = inside >= 0;
        // As near to its border, floats decide whether a face of size 2 is met, from anywhere.
        if (is_far && std::fabs(inside) < 0x1p-20) continue;
        ASSERT_EQ(found, expected) << gap << ' ' << i;
        if (found) {
          EXPECT_EQ(hit.t < distance, t < 0);
        }
        if (found && t > 0 && !is_far) {
          EXPECT_NEAR(hit.t, distance + t, 1e-9);
        }
        // A ray of floats that skips the wall.
        ray.skip_faces = around.faces;
        Hit other;
        floats_err += tracer->closest(ray, other) != expected;
        floats_err += expected && (other.t < distance) != (t < 0);
      }
    }
  }
  EXPECT_GT(floats_err, 0);  // else the near faces are not needed
}

// Sheets above each other: the tracer meets what brute force in double precision meets.
TEST(NearFaces, LayersAreMetInTheirOrder) {
  Rng rng(5, 6, 7);
  const Vec3d viewer{2, -3, 2.5};
  int layers_met[2] = {0, 0};
  for (const float gap : {3e-6f, 1e-5f}) {
    Scene scene;
    scene.camera.origin = {viewer.x, viewer.y, viewer.z};
    scene.shapes.resize(3);
    const auto sheet = [](float z) {
      return make_mesh({{-1, -1, z}, {1, -1, z}, {1, 1, z}, {-1, 1, z}}, {{0, 1, 2}, {0, 2, 3}});
    };
    for (int s = 0; s < 3; ++s) scene.shapes[s].mesh = sheet(0.7f + s * gap);
    const auto tracer = make_embree_tracer(scene, 1), brute = make_brute_force_tracer(scene);
    for (int i = 0; i < 500; ++i) {
      const Vec3d x{1.8 * rng.uniform() - 0.9, 1.8 * rng.uniform() - 0.9, 0.7};
      const Vec3d p = i % 2 == 0 ? viewer : Vec3d{viewer.x, viewer.y, -viewer.z};
      const Ray ray{p, normalize(x - p)};
      Hit hit, truth;
      ASSERT_TRUE(tracer->closest(ray, hit) && brute->closest(ray, truth));
      EXPECT_EQ(hit.face.shape, truth.face.shape) << gap << ' ' << i;
      EXPECT_NEAR(hit.t, truth.t, 1e-6);
      ++layers_met[hit.face.shape.index() / 2];
      // From the sheet in the middle: the outer ones block whatever leaves it or comes to it.
      Ray leaving{{x.x, x.y, scene.shapes[1].mesh.positions[0].z}, normalize(p - x)};
      leaving.start = {ShapeId(1), FaceId(x.x > x.y ? 0 : 1)};
      EXPECT_TRUE(tracer->occluded(leaving));
      ASSERT_TRUE(tracer->closest(leaving, hit));
      EXPECT_EQ(hit.face.shape, truth.face.shape);
      Ray arriving{p, -leaving.direction, 0, length(leaving.origin - p) * (1 - 0x1p-20)};
      arriving.end = leaving.start;
      EXPECT_TRUE(tracer->occluded(arriving));
      // And nothing blocks those that leave on the open side.
      Ray open{leaving.origin, leaving.direction};
      open.origin.z = scene.shapes[p.z > 0 ? 2 : 0].mesh.positions[0].z;
      open.start = {ShapeId(p.z > 0 ? 2 : 0), leaving.start.face};
      EXPECT_FALSE(tracer->occluded(open));
      EXPECT_FALSE(tracer->closest(open, hit));
    }
  }
  EXPECT_GT(std::min(layers_met[0], layers_met[1]), 0);
}

}  // namespace
}  // namespace limn
