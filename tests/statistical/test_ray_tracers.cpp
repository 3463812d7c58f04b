// Embree against every face tested in double precision.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "limn/core/shading.h"
#include "support/brute_force_tracer.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

Scene some_scene(double unit) {
  Scene scene;
  for (const NamedMesh& named : test_meshes()) {
    scene.shapes.emplace_back();
    const double k = static_cast<double>(scene.shapes.size());
    const Vec3d rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    scene.shapes.back().mesh = transformed(named.mesh, rows, 0.6 * unit,
                                           Vec3d{std::cos(k), std::sin(2 * k), 0.2 * k} * unit);
  }
  // Slivers askew: in coordinates of their own.
  Vec3d rows[3];
  Rng rng(1, 2, 3);
  random_rotation(rng, rows);
  scene.shapes.emplace_back();
  scene.shapes.back().mesh =
      transformed(rod_mesh(64, 0.1), rows, unit, Vec3d{0.3, 0.2, 0.1} * unit);
  scene.shapes[1].is_emitter = true;
  return scene;
}

// The smallest barycentric coordinate of the point where the ray meets the face's plane: how far
// from its border it passes.
double margin(const Scene& scene, const Ray& ray, FaceRef face) {
  const auto c = face_corners<double>(scene.shape(face.shape).mesh, face.face);
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  const Vec3d p = ray.origin + ray.direction * (dot(c[0] - ray.origin, n) / dot(n, ray.direction));
  const double b1 = dot(cross(p - c[0], c[2] - c[0]), n) / dot(n, n);
  const double b2 = dot(cross(c[1] - c[0], p - c[0]), n) / dot(n, n);
  return std::min({b1, b2, 1 - b1 - b2});
}

// Embree reads arrays with room behind the last vertex where they are, and copies of others.
TEST(EmbreeArrays, MeetTheSameWithAndWithoutRoom) {
  Scene tight = some_scene(1), roomy = tight;
  for (Shape& shape : tight.shapes) shape.mesh.positions = std::vector<Vec3f>(shape.mesh.positions);
  for (Shape& shape : roomy.shapes) shape.mesh.positions.reserve(shape.mesh.positions.size() + 1);
  ASSERT_EQ(tight.shapes[0].mesh.positions.capacity(), tight.shapes[0].mesh.positions.size());
  const auto of_copies = make_embree_tracer(tight, 1), in_place = make_embree_tracer(roomy, 1);
  Rng rng(7, 8, 9);
  for (int i = 0; i < 1000; ++i) {
    const Vec3d from = random_direction(rng) * 2.0;
    const Ray ray{from, random_direction(rng)};
    Hit a, b;
    ASSERT_EQ(of_copies->closest(ray, a), in_place->closest(ray, b));
    EXPECT_EQ(a.face, b.face);
    EXPECT_EQ(a.t, b.t);
  }
}

class RayTracers : public testing::TestWithParam<double> {};

