// Visibility by lines between silhouettes: W against faces counted one by one, closed forms, what
// must not matter.
#include "integrators/contours/line_light.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrators/lights/closed_light.h"
#include "integrators/paths/camera_path.h"
#include "support/over_floor.h"
#include "support/running_mean.h"

namespace limn {
namespace {

// A point of the scene's first shape, which is the floor, at (x, 0, z).
ContourPoint on_floor(const Scene& scene, double x, double z) {
  const Mesh& mesh = scene.shapes[0].mesh;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto c = face_corners<double>(mesh, FaceId(f));
    bool inside = true;
    const Vec3d p{x, c[0].y, z};
    for (int k = 0; k < 3; ++k) {
      inside = inside && cross(c[(k + 1) % 3] - c[k], p - c[k]).y >= 0;
    }
    if (inside) return {p, {0, 1, 0}, {ShapeId(0), FaceId(f)}};
  }
  return {};
}

struct Looking {
  Looking(const Scene& s, const LineOptions& options = {}, bool direct = false)
      : tracer(make_embree_tracer(s, 1)), light(s, *tracer, 1, options, direct) {}
  std::unique_ptr<RayTracer> tracer;
  LineLight light;
};

double occlusion(const LineLight& light, const ContourPoint& at, int offsets) {
  double sum = 0;
  for (int k = 0; k < offsets; ++k) {
    sum += light.ambient_occlusion(at, at.up, (k + 0.5) / offsets);
  }
  return sum / offsets;
}

// Faces on a ray, each by itself in long numbers, but for those that the point's own sign leaves
// out; -1 if the ray passes within `near` of a side.
int count_faces(const Scene& scene, const ContourPoint& at, const Vec3d& w, double near) {
  int count = 0;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Mesh& mesh = scene.shapes[s].mesh;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      if (at.face == FaceRef{ShapeId(s), FaceId(f)}) continue;
      const auto c = face_corners<double>(mesh, FaceId(f));
      long double side[3];
      for (int k = 0; k < 3; ++k) {
        const Vec3d a = c[k] - at.p, b = c[(k + 1) % 3] - at.p;
        const Vec3<long double> n = cross(cast<long double>(a), cast<long double>(b));
        const long double size = std::sqrt(dot(n, n));
        side[k] = size > 0 ? dot(n, cast<long double>(w)) / size : 0;
      }
      const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
      const double d = dot(n, at.p - c[0]) / length(n);
      if (std::fabs(d) < 1e-12) continue;
      const double sign = d > 0 ? -1 : 1;
      bool inside = true, close = false;
      for (const long double x : side) {
        inside = inside && sign * x > -near;
        close = close || std::fabs(static_cast<double>(x)) < near;
      }
      if (inside && close) return -1;
      count += inside;
    }
  }
  return count;
}

std::vector<std::pair<std::string, std::vector<Body>>> hard_bodies() {
  const Vec3d up{0.1, 1.2, -0.2};
  return {{"closed", {{torus_mesh(20, 10), 1, up}}},
          {"concave and open", {{cap_mesh(2), 1, up}, {grid_mesh(3), 0.6, {0.5, 0.4, 0.3}}}},
          {"inside out", {{reversed(icosphere_mesh(2)), 0.8, up}}},
          {"crossing", {{cube_mesh(), 0.7, up}, {torus_mesh(12, 8), 0.9, up}}},
          {"touching", {{cube_mesh(), 0.5, {0, 0.5, 0}}, {cube_mesh(), 0.25, {0, 1.25, 0}}}},
          {"seams and copies", {{seam_split(joined(cube_mesh(), cube_mesh())), 0.6, up}}},
          {"room", {{cube_mesh(), 8, {0, 7, 0}}, {icosphere_mesh(1), 0.7, up}}}};
}

