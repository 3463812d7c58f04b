// Interpolated normals: rays start above the faces (surface_point.h). Flat faces beside round ones
// are as bright as without normals, and derivatives are complete, also in hollows.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <tuple>

#include "integrators/terms/lane_sinks.h"
#include "limn/core/surface_point.h"
#include "limn/integrators/render.h"
#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// A box of half-width 1 with bevels, as modelling programs write it: every corner once for each of
// its three large faces, with that face's normal. So large faces are flat, bevels round.
std::string bevelled_box(const TempFiles& files) {
  constexpr double kBevel = 0.12;
  std::string text;
  std::string faces;
  const auto index = [](int axis, int sign, int u, int v) {
    return 8 * axis + (sign > 0 ? 4 : 0) + (u > 0 ? 2 : 0) + (v > 0 ? 1 : 0) + 1;
  };
  std::vector<Vec3d> at(1);
  for (int axis = 0; axis < 3; ++axis) {
    for (const int sign : {-1, 1}) {
      for (const int u : {-1, 1}) {
        for (const int v : {-1, 1}) {
          Vec3d x, n;
          x[axis] = n[axis] = sign;
          x[(axis + 1) % 3] = u * (1 - kBevel);
          x[(axis + 2) % 3] = v * (1 - kBevel);
          text += fmt::format("v {} {} {}\nvn {} {} {}\n", x.x, x.y, x.z, n.x, n.y, n.z);
          at.push_back(x);
        }
      }
    }
  }
  const auto add = [&](std::vector<int> corners) {
    const Vec3d a = at[corners[0]], b = at[corners[1]], c = at[corners[2]];
    if (dot(cross(b - a, c - a), a + b + c) < 0) std::reverse(corners.begin(), corners.end());
    for (size_t k = 2; k < corners.size(); ++k) {
      faces +=
          fmt::format("f {0}//{0} {1}//{1} {2}//{2}\n", corners[0], corners[k - 1], corners[k]);
    }
  };
  // The corner of face `axis` where the signs along x, y, z are these.
  const auto corner = [&](int axis, const std::array<int, 3>& s) {
    return index(axis, s[axis], s[(axis + 1) % 3], s[(axis + 2) % 3]);
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const int sign : {-1, 1}) {
      add({index(axis, sign, -1, -1), index(axis, sign, 1, -1), index(axis, sign, 1, 1),
           index(axis, sign, -1, 1)});
      for (const int other : {-1, 1}) {
        const int next = (axis + 1) % 3, along = (axis + 2) % 3;
        std::array<int, 3> low{}, high{};
        low[axis] = high[axis] = sign;
        low[next] = high[next] = other;
        low[along] = -1, high[along] = 1;
        add({corner(axis, low), corner(axis, high), corner(next, high), corner(next, low)});
      }
    }
  }
  for (const int x : {-1, 1})
    for (const int y : {-1, 1})
      for (const int z : {-1, 1}) {
        const std::array<int, 3> s{x, y, z};
        add({corner(0, s), corner(1, s), corner(2, s)});
      }
  return files.write("box.obj", text + faces);
}

// Waves, with normals computed: hills and hollows.
Mesh waves_mesh() {
  Mesh mesh = grid_mesh(6);
  for (Vec3f& x : mesh.positions) {
    x.z = static_cast<float>(0.3 * std::sin(4.0 * x.x + 0.3) * std::cos(4.0 * x.y));
  }
  return mesh;
}

// White light from everywhere on a convex body: what is seen is the reflectance, everywhere.
TEST(LiftedPoints, FlatFacesAreAsBrightAsWithoutNormals) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0.4, 0.5, 6};
  parts.target = {0, 0, 1};
  parts.fov = 8;  // the face z = 1 fills the film
  parts.body =
      obj_shape("box", bevelled_box(files), false, 1, {}, diffuse("red", "0.6, 0.3, 0.1")) +
      constant_light("sky", "1, 1, 1");
  RunSettings settings;
  settings.spp = 64;
  const Moments image = render(make_scene(files, parts), settings).radiance;
  const double reflectance[3] = {0.6, 0.3, 0.1};
  for (size_t i = 0; i < image.size(); ++i) {
    const double error = std::sqrt(image.variance(i));
    EXPECT_NEAR(image.mean(i), reflectance[i % 3], 6 * error + 1e-9) << i;
  }
}

