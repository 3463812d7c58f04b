// The program as a user meets it: exit statuses and messages.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "limn/core/image.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

using nlohmann::json;

struct Outcome {
  int status;
  std::string text;  // both streams
};

Outcome call(const std::string& command) {
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
Outcome run(const std::string& arguments, const std::string& environment = "") {
  return call(environment + LIMN_PROGRAM + " " + arguments);
}

std::string bytes_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

// "" if the image has none of this name.
std::string attribute_of(const std::string& file, const std::string& name) {
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

// An array's files: a mesh, and a field that gradient takes.
// The same bits with and without a break; what was asked is in the folder.
TEST_F(Program, FitsAndGoesOn) {
  const std::string target = files_.path("target.exr"), truth = files_.path("ball.obj");
  write_mesh(files_, "ball.obj", icosphere_mesh(1));
  ASSERT_EQ(run("render " + scene_ + " -D glow=3 --spp 4 -o " + target).status, 0);
  const std::string whole = files_.path("whole"), broken = files_.path("broken");
  const std::string fit = "fit " + scene_ + " --target " + target +
                          " --wrt screen.vertex_positions --wrt blaze.radiance --spp 2 --seed 3 "
                          "--no-report --bounds blaze.radiance=0,7 --view '" +
                          scene_ + ";glow=4' --target " + target + " --truth " + truth;
  const Outcome outcome = run(fit + " --steps 4 --snapshots 2 -o " + whole);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("step 4: loss "), std::string::npos) << outcome.text;
  ASSERT_EQ(run(fit + " --steps 3 --threads 2 -o " + broken).status, 0);
  ASSERT_EQ(run("fit --steps 4 --no-report --resume " + broken).status, 0);
  const auto bytes = [](const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  EXPECT_GT(bytes(whole + "/state.cbor").size(), 100u);
  EXPECT_EQ(bytes(whole + "/state.cbor"), bytes(broken + "/state.cbor"));
  EXPECT_EQ(bytes(whole + "/step_00004_screen.ply"), bytes(broken + "/step_00004_screen.ply"));
  const json a = json::parse(bytes(whole + "/fit.json"));
  const json b = json::parse(bytes(broken + "/fit.json"));
  EXPECT_EQ(a["status"], "done");
  ASSERT_EQ(a["history"].size(), 4u);
  ASSERT_EQ(b["history"].size(), 4u);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(a["history"][i]["loss"], b["history"][i]["loss"]);
  ASSERT_EQ(a["snapshots"].size(), 3u);
  for (const char* key : {"chamfer", "hausdorff", "normal_angle"}) {
    EXPECT_GT(a["snapshots"][2]["meshes"][0][key].get<double>(), 0) << key;
  }
  for (const json& picture : a["snapshots"][0]["pictures"]) {
    EXPECT_GT(bytes(whole + "/" + picture.get<std::string>()).size(), 60u);
  }
  EXPECT_EQ(bytes(whole + "/history.csv").substr(0, 29), "step,loss,stderr,step_size,ha");

  const std::string again = fit + " --steps 2 -o ";
  EXPECT_NE(refused(again + whole).find("holds a fit already"), std::string::npos);
  EXPECT_NE(refused("fit --resume " + files_.path("nowhere")).find("no fit was interrupted"),
            std::string::npos);
  EXPECT_NE(refused("fit " + scene_ + " --resume " + whole).find("leave out scene"),
            std::string::npos);
  EXPECT_NE(refused("fit --spp 4 --loss l1 --no-report --resume " + whole)
                .find("leave out --spp, --loss\n"),
            std::string::npos);
  EXPECT_NE(refused("fit --steps 2 -o " + out()).find("give a scene"), std::string::npos);
  const std::string start = "fit " + scene_ + " --steps 2 -o " + files_.path("other");
  EXPECT_NE(refused(start + " --target " + target).find("give --wrt"), std::string::npos);
  EXPECT_NE(refused(start + " --wrt blaze.radiance").find("0 --target for 1 views"),
            std::string::npos);
  const std::string good = start + " --wrt blaze.radiance --target " + target;
  EXPECT_NE(refused(good + " --bounds blaze.radiance=3").find("NAME=LEAST,MOST"),
            std::string::npos);
  EXPECT_NE(refused(good + " --loss l3").find("unknown loss \"l3\""), std::string::npos);
  EXPECT_NE(refused(good + " --optimiser sgd").find("known: adam-uniform, adam"),
            std::string::npos);
  EXPECT_NE(refused(good + " --terms sky").find("no term \"sky\" here"), std::string::npos);
  const std::string small = files_.path("small.exr");
  write_exr(small, Image(2, 2, 3), false, {});
  EXPECT_NE(refused(good + " --mask " + small).find(small + ": error: the mask has 2 x 2 pixels"),
            std::string::npos);
  const std::string flat = files_.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  EXPECT_NE(refused(good + " --truth " + flat).find("flat.obj: error: has no face with an area"),
            std::string::npos);
  EXPECT_FALSE(std::ifstream(files_.path("other") + "/state.cbor"));
}

// Each sensor of a scene has its target.
TEST_F(Program, FitsSeenBySeveralSensors) {
  std::string text = bytes_of(scene_);
  const size_t at = text.find("<sensor"), end = text.find("</sensor>") + 9;
  std::string second = text.substr(at, end - at);
  second.replace(0, 7, "<sensor id=\"side\"");
  const size_t origin = second.find("origin=\"");
  second.replace(origin, second.find('"', origin + 8) - origin, "origin=\"3, 1, 2");
  text.insert(end, second);
  const std::string both = files_.write("both.xml", text);
  std::string targets, swapped, folder = files_.path("sensors");
  for (const char* sensor : {"0", "side"}) {
    const std::string file = files_.path(std::string(sensor) + ".exr");
    const std::string told = files_.path("told.json");
    ASSERT_EQ(
        run("render " + both + " --sensor " + sensor + " --spp 64 --json " + told + " -o " + file)
            .status,
        0);
    EXPECT_EQ(json::parse(bytes_of(told))["sensor"], sensor);
    EXPECT_EQ(attribute_of(file, "limn.sensor"), sensor);
    targets += " --target " + file;
    swapped.insert(0, " --target " + file);
  }
  EXPECT_NE(bytes_of(files_.path("0.exr")), bytes_of(files_.path("side.exr")));
  const std::string fit = "fit " + both + " --wrt blaze.radiance --spp 16 --steps 1 --no-report";
  std::vector<double> losses, variances;
  for (const std::string& order : {targets, swapped}) {
    folder += "_";
    ASSERT_EQ(run(fit + order + " -o " + folder).status, 0);
    const json first = json::parse(bytes_of(folder + "/fit.json"))["history"][0];
    ASSERT_EQ(first["views"].size(), 2u);
    losses.push_back(first["loss"]);
    variances.push_back(std::pow(first["stderr"].get<double>(), 2));
  }
  EXPECT_GT(losses[1] - losses[0], 5 * std::sqrt(variances[0] + variances[1]));
  EXPECT_NE(refused(fit + " --target " + files_.path("0.exr") + " -o " + files_.path("no"))
                .find("1 --target for 2 views"),
            std::string::npos);
  EXPECT_NE(refused("render " + both + " --sensor top -o " + out())
                .find("both.xml: error: there is no sensor \"top\" (known: 0, 1 or \"side\")"),
            std::string::npos);
}

// A shape of the second view alone, whose id is no name of a file; a field, named from where the
// program runs; new triangles after the last step.
TEST_F(Program, FitsOfLaterViewsAndFields) {
  const std::string target = files_.path("target.exr"), folder = files_.path("later");
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + target).status, 0);
  SceneParts parts;
  parts.width = parts.height = 8;
  const std::string ball = write_mesh(files_, "ball.obj", icosphere_mesh(1));
  parts.body = obj_shape("a/b", ball, false, 0.4, {0, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               square("lamp", 0.5, 90, {0.3, 2.4, 0.5}, area_light("blaze", "6, 5, 4"));
  const std::string second = files_.write("second.xml", scene_text(parts));
  const std::string field = "screen.vertex_positions:field.txt";
  files_.write("field.txt", "0 0 1\n0 0 1\n0 0 1\n0 0 1\n");
  const std::string fit = std::string("cd ") + files_.path("") + " && " + LIMN_PROGRAM + " fit " +
                          scene_ + " --target " + target + " --view " + second + " --target " +
                          target + " --spp 1 --steps 1 --no-report --wrt a/b.vertex_positions";
  const Outcome outcome = call(fit + " --wrt " + field + " --bounds " + field + "=-1,1 -o later");
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_GT(bytes_of(folder + "/step_00001_a_b.ply").size(), 500u);
  EXPECT_EQ(json::parse(bytes_of(folder + "/fit.json"))["snapshots"][1]["meshes"].size(), 2u);
  const Outcome on = run("fit --no-report --steps 2 --resume " + folder);
  EXPECT_EQ(on.status, 0) << on.text;
  files_.write("field.txt", "0 0 1\n0 0 1\n0 0 1\n0 0 2\n");
  EXPECT_NE(refused("fit --no-report --steps 3 --resume " + folder)
                .find("field.txt: error: is not as it was when the fit in "),
            std::string::npos);
  const Outcome backward = run("backward " + second + " --spp 1 --target " + target +
                               " --wrt a/b.vertex_positions -o " + files_.path("back"));
  EXPECT_EQ(backward.status, 0) << backward.text;
  EXPECT_GT(bytes_of(files_.path("back") + "/a_b.vertex_positions.ply").size(), 500u);
  EXPECT_NE(call(fit + " --wrt screen.vertex_positions:fit.json -o .")
                .text.find("fit.json: error: -o would write over a file that is read"),
            std::string::npos);
  const Outcome remeshed = call(fit + " --remesh 5 -o remeshed");
  if (remeshed.text.find("OpenMesh") == std::string::npos) {
    EXPECT_NE(remeshed.text.find("--remesh 5: the fit ends before, after 1 steps"),
              std::string::npos)
        << remeshed.text;
  }
}

// Steps take twice as long each, so that the interrupt comes within one, after a snapshot.
TEST_F(Program, InterruptedFitsKeepPicturesAndTellWhatIsDamaged) {
  const std::string target = files_.path("target.exr"), folder = files_.path("fit");
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + target).status, 0);
  const Outcome outcome =
      call(std::string("timeout -s INT 2 ") + LIMN_PROGRAM + " fit " + scene_ + " --target " +
           target + " --wrt blaze.radiance --spp 1 --spp-doubling 1 --steps 40 --snapshots 1 " +
           "--no-report -o " + folder);
  EXPECT_NE(outcome.text.find("interrupted: "), std::string::npos) << outcome.text;
  const std::string file = folder + "/fit.json", text = bytes_of(file);
  const json fit = json::parse(text);
  EXPECT_EQ(fit["snapshots"].back()["step"], fit["steps"]);
  EXPECT_EQ(fit["snapshots"].back()["pictures"].size(), 1u);

  const std::string resume = "fit --no-report --resume " + folder;
  const auto says = [&](const std::string& what) {
    const std::string message = refused(resume);
    EXPECT_NE(message.find(what), std::string::npos) << message;
  };
  const auto damage = [&](const std::string& pointer, const json& value) {
    json damaged = fit;
    damaged[json::json_pointer(pointer)] = value;
    files_.write("fit/fit.json", damaged.dump());
  };
  damage("/arguments/views", json::array());
  says("fit.json: error: is not what a fit writes: it has no views");
  damage("/history/0/loss", "high");
  says("fit.json: error: is not what this fit writes: ");
  files_.write("fit/fit.json", text);
  const std::string state = bytes_of(folder + "/state.cbor");
  json other = json::from_cbor(state);
  other["parameters"].clear();
  const std::vector<uint8_t> bytes = json::to_cbor(other);
  files_.write("fit/state.cbor", std::string(bytes.begin(), bytes.end()));
  says("state.cbor: error: is the state of another fit");
  files_.write("fit/state.cbor", state);
  std::string changed = bytes_of(scene_);
  changed.replace(changed.find("0.7, 0.5, 0.3"), 3, "0.6");
  files_.write("scene.xml", changed);
  says("scene.xml: error: is not as it was when the fit in ");
  changed.replace(changed.find("0.6, 0.5, 0.3"), 3, "0.7");
  files_.write("scene.xml", changed);
  const Image image = read_exr(target);
  Image other_image = image;
  other_image.data[5] += 1;
  write_exr(target, other_image, false, {});
  says("target.exr: error: is not as it was when the fit in ");
}

