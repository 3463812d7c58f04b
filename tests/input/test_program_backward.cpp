// `limn backward` as a user meets it: single samples, reports of outliers.

#include "support/program.h"

namespace limn {
namespace {

class BackwardProgram : public Program {
 protected:
  std::string adjoint() const { return files_.path("adjoint.exr"); }
  std::string command() const {
    return "backward " + scene_ + " --adjoint " + adjoint() + " -o " + files_.path("back");
  }
  static double number_after(const std::string& text, const std::string& words) {
    const size_t at = text.find(words);
    EXPECT_NE(at, std::string::npos) << words << " in " << text;
    return at == std::string::npos ? 0 : std::stod(text.substr(at + words.size()));
  }
};

// Each sample alone adds what it adds to the run: with one pixel that counts they are few.
TEST_F(BackwardProgram, RepeatsEverySampleOfAPixel) {
  Image one(8, 8, 3);
  for (int c = 0; c < 3; ++c) one.at(4, 5, c) = 1;
  write_exr(adjoint(), one, false, {});
  constexpr int kSamples = 5;
  const std::string figures = files_.path("figures.json");
  const std::string run_line =
      command() + " --wrt blaze.radiance.g --wrt screen.vertex_positions --pixels uniform" +
      fmt::format(" --spp {} --batches 1 --terms interior,boundary", kSamples);
  ASSERT_EQ(run(run_line + " --json " + figures).status, 0);
  const json report = json::parse(std::ifstream(figures));
  double sum = 0;
  for (int s = 0; s < kSamples; ++s) {
    const Outcome outcome = run(run_line + fmt::format(" --debug-sample 4,5,{}", s));
    ASSERT_EQ(outcome.status, 0) << outcome.text;
    EXPECT_NE(outcome.text.find("vertex 0: face "), std::string::npos) << outcome.text;
    EXPECT_NE(outcome.text.find("parameter 2: screen.vertex_positions"), std::string::npos);
    EXPECT_NE(outcome.text.find("of 12 numbers"), std::string::npos) << outcome.text;
    sum += number_after(outcome.text, "sum: parameter 1: ");
  }
  const double mean = report["parameters"][0]["value"];
  EXPECT_GT(mean, 0);
  EXPECT_NEAR(sum, mean, 1e-5 * mean);
  EXPECT_NE(refused(run_line + " --debug-sample 4,5,5")
                .find("there is no sample 5 in this run of 5 samples"),
            std::string::npos);
  EXPECT_NE(refused(run_line + " --debug-sample camera,1").find("has no samples on the film here"),
            std::string::npos);
}

// The command that a report gives shows the sample: of paths by the adjoint, and of the film.
TEST_F(BackwardProgram, TellsHowToRepeatItsLargestSamples) {
  ASSERT_EQ(run("render " + scene_ + " --spp 2 --quiet -o " + adjoint()).status, 0);
  const Outcome outcome = run(command() + " --spp 7 --batches 3 --stats");
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  int traced = 0;
  for (const char* term : {"interior: one sample is ", "camera: one sample is "}) {
    const double share = number_after(outcome.text, term);
    EXPECT_GT(share, 0);
    EXPECT_LE(share, 100);
    const size_t begin = outcome.text.find("  trace: limn ", outcome.text.find(term)) + 14;
    const std::string line = outcome.text.substr(begin, outcome.text.find('\n', begin) - begin);
    EXPECT_NE(line.find(" --debug-sample "), std::string::npos) << line;
    const Outcome one = run(line);
    EXPECT_EQ(one.status, 0) << one.text;
    EXPECT_NE(one.text.find("film po"), std::string::npos) << one.text;
    EXPECT_NE(one.text.find("numbers, root of their squares "), std::string::npos) << one.text;
    ++traced;
  }
  EXPECT_EQ(traced, 2);
  EXPECT_NE(run(command() + " --time 1 --debug-sample 1,1,1").status, 0);
}

}  // namespace
}  // namespace limn
