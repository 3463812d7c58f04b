// Scenes that were written for Mitsuba are read with Mitsuba's meaning.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "limn/core/image.h"
#include "limn/core/parameter.h"
#include "limn/core/scene.h"
#include "support/temp_files.h"

namespace limn {
namespace {

std::string scene_text(const std::string& body, const std::string& version = "3.0.0") {
  return "<scene version=\"" + version + "\"><sensor type=\"perspective\"/>\n" + body + "</scene>";
}

Scene read(const std::string& body, std::vector<std::string>* warnings = nullptr) {
  return read_scene_text(scene_text(body), "", {}, warnings);
}

std::string message_of(const std::string& body) {
  try {
    read(body);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(OtherScenes, IntegratorsThatEstimateTheSame) {
  const std::vector<std::pair<std::string, int>> known = {
      {"path", -1}, {"ptracer", -1},  {"volpath", -1},       {"volpathmis", -1},      {"direct", 2},
      {"prb", 6},   {"prb_basic", 6}, {"prb_projective", 6}, {"direct_projective", 2}};
  for (const auto& [type, depth] : known) {
    EXPECT_EQ(read("<integrator type=\"" + type + "\"/>").max_depth, depth) << type;
  }
  EXPECT_EQ(read("<integrator type=\"moment\"><integrator type=\"prb\">"
                 "<integer name=\"max_depth\" value=\"4\"/></integrator></integrator>")
                .max_depth,
            4);
  EXPECT_EQ(read("<integrator type=\"direct\"><integer name=\"bsdf_samples\" value=\"0\"/>"
                 "<boolean name=\"hide_emitters\" value=\"true\"/></integrator>")
                .hide_emitters,
            true);
  std::vector<std::string> warnings;
  EXPECT_EQ(read("<integrator type=\"aov\"><string name=\"aovs\" value=\"d:depth\"/>\n"
                 "<integrator type=\"path\" name=\"image\"/></integrator>",
                 &warnings)
                .max_depth,
            -1);
  EXPECT_EQ(warnings, std::vector<std::string>{"string:2:24: warning: aovs are not written"});
}

TEST(OtherScenes, PathIgnoresMedia) {
  const std::string fog =
      "<medium type=\"homogeneous\" id=\"fog\"><rgb name=\"sigma_t\" value=\"1 2 3\"/></medium>\n";
  const std::string ball = "<shape type=\"sphere\"><ref name=\"interior\" id=\"fog\"/></shape>\n";
  std::vector<std::string> warnings;
  const std::string other = "<shape type=\"cube\"><ref name=\"interior\" id=\"fog\"/></shape>\n";
  EXPECT_EQ(read(fog + ball + other, &warnings).shapes.size(), 2u);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0],
            "string:3:43: warning: media are ignored, as by Mitsuba's path: 2 from here on");
  EXPECT_EQ(read(fog + "<integrator type=\"volpath\"/>").shapes.size(), 0u);  // of no shape
  EXPECT_NE(message_of("<integrator type=\"prbvolpath\"/>" + fog + ball).find("sees media"),
            std::string::npos);
}

// Where both have the same expectation.
TEST(OtherScenes, VolpathWithWhatItPasses) {
  const std::string net = "<bsdf id=\"a\" type=\"mask\"><bsdf type=\"diffuse\"/></bsdf>";
  const std::string lamp = "<emitter type=\"point\"/>";
  EXPECT_EQ(read("<integrator type=\"volpath\"/>" + net).max_depth, -1);
  EXPECT_EQ(read("<integrator type=\"prbvolpath\"/>" + lamp).max_depth, 6);
  EXPECT_NE(message_of("<integrator type=\"prbvolpath\"/>" + net)
                .find("bsdf \"mask\": prbvolpath counts no bounce there"),
            std::string::npos);
  EXPECT_NE(
      message_of("<integrator type=\"volpath\"><boolean name=\"hide_emitters\" value=\"true\"/>"
                 "</integrator>" +
                 net)
          .find("bsdf \"mask\": volpath hides emitters behind it"),
      std::string::npos);
  EXPECT_NE(message_of("<integrator type=\"volpath\"/>" + net + lamp)
                .find("bsdf \"mask\": volpath lets light of a point pass it"),
            std::string::npos);
}

TEST(OtherScenes, NamesOfFilesFromWindows) {
  TempFiles files;
  std::filesystem::create_directory(files.path("parts"));
  files.write("parts/path.xml",
              "<integrator type=\"path\"><integer name=\"max_depth\" value=\"7\"/></integrator>");
  const std::string file =
      files.write("s.xml", scene_text("<include filename=\"parts\\path.xml\"/>"));
  EXPECT_EQ(read_scene(file, {}, nullptr).max_depth, 7);
}

TEST(OtherScenes, SamplersFilmsAndTypesWithRemarks) {
  std::vector<std::string> warnings;
  const Scene scene = read_scene_text(
      "<scene version=\"2.1.0\"><sensor type=\"Perspective\">\n"
      "<sampler type=\"multijitter\"><integer name=\"sample_count\" value=\"9\"/></sampler>\n"
      "<film type=\"hdrfilm\"><string name=\"pixel_format\" value=\"rgba\"/></film>\n"
      "</sensor></scene>",
      "", {}, &warnings);
  EXPECT_EQ(scene.sample_count, 9);
  EXPECT_FALSE(scene.film.luminance);
  EXPECT_EQ(warnings,
            (std::vector<std::string>{
                "string:1:32: warning: sensor type \"Perspective\" is read as \"perspective\", "
                "which Mitsuba finds on some systems only",
                "string:3:22: warning: pixel_format rgba is written as rgb; render --alpha adds A",
                "string:2:1: warning: sampler \"multijitter\" is read as independent: limn "
                "chooses its own points"}));
}

TEST(OtherScenes, ObjectsUnderTheSceneByReference) {
  const Scene scene = read_scene_text(
      "<scene version=\"3.0.0\"><film id=\"f\" type=\"hdrfilm\">"
      "<integer name=\"width\" value=\"7\"/></film><sampler id=\"s\" type=\"independent\">"
      "<integer name=\"sample_count\" value=\"3\"/></sampler>"
      "<emitter id=\"e\" type=\"area\"><rgb name=\"radiance\" value=\"5\"/></emitter>"
      "<sensor type=\"perspective\"><ref id=\"f\"/><ref name=\"sampler\" id=\"s\"/></sensor>"
      "<shape type=\"cube\"><ref id=\"e\"/></shape><shape type=\"disk\" id=\"d\"><ref id=\"e\"/>"
      "</shape><ref id=\"d\"/></scene>",
      "", {}, nullptr);
  EXPECT_EQ(scene.camera.width, 7);
  EXPECT_EQ(scene.sample_count, 3);
  ASSERT_EQ(scene.shapes.size(), 2u);
  for (const Shape& shape : scene.shapes) EXPECT_EQ(shape.radiance.g.v, 5);
}

TEST(OtherScenes, SpectraAsProperties) {
  const Scene scene = read(
      "<shape type=\"cube\"><emitter type=\"area\"><spectrum name=\"radiance\" value=\"2\"/>"
      "</emitter></shape>"
      "<shape type=\"cube\"><emitter type=\"area\"><spectrum name=\"radiance\" "
      "value=\"400:0, 500:8, 600:15.6, 700:18.4\"/></emitter></shape>"
      "<shape type=\"cube\"><emitter type=\"area\"><spectrum name=\"radiance\" type=\"d65\">"
      "<float name=\"scale\" value=\"3\"/></spectrum></emitter></shape>"
      "<shape type=\"cube\"><emitter type=\"area\"><texture name=\"radiance\" "
      "type=\"rawconstant\"><vector name=\"value\" value=\"1,2,3\"/></texture></emitter></shape>"
      "<shape type=\"cube\"><emitter type=\"area\"><spectrum name=\"radiance\" "
      "type=\"irregular\"><string name=\"wavelengths\" value=\"400,500,600,700\"/>"
      "<string name=\"values\" value=\"0,8,15.6,18.4\"/></spectrum></emitter></shape>");
  const double known[5][3] = {{2.409588, 1.896582, 1.817832},
                              {20.711, 10.855, 2.771},
                              {3, 3, 3},
                              {1, 2, 3},
                              {20.711, 10.855, 2.771}};
  for (int s = 0; s < 5; ++s) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(scene.shapes[s].radiance[c].v, known[s][c], 1e-3) << s;
  }
  // A constant for eta and k is grey.
  const auto described = [](const std::string& tag) {
    const std::string eta = "<" + tag + " name=\"eta\" value=\"0.5\"/>";
    const std::string k = "<" + tag + " name=\"k\" value=\"3\"/>";
    return read("<shape type=\"cube\"><bsdf type=\"roughconductor\">" + eta + k + "</bsdf></shape>")
        .shapes[0]
        .bsdf->describe();
  };
  EXPECT_EQ(described("spectrum"), described("float"));
}

// A file that an included file names: beside that file, in <path>, beside the scene, in --path.
TEST(OtherScenes, FilesAreSearchedInOrder) {
  const TempFiles files;
  for (const char* folder : {"scene", "scene/parts", "common", "last"}) {
    std::filesystem::create_directories(files.path(folder));
  }
  const std::string main =
      files.write("scene/main.xml",
                  scene_text("<path value=\"../common\"/><include filename=\"parts/a.xml\"/>"));
  files.write("scene/parts/a.xml",
              "<scene version=\"3.0.0\"><shape type=\"obj\"><string name=\"filename\" "
              "value=\"m.obj\"/></shape></scene>");
  const std::vector<std::string> paths = {files.path("last")};
  EXPECT_THROW(read_scene(main, {}, nullptr, paths), InputError);
  std::string faces;
  // From the last place that is searched to the first, each with a face more.
  for (const char* folder : {"last", "scene", "common", "scene/parts"}) {
    faces += "v 0 0 0\nv 1 0 0\nv 0 1 " + std::to_string(faces.size()) + "\nf -1 -2 -3\n";
    files.write(std::string(folder) + "/m.obj", faces);
    const Scene scene = read_scene(main, {}, nullptr, paths);
    EXPECT_EQ(scene.shapes[0].mesh.faces.size(), std::ranges::count(faces, 'f')) << folder;
  }
}

TEST(OtherScenes, AnIncludedFileFindsAPathBesideTheScene) {
  const TempFiles files;
  std::filesystem::create_directories(files.path("parts"));
  std::filesystem::create_directories(files.path("meshes"));
  files.write("meshes/m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  files.write("parts/a.xml",
              "<scene version=\"3.0.0\"><path value=\"meshes\"/><shape type=\"obj\"><string "
              "name=\"filename\" value=\"m.obj\"/></shape></scene>");
  const std::string main = files.write("s.xml", scene_text("<include filename=\"parts/a.xml\"/>"));
  EXPECT_EQ(read_scene(main, {}, nullptr).shapes.size(), 1u);
}

TEST(OtherScenes, NamesOfEarlierFormats) {
  std::vector<std::string> warnings;
  const Scene scene = read_scene_text(
      "<scene version=\"0.6.0\">\n<integrator type=\"sppm\"><integer name=\"maxDepth\" "
      "value=\"7\"/>"
      "<float name=\"initialRadius\" value=\"1\"/></integrator>"
      "<sensor type=\"perspective\"><string name=\"fovAxis\" value=\"y\"/>"
      "<float name=\"fov\" value=\"40\"/><transform name=\"toWorld\">"
      "<lookAt origin=\"0,0,5\" target=\"0,0,0\" up=\"0,1,0\"/></transform>"
      "<sampler type=\"independent\"><integer name=\"sampleCount\" value=\"8\"/></sampler></sensor>"
      "<bsdf id=\"b\" type=\"diffuse\"><rgb name=\"diffuseReflectance\" value=\"0.25\"/></bsdf>"
      "<shape type=\"rectangle\"><transform name=\"toWorld\"><scale value=\"2\"/></transform>"
      "<ref id=\"b\"/></shape></scene>",
      "", {}, &warnings);
  EXPECT_EQ(scene.max_depth, 7);
  EXPECT_EQ(scene.sample_count, 8);
  EXPECT_EQ(scene.camera.origin.z.v, 5);
  EXPECT_EQ(scene.shapes[0].bsdf->describe(), "diffuse, reflectance 0.25 0.25 0.25");
  EXPECT_EQ(warnings,
            std::vector<std::string>{"string:2:1: warning: integrator \"sppm\" is read as "
                                     "path, without parameters of its own"});
}

TEST(OtherScenes, RotationsByZeroNeedNoAxis) {
  const Scene scene = read(
      "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate x=\"0\" y=\"0\" "
      "z=\"0\" angle=\"0\"/><scale value=\"2\"/></transform></shape>");
  EXPECT_EQ(bounds_of(scene.shapes[0].mesh).upper.x, 2);
}

TEST(OtherScenes, TypesThatAreGone) {
  std::vector<std::string> warnings;
  const Scene scene = read_scene_text(
      "<scene version=\"0.5.0\"><integrator type=\"path\"><integer name=\"maxDepth\" value=\"9\"/>"
      "<boolean name=\"strictNormals\" value=\"true\"/></integrator><sensor type=\"perspective\">"
      "<sampler type=\"sobol\"><integer name=\"sampleCount\" value=\"8\"/><integer "
      "name=\"scramble\" "
      "value=\"1\"/></sampler><film type=\"ldrfilm\"><integer name=\"width\" value=\"7\"/><string "
      "name=\"fileFormat\" value=\"png\"/><float name=\"gamma\" value=\"2.2\"/><rfilter "
      "type=\"tent\"/></film></sensor></scene>",
      "", {}, &warnings);
  EXPECT_EQ(scene.max_depth, 9);
  EXPECT_EQ(scene.sample_count, 8);
  EXPECT_EQ(scene.camera.width, 7);
  EXPECT_EQ(scene.camera.height, 576);
  EXPECT_EQ(scene.film.filter.kind, Filter::Kind::kTent);
  EXPECT_EQ(warnings,
            (std::vector<std::string>{
                "string:1:84: warning: strictNormals is ignored",
                "string:1:168: warning: sampler \"sobol\" is read as independent, without "
                "parameters of its own",
                "string:1:275: warning: film \"ldrfilm\" is read as hdrfilm, without parameters of "
                "its own"}));
  const Scene later = read_scene_text(
      "<scene version=\"3.0.0\">\u200b\n<integrator type=\"prb_reparam\"><integer "
      "name=\"reparam_rays\" value=\"8\"/></integrator><sensor type=\"perspective\"/></scene>",
      "", {}, &warnings);
  EXPECT_EQ(later.max_depth, 6);
}

TEST(OtherScenes, ColoursAndFiltersOfEarlierFormats) {
  const TempFiles files;
  write_png(files.path("t.png"), Image(2, 2, 3), 1);
  const auto describe = [&](const std::string& version, const std::string& bsdf,
                            std::vector<std::string>* warnings = nullptr) {
    const Scene scene = read_scene_text(
        "<scene version=\"" + version + "\"><sensor type=\"perspective\"><sampler " +
            "type=\"independent\"><integer name=\"dimension\" value=\"2\"/></sampler></sensor>" +
            "<shape type=\"cube\"><default name=\"white\" value=\"0.5\"/>" + bsdf +
            "</shape></scene>",
        files.path(""), {}, warnings);
    return scene.shapes[0].bsdf->describe();
  };
  const auto diffuse = [&](const std::string& value) {
    return describe("0.6.0", "<bsdf type=\"diffuse\">" + value + "</bsdf>");
  };
  const std::string three = "diffuse, reflectance 0.1 0.2 0.3";
  EXPECT_EQ(diffuse("<spectrum name=\"reflectance\" value=\"0.1, 0.2, 0.3\"/>"), three);
  EXPECT_EQ(diffuse("<rgb name=\"reflectance\" value=\"#ff3300\"/>"),
            "diffuse, reflectance 1 0.2 0");
  EXPECT_EQ(diffuse("<srgb name=\"reflectance\" value=\"1 0.5 0\"/>"),
            "diffuse, reflectance 1 0.214041 0");
  EXPECT_EQ(diffuse("<srgb name=\"reflectance\" value=\"#ffff00\"/>"),
            "diffuse, reflectance 1 1 0");
  EXPECT_EQ(diffuse("<srgb name=\"reflectance\" value=\"0.5\"/>"),
            "diffuse, reflectance 0.214041 0.214041 0.214041");
  EXPECT_EQ(diffuse("<default name=\"red\" value=\"#ff0000\"/><srgb name=\"reflectance\" "
                    "value=\"$red\"/>"),
            "diffuse, reflectance 1 0 0");
  EXPECT_EQ(diffuse("<rgb name=\"reflectance\" value=\"$white\"/>"),
            "diffuse, reflectance 0.5 0.5 0.5");
  EXPECT_THROW(diffuse("<rgb name=\"reflectance\" value=\"#ff330\"/>"), InputError);
  EXPECT_THROW(diffuse("<rgb name=\"reflectance\" value=\"#ff33-1\"/>"), InputError);
  EXPECT_EQ(describe("0.5.0",
                     "<bsdf type=\"conductor\"><rgb name=\"eta\" value=\"3\"/><rgb "
                     "name=\"k\" value=\"1.5\"/><float name=\"extEta\" value=\"1.5\"/>"
                     "</bsdf>"),
            "conductor, eta 2 2 2, k 1 1 1, specular_reflectance 1 1 1");
  std::vector<std::string> warnings;
  const std::string bitmap =
      describe("0.6.0",
               "<bsdf type=\"diffuse\"><texture type=\"bitmap\" name=\"reflectance\"><string "
               "name=\"filename\" value=\"t.png\"/><string name=\"filterType\" value=\"ewa\"/>"
               "</texture></bsdf>",
               &warnings);
  EXPECT_NE(bitmap.find("bitmap"), std::string::npos);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("filterType ewa is read as bilinear"), std::string::npos);
}