TEST_F(Program, BackwardWritesWhatOthersRead) {
  const std::string target = out(), folder = files_.path("back");
  ASSERT_EQ(run("render " + scene_ + " --spp 2 --quiet -D glow=5,5,5 -o " + target).status, 0);
  const Outcome outcome = run("backward " + scene_ + " --spp 2 --target " + target +
                              " --wrt screen.vertex_positions --wrt blaze.radiance -o " + folder);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  const json report = json::parse(std::ifstream(folder + "/gradient.json"));
  ASSERT_EQ(report["parameters"].size(), 2u);
  EXPECT_EQ(report["parameters"][0]["shape"], json({4, 3}));
  EXPECT_GT(report["loss"]["value"], 0);
  const std::string array = folder + "/screen.vertex_positions";
  EXPECT_EQ(read_mesh(array + ".ply", true).positions.size(), 4u);
  EXPECT_EQ(run("gradient " + scene_ + " --spp 1 --quiet --wrt screen.vertex_positions:" + array +
                ".txt -o " + out())
                .status,
            0);
  EXPECT_NE(refused("backward " + scene_ + " -o " + folder).find("--adjoint or --target"),
            std::string::npos);
  const std::string small = files_.path("small.exr");
  write_exr(small, Image(2, 2, 3), false, {});
  EXPECT_NE(refused("backward " + scene_ + " --target " + small + " -o " + folder)
                .find(small + ": error: the target has 2 x 2 pixels"),
            std::string::npos);
  EXPECT_NE(refused("backward " + scene_ + " --adjoint " + target + " --terms sky -o " + folder)
                .find("no term \"sky\""),
            std::string::npos);
}