TEST_P(RayTracers, AgreeButForRounding) {
  const double unit = GetParam();
  const Scene scene = some_scene(unit);
  const auto embree = make_embree_tracer(scene, 1);
  const auto oracle = make_brute_force_tracer(scene);
  Rng rng(4, 5, 6);
  int hits = 0;
  int skipped = 0;
  int at_borders = 0;
  constexpr int kRays = 4000;
  for (int i = 0; i < kRays; ++i) {
    // Floats, so that both see the same ray.
    const auto exact = [](const Vec3d& v) { return cast<double>(cast<float>(v)); };
    Ray ray{exact(random_direction(rng) * (2 * rng.uniform() * unit)),
            exact(random_direction(rng))};
    ray.skip_emitters = i % 3 == 0;
    if (i % 5 == 0) ray.t_max = static_cast<float>(3 * rng.uniform() * unit);
    if (i % 7 == 0) ray.t_min = static_cast<float>(rng.uniform() * unit);
    std::vector<FaceRef> faces;
    Hit a, b;
    // Half of the rays pass through what they met first.
    if (i % 2 == 0 && oracle->closest(ray, b)) {
      ++skipped;
      if (i % 4 == 0) {
        ray.start = b.face;
      } else {
        faces = {b.face, {b.face.shape, FaceId(0)}};
        ray.skip_faces = faces;
      }
    }
    const bool hit_a = embree->closest(ray, a);
    const bool hit_b = oracle->closest(ray, b);
    EXPECT_EQ(embree->occluded(ray), hit_a) << i;
    hits += hit_b;
    if (hit_a == hit_b && (!hit_a || (a.face == b.face && std::fabs(a.t - b.t) < 1e-4 * unit))) {
      continue;
    }
    ++at_borders;
    // They may only differ where the nearer of the two is met within rounding of its border or of
    // the ray's end.
    const bool embree_nearer = hit_a && (!hit_b || a.t < b.t);
    const Hit& nearer = embree_nearer ? a : b;
    const double to_end =
        std::min(std::fabs(nearer.t - ray.t_max), std::fabs(nearer.t - ray.t_min));
    EXPECT_TRUE(std::fabs(margin(scene, ray, nearer.face)) < 1e-4 || to_end < 1e-5 * unit)
        << "ray " << i << ", margin " << margin(scene, ray, nearer.face);
  }
  EXPECT_GT(hits, kRays / 5);
  EXPECT_GT(skipped, kRays / 10);
  EXPECT_LT(at_borders, kRays / 500);
}

// Rays that leave the faces where others ended, some to ignore what they meet next.
TEST_P(RayTracers, TraceTogetherAsAlone) {
  const double unit = GetParam();
  const Scene scene = some_scene(unit);
  const auto embree = make_embree_tracer(scene, 1);
  Rng rng(7, 8, 9);
  int hits = 0, different = 0, failed = 0;
  constexpr int kRounds = 600;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<RayQuery> queries(1 + round % 19);
    std::vector<std::array<FaceRef, 1>> skipped(queries.size());
    for (size_t i = 0; i < queries.size(); ++i) {
      Ray& ray = queries[i].ray;
      ray = {random_direction(rng) * (2 * rng.uniform() * unit), random_direction(rng)};
      Hit hit;
      if (i % 5 != 4 && embree->closest(ray, hit)) {
        const auto c = face_corners<double>(scene.shape(hit.face.shape).mesh, hit.face.face);
        const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
        const double t = dot(c[0] - ray.origin, n) / dot(ray.direction, n);
        ray = {ray.origin + ray.direction * t, random_direction(rng)};
        ray.start = hit.face;
        queries[i].normal = n;
        if (i % 3 == 0 && embree->closest(ray, hit)) {
          skipped[i] = {hit.face};
          ray.skip_faces = skipped[i];
        }
      }
      ray.skip_emitters = i % 4 == 1;
      if (i % 7 == 6) ray.t_max = rng.uniform() * unit;
      if (round % 11 == 0 && i == 2) ray.origin.x = std::numeric_limits<double>::quiet_NaN();
    }
    std::vector<RayQuery> shadows = queries;
    embree->closest_each(queries);
    embree->occluded_each(shadows);
    for (size_t i = 0; i < queries.size(); ++i) {
      const RayQuery& query = queries[i];
      ASSERT_EQ(query.failed, std::isnan(query.ray.origin.x));
      ASSERT_EQ(shadows[i].failed, query.failed);
      failed += query.failed;
      if (query.failed) continue;
      RayQuery alone = query, shadow = query;
      embree->closest_each({&alone, 1});
      embree->occluded_each({&shadow, 1});
      ASSERT_EQ(alone.found, query.found);
      ASSERT_EQ(shadow.found, shadows[i].found);
      if (query.found) {
        ASSERT_EQ(alone.hit.face, query.hit.face);
        ASSERT_EQ(alone.hit.t, query.hit.t);
      }
      Hit hit;
      const bool found = embree->closest(query.ray, hit);
      hits += found;
      different +=
          found != query.found ||
          (found && (hit.face != query.hit.face || std::fabs(hit.t - query.hit.t) > 1e-4 * unit)) ||
          embree->occluded(query.ray) != shadows[i].found;
    }
  }
  EXPECT_GT(hits, 2000);
  EXPECT_GT(failed, 20);
  EXPECT_LE(different, 3);  // by rounding, where faces meet
}