TEST(OtherScenes, WarningsOfAKindAreListed) {
  const TempFiles files;
  std::string shapes;
  for (int i = 0; i < 6; ++i) {
    const std::string name = std::to_string(i) + ".obj";
    const std::string degenerate = i % 5 > 0 ? "f 1 1 2\n" : "";
    const std::string z = std::to_string(i) + "\n";
    files.write(name, "v 0 0 " + z + "v 1 0 " + z + "v 0 1 " + z + "f 1 2 3\n" + degenerate);
    shapes += "<shape type=\"obj\"><string name=\"filename\" value=\"" + name + "\"/></shape>";
  }
  std::vector<std::string> warnings;
  read_scene_text(scene_text(shapes), files.path(""), {}, &warnings);
  ASSERT_EQ(warnings.size(), 3u);
  const std::string left_out = " of 2 faces have two corners at the same position";
  EXPECT_NE(warnings[0].find("1.obj: warning: 1" + left_out), std::string::npos);
  EXPECT_NE(warnings[1].find("2.obj: warning: 1" + left_out), std::string::npos);
  EXPECT_NE(
      warnings[2].find("3.obj: warning: like that of 2.obj, 2 more: 3.obj (1, 2), 4.obj (1, 2)"),
      std::string::npos)
      << warnings[2];
}

