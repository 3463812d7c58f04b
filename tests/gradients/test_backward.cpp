// Reverse mode against forward mode, and what must hold of any gradient.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/gradient.h"
#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// No two tilts of a shaken mesh tie, and no normal lies along a plane of the axes to rounding,
// where a frame would jump (vec.h).
Mesh shaken(Mesh mesh) {
  weld_positions(mesh);
  Rng rng(1, 2, 3);
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    Vec3d x = cast<double>(mesh.positions[v]);
    for (int k = 0; k < 3; ++k) x[k] += 0.05 * (rng.uniform() - 0.5);
    mesh.positions[v] = mesh.weld[v] < v ? mesh.positions[mesh.weld[v]] : cast<float>(x);
  }
  return mesh;
}

// A torus over a rough mirror, a lamp, a sky.
Scene mirror_scene(const TempFiles& files, bool face_normals, int depth = 3) {
  SceneParts parts;
  parts.max_depth = depth;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0.4, 0};
  parts.film = R"(<rfilter type="tent"/>)";
  const std::string mesh = write_mesh(files, "body.obj", shaken(seam_split(torus_mesh(9, 5))));
  parts.body =
      square("mirror", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.2)) +
      obj_shape("body", mesh, face_normals, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
      square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6")) +
      make_sky(files, "sky");
  return make_scene(files, parts);
}

// A body close over a floor, before a lamp of that size and of one power.
Scene penumbra_scene(const TempFiles& files, double size) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 3, 4};
  const std::string mesh = write_mesh(files, "body.obj", shaken(torus_mesh(8, 5)));
  const std::string radiance = fmt::format("{}", 3.6 / (size * size));
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
               obj_shape("body", mesh, true, 0.6, {0, 0.3, 0}, diffuse("clay", ".6, .5, .4")) +
               square("lamp", size, 90, {0.5, 3.5, 1}, area_light("glow", radiance));
  return make_scene(files, parts);
}

// Lights without extent, over a floor.
Scene shadow_scene(const TempFiles& files, bool face_normals) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 3, 4};
  const std::string mesh = write_mesh(files, "body.obj", shaken(torus_mesh(8, 5)));
  parts.body =
      square("floor", 3, -90, {0, 0, 0}, conductor("gloss", 0.4)) +
      obj_shape("body", mesh, face_normals, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
      R"(<emitter type="point" id="bulb"><point name="position" value="1, 4, 1"/>
                    <rgb name="intensity" value="20, 18, 16"/></emitter>
                  <emitter type="spot" id="spot"><float name="cutoff_angle" value="40"/>
                    <transform name="to_world"><lookat origin="-2, 3, 1" target="0, 0, 0" up="0, 0, 1"/>
                    </transform></emitter>
                  <emitter type="directional" id="sun"><vector name="direction" value="1, -2, -1"/>
                  </emitter>)";
  return make_scene(files, parts);
}

// Two bodies that pass through each other and a floor that they stand on, cut by the near plane.
Scene crossing_scene(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 1.2, 3};
  const std::string cube = write_mesh(files, "cube.obj", shaken(cube_mesh()));
  const std::string ball = write_mesh(files, "ball.obj", shaken(icosphere_mesh(1)));
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
               obj_shape("cube", cube, true, 0.5, {0, 0.5, 0}, diffuse("red", ".8, .2, .1")) +
               obj_shape("ball", ball, true, 0.6, {0.4, 0.8, 0.2}, diffuse("blue", ".1, .2, .8")) +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6")) +
               constant_light("sky", ".3, .3, .3");
  Scene scene = make_scene(files, parts);
  scene.camera.near_clip = 2.3;
  return scene;
}

