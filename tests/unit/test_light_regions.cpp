// Cones around lamps hold all that shines; pieces of edges are drawn by the density they tell, and
// weigh what they should.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrators/lights/light_regions.h"
#include "limn/edgetree/edge_pieces.h"
#include "support/environment_maps.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

Mesh disk_mesh(int corners) {
  std::vector<Vec3f> positions;
  std::vector<FaceIndices> faces;
  for (int i = 0; i < corners; ++i) {
    const double a = 2 * kPi * i / corners;
    positions.push_back({static_cast<float>(std::cos(a)), static_cast<float>(std::sin(a)), 0});
  }
  for (uint32_t i = 2; i < static_cast<uint32_t>(corners); ++i) faces.push_back({0, i - 1, i});
  return make_mesh(std::move(positions), std::move(faces));
}

// An L in the plane z = 0.
Mesh concave_mesh() {
  return make_mesh({{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}},
                   {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}});
}

std::vector<NamedMesh> lamps() {
  return {{"square", grid_mesh(1)},
          {"squares", grid_mesh(4)},
          {"triangle", disk_mesh(3)},
          {"octagon", disk_mesh(8)},
          {"disk", disk_mesh(40)},
          {"concave", concave_mesh()},
          {"tetrahedron", tetrahedron_mesh()},
          {"cube", cube_mesh()},
          {"ball", icosphere_mesh(2)},
          {"cap", cap_mesh(1)},
          {"torus", torus_mesh(12, 8)},
          {"inside out", reversed(cube_mesh())}};
}

Vec3d random_point(const Mesh& mesh, uint32_t face, Rng& rng) {
  const double root = std::sqrt(rng.uniform()), b = root * rng.uniform();
  const auto at = [&](int k) { return cast<double>(mesh.positions[mesh.faces[face][k]]); };
  return at(0) * (1 - root) + at(1) * (root - b) + at(2) * b;
}

// Far, near, or very close to the lamp, and sometimes nearly on the plane of one of its faces.
Vec3d random_place(const Mesh& mesh, double scale, Rng& rng) {
  const auto face = static_cast<uint32_t>(rng.uniform() * mesh.faces.size());
  const double far = std::exp(std::log(1e-3) + std::log(1e6) * rng.uniform());
  const Vec3d x = random_point(mesh, face, rng), p = x + random_direction(rng) * (scale * far);
  if (rng.uniform() < 0.7) return p;
  const auto at = [&](int k) { return cast<double>(mesh.positions[mesh.faces[face][k]]); };
  const Vec3d n = normalize(cross(at(1) - at(0), at(2) - at(0)));
  return p - n * (dot(n, p - x) * (1 - 1e-6 * rng.uniform()));
}

// Whatever is seen of the lamp's front above the horizon is inside the cone.
TEST(LightRegions, ConesHoldTheirLamps) {
  Rng rng(31, 0, 0);
  for (const auto& [name, shape] : lamps()) {
    int seen = 0, cut = 0;
    for (int i = 0; i < 20; ++i) {
      Vec3d rows[3];
      random_rotation(rng, rows);
      const double scale = std::exp(std::log(1e-3) + std::log(1e6) * rng.uniform());
      const Mesh mesh = transformed(shape, rows, scale, random_direction(rng) * (scale * i));
      const EmitterHull hull = make_emitter_hull(mesh, ShadingModel::kContinuous);
      for (int k = 0; k < 100; ++k) {
        const Vec3d p = random_place(mesh, scale, rng), n = random_direction(rng);
        const auto cone = cone_around(hull, p, n);
        if (cone) cut += cone->count > 0;
        for (uint32_t f = 0; f < mesh.faces.size(); f += 1 + mesh.faces.size() / 30) {
          const Vec3d x = random_point(mesh, f, rng), w = x - p;
          const auto c = face_corners<double>(mesh, FaceId(f));
          if (dot(cross(c[1] - c[0], c[2] - c[0]), w) >= 0 || dot(n, w) <= 0) continue;
          ++seen;
          ASSERT_TRUE(cone) << name;
          for (int j = 0; j < cone->count; ++j)
            ASSERT_GE(dot(cone->planes[j], w), -cone->slack * length(w)) << name << " plane " << j;
        }
      }
    }
    fmt::print("{:12} {} points seen, {} cones with planes\n", name, seen, cut);
    EXPECT_GT(seen, 500) << name;
    EXPECT_GT(cut, 200) << name;
  }
}

