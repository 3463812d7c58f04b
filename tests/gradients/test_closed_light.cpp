// Light in closed form: against formulas, lamps sampled point by point, differences of itself; what
// must not matter; whole images and derivatives against those of paths.
#include "integrators/lights/closed_light.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "integrators/edges/scene_edges.h"
#include "limn/core/parameter.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/render.h"
#include "support/block_runs.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

// A scene with its first lane seeded, or moved.
struct World {
  World(const Scene& original, const std::string& parameter = "",
        ClosedLight::By by = ClosedLight::By::kOutlines)
      : scene(deep_copy(original)),
        tracer((seed(parameter), make_embree_tracer(scene, 1))),
        light(scene, 1, by) {}
  void seed(const std::string& parameter) {
    if (!parameter.empty()) find_parameter(scene, parameter).seed(scene, 0);
  }

  // What the face scatters along a fixed ray to the viewer, where that meets its plane.
  template <class S>
  Rgb<S> scattered(FaceRef face, const Vec3d& origin, const Vec3d& direction) const {
    const Vec3<S> o{origin.x, origin.y, origin.z}, d{direction.x, direction.y, direction.z};
    const auto surface = surface_on_ray<S>(scene, face, o, d);
    return light.scattered(*tracer, surface, Scattering<S>(surface, -d, scene.shading), nullptr);
  }
  FaceRef face_on(const Vec3d& origin, const Vec3d& direction) const {
    Hit hit;
    return tracer->closest({origin, direction}, hit) ? hit.face : FaceRef{};
  }
  // On the floor, seen from above; white.
  double on_floor(double x, double z) const {
    const Vec3d origin{x, 1e-3, z}, down{0, -1, 0};
    return scattered<double>({ShapeId(0), FaceId(z < -x ? 0u : 1u)}, origin, down).g;
  }

  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  ClosedLight light;
};

// The floor's face does not matter: it has one plane.
Scene over_floor(const TempFiles& files, const std::string& body) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.body = square("floor", 8, -90, {0, 0, 0}, diffuse("chalk", "1, 1, 1")) + body;
  return make_scene(files, parts);
}

// Of a differential area to a rectangle parallel to it at the height h, a corner of which is above
// it (Howell, B-3), times pi.
double parallel_corner(double a, double b, double h) {
  const double p = std::hypot(a, h), q = std::hypot(b, h);
  return 0.5 * (a / p * std::atan(b / p) + b / q * std::atan(a / q));
}
double parallel(double x0, double x1, double z0, double z1, double h) {
  return parallel_corner(x1, z1, h) - parallel_corner(x0, z1, h) - parallel_corner(x1, z0, h) +
         parallel_corner(x0, z0, h);
}
// The same of a rectangle across it that stands on its plane at the distance c, b high, from its
// foot to `a` sideways (B-4).
double standing(double a, double b, double c) {
  const double s = std::hypot(b, c);
  return 0.5 * (std::atan(a / c) - c / s * std::atan(a / s));
}

TEST(ClosedLight, LampsOverTheFloor) {
  const TempFiles files;
  const std::string glow = area_light("glow", "1, 1, 1");
  const World above(over_floor(files, square("lamp", 0.5, 90, {0.25, 2, 0}, glow)));
  // On the floor, through the floor, and edge-on; it shines towards +z.
  const World standing_on(over_floor(files, square("lamp", 0.5, 0, {0, 0.5, 0}, glow)));
  const World through(over_floor(files, square("lamp", 0.5, 0, {0, 0.25, 0}, glow)));
  const World ceiling(
      over_floor(files, square("lamp", 0.5, 90, {0.25, 2, 0}, glow) +
                            square("top", 3, 90, {0, 2, 0}, diffuse("t", "1, 1, 1")) +
                            square("back", 3, -90, {0, 2, 0}, diffuse("b", "1, 1, 1"))));
  for (const double x : {-3.0, -0.5, 0.0, 0.1, 2.0}) {
    for (const double z : {1e-6, 0.01, 0.5, 3.0}) {
      const double lamp = parallel(-0.25 - x, 0.75 - x, -0.5 - z, 0.5 - z, 2) / kPi;
      EXPECT_NEAR(above.on_floor(x, z), lamp, 1e-14);
      EXPECT_EQ(ceiling.on_floor(x, z), above.on_floor(x, z));
      const auto upright = [&](double height) {
        return (standing(0.5 - x, height, z) - standing(-0.5 - x, height, z)) / kPi;
      };
      // Where the lamp's foot and the horizon are one line, the grid tells where.
      EXPECT_NEAR(standing_on.on_floor(x, z), upright(1), 1e-9 + 1e-12 / z);
      EXPECT_NEAR(through.on_floor(x, z), upright(0.75), 1e-9 + 1e-12 / z);
      EXPECT_EQ(standing_on.on_floor(x, -z), 0);
    }
    EXPECT_EQ(standing_on.on_floor(x, 0), 0);
  }
}