TEST(OtherScenes, WarningsThatDifferInNamesAreListed) {
  std::vector<std::string> warnings;
  read(
      "<shape type=\"Cube\"/><shape type=\"Disk\"/><shape type=\"Sphere\"/><shape "
      "type=\"Rectangle\"/>",
      &warnings);
  ASSERT_EQ(warnings.size(), 4u);  // the last: faces of disk and rectangle overlap
  EXPECT_NE(warnings[2].find("2 more: string:2:48 (\"Sphere\", \"sphere\"), string:2:70 "
                             "(\"Rectangle\", \"rectangle\")"),
            std::string::npos)
      << warnings[2];
}

TEST(OtherScenes, InstancesAreCopies) {
  const std::string group =
      "<shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\" id=\"a\"><transform "
      "name=\"to_world\"><translate x=\"1\"/></transform></shape><shape type=\"disk\"/></shape>";
  const std::string instance =
      "<shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\">"
      "<rotate z=\"1\" angle=\"90\"/></transform></shape>";
  const Scene scene = read(group + "<shape type=\"instance\"><ref id=\"g\"/></shape>" + instance);
  ASSERT_EQ(scene.shapes.size(), 4u);
  EXPECT_EQ(scene.shapes[0].id, "a");
  EXPECT_EQ(scene.shapes[2].id, "a.2");
  const Bounds first = bounds_of(scene.shapes[0].mesh), second = bounds_of(scene.shapes[2].mesh);
  EXPECT_EQ(first.upper.x, 2);
  EXPECT_NEAR(second.upper.y, 2, 1e-6);
  EXPECT_NEAR(second.upper.x, 1, 1e-6);
  EXPECT_EQ(read(group).shapes.size(), 0u);
  EXPECT_NE(message_of("<shape type=\"instance\"><ref id=\"c\"/></shape>"
                       "<shape type=\"cube\" id=\"c\"/>")
                .find("shape \"instance\": needs one shapegroup"),
            std::string::npos);
}