// A square of half-width 1 as seen from a height of 2 above its middle: four planes through its
// sides, none further out. The octagon around a ball is nowhere wider than the octagon's corners.
TEST(LightRegions, ConesAreTight) {
  const EmitterHull square = make_emitter_hull(grid_mesh(2), ShadingModel::kContinuous);
  EXPECT_TRUE(square.flat);
  EXPECT_EQ(square.points.size(), 4u);
  const auto cone = cone_around(square, {0, 0, 2}, {0, 0, -1});
  ASSERT_TRUE(cone);
  EXPECT_EQ(cone->count, 4);
  double t0 = 0, t1 = 1;
  EXPECT_TRUE(cone->clip({-4, 0, -2}, {4, 0, -2}, t0, t1));
  EXPECT_NEAR(t0, 0.375, 1e-6);
  EXPECT_NEAR(t1, 0.625, 1e-6);
  EXPECT_FALSE(cone_around(square, {0, 0, -2}, {0, 0, 1})) << "from behind";
  EXPECT_FALSE(cone_around(square, {3, 0, 0}, {-1, 0, 0})) << "on its plane";
  EXPECT_FALSE(cone_around(square, {0, 0, 2}, {0, 0, 1})) << "below the horizon";
  const EmitterHull ball = make_emitter_hull(icosphere_mesh(1), ShadingModel::kContinuous);
  const auto around = cone_around(ball, {0, 0, 10}, {0, 0, -1});
  ASSERT_TRUE(around);
  EXPECT_EQ(around->count, 8);
  t0 = 0;
  t1 = 1;
  EXPECT_TRUE(around->clip({-4, 0, -10}, {4, 0, -10}, t0, t1));
  EXPECT_LT(8 * (t1 - t0), 2.3);
}

// Radiance 1, with discs of given axes, angles [degrees] and radiances.
struct Disc {
  Vec3d axis;
  double angle, radiance;
};
std::shared_ptr<Environment> sky_with(const std::vector<Disc>& discs, int width, double base = 1) {
  Image image(width, width / 2, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double phi = 2 * kPi * (x + 0.5) / width, theta = kPi * y / (image.height - 1);
      const Vec3d w{std::sin(phi) * std::sin(theta), std::cos(theta),
                    -std::cos(phi) * std::sin(theta)};
      double value = base;
      for (const Disc& disc : discs) {
        if (dot(w, normalize(disc.axis)) >= std::cos(disc.angle * kPi / 180)) value = disc.radiance;
      }
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = static_cast<float>(value);
    }
  }
  return test::make_envmap(image);
}

// The cap of each disc holds it, and is little wider; what the cap has and what is left is all.
TEST(BrightPatches, AreTheSuns) {
  const std::vector<std::vector<Disc>> skies = {
      {{{1, 1, 0.3}, 3, 2000}},
      {{{0.1, 1, 0}, 0.5, 1e5}},                           // near the pole
      {{{0.01, 0.3, -1}, 1, 3e4}},                         // over the map's seam
      {{{1, 1, 0.3}, 2, 4000}, {{-1, 0.4, 0.2}, 3, 1000}}  // two
  };
  for (const std::vector<Disc>& discs : skies) {
    const auto patches = find_bright_patches(*sky_with(discs, 1024));
    ASSERT_EQ(patches.size(), discs.size());
    for (const BrightPatch& patch : patches) {
      double apart = 10;
      const Disc* own = nullptr;
      for (const Disc& disc : discs) {
        const double angle = std::acos(std::min(1.0, dot(normalize(disc.axis), patch.cap.axis)));
        if (angle < apart) apart = angle, own = &disc;
      }
      const double angle = own->angle * kPi / 180, texel = kPi / 512;
      fmt::print("disc of {} degrees: {:.2f} degrees apart, cap of {:.2f}, luminance {:.4g}\n",
                 own->angle, apart * 180 / kPi, std::asin(patch.cap.sine) * 180 / kPi,
                 patch.luminance);
      EXPECT_LT(apart, 0.2 * angle + texel);
      EXPECT_GT(std::asin(patch.cap.sine), 0.9 * angle);
      EXPECT_LT(std::asin(patch.cap.sine), 1.4 * angle + 2 * texel);
    }
  }
}

