#pragma once
// The program as a user meets it: commands, exit statuses, what they print and write. The target's
// LIMN_PROGRAM is its file; `run` takes another one from the environment's LIMN_PROGRAM.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "limn/core/image.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {

using nlohmann::json;

struct Outcome {
  int status;
  std::string text;  // both streams
};

inline Outcome call(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  Outcome outcome{-1, ""};
  if (!pipe) return outcome;
  std::array<char, 4096> buffer;
  while (const size_t size = fread(buffer.data(), 1, buffer.size(), pipe)) {
    outcome.text.append(buffer.data(), size);
  }
  const int status = pclose(pipe);
  outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

// environment: as a shell takes it before a command, "NAME=VALUE ".
inline Outcome run(const std::string& arguments, const std::string& environment = "") {
  const char* other = std::getenv("LIMN_PROGRAM");
  return call(environment + (other ? other : LIMN_PROGRAM) + " " + arguments);
}

// The outcome of a command to which a second one is sent ("kill $!") when it has worked for a
// second of processor time: whatever else the machine does, it listens to signals then.
inline Outcome call_and_send(const std::string& command, const std::string& signals) {
  return call("{ " + command +
              " & while set -- $(cat /proc/$!/stat); [ $3 != Z ] && [ ${14} -lt 100 ]; do sleep "
              "0.05; done; " +
              signals + "; wait $!; }");
}

inline std::string bytes_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

// "" if the image has none of this name.
inline std::string attribute_of(const std::string& file, const std::string& name) {
  for (const ImageAttribute& a : read_exr_attributes(file)) {
    if (a.name == name) return a.value;
  }
  return "";
}

class Program : public testing::Test {
 protected:
  Program() {
    SceneParts parts;
    parts.width = parts.height = 8;
    parts.body = R"(  <default name="glow" value="6, 5, 4"/>
)" + square("floor", 2.5, -90, {0, 0, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
                 square("screen", 0.8, 50, {0.2, 0.9, 0}, diffuse("paper", "0.8, 0.8, 0.8")) +
                 square("lamp", 0.5, 90, {0.3, 2.4, 0.5}, area_light("blaze", "$glow"));
    scene_ = files_.write("scene.xml", scene_text(parts));
  }
  std::string out() const { return files_.path("out.exr"); }
  // The message of a run that must fail for bad input.
  std::string refused(const std::string& arguments) const {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.status, 2) << arguments << "\n" << outcome.text;
    return outcome.text;
  }

  TempFiles files_;
  std::string scene_;
};

inline json read_json(const std::string& file) {
  std::ifstream stream(file);
  return json::parse(stream);
}

}  // namespace limn
