// Lights by themselves: what arrives from each kind, how one of them is chosen, and weights of two
// densities.
#include "limn/core/lights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "integrators/paths/path_context.h"
#include "limn/core/parameter.h"
#include "support/scenes.h"

namespace limn {
namespace {

Scene scene_with(const TempFiles& files, const std::string& body) {
  SceneParts parts;
  parts.body = body;
  return make_scene(files, parts);
}

std::shared_ptr<DeltaLight> only_light(const std::string& emitter) {
  const TempFiles files;
  return scene_with(files, emitter).delta_lights.at(0);
}

TEST(DeltaLights, APointFallsOffWithTheSquareOfTheDistance) {
  for (const char* place : {R"(<point name="position" value="1,2,3"/>)",
                            R"(<transform name="to_world"><rotate x="1" angle="40"/>
                               <translate value="1,2,3"/></transform>)"}) {
    const auto light = only_light(std::string(R"(<emitter type="point">)") + place +
                                  R"(<rgb name="intensity" value="8,4,2"/></emitter>)");
    const auto a = light->arriving(Vec3d{1, 2, -1});
    ASSERT_TRUE(a);
    EXPECT_NEAR(a->irradiance.r, 8.0 / 16, 1e-15);
    EXPECT_NEAR(a->irradiance.b, 2.0 / 16, 1e-15);
    EXPECT_NEAR(a->wo.z, 1, 1e-15);
    EXPECT_FALSE(light->arriving(value(light->origin().v)));
  }
}

// Full up to beam_width, then linear in the angle down to cutoff_angle (Mitsuba 3).
TEST(DeltaLights, ASpotFallsOffLinearlyInTheAngle) {
  const auto light = only_light(
      R"(<emitter type="spot"><float name="cutoff_angle" value="40"/><transform name="to_world">
         <lookat origin="0,5,0" target="0,0,0" up="1,0,0"/></transform></emitter>)");
  for (const double degrees : {0.0, 10.0, 29.9, 30.1, 35.0, 39.9, 40.1, 90.0, 180.0}) {
    const double angle = degrees * kPi / 180;
    const auto a = light->arriving(Vec3d{2 * std::sin(angle), 5 - 2 * std::cos(angle), 0});
    ASSERT_EQ(a.has_value(), degrees < 40) << degrees;
    if (!a) continue;
    EXPECT_NEAR(a->irradiance.g, 0.25 * std::min(1.0, (40 - degrees) / 10), 1e-12);
  }
}

// The irradiance of a plane at distance z before it is pi / z^2 on the axis, and falls off as the
// cosine of the angle there (Mitsuba 3).
TEST(DeltaLights, AProjectorLightsAFrame) {
  const auto light = only_light(
      R"(<emitter type="projector"><float name="fov" value="90"/><float name="scale" value="2"/>
         <rgb name="irradiance" value="3,2,1"/><transform name="to_world">
         <lookat origin="0,5,0" target="0,0,0" up="1,0,0"/></transform></emitter>)");
  for (const double x : {0.0, -1.5, 1.99, 2.01}) {
    const auto a = light->arriving(Vec3d{x, 3, 1.98});
    ASSERT_EQ(a.has_value(), std::fabs(x) < 2) << x;
    if (!a) continue;
    const double distance = std::sqrt(x * x + 1.98 * 1.98 + 4);
    // On a surface that faces the light; that of the plane is this times 2 / distance.
    EXPECT_NEAR(a->irradiance.r, 2 * 3 * kPi / 4 * (distance / 2), 1e-12);
    EXPECT_NEAR(a->wo.y, 2 / distance, 1e-15);
    EXPECT_LE(a->irradiance.g * distance * distance,
              light->power() / luminance(Rgb<double>{3, 2, 1}) * 2 * (1 + 1e-12));
  }
  EXPECT_FALSE(light->arriving(Vec3d{0, 6, 0}));
}

TEST(DeltaLights, ADirectionComesFromInfinity) {
  for (const char* place : {R"(<vector name="direction" value="0,-3,0"/>)",
                            R"(<transform name="to_world"><lookat origin="1,2,3" target="1,1,3"
                               up="1,0,0"/></transform>)"}) {
    const auto light = only_light(std::string(R"(<emitter type="directional">)") + place +
                                  R"(<rgb name="irradiance" value="3,2,1"/></emitter>)");
    const auto a = light->arriving(Vec3d{100, -1e6, 3});
    EXPECT_NEAR(a->wo.y, 1, 1e-15);
    EXPECT_EQ(a->irradiance.r, 3);
    const auto sample = light->sample({0, 0, 0}, 0.3, {});
    EXPECT_TRUE(std::isinf(sample->distance));
    EXPECT_EQ(sample->pdf, 0.3);
  }
}

// `lamps` shapes in their order, all squares that face down, the environment, then delta lights;
// each as often as its density says, which is the one that is asked for.
void expect_draws_of_densities(const Scene& scene, size_t lamps) {
  const Lights lights(scene);
  const size_t all = lights.all().size();
  ASSERT_EQ(all, lamps + 1 + scene.delta_lights.size());
  EXPECT_EQ(lights.all()[lamps], scene.environment.get());
  EXPECT_EQ(lights.all()[lamps + 1], scene.delta_lights[0].get());
  const Lights::Point place = lights.at({0.3, 1, 0.2});
  const int draws = 40000;
  std::vector<int> counts(all);
  std::vector<double> expected(all);
  Rng rng(4, 5, 6);
  for (int i = 0; i < draws; ++i) {
    const auto sample = lights.sample(place, rng);
    ASSERT_TRUE(sample);
    const auto which =
        static_cast<size_t>(std::ranges::find(lights.all(), sample->light) - lights.all().begin());
    ++counts[which];
    EXPECT_EQ(sample->face.has_value(), which < lamps);
    const LightView lamp{sample->wo, sample->distance, Vec3d{0, -1, 0}};
    if (which > lamps) {
      expected[which] = sample->pdf;
    } else {
      const double pdf = which < lamps
                             ? lights.pdf(place, ShapeId(static_cast<uint32_t>(which)), lamp)
                             : lights.pdf_environment(place, sample->wo);
      EXPECT_DOUBLE_EQ(sample->pdf, pdf);
      expected[which] = pdf / lights.all()[which]->pdf(place.p, lamp, 1);
    }
  }
  EXPECT_NEAR(std::accumulate(expected.begin(), expected.end(), 0.0), 1, 1e-12);
  for (size_t k = 0; k < all; ++k) {
    // Binomial, five standard errors.
    EXPECT_NEAR(counts[k], draws * expected[k],
                5 * std::sqrt(draws * expected[k] * (1 - expected[k])));
  }
}

TEST(Lights, AreDrawnAsOftenAsTheirDensitiesSay) {
  const TempFiles files;
  const Scene scene =
      scene_with(files, R"(<emitter type="directional"/><emitter type="constant"/>
                <emitter type="point" id="dot"/>)" +
                            square("lamp", 1, 90, {0, 3, 0}, area_light("glow", "1, 1, 1")));
  expect_draws_of_densities(scene, 1);
  // As finite differences move what is dark.
  for (const char* name : {"glow.radiance", "dot.intensity"}) {
    SCOPED_TRACE(name);
    expect_draws_of_densities(find_parameter(scene, name).moved(scene, -1.2), 1);
  }
}

// What is kept of a place is kept of the first four.
TEST(Lights, MoreThanFourAreDrawnAsOftenAsTheirDensitiesSay) {
  const TempFiles files;
  const std::string sky = R"(<emitter type="constant"/><emitter type="directional"/>)";
  std::string dots, lamps;
  for (const char* x : {"-1", "0.5", "2"}) {
    dots += std::string(R"(<emitter type="point"><point name="position" y="2" z="0" x=")") + x +
            R"("/></emitter>)";
  }
  for (int i = 0; i < 6; ++i) {
    const std::string glow = std::to_string(1 + 3 * i);
    lamps += square("lamp" + std::to_string(i), 0.3, 90, {i - 3.0, 3, 0},
                    area_light("glow" + std::to_string(i), glow + ", 1, 1"));
  }
  const std::string lamp = square("lamp", 1, 90, {0, 3, 0}, area_light("glow", "1, 1, 1"));
  expect_draws_of_densities(scene_with(files, sky + dots + lamp), 1);
  expect_draws_of_densities(scene_with(files, sky + lamps), 6);
}