TEST(OtherScenes, BatchesAreLists) {
  const std::string sensor =
      "<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer "
      "name=\"width\" value=\"7\"/></film></sensor>";
  const TempFiles files;
  const std::string file = files.write(
      "s.xml", "<scene version=\"3.0.0\"><sensor type=\"batch\"><film type=\"hdrfilm\"/>" + sensor +
                   sensor + "</sensor>" + sensor + "</scene>");
  std::vector<std::string> warnings;
  const Scene scene = read_scene(file, {}, &warnings);
  ASSERT_EQ(scene.sensors.size(), 3u);
  EXPECT_EQ(scene.sensors[1].camera.width, 7);
  EXPECT_EQ(count_sensors(file, {}), 3u);
  EXPECT_EQ(warnings.size(), 0u);
  EXPECT_NE(message_of("<sensor type=\"batch\"/>").find("sensor \"batch\": needs sensors"),
            std::string::npos);
  EXPECT_NE(message_of("<sensor type=\"batch\"><sensor type=\"batch\"/></sensor>")
                .find("sensor \"batch\": a batch cannot contain a batch"),
            std::string::npos);
}

// Sensors without a film of their own share the batch's, side by side.
TEST(OtherScenes, BatchesShareTheirFilm) {
  const auto batch = [](int width) {
    return "<sensor type=\"batch\"><sensor type=\"perspective\"/><sensor type=\"thinlens\"><float "
           "name=\"aperture_radius\" value=\"0\"/></sensor><film type=\"hdrfilm\"><integer "
           "name=\"width\" value=\"" +
           std::to_string(width) +
           "\"/><integer name=\"height\" value=\"5\"/><rfilter type=\"box\"/></film><sampler "
           "type=\"independent\"><integer name=\"sample_count\" value=\"9\"/></sampler></sensor>";
  };
  const Scene scene = read(batch(14));
  ASSERT_EQ(scene.sensors.size(), 3u);  // the first is that of all scenes here
  for (size_t i = 1; i < 3; ++i) {
    EXPECT_EQ(scene.sensors[i].camera.width, 7);
    EXPECT_EQ(scene.sensors[i].film.crop_width, 7);
    EXPECT_EQ(scene.sensors[i].camera.height, 5);
    EXPECT_EQ(scene.sensors[i].film.filter.kind, Filter::Kind::kBox);
    EXPECT_EQ(scene.sensors[i].sample_count, 9);
  }
  EXPECT_NE(message_of(batch(15)).find("width: must be divisible by the number of sensors, 2"),
            std::string::npos);
}

