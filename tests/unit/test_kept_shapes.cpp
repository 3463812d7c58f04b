// What scenes at several times of the shutter share is, bit for bit, what each would have alone.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrators/edges/scene_edges.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"
#include "limn/core/ray_tracer.h"
#include "limn/edgetree/rejection.h"
#include "support/meshes.h"
#include "support/motion_scenes.h"

namespace limn {
namespace {

// A cube slides past a floor, a box that stands on it, a ball with many faces, and a lamp; from a
// height on.
Scene sliding(const TempFiles& files, double height) {
  SceneParts parts;
  const std::string cube = write_mesh(files, "cube.obj", cube_mesh());
  const std::string ball = write_mesh(files, "ball.obj", icosphere_mesh(4));
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8")) +
               obj_shape("box", cube, true, 0.25, {1, 0.25, -1}, diffuse("slate", "0.2")) +
               animated(obj_shape("cube", cube, true, 0.3, {-0.9, height, 0.6},
                                  diffuse("clay", "0.7, 0.5, 0.3")),
                        {0.5, 0, 0.2}, 40) +
               obj_shape("ball", ball, false, 0.5, {0.9, 0.7, 0.8}, diffuse("grey", "0.5")) +
               square("lamp", 0.4, 90, {0.1, 2.8, 0.5}, area_light("glow", "6, 5, 4"));
  return scene_of_text(with_shutter(parts, 0, 1));
}

void expect_same(const EdgeMesh& a, const EdgeMesh& b) {
  EXPECT_EQ(a.shape, b.shape);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.face_offsets, b.face_offsets);
  EXPECT_EQ(a.incident_faces, b.incident_faces);
  EXPECT_EQ(a.incidences, b.incidences);
  EXPECT_EQ(a.near_offsets, b.near_offsets);
  EXPECT_EQ(a.faces_and_near, b.faces_and_near);
  EXPECT_EQ(a.one_sided_closed, b.one_sided_closed);
  EXPECT_EQ(a.fold_contrast, b.fold_contrast);
  EXPECT_EQ(a.extent, b.extent);
  ASSERT_EQ(a.edges.size(), b.edges.size());
  for (size_t e = 0; e < a.edges.size(); ++e) {
    EXPECT_EQ(a.edges[e].vertices, b.edges[e].vertices);
    EXPECT_EQ(a.edges[e].faces, b.edges[e].faces);
    EXPECT_EQ(a.edges[e].edge_class, b.edges[e].edge_class);
    EXPECT_EQ(a.edges[e].motion_group, b.edges[e].motion_group);
  }
  ASSERT_EQ(a.planes.size(), b.planes.size());
  for (size_t f = 0; f < a.planes.size(); ++f) EXPECT_EQ(a.planes[f].offset, b.planes[f].offset);
}

// Draws of both for the same queries.
void expect_same(const EdgeSampler& a, const EdgeSampler& b) {
  Rng numbers(5, 0, 0);
  int drawn = 0;
  for (int i = 0; i < 2000; ++i) {
    EdgeQuery query;
    query.p = {3 * numbers.uniform() - 1.5, 0.01, 3 * numbers.uniform() - 1.5};
    query.n = query.wi = {0, 1, 0};
    query.velocity.x[0] = i % 2;
    Rng one(7, i, 0), other(7, i, 0);
    const auto x = a.sample(query, one), y = b.sample(query, other);
    ASSERT_EQ(x.has_value(), y.has_value());
    if (!x) continue;
    ++drawn;
    EXPECT_EQ(x->edge, y->edge);
    EXPECT_EQ(x->t, y->t);
    EXPECT_EQ(x->probability, y->probability);
    EXPECT_EQ(a.probability(query, x->edge), b.probability(query, x->edge));
  }
  EXPECT_GT(drawn, 200);
}

class KeptShapes : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(, KeptShapes, testing::Values(0.9, 0.3, 0.2), [](const auto& test) {
  return test.param > 0.5 ? "apart" : test.param > 0.25 ? "touch" : "cross";
});

// The box has a velocity as a parameter: its derivatives change with time, though it stands still.
TEST_P(KeptShapes, HaveTheEdgesOfEachTime) {
  const TempFiles files;
  const Scene scene = sliding(files, GetParam());
  KeptEdges kept;
  bool shared = false;
  for (const double u : {0.75, 0.1, 0.5, 0.9}) {
    Scene there = deep_copy(scene);
    find_parameter(scene, "cube.translate.y").seed(there, 0);
    find_parameter(scene, "box.velocity.y").seed(there, 1);
    find_parameter(scene, "ball.scale").seed(there, 2);
    set_time(there, u);
    EdgeSamplerInput one = kept.make(there, 1), other = make_scene_edges(there, 1);
    EXPECT_EQ(one.parting, other.parting);
    ASSERT_EQ(one.objects.size(), other.objects.size());
    for (size_t o = 0; o < one.objects.size(); ++o) expect_same(one.objects[o], other.objects[o]);
    shared = shared || kept.shared();
    add_light(there, one);
    add_light(there, other);
    const EdgeSamplerType forest = edge_sampler_type("forest");
    expect_same(*forest.make(one, 1, kept.shared()), *forest.make(other, 1));
  }
  EXPECT_EQ(shared, GetParam() > 0.5);
}

TEST_P(KeptShapes, HaveTheHitsOfEachTime) {
  const TempFiles files;
  Scene scene = sliding(files, GetParam()), start = scene;
  share_between_times(start, 1);
  Rng rng(9, 0, 0);
  for (const double u : {0.75, 0.1, 0.5}) {
    const Scene one = at_time(start, u), other = at_time(scene, u);
    const auto a = make_embree_tracer(one, 1), b = make_embree_tracer(other, 1);
    std::vector<RayQuery> queries(4000);
    for (RayQuery& query : queries) {
      query.ray.origin = {4 * rng.uniform() - 2, 2.5 * rng.uniform() + 0.1, 4 * rng.uniform() - 2};
      query.ray.direction = random_direction(rng);
    }
    std::vector<RayQuery> others = queries;
    a->closest_each(queries);
    b->closest_each(others);
    std::vector<int> met(scene.shapes.size());
    for (size_t i = 0; i < queries.size(); ++i) {
      ASSERT_EQ(queries[i].found, others[i].found);
      Hit alone;
      EXPECT_EQ(a->closest(queries[i].ray, alone), queries[i].found);
      EXPECT_EQ(a->occluded(queries[i].ray), queries[i].found);
      if (!queries[i].found) continue;
      EXPECT_EQ(queries[i].hit.face, others[i].hit.face);
      // Of two faces in one plane rays meet either, each with its own rounding.
      if (GetParam() != 0.3) {
        EXPECT_EQ(queries[i].hit.t, others[i].hit.t);
      }
      EXPECT_EQ(alone.face, queries[i].hit.face);
      ++met[alone.face.shape.index()];
    }
    for (const int count : met) EXPECT_GT(count, 20);
  }
}

}  // namespace
}  // namespace limn
