// Tests of stated power: every term of the derivative times 1.1 fails one of these with 95 %.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "integrators/lights/light_regions.h"
#include "limn/core/image.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/methods.h"
#include "support/meshes.h"
#include "support/scenes.h"
#include "support/term_factor.h"
#include "support/test_names.h"

namespace limn {
namespace {

using nlohmann::json;

constexpr int kRuns = 32;

const std::string kFolder = std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/";

const json& references() {
  static const json scenes = [] {
    std::ifstream file(kFolder + "references.json");
    return json::parse(file)["scenes"];
  }();
  return scenes;
}

// A term of the scenes in scenes/closed_form, and how it is computed.
struct ExactCase {
  std::string term, method;
  std::vector<std::string> computed;  // what together is the term
  int spp = 0;                        // of each run
  double scale = 0.1;                 // a fault of this size is found
  bool reverse = false;
};

void PrintTo(const ExactCase& of, std::ostream* to) { *to << of.method << ", " << of.term; }

// One of these scenes, and the first parameters for which the term is not zero.
struct ExactTerm {
  std::string name;
  Scene scene;
  std::vector<std::string> parameters;
  Values exact;
  size_t group = 0;
};

// Few samples find the edges that a glossy floor shows sharply: a tenth would take a million. Few
// of those before lights go straight through a mask: that would take ten times the others' samples.
// So few of the film's go through two faces of glass that it would take a hundred times as many.
bool is_too_noisy(const std::string& name, const ExactCase& of) {
  return (name == "wedge_in_gloss" && of.term == "boundary") ||
         (name == "lamp_behind_mask" && of.computed.size() > 1) ||
         (name.starts_with("lamps_through_") && of.term == "camera");
}

// How many times the samples of the others a scene takes: the floor of this one is glossy, too, and
// its checkerboard has edges all over it. Only some samples refract into the water of another. One
// point of a lens, or one of parallel rays, sees less of a mirror than a pinhole's film.
int more_samples(const std::string& name, const ExactCase& of) {
  if (name == "lamps_under_water" && of.term == "camera") return 32;
  if (name.starts_with("square_in_mirror_")) return 12;
  if (name == "lamp_in_corner") return 8;
  // In reverse mode these are noisier than all others.
  if (of.reverse && (name == "wedge_in_gloss" || name == "lamp_behind_mask" ||
                     name.starts_with("lamps_through_"))) {
    return 4;
  }
  return name == "board_in_gloss" ? 3 : 1;
}

// None where the term is zero.
std::optional<ExactTerm> exact_term(const json& reference, const ExactCase& of) {
  constexpr size_t kMost = 4;  // of one pass
  ExactTerm result;
  const std::string file = reference["file"];
  result.name = file.substr(0, file.find('.'));
  if (is_too_noisy(result.name, of)) return {};
  for (const json& p : reference["parameters"]) {
    if (!p.contains(of.term) || p[of.term].is_null() || result.parameters.size() == kMost) continue;
    const Values values = p[of.term];
    const std::string name = p["name"];
    if (name.find(':') != name.npos) continue;
    if (std::ranges::all_of(values, [](double v) { return v == 0; })) continue;
    result.parameters.push_back(name);
    result.group = values.size();
    append(result.exact, values);
  }
  if (result.parameters.empty()) return {};
  result.scene = read_scene(kFolder + file, {}, nullptr);
  if (of.computed.size() > 1 && !LightRegions::any_in(result.scene)) return {};
  return result;
}

class ExactTerms : public testing::TestWithParam<ExactCase> {};

// Of every scene alone.
TEST_P(ExactTerms, HaveTheirFactor) {
  const ExactCase& of = GetParam();
  for (const json& reference : references()) {
    const auto known = exact_term(reference, of);
    if (!known) continue;
    GradientOptions options;
    options.parameters = known->parameters;
    options.method = of.method;
    options.terms = of.computed;
    std::vector<Values> errors;
    for (int j = 0; j < kRuns; ++j) {
      const int spp = of.spp * more_samples(known->name, of);
      const auto values = run_term(known->scene, options, of.computed, spp, 100 + j);
      errors.push_back(difference(values.total, known->exact));
    }
    expect_factor(fmt::format("{} of {}", of.term, known->name),
                  term_factor(errors, std::vector<Values>(kRuns, known->exact),
                              std::vector<size_t>(known->parameters.size(), known->group)),
                  of.scale);
  }
}

// The name of a case.
std::string case_name(const testing::TestParamInfo<ExactCase>& test) {
  return test.param.computed.size() > 1 ? "light_sets" : test.param.term;
}

const std::vector<std::string> kLightSets = {"boundary", "direct", "penumbra"};

INSTANTIATE_TEST_SUITE_P(, ExactTerms,
                         testing::Values(ExactCase{"interior", "forest", {"interior"}, 1024},
                                         ExactCase{"camera", "forest", {"camera"}, 256, 0.05},
                                         ExactCase{"boundary", "forest", {"boundary"}, 1536},
                                         ExactCase{"boundary", "silhouettes", kLightSets, 512},
                                         ExactCase{"shadow", "forest", {"shadow"}, 4096}),
                         case_name);

// Of the parameters' images, by the sum of magnitudes.
size_t largest_image(const ExactTerm& term) {
  Values sums(term.parameters.size());
  for (size_t i = 0; i < term.exact.size(); ++i) sums[i / term.group] += std::fabs(term.exact[i]);
  return std::ranges::max_element(sums) - sums.begin();
}

// Reverse mode: sums over pixels, weighed by the signs of the largest image.
class ExactReverseTerms : public testing::TestWithParam<ExactCase> {};

TEST_P(ExactReverseTerms, HaveTheirFactor) {
  const ExactCase& of = GetParam();
  for (const json& reference : references()) {
    const auto known = exact_term(reference, of);
    if (!known) continue;
    const Film& film = known->scene.film;
    Image adjoint(film.crop_width, film.crop_height, 3);
    const auto first = known->exact.begin() + largest_image(*known) * known->group;
    for (size_t i = 0; i < adjoint.data.size(); ++i) adjoint.data[i] = first[i] < 0 ? -1 : 1;
    BackwardOptions options;
    Values exact;
    for (size_t k = 0; k < known->parameters.size(); ++k) {
      double sum = 0, size = 0;
      for (size_t i = 0; i < known->group; ++i) {
        const double value = adjoint.data[i] * known->exact[k * known->group + i];
        sum += value;
        size += std::fabs(value);
      }
      if (std::fabs(sum) < 0.3 * size) continue;  // it cancels
      options.parameters.push_back(known->parameters[k]);
      exact.push_back(sum);
    }
    options.method = of.method;
    options.terms = of.computed;
    RunSettings settings;
    settings.spp = of.spp * more_samples(known->name, of);
    std::vector<Values> errors;
    for (int j = 0; j < kRuns; ++j) {
      settings.seed = 300 + j;
      const BackwardResult result = backward(known->scene, adjoint, options, settings);
      EXPECT_EQ(result.non_finite.count, 0u);
      Values found;
      for (const ParameterAdjoint& p : result.parameters) {
        double& sum = found.emplace_back(0);
        for (size_t i = 0; i < p.moments.size(); ++i) sum += p.moments.mean(i);
      }
      errors.push_back(difference(found, exact));
    }
    expect_factor(fmt::format("{} of {}", of.term, known->name),
                  term_factor(errors, std::vector<Values>(kRuns, exact),
                              std::vector<size_t>(exact.size(), 1)),
                  of.scale);
  }
}

INSTANTIATE_TEST_SUITE_P(
    , ExactReverseTerms,
    testing::Values(ExactCase{"interior", "forest", {"interior"}, 896, 0.1, true},
                    ExactCase{"camera", "forest", {"camera"}, 256, 0.05},
                    ExactCase{"boundary", "forest", {"boundary"}, 1536},
                    ExactCase{"boundary", "silhouettes", kLightSets, 512},
                    ExactCase{"shadow", "forest", {"shadow"}, 6144}),
    case_name);

// A term of a method that divides the derivative among terms in a way of its own: the total of all
// its terms against that of another method, or exact values.
struct SharedCase {
  std::vector<std::string> parameters;
  std::string method, term;
  int spp;
  std::string other;
  int other_spp;
};

void expect_shared_factor(const Scene& scene, const SharedCase& of, const Values* exact = nullptr) {
  GradientOptions options;
  options.parameters = of.parameters;
  GradientOptions other = options;
  options.method = of.method;
  if (!exact) other.method = of.other;
  std::vector<Values> errors, terms;
  for (int j = 0; j < kRuns; ++j) {
    const TermRunValues a = run_term(scene, options, {of.term}, of.spp, 500 + j);
    errors.push_back(difference(
        a.total, exact ? *exact : run_term(scene, other, {}, of.other_spp, 700 + j).total));
    terms.push_back(a.term);
  }
  const size_t count = of.parameters.size();
  expect_factor(of.method + " " + of.term,
                term_factor(errors, terms, std::vector<size_t>(count, errors[0].size() / count)));
}

// Edges on the film against samples that move at random: through all three filters.
TEST(SharedTerms, FilterHasItsFactor) {
  for (const char* filter : {"box", "tent", "gaussian"}) {
    const std::string file = fmt::format("lamps_in_view_{}.xml", filter);
    for (const json& reference : references()) {
      if (reference["file"] != file) continue;
      const auto known = exact_term(reference, {"camera", "forest", {"camera"}});
      expect_shared_factor(
          known->scene,
          {known->parameters, "silhouettes:directions=random:film=moving", "filter", 256, "", 0},
          &known->exact);
    }
  }
}

// The shadow of a body beside the view, from a small area light far above it: thinner than a pixel.
Scene thin_penumbra_scene(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 6, 0.5};
  parts.target = {0, 0, 0};
  parts.fov = 14;
  parts.width = parts.height = 4;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.3,
                         {1.4, 1, 0.1}, diffuse("clay", "0.1, 0.1, 0.1")) +
               square("lamp", 0.1, 90, {5.2, 4, 0.3}, area_light("glow", "300, 300, 300"));
  return make_scene(files, parts);
}