// As a camera's: a packet descends the tree as one.
TEST_P(RayTracers, TraceSideBySideAsAlone) {
  const double unit = GetParam();
  const Scene scene = some_scene(unit);
  const auto embree = make_embree_tracer(scene, 1);
  Rng rng(8, 9, 10);
  int hits = 0;
  for (int round = 0; round < 1000; ++round) {
    const Vec3d origin = random_direction(rng) * (2 * rng.uniform() * unit);
    const Vec3d middle = random_direction(rng);
    std::array<RayQuery, RayTracer::kTogether> queries;
    for (RayQuery& query : queries) {
      query.ray = {origin, normalize(middle + random_direction(rng) * 0.03)};
    }
    auto shadows = queries;
    embree->closest_each(queries);
    embree->occluded_each(shadows);
    for (size_t i = 0; i < queries.size(); ++i) {
      RayQuery alone = queries[i], shadow = queries[i];
      embree->closest_each({&alone, 1});
      embree->occluded_each({&shadow, 1});
      ASSERT_EQ(alone.found, queries[i].found);
      ASSERT_EQ(shadow.found, shadows[i].found);
      hits += alone.found;
      if (!alone.found) continue;
      ASSERT_EQ(alone.hit.face, queries[i].hit.face);
      ASSERT_EQ(alone.hit.t, queries[i].hit.t);
    }
  }
  EXPECT_GT(hits, 1000);
}

// A face close above another hides what is above it, also where a third is far away.
TEST(RaysTogether, StartBelowWhatIsCloseInLargeScenes) {
  Scene scene;
  scene.shapes.emplace_back().mesh = make_mesh({{0, 0, 0}, {1, 0, 3}, {2, 0, 0}}, {{0, 1, 2}});
  scene.shapes.emplace_back().mesh =
      make_mesh({{0.9f, 0.001f, 0.9f}, {1, 0.001f, 1.1f}, {1.1f, 0.001f, 0.9f}}, {{0, 1, 2}});
  scene.shapes.emplace_back().mesh =
      make_mesh({{1e5f, 0, 0}, {1e5f, 1, 0}, {-1e5f, 0, 1}}, {{0, 1, 2}});
  const auto embree = make_embree_tracer(scene, 1);
  std::vector<RayQuery> queries(11);
  for (RayQuery& query : queries) {
    query.ray = {{1, 0, 1}, {0, 1, 0}};
    query.ray.start = {ShapeId(0), FaceId(0)};
    query.normal = {0, 1, 0};
  }
  embree->closest_each(queries);
  for (const RayQuery& query : queries) {
    ASSERT_TRUE(query.found);
    EXPECT_EQ(query.hit.face, (FaceRef{ShapeId(1), FaceId(0)}));
    EXPECT_NEAR(query.hit.t, 0.001, 1e-6);
  }
  embree->occluded_each(queries);
  for (const RayQuery& query : queries) EXPECT_TRUE(query.found);
}

// The largest puts coordinates near kLargestCoordinate.
INSTANTIATE_TEST_SUITE_P(, RayTracers, testing::Values(1e-3, 1.0, 1e4, 5e11), [](const auto& test) {
  return test.param < 1 ? "small" : test.param < 2 ? "one" : test.param < 1e5 ? "large" : "largest";
});

// Lets the process have a little more memory than it has now.
void allow_little_memory() {
  std::ifstream statm("/proc/self/statm");
  rlim_t pages = 0;
  statm >> pages;
  const rlim_t bytes = pages * sysconf(_SC_PAGESIZE) + (rlim_t{64} << 20);
  const rlimit limit{bytes, bytes};
  setrlimit(RLIMIT_AS, &limit);
}