// The same of the whole of a round body: nothing that is convex loses light or hides itself.
TEST(LiftedPoints, ConvexBodiesLoseNoLight) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0.4, 0.5, 6};
  parts.target = {0, 0, 0};
  parts.fov = 14;  // inside of the outline
  parts.body = obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 1, {},
                         diffuse("clay", "0.6, 0.6, 0.6")) +
               constant_light("sky", "1, 1, 1");
  RunSettings settings;
  settings.spp = 256;
  const Moments image = render(make_scene(files, parts), settings).radiance;
  double sum = 0;
  for (size_t i = 0; i < image.size(); ++i)
    sum += image.mean(i) / static_cast<double>(image.size());
  fmt::print("mean {:.6g} of 0.6\n", sum);
  EXPECT_NEAR(sum, 0.6, 0.002);
}

// Lifted points of the two faces at an edge meet, and lie on no face's inner side.
TEST(LiftedPoints, MeetAtEdges) {
  const TempFiles files;
  SceneParts parts;
  parts.body = obj_shape("waves", write_mesh(files, "waves.obj", waves_mesh()), false, 1, {},
                         diffuse("clay", "0.6, 0.6, 0.6"));
  const Scene scene = make_scene(files, parts);
  const Mesh& mesh = scene.shapes[0].mesh;
  int edges = 0;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (uint32_t g = 0; g < f; ++g) {
      std::vector<uint32_t> both;
      for (const uint32_t v : mesh.faces[f])
        if (std::count(mesh.faces[g].begin(), mesh.faces[g].end(), v)) both.push_back(v);
      if (both.size() != 2) continue;
      ++edges;
      const Vec3d a = cast<double>(mesh.positions[both[0]]),
                  b = cast<double>(mesh.positions[both[1]]);
      const Vec3d x = a * 0.3 + b * 0.7, up{0, 0, 1};
      const auto one = surface_on_ray<double>(scene, {ShapeId(0), FaceId(f)}, x + up, -up);
      const auto other = surface_on_ray<double>(scene, {ShapeId(0), FaceId(g)}, x + up, -up);
      EXPECT_NEAR(length(one.p - other.p), 0, 1e-6);
      EXPECT_GE(dot(one.p - x, one.n_g), -1e-7);
    }
  }
  EXPECT_GT(edges, 50);
}

// The rate of a point that a camera at rest sees, and of what it is lifted to, is that of
// surface_on_ray, which carries derivatives itself.
TEST(LiftedPoints, SeenPointsMoveAsSurfacesSay) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0.3, 0.2, 5};
  parts.target = {0, 0, 0};
  parts.body = obj_shape("waves", write_mesh(files, "waves.obj", waves_mesh()), false, 1, {},
                         diffuse("clay", "0.6, 0.6, 0.6"));
  Scene scene = make_scene(files, parts);
  Mesh& mesh = scene.shapes[0].mesh;
  set_test_tangents(mesh);
  update_shading_normals(mesh);
  const Vec3d g = normalize(Vec3d{0.3, -0.5, 0.8});
  Rng rng(31, 0, 0);
  int seen = 0;
  double largest = 0;  // of what a lift adds
  for (uint32_t i = 0; i < 300 * mesh.faces.size(); ++i) {
    const FaceRef face{ShapeId(0), FaceId(i % static_cast<uint32_t>(mesh.faces.size()))};
    FilmPlace at;
    at.x = scene.camera.width * rng.uniform();
    at.y = scene.camera.height * rng.uniform();
    const auto ray = ray_at(CameraView<Dual>(scene.camera), at);
    const auto point = surface_on_ray<Dual>(scene, face, ray.origin, ray.direction);
    const Vec3d origin = value(ray.origin), omega = value(ray.direction);
    const auto corners = face_corners<double>(mesh, face.face);
    const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
    BoundaryForm form;
    form.distance = dot(n, corners[0] - origin) / dot(n, omega);
    form.x = origin + omega * form.distance;
    const auto b = barycentric(corners, form.x);
    if (*std::min_element(b.begin(), b.end()) < 0) continue;  // beside the face
    form.add_seen_point(scene, face, omega, g);
    FilmSample sample{};
    FilmLanes sink(scene, false, nullptr, sample);
    sink.at(at);
    ASSERT_TRUE(sink.takes(form, rng));
    sink.add(grey(1.0));
    const Lanes expected = point.p.x.d * g.x + point.p.y.d * g.y + point.p.z.d * g.z;
    for (int k = 0; k < kLanes; ++k) EXPECT_NEAR(sample.value.g[k], expected[k], 1e-12) << i;
    form.lift.reset();
    sink.takes(form, rng);
    sink.add(grey(1.0));
    for (int k = 0; k < kLanes; ++k)
      largest = std::max(largest, std::fabs(sample.value.g[k] - expected[k]));
    ++seen;
  }
  EXPECT_GT(seen, 20);
  EXPECT_GT(largest, 0.01);
}

