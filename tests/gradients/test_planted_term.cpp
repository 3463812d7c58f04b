// "A term: 3 files" of CONTRIBUTING.md. This program's table of terms has one row more, that of
// support/planted_term.cpp; all else is linked as it is. The term must work in both modes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "integrators/terms/term.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/methods.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kSlope = 2;  // of the image, in every pixel, as the body rises

// The floor fills the film, and the body is out of sight above the camera.
Scene floor_below(const TempFiles& files) {
  SceneParts parts;
  parts.width = parts.height = 8;
  parts.origin = {0, 2, 0.5};
  parts.target = {0, 0, 0};
  parts.body = square("floor", 20, -90, {0, 0, 0}, diffuse("clay", ".6, .5, .4")) +
               square("body", 0.5, 90, {0, 4, 0}, diffuse("chalk", ".6, .5, .4")) +
               square("lamp", 0.5, 90, {3, 6, 1}, area_light("glow", "6, 6, 6"));
  return make_scene(files, parts);
}

TEST(PlantedTerm, IsListed) {
  EXPECT_EQ(std::string(term_types().back().name), "planted");
  const Method method("silhouettes");
  EXPECT_EQ(method->terms.back(), "planted");
}

TEST(PlantedTerm, WorksInForwardMode) {
  const TempFiles files;
  const Scene scene = floor_below(files);
  GradientOptions options;
  options.parameters = {"body.translate.y", "body.translate.x"};
  options.method = "silhouettes";
  options.samples = std::nullopt;  // a pilot gives it samples, too
  RunSettings settings;
  settings.spp = 16;
  const GradientResult all = gradient(scene, options, settings);
  options.terms = {"planted"};
  const GradientResult alone = gradient(scene, options, settings);
  for (const GradientResult* result : {&all, &alone}) {
    const size_t term = result->term("planted");
    for (size_t k = 0; k < 2; ++k) {
      const Moments& image = result->parameters[k].terms[term];
      for (size_t i = 0; i < image.size(); ++i) {
        ASSERT_NEAR(image.mean(i), k == 0 ? kSlope : 0, 1e-12) << k;
      }
    }
  }
  EXPECT_GT(all.terms[all.term("interior")].cost.samples, 0u);
}

TEST(PlantedTerm, WorksInReverseMode) {
  const TempFiles files;
  const Scene scene = floor_below(files);
  BackwardOptions options;
  options.parameters = {"body.translate.y", "body.translate.x", "body.vertex_positions",
                        "floor.vertex_positions"};
  options.method = "silhouettes";
  options.terms = {"planted"};
  options.edge_samples = 3;
  RunSettings settings;
  settings.spp = 4;
  Image adjoint(8, 8, 3);
  std::fill(adjoint.data.begin(), adjoint.data.end(), 0.5f);
  const double sum = 0.5 * static_cast<double>(adjoint.data.size()) * kSlope;
  const BackwardResult result = backward(scene, adjoint, options, settings);
  EXPECT_NEAR(result.of("body.translate.y").moments.mean(0), sum, 1e-9);
  EXPECT_NEAR(result.of("body.translate.x").moments.mean(0), 0, 1e-9);
  // The ends of one edge, by their shares.
  std::vector<double> shares;
  const Moments& vertices = result.of("body.vertex_positions").moments;
  for (size_t i = 0; i < vertices.size(); ++i) {
    if (std::fabs(vertices.mean(i)) > 1e-9) shares.push_back(vertices.mean(i) / sum);
  }
  std::sort(shares.begin(), shares.end());
  ASSERT_EQ(shares.size(), 2u);
  EXPECT_NEAR(shares[0], 0.25, 1e-12);
  EXPECT_NEAR(shares[1], 0.75, 1e-12);
  // The vertices of paths carry the opposite.
  const Moments& floor = result.of("floor.vertex_positions").moments;
  double rise = 0;
  for (size_t i = 1; i < floor.size(); i += 3) rise += floor.mean(i);
  EXPECT_NEAR(rise, -sum, 1e-9);
}

// All terms, this one among them.
TEST(PlantedTerm, AgreesInBothModes) {
  const TempFiles files;
  const Scene scene = floor_below(files);
  BackwardOptions options;
  options.method = "silhouettes";
  RunSettings settings;
  settings.spp = 32;
  for (const ReverseCheck& check : check_reverse(scene, options, settings)) {
    // Some have no noise: they differ by rounding.
    const double error = std::hypot(check.forward_error, check.reverse_error);
    EXPECT_NEAR(check.forward, check.reverse, 4.5 * error + 1e-9) << check.parameter;
  }
}

}  // namespace
}  // namespace limn