// What `analytic` takes: bodies of both kinds of normals before lamps, one of which goes through
// its lamp, and one that the camera sees at grazing angles.
Scene lamps_scene(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0.5, 0};
  const std::string ring = write_mesh(files, "ring.obj", shaken(torus_mesh(9, 5)));
  const std::string ball = write_mesh(files, "ball.obj", shaken(icosphere_mesh(1)));
  const std::string spear = write_mesh(files, "spear.obj", shaken(cube_mesh()));
  parts.body =
      square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
      obj_shape("ring", ring, true, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
      obj_shape("ball", ball, false, 0.5, {-0.8, 0.4, 0.6}, diffuse("blue", ".1, .2, .8")) +
      obj_shape("spear", spear, true, 0.2, {0.6, 3.5, 1}, diffuse("red", ".8, .2, .1")) +
      square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6"));
  return make_scene(files, parts);
}

// Checkerboards in places of a colour and of two numbers.
Scene checkered_scene(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 2.5, 4};
  parts.body = square("floor", 3, -90, {0, 0, 0},
                      R"(<bsdf type="principled" id="paint">
                           <texture type="checkerboard" name="base_color">
                             <rgb name="color0" value=".8, .5, .3"/></texture>
                           <texture type="checkerboard" name="roughness">
                             <rgb name="color0" value=".3, .5, .4"/>
                             <float name="color1" value=".7"/></texture>
                           <texture type="checkerboard" name="metallic">
                             <float name="color0" value=".9"/></texture></bsdf>)") +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 5, 4")) +
               constant_light("sky", ".3, .3, .3");
  return make_scene(files, parts);
}

Image random_adjoint(const Scene& scene, uint64_t seed) {
  Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i) {
    adjoint.data[i] = static_cast<float>(Rng(seed, i, 0).uniform() - 0.5);
  }
  return adjoint;
}

// Of the name of a part, 0 to 2; 3 of other names.
size_t channel_of(const std::string& name) {
  const std::string end = name.substr(name.size() - 2);
  return end == ".r" ? 0 : end == ".g" ? 1 : end == ".b" ? 2 : 3;
}

// What a parameter's derivative is summed from, in magnitude.
double magnitude(const Scene& scene, const BackwardResult& result, const std::string& name) {
  const Parameter parameter = find_parameter(scene, name);
  double sum = 0;
  // Those of a channel are smaller than those of its colour.
  const bool channel = channel_of(name) < 3 && parameter.texel_velocities(scene).data.empty();
  const std::string whole = channel ? name.substr(0, name.size() - 2) : name;
  const Moments& m = result.of(whole).moments;
  for (size_t i = 0; i < m.size(); ++i) sum += std::fabs(m.mean(i));
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const std::vector<Vec3d> velocity = parameter.velocities(scene, ShapeId(s));
    if (velocity.empty()) continue;
    const Moments& g = result.of(scene.shapes[s].id + ".vertex_positions").moments;
    for (size_t v = 0; v < velocity.size(); ++v) {
      sum +=
          length(velocity[v]) * length(Vec3d{g.mean(3 * v), g.mean(3 * v + 1), g.mean(3 * v + 2)});
    }
  }
  return sum;
}

// Some texels by their names in forward mode, and all of them along a random field, against those
// of reverse mode.
std::vector<std::string> texel_names(const Scene& scene, const Image& field,
                                     const TempFiles& files) {
  if (!scene.environment || scene.environment->map().width == 0) return {};
  const std::string file = files.path("texels.exr"), name = scene.environment_id + ".data";
  write_exr(file, field, false, {});
  std::vector<std::string> names{name + ":" + file};
  for (const char* part : {".0.0.r", ".2.5.g", ".2.4.b", ".3.15.r", ".3.9.g", ".4.0.b"}) {
    names.push_back(name + part);
  }
  return names;
}

Image random_field(const Scene& scene) {
  const TexelMap::Map map = scene.environment ? scene.environment->map() : TexelMap::Map{};
  Image field(map.width, map.height, 3);
  for (size_t i = 0; i < field.data.size(); ++i) {
    field.data[i] = static_cast<float>(Rng(8, i, 0).uniform() - 0.5);
  }
  return field;
}