// Flat strips with narrow grooves: normals are upright at two corners of a face and lean at the
// third, and rays meet faces at their very sides.
TEST(LiftedPoints, NoPixelIsNegative) {
  const TempFiles files;
  std::string text;
  constexpr int kColumns = 31;
  for (const int z : {1, -1})
    for (int i = 0; i < kColumns; ++i)
      text += fmt::format("v {} {} {}\n", (i - 15) / 15.0, i % 5 == 4 ? -0.03 : 0, z);
  for (int i = 1; i < kColumns; ++i) {
    text += fmt::format("f {} {} {}\nf {} {} {}\n", i, i + 1, i + kColumns + 1, i, i + kColumns + 1,
                        i + kColumns);
  }
  SceneParts parts;
  parts.origin = {0.03, 4, 0.5};
  parts.target = {0, 0, 0};
  parts.fov = 25;
  parts.width = parts.height = 32;
  parts.body = obj_shape("strips", files.write("strips.obj", text), false, 1, {},
                         diffuse("grey", "0.5, 0.5, 0.5")) +
               constant_light("sky", "1, 1, 1");
  RunSettings settings;
  settings.spp = 64;
  const Moments image = render(make_scene(files, parts), settings).radiance;
  for (size_t i = 0; i < image.size(); ++i) EXPECT_GE(image.mean(i), 0) << i;
}

// kind: which body; both over a floor, between sky, lamp and bulb.
Scene round_scene(const TempFiles& files, const std::string& kind, const std::string& lights) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {1.6, 2.4, 4.2};
  parts.target = {0, 0.5, 0};
  const std::string clay = diffuse("clay", "0.7, 0.5, 0.3");
  if (kind == "back") parts.origin = {-0.6, 0.5, -3.4};
  const std::string body =
      kind == "box" ? obj_shape("body", bevelled_box(files), false, 0.6, {0, 0.8, 0}, clay)
      : kind == "ball"
          ? obj_shape("body", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.8,
                      {0, 1, 0}, clay)
          : obj_shape(
                "body",
                write_mesh(
                    files, "waves.obj",
                    transformed(waves_mesh(),
                                {Vec3d{1, 0, 0}, Vec3d{0, 0.6, 0.8}, Vec3d{0, -0.8, 0.6}}, 1, {})),
                false, 0.9, {0, 0.9, 0}, "<bsdf type=\"twosided\">" + clay + "</bsdf>");
  parts.body =
      square("floor", 2.5, -90, {0, 0, 0}, diffuse("grey", "0.5, 0.5, 0.5")) + body + lights;
  return make_scene(files, parts);
}

const char* kSun =
    R"(<emitter type="directional" id="sun"><vector name="direction" value="-0.6, -1, 0.5"/>
       <rgb name="irradiance" value="3,2.8,2.5"/></emitter>)";
const char* kBulb =
    R"(<emitter type="point" id="bulb"><point name="position" value="1.2,2.6,1.1"/>
       <rgb name="intensity" value="9,8,7"/></emitter>)";

using Case = std::tuple<std::string, std::string, std::string>;
class LiftedDerivatives : public testing::TestWithParam<Case> {};

TEST_P(LiftedDerivatives, AgreeWithDifferences) {
  const auto& [kind, light, parameter] = GetParam();
  const TempFiles files;
  const std::string lights =
      light == "bulb"  ? std::string(kBulb)
      : light == "sun" ? std::string(kSun)
      : light == "sky" ? constant_light("sky", "1, 0.9, 0.8")
                       : square("lamp", 0.5, 90, {0.8, 2.6, 0.6}, area_light("glow", "9, 8, 7"));
  std::string name = parameter;
  const Scene scene = round_scene(files, kind, lights);
  if (name.ends_with(':')) {
    std::string velocities;
    for (const Vec3f& x : scene.shapes[1].mesh.positions) {
      velocities +=
          fmt::format("{} {} {}\n", std::sin(3 * x.y), 0.5 * x.x * x.z, std::cos(2 * x.x));
    }
    name += files.write("velocity.txt", velocities);
  }
  expect_agreement(scene, name, 128);
}