// It has 2 % of the light, as little as the haze around it, and nearly all of its square.
TEST(BrightPatches, ALowSunInHaze) {
  const Vec3d axis{0.2, 0.1, 1};
  const auto patches = find_bright_patches(*sky_with({{axis, 6, 9}, {axis, 0.5, 1200}}, 1024));
  ASSERT_EQ(patches.size(), 1u);
  EXPECT_TRUE(patches[0].cap.holds(normalize(axis)));
  EXPECT_LT(std::asin(patches[0].cap.sine), 1.5 * kPi / 180);
}

// A sun of half a degree whose glow falls off to six: the steep part is a ring of its own, what is
// wide and dim is none. Each direction belongs to one patch at most.
TEST(BrightPatches, AGlowAroundTheSun) {
  const Vec3d axis = normalize(Vec3d{0.2, 0.4, 1});
  const auto sky =
      sky_with({{axis, 6, 5}, {axis, 1.6, 200}, {axis, 0.9, 800}, {axis, 0.5, 3e4}}, 2048);
  const auto patches = find_bright_patches(*sky);
  ASSERT_EQ(patches.size(), 2u);
  EXPECT_FALSE(patches[0].is_ring());
  EXPECT_TRUE(patches[1].is_ring());
  EXPECT_EQ(patches[1].inner_cosine, patches[0].cap.cosine);
  const auto beside = [&](double degrees) {
    const double angle = degrees * kPi / 180;
    return axis * std::cos(angle) + Frame(axis).s * std::sin(angle);
  };
  const auto held = [&](double degrees) {
    return std::pair(patches[0].holds(beside(degrees)), patches[1].holds(beside(degrees)));
  };
  EXPECT_EQ(held(0.4), std::pair(true, false));
  EXPECT_EQ(held(1.3), std::pair(false, true));
  EXPECT_EQ(held(3), std::pair(false, false));
  for (double angle = 0; angle < 3; angle += 0.01) {
    EXPECT_FALSE(held(angle).first && held(angle).second) << angle;
  }
  EXPECT_GT(patches[1].luminance, 100);
  EXPECT_LT(patches[1].luminance, 800);
  // All regions together hold what each does.
  Scene scene;
  scene.environment = sky;
  const LightRegions regions(scene);
  ASSERT_EQ(regions.size(), 2u);
  for (double angle = 0; angle < 3; angle += 0.01) {
    const Vec3d w = beside(angle);
    EXPECT_EQ(regions.escaped(0, w).g + regions.escaped(1, w).g, regions.escaped(w).g) << angle;
  }
}

// A second sun within the first one's haze is a patch of its own.
TEST(BrightPatches, ASunInTheGlowOfAnother) {
  const Vec3d first = normalize(Vec3d{0.2, 0.4, 1});
  const double apart = 4 * kPi / 180;
  const Vec3d second = first * std::cos(apart) + Frame(first).s * std::sin(apart);
  const auto patches = find_bright_patches(
      *sky_with({{first, 7, 150}, {first, 0.8, 3e4}, {second, 0.8, 2e4}}, 2048));
  for (const Vec3d& sun : {first, second}) {
    EXPECT_EQ(std::count_if(patches.begin(), patches.end(),
                            [&](const BrightPatch& patch) {
                              return !patch.is_ring() && patch.holds(sun) &&
                                     patch.cap.sine < std::sin(2 * kPi / 180);
                            }),
              1);
  }
}

// Wherever it stands in the map's density: the sun is all that few of its columns draw.
TEST(BrightPatches, AreFoundEverywhere) {
  Rng rng(5, 0, 0);
  for (int i = 0; i < 32; ++i) {
    const Vec3d axis = random_direction(rng);
    EXPECT_EQ(find_bright_patches(*sky_with({{axis, 3, 1000}}, 256)).size(), 1u)
        << axis.x << ' ' << axis.y << ' ' << axis.z;
  }
}