TEST(OtherScenes, StretchedSpheresAreTold) {
  const auto shape = [](const std::string& type, const std::string& scale) {
    return "<shape type=\"" + type + "\"><transform name=\"to_world\"><scale value=\"" + scale +
           "\"/><rotate x=\"1\" angle=\"30\"/></transform></shape>";
  };
  for (const auto& [type, scale, count] : {std::tuple{"sphere", "2, 2, 2", 0},
                                           {"sphere", "1, 1, 1.2", 1},
                                           {"cylinder", "1, 1, 2", 0},
                                           {"cylinder", "1, 2, 1", 1},
                                           {"disk", "1, 2, 1", 0}}) {
    std::vector<std::string> warnings;
    read(shape(type, scale), &warnings);
    ASSERT_EQ(warnings.size(), count) << type << scale;
    if (count == 0) continue;
    EXPECT_EQ(
        warnings[0],
        "string:2:" +
            std::to_string(std::string("<shape type=\"").size() + 3 + std::string(type).size()) +
            ": warning: to_world stretches the " + type + ", which Mitsuba keeps round");
  }
}

// As exporters write them where a spectrum's colour has no red; Mitsuba squares them.
TEST(OtherScenes, NegativeIndicesOfMetals) {
  const auto metal = [](const std::string& sign) {
    const Scene scene =
        read("<bsdf type=\"roughconductor\" id=\"m\"><rgb name=\"eta\" value=\"" + sign +
             "0.05, 4, 5\"/><rgb name=\"k\" value=\"" + sign + "0.04, 1, 2\"/></bsdf>");
    return scene.bsdfs_by_id.at("m")->describe();
  };
  EXPECT_EQ(metal("-"), metal(""));
  EXPECT_NE(metal("-").find("eta 0.05 4 5, k 0.04 1 2"), std::string::npos) << metal("-");
}