// The same screen in many ways; it hides the lamp's part x < 0.2 from the origin.
std::vector<NamedMesh> screens() {
  const auto quad = [](float x0, float x1, float z0, float z1, float y) {
    return make_mesh({{x0, y, z0}, {x1, y, z0}, {x1, y, z1}, {x0, y, z1}}, {{0, 1, 2}, {0, 2, 3}});
  };
  const Mesh one = quad(-1, 0.125f, -1, 1, 1);
  // Long sides beside short ones.
  Mesh junctions = quad(-1, 0, -1, 1, 1);
  for (int i = 0; i < 37; ++i) {
    const auto at = [](int k) { return static_cast<float>(-1 + 2.0 * k / 37); };
    junctions = joined(junctions, quad(0, 0.125f, at(i), i == 36 ? 1 : at(i + 1), 1));
  }
  Mesh fan;
  fan.positions.push_back({0.0625f, 1, 0.03125f});
  const auto spoke = [&](double t) {  // once around the quad
    const double s = 4 * t;
    const int k = std::min(3, static_cast<int>(s));
    const auto f = static_cast<float>(s - k);
    const Vec3f corners[5] = {
        {-1, 1, -1}, {0.125f, 1, -1}, {0.125f, 1, 1}, {-1, 1, 1}, {-1, 1, -1}};
    const Vec3f &a = corners[k], &b = corners[k + 1];
    fan.positions.push_back({a.x + (b.x - a.x) * f, 1, a.z + (b.z - a.z) * f});
  };
  constexpr int kSpokes = 1000;
  for (int i = 0; i < kSpokes; ++i) spoke(i / double(kSpokes));
  for (uint32_t i = 0; i < kSpokes; ++i) fan.faces.push_back({0, 1 + i, 1 + (i + 1) % kSpokes});
  Mesh box = quad(-1, 0.125f, -1, 1, 1);  // closed, wider below: its top's side is the outline
  box = joined(box, reversed(quad(-1, -0.5f, -1, 1, 0.5f)));
  box =
      joined(box, make_mesh({{0.125f, 1, -1}, {-0.5f, 0.5f, -1}, {-0.5f, 0.5f, 1}, {0.125f, 1, 1}},
                            {{0, 1, 2}, {0, 2, 3}}));
  return {{"one", one},
          {"twice", joined(one, joined(reversed(one), one))},
          {"overlapping", joined(one, quad(-1, 0.1f, -0.7f, 0.6f, 1))},
          {"junctions", junctions},
          {"fan", make_mesh(fan.positions, fan.faces)},
          {"box", box},
          {"above itself", joined(one, quad(-1, -0.25f, -1.5f, 1.5f, 1.5f))}};
}