TEST(BrightPatches, NoneInPlainSkies) {
  EXPECT_TRUE(find_bright_patches(*make_constant_environment({1, 1, 1})).empty());
  EXPECT_TRUE(find_bright_patches(*sky_with({}, 64)).empty());
  EXPECT_TRUE(find_bright_patches(*sky_with({}, 64, 0)).empty()) << "black";
  // Wide, or not bright, or with hardly any of the light.
  EXPECT_TRUE(find_bright_patches(*sky_with({{{1, 1, 0}, 40, 100}}, 512)).empty());
  EXPECT_TRUE(find_bright_patches(*sky_with({{{1, 1, 0}, 3, 5}}, 512)).empty());
  EXPECT_TRUE(find_bright_patches(*sky_with({{{1, 1, 0}, 1, 100}}, 512)).empty());
}

TEST(BrightPatches, AreThereWhereTheyAreFound) {
  for (const double radiance : {0, 5, 20, 100, 1000, 100000}) {
    const auto sky = sky_with({{{1, 1, 0}, 3, radiance}}, 256);
    EXPECT_EQ(has_bright_patch(*sky), !find_bright_patches(*sky).empty()) << radiance;
  }
  EXPECT_TRUE(has_bright_patch(*sky_with({{{1, 1, 0}, 3, 1000}}, 256)));
  EXPECT_FALSE(has_bright_patch(*make_constant_environment({1, 1, 1})));
}

// Every direction of a cap above the horizon is inside its cone, and few others.
TEST(BrightPatches, ConesHoldTheirCaps) {
  Rng rng(33, 0, 0);
  int in_cone = 0, in_cap = 0;
  for (int i = 0; i < 2000; ++i) {
    const double angle = 0.14 * rng.uniform();
    const DirectionCap cap{random_direction(rng), std::sin(angle), std::cos(angle)};
    const Vec3d n = random_direction(rng);
    const auto cone = cone_around(cap, n);
    for (int k = 0; k < 20; ++k) {
      const Vec3d w = normalize(cap.axis + random_direction(rng) * (1.5 * angle * rng.uniform()));
      if (dot(n, w) <= 0) continue;
      bool inside = cone.has_value();
      for (int j = 0; cone && j < cone->count; ++j)
        inside = inside && dot(cone->planes[j], w) >= -cone->slack;
      in_cone += inside;
      in_cap += cap.holds(w);
      EXPECT_TRUE(inside || !cap.holds(w));
    }
  }
  EXPECT_LT(in_cone, 1.1 * in_cap);
}

struct Case {
  EdgeMesh mesh;
  EdgeQuery query;
};

// An edge of unknown length before p, with velocities of its own in all lanes.
Case random_case(Rng& rng) {
  Case c;
  const double size = std::exp(std::log(1e-2) + std::log(1e3) * rng.uniform());
  c.query.p = random_direction(rng);
  c.query.n = random_direction(rng);
  c.query.wi = normalize(c.query.n + random_direction(rng) * 0.7);
  c.query.velocity.y[1] = 0.3;
  c.query.turn.rate.x[2] = rng.uniform();
  if (rng.uniform() < 0.5) c.query.turn.axis = random_direction(rng);
  for (int i = 0; i < 2; ++i) {
    const Vec3d d = random_direction(rng);
    c.mesh.positions.push_back(c.query.p + d * (size * (0.1 + rng.uniform())));
    Vec3<Lanes> v;
    for (int k = 0; k < kLanes; ++k) {
      const Vec3d r = random_direction(rng);
      v.x[k] = r.x, v.y[k] = r.y, v.z[k] = r.z;
    }
    c.mesh.tangents.push_back(v);
  }
  Edge edge;
  edge.vertices = {VertexId(0), VertexId(1)};
  c.mesh.edges.push_back(edge);
  return c;
}

std::vector<EdgePiece> pieces_of(const Case& c, const Lanes& scale = {1, 1, 1, 1}) {
  EdgeSamplerInput input{{c.mesh}};
  input.lane_scale = scale;
  const ListedEdge edge{{ShapeId(0), EdgeId(0)}, c.mesh.positions[0], c.mesh.positions[1]};
  std::vector<EdgePiece> pieces;
  cut_edges(input, c.query, {}, {&edge, 1}, pieces);
  return pieces;
}

// det(w_0, w_1, v) / |w|^3, of each lane.
Lanes jacobian(const Case& c, double t) {
  const Vec3d a = c.mesh.positions[0] - c.query.p, b = c.mesh.positions[1] - c.query.p;
  const Vec3d w = a * (1 - t) + b * t, side = cross(a, b);
  const Vec3<Lanes> v = relative_velocity(c.mesh, VertexId(0), c.query) * (1 - t) +
                        relative_velocity(c.mesh, VertexId(1), c.query) * t;
  const double l = length(w);
  return (v.x * side.x + v.y * side.y + v.z * side.z) * (1 / (l * l * l));
}