// With the same samples interior terms are equal, to rounding; over faces all there is.
void expect_same_interior(const Scene& scene, const std::string& sampler = "forest",
                          FilmPoints points = FilmPoints::kRandom) {
  BackwardOptions options;
  options.method = sampler;
  options.points = points;
  options.terms = {points == FilmPoints::kFaces ? "faces" : "interior"};
  options.uniform_pixels = true;
  for (const Parameter& p : list_parameters(scene)) options.parameters.push_back(p.name);
  const TempFiles files;
  const Image field = random_field(scene);
  const std::vector<std::string> of_texels = texel_names(scene, field, files);
  for (const std::string& name : of_texels) options.parameters.push_back(name);
  for (const Shape& shape : scene.shapes) {
    if (!shape.id.empty()) options.parameters.push_back(shape.id + ".displacement.1");
  }
  const Image adjoint = random_adjoint(scene, 1);
  RunSettings settings;
  settings.spp = 8;
  settings.seed = 5;
  const BackwardResult reverse = backward(scene, adjoint, options, settings);
  // A vertex and its copies, by name and in the array.
  for (const Shape& shape : scene.shapes) {
    if (shape.id.empty()) continue;
    const Moments& all = reverse.of(shape.id + ".displacement").moments;
    const SharedVector<uint32_t>& weld = shape.mesh.weld;
    double sum = 0, magnitude = 0;
    for (size_t v = 0; v < weld.size(); ++v) {
      if (weld[v] == weld[1]) sum += all.mean(v);
      if (weld[v] == weld[1]) magnitude += std::fabs(all.mean(v));
    }
    const double one = reverse.of(shape.id + ".displacement.1").moments.mean(0);
    EXPECT_NEAR(one, sum, 1e-13 * magnitude) << shape.id;
  }
  GradientOptions forward_options;
  for (const ParameterAdjoint& p : reverse.parameters) {
    const Parameter parameter = find_parameter_or_array(scene, p.name);
    // Displacements of one vertex are held against the array above.
    if (parameter.size > 1 || p.name.find(".displacement.") != p.name.npos) continue;
    const bool colour = parameter.colour;
    for (const char* part : {".r", ".g", ".b"}) {
      if (colour) forward_options.parameters.push_back(p.name + part);
    }
    forward_options.parameters.push_back(p.name);
  }
  forward_options.terms = options.terms;
  forward_options.method = sampler;
  forward_options.points = points;
  const GradientResult forward = gradient(scene, forward_options, settings);
  for (const ParameterGradient& p : forward.parameters) {
    double sum = 0;
    for (size_t k = 0; k < adjoint.data.size(); ++k) sum += adjoint.data[k] * p.total.mean(k);
    const bool texel = std::find(of_texels.begin(), of_texels.end(), p.name) != of_texels.end();
    const size_t channel = channel_of(p.name);
    const bool part = channel < 3 && !texel;
    const Moments& m = reverse.of(part ? p.name.substr(0, p.name.size() - 2) : p.name).moments;
    double found = m.mean(part ? channel : 0);
    if (!part && m.size() == 3) found += m.mean(1) + m.mean(2);  // along grey
    EXPECT_NEAR(found, sum, 1e-12 * magnitude(scene, reverse, p.name)) << p.name;
    if (!texel) continue;
    EXPECT_NE(sum, 0) << p.name;
    // The array has the same numbers.
    const Image velocity = find_parameter(scene, p.name).texel_velocities(scene);
    const Moments& all = reverse.of(scene.environment_id + ".data").moments;
    double dotted = 0, size = 0;
    for (size_t i = 0; i < all.size(); ++i) {
      dotted += velocity.data[i] * all.mean(i);
      size += std::fabs(velocity.data[i] * all.mean(i));
    }
    EXPECT_NEAR(dotted, sum, 1e-12 * size) << p.name;
  }
}

TEST(Backward, InteriorIsThatOfForwardMode) {
  const TempFiles files;
  expect_same_interior(mirror_scene(files, true));
  expect_same_interior(mirror_scene(files, false));
  expect_same_interior(shadow_scene(files, true));
  expect_same_interior(crossing_scene(files));
  expect_same_interior(lamps_scene(files), "analytic");
  expect_same_interior(checkered_scene(files));
}