// What changes the noise of Mitsuba's images alone.
TEST(OtherScenes, WeightsOfSampling) {
  const std::string weight = "<float name=\"sampling_weight\" value=\"2\"/>";
  const Scene scene = read(
      "<shape type=\"cube\"><float name=\"silhouette_sampling_weight\" value=\"2\"/>"
      "<emitter type=\"area\">" +
      weight + "</emitter></shape><emitter type=\"constant\">" + weight +
      "</emitter><emitter type=\"point\">" + weight + "</emitter>");
  EXPECT_TRUE(scene.shapes[0].is_emitter && scene.environment);
  EXPECT_EQ(scene.delta_lights.size(), 1u);
}

TEST(OtherScenes, SettingsOfMitsubasRayTracer) {
  const std::string setting =
      "<boolean name=\"embree_use_robust_intersections\" value=\"true\"/>"
      "<integer name=\"kd_max_depth\" value=\"9\"/>";
  EXPECT_EQ(read(setting).shapes.size(), 0u);
  EXPECT_NE(message_of("<boolean name=\"spectral\" value=\"true\"/>")
                .find("<scene>: unknown parameter \"spectral\" (known: allow_thread_reordering, "
                      "compact_acceleration_structures, embree_use_robust_intersections)"),
            std::string::npos);
}