// By a tree, among lights that have no place in it.
TEST(Lights, ManyAreDrawnAsOftenAsTheirDensitiesSay) {
  const TempFiles files;
  std::string body = R"(<emitter type="constant"/><emitter type="directional"/>)";
  for (int i = 0; i < 60; ++i) {
    const std::string glow = std::to_string(1 + i % 7);
    body += square("lamp" + std::to_string(i), 0.1 + 0.01 * i, 90,
                   {i % 8 - 4.0, 2 + 0.1 * (i % 5), i / 8 - 4.0},
                   area_light("glow" + std::to_string(i), glow + ", 1, 1"));
  }
  std::string dots;
  for (int i = 0; i < 40; ++i) {
    dots += R"(<emitter type="point"><point name="position" y="2" z="0" x=")" +
            std::to_string(0.3 * i) + R"("/></emitter>)";
  }
  const Scene scene = scene_with(files, body);
  expect_draws_of_densities(scene, 60);
  expect_draws_of_densities(scene_with(files, body + dots), 60);
  // Those of a scene that moves are chosen by the one that does not.
  const Scene moved = find_parameter(scene, "lamp7.translate.x").moved(scene, 0.5);
  const Lights lights(scene), there(moved, &lights);
  for (const Vec3d& p : {Vec3d{0.3, 1, 0.2}, Vec3d{2, 0, -1}}) {
    Rng a(1, 2, 3), b(1, 2, 3);
    for (int i = 0; i < 100; ++i) {
      const auto one = lights.sample(lights.at(p), a), other = there.sample(there.at(p), b);
      EXPECT_EQ(one->face, other->face);
    }
  }
}