// Along one edge: the pieces tile it, each density integrates to one, and where the cosine and the
// velocity keep their signs a weight is the integral of the modulus, lanes added up by their
// scales.
TEST(EdgePieces, WeighTheIntegralAndTileTheEdge) {
  Rng rng(32, 0, 0);
  const Lanes scale(1, 2, 0.5, 3);
  double largest = 0;
  int pieces_seen = 0;
  for (int i = 0; i < 400; ++i) {
    const Case c = random_case(rng);
    const Vec3d w0 = c.mesh.positions[0] - c.query.p, w1 = c.mesh.positions[1] - c.query.p;
    double t0 = 0, t1 = 1;
    if (!DirectionCone::clip_by(dot(c.query.n, w0), dot(c.query.n, w1), t0, t1)) continue;
    const std::vector<EdgePiece> pieces = pieces_of(c, scale);
    ASSERT_FALSE(pieces.empty());
    double at = t0, sum = 0, integral = 0;
    for (const EdgePiece& piece : pieces) {
      EXPECT_EQ(piece.t0, at);
      at = piece.t1;
      ++pieces_seen;
      sum += piece.weight;
      constexpr int kSteps = 200;
      for (int k = 0; k < kSteps; ++k) {
        const double u = (k + 0.5) / kSteps, h = 1e-5;
        const auto [t, density] = piece.place(u);
        const double slope = (piece.place(u + h).t - piece.place(u - h).t) / (2 * h);
        ASSERT_NEAR(slope * density, 1, 1e-4);
        const Vec3d w = w0 * (1 - t) + w1 * t;
        const double cosine = std::max(0.0, dot(c.query.n, w) / length(w)) / kPi;
        const Lanes j = jacobian(c, t);
        for (int lane = 0; lane < kLanes; ++lane)
          integral += scale[lane] * std::fabs(j[lane]) * cosine / (density * kSteps);
      }
    }
    EXPECT_EQ(at, t1);
    largest = std::max(largest, std::fabs(sum / integral - 1));
    EXPECT_NEAR(sum / integral, 1, 0.1);
  }
  fmt::print("{} pieces, largest error of a sum {:.3f}\n", pieces_seen, largest);
  EXPECT_GT(pieces_seen, 1000);
}

// A velocity across the edge that changes its sign in the middle: its integral is zero, the weight
// is not. Motion along the plane through p and the edge weighs nothing.
TEST(EdgePieces, DoNotCancel) {
  Case c;
  c.query.n = c.query.wi = {0, 0, 1};
  c.mesh.positions = {{-0.1, 0, 1}, {0.1, 0, 1}};
  Edge edge;
  edge.vertices = {VertexId(0), VertexId(1)};
  c.mesh.edges = {edge};
  const auto weight = [&](const Vec3d& v0, const Vec3d& v1) {
    c.mesh.tangents.clear();
    for (const Vec3d& v : {v0, v1})
      c.mesh.tangents.push_back({{v.x, 0, 0, 0}, {v.y, 0, 0, 0}, {v.z, 0, 0, 0}});
    const std::vector<EdgePiece> pieces = pieces_of(c);
    return pieces.empty() ? 0 : pieces[0].weight;
  };
  const double full = weight({0, 1, 0}, {0, 1, 0});
  EXPECT_NEAR(full, 0.2 / kPi, 0.01);
  EXPECT_GT(weight({0, 1, 0}, {0, -1, 0}), 0.4 * full);
  EXPECT_EQ(weight({1, 0, 0}, {0, 0, 1}), 0);
}

// p at an end, on the edge, on its line: nothing, and nothing that is no number.
TEST(EdgePieces, OfEdgesThroughThePoint) {
  Case c;
  c.query.n = c.query.wi = {0, 0, 1};
  c.query.velocity.y[0] = 1;
  Edge edge;
  edge.vertices = {VertexId(0), VertexId(1)};
  c.mesh.edges = {edge};
  for (const double x : {0.0, -1.0, -0.3, 2.0}) {
    c.mesh.positions = {{x, 0, 0}, {x + 1, 0, 0}};
    EXPECT_TRUE(pieces_of(c).empty());
    for (Vec3d& p : c.mesh.positions) p.z = 1e-300;
    for (const EdgePiece& piece : pieces_of(c)) EXPECT_TRUE(std::isfinite(piece.weight));
  }
}