TEST(SharedTerms, PenumbraHasItsFactor) {
  const TempFiles files;
  expect_shared_factor(thin_penumbra_scene(files), {{"body.translate.x", "body.translate.y",
                                                     "body.rotate.y", "lamp.translate.y"},
                                                    "silhouettes",
                                                    "penumbra",
                                                    2048,
                                                    "analytic",
                                                    2048});
}

// A glossy plate just above a floor, whose edges light up what lies a fraction of a pixel away:
// lines that are scattered add 2.06. The truth is from differences of images at 1,000,000 samples,
// with an error of 0.01.
TEST(SharedTerms, ScatteredLinesHaveTheirFactor) {
  constexpr double kTruth = -0.112, kScattered = 2.06;
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0.3, 2, 3};
  parts.target = {0, 0, 0};
  parts.width = parts.height = 8;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               R"(<shape type="cube" id="plate"><transform name="to_world">
                    <scale x=".6" y=".009" z=".42"/><translate y=".0095"/></transform>
                    <bsdf type="roughconductor"><float name="alpha" value=".16"/>
                      <string name="distribution" value="beckmann"/></bsdf></shape>)" +
               square("lamp", 0.14, 90, {-0.2, 2.7, -0.4}, area_light("glow", "60, 50, 40"));
  const Scene scene = make_scene(files, parts);
  GradientOptions options;
  options.parameters = {"plate.translate.z"};
  std::vector<Values> errors;
  for (int j = 0; j < kRuns; ++j) {
    RunSettings settings;
    settings.spp = 1024;
    settings.seed = 1300 + j;
    errors.push_back({gradient(scene, options, settings).parameters[0].image_sum.mean(0) - kTruth});
  }
  expect_factor("scattered lines",
                term_factor(errors, std::vector<Values>(kRuns, {kScattered}), {1}));
}

