// Reverse mode, term by term, against closed forms of edges that no other test of it has: inside of
// faces, in mirrors, behind masks and glass.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "limn/core/rng.h"
#include "limn/core/scene.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/statistics.h"

namespace limn {
namespace {

class ClosedFormBackward : public testing::TestWithParam<const char*> {};

TEST_P(ClosedFormBackward, IsExact) {
  const std::string folder = std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/";
  std::ifstream file(folder + "references.json");
  const auto scenes = nlohmann::json::parse(file)["scenes"];
  const auto reference = *std::find_if(scenes.begin(), scenes.end(), [](const auto& entry) {
    return entry["file"] == std::string(GetParam()) + ".xml";
  });
  const Scene scene = read_scene(folder + std::string(GetParam()) + ".xml", {}, nullptr);
  Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i) {
    adjoint.data[i] = static_cast<float>(Rng(6, i, 0).uniform());
  }
  RunSettings settings;
  settings.spp = 4096;
  settings.seed = 9;
  BackwardOptions options;
  options.batches = 64;
  for (const auto& p : reference["parameters"]) options.parameters.push_back(p["name"]);
  for (const char* term : {"interior", "camera", "boundary"}) {
    options.terms = {term};
    const BackwardResult result = backward(scene, adjoint, options, settings);
    std::vector<double> z;
    for (const auto& p : reference["parameters"]) {
      const Moments& m = result.of(p["name"]).moments;
      double found = 0, variance = 0, exact = 0;
      for (size_t i = 0; i < m.size(); ++i) {
        found += m.mean(i);
        variance += std::sqrt(m.variance(i));
      }
      for (size_t i = 0; i < adjoint.data.size(); ++i) {
        exact += adjoint.data[i] * p[term][i].template get<double>();
      }
      const double error = variance;  // channels share samples: their errors add up at most
      if (error <= 1e-9 * (1 + std::fabs(exact))) {
        EXPECT_NEAR(found, exact, 1e-8 * (1 + std::fabs(exact))) << term << " " << p["name"];
        continue;
      }
      z.push_back(normal_from_student((found - exact) / error, m.degrees()));
    }
    if (z.empty()) continue;
    const ZSummary summary = summarize(z);
    fmt::print("{:16} {:9} {:3} values, mean z {:6.2f}, largest |z| {:5.2f}\n", GetParam(), term,
               summary.count, summary.mean, summary.largest);
    EXPECT_GE(summary.p_largest, 1e-6) << term;
  }
}

INSTANTIATE_TEST_SUITE_P(, ClosedFormBackward,
                         testing::Values("board_in_sky", "seam_in_sky", "board_in_gloss",
                                         "square_in_mirror", "square_in_mirror_orthographic",
                                         "square_in_mirror_thinlens", "mirror_wedge",
                                         "lamp_in_mirror", "lamp_in_corner", "lamps_behind_mask",
                                         "lamp_behind_mask", "lamps_under_water",
                                         "lamps_through_pane"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace limn