// A report without what clocks and threads say.
json without_times(json report) {
  for (const char* name : {"seconds", "setup_seconds", "threads"}) report.erase(name);
  if (report.contains("costs")) {
    for (auto& cost : report["costs"]) cost.erase("seconds");
  }
  if (report.contains("stats")) {
    report["stats"].erase("setup_seconds");
    for (auto& term : report["stats"]["terms"]) term.erase("seconds");
  }
  return report;
}

class Parts : public Program {
 protected:
  std::string part(int k) const { return files_.path(fmt::format("jobs/{}.part", k)); }
  // Parts 1 to 3 of a command, in another order, by other numbers of threads.
  void make_parts(const std::string& command) const {
    for (const int k : {3, 1, 2}) {
      std::filesystem::remove(part(k));  // of another run
      // Every third as a cluster's job would.
      const std::string threads = std::to_string(1 + k % 2), index = std::to_string(k);
      const Outcome outcome =
          k == 3 ? run_job(command, index, threads)
                 : run(command + " --threads " + threads + " --part " + index + "/3 -o " + part(k));
      ASSERT_EQ(outcome.status, 0) << outcome.text;
      EXPECT_NE(outcome.text.find("part " + std::to_string(k) + "/3"), std::string::npos);
    }
  }
  Outcome run_job(const std::string& command, const std::string& index,
                  const std::string& threads) const {
    return call(
        fmt::format("SLURM_ARRAY_TASK_ID={} SLURM_ARRAY_TASK_COUNT=3 SLURM_CPUS_PER_TASK={} "
                    "LIMN={} {}/tools/cluster/parts.sbatch {} {}",
                    index, threads, LIMN_PROGRAM, LIMN_SOURCE_DIR, files_.path("jobs"), command));
  }
  std::string all_parts() const { return part(2) + " " + part(3) + " " + part(1); }
  // The report of a run, and the bytes of its files.
  std::pair<json, std::vector<std::string>> result_of(const std::string& command,
                                                      const std::string& output,
                                                      const std::vector<std::string>& files) const {
    const std::string figures = files_.path("figures.json");
    const Outcome outcome = run(command + " --quiet --json " + figures + " -o " + output);
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    std::vector<std::string> bytes;
    for (const std::string& file : files) {
      bytes.push_back(bytes_of(file));
      std::filesystem::remove(file);
    }
    return {without_times(json::parse(std::ifstream(figures))), bytes};
  }
  void expect_same(const std::string& command, const std::string& output,
                   const std::vector<std::string>& files) const {
    const auto [report, bytes] = result_of(command, output, files);
    const auto [joined_report, joined_bytes] = result_of("merge " + all_parts(), output, files);
    EXPECT_EQ(report, joined_report);
    for (size_t i = 0; i < files.size(); ++i) EXPECT_TRUE(bytes[i] == joined_bytes[i]) << files[i];
  }
};

TEST_F(Parts, OfAGradientJoinToTheBitsOfOneRun) {
  const std::string command = "gradient " + scene_ +
                              " --spp 20 --wrt screen.translate.x --wrt "
                              "blaze.radiance -D glow=5,5,5";
  const std::vector<std::string> files = {
      files_.path("out_screen.translate.x.exr"), files_.path("out_screen.translate.x_stderr.exr"),
      files_.path("out_screen.translate.x.png"), files_.path("out_blaze.radiance.exr"),
      files_.path("out_blaze.radiance_stderr.exr")};
  make_parts(command);
  expect_same(command, out(), files);
  // What a method counts beside sums is in the image's header.
  const std::string warped =
      "gradient " + scene_ + " --method was --spp 3 --wrt screen.translate.x";
  make_parts(warped);
  expect_same(warped, out(), {out(), files_.path("out_stderr.exr")});
  make_parts(command);
  // An interrupted part holds its first batches, the last of them cut off.
  std::filesystem::resize_file(part(2), std::filesystem::file_size(part(2)) * 2 / 3);
  EXPECT_NE(refused("merge " + all_parts() + " -o " + out()).find("is not complete"),
            std::string::npos);
  const std::string before = bytes_of(part(2)).substr(0, 2000);
  ASSERT_EQ(run(command + " --part 2/3 -o " + part(2)).status, 0);
  EXPECT_TRUE(bytes_of(part(2)).substr(0, 2000) == before);
  // A damaged end: the batches before it stay, clocks and all.
  const std::string whole = bytes_of(part(2));
  std::filesystem::resize_file(part(2), whole.size() - 128);
  std::ofstream(part(2), std::ios::binary | std::ios::app) << std::string(300, '\0');
  EXPECT_NE(refused("merge " + all_parts() + " -o " + out()).find("is no part of a run"),
            std::string::npos);
  ASSERT_EQ(run(command + " --part 2/3 -o " + part(2)).status, 0);
  EXPECT_TRUE(bytes_of(part(2)) == whole);
  expect_same(command, out(), files);
}

TEST_F(Parts, OfAReversePassAndAnImageJoinToTheBitsOfOneRun) {
  const std::string target = files_.path("target.exr"), folder = files_.path("back");
  ASSERT_EQ(run("render " + scene_ + " --spp 2 --quiet -D glow=5,5,5 -o " + target).status, 0);
  ASSERT_EQ(run("backward " + scene_ + " --quiet --spp 3 --loss-only --target " + target + " -o " +
                folder)
                .status,
            0);
  const std::string adjoint = files_.path("adjoint.exr");
  std::filesystem::rename(folder + "/adjoint.exr", adjoint);
  const std::string command =
      "backward " + scene_ + " --spp 7 --batches 5 --stats --adjoint " + adjoint;
  const std::vector<std::string> files = {folder + "/screen.vertex_positions.ply",
                                          folder + "/screen.vertex_positions.npy",
                                          folder + "/floor.vertex_positions.png"};
  make_parts(command);
  expect_same(command, folder, files);
  const std::string image = "render " + scene_ + " --spp 5";
  make_parts(image);
  expect_same(image, out(), {out()});
  // With the loss in the same run: the same adjoint, the same samples.
  EXPECT_NE(refused("backward " + scene_ + " --target " + target + " --part 1/2 -o " + part(1))
                .find("--loss-only"),
            std::string::npos);
}

