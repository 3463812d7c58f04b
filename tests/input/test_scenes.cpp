// Every scene of scenes/ and scenes/gallery/ is read and differentiated; what its comment promises
// holds.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>
#include <vector>

#include "limn/core/parameter.h"
#include "limn/edgetree/edges.h"
#include "limn/integrators/gradient.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> scene_files() {
  std::vector<std::string> files;
  for (const char* folder : {LIMN_SOURCE_DIR "/scenes", LIMN_SOURCE_DIR "/scenes/gallery"}) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() == ".xml") files.push_back(entry.path().string());
    }
  }
  std::ranges::sort(files);
  return files;
}

std::string text_of(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

class SceneFile : public testing::TestWithParam<std::string> {
 protected:
  SceneFile() : text_(text_of(GetParam())) {}

  // Small, and with the meshes and skies of this build, wherever it is.
  std::map<std::string, std::string> defines() const {
    std::map<std::string, std::string> values = {{"width", "8"}, {"height", "8"}, {"spp", "1"}};
    for (const auto& [name, value] : defaults()) {
      if (value.find("../build/generated/") != std::string::npos) {
        values[name] = LIMN_GENERATED_DIR "/" + fs::path(value).filename().string();
      }
    }
    return values;
  }
  // A file of a Debian package that is not here; "" if there is none.
  std::string missing_file() const {
    for (const auto& [name, value] : defaults()) {
      if (value.starts_with("/usr/share/") && !fs::exists(value)) return value;
    }
    return "";
  }
  bool promises(const std::string& words) const { return text_.find(words) != std::string::npos; }

  std::string text_;

 private:
  std::map<std::string, std::string> defaults() const {
    static const std::regex pattern(R"re(<default name="([^"]*)" value="([^"]*)"/>)re");
    std::map<std::string, std::string> values;
    for (std::sregex_iterator match(text_.begin(), text_.end(), pattern), end; match != end;
         ++match) {
      values[(*match)[1]] = (*match)[2];
    }
    return values;
  }
};

TEST_P(SceneFile, HasAMainParameterWithADerivative) {
  if (const std::string file = missing_file(); !file.empty()) GTEST_SKIP() << file;
  std::smatch main;
  ASSERT_TRUE(std::regex_search(text_, main, std::regex(R"(Main parameter:\s+(\S+?)\.?\s)")));
  std::vector<std::string> warnings;
  const Scene scene = read_scene(GetParam(), defines(), &warnings);
  EXPECT_EQ(warnings, std::vector<std::string>{});
  GradientOptions options;
  options.parameters = {main[1]};
  RunSettings settings;
  settings.spp = 1;
  const GradientResult result = gradient(scene, options, settings);
  EXPECT_EQ(result.non_finite.count, 0u) << result.non_finite.message();
  double magnitude = 0;
  const Moments& total = result.parameters[0].total;
  for (size_t i = 0; i < total.size(); ++i) magnitude += std::fabs(total.mean(i));
  EXPECT_GT(magnitude, 0);
}

// All of the points lie beyond one side of the film.
bool is_out_of_view(const Camera& camera, const std::vector<Vec3d>& points) {
  const double w = camera.width;
  const double h = camera.height;
  const std::array<Vec3d, 4> corners = {
      camera.ray<double>(0, 0).direction, camera.ray<double>(w, 0).direction,
      camera.ray<double>(w, h).direction, camera.ray<double>(0, h).direction};
  const Vec3d pinhole = value(camera.origin);
  for (int i = 0; i < 4; ++i) {
    const Vec3d outward = cross(corners[(i + 1) % 4], corners[i]);
    // +1 if the opposite corner is behind the side, as it is in a right-handed frame.
    const double side = dot(outward, corners[(i + 2) % 4]) < 0 ? 1 : -1;
    if (std::ranges::all_of(points,
                            [&](const Vec3d& p) { return dot(outward, p - pinhole) * side > 0; })) {
      return true;
    }
  }
  return false;
}

// Whichever of the generated meshes it shows.
TEST_P(SceneFile, KeepsOutOfViewWhatItSaysIs) {
  if (!promises("out of view")) return;
  int objects = 0;
  for (const auto& entry : fs::directory_iterator(LIMN_GENERATED_DIR)) {
    if (entry.path().extension() != ".ply") continue;
    std::map<std::string, std::string> values = defines();
    values["mesh"] = entry.path().string();
    const Scene scene = read_scene(GetParam(), values, nullptr);
    for (const Shape& shape : scene.shapes) {
      if (shape.id == "floor") continue;
      std::vector<Vec3d> points;
      for (const Vec3f& p : shape.mesh.positions) points.push_back(cast<double>(p));
      EXPECT_TRUE(is_out_of_view(scene.camera, points)) << shape.id << ", " << entry.path();
      objects += shape.id == "object";
    }
  }
  EXPECT_GE(objects, 9);
}

TEST_P(SceneFile, SaysWhatToDoWithoutTheBuildsFiles) {
  if (!promises("<default name=\"mesh\"")) return;
  std::map<std::string, std::string> values = defines();
  values["mesh"] = "../build/generated/no_such_mesh.ply";
  try {
    read_scene(GetParam(), values, nullptr);
    FAIL();
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("filename: no such file: \"../build/generated/no_such_mesh.ply\""
                        " (the build makes it: run tools/build)"),
              std::string::npos)
        << text;
  }
}

INSTANTIATE_TEST_SUITE_P(, SceneFile, testing::ValuesIn(scene_files()),
                         [](const auto& test) { return fs::path(test.param).stem().string(); });

}  // namespace
}  // namespace limn
