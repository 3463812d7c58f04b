// Comparing methods: on closed-form scenes, with methods made for the test, interrupted, and with
// references that belong elsewhere.
#include "limn/integrators/compare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "integrators/methods/difference_method.h"
#include "limn/core/error.h"
#include "support/temp_files.h"

namespace limn {
namespace {

const std::string kFolder = std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/";
const std::string kFile = "half_hidden_lamp.xml";
const std::string kParameter = "lamp.translate.x";

// The same run whatever a machine does in the time: a number of samples instead of seconds.
class CountedMethod final : public TimedMethod {
 public:
  CountedMethod(std::unique_ptr<TimedMethod> method, int spp)
      : method_(std::move(method)), spp_(spp) {}
  std::string name() const override { return method_->name(); }
  std::string description() const override { return method_->description(); }
  MethodRun run(const RunSettings& settings) override {
    RunSettings counted = settings;
    counted.spp = spp_;
    counted.seconds = 0;
    return method_->run(counted);
  }

 private:
  std::unique_ptr<TimedMethod> method_;
  int spp_;
};

// A job on a closed-form scene of a few pixels.
struct Job {
  Scene scene = read_scene(kFolder + kFile, {}, nullptr);
  MethodInput input{scene, kParameter, {}, 0, 1};
  RunSettings settings;
  Job() { settings.seed = 5; }

  Reference reference(int spp) const {
    RunSettings run = settings;
    run.spp = spp;
    run.seed = derived_seed(settings.seed, "reference");
    return make_reference(input, run);
  }
  std::vector<std::unique_ptr<TimedMethod>> methods(const std::vector<std::string>& names,
                                                    int spp) const {
    std::vector<std::unique_ptr<TimedMethod>> made;
    for (const std::string& name : names) {
      made.push_back(std::make_unique<CountedMethod>(make_method(input, name), spp));
    }
    return made;
  }
};

// One value per channel of every pixel.
std::vector<double> exact_derivative() {
  std::ifstream file(kFolder + "references.json");
  const nlohmann::json all = nlohmann::json::parse(file);
  for (const auto& scene : all["scenes"]) {
    if (scene["file"] != kFile) continue;
    for (const auto& p : scene["parameters"]) {
      if (p["name"] == kParameter) return p["total"].get<std::vector<double>>();
    }
  }
  return {};
}

// All against the exact image: the reference and every method agree with it.
TEST(Compare, MethodsAgreeWithTheClosedForm) {
  const Job job;
  const Reference measured = job.reference(1024);
  Reference exact = measured;
  exact.image = exact_derivative();
  ASSERT_EQ(exact.image.size(), measured.image.size());
  const Film& film = job.scene.film;
  exact.blocks.sums = sum_blocks(exact.image, film.crop_width, film.crop_height, 1);
  const ZSummary z = summarize(bias_scores({measured.blocks}, exact.blocks, exact.edges));
  EXPECT_GT(p_value(z), 1e-6) << z.largest;

  CompareOptions options;
  options.times = {0.1};
  options.repeats = 2;
  for (const ComparedMethod& m :
       compare(options, exact, job.methods({"forest", "brute"}, 1024), job.settings)) {
    EXPECT_EQ(m.status, MethodStatus::kDone) << m.name << m.message;
    ASSERT_EQ(m.summary.size(), 1u);
    EXPECT_GT(m.summary[0].bias.count, 0) << m.name;
    EXPECT_GT(p_value(m.summary[0].bias), 1e-6) << m.name << m.summary[0].bias.largest;
    EXPECT_EQ(m.summary[0].term_seconds.size(), 3u);
  }
}

TEST(Compare, FindsABias) {
  Job job;
  const Reference reference = job.reference(1024);
  job.input.terms = {"interior", "camera"};
  CompareOptions options;
  options.times = {0.05};
  options.repeats = 2;
  const auto results = compare(options, reference, job.methods({"forest"}, 1024), job.settings);
  EXPECT_LT(p_value(results[0].summary[0].bias), 1e-6);
}

// What a method was asked, and an image with a known error.
class KnownMethod final : public TimedMethod {
 public:
  KnownMethod(std::string name, double error, std::vector<RunSettings>& log)
      : name_(std::move(name)), error_(error), log_(log) {}
  std::string name() const override { return name_; }
  std::string description() const override { return "made for a test"; }
  MethodRun run(const RunSettings& settings) override {
    log_.push_back(settings);
    names.push_back(name_);
    MethodRun run;
    run.image.assign(12, 1 + error_ / std::sqrt(settings.seconds));
    run.blocks.sums.assign(4, 3 * run.image[0]);
    run.seconds = settings.seconds;
    run.spp = 3;
    return run;
  }
  std::vector<MethodSetting> settings() const override {
    return {{"seconds", log_.back().seconds}};
  }
  static inline std::vector<std::string> names;

