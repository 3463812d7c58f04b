// Terms that no parameter of a run can change are left out: beside a parameter that has all of
// them, what each adds for the others is zero to the last bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "limn/core/image.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/check.h"
#include "limn/integrators/gradient.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// Shapes, a camera, a BSDF with an alpha and one with a texture, and a light of every kind.
Scene scene_with_all(const TempFiles& files, const std::string& more = "") {
  SceneParts parts;
  parts.width = parts.height = 8;
  parts.body =
      more + ball_over_gloss(files, 0.3) +
      square("wall", 1.5, 0, {0, 1, -1.5},
             R"(<bsdf type="diffuse" id="paint"><texture type="checkerboard" name="reflectance"/>
                </bsdf>)") +
      R"(<emitter type="point" id="dot"><point name="position" value="1,3,1"/></emitter>
         <emitter type="spot" id="beam"><transform name="to_world">
         <lookat origin="-1,4,1" target="0,0,0" up="1,0,0"/></transform></emitter>
         <emitter type="directional" id="noon"><vector name="direction" value="0.2,-1,0.1"/>
         </emitter>)";
  return make_scene(files, parts);
}

GradientResult run(const Scene& scene, const std::vector<std::string>& parameters,
                   const std::string& method, int spp = 16) {
  GradientOptions options;
  options.method = method;
  options.parameters = parameters;
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 3;
  settings.threads = 1;
  return gradient(scene, options, settings);
}

// Scalars, and a component of every array.
std::vector<std::string> some_of_all(const Scene& scene) {
  std::vector<std::string> names;
  for (const Parameter& p : list_parameters(scene)) {
    std::string name = p.name;
    if (p.array.size() == 3) name += ".1.1.g";
    if (p.array.size() == 2) name += ".2.y";
    if (p.array.size() == 1) name += ".2";
    names.push_back(name);
  }
  return names;
}

bool is_zero(const Moments& moments) {
  for (size_t i = 0; i < moments.size(); ++i)
    if (moments.mean(i) != 0 || moments.variance(i) != 0) return false;
  return true;
}

std::set<std::string> names_of(const GradientResult& result) {
  std::set<std::string> names;
  for (const TermRun& term : result.terms) names.insert(term.name);
  return names;
}

TEST(ChangedTerms, AreAllThatDifferFromZero) {
  const TempFiles files;
  const Scene scene = scene_with_all(files);
  for (const std::string method : {"silhouettes", "forest"}) {
    std::set<std::string> zero;  // of some parameter
    std::vector<std::string> names = some_of_all(scene);
    names.emplace_back("ball.translate.x");
    const GradientResult joint = run(scene, names, method, 4);
    for (const ParameterGradient& g : joint.parameters) {
      SCOPED_TRACE(method + ": " + g.name);
      const std::set<std::string> kept = names_of(run(scene, {g.name}, method, 1));
      for (size_t t = 0; t < joint.terms.size(); ++t) {
        if (kept.contains(joint.terms[t].name)) continue;
        EXPECT_TRUE(is_zero(g.terms[t])) << joint.terms[t].name;
        zero.insert(joint.terms[t].name);
      }
    }
    EXPECT_EQ(zero.size(), names_of(run(scene, {"ball.translate.x"}, method)).size() - 1) << method;
  }
}

// What is kept differs from zero for some parameter of the kind, so no kind is sampled in vain.
TEST(ChangedTerms, DoDifferFromZero) {
  const TempFiles files;
  const Scene scene = scene_with_all(files);
  const auto expect_some = [&](const std::vector<std::string>& names, size_t count) {
    std::set<std::string> differs;
    for (const std::string& name : names) {
      const GradientResult result = run(scene, {name}, "silhouettes");
      EXPECT_EQ(result.terms.size(), count) << name;
      for (size_t t = 0; t < result.terms.size(); ++t)
        if (!is_zero(result.parameters[0].terms[t])) differs.insert(result.terms[t].name);
    }
    EXPECT_EQ(differs.size(), count) << names[0];
  };
  expect_some({"ball.translate.x"}, 6);
  expect_some({"sensor.translate.x"}, 6);
  expect_some({"dot.translate.x"}, 2);
  expect_some({"noon.rotate.x"}, 2);
  // A beam that turns lights the same shadows in another way.
  expect_some({"beam.rotate.x"}, 1);
  expect_some({"clay.reflectance", "gloss.alpha", "glow.radiance", "dot.intensity"}, 1);
}

