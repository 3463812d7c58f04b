// The exact message of every kind of mistake in a scene file.
#include <gtest/gtest.h>

#include <algorithm>

#include "limn/core/memory.h"
#include "limn/core/scene.h"
#include "support/temp_files.h"

namespace limn {
namespace {

using Defines = std::map<std::string, std::string>;

// What read_scene says of a file with this content, the file's directory replaced by "@".
std::string message_of(const TempFiles& files, const std::string& content, const Defines& defines) {
  const std::string file = files.write("s.xml", content);
  try {
    read_scene(file, defines, nullptr);
  } catch (const InputError& error) {
    std::string text = error.what();
    const std::string directory = std::filesystem::path(file).parent_path().string();
    for (size_t at; (at = text.find(directory)) != text.npos;) {
      text.replace(at, directory.size(), "@");
    }
    return text;
  }
  return "no error";
}

struct Mistake {
  std::string name;
  std::string content;
  std::string message;
};
std::ostream& operator<<(std::ostream& out, const Mistake& mistake) {
  return out << mistake.content;
}

// Line 1 is <scene>, line 2 a sensor; the body begins in line 3.
std::string scene(const std::string& body) {
  return "<scene version=\"3.0.0\">\n<sensor type=\"perspective\"/>\n" + body + "\n</scene>\n";
}
std::string sensor(const std::string& body) {
  return "<scene version=\"3.0.0\">\n<sensor type=\"perspective\">\n" + body +
         "\n</sensor>\n</scene>\n";
}
std::string shape(const std::string& body) {
  return scene("<shape type=\"cube\">\n" + body + "\n</shape>");
}
std::string transform(const std::string& body) {
  return shape("<transform name=\"to_world\">\n" + body + "\n</transform>");
}

// `text` so often, with the number from 0 for "#" and the next for "@".
std::string repeated(int count, const std::string& text) {
  std::string all;
  for (int i = 0; i < count; ++i) {
    for (const char c : text) {
      all += c == '#' ? std::to_string(i) : c == '@' ? std::to_string(i + 1) : std::string(1, c);
    }
  }
  return all;
}

const std::vector<Mistake>& mistakes() {
  static const std::vector<Mistake> all = {
#include "bad_scenes.inc"
  };
  return all;
}

class BadScene : public testing::TestWithParam<Mistake> {};

TEST_P(BadScene, SaysWhatAndWhere) {
  const TempFiles files;
  files.write("empty.xml", "<scene version=\"3.0.0\"></scene>");
  files.write("loop.xml", "<scene version=\"3.0.0\"><include filename=\"loop.xml\"/></scene>");
  EXPECT_EQ(message_of(files, GetParam().content, {}), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(All, BadScene, testing::ValuesIn(mistakes()),
                         [](const auto& c) { return c.param.name; });

TEST(BadScene, MissingFile) {
  try {
    read_scene("no/such.xml", {}, nullptr);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "no/such.xml: error: cannot read: No such file or directory");
  }
}

TEST(BadScene, UnusedDefine) {
  const TempFiles files;
  const std::string content = scene("<default name=\"res\" value=\"4\"/>");
  EXPECT_EQ(message_of(files, content, {{"rez", "8"}}),
            "@/s.xml: error: -D rez=8: the scene has no parameter \"$rez\" (known: res)");
}

TEST(BadScene, DefineOfAWrongType) {
  const TempFiles files;
  const std::string content =
      scene("<integrator type=\"path\"><integer name=\"max_depth\" value=\"$d\"/></integrator>");
  EXPECT_EQ(message_of(files, content, {{"d", "deep"}}),
            "@/s.xml:3:51: error: <integer>: value must be an integer, not \"deep\"");
  EXPECT_EQ(message_of(files, content, {{"d", "3"}}), "no error");
}

// What a run asks of memory is said before it is taken. (What is free is the machine's affair.)
TEST(BadScene, FilmBeyondMemory) {
  const SourceLocation where{"s.xml", 3, 1};
  try {
    require_memory(where, 1e18, "the film", "lower width");
    FAIL();
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_EQ(text.rfind("s.xml:3:1: error: the film takes 1000000000.0 GB of memory, and ", 0), 0u)
        << text;
    EXPECT_TRUE(text.ends_with(" GB are free: lower width")) << text;
  }
  EXPECT_NO_THROW(require_memory(where, 1, "", ""));
  EXPECT_GT(free_memory(), 0);
}

// In the order of the readers' passes; lists of what is known are cut out.
TEST(BadScene, IndependentMistakesAreReportedTogether) {
  const TempFiles files;
  const std::string content = scene(
      "<shape type=\"cube\"><float name=\"a\" value=\"1\"/><float name=\"b\" value=\"1\"/>\n"
      "<bsdf type=\"hair\"/><emitter type=\"sun\"/></shape>\n"
      "<shape type=\"ply\"><string name=\"filename\" value=\"a.ply\"/></shape>\n"
      "<shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/><ref id=\"steel\"/></shape>\n"
      "<bsdf type=\"mask\"><ref id=\"wood\"/><bsdf type=\"fur\"/><bsdf type=\"silk\"/></bsdf>\n"
      "<volume type=\"fog\"/>");
  std::string message = message_of(files, content, {{"q", "1"}, {"s", "2"}});
  for (size_t at; (at = message.find(" (")) != message.npos;) {
    message.erase(at, message.find(')', at) + 1 - at);
  }
  EXPECT_EQ(message,
            "@/s.xml:6:43: error: undefined parameter \"$r\"\n"
            "@/s.xml: error: -D q=1: the scene has no parameter \"$q\"\n"
            "@/s.xml: error: -D s=2: the scene has no parameter \"$s\"\n"
            "@/s.xml:8:1: error: <scene>: unknown element <volume>; limn has no volumes\n"
            "@/s.xml:6:60: error: there is no object with the id \"steel\"\n"
            "@/s.xml:7:24: error: there is no object with the id \"wood\"\n"
            "@/s.xml:4:1: error: unknown bsdf type \"hair\"\n"
            "@/s.xml:4:20: error: unknown type \"sun\" of an emitter inside a shape\n"
            "@/s.xml:3:20: error: shape \"cube\": unknown parameter \"a\"\n"
            "@/s.xml:3:47: error: shape \"cube\": unknown parameter \"b\"\n"
            "@/s.xml:5:19: error: shape \"ply\": filename: no such file: \"a.ply\"\n"
            "@/s.xml:7:35: error: unknown bsdf type \"fur\"\n"
            "@/s.xml:7:53: error: unknown bsdf type \"silk\"\n"
            "13 errors");
}

TEST(BadScene, MistakesOfSensorFilmAndSamplerAreReportedTogether) {
  const TempFiles files;
  std::string message =
      message_of(files,
                 scene("<sensor type=\"perspective\"><float name=\"fovv\" value=\"30\"/>\n"
                       "<film type=\"hdrfilm\"><integer name=\"widht\" value=\"3\"/></film>\n"
                       "<sampler type=\"halton\"/></sensor>"),
                 {});
  for (size_t at; (at = message.find(" (")) != message.npos;) {
    message.erase(at, message.find(')', at) + 1 - at);
  }
  EXPECT_EQ(message,
            "@/s.xml:4:22: error: film \"hdrfilm\": unknown parameter \"widht\"\n"
            "@/s.xml:5:1: error: unknown sampler type \"halton\"\n"
            "@/s.xml:3:28: error: sensor \"perspective\": unknown parameter \"fovv\"\n"
            "3 errors");
}

// Whatever refers to an object that failed, directly or by others, has no error of its own.
TEST(BadScene, WhatFollowsFromAMistakeIsNotReported) {
  const TempFiles files;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"<bsdf type=\"hair\" id=\"a\"/><shape type=\"cube\"><ref id=\"a\"/></shape>"
       "<bsdf type=\"twosided\"><ref id=\"a\"/></bsdf><alias id=\"a\" as=\"b\"/>"
       "<shape type=\"cube\"><ref id=\"b\"/></shape>",
       "3:1: error: unknown bsdf type"},
      {"<volume type=\"fog\" id=\"a\"><bsdf type=\"diffuse\" id=\"b\"/></volume>"
       "<shape type=\"cube\"><ref id=\"a\"/></shape><shape type=\"cube\"><ref id=\"b\"/></shape>",
       "3:1: error: <scene>: unknown element"},
      {"<shape type=\"cube\"><ref id=\"a\"/></shape><shape type=\"cube\"><ref id=\"a\"/></shape>",
       "3:25: error: there is no object"},
      {"<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"crop_width\" "
       "value=\"$w\"/><integer name=\"width\" value=\"1\"/></film></sensor>",
       "3:76: error: undefined parameter"},
      {"<include filename=\"no.xml\"/><shape type=\"$t\"/><shape type=\"cube\"><ref "
       "id=\"a\"/></shape>",
       "3:10: error: no such file"},
      {"<path value=\"no\"/><include filename=\"no.xml\"/><shape type=\"torus\"/>",
       "3:7: error: no such directory"},
      {"<shape type=\"shapegroup\" id=\"g\"><shape type=\"torus\"/></shape>"
       "<shape type=\"instance\"><ref id=\"g\"/></shape><shape type=\"instance\"><ref "
       "id=\"g\"/></shape>",
       "3:33: error: unknown shape type"},
  };
  for (const auto& [body, begin] : cases) {
    const std::string message = message_of(files, scene(body), {});
    EXPECT_EQ(message.find("@/s.xml:" + begin), 0u) << message;
    EXPECT_EQ(message.find('\n'), message.npos) << message;
  }
  EXPECT_EQ(message_of(files, "<scene version=\"3.0.0\"><sensor type=\"fisheye\"/></scene>", {}),
            "@/s.xml:1:24: error: unknown sensor type \"fisheye\" (known: batch, orthographic, "
            "perspective, thinlens)");
}

TEST(BadScene, TwentyMistakesAreEnough) {
  const TempFiles files;
  for (const std::string& body :
       {repeated(30, "<film type=\"#\" size=\"1\"/>\n"),
        repeated(30, "<shape type=\"cube\"><bsdf type=\"#\"/></shape>\n"),
        "<bsdf type=\"diffuse\">" + repeated(30, "<float name=\"a#\" value=\"1\"/>\n") +
            "</bsdf>"}) {
    const std::string message = message_of(files, scene(body), {});
    EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 20) << message;
    EXPECT_TRUE(message.ends_with("\n20 errors, and what follows is not read")) << message;
  }
}

// Mistakes inside nested elements must never be taken for a valid scene, however a valid file is
// cut short.
TEST(BadScene, EveryTruncationIsAnError) {
  const TempFiles files;
  const std::string content = scene(
      "<shape type=\"cube\" id=\"a\"><boolean name=\"flip_normals\" value=\"true\"/>"
      "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>");
  ASSERT_EQ(message_of(files, content, {}), "no error");
  const size_t end = content.rfind("</scene>") + 8;
  for (size_t size = 0; size < end; ++size) {
    EXPECT_NE(message_of(files, content.substr(0, size), {}), "no error") << size;
  }
}

}  // namespace
}  // namespace limn