// Faces that go through each other and are cut by a clip plane among them.
TEST(Backward, FacesAreThoseOfForwardMode) {
  const TempFiles files;
  Scene scene = lamps_scene(files);
  expect_same_interior(scene, "analytic", FilmPoints::kFaces);
  scene.camera.near_clip = 4;
  expect_same_interior(scene, "analytic", FilmPoints::kFaces);
}

// A diffuse floor and nothing else under a map: the derivative of its radiance with respect to a
// texel is the integral of that texel's weight times the cosine over pi, whatever the map holds. A
// black one is drawn from evenly, a lower half that is black never.
TEST(Backward, TexelsOverAFloorHaveTheirClosedForm) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 3, 0.5};
  parts.target = {0, 0, 0};
  parts.width = parts.height = 4;
  for (const bool black : {false, true}) {
    Image map(6, 5, 3);
    for (size_t i = 0; i < map.data.size() && !black; ++i) {
      map.data[i] = i < 9 * 6 ? static_cast<float>(0.2 + Rng(2, i, 0).uniform()) : 0;
    }
    const std::string file = files.path(black ? "black.exr" : "map.exr");
    write_exr(file, map, false, {});
    parts.body = square("floor", 50, -90, {0, 0, 0}, diffuse("grey", ".5, .25, 1")) +
                 R"(<emitter type="envmap" id="sky"><string name="filename" value=")" + file +
                 R"("/><float name="scale" value="2"/></emitter>)";
    const Scene scene = make_scene(files, parts);
    Image adjoint(4, 4, 3);
    for (float& a : adjoint.data) a = 1.0f / 16;
    BackwardOptions options;
    options.parameters = {"sky.data", "sky.scale"};
    options.batches = 1024;
    RunSettings settings;
    settings.spp = 1024;
    settings.threads = 2;
    const BackwardResult result = backward(scene, adjoint, options, settings);
    std::vector<double> truth(map.data.size());
    constexpr int kPoints = 400;  // of Gauss' kind would be too much: midpoints, to 1e-5
    for (int i = 0; i < kPoints; ++i) {
      for (int k = 0; k < 4 * kPoints; ++k) {
        const double y = (i + 0.5) / kPoints, r = std::sqrt(1 - y * y);
        const double phi = 2 * kPi * (k + 0.5) / (4 * kPoints);
        const Vec3d d{r * std::cos(phi), y, r * std::sin(phi)};
        for (const auto& [texel, weight] : scene.environment->texel_weights(d)) {
          const double share = weight * y / kPi * 2 * kPi / (4.0 * kPoints * kPoints);
          const double reflectance[3] = {0.5, 0.25, 1};
          for (size_t c = 0; c < 3; ++c) truth[3 * texel + c] += share * reflectance[c];
        }
      }
    }
    const Moments& m = result.parameters[0].moments;
    double along = 0, squares = 0, count = 0;
    for (size_t i = 0; i < truth.size(); ++i) {
      along += m.mean(i) * map.data[i];
      if (truth[i] == 0) {
        EXPECT_EQ(m.mean(i), 0);
        continue;
      }
      const double z = (m.mean(i) - truth[i]) / std::sqrt(m.variance(i));
      EXPECT_LT(std::fabs(z), 5) << i;
      squares += z * z;
      ++count;
    }
    fmt::print("{} texels: mean square of z {:.2f}\n", count / 3, squares / count);
    // Channels have one z, and of texels each four share paths.
    EXPECT_LT(squares / count, 1 + 5 * std::sqrt(2 / (count / 12)));
    // The image is linear in the map: with scale 2, half of the sum of texels times derivatives.
    EXPECT_NEAR(along / 2, result.parameters[1].moments.mean(0), 1e-9 * std::fabs(along));
  }
}

TEST(Backward, AgreesInMirrors) {
  const TempFiles files;
  expect_modes_agree(mirror_scene(files, true), 32, {});
  expect_modes_agree(mirror_scene(files, false), 32, {});
}

