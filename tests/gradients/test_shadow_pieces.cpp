// Where the edges of sharp shadows lie, how densely points on them are drawn, and whether error
// bars are true where a shadow begins at what casts it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "integrators/edges/near_faces.h"
#include "integrators/edges/scene_edges.h"
#include "integrators/paths/traced_scene.h"
#include "integrators/terms/gloss_lines.h"
#include "integrators/terms/shadow_edges.h"
#include "integrators/terms/shadow_lines.h"
#include "integrators/terms/shadow_pieces.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/statistics.h"
#include "support/chi_square.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// The largest k at t, by every segment; -1e9 where there is none.
double highest(std::span<const Stretch> segments, double t) {
  double most = -1e9;
  for (const Stretch& s : segments) {
    if (t > s.t0 && t < s.t1) most = std::max(most, s.at(t));
  }
  return most;
}

TEST(UpperEnvelope, AgreesWithEverySegment) {
  Rng rng(2, 7, 1);
  for (uint32_t trial = 0; trial < 200; ++trial) {
    std::vector<Stretch> segments;
    for (uint32_t i = 0; i < 1 + trial % 40; ++i) {
      const double t0 = rng.uniform(), t1 = t0 + 0.01 + rng.uniform() * (trial % 3 ? 0.1 : 0.8);
      const double k0 = rng.uniform(), k1 = rng.uniform();
      segments.push_back({t0, t1, k0, k1, i});
    }
    const std::vector<Stretch> upper = upper_envelope(segments);
    for (size_t i = 1; i < upper.size(); ++i) EXPECT_GE(upper[i].t0, upper[i - 1].t1);
    for (int k = 0; k < 200; ++k) {
      const double t = 1.8 * rng.uniform();
      EXPECT_NEAR(highest(upper, t), highest(segments, t), 1e-9) << "trial " << trial;
    }
  }
  EXPECT_TRUE(upper_envelope({}).empty());
}

TEST(UpperEnvelope, TiesGoToTheLowerLabel) {
  const std::vector<Stretch> both = {{0, 1, 2, 3, 7}, {0, 1, 2, 3, 4}};
  const auto upper = upper_envelope(both);
  ASSERT_EQ(upper.size(), 1u);
  EXPECT_EQ(upper[0].label, 4u);
}

const char* kBulb =
    R"(<emitter type="point" id="bulb"><point name="position" value="-1.2,2.2,1.1"/>
       <rgb name="intensity" value="9,8,7"/></emitter>)";
const char* kTorch =
    R"(<emitter type="spot" id="torch"><rgb name="intensity" value="20,30,40"/>
       <float name="cutoff_angle" value="35"/><float name="beam_width" value="12"/>
       <transform name="to_world"><lookat origin="1.4,2.6,1.2" target="0,0.4,0" up="0,1,0"/>
       </transform></emitter>)";
const char* kSun =
    R"(<emitter type="directional" id="sun"><vector name="direction" value="0.4,-1,-0.3"/>
       <rgb name="irradiance" value="2,2,2.5"/></emitter>)";

// Shadows that fall on a floor and a wall, on a ball of many faces and through each other.
struct Shadows {
  explicit Shadows(const TempFiles& files, bool lifted = false)
      : scene(make(files, lifted)),
        traced(scene, 1, {.edges = true}),
        input(make_scene_edges(scene, 1)),
        frames(scene, input),
        edges(traced.context(), frames, 1),
        pieces(traced.context(), input, edges.edges(), false, 2) {}

  static Scene make(const TempFiles& files, bool lifted) {
    SceneParts parts;
    parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
                 square("wall", 2.5, 0, {0, 1.5, -1.5}, diffuse("plaster", "0.7, 0.7, 0.6")) +
                 obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.35,
                           {-0.8, 0.55, 0.2}, diffuse("clay", "0.7, 0.5, 0.3")) +
                 obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), !lifted, 0.45,
                           {0.6, 0.7, 0.1}, diffuse("chalk", "0.8, 0.8, 0.8")) +
                 kBulb + kTorch + kSun;
    Scene scene = make_scene(files, parts);
    find_parameter(scene, "cube.rotate.y").seed(scene, 0);
    return scene;
  }
  // None if the shadow of t is not known to fall anywhere.
  const ShadowPiece* piece_at(uint32_t edge, double t) const {
    for (const ShadowPiece& piece : pieces.pieces())
      if (piece.edge == edge && t >= piece.t0 && t <= piece.t1) return &piece;
    return nullptr;
  }

  Scene scene;
  TracedScene traced;
  EdgeSamplerInput input;
  LightFrames frames;
  ShadowEdges edges;
  ShadowPieces pieces;
};