// The film is [-1, 1] across and square pixels high, scaled by to_world.
TEST(OtherScenes, OrthographicSensors) {
  const Scene scene = read_scene_text(
      "<scene version=\"3.0.0\"><sensor type=\"orthographic\"><transform name=\"to_world\">"
      "<scale x=\"3\" y=\"3\"/><lookat origin=\"0,0,5\" target=\"0,0,0\" up=\"0,1,0\"/></transform>"
      "<film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer name=\"height\" "
      "value=\"4\"/></film></sensor><shape type=\"cube\" id=\"a\"/></scene>",
      "", {}, nullptr);
  const CameraRay<double> corner = scene.camera.ray<double>(0, 0);
  EXPECT_NEAR(corner.origin.x, -3, 1e-12);  // +X is to the left as seen from +Z
  EXPECT_NEAR(corner.origin.y, 1.5, 1e-12);
  EXPECT_NEAR(corner.direction.z, -1, 1e-12);
  const std::array<Camera::FilmPoint<double>, 2> places = {{{8, 4}, {6, 1}}};
  std::array<CameraRay<double>, 2> rays;
  find_rays(CameraView<double>(scene.camera), places, rays);
  EXPECT_NEAR(rays[0].origin.x, 3, 1e-12);
  EXPECT_NEAR(rays[1].origin.y, 0.75, 1e-12);
  EXPECT_EQ(rays[1].t_min, 0.01);
  EXPECT_NO_THROW(find_parameter(scene, "sensor.rotate.x"));
  EXPECT_THROW(find_parameter(scene, "sensor.fov"), InputError);
}

// A checkerboard asks for texture coordinates.
std::string textured(const std::string& type, const std::string& file, const std::string& more) {
  return "<shape type=\"" + type + "\"><string name=\"filename\" value=\"" + file + "\"/>" + more +
         "<bsdf type=\"diffuse\"><texture name=\"reflectance\" "
         "type=\"checkerboard\"/></bsdf></shape>";
}

std::array<float, 6> uv_of_face(const Mesh& mesh, size_t face) {
  std::array<float, 6> uv;
  for (size_t k = 0; k < 3; ++k) {
    uv[2 * k] = mesh.uv_places[mesh.uv_ids[face][k]].x;
    uv[2 * k + 1] = mesh.uv_places[mesh.uv_ids[face][k]].y;
  }
  return uv;
}

TEST(OtherScenes, TextureCoordinatesOfFiles) {
  const TempFiles files;
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  const std::string obj =
      files.write("a.obj", corners + "vt 0.25 0.25\nvt 0.5 0.125 7\nf 1/1 2/-1 3/2\nf 1 2 4\n");
  const std::string ply = files.write(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float t\nproperty float s\nelement face 1\nproperty list uchar int "
      "vertex_index\nend_header\n0 0 0 0.5 0.25\n1 0 0 0 1\n0 1 0 2 3\n3 0 1 2\n");
  const Scene scene =
      read(textured("obj", obj, "") +
           textured("obj", obj, "<boolean name=\"flip_tex_coords\" value=\"false\"/>") +
           textured("ply", ply, "") +
           textured("ply", ply, "<boolean name=\"flip_normals\" value=\"true\"/>") +
           "<shape type=\"ply\"><string name=\"filename\" value=\"" + ply + "\"/></shape>");
  using Uv = std::array<float, 6>;
  EXPECT_EQ(uv_of_face(scene.shapes[0].mesh, 0), (Uv{0.25f, 0.75f, 0.5f, 0.875f, 0.5f, 0.875f}));
  EXPECT_EQ(uv_of_face(scene.shapes[1].mesh, 0), (Uv{0.25f, 0.25f, 0.5f, 0.125f, 0.5f, 0.125f}));
  EXPECT_EQ(uv_of_face(scene.shapes[1].mesh, 1), (Uv{}));  // corners without any
  EXPECT_EQ(uv_of_face(scene.shapes[2].mesh, 0), (Uv{0.25f, 0.5f, 1, 0, 3, 2}));
  EXPECT_EQ(uv_of_face(scene.shapes[3].mesh, 0), (Uv{0.25f, 0.5f, 3, 2, 1, 0}));
  EXPECT_TRUE(scene.shapes[4].mesh.uv_ids.empty());  // nothing asks for them
}