std::vector<LightTree::Emitter> some_emitters(size_t count, bool round, Rng& rng) {
  std::vector<LightTree::Emitter> emitters(count);
  for (LightTree::Emitter& e : emitters) {
    for (int k = 0; k < 3; ++k) e.center[k] = 4 * rng.uniform();
    e.light = std::exp2(8 * rng.uniform());
    const double flat = round ? 0 : rng.uniform() < 0.5 ? 1 : rng.uniform();
    e.facing = normalize(Vec3d{rng.uniform() - 0.5, rng.uniform() - 0.5, rng.uniform() - 0.5}) *
               (flat * e.light);
    e.rest = (1 - flat) * e.light / 4;
    e.spread = 0.01 * rng.uniform();
  }
  return emitters;
}

// What a tree chooses at u is as wide in u as is likely, and follows itself without gaps.
TEST(LightTree, ChoosesAsOftenAsItsProbabilitiesSay) {
  Rng rng(7, 8, 9);
  for (const size_t count : {1, 2, 3, 17, 100, 257}) {
    const LightTree tree(some_emitters(count, false, rng));
    for (int i = 0; i < 20; ++i) {
      const Vec3d p{8 * rng.uniform() - 2, 8 * rng.uniform() - 2, 8 * rng.uniform() - 2};
      std::vector<double> probabilities;
      for (size_t e = 0; e < count; ++e) probabilities.push_back(tree.probability(p, e));
      EXPECT_NEAR(std::accumulate(probabilities.begin(), probabilities.end(), 0.0), 1, 1e-12);
      constexpr int kDraws = 4000;
      std::vector<int> drawn(count);
      for (int j = 0; j < kDraws; ++j) ++drawn[tree.choose(p, (j + 0.5) / kDraws)];
      for (size_t e = 0; e < count; ++e) {
        // An interval of u: it holds as many of a row of numbers as fit, one more, or one less.
        EXPECT_NEAR(drawn[e], kDraws * probabilities[e], 1 + 1e-6);
      }
    }
  }
}

// Far off, the probabilities are those of the emitters' own estimates, where these shine in all
// directions.
TEST(LightTree, ChoosesInProportionToWhatIsSent) {
  Rng rng(1, 1, 2);
  const std::vector<LightTree::Emitter> emitters = some_emitters(50, true, rng);
  const LightTree tree(emitters);
  const Vec3d p{900, 700, 300};
  const double all = tree.irradiance(p);
  for (size_t e = 0; e < emitters.size(); ++e) {
    const LightTree one(std::span(&emitters[e], 1));
    EXPECT_NEAR(tree.probability(p, e) * all / one.irradiance(p), 1, 0.01) << e;
  }
  EXPECT_TRUE(LightTree().empty());
  EXPECT_EQ(LightTree().irradiance(p), 0);
}