INSTANTIATE_TEST_SUITE_P(
    , LiftedDerivatives,
    testing::Values(
        Case("box", "sky", "body.rotate.y"), Case("box", "lamp", "body.rotate.x"),
        Case("box", "lamp", "body.translate.y"), Case("box", "lamp", "lamp.translate.x"),
        Case("box", "bulb", "body.rotate.y"), Case("box", "bulb", "bulb.translate.x"),
        Case("waves", "sky", "body.rotate.x"), Case("waves", "lamp", "body.rotate.y"),
        Case("waves", "lamp", "body.translate.y"), Case("waves", "lamp", "lamp.translate.x"),
        Case("waves", "sky", "body.vertex_positions:"), Case("waves", "bulb", "body.translate.x"),
        Case("waves", "bulb", "sensor.translate.x"), Case("waves", "bulb", "body.rotate.z"),
        Case("waves", "bulb", "body.vertex_positions:"), Case("waves", "sun", "body.rotate.y"),
        Case("ball", "bulb", "bulb.translate.x"), Case("ball", "bulb", "sensor.translate.x"),
        Case("ball", "bulb", "body.vertex_positions:"), Case("ball", "sun", "body.rotate.x"),
        Case("back", "lamp", "body.rotate.y"), Case("back", "bulb", "bulb.translate.x")),
    [](const auto& of) {
      std::string name =
          std::get<0>(of.param) + "_" + std::get<1>(of.param) + "_" + std::get<2>(of.param);
      for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
      return name;
    });

// Hard shadows that a coarse mesh casts on itself, where light grazes it: to about 0.3 %.
TEST(LiftedPoints, GrazingLightHasAllItsShadows) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {1.5, -2, 3.5};
  parts.target = {0, 0, 0};
  parts.fov = 30;
  parts.body = obj_shape("body", write_mesh(files, "waves.obj", waves_mesh()), false, 1, {},
                         diffuse("clay", "0.5, 0.5, 0.5")) +
               R"(<emitter type="point" id="bulb"><point name="position" value="2.5,0.4,0.8"/>
                  <rgb name="intensity" value="14,14,14"/></emitter>)";
  const Scene scene = make_scene(files, parts);
  RunSettings settings;
  settings.spp = 16384;
  const Moments differences =
      finite_differences(scene, "bulb.translate.z", 0.03, 8, settings).extrapolated.image_sum;
  settings.spp = 1024;
  settings.seed = 2;
  GradientOptions options;
  options.parameters = {"bulb.translate.z"};
  const Moments sum = gradient(scene, options, settings).parameters[0].image_sum;
  const double error = std::sqrt(differences.variance(0) + sum.variance(0));
  EXPECT_LT(error, 0.003 * sum.mean(0));
  EXPECT_NEAR(sum.mean(0), differences.mean(0), 3.5 * error);
}

// Light in closed form, and lines, from where paths start, too: the sums of images agree.
TEST(LiftedPoints, MethodsShareAnImage) {
  const TempFiles files;
  for (const std::string kind : {"waves", "back", "ball"}) {
    for (const std::string method : {"analytic", "lines"}) {
      const bool lamp = method == "analytic";
      Scene scene =
          round_scene(files, kind,
                      lamp ? square("lamp", 0.5, 90, {0.8, 2.6, 0.6}, area_light("glow", "9, 8, 7"))
                           : constant_light("sky", "1, 0.9, 0.8"));
      scene.max_depth = 2;
      const auto sum = [&](const std::string& by, int spp) {
        RunSettings settings;
        settings.spp = spp;
        RenderOptions options;
        options.method = by;
        const Moments image = render(scene, settings, options).radiance;
        double total = 0, variance = 0;
        for (size_t i = 0; i < image.size(); ++i) {
          total += image.mean(i);
          variance += image.variance(i);
        }
        return std::pair(total, 3 * variance);  // channels are alike
      };
      const auto [paths, of_paths] = sum("path", 256);
      const auto [other, of_other] = sum(method, 16);
      const double z = (other - paths) / std::sqrt(of_paths + of_other);
      fmt::print("{:6} {:12} {:.6g}, by paths {:.6g}, z {:.2f}\n", kind, method, other, paths, z);
      EXPECT_LT(std::fabs(z), 4.5) << kind << ", " << method;
    }
  }
}

}  // namespace
}  // namespace limn