// Texels, coats, mirrors and glass.
std::string more_values(const TempFiles& files) {
  Image image(4, 3, 3);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = 0.1f + 0.8f * static_cast<float>((7 * i) % 12) / 12;
  }
  write_exr(files.path("texels.exr"), image, false, {});
  const auto texels = [&](const std::string& name) {
    return "<texture type=\"bitmap\" name=\"" + name + "\"><string name=\"filename\" value=\"" +
           files.path("texels.exr") + "\"/></texture>";
  };
  return square("poster", 0.5, 0, {-1.3, 1.2, 0.5},
                "<bsdf type=\"roughplastic\" id=\"print\"><string name=\"distribution\" "
                "value=\"ggx\"/>" +
                    texels("diffuse_reflectance") + "</bsdf>") +
         square("mirror", 0.5, 0, {1.3, 1.2, 0.5},
                R"(<bsdf type="conductor" id="silver"><float name="eta" value="0.2"/>
                <float name="k" value="3"/></bsdf>)") +
         square("pane", 0.4, 0, {0.3, 0.6, 1},
                R"(<bsdf type="twosided"><bsdf type="plastic" id="coat"/></bsdf>)") +
         square("window", 0.4, 0, {-0.6, 0.6, 1}, R"(<bsdf type="thindielectric" id="glass"/>)") +
         square("screen", 0.4, 90, {0, 2, 0},
                "<emitter type=\"area\" id=\"show\">" + texels("radiance") + "</emitter>");
}

// Where values alone change, paths are followed in plain numbers; beside what moves they are not.
TEST(ChangedTerms, OfValuesAloneAreAsBesideMotion) {
  const TempFiles files;
  const Scene scene = scene_with_all(files, more_values(files));
  std::vector<std::string> names;  // of values
  std::vector<GradientResult> runs;
  for (const std::string& name : some_of_all(scene)) {
    GradientResult one = run(scene, {name}, "silhouettes", 2);
    if (one.terms.size() > 1 || one.terms[0].name != "interior") continue;
    names.push_back(name);
    runs.push_back(std::move(one));
  }
  EXPECT_GE(runs.size(), 20u);
  names.emplace_back("ball.translate.x");
  const GradientResult joint = run(scene, names, "silhouettes", 2);
  for (size_t k = 0; k < runs.size(); ++k) {
    const std::string& name = names[k];
    SCOPED_TRACE(name);
    const GradientResult& alone = runs[k];
    const Moments& a = alone.parameters[0].terms[0];
    const Moments& b = joint.parameters[k].terms[0];
    double largest = 0;
    for (size_t i = 0; i < b.size(); ++i) largest = std::max(largest, std::fabs(b.mean(i)));
    // The one lights nothing in view, the other reflects everything at eta 0.
    EXPECT_TRUE(largest > 0 || name.starts_with("beam") || name == "gloss.k");
    // Rounding may part a path that grazes an edge from the same one.
    int apart = 0, of = 0;
    for (size_t i = 0; i < b.size(); ++i) {
      of += b.mean(i) != 0;
      apart += !(std::fabs(a.mean(i) - b.mean(i)) <= 1e-9 * largest);
      apart += !(std::fabs(alone.radiance.mean(i) - joint.radiance.mean(i)) <= 1e-9);
    }
    EXPECT_LE(8 * apart, of);
  }
}