// To the bit, lights of every kind among each other; what was in a sample's place is gone.
TEST(Lights, DrawnAtOnceAreThoseDrawnAlone) {
  const TempFiles files;
  const std::string bodies[] = {
      R"(<emitter type="constant"/><emitter type="directional"/><emitter type="point"/>)" +
          square("lamp", 1, 90, {0, 3, 0}, area_light("glow", "1, 1, 1")),
      R"(<emitter type="constant"/>)",
      square("lamp", 1, 90, {0, 3, 0}, area_light("glow", "1, 1, 1"))};
  for (const std::string& body : bodies) {
    const Scene scene = scene_with(files, body);
    const Lights lights(scene);
    const size_t most = 16;
    std::vector<Lights::Point> places;
    for (size_t i = 0; i < most; ++i) {  // some above the lamp, which does not shine on them
      places.push_back(lights.at({0.1 * i, 0.4 * i, 0.2}));
    }
    for (size_t round = 0; round < 50; ++round) {
      std::vector<Lights::Numbers> u(round % (most + 1));
      std::vector<std::optional<LightSample>> samples(u.size(), LightSample{});
      std::vector<Lights::Draw> draws;
      for (size_t i = 0; i < u.size(); ++i) {
        Rng rng(round, i, 3);
        for (double& number : u[i]) number = rng.uniform();
        draws.push_back({&places[i], &samples[i]});
      }
      lights.sample(draws, u);
      for (size_t i = 0; i < u.size(); ++i) {
        Rng rng(round, i, 3);
        const auto alone = lights.sample(places[i], rng);
        ASSERT_EQ(samples[i].has_value(), alone.has_value());
        if (!alone) continue;
        EXPECT_EQ(samples[i]->light, alone->light);
        EXPECT_EQ(samples[i]->wo.x, alone->wo.x);
        EXPECT_EQ(samples[i]->distance, alone->distance);
        EXPECT_EQ(samples[i]->pdf, alone->pdf);
        EXPECT_EQ(samples[i]->place, alone->place);
      }
    }
  }
}

// To rounding, lights of every kind and more than are kept of a place; to the bit, however many
// places go beside one, also right in a lamp's center.
TEST(Lights, PlacesAtOnceAreThoseAlone) {
  const TempFiles files;
  std::string body = R"(<emitter type="constant"/><emitter type="point"/>)";
  for (int i = 0; i < 4; ++i) {
    body += square("lamp" + std::to_string(i), 1, 90, {i - 2.0, 3, 0},
                   area_light("glow" + std::to_string(i), "2, 1, 1"));
  }
  const Scene scene = scene_with(files, body);
  const Lights lights(scene), by_others(scene, &lights);
  std::vector<Vec3d> points{{-2, 3, 0}};
  for (int i = 0; i < 12; ++i) points.push_back({0.1 * i, 0.4 * i, 0.2});
  for (const Lights* const asked : {&lights, &by_others}) {
    const auto at_once = [&](size_t first, size_t count) {
      std::vector<Lights::Point> found(count);
      std::vector<const Vec3d*> p;
      std::vector<Lights::Point*> places;
      for (size_t i = 0; i < count; ++i) {
        p.push_back(&points[first + i]);
        places.push_back(&found[i]);
      }
      asked->at(p, places);
      return found;
    };
    const auto together = at_once(0, points.size());
    for (size_t i = 0; i < points.size(); ++i) {
      const Lights::Point single = at_once(i, 1)[0], plain = asked->at(points[i]);
      EXPECT_EQ(together[i].p, points[i]);
      EXPECT_EQ(together[i].sum, single.sum);
      EXPECT_EQ(together[i].first, single.first);
      EXPECT_NEAR(single.sum, plain.sum, 1e-14 * plain.sum);
      for (size_t k = 0; k < 4; ++k) {
        EXPECT_NEAR(single.first[k], plain.first[k], 1e-14 * plain.first[k]);
      }
    }
  }
}

