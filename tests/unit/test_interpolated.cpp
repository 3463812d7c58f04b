// The method `interpolated`: outlines of the sky and their light against closed forms and lines,
// what interpolation keeps, correspondence, Delaunay triangles, images, refusals.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "integrators/contours/line_light.h"
#include "integrators/interpolation/radiance_tables.h"
#include "integrators/interpolation/sky_mesh.h"
#include "integrators/interpolation/spherical_delaunay.h"
#include "limn/core/environment.h"
#include "limn/core/error.h"
#include "limn/core/rng.h"
#include "limn/integrators/methods.h"
#include "support/over_floor.h"

namespace limn {
namespace {

const std::string kSky = constant_light("sky", "1, 1, 1");

struct Looking {
  explicit Looking(const Scene& s, int lines = 4096)
      : tracer(make_embree_tracer(s, 1)),
        contours(s, *tracer, 1),
        light(s, *tracer, 1, {.lines = lines}, s.environment != nullptr) {}
  std::unique_ptr<RayTracer> tracer;
  Contours contours;
  LineLight light;
};

DirectionLoops view(const SkyPolygons& sky, const Vec3d& p) {
  DirectionLoops loops;
  view_of(sky, p, loops);
  return loops;
}

// A point of the floor, which is the scene's first shape.
ContourPoint on_floor(double x, double z) {
  return {{x, 0, z}, {0, 1, 0}, {ShapeId(0), FaceId(x > z)}};
}
double open_share(const Looking& look, const ContourPoint& at) {
  const SkyPolygons sky = find_sky_polygons(look.contours, at);
  EXPECT_EQ(sky.contradictions, 0) << at.p.x << " " << at.p.z;
  return dot(at.up, mean_direction(view(sky, at.p))) / kPi;
}

// Lambert's formula: the integral of w.y over a polygon seen from the origin, over pi.
double form_factor(const std::vector<Vec3d>& corners) {
  DirectionLoops loops;
  for (const Vec3d& x : corners) loops.directions.push_back(normalize(x));
  loops.close();
  return std::fabs(mean_direction(loops).y) / kPi;
}

TEST(Interpolated, OutlinesHaveClosedForms) {
  const TempFiles files;
  const Scene open = over_floor(files, {}, false, kSky);
  EXPECT_NEAR(open_share(Looking(open), on_floor(0.3, 0.1)), 1, 1e-12);
  // Half of the sky behind a wall without end, to what is left beside and above it.
  const std::vector<Vec3d> far = {{-4e3, 0, -1}, {4e3, 0, -1}, {4e3, 4e3, -1}, {-4e3, 4e3, -1}};
  std::vector<Vec3f> corners;
  for (const Vec3d& x : far) corners.push_back(cast<float>(x));
  const Mesh wall = make_mesh(std::move(corners), {{0, 1, 2}, {0, 2, 3}});
  const Scene half = over_floor(files, {{wall}}, false, kSky);
  const double share = open_share(Looking(half), on_floor(0, 0));
  EXPECT_NEAR(share, 1 - form_factor(far), 1e-9);
  EXPECT_NEAR(share, 0.5, 1e-3);
  const Mesh triangle = make_mesh({{-1, 1, -1}, {1.5, 1.25, -1}, {0.25, 0.75, 1}}, {{0, 1, 2}});
  const Scene over = over_floor(files, {{triangle}}, false, kSky);
  std::vector<Vec3d> seen;
  for (const Vec3f& x : triangle.positions) seen.push_back(cast<double>(x));
  EXPECT_NEAR(open_share(Looking(over), on_floor(0, 0)), 1 - form_factor(seen), 1e-9);
}

// Bodies that hide parts of each other, one of them standing on the floor.
Scene bodies(const TempFiles& files, const std::string& lights, bool smooth = false) {
  return over_floor(files,
                    {{torus_mesh(16, 8), 0.8, {0.2, 1.1, 0}},
                     {icosphere_mesh(2), 0.5, {-0.9, 0.6, 0.6}},
                     {cube_mesh(), 0.4, {1.2, 0.4, -0.8}}},
                    smooth, lights);
}

TEST(Interpolated, OutlinesAgreeWithLines) {
  const TempFiles files;
  for (const bool smooth : {false, true}) {
    const Scene scene = bodies(files, kSky, smooth);
    const Looking look(scene);
    Rng rng(4, 2, 1);
    double largest = 0;
    size_t loops = 0, corners = 0;
    for (int i = 0; i < 100; ++i) {
      const double x = 4 * rng.uniform() - 2, z = 4 * rng.uniform() - 2;
      const ContourPoint at = on_floor(x, z);
      const double share = open_share(look, at);
      const double lines = look.light.ambient_occlusion(at, at.up, rng.uniform());
      largest = std::max(largest, std::fabs(share - lines));
      const SkyPolygons sky = find_sky_polygons(look.contours, at);
      loops += sky.loops(), corners += sky.corners.size();
    }
    fmt::print("largest difference {:.2g}, {} loops and {} corners of 100 points\n", largest, loops,
               corners);
    // 4096 lines: their error falls as n^-1.5.
    EXPECT_LT(largest, 2e-4);
  }
}

std::vector<SeenSide> floor_sides() {
  return {{{ShapeId(0), FaceId(0)}, true}, {{ShapeId(0), FaceId(1)}, true}};
}

// At vertices the outline is exact; between them every corner is in a triple, and triples run
// around their loops in order.
TEST(Interpolated, IsExactAtVerticesAndTakesEveryCorner) {
  const TempFiles files;
  const Scene scene = bodies(files, kSky);
  const Looking look(scene);
  for (const bool single : {true, false}) {
    SkyMeshOptions options;
    options.triples.single_loops = single;
    const SkyMesh mesh(scene, look.contours, floor_sides(), options);
    ASSERT_GT(mesh.patches().size(), 100u);
    size_t corners = 0, triples = 0, relaxed = 0;
    for (uint32_t i = 0; i < mesh.patches().size(); ++i) {
      const SkyPatch& patch = mesh.patches()[i];
      std::set<uint32_t> met;
      for (const auto& t : mesh.triples()[i].triples) met.insert(t.begin(), t.end());
      size_t all = 0;
      for (int k = 0; k < 3; ++k) {
        const uint32_t v = patch.vertices[k];
        const SkyPolygons& sky = mesh.skies()[v];
        all += sky.corners.size();
        SkyMesh::Spot spot{i, {}};
        spot.weights[k] = 1;
        DirectionLoops loops;
        const Vec3d& p = mesh.vertices()[v].at.p;
        mesh.outline(spot, p, loops);
        const Vec3d kept = mean_direction(loops), exact = mean_direction(view(sky, p));
        EXPECT_LT(length(kept - exact), 1e-9) << i << " " << k;
      }
      EXPECT_EQ(met.size(), all) << i;
      corners += all, triples += mesh.triples()[i].triples.size();
      relaxed += mesh.triples()[i].relaxed;
    }
    fmt::print("{} patches, {} too coarse: {} corners, {} triples, {} of them relaxed\n",
               mesh.patches().size(), mesh.coarse(), corners, triples, relaxed);
  }
}

// Of second order in the size of triangles.
TEST(Interpolated, ErrorFallsWithTheSquareOfTheSize) {
  const TempFiles files;
  const Scene scene = over_floor(files, {{icosphere_mesh(3), 0.5, {0, 2.5, 0}}}, false, kSky);
  const Looking look(scene);
  std::vector<double> errors;
  for (const int halvings : {2, 3, 4}) {
    // Tolerances that cut so often are found by cutting: nothing reaches 1e-12.
    SkyMeshOptions options;
    options.tolerance = 1e-12;
    options.most_halvings = halvings;
    const SkyMesh mesh(scene, look.contours, floor_sides(), options);
    double sum = 0;
    Rng rng(3, 1, 2);
    for (int k = 0; k < 400; ++k) {
      const double x = 3 * rng.uniform() - 1.5, z = 3 * rng.uniform() - 1.5;
      const Scene& s = scene;
      for (const SeenSide& side : floor_sides()) {
        const auto c = face_corners<double>(s.shapes[0].mesh, side.face.face);
        const Vec3d e1 = c[1] - c[0], e2 = c[2] - c[0], n = cross(e1, e2),
                    q = Vec3d{x, 0, z} - c[0];
        const std::array<double, 2> b{dot(cross(q, e2), n) / dot(n, n),
                                      dot(cross(e1, q), n) / dot(n, n)};
        if (b[0] < 0 || b[1] < 0 || b[0] + b[1] > 1) continue;
        DirectionLoops loops;
        mesh.outline(*mesh.find(side, b), {x, 0, z}, loops);
        sum += std::fabs(mean_direction(loops).y / kPi - open_share(look, on_floor(x, z)));
      }
    }
    errors.push_back(sum / 400);
  }
  const double slope = std::log2(errors[0] / errors[2]) / 2;
  fmt::print("errors {}, slope {:.2f}\n", fmt::join(errors, " "), slope);
  EXPECT_NEAR(slope, 2, 0.3);
}

// Every circle through a triangle is empty, and the triangles close up.
TEST(Interpolated, DelaunayCirclesAreEmpty) {
  Rng rng(1, 5, 2);
  for (int n = 4; n < 60; ++n) {
    std::vector<Vec3d> points;
    for (int i = 0; i < n; ++i) {
      // Some sets lie on one circle, some nearly in one place.
      const double a = rng.uniform(), b = rng.uniform();
      const double z = n % 3 == 0 ? 0.5 : n % 3 == 1 ? 1 - 1e-4 * a : 2 * a - 1;
      const double r = std::sqrt(1 - z * z);
      points.push_back({r * std::cos(2 * kPi * b), r * std::sin(2 * kPi * b), z});
    }
    const auto facets = spherical_delaunay(points);
    EXPECT_EQ(facets.size(), 2u * n - 4);
    for (const auto& f : facets) {
      const Vec3d normal = cross(points[f[1]] - points[f[0]], points[f[2]] - points[f[0]]);
      const double size = length(normal);
      for (const Vec3d& x : points) EXPECT_LT(dot(normal, x - points[f[0]]), 1e-6 * size + 1e-15);
    }
  }
}

RenderOptions with(const std::string& method) {
  RenderOptions options;
  options.method = Method(method);
  return options;
}
Image image_of(const Scene& scene, const std::string& method, int spp = 16, int threads = 1) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 5;
  settings.threads = threads;
  const RenderResult result = render(scene, settings, with(method));
  EXPECT_EQ(result.non_finite.count, 0u);
  return mean_image(result.radiance, scene.film.crop_width, scene.film.crop_height);
}
double difference(const Image& a, const Image& b) {
  double sum = 0, all = 0;
  for (size_t i = 0; i < a.data.size(); ++i) {
    sum += std::fabs(double{a.data[i]} - b.data[i]), all += b.data[i];
  }
  return sum / all;
}

// Of fewer faces than the bodies above.
Scene ring(const TempFiles& files, const std::string& lights, bool smooth) {
  return over_floor(files, {{torus_mesh(8, 4), 0.8, {0.2, 1.1, 0}}}, smooth, lights);
}

TEST(Interpolated, ImagesAreThoseOfLines) {
  const TempFiles files;
  for (const bool smooth : {false, true}) {
    const Scene scene = ring(files, smooth ? make_sun(files, "sun") : kSky, smooth);
    const Image lines = image_of(scene, "lines", 64);
    for (const char* setting :
         {"", ":interpolate=radiance", ":interpolate=distances", ":interpolate=nothing",
          ":interpolate=rays", ":shading=vertex", ":interpolate=radiance:shading=adaptive"}) {
      if (!smooth && *setting != 0) continue;
      const std::string method = std::string("interpolated") + setting;
      const double error = difference(image_of(scene, method), lines);
      fmt::print("{} {}: {:.4f} of the light differs\n", smooth ? "smooth" : "flat", method, error);
      // Of rays the noise of pixels is larger: a sixteenth of it in their sum.
      const std::string name = setting;
      EXPECT_LT(name.ends_with("rays") ? error / 16 : error, 0.03) << method;
    }
  }
}

// Of a white sky nothing scatters more than it sends.
TEST(Interpolated, GlossKeepsEnergy) {
  const TempFiles files;
  const std::string plate = square("plate", 4, -90, {0, 0.01, 0}, conductor("metal", 0.3));
  const Scene open = over_floor(files, {}, false, kSky + plate);
  for (const char* method : {"interpolated", "interpolated:gloss-cap=0.5"}) {
    const Image image = image_of(open, method, 1);
    EXPECT_LT(*std::max_element(image.data.begin(), image.data.end()), 1 + 1e-3) << method;
    EXPECT_GT(image.at(8, 12, 0), 0.3) << method;
  }
}

TEST(Interpolated, ThreadsDoNotMatter) {
  const TempFiles files;
  const Scene scene = ring(files, make_sun(files, "sun"), true);
  const std::string method = "interpolated:tolerance=0.03";
  EXPECT_EQ(image_of(scene, method, 1, 1).data, image_of(scene, method, 1, 3).data);
}

TEST(Interpolated, SaysWhatItDoesNotKnow) {
  const TempFiles files;
  RenderOptions options = with("interpolated");
  const auto refused = [&](const Scene& scene) -> std::string {
    try {
      render(scene, {}, options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(refused(over_floor(files, {})).find("no environment"), std::string::npos);
  const std::string lamp = square("lamp", 0.6, 90, {0.4, 2.9, 0.3}, area_light("glow", "9, 8, 7"));
  EXPECT_NE(refused(over_floor(files, {}, false, kSky + lamp))
                .find("shape \"lamp\": only the environment is interpolated: use lines"),
            std::string::npos);
  const std::string mirror = square("mirror", 1, 0, {0, 1, 0}, conductor("m", 0.1));
  options.method = Method("interpolated:shading=vertex");
  EXPECT_NE(refused(over_floor(files, {}, false, kSky + mirror)).find("gloss is known of outlines"),
            std::string::npos);
  options.method = Method("interpolated:shading=adaptive");
  EXPECT_NE(refused(over_floor(files, {}, false, kSky)).find("wrong with outlines"),
            std::string::npos);
  options.what = RenderWhat::kAmbientOcclusion;
  EXPECT_NE(refused(over_floor(files, {}, false, kSky)).find("knows radiance alone"),
            std::string::npos);
  EXPECT_FALSE(Method("interpolated")->can(Task::kGradient));
  EXPECT_FALSE(Method("interpolated")->can(Task::kBackward));
}

}  // namespace
}  // namespace limn