// From one direction to any other: what contours say changes W as the faces themselves do.
TEST(Contours, WindingIsTheNumberOfFaces) {
  for (const auto& [name, bodies] : hard_bodies()) {
    const TempFiles files;
    const Scene scene = over_floor(files, bodies);
    const auto tracer = make_embree_tracer(scene, 1);
    const Contours contours(scene, *tracer, 1);
    Rng rng(7, 0, 0);
    std::vector<ContourArc> arcs;
    Isolines lines;
    int compared = 0, largest = 0;
    for (int i = 0; i < 40; ++i) {
      // On the floor (where things stand and touch, too), in the air, inside of things.
      ContourPoint at = on_floor(scene, 2 * rng.uniform() - 1, 2 * rng.uniform() - 1);
      if (i % 2 == 1) {
        at = {at.p + Vec3d{0, 2 * rng.uniform(), 0}, random_direction(rng), {}};
      }
      arcs.clear();
      contours.list(at, {}, nullptr, arcs);
      Vec3d pole = random_direction(rng);
      if (dot(pole, at.up) < 0) pole = -pole;
      const Frame frame(pole);
      const int at_pole = contours.count(at, pole, nullptr);
      lines.build({pole, frame.s, frame.t}, 8, rng.uniform(), at, arcs);
      for (int j = 0; j < 8; ++j) {
        const Vec3d& r = lines.line(j).r;
        const double end = -dot(at.up, r) / dot(at.up, pole);
        for (int k = 0; k < 6; ++k) {
          const double cot = std::tan(1.5 * (2 * rng.uniform() - 1));
          if (cot < end) continue;
          int w = at_pole;
          for (const auto& crossing : lines.crossings(j)) {
            if (crossing.cot > cot) w += crossing.change;
          }
          const Vec3d direction = normalize(pole * cot + r);
          const int true_count = count_faces(scene, at, direction, 1e-9);
          if (true_count < 0) continue;
          ++compared;
          largest = std::max(largest, w);
          EXPECT_EQ(w, true_count) << name << " point " << i;
          EXPECT_EQ(contours.count(at, direction, nullptr), true_count) << name << " point " << i;
        }
      }
    }
    EXPECT_GT(compared, 400) << name;
    EXPECT_GE(largest, 2) << name;
  }
}

// The cosine-weighted part of the half sphere around n that a polygon fills (Lambert), from above.
double form_factor(const Vec3d& p, const Vec3d& n, const std::vector<Vec3d>& corners) {
  double sum = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Vec3d a = normalize(corners[i] - p), b = normalize(corners[(i + 1) % corners.size()] - p);
    const Vec3d s = cross(a, b);
    sum += std::atan2(length(s), dot(a, b)) * dot(n, s) / length(s);
  }
  return std::fabs(sum) / (2 * kPi);
}
// Of a triangle, over 2 pi (Van Oosterom and Strackee 1983).
double solid_angle(const Vec3d& p, const std::array<Vec3d, 3>& x) {
  const Vec3d a = normalize(x[0] - p), b = normalize(x[1] - p), c = normalize(x[2] - p);
  return 2 * std::atan2(std::fabs(determinant(a, b, c)), 1 + dot(a, b) + dot(b, c) + dot(c, a)) /
         (2 * kPi);
}

