// Derivatives of textures: texels, attributes, and what slides over them.
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/image.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/check.h"
#include "support/check_runs.h"
#include "support/temp_files.h"

namespace limn {
namespace {

// An image of 4 by 3 texels, of values that differ by channels.
std::string write_texture(const TempFiles& files) {
  Image image(4, 3, 3);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = 0.1f + 0.8f * static_cast<float>((7 * i) % 12) / 12;
  }
  const std::string file = files.path("texture.exr");
  write_exr(file, image, false, {});
  return file;
}

std::string bitmap(const std::string& name, const std::string& file) {
  return "<texture name=\"" + name + "\" type=\"bitmap\"><string name=\"filename\" value=\"" +
         file + "\"/><string name=\"wrap_mode\" value=\"clamp\"/></texture>";
}

// The camera looks down at the square [-1, 1]^2 in z = 0.
Scene read(const std::string& body, int depth = 2) {
  return read_scene_text(
      "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"" +
          std::to_string(depth) +
          "\"/></integrator><sensor type=\"perspective\"><float name=\"fov\" value=\"50\"/>"
          "<transform name=\"to_world\"><lookat origin=\"0.2,0.1,3\" target=\"0,0,0\" "
          "up=\"0,1,0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"16\"/>"
          "<integer name=\"height\" value=\"16\"/><rfilter type=\"box\"/></film></sensor>" +
          body + "</scene>",
      "", {}, nullptr);
}
const std::string kSky = "<emitter type=\"constant\"/>";
const std::string kFloor =
    "<shape type=\"rectangle\" id=\"floor\"><bsdf type=\"diffuse\" id=\"grey\"/></shape>";
std::string square(const std::string& inside) {
  return "<shape type=\"rectangle\" id=\"square\">" + inside + "</shape>";
}

// By reverse mode, too.
void expect_both(const Scene& scene, const std::string& parameter, int spp) {
  SCOPED_TRACE(parameter);
  expect_agreement(scene, parameter, spp);
  BackwardOptions options;
  options.parameters = {parameter};
  expect_modes_agree(scene, spp, options);
}

// Under a sky of radiance 1 alone, a diffuse square has the radiance of its reflectance.
TEST(Textures, BitmapOfAMaterial) {
  const TempFiles files;
  const Scene scene = read(kSky + square("<bsdf type=\"diffuse\" id=\"b\">" +
                                         bitmap("reflectance", write_texture(files)) + "</bsdf>"));
  expect_both(scene, "b.reflectance.data.1.2.g", 64);
  expect_both(scene, "square.translate.x", 64);
  expect_both(scene, "square.rotate.z", 64);
}

TEST(Textures, BitmapOfARoughness) {
  const TempFiles files;
  const Scene scene =
      read("<emitter type=\"point\"><point name=\"position\" value=\"0.5,0.2,2\"/></emitter>" +
           square("<bsdf type=\"roughconductor\" id=\"b\">" +
                  bitmap("alpha", write_texture(files)) + "</bsdf>"));
  expect_both(scene, "b.alpha.data.1.1.g", 64);
}

TEST(Textures, ColoursOfVertices) {
  const TempFiles files;
  const std::string ply = files.write(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float r\nproperty float g\nproperty float b\nelement face 2\nproperty list "
      "uchar int vertex_index\nproperty float heat_0\nend_header\n-1 -1 0 0.1 0.2 0.3\n"
      "1 -1 0 0.9 0.2 0.5\n1 1 0 0.3 0.8 0.1\n-1 1 0 0 1 0.6\n3 0 1 2 0.25\n3 0 2 3 0.75\n");
  const auto with = [&](const std::string& name) {
    return read(kSky + "<shape type=\"ply\" id=\"square\"><string name=\"filename\" value=\"" +
                ply +
                "\"/><bsdf type=\"diffuse\"><texture type=\"mesh_attribute\" "
                "name=\"reflectance\"><string name=\"name\" value=\"" +
                name + "\"/></texture></bsdf></shape>");
  };
  const Scene scene = with("vertex_color");
  EXPECT_EQ(find_parameter_or_array(scene, "square.vertex_color").array,
            (std::vector<size_t>{1, 4, 3}));
  expect_both(scene, "square.vertex_color.2.g", 64);
  expect_both(scene, "square.translate.y", 64);
  expect_both(with("face_heat"), "square.face_heat.1.r", 64);
  try {
    with("face_weight");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what())
                  .find("no attribute face_weight in " + ply +
                        ", needed by the texture of \"reflectance\" (known: vertex_color, "
                        "face_heat)"),
              std::string::npos)
        << error.what();
  }
}