TEST(ClosedLight, ScreensHideWhatTheyCover) {
  const TempFiles files;
  for (const NamedMesh& screen : screens()) {
    const Scene scene =
        over_floor(files, square("lamp", 0.5, 90, {0.25, 2, 0}, area_light("glow", "1, 1, 1")) +
                              obj_shape("screen", write_mesh(files, "screen.obj", screen.mesh),
                                        true, 1, {0, 0, 0}, diffuse("black", "0, 0, 0")));
    const World world(scene, "screen.translate.x");
    // From (x, z), |z| <= 0.25, all of the lamp before 2 * 0.125 - x is hidden.
    for (const double x : {0.0, 0.03, -0.2, 0.4, -0.4, -0.6, 0.6}) {
      const double z = 0.1 * x;
      const auto lit = [&](double edge) {
        const double from = std::clamp(2 * edge - x, -0.25, 0.75);
        return parallel(from - x, 0.75 - x, -0.5 - z, 0.5 - z, 2) / kPi;
      };
      EXPECT_NEAR(world.on_floor(x, z), lit(0.125), 1e-9) << screen.name << x;
      if (lit(0.125) == 0) {
        EXPECT_NEAR(world.on_floor(x, z), 0, 1e-16) << screen.name;
      }
      const Dual moved =
          world.scattered<Dual>({ShapeId(0), FaceId(0u)}, {x, 1e-3, z}, {0, -1, 0}).g;
      const double h = 1e-4;
      const double slope =
          (lit(0.125 - 2 * h) - lit(0.125 + 2 * h) - 8 * (lit(0.125 - h) - lit(0.125 + h))) /
          (12 * h);
      EXPECT_NEAR(moved.v, world.on_floor(x, z), 1e-15);
      EXPECT_NEAR(moved.d[0], slope, 1e-9) << screen.name << x;
    }
  }
}

// Bodies that pass through each other, the floor and a lamp; open, flat and smooth ones.
Scene crowded(const TempFiles& files) {
  const Mesh leaf =
      make_mesh({{-1, 0, 0}, {0, -0.5f, 0.3f}, {0, 0.5f, 0.3f}, {1, 0, 0}}, {{0, 1, 2}, {2, 1, 3}});
  const std::string twosided =
      R"(<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value=".3,.6,.2"/></bsdf>
      </bsdf>)";
  return over_floor(
      files, obj_shape("torus", write_mesh(files, "torus.obj", torus_mesh(12, 7)), true, 0.4,
                       {0, 0.3, 0.1}, diffuse("clay", "0.6, 0.5, 0.4")) +
                 obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.3,
                           {0.4, 0.35, 0.2}, diffuse("snow", "0.9, 0.9, 0.9")) +
                 obj_shape("leaf", write_mesh(files, "leaf.obj", leaf), true, 0.4, {-0.2, 1, 0.3},
                           twosided) +
                 square("lamp", 0.4, 90, {0.3, 1.6, -0.2}, area_light("glow", "9, 8, 6")) +
                 square("small", 0.1, 40, {-0.5, 0.9, 0.6}, area_light("dim", "3, 9, 5")) +
                 obj_shape("bulb", write_mesh(files, "bulb.obj", tetrahedron_mesh()), true, 0.1,
                           {0.5, 1.2, -0.5}, area_light("fire", "9, 2, 1")) +
                 obj_shape("spear", write_mesh(files, "spear.obj", icosphere_mesh(0)), true, 0.2,
                           {0.4, 1.63, -0.3}, diffuse("iron", "0.4, 0.4, 0.4")));
}

// Light of all lamps by points on a grid of n by n cells, one in each.
Rgb<double> sampled(const World& world, const SurfacePoint<double>& surface,
                    const Scattering<double>& scattering, int n, Rng& rng) {
  Rgb<double> sum;
  for (uint32_t s = 0; s < world.scene.shapes.size(); ++s) {
    const Shape& shape = world.scene.shapes[s];
    for (uint32_t f = 0; shape.is_emitter && f < shape.mesh.faces.size(); ++f) {
      const FaceRef face{ShapeId(s), FaceId(f)};
      const auto c = face_corners<double>(shape.mesh, face.face);
      const Vec3d normal = cross(c[1] - c[0], c[2] - c[0]);  // twice the area
      for (int i = 0; i < n * n; ++i) {
        const double root = std::sqrt((i % n + rng.uniform()) / n);
        const double b = root * (i / n + rng.uniform()) / n;
        const Vec3d y = c[0] + (c[1] - c[0]) * (1 - root) + (c[2] - c[0]) * b;
        const double distance = length(y - surface.p);
        const Vec3d w = (y - surface.p) / distance;
        const double cosine = -dot(normal, w);
        if (!(cosine > 0)) continue;
        const Rgb<double> f_s = scattering.eval_value(w);
        Ray ray{surface.p, w};
        ray.start = surface.face;
        ray.end = face;
        ray.t_max = distance * (1 - 0x1p-20);
        if (is_black(f_s) || world.tracer->occluded(ray)) continue;
        sum += f_s * value(shape.radiance) * (0.5 * cosine / (distance * distance * n * n));
      }
    }
  }
  return sum;
}