// Against rays: the piece of every shadow is known, and where it lies on its face.
TEST(ShadowPieces, AreWhereShadowsFall) {
  const TempFiles files;
  const Shadows shadows(files);
  Rng rng(5, 5, 5);
  int found = 0, other = 0;
  constexpr int kTrials = 20000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const uint32_t edge = shadows.edges.choose(rng.uniform());
    const double t = rng.uniform();
    RayCount rays;
    const auto point = shadows.edges.cast(shadows.edges.edge(edge), t, rng, rays);
    const ShadowPiece* piece = shadows.piece_at(edge, t);
    if (!point != !piece || (point && point->face != piece->face)) {
      ++other;
      continue;
    }
    if (!point) continue;
    ++found;
    const ShadowEdge& of = shadows.edges.edge(edge);
    const EdgeMesh& mesh = shadows.input.object(of.id.object);
    const auto& ends = mesh.edge(of.id.edge).vertices;
    const LightSheet sheet(of.light->origin(), mesh.position(ends[0]), mesh.position(ends[1]));
    const double s = (t - piece->t0) / (piece->t1 - piece->t0);
    const Vec3d x = sheet.point(t, piece->k0 + (piece->k1 - piece->k0) * s);
    EXPECT_LT(length(x - point->x), 1e-5);
    // On the straight line between the piece's ends, where it says, and back.
    double slope;
    const double fraction = piece->from_edge(t, slope);
    const Vec3d x0 = sheet.point(piece->t0, piece->k0), x1 = sheet.point(piece->t1, piece->k1);
    EXPECT_LT(length(x0 + (x1 - x0) * fraction - x), 1e-9);
    EXPECT_NEAR(piece->to_edge(fraction), t, 1e-9);
    const double step = 1e-6 * (piece->t1 - piece->t0);
    double unused;
    if (t - step > piece->t0 && t + step < piece->t1) {
      const double rise = piece->from_edge(t + step, unused) - piece->from_edge(t - step, unused);
      EXPECT_NEAR(rise / (2 * step) / slope, 1, 1e-4);
    }
  }
  EXPECT_GT(found, kTrials / 3);
  // Rays in floats decide otherwise where a shadow passes from face to face.
  EXPECT_LE(other, kTrials / 1000);
}

// Where vertices of paths may be: of a matt and of a glossy surface, far and close to a shadow.
std::vector<EdgeQuery> queries_of(const Shadows& shadows) {
  std::vector<EdgeQuery> queries;
  const Bsdf& matt = *shadows.scene.shapes[1].bsdf->side(true);
  const Bsdf& gloss = *shadows.scene.shapes[0].bsdf->side(true);
  const auto add = [&](const Vec3d& p, const Vec3d& n, const Vec3d& wi, const Bsdf& bsdf,
                       FaceRef face) {
    EdgeQuery query;
    query.p = p;
    query.n = n;
    query.wi = normalize(wi);
    query.lobe = bsdf.lobe();
    query.face = face;
    queries.push_back(query);
  };
  add({0.3, 1, -1.5}, {0, 0, 1}, {0, 1, 1}, matt, {ShapeId(1), FaceId(0)});
  add({-1, 0.4, 0.5}, {0, -1, 0}, {1, -1, 1}, gloss, {});
  const ShadowPiece& piece = shadows.pieces.pieces()[0];
  const ShadowEdge& edge = shadows.edges.edge(piece.edge);
  const EdgeMesh& mesh = shadows.input.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d x = LightSheet(edge.light->origin(), mesh.position(ends[0]), mesh.position(ends[1]))
                      .point(piece.t1, piece.k1);
  for (const double r : {1e-1, 1e-2})
    add(x + Vec3d{0, 1, 0} * r, {0, -1, 0}, {0.3, -1, 0.2}, matt, {});
  return queries;
}

// Steps that crowd at both ends, where a point may be close; and back.
double crowded(double g) { return g * g * (3 - 2 * g); }
double uncrowded(double f) { return 0.5 - std::sin(std::asin(1 - 2 * f) / 3); }

