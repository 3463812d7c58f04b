// The exact message of every kind of mistake in a scene file.
#include <gtest/gtest.h>

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
    EXPECT_STREQ(error.what(), "no/such.xml: error: cannot read the file");
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