TEST(LineLight, ClosedFormsOfOpenSky) {
  const TempFiles files;
  const Scene open = over_floor(files, {});
  const ContourPoint at = on_floor(open, 0.3, 0.2);
  const Looking nothing(open);
  EXPECT_NEAR(nothing.light.openness(at, 0.3), 1, 1e-14);
  EXPECT_NEAR(nothing.light.ambient_occlusion(at, at.up, 0.3), 1, 1e-14);

  // A square over the floor, seen from below.
  const Mesh roof =
      make_mesh({{-1, 1, -1}, {1, 1, -1}, {1, 1, 1}, {-1, 1, 1}}, {{0, 1, 2}, {0, 2, 3}});
  const std::vector<Vec3d> corners = {{-1, 1, -1}, {1, 1, -1}, {1, 1, 1}, {-1, 1, 1}};
  const Scene under = over_floor(files, {{roof}});
  const Looking look(under, {.lines = 4096});
  RunningMean cosine, plain;
  for (int k = 0; k < 16; ++k) {
    cosine.add(look.light.ambient_occlusion(at, at.up, (k + 0.37) / 16));
    plain.add(look.light.openness(at, (k + 0.37) / 16));
  }
  const double hidden = solid_angle(at.p, {corners[0], corners[1], corners[2]}) +
                        solid_angle(at.p, {corners[0], corners[2], corners[3]});
  // What 4096 lines leave is far less than this; a mistake is far more.
  EXPECT_NEAR(cosine.mean(), 1 - form_factor(at.p, at.up, corners), 1e-7);
  EXPECT_NEAR(plain.mean(), 1 - hidden, 1e-7);

  // A box without a lid: the floor inside sees the sky through it alone.
  Mesh walls = cube_mesh();
  std::vector<FaceIndices> faces(walls.faces);
  std::erase_if(faces, [&](const FaceIndices& face) {
    double lowest = 1, highest = -1;
    for (const uint32_t v : face) {
      lowest = std::fmin(lowest, walls.positions[v].y);
      highest = std::fmax(highest, walls.positions[v].y);
    }
    return lowest == highest;
  });
  ASSERT_EQ(faces.size(), 8u);
  walls.faces = faces;
  const Scene box = over_floor(files, {{walls, 1, {0, 1, 0}}});
  const Looking in_box(box, {.lines = 4096});
  const std::vector<Vec3d> lid = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}};
  EXPECT_NEAR(occlusion(in_box.light, at, 8), form_factor(at.p, at.up, lid), 1e-7);

  // Inside a closed mesh it is black, whichever way that is turned.
  for (const bool turned : {false, true}) {
    const Mesh ball = turned ? reversed(icosphere_mesh(2)) : icosphere_mesh(2);
    const Scene closed = over_floor(files, {{ball, 2, {0, 0, 0}}});
    const Looking inside(closed);
    EXPECT_EQ(inside.light.openness(at, 0.4), 0);
    EXPECT_EQ(inside.light.ambient_occlusion(at, at.up, 0.4), 0);
  }
}

// A sphere of radius R at height h fills R^2 / h^2 of the cosine-weighted sky below its center; a
// mesh inside of it less, by its faces' arrows.
TEST(LineLight, SphereOverPlane) {
  const TempFiles files;
  const Scene scene = over_floor(files, {{icosphere_mesh(5), 0.8, {0.3, 1.6, 0.2}}});
  const Looking look(scene, {.lines = 64});
  const double covered = 1 - occlusion(look.light, on_floor(scene, 0.3, 0.2), 4);
  EXPECT_LT(covered, 0.25);
  EXPECT_GT(covered, 0.25 * (1 - 2e-3));
}

