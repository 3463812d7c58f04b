// Reverse mode against forward mode, and what must hold of any gradient.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
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

// Lights without extent, over a floor.
Scene shadow_scene(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 3, 4};
  const std::string mesh = write_mesh(files, "body.obj", shaken(torus_mesh(8, 5)));
  parts.body = square("floor", 3, -90, {0, 0, 0}, conductor("gloss", 0.4)) +
               obj_shape("body", mesh, true, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
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

Image random_adjoint(const Scene& scene, uint64_t seed) {
  Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i) {
    adjoint.data[i] = static_cast<float>(Rng(seed, i, 0).uniform() - 0.5);
  }
  return adjoint;
}

// What a parameter's derivative is summed from, in magnitude.
double magnitude(const Scene& scene, const BackwardResult& result, const std::string& name) {
  double sum = std::fabs(result.of(name).moments.mean(0));
  const Parameter parameter = find_parameter(scene, name);
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

// With the same samples interior terms are equal, to rounding.
void expect_same_interior(const Scene& scene) {
  BackwardOptions options;
  options.terms = {"interior"};
  options.uniform_pixels = true;
  for (const Parameter& p : list_parameters(scene)) options.parameters.push_back(p.name);
  const Image adjoint = random_adjoint(scene, 1);
  RunSettings settings;
  settings.spp = 8;
  settings.seed = 5;
  const BackwardResult reverse = backward(scene, adjoint, options, settings);
  GradientOptions forward_options;
  for (const ParameterAdjoint& p : reverse.parameters)
    if (p.shape.empty()) forward_options.parameters.push_back(p.name);
  forward_options.terms = {"interior"};
  forward_options.method = "forest";
  const GradientResult forward = gradient(scene, forward_options, settings);
  for (const ParameterGradient& p : forward.parameters) {
    double sum = 0;
    for (size_t k = 0; k < adjoint.data.size(); ++k) sum += adjoint.data[k] * p.total.mean(k);
    const double found = reverse.of(p.name).moments.mean(0);
    EXPECT_NEAR(found, sum, 1e-12 * magnitude(scene, reverse, p.name)) << p.name;
  }
}

TEST(Backward, InteriorIsThatOfForwardMode) {
  const TempFiles files;
  expect_same_interior(mirror_scene(files, true));
  expect_same_interior(mirror_scene(files, false));
  expect_same_interior(shadow_scene(files));
  expect_same_interior(crossing_scene(files));
}

// z-scores of all parameters, whose sum of squares has as many degrees of freedom at most.
void expect_agreement(const Scene& scene, int spp, const std::vector<std::string>& terms = {}) {
  BackwardOptions options;
  options.terms = terms;
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 3;
  settings.threads = 2;
  for (const ReverseCheck& check : check_reverse(scene, options, settings)) {
    fmt::print("{:28} forward {:10.4g} +- {:8.2g}  reverse {:10.4g} +- {:8.2g}  z {:5.2f}\n",
               check.parameter, check.forward, check.forward_error, check.reverse,
               check.reverse_error, check.z);
    EXPECT_LT(std::fabs(check.z), 4.5) << check.parameter;
  }
}

TEST(Backward, AgreesInMirrors) {
  const TempFiles files;
  expect_agreement(mirror_scene(files, true), 32);
  expect_agreement(mirror_scene(files, false), 32);
}

TEST(Backward, AgreesInSharpShadows) {
  const TempFiles files;
  expect_agreement(shadow_scene(files), 64);
}

TEST(Backward, AgreesWhereShapesCrossAndAreCut) {
  const TempFiles files;
  expect_agreement(crossing_scene(files), 64);
}

// At the target itself both the loss and its gradient have mean zero, however noisy the images are.
TEST(Backward, LossIsUnbiasedAtItsTarget) {
  const TempFiles files;
  const Scene scene = shadow_scene(files);
  RunSettings settings;
  settings.spp = 2048;
  settings.threads = 2;
  const RenderResult truth = render(scene, settings);
  const Image target = mean_image(truth.radiance, scene.film.crop_width, scene.film.crop_height);
  for (const char* name : {"l2", "relative-l2"}) {
    Moments values(2);
    BackwardOptions options;
    options.parameters = {"clay.reflectance"};
    settings.spp = 2;
    for (settings.seed = 100; settings.seed < 164; ++settings.seed) {
      const LossResult loss = image_loss(scene, target, loss_kind(name), settings);
      const BackwardResult result = backward(scene, loss.adjoint, options, settings);
      values.add_batch({loss.value, result.parameters[0].moments.mean(0)}, 1);
    }
    EXPECT_LT(std::fabs(values.mean(0)), 4.5 * std::sqrt(values.variance(0))) << name;
    EXPECT_LT(std::fabs(values.mean(1)), 4.5 * std::sqrt(values.variance(1))) << name;
  }
}

TEST(Backward, LossImagesThatDoNotFitAreNamed) {
  const TempFiles files;
  const Scene scene = shadow_scene(files);
  const Image target(scene.film.crop_width, scene.film.crop_height, 3);
  const auto refused = [&](const Image& t, const Image& mask) -> std::string {
    try {
      check_loss_images(scene, t, mask, "t.exr", "m.exr");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  Image mask = target;
  EXPECT_EQ(refused(target, mask),
            "m.exr: error: the mask is zero everywhere: no pixel is left for the loss");
  for (float& v : mask.data) v = 1;
  EXPECT_EQ(refused(target, mask), "");
  mask.at(1, 2, 2) = 0;
  EXPECT_EQ(refused(target, mask)
                .find("m.exr: error: the mask's channels differ in column 1, "
                      "row 2"),
            0u);
  Image holes = target;
  holes.at(3, 0, 1) = NAN;
  EXPECT_EQ(refused(holes, {}).find("t.exr: error: the target is not finite in column 3, row 0"),
            0u);
  EXPECT_EQ(refused(Image(1, 1, 3), {}).find("t.exr: error: the target has 1 x 1 pixels"), 0u);
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

TEST(Backward, ThreadsChangeNoBit) {
  const TempFiles files;
  const Scene scene = shadow_scene(files);
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

}  // namespace
}  // namespace limn