TEST(ClosedLight, IsWhatIsSampled) {
  const TempFiles files;
  const World world(crowded(files));
  constexpr int kGroups = 60, kPoints = 12, kRepeats = 8, kCells = 6;
  std::vector<double> z;
  Rng rng(52, 0, 0);
  int found = 0, lit = 0;
  for (int g = 0; g < kGroups; ++g) {
    double residual = 0, variance = 0;
    for (int k = 0; k < kPoints; ++k) {
      const Vec3d origin = random_direction(rng) * 1.5 + Vec3d{0, 1.6, 0};
      const Vec3d target{rng.uniform() - 0.4, 0.6 * rng.uniform(), rng.uniform() - 0.4};
      const Vec3d direction = normalize(target - origin);
      const FaceRef face = world.face_on(origin, direction);
      if (!face.shape.valid()) continue;
      ++found;
      const auto surface = surface_on_ray<double>(world.scene, face, origin, direction);
      const Scattering<double> scattering(surface, -direction, world.scene.shading);
      if (scattering.black()) continue;
      const double truth = world.scattered<double>(face, origin, direction).g;
      double values[kRepeats], mean = 0;
      for (double& v : values) {
        v = sampled(world, surface, scattering, kCells, rng).g;
        mean += v / kRepeats;
      }
      for (const double v : values) {
        variance += (v - mean) * (v - mean) / (kRepeats * (kRepeats - 1));
      }
      residual += mean - truth;
      lit += truth > 0;
    }
    z.push_back(residual / std::sqrt(variance));
  }
  const ZSummary summary = summarize(z);
  fmt::print("{} points, {} lit; z: mean {:.2f}, deviation {:.2f}, largest {:.2f}\n", found, lit,
             summary.mean, summary.deviation, summary.largest);
  EXPECT_GT(lit, 400);
  EXPECT_TRUE(summary.plausible(kLevel));
}

// What is lit, by outlines and by regions: two ways that share nothing but sides.
TEST(ClosedLight, OutlinesAreThoseOfRegions) {
  const TempFiles files;
  const Scene scene = crowded(files);
  for (const std::string name : {"torus.rotate.y", "lamp.rotate.x", "spear.translate.z"}) {
    const World outlines(scene, name), regions(scene, name, ClosedLight::By::kRegions);
    Rng rng(56, 0, 0);
    double value = 0, slope = 0, value_error = 0, slope_error = 0;
    for (int i = 0; i < 400; ++i) {
      const Vec3d origin = random_direction(rng) * 1.5 + Vec3d{0, 1.6, 0};
      const Vec3d target{rng.uniform() - 0.4, 0.6 * rng.uniform(), rng.uniform() - 0.4};
      const Vec3d direction = normalize(target - origin);
      const FaceRef face = outlines.face_on(origin, direction);
      if (!face.shape.valid()) continue;
      const auto surface = surface_on_ray<double>(scene, face, origin, direction);
      if (Scattering<double>(surface, -direction, scene.shading).black()) continue;
      const Dual a = outlines.scattered<Dual>(face, origin, direction).g;
      const Dual b = regions.scattered<Dual>(face, origin, direction).g;
      EXPECT_NEAR(a.v, b.v, 1e-11) << i;
      EXPECT_NEAR(a.d[0], b.d[0], 1e-9 * (1 + std::fabs(b.d[0]))) << i;
      value = std::max(value, b.v), slope = std::max(slope, std::fabs(b.d[0]));
      value_error = std::max(value_error, std::fabs(a.v - b.v));
      slope_error = std::max(slope_error, std::fabs(a.d[0] - b.d[0]));
    }
    fmt::print("{:18} values to {:.2g}, off by {:.1g}; derivatives to {:.2g}, off by {:.1g}\n",
               name, value, value_error, slope, slope_error);
    EXPECT_GT(slope, 0.01);
  }
}