// The error of unbiased sums: their mean over offsets is the limit, and they fall as lines^-1.5.
TEST(LineLight, ConvergesAndIsUnbiased) {
  const TempFiles files;
  const Scene scene = over_floor(files, {{torus_mesh(40, 20), 0.9, {0.2, 1.3, -0.1}}});
  const ContourPoint at = on_floor(scene, 0.35, -0.15);
  const Looking fine(scene, {.lines = 1 << 14});
  const double truth = occlusion(fine.light, at, 4);
  double before = 0;
  for (const int lines : {16, 64, 256}) {
    const Looking look(scene, {.lines = lines});
    RunningMean mean;
    double squares = 0;
    for (uint64_t k = 0; k < 400; ++k) {
      Rng rng(3, k, lines);
      const double value = look.light.ambient_occlusion(at, at.up, rng.uniform());
      mean.add(value);
      squares += (value - truth) * (value - truth);
    }
    EXPECT_LT(std::fabs(mean.z_score(truth)), 4) << lines;
    const double error = std::sqrt(squares / 400);
    fmt::print("{} lines: error {:.2g} of {:.4f}\n", lines, error, truth);
    if (before > 0) {
      EXPECT_LT(error, before / 3);
    }
    before = error;
  }
  const Looking careful(scene, {.lines = 16, .tolerance = 1e-4});
  RunningMean mean;
  double squares = 0;
  for (uint64_t k = 0; k < 100; ++k) {
    Rng rng(5, k, 0);
    squares += std::pow(careful.light.ambient_occlusion(at, at.up, rng.uniform()) / truth - 1, 2);
  }
  EXPECT_LT(std::sqrt(squares / 100), 2e-4);
  EXPECT_EQ(careful.light.missed(), 0);
  // A single line and the next both miss what a tenth of them meet, and agree.
  const Scene slim = over_floor(files, {{cube_mesh(), 0.3, {0.9, 1, 0}}});
  const Looking slim_fine(slim, {.lines = 1 << 12});
  const double slim_truth = occlusion(slim_fine.light, at, 4);
  for (const int lines : {1, 8}) {
    const Looking few(slim, {.lines = lines, .tolerance = 1e-3});
    double worst = 0;
    for (int k = 0; k < 100; ++k) {
      const double value = few.light.ambient_occlusion(at, at.up, (k + 0.5) / 100);
      worst = std::max(worst, std::fabs(value / slim_truth - 1));
    }
    fmt::print("from {} lines to 1e-3: worst {:.2g}\n", lines, worst);
    EXPECT_LT(worst, 0.01) << lines;
  }
  const Looking hopeless(scene, {.lines = 16, .tolerance = 1e-15});
  hopeless.light.ambient_occlusion(at, at.up, 0.3);
  EXPECT_EQ(hopeless.light.missed(), 1);
  RenderOptions options;
  options.what = RenderWhat::kAmbientOcclusion;
  options.tolerance = 0.01;
  EXPECT_TRUE(run(scene, "lines", 1, options).warnings.empty());
}

// The file's normals may turn past the face: what lies below it is no part of their sky.
TEST(LineLight, NormalsTurnedPastTheFace) {
  const TempFiles files;
  const double turned = 100 * kPi / 180;
  const std::string file =
      files.write("turned.obj", fmt::format("v -4 0 -4\nv 4 0 -4\nv 4 0 4\nv -4 0 4\nvn 0 {} {}\n"
                                            "f 1//1 3//1 2//1\nf 1//1 4//1 3//1\n",
                                            std::cos(turned), std::sin(turned)));
  const std::string ground =
      obj_shape("ground", file, false, 1, {0, 0.1, 0}, diffuse("clay", "0.5, 0.5, 0.5"));
  RenderOptions options;
  options.what = RenderWhat::kAmbientOcclusion;
  const RenderResult open = run(over_floor(files, {}, false, ground), "lines", 1, options);
  const size_t middle = (8 * 16 + 8) * 3;
  EXPECT_NEAR(open.radiance.mean(middle), (1 + std::cos(turned)) / 2, 1e-4);
  const Scene scene = over_floor(files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}}, false, ground);
  expect_alike(run(scene, "lines", 16, options), run(scene, "rays", 128, options), "turned");
}

// Point by point against what is exact (closed_light.h).
void expect_closed_form(const Scene& scene) {
  const Looking look(scene, {.lines = 8192}, true);
  const ClosedLight closed(scene, 1);
  const CameraView<double> camera(scene.camera);
  double worst = 0, sum = 0, apart = 0;
  for (int i = 0; i < 24 * 24; ++i) {
    const auto ray = camera.ray((i % 24 + 0.41) * 16 / 24, (i / 24 + 0.37) * 16 / 24);
    Hit hit;
    if (!look.tracer->closest(camera_ray(scene, ray), hit)) continue;
    const auto surface =
        surface_on_ray<double>(scene, hit.face, Vec3d(ray.origin), Vec3d(ray.direction));
    const Scattering<double> scattering(surface, -Vec3d(ray.direction), scene.shading);
    if (scattering.black()) continue;
    const double exact = closed.scattered(*look.tracer, surface, scattering, nullptr).g;
    const double found = look.light.emitters(surface, scattering, 0.3).g;
    worst = std::max(worst, std::fabs(found - exact));
    apart += std::fabs(found - exact), sum += exact;
  }
  fmt::print("apart {:.2g}, worst {:.2g} of {:.3g}\n", apart / sum, worst, sum / 576);
  EXPECT_GT(sum, 0);
  // What 2048 lines leave.
  EXPECT_LT(apart, 2e-5 * sum);
  EXPECT_LT(worst, 1e-3 * sum / 576);
}

