// Who may include whom: the order of folders, rooms and contracts, one door for every third party;
// and how files begin.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

struct Include {
  std::string file;  // from the repository's root
  std::string path;  // as written
  bool angled;
};

std::vector<Include> includes_below(const std::string& folder) {
  static const std::regex pattern(R"re(^\s*#\s*include\s*([<"])([^>"]+)[>"])re");
  std::vector<Include> includes;
  const fs::path root(LIMN_SOURCE_DIR);
  for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
    const auto ending = entry.path().extension();
    if (ending != ".h" && ending != ".cpp") continue;
    std::ifstream stream(entry.path());
    std::smatch match;
    for (std::string line; std::getline(stream, line);) {
      if (!std::regex_search(line, match, pattern)) continue;
      includes.push_back(
          {fs::relative(entry.path(), root).string(), match[2].str(), match[1].str() == "<"});
    }
  }
  return includes;
}

bool starts_with_any(const std::string& path, const std::vector<std::string>& prefixes) {
  for (const std::string& prefix : prefixes) {
    if (path.starts_with(prefix)) return true;
  }
  return false;
}

// Includes of limn's own headers from `folder` that lie in none of `allowed`.
std::vector<std::string> strays(const std::string& folder,
                                const std::vector<std::string>& allowed) {
  std::vector<std::string> found;
  for (const Include& include : includes_below(folder)) {
    if (!include.path.starts_with("limn/") || starts_with_any(include.path, allowed)) continue;
    found.push_back(include.file + " includes " + include.path);
  }
  return found;
}

using Strings = std::vector<std::string>;

TEST(Includes, NothingPointsUpward) {
  EXPECT_EQ(strays("include/limn/core", {"limn/core/"}), Strings{});
  EXPECT_EQ(strays("src", {"limn/core/"}), Strings{});
  EXPECT_EQ(strays("include/limn/edgetree", {"limn/core/", "limn/edgetree/"}), Strings{});
  EXPECT_EQ(strays("edgetree", {"limn/core/", "limn/edgetree/"}), Strings{});
  EXPECT_EQ(strays("include/limn/integrators", {"limn/"}), Strings{});
}

// Edges and their samplers know meshes, numbers and a summary of a lobe: no scene, surface, light,
// film, image or ray.
TEST(Includes, EdgetreeSeesNoScene) {
  const std::vector<std::string> allowed = {
      "limn/edgetree/",     "limn/core/mesh.h",     "limn/core/vec.h",     "limn/core/dual.h",
      "limn/core/rng.h",    "limn/core/lobe.h",     "limn/core/error.h",   "limn/core/parallel.h",
      "limn/core/bounds.h", "limn/core/check.h",    "limn/core/names.h",   "limn/core/box_tree.h",
      "limn/core/touch.h",  "limn/core/settings.h", "limn/core/prefetch.h"};
  EXPECT_EQ(strays("edgetree", allowed), Strings{});
  EXPECT_EQ(strays("include/limn/edgetree", allowed), Strings{});
}

// Headers inside src, edgetree, integrators and tools are private to that folder and named by their
// path from the repository's root. tools/fit_ltc is a part of edgetree's source (it writes a table
// that edgetree compiles in) and stands apart.
TEST(Includes, PrivateHeadersStayInTheirFolder) {
  for (const std::string folder : {"include", "src", "edgetree", "integrators", "tools"}) {
    for (const Include& include : includes_below(folder)) {
      if (include.angled || include.path.starts_with("limn/")) continue;
      // What the library is made with, and what measures its parts.
      if (starts_with_any(include.file, {"tools/fit_ltc/", "tools/benchmark/"})) continue;
      EXPECT_TRUE(include.path.starts_with(folder + "/") &&
                  fs::exists(fs::path(LIMN_SOURCE_DIR) / include.path))
          << include.file << " includes " << include.path;
    }
  }
}

