// Moving directions: whatever they do, the mean stays; and where they are meant for, they take out
// most of the variance.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "integrators/paths/traced_scene.h"
#include "integrators/pilot/term_estimator.h"
#include "integrators/terms/term_table.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/methods.h"
#include "support/meshes.h"
#include "support/same_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

// A ball over a glossy floor between a lamp and a sky.
Scene gloss_scene(const TempFiles& files, double alpha) {
  SceneParts parts;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", alpha)) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.6,
                         {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               square("lamp", 0.5, 90, {0.3, 2.4, 0.5}, area_light("glow", "6, 5, 4")) +
               make_sky(files, "sky");
  return make_scene(files, parts);
}

TEST(MovingDirections, KeepTheMean) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 0.2);
  for (const char* parameter : {"ball.translate.x", "lamp.translate.x", "sensor.rotate.x"}) {
    expect_same_mean(
        scene, {parameter},
        {"silhouettes:directions=random:film=moving", "silhouettes:directions=moving", "adaptive"});
  }
}

// Four of them share a pass; one of the others moves nothing.
TEST(MovingDirections, KeepTheMeanOfSeveralParameters) {
  const TempFiles files;
  expect_same_mean(
      gloss_scene(files, 0.2),
      {"ball.translate.x", "ball.rotate.y", "lamp.translate.x", "sensor.translate.y",
       "floor.translate.y", "glow.radiance"},
      {"silhouettes:directions=random:film=moving", "silhouettes:directions=moving", "adaptive"});
}

// The edges of a point light's shadows, seen in gloss, move against directions that turn. One
// pixel: each seed is one turn.
TEST(MovingDirections, KeepTheMeanOfSharpShadows) {
  const Scene scene = read_scene(
      std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/shadow_in_gloss.xml", {}, nullptr);
  const auto estimate = [&](const std::string& method, int spp, uint64_t seed) {
    GradientOptions options;
    options.parameters = {"object.translate.x"};
    options.method = method;
    options.samples = SampleCounts{1, 0.5, 1, 4};
    RunSettings settings;
    settings.spp = spp;
    settings.seed = seed;
    return gradient(scene, options, settings).parameters[0].image_sum;
  };
  const Moments held = estimate("forest", 32768, 1);
  std::vector<double> z;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const Moments turned = estimate("silhouettes:directions=random:film=moving", 16384, seed);
    z.push_back((turned.mean(0) - held.mean(0)) / std::sqrt(turned.variance(0) + held.variance(0)));
  }
  EXPECT_GE(summarize(z).p_largest, 1e-4) << summarize(z).largest;
}

// A shadow's edge on a wall, which a glossy floor shows.
TEST(MovingDirections, KeepTheMeanOfSharpShadowsByAPilot) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0, 2, 4};
  parts.target = {0, 0, 0.2};
  parts.fov = 30;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.15)) +
               square("wall", 3, 0, {0, 1.5, -1.5}, diffuse("plaster", "0.7, 0.7, 0.7")) +
               square("leaf", 0.5, 0, {0, 2.6, -1},
                      R"(<bsdf type="twosided">)" + diffuse("soot", "0, 0, 0") + "</bsdf>") +
               R"(<emitter type="point" id="bulb"><point name="position" value="0.1,3.2,0.6"/>
                  <rgb name="intensity" value="9,9,9"/></emitter>)";
  expect_same_mean(make_scene(files, parts), {"leaf.translate.x", "leaf.rotate.z"}, {"adaptive"});
}

// A glossy plate just above a floor, under a lamp and a bulb: lines from edges and shadows find the
// first vertices of paths, and have their share of what turns there change. Each seed is one turn.
TEST(MovingDirections, KeepTheMeanOfLinesToFirstVertices) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0.3, 2, 3};
  parts.target = {0, 0, 0};
  parts.width = parts.height = 4;
  Mesh plate = cube_mesh();
  for (Vec3f& v : plate.positions) v = {v.x, 0.1f * v.y, 0.7f * v.z};
  const std::string body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
                           obj_shape("plate", write_mesh(files, "plate.obj", plate), true, 0.6,
                                     {0, 0.2, 0}, conductor("metal", 0.16));
  for (const std::string& light :
       {square("lamp", 0.1, 90, {-0.2, 2.7, -0.4}, area_light("glow", "60, 50, 40")),
        std::string(R"(<emitter type="point" id="bulb"><point name="position" value="0.7,3,0.1"/>
                       <rgb name="intensity" value="9,9,9"/></emitter>)")}) {
    parts.body = body + light;
    const Scene scene = make_scene(files, parts);
    const auto estimate = [&](const std::string& method, int spp, uint64_t seed) {
      return run_method(scene, {"plate.translate.y"}, method, spp, seed).parameters[0].image_sum;
    };
    const Moments held = estimate("silhouettes", 16384, 1);
    std::vector<double> z;
    for (uint64_t seed = 1; seed <= 8; ++seed) {
      const Moments turned = estimate("silhouettes:directions=random:film=moving", 2048, seed);
      z.push_back((turned.mean(0) - held.mean(0)) /
                  std::sqrt(turned.variance(0) + held.variance(0)));
    }
    EXPECT_GE(summarize(z).p_largest, 1e-4) << summarize(z).largest;
  }
}