// Directions towards a region follow the density that is told: integrals over it by draws are those
// by directions of the whole sphere.
// Directions towards a sun and towards what glows around it: within it, and evenly.
TEST(LightRegions, DrawWithinASunAndItsGlow) {
  const Vec3d sun = normalize(Vec3d{0.2, 0.4, 1});
  Scene scene;
  scene.environment =
      sky_with({{sun, 6, 5}, {sun, 1.6, 200}, {sun, 0.9, 800}, {sun, 0.5, 3e4}}, 2048);
  const LightRegions regions(scene);
  ASSERT_EQ(regions.size(), 2u);
  ASSERT_TRUE(regions.patch(1).is_ring());
  constexpr int kSteps = 1000;
  for (size_t k = 0; k < 2; ++k) {
    const BrightPatch& patch = regions.patch(k);
    const double outer = 1 - patch.cap.cosine, inner = patch.inner_versine();
    for (int i = 0; i < kSteps; ++i) {
      const double u = (i + 0.5) / kSteps;
      const auto w = regions.draw_direction(k, {}, u, 0.3);
      ASSERT_TRUE(w);
      EXPECT_TRUE(patch.holds(*w)) << k << " " << u;
      EXPECT_NEAR(1 - dot(*w, patch.cap.axis), inner + u * (outer - inner), 1e-12);
      EXPECT_NEAR(regions.direction_pdf(k, {}, *w) * 2 * kPi * (outer - inner), 1, 1e-9);
    }
  }
  EXPECT_EQ(regions.direction_pdf(1, {}, regions.patch(0).cap.axis), 0);
}

TEST(LightRegions, DrawDirectionsByTheirDensity) {
  const TempFiles files;
  SceneParts parts;
  const auto lamp = [&](const std::string& id, const Mesh& mesh, const Vec3d& offset) {
    return obj_shape(id, write_mesh(files, id + ".obj", mesh), true, 0.5, offset,
                     area_light(id + "_light", "1, 1, 1"));
  };
  parts.body = lamp("octagon", disk_mesh(8), {0, 0, 0}) + lamp("hook", concave_mesh(), {0, 1, 0}) +
               lamp("ball", icosphere_mesh(1), {1, 0, 0});
  const Scene scene = make_scene(files, parts);
  const LightRegions regions(scene);
  ASSERT_EQ(regions.size(), 3u);
  const auto g = [](const Vec3d& w) { return 2 + w.x - 0.5 * w.y; };
  constexpr int kDraws = 200000;
  Rng rng(5, 0, 0);
  for (size_t k = 0; k < regions.size(); ++k) {
    for (const Vec3d& x : {Vec3d{0.3, 0.2, 1.5}, Vec3d{2, -0.5, 0.7}}) {
      double drawn = 0, drawn2 = 0, whole = 0, whole2 = 0;
      for (int i = 0; i < kDraws; ++i) {
        const auto w = regions.draw_direction(k, x, rng.uniform(), rng.uniform());
        ASSERT_TRUE(w);
        const double pdf = regions.direction_pdf(k, x, *w);
        const double a = pdf > 0 ? g(*w) : 0;
        drawn += a, drawn2 += a * a;
        const double z = 2 * rng.uniform() - 1, phi = 2 * kPi * rng.uniform();
        const double r = std::sqrt(1 - z * z);
        const Vec3d v{r * std::cos(phi), r * std::sin(phi), z};
        const double b = 4 * kPi * regions.direction_pdf(k, x, v) * g(v);
        whole += b, whole2 += b * b;
      }
      const double error =
          std::sqrt(drawn2 - drawn * drawn / kDraws + whole2 - whole * whole / kDraws);
      EXPECT_LT(std::fabs(drawn - whole), 5 * error) << k;
    }
  }
  // Nothing shines behind a flat lamp.
  EXPECT_FALSE(regions.draw_direction(0, {0, 0, -1}, 0.5, 0.5));
  EXPECT_EQ(regions.direction_pdf(0, {0, 0, -1}, {0, 0, 1}), 0);
}

}  // namespace
}  // namespace limn
