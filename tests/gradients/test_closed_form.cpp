// Every sampler on every closed-form scene: image, each term and the total of each parameter's
// derivative against their exact values, as z-scores.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "limn/integrators/methods.h"
#include "limn/integrators/statistics.h"
#include "support/test_names.h"

namespace limn {
namespace {

using nlohmann::json;

// Samples per pixel: 4096, or what LIMN_CLOSED_FORM_SPP says for a stricter run by hand.
int samples_per_pixel() {
  const char* spp = std::getenv("LIMN_CLOSED_FORM_SPP");
  return spp ? std::atoi(spp) : 4096;
}

// Chance that one comparison of a right program fails; there are some hundreds of them.
constexpr double kLevel = 1e-6;

const std::string kFolder = std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/";

// Read once: every test is a process of its own, which lists all tests first.
const json& references() {
  static const json scenes = [] {
    std::ifstream file(kFolder + "references.json");
    return json::parse(file)["scenes"];
  }();
  return scenes;
}

double largest_magnitude(const json& values) {
  double largest = 0;
  for (const json& value : values) largest = std::max(largest, std::fabs(value.get<double>()));
  return largest;
}

// A value to which only a few of the n samples contribute (its n-fold is few times the largest
// value, both exact and estimated): counts that small are not normal, and say nothing.
bool too_rare(double estimate, double exact, double largest, double n) {
  const double limit = 30 * largest / n;
  return exact != 0 && std::fabs(exact) < limit && std::fabs(estimate) < limit;
}

// z-scores of all values whose estimate varies; values without variance must be right to rounding:
// to the accuracy of the reference. fewest: samples of a term, in those per pixel.
// by_chance: positions on the film move by chance, and make much, by few samples, of what a pixel
// hardly sees.
void compare(const Moments& estimate, const json& exact, double accuracy, const std::string& name,
             double fewest, bool by_chance = false) {
  ASSERT_EQ(estimate.size(), exact.size()) << name;
  const double largest = largest_magnitude(exact);
  std::vector<double> z;
  for (size_t i = 0; i < estimate.size(); ++i) {
    const double residual = estimate.mean(i) - exact[i].get<double>();
    const double error = std::sqrt(estimate.variance(i));
    // Below the accuracy of the reference no statistics are possible.
    const double floor = accuracy * std::max(1.0, std::fabs(exact[i].get<double>()));
    if (too_rare(estimate.mean(i), exact[i], largest, fewest * estimate.samples())) continue;
    if (by_chance && std::fabs(exact[i].get<double>()) < 1e-3 * largest &&
        std::fabs(estimate.mean(i)) < 0.05 * largest) {
      continue;
    }
    if (error <= floor) {
      EXPECT_LE(std::fabs(residual), 8 * floor) << name << " value " << i;
      continue;
    }
    z.push_back(normal_from_student(residual / error, estimate.degrees()));
  }
  if (z.empty()) return;
  const ZSummary summary = summarize(z);
  fmt::print("{:64} {:4} values, mean z {:6.2f}, largest |z| {:5.2f}\n", name, summary.count,
             summary.mean, summary.largest);
  EXPECT_GE(summary.p_largest, kLevel) << name << ": largest |z| " << summary.largest;
}

// Method and scene file.
class ClosedForm : public testing::TestWithParam<std::tuple<std::string, std::string>> {};

const json& find_reference(const std::string& file) {
  for (const json& reference : references()) {
    if (reference["file"] == file) return reference;
  }
  throw InputError({file}, "has no reference");
}

// All that have exact values, and names of files where they are.
std::vector<std::string> parameters_of(const json& reference) {
  std::vector<std::string> names;
  for (const json& p : reference["parameters"]) {
    std::string name = p["name"];
    const size_t colon = name.find(':');
    if (colon != std::string::npos) name.insert(colon + 1, kFolder);
    names.push_back(name);
  }
  return names;
}

// samples: none where the method is to choose them.
void expect_exact(const std::string& method, const std::string& file,
                  const std::optional<SampleCounts>& samples, int spp = samples_per_pixel(),
                  const WarpOptions& warp = {}) {
  const json& reference = find_reference(file);
  const Scene scene = read_scene(kFolder + file, {}, nullptr);
  GradientOptions options;
  options.method = method;
  options.samples = samples;
  if (Method(method)->warps) options.warp = warp;
  options.parameters = parameters_of(reference);
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 7;
  const GradientResult result = gradient(scene, options, settings);
  EXPECT_EQ(result.non_finite.count, 0u) << result.non_finite.message();
  const double accuracy = reference["accuracy"];
  const double fewest = std::min(1.0, result.terms[result.term("camera")].samples);
  compare(result.radiance, reference["image"], accuracy, "image", fewest);
  for (size_t k = 0; k < options.parameters.size(); ++k) {
    const json& exact = reference["parameters"][k];
    const ParameterGradient& g = result.parameters[k];
    const std::string name = exact["name"];
    compare(g.total, exact["total"], accuracy, name, fewest,
            method.find("directions=random") != method.npos);
    if (Method(method)->only_sum_fixed) continue;
    for (size_t t = 0; t < result.terms.size(); ++t) {
      const std::string& term = result.terms[t].name;
      // Where regions of light are apart, the boundary term is three.
      if (term == "boundary" && result.terms.back().name == "penumbra") continue;
      if (!exact.contains(term) || exact[term].is_null()) continue;
      compare(g.terms[t], exact[term], accuracy, name + " " + term, fewest);
    }
  }
}

bool has_term(const json& reference, const std::string& term) {
  for (const json& parameter : reference["parameters"]) {
    const auto values = parameter.find(term);
    if (values == parameter.end() || !values->is_array()) continue;
    if (std::ranges::any_of(*values, [](const json& v) { return v != 0.0; })) return true;
  }
  return false;
}

TEST_P(ClosedForm, GradientIsExact) {
  const auto& [method, file] = GetParam();
  const bool chooses = Method(method)->only_sum_fixed && !Method(method)->is_variant();
  int spp = samples_per_pixel() / (Method(method)->warps ? 2 : 1);  // dear ones
  // Chosen, an eighth of the samples take as long as the others', with smaller errors: a tenth of
  // those of `forest` in most scenes. Not so in shadows of delta lights: three times as large ones.
  if (chooses && !has_term(find_reference(file), "shadow")) spp /= 8;
  // A wide kernel: its tails, and with them the largest samples, come often enough to be seen.
  const WarpOptions warp{8, 100};
  expect_exact(method, file, chooses ? std::nullopt : std::optional(SampleCounts{}), spp, warp);
}

// Whatever one sample per pixel holds.
class ClosedFormSamples : public testing::TestWithParam<std::tuple<SampleCounts, std::string>> {};

TEST_P(ClosedFormSamples, GradientIsExact) {
  const auto& [samples, file] = GetParam();
  expect_exact("forest", file, samples);
}

// Each scene with one of two counts, in turns.
std::vector<std::tuple<SampleCounts, std::string>> counts_and_files() {
  const SampleCounts counts[] = {{3, 0.3, 2}, {1, 2.5, 5}};
  std::vector<std::tuple<SampleCounts, std::string>> cases;
  for (const json& reference : references()) {
    cases.emplace_back(counts[cases.size() % 2], reference["file"]);
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(, ClosedFormSamples, testing::ValuesIn(counts_and_files()),
                         [](const auto& test) {
                           const std::string file = std::get<1>(test.param);
                           return test_name(to_string(std::get<0>(test.param)) + "_" +
                                            file.substr(0, file.find('.')));
                         });

// Read once, for the list of tests.
const Scene& listed_scene(const std::string& file) {
  static std::map<std::string, Scene> scenes;
  const auto found = scenes.find(file);
  if (found != scenes.end()) return found->second;
  return scenes.emplace(file, read_scene(kFolder + file, {}, nullptr)).first->second;
}

// Whether a method that takes few scenes has something to show.
bool takes(const MethodType& type, const std::string& file) {
  if (!type.check) return true;
  const Scene& scene = listed_scene(file);
  try {
    type.check(scene);
    return scene.max_depth > 1;
  } catch (const InputError&) {
    return false;
  }
}

// The rows of the table and, of each setting, the values that are not the default. `adaptive` and
// `silhouettes` choose edges by the code of `forest`, which stands for what all three have.
std::vector<std::string> all_methods() {
  const MethodType& forest = *Method("forest");
  std::vector<std::string> names;
  for (const MethodType& type : method_types()) {
    if (!type.terms_can_be_left_out) continue;
    names.push_back(type.name);
    for (const std::string& name : variants_of(type)) {
      const std::string setting = split_name(name)[1];
      const std::vector<std::string> known = variants_of(forest);
      const bool again = type.name != "forest" &&
                         std::find(known.begin(), known.end(), "forest:" + setting) != known.end();
      if (!again || type.name == "quadric") names.push_back(name);
    }
  }
  return names;
}

// A sampler of edges, whose other terms are those of `forest`.
bool draws_alike(const MethodType& type) {
  return !type.only_sum_fixed && type.name != "forest" && type.terms == Method("forest")->terms;
}

std::vector<std::tuple<std::string, std::string>> all_cases() {
  std::vector<std::tuple<std::string, std::string>> cases;
  size_t variants = 0;
  for (const std::string& name : all_methods()) {
    const Method method(name);
    const MethodType& type = *method;
    if (type.biased) continue;
    variants += type.is_variant() ? 1 : 0;
    size_t at = 0;
    for (const json& reference : references()) {
      // Where shading points see no edge move, samplers of edges do what `forest` does (see below),
      // and warped directions have nothing to show. How variants draw is tested edge by edge
      // (test_edge_samplers); that a term takes what they say is the same code for all, and each is
      // held against one scene in four, another four than the one before. Variants of other kinds
      // take every other scene.
      const bool sampler = type.is_variant() && !type.only_sum_fixed;
      if ((sampler || draws_alike(type) || type.warps) && !has_term(reference, "boundary"))
        continue;
      const std::string file = reference["file"];
      if (!takes(type, file)) continue;
      if (type.is_variant() && (++at + variants) % (sampler ? 4 : 2) != 0) continue;
      cases.emplace_back(name, file);
    }
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(, ClosedForm, testing::ValuesIn(all_cases()), [](const auto& test) {
  const std::string file = std::get<1>(test.param);
  return test_name(std::get<0>(test.param) + "_" + file.substr(0, file.find('.')));
});

// But for what rounding leaves of edges that do not move.
TEST(ClosedFormAlike, SamplersDifferOnlyWhereShadingPointsSeeEdgesMove) {
  size_t compared = 0;
  for (const json& reference : references()) {
    if (has_term(reference, "boundary")) continue;
    GradientOptions options;
    options.parameters = parameters_of(reference);
    const Scene& scene = listed_scene(reference["file"]);
    RunSettings settings;
    settings.spp = 4;
    settings.seed = 7;
    options.method = "forest";
    const GradientResult forest = gradient(scene, options, settings);
    for (const MethodType& type : method_types()) {
      if (!type.terms_can_be_left_out || !draws_alike(type)) continue;
      options.method = type.name;
      const GradientResult other = gradient(scene, options, settings);
      for (size_t k = 0; k < options.parameters.size(); ++k) {
        const Moments &a = other.parameters[k].total, &b = forest.parameters[k].total;
        for (size_t i = 0; i < a.size(); ++i) {
          EXPECT_NEAR(a.mean(i), b.mean(i), 1e-12 * (1 + std::fabs(b.mean(i))))
              << type.name << " " << options.parameters[k];
        }
      }
      ++compared;
    }
  }
  EXPECT_GT(compared, 60u);
}

// With many rays and a wide kernel, what is left of the bias of warped-area sampling drowns in the
// noise of these samples.
class ClosedFormWarped : public testing::TestWithParam<std::string> {};

TEST_P(ClosedFormWarped, IsNearlyExact) {
  expect_exact("was", GetParam(), SampleCounts{}, samples_per_pixel() / 16, {64, 100});
}

std::vector<std::string> files_with_boundary() {
  std::vector<std::string> files;
  for (const json& reference : references()) {
    if (has_term(reference, "boundary") && takes(*Method("was"), reference["file"])) {
      files.push_back(reference["file"]);
    }
  }
  return files;
}

INSTANTIATE_TEST_SUITE_P(, ClosedFormWarped, testing::ValuesIn(files_with_boundary()),
                         [](const auto& test) {
                           return test_name(test.param.substr(0, test.param.find('.')));
                         });

}  // namespace
}  // namespace limn