// The image is linear in a lamp's radiance, so that its derivative does not depend on it: no less
// of a lamp that is black, as fits may begin.
TEST(Backward, OfABlackLamp) {
  const TempFiles files;
  const auto scene_of = [&](const char* radiance) {
    SceneParts parts;
    parts.body = square("floor", 2, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
                 square("lamp", 0.7, 90, {0, 1.5, 0}, area_light("glow", radiance));
    return make_scene(files, parts);
  };
  GradientOptions options;
  options.parameters = {"glow.radiance"};
  options.block = 16;
  RunSettings settings;
  settings.spp = 64;
  const auto forward = [&](const char* radiance) {
    return gradient(scene_of(radiance), options, settings).parameters[0].total_blocks;
  };
  const Moments black = forward("0"), bright = forward("2");
  EXPECT_GT(black.mean(0), 0);
  EXPECT_LT(std::fabs(black.mean(0) - bright.mean(0)),
            5 * std::sqrt(black.variance(0) + bright.variance(0)));
  BackwardOptions reverse;
  reverse.parameters = options.parameters;
  expect_modes_agree(scene_of("0"), 256, reverse);
}

// Any sampler of edges has the same mean.
TEST(Backward, AgreesWithOtherSamplers) {
  const TempFiles files;
  const Scene scene = mirror_scene(files, true);
  const Image adjoint = random_adjoint(scene, 4);
  BackwardOptions options;
  options.terms = {"boundary"};
  options.parameters = {"body.translate.x", "body.translate.y", "body.scale", "lamp.translate.z"};
  RunSettings settings;
  settings.spp = 64;
  const BackwardResult one = backward(scene, adjoint, options, settings);
  options.method = "li2019";
  settings.seed = 1;
  const BackwardResult other = backward(scene, adjoint, options, settings);
  for (const std::string& name : options.parameters) {
    const Moments &a = one.of(name).moments, &b = other.of(name).moments;
    EXPECT_NE(a.mean(0), b.mean(0)) << name;
    EXPECT_LT(std::fabs(a.mean(0) - b.mean(0)), 5 * std::sqrt(a.variance(0) + b.variance(0)))
        << name;
  }
  EXPECT_THROW(options.method = "oak", InputError);
  options.method = "fd";  // in forward mode alone
  EXPECT_THROW(backward(scene, adjoint, options, settings), InputError);
}

// Light in closed form, and silhouettes on the film with jumps in closed form.
TEST(Backward, AgreesWithLightInClosedForm) {
  const TempFiles files;
  BackwardOptions options;
  options.method = "analytic";
  expect_modes_agree(lamps_scene(files), 16, options);
}

// Displacements tell nothing that the vertices do not: they are taken by name.
TEST(Backward, AllIsWithoutWhatRepeats) {
  const TempFiles files;
  const Scene scene = lamps_scene(files);
  BackwardOptions options;
  RunSettings settings;
  settings.spp = 1;
  const Image adjoint = random_adjoint(scene, 1);
  std::vector<std::string> all, expected;
  for (const ParameterAdjoint& p : backward(scene, adjoint, options, settings).parameters) {
    all.push_back(p.name);
  }
  for (const Parameter& p : list_parameters(scene)) {
    if (!p.name.ends_with(".displacement")) expected.push_back(p.name);
  }
  EXPECT_LT(expected.size(), list_parameters(scene).size());
  EXPECT_EQ(all, expected);
  options.parameters = {"ring.displacement"};
  EXPECT_EQ(backward(scene, adjoint, options, settings).parameters.size(), 1u);
}

// Where lamps and suns are regions apart. Before a small lamp most is found from there, before a
// larger one half of it: with the whole of both z is 7.
TEST(Backward, AgreesWithRegionsOfLight) {
  const TempFiles files;
  const Scene large = mirror_scene(files, true);
  BackwardOptions options;
  options.method = "silhouettes";
  expect_modes_agree(large, 16, options);
  options.terms = {"direct", "penumbra"};
  options.parameters = {"body.translate.x", "body.translate.y", "body.translate.z", "body.scale"};
  expect_modes_agree(penumbra_scene(files, 0.02), 256, options);
  options.parameters = {"body.translate.y"};
  expect_modes_agree(penumbra_scene(files, 0.1), 1024, options);
  options.method = "forest";
  EXPECT_THROW(backward(large, random_adjoint(large, 1), options, RunSettings{}), InputError);
}

// A low sun of one texel is a region, too: what an object hides of it and what it shows.
TEST(Backward, AgreesWithBrightPatches) {
  const TempFiles files;
  Image map(64, 32, 3);
  for (float& v : map.data) v = 0.3f;
  for (int c = 0; c < 3; ++c) map.at(40, 10, c) = 2000;
  write_exr(files.path("sun.exr"), map, false, {});
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 3, 4};
  const std::string mesh = write_mesh(files, "body.obj", shaken(torus_mesh(8, 5)));
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
               obj_shape("body", mesh, true, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
               R"(<emitter type="envmap" id="sky"><string name="filename" value=")" +
               files.path("sun.exr") + R"("/></emitter>)";
  const Scene scene = make_scene(files, parts);
  BackwardOptions options;
  options.method = "silhouettes";
  expect_modes_agree(scene, 32, options);
  options.terms = {"direct"};
  options.parameters = {"body.translate.x", "body.translate.y", "body.translate.z", "body.scale"};
  expect_modes_agree(scene, 256, options);
}