// Densities sum up to the probability that a draw finds anything, and draws follow them.
TEST(ShadowPieces, AreDrawnByTheirDensity) {
  const TempFiles files;
  const Shadows shadows(files);
  constexpr int kBins = 4, kSteps = 256, kDraws = 40000;
  const auto queries = queries_of(shadows);
  for (size_t q = 0; q < queries.size(); ++q) {
    const EdgeQuery& query = queries[q];
    const auto& pieces = shadows.pieces.pieces();
    std::vector<double> expected, observed(kBins * pieces.size() + 1);
    for (const ShadowPiece& piece : pieces) {
      for (int bin = 0; bin < kBins; ++bin) {
        double sum = 0;
        for (int step = 0; step < kSteps; ++step) {
          const double g = bin * kSteps + step, all = kBins * kSteps;
          const double t0 = piece.to_edge(crowded(g / all));
          const double t1 = piece.to_edge(crowded((g + 1) / all));
          const double middle = piece.to_edge(crowded((g + 0.5) / all));
          sum += shadows.pieces.density(query, piece.edge, middle) * (t1 - t0);
        }
        expected.push_back(sum);
      }
    }
    const double all = std::accumulate(expected.begin(), expected.end(), 0.0);
    EXPECT_LT(all, 1.001);
    EXPECT_GT(all, 0.3);
    expected.push_back(std::max(0.0, 1 - all));
    for (double& e : expected) e *= kDraws;
    std::vector<std::optional<ShadowDraw>> draws;
    for (int i = 0; i < kDraws; ++i) {
      Rng rng(11, i, q);
      shadows.pieces.draw(query, {&rng, 1}, draws);
      if (!draws[0]) {
        ++observed.back();
        continue;
      }
      const ShadowPiece* piece = shadows.piece_at(draws[0]->edge, draws[0]->t);
      ASSERT_NE(piece, nullptr);
      double slope;
      const double f = piece->from_edge(draws[0]->t, slope);
      const int bin = std::clamp(static_cast<int>(kBins * uncrowded(f)), 0, kBins - 1);
      ++observed[kBins * (piece - pieces.data()) + bin];
      const double density = shadows.pieces.density(query, draws[0]->edge, draws[0]->t);
      EXPECT_NEAR(draws[0]->density / density, 1, 1e-6);
    }
    const test::ChiSquare fit = test::chi_square_test(observed, expected);
    fmt::print("query {}: found {:.4f}, chi-square {:.1f} of {}, p {:.3f}\n", q, all, fit.statistic,
               fit.degrees_of_freedom, fit.p_value);
    EXPECT_GT(fit.degrees_of_freedom, 3);
    EXPECT_GT(fit.p_value, test::sidak_threshold(1e-3, 4));
  }
}

// A box on a floor or above it, before a bulb.
SceneParts box_parts(const std::string& surface, double height, double gap = 0,
                     const std::string& floor = square("floor", 3, -90, {0, 0, 0},
                                                       diffuse("grey", ".7, .7, .7"))) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0.35, 2, 3.5};
  parts.target = {0.3, 0.3, -0.25};
  parts.fov = 62;
  parts.width = parts.height = 12;
  parts.body =
      floor + R"(<shape type="cube" id="box"><transform name="to_world">
                    <scale x=".6" y=")" +
      fmt::format(R"({}" z=".42"/><translate y="{}"/></transform>)", height / 2, height / 2 + gap) +
      surface + R"(</shape>
               <emitter type="point"><point name="position" value="0.714, 3.036, 0.109"/>
                 <rgb name="intensity" value="16, 16, 16"/></emitter>)";
  return parts;
}

struct StandingBox {
  Scene scene(const TempFiles& files) const {
    return make_scene(files, box_parts(surface, height, gap));
  }

  const char* name;
  std::string surface;
  double height;
  // The derivative summed over the image, by differences of images at 2,097,152 samples (1,500,000
  // for the plate, with half the step; 2,000,000 for the hovering box).
  double truth, error;
  double gap = 0;
};

StandingBox matt_box() { return {"diffuse", diffuse("clay", ".6, .6, .6"), 0.2, -1.533, 0.0055}; }
const char* kGloss = R"(<bsdf type="roughconductor"><float name="alpha" value=".16"/>
                          <string name="distribution" value="beckmann"/></bsdf>)";