// What directions that turn carry along, number by number: a point seen from outside the one object
// that moves, where they follow a plane, and from within it, where they rotate.
TEST(MovingDirections, CarryPointsAtTheirRatesPerTurn) {
  const TempFiles files;
  Scene scene = gloss_scene(files, 0.2);
  find_parameter(scene, "ball.translate.x").seed(scene, 0);
  const MotionRates rates(scene, 1, {1, 1, 1, 1});
  const Vec3d to{0.3, -0.5, 0.2}, g{0.7, 0.4, -0.6};
  for (const bool follows : {true, false}) {
    const Vec3d p = follows ? Vec3d{-1, 0.1, 2} : Vec3d{0.2, 1.01, 0};
    const Vec3d per_turn = rates.per_turn(p, to, g);
    for (int k = 0; k < 3; ++k) {
      DirectionField field;
      field.turn[k][0] = 1;
      const DirectionTurn turn = rates.motion_at(p, field).turn;
      EXPECT_EQ(turn.follows(), follows);
      const Vec3<Lanes> v = turn.velocity(to);
      const double rate = v.x[0] * g.x + v.y[0] * g.y + v.z[0] * g.z;
      EXPECT_GT(std::fabs(rate), 0);
      EXPECT_NEAR(per_turn[k], rate, 1e-12 * std::fabs(rate));
    }
  }
}

// Keeps what samples of the film come to.
class FormSink final : public FilmSink {
 public:
  FormSink() { book_on(cost_); }
  bool at(const FilmPlace&) override { return true; }
  bool takes(const BoundaryForm& form, const Rng&) override {
    forms.push_back(form);
    return false;
  }
  void add(const Rgb<double>&) override {}
  void add_line(const FilmLineSample&, const Rgb<double>&) override {}

  std::vector<BoundaryForm> forms;

 private:
  TermCost cost_;
};

// A line that ends at a first vertex says how directions there turn what the vertex sees: all that
// the sample has but the vertex itself.
TEST(MovingDirections, TurnLinesToFirstVertices) {
  const TempFiles files;
  SceneParts parts;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.6, {0, 0.7, 0},
                         conductor("metal", 0.16)) +
               square("lamp", 0.1, 90, {-0.2, 2.7, -0.4}, area_light("glow", "60, 50, 40")) +
               R"(<emitter type="point" id="bulb"><point name="position" value="0.7,3,0.1"/>
                  <rgb name="intensity" value="9,9,9"/></emitter>)";
  Scene scene = make_scene(files, parts);
  find_parameter(scene, "body.translate.y").seed(scene, 0);
  const TracedScene traced(scene, 1, {.edges = true});
  TermInput input(traced.context(), 1, {1, 1, 1, 1}, edge_sampler_type("silhouettes"), 1);
  for (const auto make : {make_penumbra_term, make_shadow_term, make_boundary_term}) {
    const size_t faces = make == make_boundary_term ? 1 : 2;  // those of fewer are seen directly
    const auto term = make(input);
    FormSink sink;
    for (int i = 0; i < 4000; ++i) {
      const Rng key(51, i, 0);
      term->sample_film(Rng(key).uniform(), key, sink);
    }
    int lines = 0;
    for (const BoundaryForm& form : sink.forms) {
      const auto all = form.all();
      const auto is_face = [](const MovingPoint& p) { return p.of == MovingPoint::Of::kFace; };
      if (static_cast<size_t>(std::ranges::count_if(all, is_face)) < faces) continue;
      ++lines;
      ASSERT_TRUE(form.turned);
      Vec3d sum = form.turned->g;
      for (const MovingPoint& p : all.first(all.size() - 1)) sum = sum + p.g;
      EXPECT_LT(length(sum), 1e-12 * length(form.turned->g));
      EXPECT_LT(length(form.turned->vertex - form.x), 1e-12);
      const auto [mesh, edge, t] = std::tuple(all[0].mesh, all[0].edge, all[0].t);
      const auto& ends = mesh->edge(edge.edge).vertices;
      const Vec3d seen = faces > 1
                             ? std::ranges::find_if(all, is_face)->x
                             : mesh->position(ends[0]) * (1 - t) + mesh->position(ends[1]) * t;
      EXPECT_LT(length(form.turned->vertex + form.turned->to - seen), 1e-12);
    }
    EXPECT_GT(lines, 20);
  }
}

