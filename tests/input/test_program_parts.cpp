// Parts of runs, and what joins them.
#include <filesystem>

#include "integrators/estimates/checksum.h"
#include "support/program.h"

namespace limn {
namespace {

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
  EXPECT_NE(refused("merge " + all_parts() + " -o " + out()).find("make part 2/3 again"),
            std::string::npos);
  ASSERT_EQ(run(command + " --part 2/3 -o " + part(2)).status, 0);
  EXPECT_TRUE(bytes_of(part(2)) == whole);
  expect_same(command, out(), files);
}

// Images are cheap here: differences take more samples than were asked for.
TEST_F(Parts, TellTheSamplesThatTheRunPlans) {
  const Outcome outcome = run("gradient " + scene_ +
                              " --method fastest --spp 32 --wrt lamp.translate.x --part 1/1 -o " +
                              files_.path("one.part"));
  int done = 0, all = 0;
  const size_t at = outcome.text.find("part 1/1, ");
  ASSERT_NE(at, std::string::npos) << outcome.text;
  ASSERT_EQ(std::sscanf(outcome.text.c_str() + at, "part 1/1, %d of %d", &done, &all), 2);
  EXPECT_GT(all, 32);
  EXPECT_EQ(done, all);
}

// Wherever a bit flips, parts are not joined, and the part made again joins to the same bits.
TEST_F(Parts, WithAFlippedBitAreRefused) {
  const std::string command = "gradient " + scene_ + " --spp 9 --method fd --wrt blaze.radiance";
  make_parts(command);
  const std::string whole = bytes_of(part(2));
  const auto flip = [&](size_t byte, int bit) {
    std::string bytes = whole;
    bytes[byte] = static_cast<char>(bytes[byte] ^ 1 << bit);
    std::ofstream(part(2), std::ios::binary) << bytes;
  };
  size_t batches = 0;
  for (int i = 0; i < 40; ++i) {
    flip(whole.size() * i / 40 + i % 7, i % 8);
    const std::string message = refused("merge " + all_parts() + " -o " + out());
    EXPECT_NE(message.find(part(2) + ": error: is "), std::string::npos) << i << ": " << message;
    batches += message.find("whole batches: make part 2/3 again") != std::string::npos;
  }
  EXPECT_GT(batches, 20u);
  flip(whole.size() / 2, 3);
  ASSERT_EQ(run(command + " --part 2/3 -o " + part(2)).status, 0);
  expect_same(command, out(), {out()});
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

// Numbers of samples as a pilot chose them, which every part and the joining run must have alike.
TEST_F(Parts, OfAdaptiveHaveOnePlan) {
  const std::string command = "gradient " + scene_ + " --spp 16 --wrt screen.translate.x";
  make_parts(command);
  expect_same(command, out(), {out()});
  // As of a machine whose pilot chose otherwise.
  const auto choose_otherwise = [&](int k) {
    std::string bytes = bytes_of(part(k));
    const std::string name = "choice of the pilot: ";
    const size_t at = bytes.find(name);
    ASSERT_NE(at, std::string::npos);
    char& digit = bytes[at + name.size()];
    digit = digit == '0' ? '1' : '0';
    const size_t text = bytes.find("limn part"), sum = bytes.find("checksum: ");
    bytes.replace(sum + 10, 8, fmt::format("{:08x}", checksum(bytes.substr(text, sum - text))));
    std::ofstream(part(k), std::ios::binary) << bytes;
  };
  choose_otherwise(2);
  const auto merged = [&] { return refused("merge " + all_parts() + " -o " + out()); };
  EXPECT_NE(merged().find("another run than " + part(2) + ": choice of the pilot is"),
            std::string::npos);
  EXPECT_NE(refused(command + " --part 2/3 -o " + part(2)).find("choice of the pilot was"),
            std::string::npos);
  choose_otherwise(1);
  choose_otherwise(3);
  EXPECT_NE(merged().find("cannot be joined here: choice of the pilot was"), std::string::npos);
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

}  // namespace
}  // namespace limn
