// Coverage and its derivatives in closed form; losses against masks.
#include "limn/core/coverage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/temp_files.h"

namespace limn {
namespace {

// The film shows [-1, 1]^2. A plate covers [-0.5, 0.5]^2, its back to the camera; a lamp before its
// middle is hidden; a pane of glass covers x > 0.75.
Scene scene() {
  return read_scene_text(
      R"(<scene version="3.0.0">
<integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>
<sensor type="orthographic"><transform name="to_world">
  <lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/>
  <rfilter type="box"/></film></sensor>
<shape type="rectangle" id="lamp"><transform name="to_world"><scale value="0.7"/>
  <translate z="2"/></transform><emitter type="area"/></shape>
<shape type="rectangle" id="plate"><transform name="to_world"><scale value="0.5"/>
  <rotate y="1" angle="180"/></transform><bsdf type="roughconductor" id="metal"/></shape>
<shape type="rectangle" id="pane"><transform name="to_world"><scale value="0.125"/>
  <scale y="16"/><translate x="0.875"/></transform><bsdf type="thindielectric"/></shape>
<emitter type="constant" id="sky"/></scene>)",
      "", {}, nullptr);
}

TEST(Coverage, IsWhatSurfacesCover) {
  const Scene coverage = coverage_of(scene());
  RunSettings settings;
  settings.spp = 4;
  const RenderResult image = render(coverage, settings, {});
  // The camera's +x is to the left.
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      const bool plate = x >= 2 && x < 6 && y >= 2 && y < 6, pane = x == 0 || x == 7;
      const double value = image.radiance.mean(3 * (8 * y + x));
      if (pane) continue;
      EXPECT_NEAR(value, plate ? 0 : -1, 1e-12) << x << " " << y;
    }
  }
  double sides[2] = {0, 0};
  for (const int x : {0, 7}) {
    for (int y = 0; y < 8; ++y) sides[x > 0] += 1 + image.radiance.mean(3 * (8 * y + x));
  }
  EXPECT_NEAR(sides[0] + sides[1], 8, 1e-12);
  EXPECT_NEAR(sides[0] * sides[1], 0, 1e-12);
  std::vector<std::string> names;
  for (const Parameter& parameter : list_parameters(coverage)) names.push_back(parameter.name);
  EXPECT_TRUE(std::ranges::count(names, "plate.translate.x"));
  for (const char* name : {"lamp.translate.x", "metal.alpha", "sky.radiance.r"}) {
    EXPECT_FALSE(std::ranges::count(names, name)) << name;
  }
}

TEST(Coverage, HasDerivativesInBothModes) {
  const Scene coverage = coverage_of(scene());
  RunSettings settings;
  settings.spp = 64;
  GradientOptions options;
  options.parameters = {"plate.scale", "plate.translate.x"};
  const GradientResult forward = gradient(coverage, options, settings);
  // The area, 1 before, grows twice as fast as the plate; 16 pixels show 1, in three channels.
  const double grown = 3 * 2 * 16;
  const ParameterGradient& scaled = forward.parameters[0];
  const double error = std::sqrt(scaled.image_sum.variance(0));
  EXPECT_GT(error, 0);
  EXPECT_NEAR(scaled.image_sum.mean(0), grown, 4 * error);
  EXPECT_LT(error, 0.01 * grown);
  double left = 0;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 4; ++x) left += forward.parameters[1].total.mean(3 * (8 * y + x));
  }
  EXPECT_NEAR(std::fabs(left), 16, 0.5);
  Image adjoint(8, 8, 3);
  std::ranges::fill(adjoint.data, 1.0f);
  BackwardOptions reverse;
  reverse.parameters = {"plate.scale"};
  const BackwardResult back = backward(coverage, adjoint, reverse, settings);
  const double back_error = std::sqrt(back.parameters[0].moments.variance(0));
  EXPECT_NEAR(back.parameters[0].moments.mean(0), grown, 4 * back_error);
}

TEST(Coverage, IsReadFromMasks) {
  const TempFiles files;
  Image grey(2, 1, 1), alpha(2, 1, 1);
  grey.data = {1, 0.25};
  write_exr(files.path("grey.exr"), grey, false, {});
  EXPECT_EQ(read_coverage(files.path("grey.exr")).data, (std::vector<float>{0, -0.75}));
  alpha.data = {0.5, 1};
  write_exr_with_alpha(files.path("alpha.exr"), grey, alpha, false, {});
  EXPECT_EQ(read_coverage(files.path("alpha.exr")).data, (std::vector<float>{-0.5, 0}));
  EXPECT_EQ(read_image(files.path("alpha.exr")).data, grey.data);
  alpha.data = {1, 1};  // all is covered, whatever its colours
  write_exr_with_alpha(files.path("covered.exr"), grey, alpha, false, {});
  EXPECT_EQ(read_coverage(files.path("covered.exr")).data, (std::vector<float>{0, 0}));
  grey.data = {0, 255};
  write_exr(files.path("bytes.exr"), grey, false, {});
  EXPECT_THROW(read_coverage(files.path("bytes.exr")), InputError);
  // Several lines to a block, of halves.
  const Image colours(4, 20, 3), all(4, 20, 1);
  write_exr_with_alpha(files.path("halves.exr"), colours, all, true, {});
  EXPECT_EQ(read_coverage(files.path("halves.exr")).data, std::vector<float>(80, -1));
  // As stored: half of the byte is half covered.
  Image half(1, 1, 3);
  std::ranges::fill(half.data, static_cast<float>(srgb_decode(128 / 255.0)));
  write_png(files.path("half.png"), half, 1);
  const Image mask = read_coverage(files.path("half.png"));
  ASSERT_EQ(mask.data.size(), 1u);
  EXPECT_NEAR(mask.data[0], 128 / 255.0 - 1, 1e-6);
}

}  // namespace
}  // namespace limn