StandingBox glossy_box() { return {"glossy", kGloss, 0.2, -3.6533, 0.0081}; }
// A twentieth of a pixel is what is seen of its side, which its shadow lights up.
StandingBox plate() { return {"plate", kGloss, 0.02, -2.4327, 0.0077}; }
// Of the floor in view a thousandth sees the edges of its lit side at grazing angles.
StandingBox hovering_box() { return {"hovering", kGloss, 0.2, -4.0405, 0.0065, 0.1}; }

// Runs of different seeds, held against the truth: none is off by more than three times its error
// bar, and together they scatter as the bars say.
class Runs {
 public:
  explicit Runs(const StandingBox& box) : box_(box) {}

  void add(const Moments& sum) {
    const double error = std::hypot(std::sqrt(sum.variance(0)), box_.error);
    const double z = (sum.mean(0) - box_.truth) / error;
    ++count_;
    squares_ += z * z;
    worst_ = std::max(worst_, std::fabs(z));
  }
  void expect_true(const std::string& name) const {
    const double p = test::upper_gamma(count_ / 2.0, squares_ / 2);
    fmt::print("{}: largest |z| {:.2f}, sum of squares {:.1f} of {}, p {:.3g}\n", name, worst_,
               squares_, count_, p);
    EXPECT_LT(worst_, 3);
    EXPECT_GT(p, 1e-3);
    EXPECT_LT(p, 1 - 1e-3);
  }

 private:
  const StandingBox& box_;
  int count_ = 0;
  double squares_ = 0, worst_ = 0;
};

// Drawn as the light alone sees the edges, 15 and 20 of 30 runs are off by more than three bars;
// without lines from the edges of gloss 1 of the last, whose scores have a sum of squares of 68.
TEST(ShadowPieces, HaveTrueErrorBarsWhereShadowsBegin) {
  const TempFiles files;
  for (const StandingBox& box : {matt_box(), glossy_box(), plate(), hovering_box()}) {
    const Scene scene = box.scene(files);
    GradientOptions options;
    options.parameters = {"box.translate.z"};
    RunSettings settings;
    settings.spp = 64;
    settings.threads = 2;
    Runs runs(box);
    for (settings.seed = 1; settings.seed <= 30; ++settings.seed) {
      runs.add(gradient(scene, options, settings).parameters[0].image_sum);
    }
    runs.expect_true(box.name);
  }
}

// Reverse mode draws by motions of every vertex by itself.
TEST(ShadowPieces, ServeReverseMode) {
  const TempFiles files;
  const StandingBox box = matt_box();
  const Scene scene = box.scene(files);
  BackwardOptions options;
  options.parameters = {"box.translate.z"};
  RunSettings settings;
  settings.spp = 256;
  settings.threads = 2;
  Image adjoint(12, 12, 3);
  std::fill(adjoint.data.begin(), adjoint.data.end(), 1.0f);
  Runs runs(box);
  for (settings.seed = 1; settings.seed <= 10; ++settings.seed) {
    runs.add(backward(scene, adjoint, options, settings).of("box.translate.z").moments);
  }
  runs.expect_true("reverse");
}

// Where lines carry most of the light: on a strip of floor, a hundredth of the film, just before
// the lit side of a hovering box. Methods without lines leave its edges to vertices.
TEST(GlossLines, ShareEdgesWithVertices) {
  const TempFiles files;
  const char* strip = "v .601 0 .4\nv .63 0 .4\nv .63 0 -.4\nv .601 0 -.4\nf 1 2 3 4\n";
  SceneParts parts = box_parts(kGloss, 0.2, 0.1,
                               obj_shape("strip", files.write("strip.obj", strip), true, 1,
                                         {0, 0, 0}, diffuse("grey", ".7, .7, .7")));
  parts.origin = {0.59, 3, 0};
  parts.target = {0.59, 0, 0.001};
  parts.fov = 60;
  parts.width = parts.height = 32;
  const auto sum_of = [&](const std::string& method, int spp) {
    GradientOptions options;
    options.parameters = {"box.translate.y"};
    options.terms = {"boundary"};
    options.method = method;
    RunSettings settings;
    settings.spp = spp;
    settings.threads = 2;
    return gradient(make_scene(files, parts), options, settings).parameters[0].image_sum;
  };
  const Moments lines = sum_of("silhouettes", 256);
  parts.film = R"(<integer name="crop_offset_x" value="14"/><integer name="crop_width" value="4"/>
                  <integer name="crop_offset_y" value="10"/><integer name="crop_height" value="12"/>
                  <rfilter type="box"/>)";
  const Moments vertices = sum_of("forest", 4096);
  const double error = std::sqrt(lines.variance(0) + vertices.variance(0));
  fmt::print("{} +- {}, {} +- {}\n", lines.mean(0), std::sqrt(lines.variance(0)), vertices.mean(0),
             std::sqrt(vertices.variance(0)));
  EXPECT_LT(std::fabs(lines.mean(0) - vertices.mean(0)), 4 * error);
  EXPECT_LT(error, 0.05 * std::fabs(vertices.mean(0)));
}