// A sun of 1.5 degrees in a dim sky.
std::string sun_in_sky(const TempFiles& files, const Vec3d& axis) {
  Image map(512, 256, 3);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double phi = 2 * kPi * (x + 0.5) / map.width, theta = kPi * y / (map.height - 1);
      const Vec3d w{std::sin(phi) * std::sin(theta), std::cos(theta),
                    -std::cos(phi) * std::sin(theta)};
      const bool bright = dot(w, normalize(axis)) > std::cos(1.5 * kPi / 180);
      for (int c = 0; c < 3; ++c) map.at(x, y, c) = bright ? 4000.0f : 0.2f;
    }
  }
  write_exr(files.path("sun.exr"), map, false, {});
  return fmt::format(
      R"(<emitter type="envmap" id="sky"><string name="filename" value="{}"/></emitter>)",
      files.path("sun.exr"));
}

// Directions that turn at random sweep over silhouettes before a sun, which `direct` and `penumbra`
// share: what they add for that, interior takes back. A wrong sign doubles or undoes it.
TEST(SharedTerms, TurnsBeforeTheSunHaveTheirFactor) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 6, 0.5};
  parts.target = {0, 0, 0};
  parts.fov = 14;
  parts.width = parts.height = 4;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.3,
                         {1, 1.5, 0.1}, diffuse("clay", "0.1, 0.1, 0.1")) +
               sun_in_sky(files, {0.7, 1, 0.05});
  const Scene scene = make_scene(files, parts);
  const std::vector<std::string> sets = {"boundary", "direct", "penumbra"};
  GradientOptions turned, held;
  turned.parameters = held.parameters = {"body.translate.x", "body.rotate.y"};
  turned.method = "silhouettes:directions=random";
  held.method = "silhouettes";
  std::vector<Values> errors, terms;
  for (int j = 0; j < kRuns; ++j) {
    const TermRunValues a = run_term(scene, turned, sets, 1024, 900 + j);
    const TermRunValues b = run_term(scene, held, sets, 512, 1100 + j);
    errors.push_back(difference(a.total, b.total));
    terms.push_back(difference(a.term, b.term));
  }
  expect_factor("turns before the sun",
                term_factor(errors, terms, {errors[0].size() / 2, errors[0].size() / 2}), 0.5);
}

}  // namespace
}  // namespace limn