// Seen at a grazing angle a floor that rises slides ten times as fast: its vertices take so many
// directions in place of one.
TEST(FastVertices, KeepTheMean) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0, 0.5, 5};
  parts.target = {0, 0, 0};
  parts.fov = 15;
  parts.width = parts.height = 8;
  parts.body = square("floor", 2, -90, {0, 0, 0}, conductor("gloss", 0.4)) +
               square("wall", 2, 0, {0, 1, -1.5}, diffuse("plaster", "0.7, 0.6, 0.5")) +
               make_sky(files, "sky");
  const Scene scene = make_scene(files, parts);
  expect_same_mean(scene, {"floor.translate.y"}, {"adaptive"});
  double difference = 0, variance = 0;
  for (const char* method : {"forest", "adaptive"}) {
    const Moments radiance = run_method(scene, {"floor.translate.y"}, method, 64, 5).radiance;
    for (size_t i = 0; i < radiance.size(); ++i) {
      difference += method[0] == 'f' ? -radiance.mean(i) : radiance.mean(i);
      variance += radiance.variance(i);
    }
  }
  EXPECT_LE(std::fabs(difference), 5 * std::sqrt(variance));
}

Scene mirror_scene(const TempFiles& files, int size) {
  SceneParts parts;
  parts.width = parts.height = size;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.1)) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.6,
                         {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               make_sky(files, "sky");
  return make_scene(files, parts);
}

// Without the noisiest hundredth, which single bright samples rule.
double trimmed_variance(const Moments& moments) {
  std::vector<double> variances;
  for (size_t i = 0; i < moments.size(); ++i) variances.push_back(moments.variance(i));
  std::sort(variances.begin(), variances.end());
  variances.resize(variances.size() - variances.size() / 100);
  return std::accumulate(variances.begin(), variances.end(), 0.0);
}

// The floor shows the ball. Over four seeds, and per ray.
TEST(MovingDirections, TakeOutWhatSlides) {
  const TempFiles files;
  const Scene scene = mirror_scene(files, 32);
  const auto variance_times_rays = [&](const std::string& method) {
    double sum = 0;
    for (const uint64_t seed : {1, 2, 3, 4}) {
      const GradientResult result = run_method(scene, {"ball.translate.y"}, method, 64, seed);
      uint64_t rays = 0;
      for (const auto& term : result.terms) rays += term.cost.rays;
      sum += trimmed_variance(result.parameters[0].total) * static_cast<double>(rays);
    }
    return sum;
  };
  EXPECT_LT(variance_times_rays("silhouettes:directions=moving"), variance_times_rays("forest"));
}

// A black box that rises before an even sky, in gloss: only moving directions give `interior` any
// noise. It must not exceed that of the edges which they are to follow.
TEST(MovingDirections, AddLessThanTheyTakeOut) {
  const TempFiles files;
  SceneParts parts;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
               obj_shape("box", write_mesh(files, "box.obj", cube_mesh()), true, 0.4, {0, 1, 0},
                         diffuse("soot", "0, 0, 0")) +
               constant_light("sky", "1, 1, 1");
  const Scene scene = make_scene(files, parts);
  double interior = 0, boundary = 0;
  for (const uint64_t seed : {6, 7, 8, 9}) {
    const GradientResult result = run_method(scene, {"box.translate.y"}, "adaptive", 64, seed);
    for (size_t t = 0; t < result.terms.size(); ++t) {
      const std::vector<double> squares = variances(result.parameters[0].terms[t]);
      const double sum = std::accumulate(squares.begin(), squares.end(), 0.0);
      if (result.terms[t].name == "interior") interior += sum;
      if (result.terms[t].name == "boundary") boundary += sum;
    }
  }
  EXPECT_GT(boundary, 0);
  EXPECT_LT(interior, boundary);
}