// Vertices that lines find, by ninths of a film of 12 by 12 pixels: those that are drawn, and what
// their density comes to.
class Ninths {
 public:
  void draw(const SeenVertex& vertex, const PathContext& context) {
    RayCount rays;
    const FilmPlace& at = vertex.seen.at;
    const bool inside = at.x >= 0 && at.x < 12 && at.y >= 0 && at.y < 12;
    if (inside && !is_hidden(context, vertex.seen, vertex.face, rays)) ++drawn_[bin_of(at)];
  }
  void expect(const SeenVertex& vertex, double amount) {
    expected_[bin_of(vertex.seen.at)] += amount;
    squares_[bin_of(vertex.seen.at)] += amount * amount;
  }
  void compare(int samples) const {
    double worst = 0;
    for (size_t bin = 0; bin < drawn_.size(); ++bin) {
      const double error = std::sqrt(drawn_[bin] + squares_[bin]);
      if (error > 0) worst = std::max(worst, std::fabs(drawn_[bin] - expected_[bin]) / error);
      fmt::print("{}: drawn {}, expected {:.1f} +- {:.1f}\n", bin, drawn_[bin], expected_[bin],
                 std::sqrt(squares_[bin]));
    }
    EXPECT_GT(std::accumulate(drawn_.begin(), drawn_.end(), 0.0), 0.05 * samples);
    EXPECT_LT(worst, 4);  // nine scores
  }

 private:
  static int bin_of(const FilmPlace& at) {
    return 3 * std::clamp(static_cast<int>(at.y) / 4, 0, 2) +
           std::clamp(static_cast<int>(at.x) / 4, 0, 2);
  }
  std::array<double, 9> drawn_{}, expected_{}, squares_{};
};

// One that the camera sees at a random place of such a film.
std::optional<SeenVertex> vertex_on_film(const PathContext& context, Rng& rng) {
  const double x = 12 * rng.uniform(), y = 12 * rng.uniform();
  const CameraRay<double> from = context.scene.camera.ray<double>(x, y);
  Hit hit;
  if (!context.tracer.closest(Ray{from.origin, from.direction}, hit)) return {};
  const auto met = surface_on_ray<double>(context.scene, hit.face, from.origin, from.direction);
  return seen_vertex(context.scene, hit.face, met.p, {});
}

// As many draws of lines arrive where the camera sees them as their density says, which is
// integrated over the film and the edges.
TEST(GlossLines, FollowTheirDensity) {
  const TempFiles files;
  Scene scene = make_scene(files, box_parts(conductor("gloss", 0.3), 0.2, 0.4));
  find_parameter(scene, "box.translate.z").seed(scene, 0);
  const TracedScene traced(scene, 1, {.edges = true});
  const PathContext& context = traced.context();
  const EdgeSamplerInput input = make_scene_edges(scene, 1);
  const GlossLines lines(context, input, false);
  ASSERT_FALSE(lines.empty());
  constexpr int kSamples = 2000000;
  Ninths ninths;
  for (int i = 0; i < kSamples; ++i) {
    Rng rng(3, i, 1);
    RayCount rays;
    const double u = rng.uniform();
    const auto line = lines.draw(u, rng, {}, rays);
    if (line) ninths.draw(line->vertex, context);
  }
  const EdgeMesh& box = input.object(ShapeId(1));
  for (int i = 0; i < kSamples; ++i) {
    Rng rng(4, i, 1);
    const auto vertex = vertex_on_film(context, rng);
    if (!vertex) continue;
    const auto e = static_cast<uint32_t>(rng.uniform() * static_cast<double>(box.edges.size()));
    const double t = rng.uniform();
    const auto& ends = box.edge(EdgeId(e)).vertices;
    const Vec3d at = box.position(ends[0]) * (1 - t) + box.position(ends[1]) * t;
    Ray ray{at, normalize(vertex->q - at)};
    const FacesAround around = box.around(EdgeId(e));
    ray.skip_faces = around.all;
    Hit hit;
    if (!closest_at_edge(context.tracer, scene, around, at, 0, ray, hit)) continue;
    if (hit.face != vertex->face) continue;
    const double density = lines.share({{ShapeId(1), EdgeId(e)}, t, *vertex}).density;
    ninths.expect(*vertex, density * 144 * static_cast<double>(box.edges.size()));
  }
  ninths.compare(kSamples);
}