// The rooms of a folder, lowest first. A file includes private headers of its own room, of rooms
// before it and of the folder's top; what lies at the top (registries) includes all.
struct Rooms {
  std::string folder;
  Strings rooms;
};
const std::vector<Rooms>& all_rooms() {
  static const std::vector<Rooms> rooms = {
      {"src",
       {"base", "regions", "mesh", "image", "texture", "bsdf", "light", "rays", "scene",
        "scene_file"}},
      {"edgetree",
       {"edges", "lobe", "light", "bounds", "forest", "quadric", "baselines", "rejection"}},
      {"integrators",
       {"estimates", "edges", "lights", "contours", "paths", "film", "terms", "pilot", "methods",
        "interpolation", "backward", "fit", "compare"}},
  };
  return rooms;
}

std::string room_of(const std::string& path) {
  const size_t first = path.find('/'), second = path.find('/', first + 1);
  return second == path.npos ? "" : path.substr(first + 1, second - first - 1);
}

size_t rank(const Strings& order, const std::string& name) {
  return std::find(order.begin(), order.end(), name) - order.begin();
}

TEST(Includes, NothingRunsBackUpBetweenRooms) {
  for (const auto& [folder, rooms] : all_rooms()) {
    for (const Include& include : includes_below(folder)) {
      const std::string from = room_of(include.file);
      if (from.empty()) continue;
      EXPECT_LT(rank(rooms, from), rooms.size()) << include.file << ": an unknown room";
      if (!include.path.starts_with(folder + "/")) continue;
      const std::string to = room_of(include.path);
      if (to.empty()) continue;
      EXPECT_LE(rank(rooms, to), rank(rooms, from)) << include.file << " includes " << include.path;
    }
  }
}

// The contracts of limn/core, lowest first: each includes only earlier ones. A room of src sees
// contracts up to the one given.
const Strings kContracts = {"check.h",
                            "prefetch.h",
                            "huge_pages.h",
                            "renew.h",
                            "error.h",
                            "memory.h",
                            "output_file.h",
                            "vec.h",
                            "dual.h",
                            "tape.h",
                            "var.h",
                            "rng.h",
                            "discrete_distribution.h",
                            "names.h",
                            "settings.h",
                            "ids.h",
                            "parallel.h",
                            "bounds.h",
                            "box_tree.h",
                            "touch.h",
                            "matrix.h",
                            "visible_regions.h",
                            "shadow_outlines.h",
                            "shared_vector.h",
                            "tangents.h",
                            "mesh.h",
                            "surface_lift.h",
                            "tangent.h",
                            "normals_adjoint.h",
                            "lobe.h",
                            "parameter_ref.h",
                            "texel_map.h",
                            "texture.h",
                            "mesh_attribute.h",
                            "bsdf_value.h",
                            "bsdf.h",
                            "make_bsdf.h",
                            "properties.h",
                            "image.h",
                            "film.h",
                            "camera.h",
                            "light.h",
                            "framed_light.h",
                            "environment.h",
                            "mis_compensation.h",
                            "scene.h",
                            "exposure.h",
                            "camera_pose.h",
                            "coverage.h",
                            "slots.h",
                            "duplicate_faces.h",
                            "ray_tracer.h",
                            "blur.h",
                            "blur_tracer.h",
                            "face_overlaps.h",
                            "face_tree.h",
                            "surface_point.h",
                            "textures_at.h",
                            "shading.h",
                            "light_tree.h",
                            "lights.h",
                            "reverse.h",
                            "parameter.h"};
const std::map<std::string, std::string> kSeenFrom = {
    {"base", "properties.h"},  {"regions", "shadow_outlines.h"}, {"mesh", "normals_adjoint.h"},
    {"image", "film.h"},       {"texture", "image.h"},           {"bsdf", "properties.h"},
    {"light", "lights.h"},     {"rays", "face_tree.h"},          {"scene", "parameter.h"},
    {"scene_file", "lights.h"}};