// What a pilot learns of a parameter does not depend on the others: asked for twice or four times
// over, it has the same derivative in each sample, and turns, whose unit is the sum over the
// parameters, change it as much.
TEST(MovingDirections, AreAlikeForSeveralParameters) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 0.2);
  // Draws edges whatever moves them.
  const EdgeSamplerType& sampler = edge_sampler_type("uniform");
  const auto terms = terms_of(scene, sampler);
  const auto slot_of = [&](const std::string& name) {
    return std::find_if(terms.begin(), terms.end(),
                        [&](const TermType* type) { return type->name == name; }) -
           terms.begin();
  };
  const std::vector<bool> computed(terms.size(), true);
  const Parameter parameter = find_parameter(scene, "ball.translate.y");
  constexpr int kSamples = 2000;
  const auto samples_of = [&](int count) {
    const std::vector<Parameter> parameters(count, parameter);
    TermEstimator estimator(scene, parameters, terms, computed, sampler, 1);
    estimator.set_plan({});
    BatchSums sums;
    std::vector<TermCost> costs(estimator.slots());
    NonFinite bad;
    SampleSink sink(scene.film, served_pixels(scene.film), count, estimator.lane_scale(), sums,
                    costs, bad, nullptr);
    std::vector<TurnedSample> samples;
    for (int i = 0; i < kSamples; ++i) {
      const auto sample =
          estimator.sample({i % 16, i / 16 % 16, i}, Rng(7, i, 0), true, false, sink);
      EXPECT_TRUE(sample.finite);
      samples.insert(samples.end(), sample.terms.begin(), sample.terms.end());
    }
    return samples;
  };
  const auto one = samples_of(1);
  for (const int count : {2, 4}) {
    const auto many = samples_of(count);
    std::array<int, kMostTerms> moving{};
    for (size_t i = 0; i < one.size(); ++i) {
      double squares = 0, differences = 0;
      const auto compare = [&](double a, double b) {
        squares += a * a;
        differences += (a - b) * (a - b);
      };
      for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < count; ++k) compare(one[i].value[c][0], many[i].value[c][k]);
        for (int axis = 0; axis < 3; ++axis) {
          compare(one[i].turned[c][axis], many[i].turned[c][axis] / count);
          compare(one[i].scores[c][axis], many[i].scores[c][axis] / count);
        }
      }
      moving[i % moving.size()] += squares > 0;
      EXPECT_LE(differences, squares * std::pow(0x1p-30, 2)) << i;
    }
    for (const char* term : {"interior", "boundary"}) {
      EXPECT_GT(moving[slot_of(term)], kSamples / 100) << term;
    }
  }
}

TEST(MovingDirections, TakeOutWhatSlidesForEveryParameter) {
  const TempFiles files;
  const Scene scene = mirror_scene(files, 32);
  const std::vector<std::string> parameters = {"ball.translate.y", "ball.translate.z"};
  const auto variances_times_rays = [&](const std::string& method) {
    std::vector<double> sums(parameters.size());
    for (const uint64_t seed : {1, 2, 3, 4}) {
      const GradientResult result = run_method(scene, parameters, method, 64, seed);
      uint64_t rays = 0;
      for (const auto& term : result.terms) rays += term.cost.rays;
      for (size_t k = 0; k < sums.size(); ++k)
        sums[k] += trimmed_variance(result.parameters[k].total) * static_cast<double>(rays);
    }
    return sums;
  };
  const auto moving = variances_times_rays("silhouettes:directions=moving");
  const auto held = variances_times_rays("silhouettes");
  for (size_t k = 0; k < parameters.size(); ++k) {
    EXPECT_LT(moving[k], held[k]) << parameters[k];
  }
}

// With some terms left out nothing would take back what directions add to the others.
TEST(MovingDirections, RestWhereTermsAreLeftOut) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 0.2);
  const auto interior = [&](const std::string& method) {
    const GradientResult result =
        run_method(scene, {"ball.translate.y"}, method, 64, 3, 2, {"interior", "camera"});
    return result.parameters[0].total;
  };
  const Moments a = interior("forest"), b = interior("silhouettes:directions=random:film=moving");
  for (size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a.mean(i), b.mean(i));
}

TEST(MovingDirections, SameBitsOnAnyNumberOfThreads) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 0.1);
  for (const std::vector<std::string>& parameters :
       {std::vector<std::string>{"ball.translate.y"},
        std::vector<std::string>{"ball.translate.y", "ball.rotate.x", "sensor.translate.x"}}) {
    const GradientResult one = run_method(scene, parameters, "adaptive", 32, 5, 1);
    EXPECT_GT(one.pilot_spp, 0);
    for (const int threads : {2, 5}) {
      expect_same_bits(one, run_method(scene, parameters, "adaptive", 32, 5, threads));
    }
  }
}

}  // namespace
}  // namespace limn