// Light that comes in low: a glossy floor throws the shadow of a box on the wall behind.
SceneParts thrown_shadow(const std::string& floor) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0.6, 2.2, 3.2};
  parts.target = {0.1, 0.4, -0.6};
  parts.fov = 55;
  parts.width = parts.height = 12;
  parts.body = square("floor", 3, -90, {0, 0, 0}, floor) +
               square("wall", 3, 0, {0, 0, -1}, diffuse("plaster", ".6, .6, .6")) +
               R"(<shape type="cube" id="box"><transform name="to_world">
                    <scale x=".4" y=".2" z=".1"/><translate y=".2" z="-.5"/></transform>)" +
               diffuse("clay", ".6, .5, .4") + R"(</shape>
               <emitter type="directional"><vector name="direction" value="-.2, -.6, -1.1"/>
                 <rgb name="irradiance" value="2, 2, 2"/></emitter>)";
  return parts;
}

// A density of 1.1 times as much is found out.
TEST(ShadowLines, FollowTheirDensity) {
  const TempFiles files;
  Scene scene = make_scene(files, thrown_shadow(conductor("gloss", 0.3)));
  find_parameter(scene, "box.translate.x").seed(scene, 0);
  const TracedScene traced(scene, 1, {.edges = true});
  const PathContext& context = traced.context();
  const EdgeSamplerInput input = make_scene_edges(scene, 1);
  const LightFrames frames(scene, input);
  const ShadowEdges edges(context, frames, 1);
  const ShadowLines lines(context, input);
  constexpr int kSamples = 2000000;
  Ninths ninths;
  for (int i = 0; i < kSamples; ++i) {
    Rng rng(3, i, 1);
    RayCount rays;
    const ShadowEdge& edge = edges.edge(edges.choose(rng.uniform()));
    const double t = rng.uniform(), u_0 = rng.uniform(), u_1 = rng.uniform();
    const auto point = edges.cast(edge, t, rng, rays);
    const auto vertex = point ? lines.draw(edge, *point, u_0, u_1, {}, rays) : std::nullopt;
    if (vertex) ninths.draw(*vertex, context);
  }
  for (int i = 0; i < kSamples; ++i) {
    Rng rng(4, i, 1);
    RayCount rays;
    const auto vertex = vertex_on_film(context, rng);
    const auto e = static_cast<uint32_t>(rng.uniform() * static_cast<double>(edges.size()));
    const auto point = edges.cast(edges.edge(e), rng.uniform(), rng, rays);
    if (!vertex || !point) continue;
    Ray ray{point->x, normalize(vertex->q - point->x)};
    ray.start = point->face;
    Hit hit;
    if (!context.tracer.closest(ray, hit) || hit.face != vertex->face) continue;
    const double density = edges.probability(e) * lines.density(edges.edge(e), *point, *vertex);
    ninths.expect(*vertex, density * 144 * static_cast<double>(edges.size()));
  }
  ninths.compare(kSamples);
}

// By the cosine alone it is 1.8e-5.
TEST(ShadowLines, FollowTheLobesOfFaces) {
  const TempFiles files;
  const Scene scene = make_scene(files, thrown_shadow(conductor("gloss", 0.16)));
  GradientOptions options;
  options.parameters = {"box.translate.x"};
  options.terms = {"shadow"};
  RunSettings settings;
  settings.spp = 64;
  settings.threads = 2;
  double squares = 0;
  for (settings.seed = 1; settings.seed <= 10; ++settings.seed) {
    const Moments total = gradient(scene, options, settings).parameters[0].total;
    squares += mean_of(variances(total)) / 10;
  }
  fmt::print("mean squared error {:.3g}\n", squares);
  EXPECT_LT(squares, 6e-6);  // 2.4e-6
}

}  // namespace
}  // namespace limn
