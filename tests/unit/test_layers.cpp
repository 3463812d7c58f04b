// Layers of what the camera sees.
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/integrators/layers.h"
#include "support/temp_files.h"

namespace limn {
namespace {

// A square of side 2 in z = 1 that fills the left half of the film, seen along -z from z = 4; the
// film is 3 tan(fov / 2) = 1 to either side.
Scene scene() {
  return read_scene_text(
      "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" "
      "value=\"36.86989764584402\"/><transform name=\"to_world\"><lookat origin=\"0,0,4\" "
      "target=\"0,0,0\" up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" "
      "value=\"8\"/><integer name=\"height\" value=\"8\"/><rfilter type=\"box\"/></film></sensor>"
      "<shape type=\"rectangle\"><transform name=\"to_world\"><translate x=\"-1\" z=\"1\"/>"
      "</transform><bsdf type=\"diffuse\"><texture name=\"reflectance\" type=\"checkerboard\">"
      "<rgb name=\"color0\" value=\"0.5,0.25,0.125\"/><rgb name=\"color1\" "
      "value=\"0.5,0.25,0.125\"/></texture></bsdf></shape></scene>",
      "", {}, nullptr);
}

TEST(Layers, OfASquare) {
  RunSettings settings;
  settings.spp = 64;
  const LayersResult result = render_layers(scene(), layer_names(), settings);
  ASSERT_EQ(result.layers.size(), 8u);
  EXPECT_EQ(result.spp, 64);
  const auto at = [&](const std::string& name, int x, int y, int c) {
    for (const ImageLayer& layer : result.layers) {
      if (layer.name == name) return layer.image.at(x, y, c);
    }
    return std::nanf("");
  };
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      const bool seen = x < 4;
      const double place_x = (x + 0.5) / 4 - 1, place_y = 1 - (y + 0.5) / 4;
      EXPECT_EQ(at("alpha", x, y, 0), seen ? 1 : 0);
      EXPECT_EQ(at("normals", x, y, 2), seen ? 1 : 0);
      EXPECT_EQ(at("sh_normal", x, y, 2), seen ? 1 : 0);
      EXPECT_EQ(at("shape_index", x, y, 0), seen ? 1 : 0);
      EXPECT_NEAR(at("albedo", x, y, 1), seen ? 0.25 : 0, 1e-6);
      EXPECT_NEAR(at("position", x, y, 0), seen ? place_x : 0, 0.01);
      EXPECT_NEAR(at("position", x, y, 2), seen ? 1 : 0, 1e-5);
      EXPECT_NEAR(at("uv", x, y, 0), seen ? (place_x + 2) / 2 : 0, 0.01);
      EXPECT_NEAR(at("uv", x, y, 1), seen ? (place_y + 1) / 2 : 0, 0.01);
      const double depth = std::sqrt(9 + place_x * place_x + place_y * place_y);
      EXPECT_NEAR(at("depth", x, y, 0), seen ? depth : 0, 0.01);
    }
  }
  EXPECT_THROW(render_layers(scene(), {"alpha", "colour"}, settings), InputError);
  EXPECT_THROW(render_layers(scene(), {"alpha", "alpha"}, settings), InputError);
}

// Another program would find them by these names.
TEST(Layers, AreChannelsOfOneFile) {
  RunSettings settings;
  settings.spp = 1;
  const TempFiles files;
  const LayersResult result = render_layers(scene(), {"normals", "alpha"}, settings);
  write_exr_layers(files.path("a.exr"), result.layers, {{"limn.what", "normals,alpha"}});
  EXPECT_EQ(read_exr_attributes(files.path("a.exr")).size(), 1u);
  try {
    read_exr(files.path("a.exr"));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("(found: alpha.Y, normals.X, normals.Y, normals.Z)"),
              std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace limn