TEST_F(Parts, ThatDoNotFitAreRefused) {
  const std::string command = "gradient " + scene_ + " --quiet --spp 4 --wrt screen.translate.x";
  make_parts("gradient " + scene_ + " --spp 4 --wrt screen.translate.x");
  const auto merged = [&](const std::string& parts) {
    return refused("merge " + parts + " -o " + out());
  };
  EXPECT_NE(merged(part(1) + " " + part(3)).find("part 2/3 is missing; 2 of 3 are given"),
            std::string::npos);
  EXPECT_NE(merged(all_parts() + " " + part(1)).find("each is needed once"), std::string::npos);
  const std::string alien = files_.path("alien.part");
  const std::string with_alien = part(1) + " " + part(2) + " " + alien;
  const auto make_alien = [&](const std::string& arguments) {
    std::filesystem::remove(alien);
    ASSERT_EQ(run(arguments + " -o " + alien).status, 0);
  };
  make_alien(command + " --seed 1 --part 3/3");
  EXPECT_NE(refused(command + " --part 3/3 -o " + alien)
                .find(alien + ": error: holds a part of another run: seed was 1, but now is 0"),
            std::string::npos);
  EXPECT_NE(refused(command + " --seed 1 --part 2/3 -o " + alien)
                .find("holds part 3/3, and part 2/3 is asked for"),
            std::string::npos);
  EXPECT_NE(merged(with_alien)
                .find(alien + ": error: is a part of another run than " + part(1) +
                      ": seed is 1, there 0"),
            std::string::npos);
  make_alien(command + " -D glow=6,5,4.5 --part 3/3");
  EXPECT_NE(merged(with_alien).find("another run than " + part(1) + ": scene is"),
            std::string::npos);
  make_alien(command + " --film exact --part 3/3");
  EXPECT_NE(merged(with_alien).find("another run than " + part(1) + ": film is exact, there rays"),
            std::string::npos);
  make_alien(command + " --part 2/2");
  EXPECT_NE(merged(with_alien).find("is part 2/2, but " + part(1) + " is part 1/3"),
            std::string::npos);
  EXPECT_NE(merged(part(1) + " " + scene_).find("is no part of a run"), std::string::npos);
  const std::string bytes = bytes_of(part(1));
  for (const std::string& place : {" -o " + part(1), " -o " + out() + " --json " + part(1)}) {
    EXPECT_NE(refused("merge " + all_parts() + place).find("would write over a file that is read"),
              std::string::npos)
        << place;
  }
  EXPECT_TRUE(bytes_of(part(1)) == bytes);
  // The scene changes after the parts are made.
  std::ofstream(scene_, std::ios::app) << "<!-- the same scene -->\n";
  EXPECT_EQ(run("merge " + all_parts() + " --quiet -o " + out()).status, 0);
  std::string text = bytes_of(scene_);
  text.replace(text.find("0.7, 0.5, 0.3"), 3, "0.8");
  std::ofstream(scene_) << text;
  EXPECT_NE(merged(all_parts()).find("cannot be joined here: scene was"), std::string::npos);
  for (const char* bad : {"0/3", "4/3", "1", "1/", "a/3", "1/3/3"}) {
    EXPECT_NE(refused(command + " --part " + bad + " -o " + alien).find("expected K/N"),
              std::string::npos)
        << bad;
  }
  EXPECT_NE(refused(command + " --part 1/3 -o " + out()).find("must end in .part"),
            std::string::npos);
}

// A field's file is not a part of the scene.
TEST_F(Parts, OfOtherFieldsAreRefused) {
  const std::string field = files_.write("field.txt", "1 0 0\n1 0 0\n1 0 0\n1 0 0\n");
  const std::string name = " --wrt screen.vertex_positions:" + field;
  for (const std::string& command :
       {"gradient " + scene_ + " --spp 4" + name,
        "backward " + scene_ + " --spp 4 --adjoint " + files_.path("adjoint.exr") + name}) {
    ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + files_.path("adjoint.exr")).status, 0);
    make_parts(command);
    files_.write("field.txt", "1 0 0\n1 0 0\n1 0 0\n1 0 1\n");
    EXPECT_NE(refused("merge " + all_parts() + " -o " + out()).find("velocities was"),
              std::string::npos);
    std::filesystem::remove(part(3));
    ASSERT_EQ(run(command + " --part 3/3 -o " + part(3)).status, 0);
    EXPECT_NE(refused("merge " + all_parts() + " -o " + out()).find("another run than"),
              std::string::npos);
    files_.write("field.txt", "1 0 0\n1 0 0\n1 0 0\n1 0 0\n");
  }
}

TEST_F(Program, ReversePassesKeepToTheirTime) {
  const std::string folder = files_.path("back"), again = files_.path("again");
  const std::string target = files_.path("target.exr");
  ASSERT_EQ(run("render " + scene_ + " --spp 2 --quiet -D glow=5,5,5 -o " + target).status, 0);
  const std::string command = "backward " + scene_ + " --quiet --adjoint " + target + " ";
  const Outcome outcome = run(command + "--time 0.5 -o " + folder);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  const json timed = json::parse(std::ifstream(folder + "/gradient.json"));
  // Its samples and batches say all.
  ASSERT_EQ(run(command + fmt::format("--spp {} --batches {} -o {}", timed["spp"].get<int>(),
                                      timed["batches"].get<int>(), again))
                .status,
            0);
  const json same = json::parse(std::ifstream(again + "/gradient.json"));
  EXPECT_EQ(timed["parameters"][0]["value"], same["parameters"][0]["value"]);
  EXPECT_EQ(bytes_of(folder + "/screen.vertex_positions.npy"),
            bytes_of(again + "/screen.vertex_positions.npy"));
  EXPECT_GE(timed["batches"], 2);
}

TEST_F(Program, WarnsOnce) {
  const std::string mesh = files_.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n");
  SceneParts parts;
  parts.width = parts.height = 2;
  parts.body = R"(  <shape type="obj"><string name="filename" value="a.obj"/></shape>
)";
  const std::string scene = files_.write("collapsed.xml", scene_text(parts));
  EXPECT_EQ(
      run("render " + scene + " --spp 1 --quiet -o " + out()).text,
      mesh + ": warning: 1 of 2 faces have two corners at the same position and are left out\n");
}

