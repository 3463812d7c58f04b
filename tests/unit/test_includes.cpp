// Who may include whom: the folders' order, and one door for every third party.
#include <gtest/gtest.h>

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
      "limn/edgetree/",     "limn/core/mesh.h",  "limn/core/vec.h",   "limn/core/dual.h",
      "limn/core/rng.h",    "limn/core/lobe.h",  "limn/core/error.h", "limn/core/parallel.h",
      "limn/core/bounds.h", "limn/core/check.h", "limn/core/names.h"};
  EXPECT_EQ(strays("edgetree", allowed), Strings{});
  EXPECT_EQ(strays("include/limn/edgetree", allowed), Strings{});
}

// The rooms of edgetree, each on top of what stands before it: nothing runs back up, nor sideways.
TEST(Includes, RoomsOfEdgetreeInOrder) {
  const std::map<std::string, std::set<std::string>> below = {
      {"edges", {}},
      {"lobe", {}},
      {"light", {}},
      {"rejection", {}},
      {"baselines", {"lobe"}},
      {"forest", {"edges", "lobe", "light"}},
  };
  for (const auto& [room, allowed] : below) {
    for (const Include& include : includes_below("edgetree/" + room)) {
      if (!include.path.starts_with("edgetree/")) continue;
      const std::string rest = include.path.substr(std::string("edgetree/").size());
      const std::string other = rest.substr(0, rest.find('/'));
      EXPECT_TRUE(rest == "simd.h" || other == room || allowed.contains(other))
          << include.file << " includes " << include.path;
    }
  }
}

// Headers inside src, edgetree, integrators and tools are private to that folder and named by their
// path from the repository's root. tools/fit_ltc is a part of edgetree's source (it writes a table
// that edgetree compiles in) and stands apart.
TEST(Includes, PrivateHeadersStayInTheirFolder) {
  for (const std::string folder : {"include", "src", "edgetree", "integrators", "tools"}) {
    for (const Include& include : includes_below(folder)) {
      if (include.angled || include.path.starts_with("limn/")) continue;
      if (include.file.starts_with("tools/fit_ltc/")) continue;
      EXPECT_TRUE(include.path.starts_with(folder + "/") &&
                  fs::exists(fs::path(LIMN_SOURCE_DIR) / include.path))
          << include.file << " includes " << include.path;
    }
  }
}

// In src, edgetree and integrators every library but fmt and Eigen is included by one .cpp.
TEST(Includes, OneDoorPerThirdParty) {
  const std::map<std::string, std::regex> libraries = {
      {"Embree", std::regex("^embree[34]/.*")},
      {"OpenEXR", std::regex("^(Imf|Iex|half\\.h|OpenEXR/).*")},
      {"libpng", std::regex("^png.*")},
      {"tinyobjloader", std::regex("^tiny_obj_loader.*")},
      {"pugixml", std::regex("^pugixml.*")},
      {"TBB", std::regex("^(oneapi/)?tbb/.*")},
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
  for (const char* library : {"Embree", "OpenEXR", "libpng", "tinyobjloader", "pugixml", "TBB"}) {
    ASSERT_EQ(doors[library].size(), 1u) << library;
  }
  for (const auto& [library, files] : doors) {
    for (const std::string& file : files) {
      EXPECT_EQ(files.size(), 1u) << library << " in " << file;
      EXPECT_TRUE(file.ends_with(".cpp")) << library << " in " << file;
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

}  // namespace
