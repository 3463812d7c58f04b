// A closed room whose walls all emit E and reflect a share rho: radiance is E / (1 - rho)
// everywhere, whatever the shape of the room; with a depth limit d, E (1 - rho^d) / (1 - rho).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kEmission = 0.7;
constexpr double kReflectance = 0.6;
constexpr double kLevel = 1e-5;

Scene room(const TempFiles& files, const Mesh& mesh, int depth, int roulette) {
  SceneParts parts;
  parts.max_depth = depth;
  parts.rr_depth = roulette;
  parts.width = parts.height = 2;
  parts.fov = 100;
  parts.origin = {0.1, 0.2, 0.3};
  parts.target = {1, 0.1, -0.2};
  parts.body = obj_shape("room", write_mesh(files, "room.obj", reversed(mesh)), true, 1, {0, 0, 0},
                         diffuse("wall", fmt::format("{}", kReflectance)) +
                             area_light("glow", fmt::format("{}", kEmission)));
  return make_scene(files, parts);
}

struct Case {
  std::string name;
  Mesh mesh;
  int depth, roulette;
  double radiance() const {
    const double share = depth < 0 ? 0 : std::pow(kReflectance, depth);
    return kEmission * (1 - share) / (1 - kReflectance);
  }
};

class Furnace : public testing::TestWithParam<Case> {};

TEST_P(Furnace, RadianceIsKnown) {
  const TempFiles files;
  const Scene scene = room(files, GetParam().mesh, GetParam().depth, GetParam().roulette);
  RunSettings settings;
  settings.spp = 2048;
  const RenderResult r = render(scene, settings);
  const ZSummary z =
      compare_moments(r.radiance, std::vector<double>(r.radiance.size(), GetParam().radiance()));
  fmt::print("{:16} {:3} values, mean z {:5.2f}, sd {:4.2f}, max |z| {:5.2f}\n", GetParam().name,
             z.count, z.mean, z.deviation, z.largest);
  EXPECT_GT(z.count, 0);
  EXPECT_GE(z.p_largest, kLevel);
}

// The same by even numbers: images of other seeds are independent. Samples serve several pixels;
// the film cuts the filters of all.
TEST_P(Furnace, RadianceByEvenNumbersIsKnown) {
  const TempFiles files;
  Scene scene = room(files, GetParam().mesh, GetParam().depth, GetParam().roulette);
  scene.film.filter = {};  // a gaussian
  RunSettings settings;
  settings.spp = 32;
  Moments images(12);
  for (settings.seed = 0; settings.seed < 16; ++settings.seed) {
    images.add_batch(means(render(scene, settings, {.generator = "sobol"}).radiance), 1);
  }
  const ZSummary z =
      compare_moments(images, std::vector<double>(images.size(), GetParam().radiance()));
  fmt::print("{:16} {:3} values, mean z {:5.2f}, sd {:4.2f}, max |z| {:5.2f}\n", GetParam().name,
             z.count, z.mean, z.deviation, z.largest);
  EXPECT_GT(z.count, 0);
  EXPECT_GE(z.p_largest, kLevel);
}

INSTANTIATE_TEST_SUITE_P(, Furnace,
                         testing::Values(Case{"cube", cube_mesh(), -1, 5},
                                         Case{"cube_early", cube_mesh(), -1, 1},
                                         Case{"cube_unlimited", cube_mesh(), -1, 1000},
                                         Case{"cube_limited", cube_mesh(), 3, 1000},
                                         Case{"ball", icosphere_mesh(1), -1, 5}),
                         [](const auto& test) { return test.param.name; });

// With f = 1 / (1 - rho): f for the emission, E f^2 for the reflectance, nothing for what moves.
TEST(FurnaceGradient, IsKnown) {
  const TempFiles files;
  const Scene scene = room(files, cube_mesh(), 40, 1000);
  GradientOptions options;
  options.parameters = {"glow.radiance", "wall.reflectance", "sensor.translate.x", "room.rotate.y"};
  options.block = 1;
  RunSettings settings;
  settings.spp = 2048;
  const GradientResult r = gradient(scene, options, settings);
  const double f = 1 / (1 - kReflectance);
  const double exact[] = {f, kEmission * f * f, 0, 0};
  for (int k = 0; k < 4; ++k) {
    const Moments& blocks = r.parameters[k].total_blocks;
    const double per_block = exact[k] * options.block * options.block * 3;
    const ZSummary z = compare_moments(blocks, std::vector<double>(blocks.size(), per_block));
    fmt::print("{:20} {:3} blocks, mean z {:5.2f}, sd {:4.2f}, max |z| {:5.2f}\n",
               options.parameters[k], z.count, z.mean, z.deviation, z.largest);
    EXPECT_GT(z.count, 0);
    EXPECT_TRUE(z.plausible(kLevel)) << options.parameters[k];
  }
}

}  // namespace
}  // namespace limn