TEST_F(Program, RendersAndDifferentiates) {
  EXPECT_EQ(run("render " + scene_ + " --spp 2 --quiet -o " + out()).text, "");
  EXPECT_EQ(read_exr(out()).width, 8);
  const std::string figures = files_.path("figures.json");
  const Outcome outcome = run("gradient " + scene_ + " --spp 8 --quiet --wrt screen.translate.x" +
                              " --json " + figures + " -o " + out());
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "");
  EXPECT_TRUE(std::filesystem::exists(files_.path("out_stderr.exr")));
  EXPECT_TRUE(std::filesystem::exists(files_.path("out.png")));
  std::ifstream stream(figures);
  EXPECT_EQ(nlohmann::json::parse(stream)["spp"], 8);
  EXPECT_EQ(run("info " + scene_).status, 0);
}

TEST_F(Program, DifferentiatesForATime) {
  const std::string figures = files_.path("figures.json");
  const Outcome outcome = run("gradient " + scene_ + " --time 0.01 --quiet --wrt " +
                              "screen.translate.x --json " + figures + " -o " + out());
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  std::ifstream stream(figures);
  EXPECT_GE(nlohmann::json::parse(stream)["spp"], 2);  // standard errors need two
  EXPECT_TRUE(std::filesystem::exists(files_.path("out_stderr.exr")));
  EXPECT_NE(refused("gradient " + scene_ + " --time 1 --spp 4 --wrt screen.translate.x -o " + out())
                .find("--spp excludes --time"),
            std::string::npos);
}

TEST_F(Program, SharesTheWorkAmongTerms) {
  const std::string figures = files_.path("figures.json");
  const std::string gradient = "gradient " + scene_ +
                               " --wrt screen.translate.x --method forest --threads 1 --json " +
                               figures + " -o " + out();
  const auto report = [&](const std::string& arguments) {
    const Outcome outcome = run(gradient + arguments);
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    std::ifstream stream(figures);
    return std::pair(nlohmann::json::parse(stream), outcome.text);
  };
  const auto [given, given_text] = report(" --spp 16 --samples 3,0.5,2");
  EXPECT_EQ(given["samples"], (nlohmann::json{{"interior", 3}, {"camera", 0.5}, {"boundary", 2}}));
  EXPECT_EQ(given["pilot_spp"], 0);
  EXPECT_EQ(given["costs"]["interior"]["samples"], 3 * 16 * 64);
  EXPECT_NE(given_text.find("3,0.5,2"), std::string::npos) << given_text;
  std::string attribute;
  for (const ImageAttribute& a : read_exr_attributes(out())) {
    if (a.name == "limn.samples") attribute = a.value;
  }
  EXPECT_EQ(attribute, "3,0.5,2");

  const auto [chosen, chosen_text] = report(" --spp 16");
  EXPECT_EQ(chosen["pilot_spp"], 4);
  EXPECT_NE(chosen_text.find("chosen by 4"), std::string::npos) << chosen_text;
  const auto [brief, brief_text] = report(" --spp 15");
  EXPECT_EQ(brief["pilot_spp"], 0);
  EXPECT_EQ(brief["samples"], (nlohmann::json{{"interior", 1}, {"camera", 1}, {"boundary", 1}}));
}

TEST_F(Program, Compares) {
  const std::string folder = files_.path("folder");
  const std::string compare = "compare " + scene_ + " --wrt screen.translate.x --time 0.1" +
                              " --reference-time 0.1 --repeats 2 --quiet --no-report -o " + folder;
  const Outcome outcome = run(compare + " --methods forest,fd --sweep 2");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "");
  const auto report = [&] {
    std::ifstream stream(folder + "/compare.json");
    return nlohmann::json::parse(stream);
  };
  const nlohmann::json first = report();
  EXPECT_EQ(first["kind"], "compare");
  EXPECT_EQ(first["unit"], "scene units");
  EXPECT_EQ(first["times"], nlohmann::json({0.05, 0.1}));
  EXPECT_FALSE(first["reference"]["cached"].get<bool>());
  ASSERT_EQ(first["methods"].size(), 2u);
  for (const nlohmann::json& method : first["methods"]) {
    EXPECT_EQ(method["status"], "done");
    EXPECT_EQ(method["runs"].size(), 4u);
    EXPECT_EQ(method["summary"].size(), 2u);
    EXPECT_TRUE(method["slope"]["value"].is_number() || method["slope"].is_null());
    for (const char* key : {"image", "picture", "error_picture"}) {
      EXPECT_TRUE(std::filesystem::exists(folder + "/" + method[key].get<std::string>())) << key;
    }
    for (const char* key : {"mse", "relative_mse", "trimmed_mse", "seconds", "spp", "rays"}) {
      EXPECT_TRUE(method["summary"][1][key].is_number()) << key;
      EXPECT_TRUE(method["runs"][3][key].is_number()) << key;
    }
  }
  EXPECT_TRUE(first["methods"][1]["settings"]["step"].is_number());
  for (const char* file : {"compare.csv", "image.png", "reference.png", "reference_stderr.exr"}) {
    EXPECT_TRUE(std::filesystem::exists(folder + "/" + file)) << file;
  }

  EXPECT_EQ(run(compare + " --methods uniform").status, 0);
  EXPECT_TRUE(report()["reference"]["cached"].get<bool>());
  EXPECT_EQ(report()["reference"]["spp"], first["reference"]["spp"]);

  const std::string other = "compare " + scene_ + " --wrt screen.translate.y --time 0.1 -o " +
                            files_.path("other") + " --reference " + folder + "/reference.exr";
  const std::string text = refused(other + " --methods forest");
  EXPECT_NE(text.find("parameter (--wrt): \"screen.translate.x\" there"), std::string::npos)
      << text;
}

// A Python that cannot start is as good as none.
TEST_F(Program, WithoutPythonTheDataIsWritten) {
  const std::string folder = files_.path("folder");
  const Outcome outcome = run("compare " + scene_ + " --wrt screen.translate.x --time 0.05" +
                                  " --repeats 2 --methods forest,mitsuba -o " + folder,
                              "PYTHONHOME=/nowhere ");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("no report.html: "), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("All data is in " + folder), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("mitsuba missing: "), std::string::npos) << outcome.text;
  EXPECT_FALSE(std::filesystem::exists(folder + "/report.html"));
  std::ifstream stream(folder + "/compare.json");
  const auto methods = nlohmann::json::parse(stream)["methods"];
  EXPECT_EQ(methods[0]["status"], "done");
  EXPECT_EQ(methods[1]["status"], "missing");
  EXPECT_NE(methods[1]["message"], "");
}