TEST(EmbreeDeathTest, SaysWhatItLacks) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer needs all addresses";
#endif
  Scene scene;
  scene.shapes.emplace_back();
  Mesh& mesh = scene.shapes[0].mesh;
  mesh.positions.resize(6'000'000);  // 72 MB
  mesh.faces.resize(1);
  const auto make = [&] {
    const Scene empty;
    const auto first = make_embree_tracer(empty, 1);  // has threads and their memory
    allow_little_memory();
    try {
      make_embree_tracer(scene, 1);
    } catch (const InputError& error) {
      std::fputs(error.what(), stderr);
      std::exit(3);
    }
  };
  EXPECT_EXIT(make(), testing::ExitedWithCode(3), "^error: Embree: .*memory");
}

TEST(BadRays, AreRefused) {
  const Scene scene = some_scene(1);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Ray good{{0, 0, 3}, {0, 0, -1}};
  std::vector<Ray> bad(8, good);
  bad[0].origin.x = nan;
  bad[1].origin.y = -infinity;
  bad[2].origin.z = 0x1p61;
  bad[3].direction.x = nan;
  bad[4].direction.z = -infinity;
  bad[5].t_min = nan;
  bad[6].t_max = nan;
  bad[7].t_max = -1;
  for (const auto& tracer : {make_embree_tracer(scene, 1), make_brute_force_tracer(scene)}) {
    Hit hit;
    EXPECT_NO_THROW(tracer->closest(good, hit));
    for (const Ray& ray : bad) {
      EXPECT_THROW(tracer->closest(ray, hit), UntraceableRay);
      EXPECT_THROW(tracer->occluded(ray), UntraceableRay);
    }
  }
}

// Corners on a line, which rounding relative to a ray's origin may move off it.
TEST(FacesWithoutArea, AreNeverMet) {
  Scene scene;
  scene.shapes.emplace_back();
  scene.shapes[0].mesh =
      make_mesh({{0.1f, 0.3f, 0.7f}, {0.2f, 0.6f, 1.4f}, {0.4f, 1.2f, 2.8f}}, {{0, 1, 2}});
  ASSERT_FALSE(has_area(scene.shapes[0].mesh, {0, 1, 2}));
  const auto tracer = make_embree_tracer(scene, 1);
  Rng rng(1, 2, 3);
  for (int i = 0; i < 20000; ++i) {
    const Vec3d origin = random_direction(rng);
    const Vec3d target = Vec3d{0.1f, 0.3f, 0.7f} * (1 + 3 * rng.uniform());
    Hit hit;
    EXPECT_FALSE(tracer->closest({origin, normalize(target - origin)}, hit));
  }
}

// Rays that start or end next to the sides of a large cube's faces, where floats would meet the
// face beside theirs.
TEST(BesideItsFace, ARayMeetsNothingThatDoesNotRiseAboveIt) {
  Rng rng(7, 8, 9);
  for (int i = 0; i < 200; ++i) {
    Scene scene;
    scene.shapes.emplace_back();
    Vec3d rows[3];
    random_rotation(rng, rows);
    scene.shapes[0].mesh = transformed(cube_mesh(), rows, 1000, {1, -2, 3});
    const auto tracer = make_embree_tracer(scene, 1);
    for (uint32_t f = 0; f < 12; ++f) {
      const FaceRef face{ShapeId(0), FaceId(f)};
      const auto c = face_corners<double>(scene.shapes[0].mesh, face.face);
      const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
      const int k = static_cast<int>(3 * rng.uniform());
      const Vec3d& first = c[k];
      const Vec3d& second = c[(k + 1) % 3];
      const bool is_diagonal = length(second - first) > 2500;
      const double inside = 1e-8 * rng.uniform();
      const Vec3d p =
          (first + (second - first) * rng.uniform()) * (1 - inside) + c[(k + 2) % 3] * inside;
      Vec3d out = random_direction(rng);
      if (dot(out, n) < 0) out = -out;
      Hit hit;
      Ray leaves{p, out};
      leaves.start = face;
      EXPECT_FALSE(tracer->occluded(leaves));
      EXPECT_FALSE(tracer->closest(leaves, hit));
      Ray arrives{p + out * 100, -out, 0, 100};
      arrives.end = face;
      EXPECT_FALSE(tracer->occluded(arrives));
      leaves.direction = -out;
      EXPECT_TRUE(tracer->closest(leaves, hit) || !is_diagonal);
    }
  }
}

}  // namespace
}  // namespace limn