TEST(Textures, BitmapOfALamp) {
  const TempFiles files;
  const Scene scene =
      read(kFloor +
           "<shape type=\"rectangle\" id=\"lamp\"><transform name=\"to_world\"><rotate x=\"1\" "
           "angle=\"180\"/><translate z=\"1.5\" x=\"1.6\"/></transform><emitter type=\"area\" "
           "id=\"e\">" +
           bitmap("radiance", write_texture(files)) + "</emitter></shape>");
  for (const Parameter& p : list_parameters(scene)) EXPECT_NE(p.name, "e.radiance");
  expect_both(scene, "e.radiance.data.1.1.r", 64);
  expect_both(scene, "lamp.translate.x", 256);
  expect_both(scene, "floor.translate.z", 256);
}

// A lamp in view.
TEST(Textures, BitmapOfALampInView) {
  const TempFiles files;
  const Scene scene = read(square("<emitter type=\"area\" id=\"e\">" +
                                  bitmap("radiance", write_texture(files)) + "</emitter>"));
  expect_both(scene, "e.radiance.data.0.3.b", 64);
  expect_both(scene, "square.translate.x", 64);
}

TEST(Textures, BitmapOfAProjectorAndASpot) {
  const TempFiles files;
  const std::string place =
      "<transform name=\"to_world\"><lookat origin=\"0.4,-0.3,2\" target=\"0,0,0\" "
      "up=\"0,1,0\"/></transform>";
  const std::string texture = write_texture(files);
  const Scene projector =
      read(kFloor + "<emitter type=\"projector\" id=\"p\">" + place +
           "<float name=\"fov\" value=\"100\"/>" + bitmap("irradiance", texture) + "</emitter>");
  expect_both(projector, "p.irradiance.data.1.2.r", 64);
  expect_both(projector, "p.translate.x", 64);
  expect_both(projector, "floor.translate.y", 64);
  expect_both(projector, "p.scale", 64);
  const Scene spot = read(kFloor + "<emitter type=\"spot\" id=\"q\">" + place +
                          "<float name=\"cutoff_angle\" value=\"60\"/>" +
                          bitmap("texture", texture) + "</emitter>");
  expect_both(spot, "q.texture.data.1.2.r", 64);
  expect_both(spot, "q.rotate.y", 64);
  expect_both(spot, "q.cutoff_angle", 64);
}

const std::string kProjector =
    "<emitter type=\"projector\" id=\"p\"><transform name=\"to_world\"><lookat "
    "origin=\"0.4,-0.3,2\" target=\"0,0,0\" up=\"0,1,0\"/></transform><float name=\"fov\" "
    "value=\"20\"/><rgb name=\"irradiance\" value=\"3,2,1\"/></emitter>";

// The frame is in view, then seen by way of a wall as well.
TEST(Textures, FrameOfAProjector) {
  const Scene scene = read(kFloor + kProjector);
  expect_both(scene, "p.translate.x", 256);
  expect_both(scene, "p.translate.z", 256);
  expect_both(scene, "p.rotate.y", 256);
  expect_both(scene, "p.rotate.z", 256);
  expect_both(scene, "floor.translate.z", 256);
  const std::string wall =
      "<shape type=\"rectangle\" id=\"wall\"><transform name=\"to_world\"><rotate y=\"1\" "
      "angle=\"90\"/><translate x=\"-0.6\"/></transform></shape>";
  expect_both(read(kFloor + wall + kProjector, 3), "p.rotate.y", 512);
}

// A ball shows the frame as well: its motion there is missing.
TEST(Textures, FrameOfAProjectorInAMirror) {
  const std::string ball =
      "<shape type=\"sphere\"><point name=\"center\" value=\"0.4,0.4,0.3\"/><float "
      "name=\"radius\" value=\"0.3\"/><bsdf type=\"conductor\"/></shape>";
  const auto incomplete = [](const Scene& scene, const std::string& parameter) {
    return run_check(scene, parameter, 8).gradient.incomplete;
  };
  EXPECT_FALSE(incomplete(read(kFloor + kProjector), "p.rotate.y"));
  const Scene scene = read(kFloor + ball + kProjector, 3);
  EXPECT_TRUE(incomplete(scene, "p.rotate.y"));
  EXPECT_FALSE(incomplete(scene, "p.irradiance"));
}

}  // namespace
}  // namespace limn