// Through lamps, too.
TEST(LineLight, LampsAgreeWithTheClosedForm) {
  const TempFiles files;
  const std::string lamps =
      square("lamp", 0.6, 90, {0.4, 1.9, 0.3}, area_light("glow", "9, 8, 7")) +
      square("side", 0.5, 20, {-0.6, 1.2, -2}, area_light("low", "3, 4, 5"));
  for (const bool smooth : {false, true}) {
    expect_closed_form(over_floor(
        files, {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}}, {cube_mesh(), 0.3, {-0.9, 0.3, 0.6}}},
        smooth, lamps));
  }
}

// A finely cut rectangle is a rectangle, and does not shine behind itself.
TEST(LineLight, LampsOfManyFacesHaveOneFront) {
  const TempFiles files;
  Mesh down = grid_mesh(4);
  for (Vec3f& x : down.positions) x = {x.x, 0, x.y};
  for (const bool turned : {false, true}) {
    const std::string file = write_mesh(files, "grid.obj", turned ? reversed(down) : down);
    expect_closed_form(over_floor(
        files, {{cube_mesh(), 0.3, {-0.9, 0.3, 0.6}}, {torus_mesh(8, 6), 0.3, {0.3, 1.7, -1}}},
        false,
        square("wall", 3, 0, {0, 1, -2}, diffuse("plaster", "0.5, 0.5, 0.5")) +
            obj_shape("lamp", file, true, 0.7, {0.2, 1.2, -0.4}, area_light("glow", "9, 8, 7"))));
  }
}

// Half of a lamp of 1e-7 rad is hidden: lines end where it does.
TEST(LineLight, LampsOfNoExtent) {
  const TempFiles files;
  const double size = 5e-7, edge = 1e-7;
  Mesh screen;
  screen.positions = {{-1, 0, -1}, {1e-7f, 0, -1}, {1e-7f, 0, 1}, {-1, 0, 1}};
  const Mesh half = make_mesh(screen.positions, {{0, 1, 2}, {0, 2, 3}});
  const Scene scene =
      over_floor(files, {{half, 1, {0, 5, 0}}}, false,
                 square("lamp", size, 90, {0, 10, 0}, area_light("glow", "9, 8, 7")));
  const ContourPoint at = on_floor(scene, 0, 0);
  const auto surface = surface_on_ray<double>(scene, at.face, Vec3d{0, 1, 0}, Vec3d{0, -1, 0});
  const Scattering<double> scattering(surface, {0, 1, 0}, scene.shading);
  const Looking look(scene, {.lines = 1024}, true);
  double sum = 0;
  for (int k = 0; k < 16; ++k) {
    sum += look.light.emitters(surface, scattering, (k + 0.5) / 16).g / 16;
  }
  // What is seen past the screen, at twice its distance.
  const double seen = (size - 2 * edge) * 2 * size / 100;
  EXPECT_NEAR(sum / (0.7 / kPi * 8 * seen), 1, 1e-4);
}