TEST_F(Program, ComparesOnlyWhatItKnows) {
  const std::string compare = "compare " + scene_ + " --wrt screen.translate.x --time 0.1 -o " +
                              files_.path("folder") + " --methods ";
  const std::string text = refused(compare + "forest,forrest");
  EXPECT_NE(text.find("unknown method \"forrest\" (known: adaptive, "), std::string::npos) << text;
  EXPECT_NE(text.find("fd, mitsuba-after-setup, mitsuba)"), std::string::npos) << text;
  EXPECT_NE(refused(compare + "forest,forest").find("given twice"), std::string::npos);
  EXPECT_NE(refused(compare + "fd --terms interior").find("all terms in one"), std::string::npos);
  EXPECT_NE(refused(compare + "forest --spp 4").find("--time"), std::string::npos);
  EXPECT_NE(refused(compare + "forest --repeats 0").find("--repeats"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(files_.path("folder")));
}

TEST_F(Program, ChecksBothWays) {
  const std::string check = "check " + scene_ + " --spp 2048 --block 2 --wrt screen.translate.y";
  const Outcome right = run(check);
  // Too few samples for a verdict are no accusation.
  EXPECT_TRUE(right.status == 0 || right.status == 4) << right.text;
  EXPECT_NE(right.text.find("found with 95 %"), std::string::npos);
  const Outcome wrong = run(check + " --terms interior,camera,boundary");
  EXPECT_EQ(wrong.status, 1) << wrong.text;
  EXPECT_NE(wrong.text.find("suspect the direct term"), std::string::npos) << wrong.text;
}

// Whatever the method: images, standard errors and figures of every parameter.
TEST_F(Program, GradientsByAnyMethod) {
  for (const std::string method : {"forest", "uniform", "fd"}) {
    const Outcome outcome =
        run("gradient " + scene_ + " --wrt screen.translate.x --wrt screen.translate.y --spp 8" +
            " --method " + method + " --stats --json " + files_.path("g.json") + " -o " + out());
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    EXPECT_NE(outcome.text.find("set-up, "), std::string::npos) << outcome.text;
    for (const char* parameter : {"screen.translate.x", "screen.translate.y"}) {
      const std::string stem = files_.path("out_" + std::string(parameter));
      for (const char* ending : {".exr", ".png", "_stderr.exr"}) {
        EXPECT_TRUE(std::filesystem::exists(stem + ending)) << method << stem << ending;
        std::filesystem::remove(stem + ending);
      }
    }
    std::ifstream stream(files_.path("g.json"));
    const auto figures = nlohmann::json::parse(stream);
    EXPECT_EQ(figures["method"], method);
    EXPECT_EQ(figures["costs"].size(), method == "fd" ? 1u : 3u);
    EXPECT_EQ(figures["parameters"].size(), 2u);
  }
  EXPECT_NE(refused("gradient " + scene_ + " --wrt screen.translate.x --method fd --terms " +
                    "interior -o " + out())
                .find("\"fd\" has all terms in one"),
            std::string::npos);
}

TEST_F(Program, ChecksAnyMethod) {
  for (const std::string method : {"li2019", "fd"}) {
    const Outcome outcome = run("check " + scene_ + " --spp 512 --block 2 --method " + method +
                                " --wrt screen.translate.y");
    EXPECT_TRUE(outcome.status == 0 || outcome.status == 4) << method << outcome.text;
  }
}

// A sample done again adds what it added in its run: with one sample per pixel, the pixel's value.
TEST_F(Program, RepeatsOneSample) {
  const std::string gradient =
      "gradient " + scene_ + " --wrt screen.translate.x --method forest -o " + out();
  const Outcome whole = run(gradient + " --spp 1 --samples 1 --terms boundary");
  EXPECT_EQ(whole.status, 0) << whole.text;
  const Image image = read_exr(out());
  int brightest = 0;
  for (int i = 0; i < image.width * image.height; ++i) {
    const auto size = [&](int k) { return std::fabs(image.data[3 * k]); };
    if (size(i) > size(brightest)) brightest = i;
  }
  ASSERT_NE(image.data[3 * brightest], 0);
  const Outcome one = run(gradient + " --spp 1 --samples 1 --terms boundary --debug-sample " +
                          std::to_string(brightest % image.width) + "," +
                          std::to_string(brightest / image.width) + ",0");
  EXPECT_EQ(one.status, 0) << one.text;
  EXPECT_NE(one.text.find("vertex 0: face "), std::string::npos) << one.text;
  const std::string sum = "sum: boundary of parameter 1: (";
  const size_t place = one.text.find(sum);
  ASSERT_NE(place, std::string::npos) << one.text;
  EXPECT_NEAR(std::stod(one.text.substr(place + sum.size())), image.data[3 * brightest],
              1e-5 * std::fabs(image.data[3 * brightest]));
  EXPECT_NE(refused(gradient + " --debug-sample 1,2").find("there is no sample 2 of the term"),
            std::string::npos);
  EXPECT_NE(refused(gradient + " --debug-sample 9999,0,0").find("pixels of this film"),
            std::string::npos);
  EXPECT_NE(refused(gradient + " --debug-sample here").find("X,Y,S"), std::string::npos);
  EXPECT_NE(
      refused("render " + scene_ + " -o " + out() + " --debug-sample 0,0,-1").find("no sample -1"),
      std::string::npos);
}

// Samples that are not finite are an error, with the command that shows the first; what is finite
// is kept. Here a corner touches the pinhole.
TEST_F(Program, NonFiniteSamplesAreAnErrorThatCanBeRepeated) {
  // A pixel of 1e30 changes within 1e-12: by more than a float holds.
  files_.write("tiny.obj", "v -1e-12 -1e-12 0\nv 1e-12 -1e-12 0\nv 0 1e-12 0\nf 1 2 3\n");
  const std::string scene = files_.write("tiny.xml", R"(<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/><float name="near_clip" value="1e-14"/>
<transform name="to_world"><lookat origin="0, 0, 4e-12" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
<rfilter type="box"/></film></sensor>
<shape type="obj" id="sheet"><string name="filename" value="tiny.obj"/></shape>
<emitter type="constant"><rgb name="radiance" value="1e30"/></emitter></scene>
)");
  const Outcome outcome =
      run("gradient " + scene + " --wrt sheet.translate.y --spp 2 --samples 1 -o " + out());
  EXPECT_EQ(outcome.status, 3) << outcome.text;
  EXPECT_NE(outcome.text.find("non-finite sample"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("  to see the first: limn gradient "), std::string::npos)
      << outcome.text;
  EXPECT_NE(outcome.text.find(" --debug-sample "), std::string::npos) << outcome.text;
  EXPECT_TRUE(std::filesystem::exists(out()));
}

TEST_F(Program, AblationsStandInTheLongHelp) {
  const std::string brief = run("gradient --help").text;
  const std::string all = run("gradient --help-all").text;
  EXPECT_EQ(brief.find("forest-concave"), std::string::npos) << brief;
  EXPECT_NE(brief.find("li2019"), std::string::npos) << brief;
  EXPECT_NE(all.find("forest-concave"), std::string::npos) << all;
}

TEST_F(Program, UnknownParameterListsTheNearest) {
  const std::string text = refused("gradient " + scene_ + " --wrt scren.translate.x -o " + out());
  EXPECT_NE(text.find("\"scren.translate.x\""), std::string::npos) << text;
  EXPECT_NE(text.find("screen.translate.x"), std::string::npos) << text;
  EXPECT_FALSE(std::filesystem::exists(out()));
}

TEST_F(Program, UnknownNamesListTheKnown) {
  const std::string gradient = "gradient " + scene_ + " --wrt screen.translate.x -o " + out();
  EXPECT_NE(refused(gradient + " --sampler forrest").find("brute"), std::string::npos);
  EXPECT_NE(refused(gradient + " --terms interior,border").find("boundary"), std::string::npos);
  EXPECT_NE(refused("render " + scene_ + " --shading phong -o " + out()).find("continuous"),
            std::string::npos);
  EXPECT_NE(refused("paint " + scene_)
                .find("limn paint: no such command (known: info, render, gradient, backward, fit, "
                      "merge, check, compare, reject; limn --help tells more)"),
            std::string::npos);
  EXPECT_NE(refused("").find("limn: a command is needed (known: info"), std::string::npos);
}

TEST_F(Program, BadNumbers) {
  const std::string render = "render " + scene_ + " -o " + out();
  EXPECT_NE(refused(render + " --spp 0").find("--spp"), std::string::npos);
  EXPECT_NE(refused(render + " --spp many").find("--spp"), std::string::npos);
  EXPECT_NE(refused(render + " --threads 0").find("--threads"), std::string::npos);
  EXPECT_NE(refused(render + " --seed -1").find("--seed"), std::string::npos);
  EXPECT_NE(refused("check " + scene_ + " --wrt screen.translate.x --step 0").find("--step"),
            std::string::npos);
  EXPECT_EQ(refused("check " + scene_ + " --wrt screen.translate.x --spp 1"),
            "error: check needs --spp of at least 2, for standard errors\n");
}

// The options of a method that is not asked for are a mistake, whatever the command.
TEST_F(Program, AuxiliaryRaysAreForMethodsThatTraceThem) {
  const std::string where = scene_ + " --wrt screen.translate.x --aux 4";
  const std::string whose = "(--aux, --kappa) are for the methods was, was-unbiased: ";
  const std::pair<std::string, std::string> mistakes[] = {
      {"gradient " + where + " -o " + out(), "the method \"adaptive\" has none"},
      {"check " + where + " --method fd", "the method \"fd\" has none"},
      {"check " + where + " --reverse", "the method \"reverse mode\" has none"},
      {"compare " + where + " --time 0.1 --methods forest,fd -o " + files_.path("folder"),
       "none of the methods forest, fd has any"}};
  for (const auto& [command, text] : mistakes) {
    EXPECT_EQ(refused(command), "error: auxiliary rays and their kernel " + whose + text + "\n");
  }
  const std::string right = "check " + where + " --method was --spp 2";
  EXPECT_EQ(run(right).status, 4) << run(right).text;
}

TEST_F(Program, BadSamples) {
  const std::string gradient =
      "gradient " + scene_ + " --wrt screen.translate.x --method forest -o " + out();
  for (const char* samples : {"3,", "3,1,1,1", "3:1:1", "0,1,1", "1,0,1", "1,1,0.5", "1.5,1,1",
                              "1,1,2000", "-1,1,1", "many"}) {
    const std::string message = refused(gradient + " --samples=" + samples);
    EXPECT_NE(message.find("--samples"), std::string::npos) << samples << ": " << message;
    EXPECT_NE(message.find("3,0.5,1"), std::string::npos) << samples << ": " << message;
  }
}

TEST_F(Program, BadDefines) {
  const std::string render = "render " + scene_ + " -o " + out();
  EXPECT_EQ(refused(render + " -D glow"), "error: -D glow: expected NAME=VALUE\n");
  EXPECT_NE(refused(render + " -D gloww=3").find("(known: glow)"), std::string::npos);
  EXPECT_NE(refused(render + " -D glow=bright").find("scene.xml:"), std::string::npos);
}

TEST_F(Program, OutputsThatCannotBeWritten) {
  const std::string text = refused("render " + scene_ + " -o /proc/no/such.exr");
  EXPECT_NE(text.find("/proc/no/such.exr: error: cannot be written"), std::string::npos) << text;
  EXPECT_NE(refused("render " + scene_ + " -o " + files_.path("out.jpg")).find(".exr"),
            std::string::npos);
}

TEST_F(Program, OutputsThatCollide) {
  const std::string gradient = "gradient " + scene_ + " --spp 2 --quiet --wrt screen.translate.x";
  EXPECT_NE(refused(gradient + " -o " + out() + " --json " + out())
                .find("-o and --json would both write this file"),
            std::string::npos);
  EXPECT_NE(
      refused(gradient + " --wrt screen.translate.x -o " + out()).find("would have this name"),
      std::string::npos);
  EXPECT_NE(refused(gradient + " -o " + out() + " --json " + scene_)
                .find("--json would write over a file that is read"),
            std::string::npos);
  EXPECT_NE(refused("check " + scene_ + " --wrt screen.translate.x --json " + files_.path("."))
                .find("it is a folder"),
            std::string::npos);
  EXPECT_NE(refused("info " + scene_ + " --json " + files_.path("none/x.json")).find("no folder"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(out()));
}

TEST_F(Program, NothingOldLiesBesideANewImage) {
  const auto there = [&](const char* ending) {
    return std::filesystem::exists(files_.path(std::string("out") + ending));
  };
  files_.write("out_notes.exr", "not an image");
  const std::string gradient = "gradient " + scene_ + " --quiet -o " + out();
  EXPECT_EQ(run(gradient + " --spp 2 --sample-images --wrt screen.translate.x" +
                " --wrt screen.translate.y")
                .status,
            0);
  EXPECT_TRUE(there("_screen.translate.y_stderr.exr") && there("_samples_camera.exr"));
  EXPECT_EQ(run(gradient + " --spp 2 --wrt screen.translate.x").status, 0);
  EXPECT_FALSE(there("_screen.translate.y.exr") || there("_screen.translate.y.png") ||
               there("_screen.translate.y_stderr.exr") || there("_samples_camera.exr"));
  EXPECT_TRUE(there(".exr") && there("_stderr.exr"));
  EXPECT_EQ(run("render " + scene_ + " --spp 1 --quiet -o " + out()).status, 0);
  EXPECT_FALSE(there("_stderr.exr"));
  EXPECT_TRUE(there("_notes.exr"));
}

// A file that may not grow is as good as a full disk.
TEST_F(Program, FullDisksAreAnError) {
  const Outcome outcome =
      run("gradient " + scene_ + " --spp 2 --quiet --wrt screen.translate.x" + " -o " + out(),
          "trap '' XFSZ; ulimit -f 1; ");
  EXPECT_EQ(outcome.status, 2) << outcome.text;
  EXPECT_NE(outcome.text.find("cannot write"), std::string::npos) << outcome.text;
  EXPECT_FALSE(std::filesystem::exists(out()));
}

TEST_F(Program, SigtermWritesWhatIsDone) {
  const Outcome outcome = run(
      "gradient " + scene_ + " --quiet --spp 1000000000 --wrt " + "screen.translate.x -o " + out(),
      "timeout --preserve-status -s TERM 2 ");
  EXPECT_EQ(outcome.status, 130) << outcome.text;
  EXPECT_TRUE(std::filesystem::exists(out()));
}

// Every warning of `info` stands in the figures of a run, too.
TEST_F(Program, WarningsAreInTheFigures) {
  files_.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n");
  SceneParts parts;
  parts.width = parts.height = 2;
  parts.body = R"(  <shape type="obj" id="a"><string name="filename" value="a.obj"/></shape>
  <shape type="rectangle" id="b"><transform name="to_world"><translate z="1"/></transform></shape>
  <shape type="rectangle" id="c"><transform name="to_world"><translate x="1" z="1"/></transform>
  </shape>
)";
  const std::string scene = files_.write("warned.xml", scene_text(parts));
  const std::string figures = files_.path("figures.json");
  const auto warnings = [&](const std::string& arguments) {
    run(arguments + " --json " + figures);
    std::ifstream stream(figures);
    const auto report = nlohmann::json::parse(stream);
    return (report.is_array() ? report[0] : report)["warnings"];
  };
  const auto of_info = warnings("info " + scene);
  ASSERT_EQ(of_info.size(), 2u);  // a face without area, shapes that overlap
  const std::string wrt = " --spp 2 --quiet --wrt a.translate.x";
  const auto of_gradient = warnings("gradient " + scene + wrt + " -o " + out());
  for (size_t i = 0; i < of_info.size(); ++i) EXPECT_EQ(of_gradient[i], of_info[i]);
  EXPECT_EQ(warnings("check " + scene + wrt), of_info);
  EXPECT_EQ(warnings("render " + scene + " --spp 1 --quiet -o " + out()), of_info);
  EXPECT_EQ(warnings("check " + scene + wrt + " --shading mitsuba").size(), 3u);
}

nlohmann::json read_json(const std::string& file) {
  std::ifstream stream(file);
  return nlohmann::json::parse(stream);
}

TEST_F(Program, ShowsRejection) {
  const std::string mesh = write_mesh(files_, "ball.obj", torus_mesh(16, 8));
  const std::string folder = files_.path("rejection");
  const Outcome outcome =
      run("reject " + mesh + " --no-report --size 32 --points 8 --node-edges 40 -o " + folder);
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("hit rate"), std::string::npos) << outcome.text;
  const nlohmann::json report = read_json(folder + "/reject.json");
  EXPECT_EQ(report["kind"], "reject");
  EXPECT_EQ(report["edges"], 3 * 16 * 8);
  EXPECT_EQ(report["variants"].size(), 4u);
  EXPECT_TRUE(std::filesystem::exists(folder + "/reject.csv"));
  std::vector<std::string> pictures = {report["overview"]};
  for (const auto& variant : report["variants"]) {
    pictures.push_back(variant["edges_picture"]);
    EXPECT_EQ(variant["reachable_edges"],
              variant["silhouettes"].get<int>() + variant["false_accepts"].get<int>());
    EXPECT_EQ(variant["slices"].size(), 2u);
    for (const auto& slice : variant["slices"]) {
      pictures.push_back(slice["picture"]);
      EXPECT_EQ(slice["points"], 32 * 32);
      EXPECT_EQ(slice["missed"], 0);
    }
  }
  for (const std::string& picture : pictures)
    EXPECT_GT(std::filesystem::file_size(folder + "/" + picture), 100u) << picture;
}

TEST_F(Program, ShowsRejectionInAScene) {
  const std::string folder = files_.path("rejection");
  const std::string reject = "reject " + scene_ +
                             " --no-report --quiet --methods forest --size 16 --points 4 -o " +
                             folder;
  const Outcome outcome = run(reject + " --shape screen --point 0,3,0 --view 1,0.2,0 --node 0");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "");
  EXPECT_EQ(read_json(folder + "/reject.json")["shape"], "screen");
  EXPECT_NE(refused(reject + " --shape scren")
                .find("no shape has the id \"scren\" (known: floor, "
                      "screen, lamp)"),
            std::string::npos);
  EXPECT_NE(refused(reject + " --node 4000").find("--node 4000: forest has nodes 0 to"),
            std::string::npos);
  EXPECT_NE(refused(reject + " --view 1,2").find("--view"), std::string::npos);
  EXPECT_NE(refused(reject + " --up 0,0,0").find("--up: a direction cannot be 0,0,0"),
            std::string::npos);
  EXPECT_NE(refused(reject + " --point 0,nan,0").find("--point: must be finite"),
            std::string::npos);
  EXPECT_NE(refused(reject + " --methods forest,brute")
                .find("\"brute\" is no sampler with a rejection test (those "
                      "are forest, silhouettes, li2019,"),
            std::string::npos);
  EXPECT_EQ(refused("reject no/such.ply -o " + folder),
            "no/such.ply: error: cannot read the file\n");
  EXPECT_NE(refused("reject " + scene_ + " -o /proc/no/such").find("/proc/no/such"),
            std::string::npos);
}

TEST_F(Program, MissingSceneAndHelp) {
  EXPECT_EQ(refused("info no/such.xml"), "no/such.xml: error: cannot read the file\n");
  EXPECT_EQ(run("--help").status, 0);
  EXPECT_EQ(run("gradient --help").status, 0);
}

}  // namespace
}  // namespace limn