// By irradiance on a surface that faces them: 1 / d^2 of points, the closed form of a small lamp
// from its front, nothing from its back. What is expected to send nothing is drawn now and then.
TEST(Lights, AreDrawnByWhatTheySend) {
  const TempFiles files;
  const Scene scene = scene_with(
      files, R"(<emitter type="point"><point name="position" x="0" y="0" z="0"/></emitter>)" +
                 square("lamp", 0.01, 90, {0, 3, 0}, area_light("glow", "20, 20, 20")));
  const Lights lights(scene);
  const auto chance = [&](double y) {  // of the lamp
    Rng rng(7, 8, 9);
    const Lights::Point place = lights.at({0, y, 0});
    while (true) {
      const auto sample = lights.sample(place, rng);
      if (sample && !sample->face) return 1 - sample->pdf;
    }
  };
  const double least = chance(4);
  EXPECT_GT(least, 0);
  EXPECT_LT(least, 0.25);
  const auto expected = [&](double lamp, double point) {
    return least + (1 - 2 * least) * lamp / (lamp + point);
  };
  const double area = 4e-4;
  EXPECT_NEAR(chance(1), expected(20 * area / 4, 1), 1e-6);
  EXPECT_NEAR(chance(2), expected(20 * area, 0.25), 1e-5);
}

// Of a lamp as large as a disk of radius 1, also right in front of it: pi L / (d^2 + 1) on its
// axis.
TEST(Lights, AreDrawnByWhatLargeLampsSend) {
  const TempFiles files;
  const Scene scene = scene_with(
      files, R"(<emitter type="constant"/>)" + square("lamp", std::sqrt(kPi) / 2, 90, {0, 3, 0},
                                                      area_light("glow", "20, 20, 20")));
  const Lights lights(scene);
  for (const double d : {3.0, 1.0, 0.1, 0.001}) {
    const Lights::Point place = lights.at({0, 3 - d, 0});
    const double chance =
        lights.pdf_environment(place, {0, 1, 0}) / lights.all()[1]->pdf({}, {{0, 1, 0}, 1, {}}, 1);
    const double lamp = 20 / (d * d + 1), sky = 1;
    EXPECT_NEAR(chance, 0.125 + 0.75 * sky / (lamp + sky), 1e-6) << d;
  }
}

// So near that the square of the distance rounds to nothing: a weight over it would be infinite.
TEST(Lights, OfNoDensityDrawNothing) {
  const TempFiles files;
  Scene scene = scene_with(files, square("lamp", 1, 90, {}, area_light("glow", "1, 1, 1")));
  Mesh& mesh = scene.shapes[0].mesh;
  const FaceIndices& face = mesh.faces[0];
  mesh.positions[face[0]] = {-8, 0, 0};
  mesh.positions[face[1]] = {0, 0, 0};
  mesh.positions[face[2]] = {0, 0, -8};
  const std::unique_ptr<Light> lamp = make_area_light(scene, ShapeId(0), DrawFaces::kByArea);
  const LightNumbers corner{};  // draws the second one
  const auto near = lamp->sample({0, 1e-150, 0}, 1, corner);
  ASSERT_TRUE(near);
  EXPECT_GT(near->pdf, 0);
  EXPECT_FALSE(lamp->sample({0, 3e-162, 0}, 1, corner));
}

// To rounding, also where densities or their ratio are beyond what squares can hold.
TEST(MisWeights, OverADensityAreDividedByIt) {
  const auto expect_divided = [](double pdf, double other) {
    const double expected = mis_weight(pdf, other) / pdf;
    const double found = mis_weight_over_pdf(pdf, other);
    if (!std::isfinite(expected)) {
      EXPECT_EQ(found, expected) << pdf << " " << other;
      return;
    }
    // At most two epsilons of a weight or a product below the normal numbers, and half of one each
    // of all else; a result below them may become nothing.
    EXPECT_NEAR(
        found, expected,
        4 * std::numeric_limits<double>::epsilon() * expected + std::numeric_limits<double>::min())
        << pdf << " " << other;
  };
  Rng rng(1, 2, 3);
  for (int i = 0; i < 200000; ++i) {
    const double pdf = std::pow(10, 630 * rng.uniform() - 322);
    expect_divided(pdf, pdf * std::pow(10, 8 * rng.uniform() - 4));
    expect_divided(pdf, std::pow(10, 630 * rng.uniform() - 322));
    expect_divided(pdf, 0);
  }
  EXPECT_EQ(mis_weight_over_pdf(0.25, 0), 4);
  EXPECT_EQ(mis_weight_over_pdf(1e-300, 1e300), 0);
}

TEST(Lights, OfASceneWithoutAnyAreEmpty) {
  const TempFiles files;
  EXPECT_TRUE(Lights(scene_with(files, square("floor", 1, 0, {}, ""))).empty());
}

}  // namespace
}  // namespace limn