TEST(Backward, AgreesInSharpShadows) {
  const TempFiles files;
  for (const bool face_normals : {true, false})
    expect_modes_agree(shadow_scene(files, face_normals), 64, {});
}

TEST(Backward, AgreesWhereShapesCrossAndAreCut) {
  const TempFiles files;
  expect_modes_agree(crossing_scene(files), 64, {});
}

// Nothing changes if all shapes and the camera move together.
TEST(Backward, CommonTranslationSumsToZero) {
  const TempFiles files;
  for (const Scene& scene : {mirror_scene(files, true), crossing_scene(files)}) {
    BackwardOptions options;
    for (const Shape& shape : scene.shapes) {
      for (const char* axis : {"x", "y", "z"})
        options.parameters.push_back(shape.id + ".translate." + axis);
    }
    for (const char* axis : {"x", "y", "z"})
      options.parameters.push_back(std::string("sensor.translate.") + axis);
    RunSettings settings;
    settings.spp = 2;
    const BackwardResult result = backward(scene, random_adjoint(scene, 2), options, settings);
    for (size_t axis = 0; axis < 3; ++axis) {
      double sum = 0, size = 0;
      for (size_t i = axis; i < options.parameters.size(); i += 3) {
        sum += result.parameters[i].moments.mean(0);
        size += std::fabs(result.parameters[i].moments.mean(0));
      }
      EXPECT_NEAR(sum, 0, 1e-9 * size);
    }
  }
}

void expect_the_same_bits(const Scene& scene) {
  const Image adjoint = random_adjoint(scene, 4);
  std::vector<std::vector<double>> all;
  for (const int threads : {1, 2, 7}) {
    RunSettings settings;
    settings.spp = 136;
    settings.threads = threads;
    BackwardOptions options;
    options.batches = 2;  // each of more than one wave of tiles
    const BackwardResult result = backward(scene, adjoint, options, settings);
    EXPECT_EQ(result.non_finite.count, 0u);
    std::vector<double> values;
    for (const ParameterAdjoint& p : result.parameters) {
      for (size_t i = 0; i < p.moments.size(); ++i) {
        values.push_back(p.moments.mean(i));
        values.push_back(p.moments.variance(i));
      }
    }
    all.push_back(values);
  }
  EXPECT_EQ(all[0], all[1]);
  EXPECT_EQ(all[0], all[2]);
}

TEST(Backward, ThreadsChangeNoBit) {
  const TempFiles files;
  expect_the_same_bits(shadow_scene(files, false));
  expect_the_same_bits(mirror_scene(files, false, 2));
}

}  // namespace
}  // namespace limn