// A path that starts on an edge sees the limit of what points see that come to it on its face:
// edges of bodies, of bodies that stand on others, and where bodies cross.
TEST(ClosedLight, PointsOnEdgesAreLimits) {
  const TempFiles files;
  Scene scene = crowded(files);
  const std::string cube = write_mesh(files, "cube.obj", cube_mesh());
  SceneParts parts;
  parts.max_depth = 2;
  parts.body = square("floor", 2, -90, {0, 0, 0}, diffuse("chalk", "1, 1, 1")) +
               obj_shape("cube", cube, true, 0.25, {-0.3, 0.25, 0.1}, diffuse("a", "1, 1, 1")) +
               obj_shape("upper", cube, true, 0.125, {-0.3, 0.625, 0}, diffuse("b", "1, 1, 1")) +
               square("lamp", 0.4, 90, {0.3, 1.6, -0.2}, area_light("glow", "9, 8, 6"));
  for (const Scene& each : {scene, make_scene(files, parts)}) {
    const World world(each);
    const EdgeSamplerInput input = make_sampler_input(world.scene, 1);
    Rng rng(55, 0, 0);
    int points = 0, lit = 0, blocked = 0;
    constexpr double kNear = 1e-6;
    // Radiance of 9 in a solid angle of pi, over pi, of lamps at a distance of 1: as steep as that.
    constexpr double kSlope = 9;
    for (const EdgeMesh& object : input.objects) {
      for (uint32_t e = 0; e < object.edges.size(); ++e) {
        const FacesAround around = object.around(EdgeId(e));
        // Where a body goes through a lamp, its light has no limit.
        const auto shines = [&](FaceRef face) { return world.scene.shape(face.shape).is_emitter; };
        if (std::any_of(around.faces.begin(), around.faces.end(), shines)) continue;
        const auto& ends = object.edge(EdgeId(e)).vertices;
        const Vec3d x0 = object.position(ends[0]), x1 = object.position(ends[1]);
        const Vec3d y = x0 + (x1 - x0) * (0.1 + 0.8 * rng.uniform());
        for_every_side(
            world.scene, around, x0, normalize(x1 - x0), [&](const FaceSide& side, Incidence) {
              const auto c =
                  face_corners<double>(world.scene.shape(side.face.shape).mesh, side.face.face);
              const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
              const EdgeStart start{around, x0, x1, side};
              const auto light_at = [&](double step, const EdgeStart* edge) {
                const auto surface =
                    surface_on_ray<double>(world.scene, side.face, y + side.into * step, n);
                const Scattering<double> scattering(surface, n, world.scene.shading);
                return world.light.scattered(*world.tracer, surface, scattering, edge).g;
              };
              const double here = light_at(0, &start), near = light_at(kNear, nullptr),
                           far = light_at(10 * kNear, nullptr);
              // Like a root of the distance at the least smooth, or with the slope of what stands
              // at a distance.
              EXPECT_LE(std::fabs(here - near),
                        std::sqrt(0.1) * std::fabs(here - far) + kSlope * kNear)
                  << "face " << side.face.face.index() << " of shape " << side.face.shape.index()
                  << " at edge " << e;
              ++points;
              lit += here > 0;
              blocked += here < light_at(0, nullptr);
            });
      }
    }
    fmt::print("{} points, {} lit, {} with less light than without their neighbours\n", points, lit,
               blocked);
    EXPECT_GT(lit, 10);
  }
}

// With coordinates that floats hold after every step of a test, too, and no symmetry.
Mesh snapped(Mesh mesh, double scale, const Vec3d& offset) {
  Rng rng(54, 0, 0);
  for (Vec3f& x : mesh.positions) {
    for (int k = 0; k < 3; ++k) {
      const double bump = 0.02 * rng.uniform();
      x[k] = static_cast<float>(std::round((x[k] * scale + offset[k] + bump) * 4096) / 4096);
    }
  }
  return make_mesh(mesh.positions, mesh.faces);
}