 private:
  std::string name_;
  double error_;
  std::vector<RunSettings>& log_;
};

class MissingMethod final : public TimedMethod {
 public:
  std::string name() const override { return "absent"; }
  std::string description() const override { return "not there"; }
  MethodRun run(const RunSettings&) override { throw MethodMissing("install it"); }
};

Reference known_reference() {
  Reference reference;
  reference.image.assign(12, 1.0);
  reference.variance.assign(12, 0.0);
  reference.blocks = {std::vector<double>(4, 3.0), std::vector<double>(4, 0.0), 10, 0};
  reference.edges.assign(4, 0.0);
  reference.spp = 2;
  return reference;
}

TEST(Compare, InterleavesWithSeedsOfTheirOwn) {
  KnownMethod::names.clear();
  std::vector<RunSettings> log;
  std::vector<std::unique_ptr<TimedMethod>> methods;
  methods.push_back(std::make_unique<KnownMethod>("a", 0.1, log));
  methods.push_back(std::make_unique<MissingMethod>());
  methods.push_back(std::make_unique<KnownMethod>("b", 0.2, log));
  CompareOptions options;
  options.times = {1, 2};
  options.repeats = 2;
  const auto results = compare(options, known_reference(), methods, RunSettings());
  EXPECT_EQ(KnownMethod::names, (std::vector<std::string>{"a", "b", "a", "b", "a", "b", "a", "b"}));
  std::set<uint64_t> seeds;
  for (const RunSettings& run : log) seeds.insert(run.seed);
  EXPECT_EQ(seeds.size(), log.size());
  EXPECT_EQ(log.front().seconds, 1);
  EXPECT_EQ(log.back().seconds, 2);

  EXPECT_EQ(results[1].status, MethodStatus::kMissing);
  EXPECT_EQ(results[1].message, "install it");
  EXPECT_TRUE(results[1].summary.empty());
  for (const size_t m : {0, 2}) {
    const double error = m == 0 ? 0.1 : 0.2;
    EXPECT_EQ(results[m].status, MethodStatus::kDone);
    ASSERT_EQ(results[m].summary.size(), 2u);
    EXPECT_NEAR(results[m].summary[0].mse.value, error * error, 1e-12);
    EXPECT_NEAR(results[m].summary[1].mse.value, error * error / 2, 1e-12);
    EXPECT_NEAR(results[m].slope->value, -1, 1e-9);
    EXPECT_NEAR(results[m].image[0], 1 + error / std::sqrt(2), 1e-12);  // the longest time
    EXPECT_EQ(std::get<double>(results[m].settings[0].value), 2);
  }
  EXPECT_NEAR(results[0].time_ratio->value, 1, 1e-12);
  EXPECT_NEAR(results[2].time_ratio->value, 4, 1e-9);
}

TEST(Compare, AnInterruptKeepsFinishedRuns) {
  const Job job;
  const Reference reference = job.reference(64);
  std::atomic<bool> stop = false;
  RunSettings settings = job.settings;
  settings.interrupted = &stop;
  settings.progress = [&](double done) { stop = stop || done > 0.55; };  // in the second run
  CompareOptions options;
  options.times = {0.05};
  options.repeats = 1;
  const auto results =
      compare(options, reference, job.methods({"forest", "uniform"}, 1024), settings);
  EXPECT_EQ(results[0].status, MethodStatus::kDone);
  EXPECT_EQ(results[0].runs.size(), 1u);
  EXPECT_FALSE(results[0].image.empty());
  EXPECT_EQ(results[1].status, MethodStatus::kInterrupted);
  EXPECT_EQ(results[1].message, "interrupted after 0 of 1 runs");
  EXPECT_TRUE(results[1].image.empty());
}

// Warped-area sampling with two rays is wrong, and a comparison says so of it alone.
TEST(Compare, SeesABias) {
  const Scene scene = read_scene(kFolder + "lamp_in_beckmann.xml", {}, nullptr);
  const MethodInput input{scene, "lamp.translate.x", {}, 0, 1, SampleCounts{}, {2, 100}};
  RunSettings settings;
  settings.seed = 5;
  settings.spp = 32768;
  const Reference reference = make_reference(input, settings);
  std::vector<std::unique_ptr<TimedMethod>> methods;
  for (const char* name : {"forest", "was"}) {
    methods.push_back(std::make_unique<CountedMethod>(make_method(input, name), 8192));
  }
  CompareOptions options;
  options.times = {1};
  options.repeats = 3;
  const auto results = compare(options, reference, methods, settings);
  EXPECT_GT(results[0].summary[0].bias.p_largest, 1e-3);
  EXPECT_LT(results[1].summary[0].bias.p_largest, 1e-4);
}

TEST(Methods, AreTheSamplersAndDifferences) {
  const Job job;
  std::set<std::string> names;
  for (const std::string& name : method_names(Task::kGradient)) {
    names.insert(name);
    EXPECT_EQ(make_method(job.input, name)->name(), name);
  }
  EXPECT_THROW(make_method(job.input, "path"), InputError);
  EXPECT_TRUE(names.count("forest") && names.count("brute") && names.count("fd"));
  try {
    make_method(job.input, "forrest");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("known: adaptive, "), std::string::npos);
  }
}

TEST(Differences, TakeTheStepThatIsGiven) {
  Job job;
  job.input.step = 0.015625;
  const auto method = make_method(job.input, "fd");
  RunSettings settings = job.settings;
  settings.spp = 64;
  const MethodRun run = method->run(settings);
  EXPECT_EQ(run.spp, 64);
  EXPECT_GT(run.rays, 0u);
  EXPECT_EQ(run.term_seconds.size(), 1u);
  EXPECT_EQ(run.blocks.variances.size(), run.blocks.sums.size());
  ASSERT_EQ(method->settings().size(), 2u);
  EXPECT_EQ(std::get<double>(method->settings()[0].value), 0.015625);
}

// The sum over the image, resolved to a tenth.
TEST(Differences, AgreeWithTheClosedForm) {
  Job job;
  job.input.step = 0.015625;
  RunSettings settings = job.settings;
  settings.spp = 32768;
  const MethodRun run = make_method(job.input, "fd")->run(settings);
  const std::vector<double> exact = exact_derivative();
  const double truth = std::accumulate(exact.begin(), exact.end(), 0.0);
  const double found = std::accumulate(run.image.begin(), run.image.end(), 0.0);
  const std::vector<double>& variances = run.blocks.variances;
  const double error = std::sqrt(std::accumulate(variances.begin(), variances.end(), 0.0));
  EXPECT_LT(std::fabs(found - truth), 4.5 * error) << found << " +- " << error << ", " << truth;
  EXPECT_LT(error, 0.1 / 6.2 * std::fabs(truth));
}

// Trials of exact power laws: squared bias B h^4, variance V / h^power.
std::vector<StepTrial> trials_of(double bias, double variance, double power) {
  std::vector<StepTrial> trials;
  for (int k = 0; k < 5; ++k) {
    const double h = 0.001 * std::pow(4, k);
    const double change = std::sqrt(bias) * (h * h - h * h / 16);
    trials.push_back({h, variance * std::pow(h, -power), k > 0 ? change * change : 1e9});
  }
  return trials;
}

TEST(Differences, BestStepIsTheMinimum) {
  for (const double power : {0.5, 1.0, 2.0}) {
    for (const double optimum : {0.004, 0.01, 0.03, 0.06}) {
      const double bias = 10, samples = 100;
      // The derivative of B h^4 + V h^-power / n is zero there.
      const double variance = 4 * bias * samples / power * std::pow(optimum, 4 + power);
      const StepForecast found = best_step(trials_of(bias, variance, power), samples);
      EXPECT_NEAR(found.step, optimum, 1e-9 * optimum);
      const double squared_bias = bias * std::pow(optimum, 4);
      EXPECT_NEAR(found.squared_bias, squared_bias, 1e-9 * squared_bias);
      EXPECT_NEAR(found.variance, 4 / power * squared_bias, 1e-9 * squared_bias);
      EXPECT_GE(found.most_squared_bias, found.squared_bias);
    }
  }
  // Without bias the largest step, without noise the smallest.
  EXPECT_DOUBLE_EQ(best_step(trials_of(0, 1, 1), 100).step, 0.256);
  EXPECT_DOUBLE_EQ(best_step(trials_of(1, 0, 1), 100).step, 0.001);
  // Noise that does not fall with the step: as small as the bias needs it, whatever is far away.
  std::vector<StepTrial> trials = trials_of(10, 1, 0);
  EXPECT_LT(best_step(trials, 100).step, 0.256);
  // A squared bias that the pilot cannot tell from none may be there, and is less at smaller steps:
  // 0.0228 beside an error of 0.0039 at the largest, 0.0014 beside 0.0156 at the next.
  trials = trials_of(0, 0.1, 1);
  for (StepTrial& trial : trials) trial.change_error = 0.02;
  EXPECT_NEAR(best_step(trials, 100).step, 0.064 * std::pow(0.015625 / (4 * 0.0014222), 0.2), 1e-5);
}

// Edges along the columns of pixels: those within a step of a border have a bias of their own size,
// and the mean square falls with h alone.
TEST(Differences, BestStepKnowsEdgesAtTheBordersOfPixels) {
  std::vector<StepTrial> trials;
  for (int k = 0; k < 5; ++k) {
    const double h = 0.001 * std::pow(4, k);
    trials.push_back({h, 1 / h, 100 * h});
  }
  // 100 h + 1 / (10^4 h) is least at h = 0.001.
  const double step = best_step(trials, 1e4).step;
  EXPECT_LE(100 * step + 1e-4 / step, 1.5 * (100 * 0.001 + 1e-4 / 0.001));
}

// A step so large that all has moved away changes no further: what the next one shows is no less.
TEST(Differences, BestStepKnowsStepsBeyondWhatMoves) {
  const std::vector<StepTrial> trials = {{0.00067, 1850, -1, 3.1},
                                         {0.0027, 145, -1, 3.1},
                                         {0.0106, 11.4, 0.63, 1.03},
                                         {0.0426, 0.9, 0.68, 0.15},
                                         {0.17, 0.07, 0.28, 0.027}};
  EXPECT_LT(best_step(trials, 620).step, 0.0106);
  // A slat that all larger steps carry past the window: their bias is at least what the smaller one
  // shows, (16 / 15)^2 times its change, though they change no further and have no noise.
  const std::vector<StepTrial> slat = {{0.0001, 400, 0, 1},
                                       {0.0004, 100, 50, 5},
                                       {0.0016, 0, 0.1, 0.01},
                                       {0.0064, 0, 0.01, 0.001},
                                       {0.0256, 0, 0, 0.001}};
  const StepForecast far = best_step(slat, 1);
  EXPECT_GT(far.step, 0.0004);
  EXPECT_GE(far.most_squared_bias, (50 - 5) * std::pow(16 / 15.0, 2) * 0.999);
}

TEST(Differences, APilotThatTookAllTheTimeLeavesTheFewestSamples) {
  EXPECT_DOUBLE_EQ(samples_behind_pilot(80, 0.5, 2), 40);
  EXPECT_DOUBLE_EQ(samples_behind_pilot(80, 0.01, 2), 2);
  EXPECT_DOUBLE_EQ(samples_behind_pilot(80, -0.43, 2), 2);
}

TEST(Differences, VarianceThatAPilotHasNotMetIsExtrapolated) {
  // An exact law stays as it is.
  for (const double power : {0.0, 1.0, 2.0}) {
    std::vector<StepTrial> trials = trials_of(1, 1, power);
    extrapolate_variances(trials);
    for (int k = 0; k < 5; ++k) {
      EXPECT_NEAR(trials[k].variance * std::pow(trials[k].step, power), 1, 1e-12);
    }
  }
  // Edges that the smaller steps did not meet.
  std::vector<StepTrial> trials = trials_of(10, 1, 1);
  for (int k = 0; k < 3; ++k) trials[k].variance = 0;
  extrapolate_variances(trials);
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(trials[k].variance * trials[k].step, 1, 1e-12);
  // Nor any but the largest, or not all of them, beside noise that all have.
  for (int k = 0; k < 4; ++k) trials[k].variance = 0;
  extrapolate_variances(trials);
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(trials[k].variance * trials[k].step, 1, 1e-12);
  trials = trials_of(10, 1, 1);
  trials[3].variance = 0.5 * trials[4].variance;
  extrapolate_variances(trials);
  EXPECT_NEAR(trials[3].variance, 2.5 * trials[4].variance, 1e-12);
  // No growth beyond that of two unrelated images, none without any variance.
  trials = trials_of(1, 0, 1);
  trials[3].variance = 1000;
  trials[4].variance = 1;
  extrapolate_variances(trials);
  EXPECT_DOUBLE_EQ(trials[2].variance, 16000);
  trials = trials_of(1, 0, 1);
  extrapolate_variances(trials);
  EXPECT_EQ(trials[0].variance, 0);
}

class ReferenceFile : public testing::Test {
 protected:
  ReferenceFile() {
    reference_ = job_.reference(64);
    reference_.asked_seconds = 0.02;
    write_reference(file_, reference_, identity(), job_.scene.film, 1);
  }
  Identity identity() const { return identify(job_.input, {}); }
  Reference read(const Identity& identity) const {
    return read_reference(file_, identity, job_.scene.film);
  }
  // The message of a refusal.
  std::string refusal(const Identity& identity) const {
    try {
      read(identity);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  TempFiles files_;
  Job job_;
  std::string file_ = files_.path("reference.exr");
  Reference reference_;
};

TEST_F(ReferenceFile, IsReadAsItWasWritten) {
  const Reference back = read(identity());
  EXPECT_TRUE(back.cached);
  EXPECT_EQ(back.seed, reference_.seed);
  EXPECT_EQ(back.spp, reference_.spp);
  EXPECT_EQ(back.method, Method(Task::kCompare).name());
  EXPECT_EQ(back.asked_seconds, 0.02);
  EXPECT_EQ(back.blocks.variances, reference_.blocks.variances);
  EXPECT_EQ(back.blocks.degrees, reference_.blocks.degrees);
  EXPECT_EQ(back.edges, reference_.edges);
  for (size_t i = 0; i < back.image.size(); ++i) {  // rounded to float
    EXPECT_NEAR(back.image[i], reference_.image[i], 1e-7 * std::fabs(reference_.image[i]));
    EXPECT_NEAR(back.variance[i], reference_.variance[i], 1e-6 * reference_.variance[i]);
  }
}

TEST_F(ReferenceFile, OfSomethingElseIsRefused) {
  const MethodInput other{job_.scene, "lamp.translate.z", {}, 0, 1};
  std::string text = refusal(identify(other, {}));
  EXPECT_NE(text.find("reference.exr: error: the reference belongs to something else"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("parameter: \"lamp.translate.x\" there, \"lamp.translate.z\" here"),
            std::string::npos)
      << text;
  EXPECT_EQ(text.find("terms"), std::string::npos) << text;

  const MethodInput edges{job_.scene, kParameter, {"camera", "boundary"}, 0, 1};
  EXPECT_NE(refusal(identify(edges, {})).find("terms: "), std::string::npos);
  EXPECT_NE(refusal(identify(job_.input, {{"spp", "3"}})).find("defines: "), std::string::npos);
  job_.scene = read_scene(kFolder + "lamp_in_beckmann.xml", {}, nullptr);
  text = refusal(identity());
  EXPECT_NE(text.find("content of the scene file"), std::string::npos) << text;
  EXPECT_NE(text.find("content of the scene's meshes and maps"), std::string::npos) << text;
}

TEST_F(ReferenceFile, MustBeWhole) {
  std::filesystem::remove(files_.path("reference_stderr.exr"));
  EXPECT_NE(refusal(identity()).find("standard errors is missing"), std::string::npos);
  write_exr(file_, Image(4, 4, 3), false, {});
  EXPECT_NE(refusal(identity()).find("is not a reference"), std::string::npos);
}

TEST_F(ReferenceFile, IsUsedAgainIfItIsLongEnough) {
  std::string why;
  const auto find = [&](double seconds) {
    return find_reference(file_, identity(), job_.scene.film, seconds, why);
  };
  EXPECT_TRUE(find(0.02));
  EXPECT_EQ(why, "");
  EXPECT_FALSE(find(0.03));
  EXPECT_NE(why.find("less than the 0.03 s asked for"), std::string::npos) << why;
  EXPECT_FALSE(find_reference(files_.path("none.exr"), identity(), job_.scene.film, 0, why));
  EXPECT_EQ(why, "");
}

}  // namespace
}  // namespace limn