// The sums are those of a run with all terms.
TEST(ChangedTerms, HaveTheSumOfAll) {
  const TempFiles files;
  const Scene scene = scene_with_all(files);
  for (const std::string method : {"adaptive", "silhouettes"}) {
    for (const std::string name :
         {"gloss.alpha", "sky.data.2.5.g", "dot.translate.x", "noon.rotate.z", "sky.scale"}) {
      const Moments a = run(scene, {name}, method).parameters[0].image_sum;
      const Moments b =
          run(scene, {name, "ball.translate.x", "sensor.fov"}, method).parameters[0].image_sum;
      const double error = std::sqrt(a.variance(0) + b.variance(0));
      EXPECT_LE(std::fabs(a.mean(0) - b.mean(0)), 5 * error) << method << ", " << name;
    }
  }
}

TEST(ChangedTerms, ListEdgesForWhatMovesAlone) {
  const TempFiles files;
  const Scene scene = scene_with_all(files);
  EXPECT_TRUE(run(scene, {"clay.reflectance", "glow.radiance"}, "adaptive").stats.edges.empty());
  EXPECT_FALSE(run(scene, {"clay.reflectance", "dot.translate.x"}, "adaptive").stats.edges.empty());
  BackwardOptions options;
  RunSettings settings;
  settings.spp = 1;
  settings.threads = 1;
  const auto edges_of = [&](const std::string& name) {
    options.parameters = {name};
    return backward(scene, Image(8, 8, 3), options, settings).stats.edges.size();
  };
  EXPECT_EQ(edges_of("clay.reflectance"), 0u);
  EXPECT_GT(edges_of("ball.translate.x"), 0u);
}

// Vertices on black surfaces, or behind them, draw no edges, whatever the derivatives by their
// colour are.
TEST(ChangedTerms, DrawNoEdgesWhereNothingIsScattered) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 8;
  const auto body = [&](const std::string& colour) {
    return square("floor", 2.5, -90, {0, 0, 0}, diffuse("soot", colour)) +
           obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), true, 0.4,
                     {0.4, 0.8, 0.2}, diffuse("coal", colour)) +
           square("lamp", 0.3, 90, {0.3, 2.4, 0.5}, area_light("glow", "30, 25, 20"));
  };
  const std::vector<std::string> wrt = {"ball.translate.x", "soot.reflectance.r"};
  for (const std::string colour : {"0, 0, 0", "0.5, 0.5, 0.5"}) {
    parts.body = body(colour);
    const Scene scene = make_scene(files, parts);
    const bool black = colour == "0, 0, 0";
    for (const std::string method : {"silhouettes", "forest"}) {
      uint64_t drawn = 0;
      const GradientResult result = run(scene, wrt, method);
      for (const TermRun& term : result.terms)
        if (term.name == "boundary" || term.name == "direct") drawn += term.cost.samples;
      EXPECT_EQ(drawn == 0, black) << method;
      EXPECT_FALSE(is_zero(result.parameters[1].total));
    }
    BackwardOptions options;
    options.parameters = {"ball.translate.x", "soot.reflectance"};
    RunSettings settings;
    settings.spp = 16;
    settings.threads = 1;
    Image ones(8, 8, 3);
    std::ranges::fill(ones.data, 1.0f);
    uint64_t drawn = 0;
    for (const TermRun& term : backward(scene, ones, options, settings).terms)
      if (term.name == "boundary" || term.name == "direct") drawn += term.cost.samples;
    EXPECT_EQ(drawn == 0, black);
  }
}

// Counts of samples are in the order of the scene's terms, also where some are left out.
TEST(ChangedTerms, TakeTheirOwnCounts) {
  const TempFiles files;
  const Scene scene = scene_with_all(files);
  GradientOptions options;
  options.method = "forest";
  options.parameters = {"dot.translate.x"};
  options.samples = SampleCounts{2, 0.5, 3, 4};  // interior, camera, boundary, shadow
  RunSettings settings;
  settings.spp = 4;
  settings.threads = 1;
  const GradientResult result = gradient(scene, options, settings);
  ASSERT_EQ(result.terms.size(), 2u);
  EXPECT_EQ(result.terms[0].samples, 2);
  EXPECT_EQ(result.terms[1].samples, 4);
}

}  // namespace
}  // namespace limn