// Every vertex of one shape on its own way, in steps of 1 / 64; copies of a vertex together.
std::string velocities(const TempFiles& files, const Mesh& mesh, uint64_t seed) {
  std::string text;
  for (const Vec3f& x : mesh.positions) {
    Rng rng(seed, static_cast<uint64_t>(std::llround(4096.0 * (x.x + 8))),
            static_cast<uint64_t>(std::llround(4096.0 * (x.y + 8) + 65536.0 * 4096 * (x.z + 8))));
    for (int k = 0; k < 3; ++k)
      text += fmt::format("{} ", std::round(64 * rng.uniform() - 32) / 64);
    text += "\n";
  }
  return files.write(fmt::format("velocity{}.txt", seed), text);
}

// Along fixed rays, for shapes that light falls on, that are in its way, and that send it.
TEST(ClosedLight, DerivativeIsThatOfItsValue) {
  const TempFiles files;
  struct Body {
    std::string id;
    Mesh mesh;
    bool flat;
    std::string inner;
  };
  const Mesh up =
      make_mesh({{-2, 0, 2}, {2, 0, 2}, {2, 0, -2}, {-2, 0, -2}}, {{0, 1, 2}, {0, 2, 3}});
  const Mesh down = make_mesh(
      {{-0.5f, 1.5f, -0.25f}, {0.5f, 1.5f, -0.25f}, {0.5f, 1.5f, 0.5f}, {-0.25f, 1.5f, 0.5f}},
      {{0, 1, 2}, {0, 2, 3}});
  const std::vector<Body> bodies = {{"floor", up, true, diffuse("chalk", "0.8, 0.8, 0.8")},
                                    {"ball", snapped(icosphere_mesh(1), 0.4, {0.2, 0.35, 0}), true,
                                     diffuse("snow", "0.9, 0.9, 0.9")},
                                    {"torus", snapped(torus_mesh(9, 6), 0.3, {-0.3, 0.8, 0.1}),
                                     false, diffuse("clay", "0.6, 0.5, 0.4")},
                                    {"spear", snapped(icosphere_mesh(0), 0.125, {0.1, 1.5, 0.1}),
                                     true, diffuse("iron", "0.4, 0.4, 0.4")},
                                    {"lamp", down, true, area_light("glow", "5, 5, 5")}};
  SceneParts parts;
  parts.max_depth = 2;
  for (const Body& body : bodies) {
    parts.body += obj_shape(body.id, write_mesh(files, body.id + ".obj", body.mesh), body.flat, 1,
                            {0, 0, 0}, body.inner);
  }
  const Scene scene = make_scene(files, parts);
  for (size_t b = 0; b < bodies.size(); ++b) {
    const std::string name =
        bodies[b].id + ".vertex_positions:" + velocities(files, bodies[b].mesh, b);
    const Parameter parameter = find_parameter(scene, name);
    const World world(scene, name);
    constexpr double kStep = 0x1p-11;
    // Values are sums over some tens of sides, of 5 units of light, each of some hundred roundings.
    // A difference over 2 kStep is off by this over kStep, (4 near - far) / 3 by 3 / 2 of it.
    constexpr double kRounding = 0x1p-40, kSlopeRounding = 1.5 * kRounding / kStep;
    std::vector<std::unique_ptr<World>> moved;
    for (const int k : {-2, -1, 1, 2}) {
      moved.push_back(std::make_unique<World>(parameter.moved(scene, k * kStep)));
    }
    Rng rng(53, b, 0);
    double squares = 0;
    std::vector<double> residuals;
    for (int i = 0; i < 200; ++i) {
      const Vec3d origin = random_direction(rng) + Vec3d{0, 1.2, 0};
      const Vec3d target{rng.uniform() - 0.5, 0.3 * rng.uniform(), rng.uniform() - 0.5};
      const Vec3d direction = normalize(target - origin);
      const FaceRef face = world.face_on(origin, direction);
      if (!face.shape.valid() || origin.y < 0) continue;
      const auto surface = surface_on_ray<double>(scene, face, origin, direction);
      if (Scattering<double>(surface, -direction, scene.shading).black()) continue;
      const Dual here = world.scattered<Dual>(face, origin, direction).g;
      EXPECT_NEAR(here.v, world.scattered<double>(face, origin, direction).g, kRounding);
      double f[4];
      for (int k = 0; k < 4; ++k) f[k] = moved[k]->scattered<double>(face, origin, direction).g;
      const double near = (f[2] - f[1]) / (2 * kStep), far = (f[3] - f[0]) / (4 * kStep);
      const double residual = std::fabs(here.d[0] - (4 * near - far) / 3);
      // What differences say of kinks: where an outline changes its make-up the slope does.
      const double bend1 = (f[2] + f[1] - 2 * here.v) / kStep;
      const double bend2 = (f[3] + f[0] - 2 * here.v) / (2 * kStep);
      EXPECT_LE(residual,
                kSlopeRounding + std::fabs(bend2 - 2 * bend1) + 4 * std::fabs(near - far));
      residuals.push_back(residual);
      squares += here.d[0] * here.d[0];
    }
    std::sort(residuals.begin(), residuals.end());
    const double size = std::sqrt(squares / static_cast<double>(residuals.size()));
    const double most = residuals[residuals.size() * 4 / 5];
    fmt::print(
        "{:6} {} points, derivative {:.2g}; residual in half of them {:.1g}, in 80 % {:.1g}\n",
        bodies[b].id, residuals.size(), size, residuals[residuals.size() / 2], most);
    EXPECT_LT(most, kSlopeRounding);
    EXPECT_GT(size, 1e6 * kSlopeRounding);  // so that a share of a millionth would be seen
  }
}