// Interpolated normals under a map, against a sum over the whole sphere, of which the point's own
// face hides a part: the point lies above it (surface_point.h).
TEST(LineLight, MapsOverTurnedNormals) {
  const TempFiles files;
  const std::string file =
      files.write("tilted.obj",
                  "v -4 -1.2 -4\nv 4 1.2 -4\nv 4 1.2 4\nv -4 -1.2 4\nvn 0 1 0.1\n"
                  "f 1//1 3//1 2//1\nf 1//1 4//1 3//1\n");
  const Scene scene =
      over_floor(files, {}, false,
                 obj_shape("tilted", file, false, 1, {0, 3, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
                     make_sky(files, "map"));
  const Vec3d down{0, -1, 0};
  const auto surface =
      surface_on_ray<double>(scene, {ShapeId(1), FaceId(0)}, Vec3d{0.1, 6, -0.2}, down);
  const Scattering<double> scattering(surface, -down, scene.shading);
  ASSERT_TRUE(surface.lifted);
  const Looking look(scene, {.lines = 512}, true);
  double found = 0;
  for (int k = 0; k < 64; ++k) {
    found += look.light.environment(surface, scattering, (k + 0.4) / 64).g / 64;
  }
  constexpr int kRows = 700, kColumns = 1400;
  double sum = 0;
  for (int j = 0; j < kRows; ++j) {
    const double theta = kPi * (j + 0.5) / kRows, c = std::cos(theta), s = std::sin(theta);
    for (int i = 0; i < kColumns; ++i) {
      const double phi = 2 * kPi * (i + 0.5) / kColumns;
      const Vec3d d{s * std::cos(phi), c, s * std::sin(phi)};
      const double f = scattering.eval(d).g;
      const bool open = f > 0 && !look.tracer->occluded(Ray{surface.p, d});
      if (open) sum += f * scene.environment->radiance(d).g * s;
    }
  }
  sum *= 2 * kPi * kPi / kRows / kColumns;
  fmt::print("map over turned normals: {:.8g} and {:.8g}\n", found, sum);
  // The sum over the sphere is right to a step's width along the face's outline, of which little of
  // the light comes.
  EXPECT_NEAR(found / sum, 1, 1e-3);
}

// Faces behind a lamp, in its plane and through it.
TEST(LineLight, LampsEndWhatIsBeforeThem) {
  const TempFiles files;
  const std::string lamp = square("lamp", 0.8, 90, {0, 2, 0}, area_light("glow", "5, 5, 5"));
  for (const auto& [name, bodies] : std::vector<std::pair<std::string, std::vector<Body>>>{
           {"behind", {{cube_mesh(), 0.5, {0.2, 2.9, 0}}}},
           {"housing", {{cube_mesh(), 0.8, {0, 2.8, 0}}}},
           {"through", {{icosphere_mesh(2), 0.5, {0.3, 2.1, 0.2}}}},
           {"beside", {{cube_mesh(), 0.6, {1.2, 2, 0.1}}}}}) {
    const Scene scene = over_floor(files, bodies, false, lamp);
    expect_alike(run(scene, "lines", 16), run(scene, "path", 1024), name);
  }
}

TEST(LineLight, ScaleAndPlaceDoNotMatter) {
  const TempFiles files;
  const std::vector<Body> bodies = {{torus_mesh(16, 8), 0.8, {0.25, 1.125, 0}}};
  RenderOptions options;
  options.what = RenderWhat::kAmbientOcclusion;
  const RenderResult plain = run(over_floor(files, bodies), "lines", 2, options);
  for (const auto& [unit, shift] :
       std::vector<std::pair<double, Vec3d>>{{1024, {}}, {1.0 / 1024, {}}, {1, {16, -32, 64}}}) {
    const RenderResult moved =
        run(over_floor(files, bodies, false, "", unit, shift), "lines", 2, options);
    for (size_t i = 0; i < plain.radiance.size(); ++i) {
      // Floats of the moved mesh are rounded, and move shadows' edges by that.
      ASSERT_NEAR(moved.radiance.mean(i), plain.radiance.mean(i), 2e-3) << unit;
    }
  }
}

}  // namespace
}  // namespace limn