TEST(Includes, ContractsOfCoreStandInOrder) {
  const std::string core = "limn/core/";
  for (const std::string folder : {"include/limn/core", "src"}) {
    for (const Include& include : includes_below(folder)) {
      if (!include.path.starts_with(core)) continue;
      const size_t to = rank(kContracts, include.path.substr(core.size()));
      const std::string name = fs::path(include.file).filename().string();
      const size_t from = folder == "src" ? rank(kContracts, kSeenFrom.at(room_of(include.file)))
                                          : rank(kContracts, name);
      EXPECT_LT(from, kContracts.size()) << include.file << ": give it a place in kContracts";
      EXPECT_LE(to, from) << include.file << " includes " << include.path;
    }
  }
}

// Its macros have names that other libraries have too.
TEST(Includes, NoPublicHeaderIncludesCheck) {
  for (const Include& include : includes_below("include")) {
    EXPECT_NE(include.path, "limn/core/check.h") << include.file;
  }
}

// In src, edgetree and integrators every library but fmt and Eigen is included by one .cpp.
TEST(Includes, OneDoorPerThirdParty) {
  const std::map<std::string, std::regex> libraries = {
      {"Embree", std::regex("^embree[34]/.*")},
      {"OpenEXR", std::regex("^(Imf|Iex|half\\.h|openexr|OpenEXR/).*")},
      {"libpng", std::regex("^png.*")},
      {"libjpeg", std::regex("^(jpeglib|jerror).*")},
      {"zlib", std::regex("^zlib.*")},
      {"pugixml", std::regex("^pugixml.*")},
      {"tinyobjloader", std::regex("^tiny_obj_loader.*")},
      {"TBB", std::regex("^(oneapi/)?tbb/.*")},
      {"OpenMesh", std::regex("^OpenMesh/.*")},
      {"CLP", std::regex("^(coin/|Clp|Coin).*")},
  };
  std::map<std::string, std::set<std::string>> doors;
  for (const char* folder : {"include", "src", "edgetree", "integrators", "tools"}) {
    for (const Include& include : includes_below(folder)) {
      for (const auto& [library, pattern] : libraries) {
        if (std::regex_match(include.path, pattern)) doors[library].insert(include.file);
      }
    }
  }
  for (const char* library :
       {"Embree", "OpenEXR", "libjpeg", "libpng", "pugixml", "TBB", "tinyobjloader", "zlib"}) {
    ASSERT_EQ(doors[library].size(), 1u) << library;
  }
  for (const auto& [library, files] : doors) {
    for (const std::string& file : files) {
      EXPECT_EQ(files.size(), 1u) << library << " in " << file;
      EXPECT_TRUE(file.ends_with(".cpp")) << library << " in " << file;
    }
  }
}

// The Python module is nanobind's door, and sees what any program outside sees.
TEST(Includes, PythonBindsContractsAlone) {
  for (const char* folder : {"include", "src", "edgetree", "integrators", "tools", "tests"}) {
    for (const Include& include : includes_below(folder)) {
      const bool bindings = include.file.starts_with("tools/python/");
      EXPECT_TRUE(bindings || !include.path.starts_with("nanobind")) << include.file;
      if (!bindings || include.angled) continue;
      EXPECT_TRUE(include.path.starts_with("limn/") || include.path.starts_with("tools/python/"))
          << include.file << " includes " << include.path;
    }
  }
}

TEST(Includes, HeadersAreGuardedByPragmaOnce) {
  const fs::path root(LIMN_SOURCE_DIR);
  for (const char* folder : {"include", "src", "edgetree", "integrators", "tools", "tests"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      if (entry.path().extension() != ".h") continue;
      std::ifstream stream(entry.path());
      std::string first;
      std::getline(stream, first);
      EXPECT_EQ(first, "#pragma once") << entry.path();
    }
  }
}

// Folders whose every .cpp opens with a line that says what it is for.
const Strings kOpened = {"src", "edgetree", "integrators", "tools", "tests"};

TEST(Includes, SourcesOpenWithTheirPurpose) {
  const fs::path root(LIMN_SOURCE_DIR);
  for (const std::string& folder : kOpened) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      if (entry.path().extension() != ".cpp") continue;
      std::ifstream stream(entry.path());
      std::string first;
      std::getline(stream, first);
      EXPECT_TRUE(first.starts_with("// ") && first.size() > 12) << entry.path();
    }
  }
}

}  // namespace