GradientResult run(const Scene& scene, const std::string& method,
                   const std::vector<std::string>& parameters, int spp) {
  GradientOptions options;
  options.parameters = parameters;
  options.method = method;
  return run_blocks(scene, options, spp, method == "analytic" ? 21 : 22, 2);
}

// Sums over blocks of 4 by 4 pixels of images of 16 by 16: single pixels meet rare events.
ZSummary compare_images(const Moments& a, const Moments& b) {
  std::vector<double> z;
  for (size_t block = 0; block < 16; ++block) {
    double residual = 0, variance = 0;
    for (size_t i = 0; i < 16; ++i) {
      const size_t x = block % 4 * 4 + i % 4, y = block / 4 * 4 + i / 4,
                   green = 3 * (16 * y + x) + 1;
      residual += a.mean(green) - b.mean(green);
      variance += a.variance(green) + b.variance(green);
    }
    if (variance > 0) z.push_back(residual / std::sqrt(variance));
  }
  return summarize(z);
}

TEST(Analytic, ImagesAndDerivativesAreThoseOfPaths) {
  const TempFiles files;
  const Scene scene = crowded(files);
  const std::vector<std::string> parameters = {
      "torus.translate.x", "ball.translate.y", "leaf.rotate.z",      "lamp.rotate.x",
      "spear.translate.x", "snow.reflectance", "sensor.translate.x", "glow.radiance"};
  const GradientResult paths = run(scene, "silhouettes", parameters, 64);
  const GradientResult closed = run(scene, "analytic", parameters, 32);
  const ZSummary image = compare_images(closed.radiance, paths.radiance);
  fmt::print("image: z has mean {:5.2f}, deviation {:4.2f}, largest {:4.2f}\n", image.mean,
             image.deviation, image.largest);
  EXPECT_GT(image.count, 8);
  EXPECT_TRUE(image.plausible(kLevel));
  for (size_t k = 0; k < parameters.size(); ++k) {
    const ParameterGradient &a = closed.parameters[k], &b = paths.parameters[k];
    const ZSummary blocks = compare_moments(a.total_blocks, b.total_blocks);
    fmt::print(
        "{:20} {} blocks: z has mean {:5.2f}, deviation {:4.2f}, largest {:4.2f}; {:.2g} "
        "{:.2g}\n",
        a.name, blocks.count, blocks.mean, blocks.deviation, blocks.largest,
        mean_square(variances(a.total)), mean_square(variances(b.total)));
    EXPECT_GT(blocks.count, 1);
    EXPECT_TRUE(blocks.plausible(kLevel)) << a.name;
  }
}

}  // namespace
}  // namespace limn