// Mitsuba's are barycentric then, from the corner that a file has first.
TEST(OtherScenes, TextureCoordinatesThatAreMissing) {
  const TempFiles files;
  const std::string obj =
      files.write("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n");
  const std::string file = "<shape type=\"obj\"><string name=\"filename\" value=\"" + obj + "\"/>";
  std::vector<std::string> warnings;
  const Scene scene =
      read(textured("obj", obj, "") + "\n" + file +
               "<boolean name=\"flip_normals\" value=\"true\"/><bsdf type=\"roughconductor\">"
               "<float name=\"alpha_u\" value=\"0.1\"/><float name=\"alpha_v\" value=\"0.3\"/>"
               R"(</bsdf><transform name="to_world"><translate z="2"/></transform></shape>)" +
               file + R"(<transform name="to_world"><translate z="1"/></transform></shape>)",
           &warnings);
  using Uv = std::array<float, 6>;
  for (size_t face = 0; face < 2; ++face) {
    EXPECT_EQ(scene.shapes[0].mesh.uv_source, UvSource::kFaces);
    EXPECT_EQ(uv_of_face(scene.shapes[0].mesh, face), (Uv{0, 0, 1, 0, 0, 1}));
    EXPECT_EQ(uv_of_face(scene.shapes[1].mesh, face), (Uv{0, 0, 0, 1, 1, 0}));
  }
  EXPECT_EQ(scene.shapes[2].mesh.uv_source, UvSource::kNone);
  const std::string end = "\": each face has its barycentric coordinates, as in Mitsuba";
  EXPECT_EQ(warnings,
            (std::vector<std::string>{"string:2:1: warning: no texture coordinates in " + obj +
                                          ", needed by the texture of \"reflectance" + end,
                                      "string:3:1: warning: no texture coordinates in " + obj +
                                          ", needed by the directions of \"alpha_u" + end}));
}

TEST(OtherScenes, TextureCoordinatesThatCannotBe) {
  const TempFiles files;
  for (const char* number : {"nan", "inf", "1e38", "-1e300"}) {
    const std::string obj = files.write(
        "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 " + std::string(number) + "\nf 1/1 2/1 3/1\n");
    EXPECT_EQ(message_of(textured("obj", obj, "")),
              obj + ": error: texture coordinate 0 (counted from 0) is not finite or beyond 1e9");
    EXPECT_EQ(
        message_of("<shape type=\"obj\"><string name=\"filename\" value=\"" + obj + "\"/></shape>"),
        "no error");
  }
}

TEST(OtherScenes, Cylinders) {
  const Scene scene = read(
      "<shape type=\"cylinder\"><point name=\"p0\" value=\"1,2,3\"/><point name=\"p1\" "
      "value=\"1,6,3\"/><float name=\"radius\" value=\"0.5\"/></shape>"
      "<shape type=\"cylinder\"><boolean name=\"flip_normals\" value=\"true\"/></shape>");
  const Mesh& mesh = scene.shapes[0].mesh;
  double area = 0;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto c = face_corners<double>(mesh, FaceId(f));
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    area += 0.5 * length(n);
    EXPECT_GT(dot(n, c[0] - Vec3d{1, c[0].y, 3}), 0);
  }
  EXPECT_NEAR(area, 2 * kPi * 0.5 * 4, 1e-3 * area);
  for (const Vec3f& p : mesh.positions) {
    EXPECT_NEAR(std::hypot(p.x - 1, p.z - 3), 0.5, 1e-6);
    EXPECT_TRUE(p.y == 2 || p.y == 6);
  }
  const Mesh& inside = scene.shapes[1].mesh;
  EXPECT_LT(dot(inside.normals[inside.normal_ids[0][0]],
                cast<double>(inside.positions[inside.faces[0][0]])),
            0);
  EXPECT_NE(message_of("<shape type=\"cylinder\"><point name=\"p1\" value=\"0,0,0\"/></shape>")
                .find("shape \"cylinder\": p0 and p1 coincide"),
            std::string::npos);
}

}  // namespace
}  // namespace limn
