// Fits: their parts against hand-made numbers, closed forms by z-scores, and bits that must not
// change.
#include "limn/integrators/fit.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "integrators/fit/quasi_newton.h"
#include "integrators/fit/surface_tree.h"
#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/large_steps.h"
#include "limn/integrators/mesh_distance.h"
#include "limn/integrators/remesh.h"
#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

using nlohmann::json;

// x with A x = b, by elimination with pivots; rows of A, then of b.
std::vector<double> solve_dense(std::vector<std::vector<double>> a, std::vector<double> b) {
  const size_t n = b.size();
  for (size_t i = 0; i < n; ++i) {
    size_t pivot = i;
    for (size_t r = i; r < n; ++r)
      if (std::fabs(a[r][i]) > std::fabs(a[pivot][i])) pivot = r;
    std::swap(a[i], a[pivot]);
    std::swap(b[i], b[pivot]);
    for (size_t r = i + 1; r < n; ++r) {
      const double f = a[r][i] / a[i][i];
      for (size_t c = i; c < n; ++c) a[r][c] -= f * a[i][c];
      b[r] -= f * b[i];
    }
  }
  for (size_t i = n; i-- > 0;) {
    for (size_t c = i + 1; c < n; ++c) b[i] -= a[i][c] * b[c];
    b[i] /= a[i][i];
  }
  return b;
}

// Copies along seams are one vertex, borders and closed meshes alike.
TEST(Fit, LargeStepsSolveWhatADenseMatrixDoes) {
  for (const Mesh& mesh : {seam_split(torus_mesh(7, 4)), grid_mesh(4), icosphere_mesh(1)}) {
    const double lambda = std::pow(0.7 / mean_edge_length(mesh), 2);
    const LargeSteps steps(mesh, lambda);
    const size_t n = steps.size();
    std::vector<std::vector<double>> matrix(n, std::vector<double>(n));
    double sum = 0, edges = 0;
    for (const FaceIndices& face : mesh.faces) {
      for (int k = 0; k < 3; ++k) {
        const uint32_t a = face[k], b = face[(k + 1) % 3];
        const uint32_t i = steps.welded()[a], j = steps.welded()[b];
        if (matrix[i][j] != 0) continue;
        matrix[i][j] = matrix[j][i] = -1;
        sum += length(cast<double>(mesh.positions[a]) - cast<double>(mesh.positions[b]));
        ++edges;
      }
    }
    EXPECT_NEAR(mean_edge_length(mesh), sum / edges, 1e-12);
    for (size_t i = 0; i < n; ++i) {
      double row = 0;
      for (double& x : matrix[i]) row += x *= steps.lambda();
      matrix[i][i] = 1 - row;
    }
    std::vector<double> x(3 * n);
    for (size_t i = 0; i < x.size(); ++i) x[i] = Rng(1, i, 0).uniform() - 0.5;
    const std::vector<double> solved = steps.solve(x), back = steps.apply(solved);
    for (int k = 0; k < 3; ++k) {
      std::vector<double> column(n);
      for (size_t i = 0; i < n; ++i) column[i] = x[3 * i + k];
      const std::vector<double> dense = solve_dense(matrix, column);
      for (size_t i = 0; i < n; ++i) {
        EXPECT_NEAR(solved[3 * i + k], dense[i], 1e-12);
        EXPECT_NEAR(back[3 * i + k], column[i], 1e-12);
      }
    }
  }
}

// Two steps down (x - 3)^2 / 2 and (y + 1)^2 / 8 from zero, worked out by hand.
TEST(Fit, OptimisersStepAsByHand) {
  const auto two_steps = [](OptimiserKind kind) {
    Optimiser optimiser(kind, 2);
    std::vector<double> x{0, 0};
    for (int64_t count = 0; count < 2; ++count) {
      const auto step = optimiser.step({x[0] - 3, (x[1] + 1) / 4}, count);
      for (int k = 0; k < 2; ++k) x[k] += step[k];
    }
    return x;
  };
  // Gradients: -3, 1/4, then those after a first step of 1, -1 (Adam), 1, -1/12 (one scale).
  const double m1 = (0.9 * 0.1 * -3 + 0.1 * -2) / 0.19;
  const double v1 = (0.95 * 0.05 * 9 + 0.05 * 4) / (1 - 0.95 * 0.95);
  const double m2 = 0.9 * 0.1 * 0.25 / 0.19, v2 = 0.95 * 0.05 * 0.0625 / (1 - 0.95 * 0.95);
  const auto adam = two_steps(OptimiserKind::kAdam);
  EXPECT_NEAR(adam[0], 1 - m1 / std::sqrt(v1), 1e-14);
  EXPECT_NEAR(adam[1], -1 - m2 / std::sqrt(v2), 1e-14);
  const double y1 = -0.25 / 3, m3 = (0.9 * 0.1 * 0.25 + 0.1 * (y1 + 1) / 4) / 0.19;
  const auto uniform = two_steps(OptimiserKind::kAdamUniform);
  EXPECT_NEAR(uniform[0], 1 - m1 / std::sqrt(v1), 1e-14);
  EXPECT_NEAR(uniform[1], y1 - m3 / std::sqrt(v1), 1e-14);
  const auto descent = two_steps(OptimiserKind::kGradientDescent);
  EXPECT_DOUBLE_EQ(descent[0], 3);
  EXPECT_DOUBLE_EQ(descent[1], -0.25 - 0.75 / 4);
  // What nothing pulls at rests.
  EXPECT_EQ(Optimiser(OptimiserKind::kAdam, 1).step({0}, 0)[0], 0);
}

// A scene whose image and derivatives are known.
struct Known {
  Scene scene;
  json reference;
};
Known known(const std::string& name) {
  const std::string folder = std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/";
  std::ifstream file(folder + "references.json");
  const json all = json::parse(file)["scenes"];
  for (const json& one : all) {
    if (one["file"] == name) return {read_scene(folder + name, {}, nullptr), one};
  }
  throw std::runtime_error("no reference of " + name);
}
std::vector<double> derivative(const Known& k, const std::string& parameter) {
  for (const json& p : k.reference["parameters"])
    if (p["name"] == parameter) return p["total"];
  throw std::runtime_error("no derivative for " + parameter);
}
Image image_of(const Known& k, const std::vector<double>& values) {
  Image image(k.scene.film.crop_width, k.scene.film.crop_height, 3);
  for (size_t i = 0; i < values.size(); ++i) image.data[i] = static_cast<float>(values[i]);
  return image;
}

double z_score(const Moments& m, size_t i, double truth) {
  return (m.mean(i) - truth) / std::sqrt(m.variance(i));
}

// Loss and gradient by three independent images have the closed forms' means; a mask weighs pixels,
// and what it leaves out may be anything.
TEST(Fit, LossAndItsGradientHaveTheRightMean) {
  const Known k = known("lamp_over_plane.xml");
  const std::vector<double> exact = k.reference["image"];
  Image target = image_of(k, exact), mask(target.width, target.height, 1);
  for (size_t i = 0; i < target.data.size(); ++i) target.data[i] *= 0.6f + 0.1f * (i % 5);
  for (size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = static_cast<float>(i);
  target.data[0] = NAN;  // in the pixel of mask 0
  const std::vector<std::string> names{"lamp.translate.x", "lamp.rotate.z",
                                       "floor_bsdf.reflectance.g"};
  double sum = 0;
  for (const float m : mask.data) sum += 3 * m;
  for (const LossKind kind : {LossKind::kL2, LossKind::kRelativeL2}) {
    const std::string name = kLosses[static_cast<int>(kind)];
    double loss = 0;
    std::vector<double> adjoint(exact.size());
    for (size_t i = 3; i < exact.size(); ++i) {
      const double t = target.data[i], w = mask.data[i / 3] / sum;
      const double scale = kind == LossKind::kL2 ? w : w / (t * t + 0.01);
      loss += scale * (exact[i] - t) * (exact[i] - t);
      adjoint[i] = 2 * scale * (exact[i] - t);
    }
    Moments found(1 + names.size());
    BackwardOptions options;
    options.parameters = names;
    RunSettings settings;
    settings.spp = 2;
    for (settings.seed = 0; settings.seed < 1024; ++settings.seed) {
      const LossResult one = image_loss(k.scene, target, {kind}, settings, mask);
      const BackwardResult result = backward(k.scene, one.adjoint, options, settings);
      std::vector<double> values{one.value};
      for (const ParameterAdjoint& p : result.parameters) values.push_back(p.moments.mean(0));
      found.add_batch(values, 1);
    }
    fmt::print("{}: z {:.2f}, error {:.1f} %\n", name, z_score(found, 0, loss),
               100 * std::sqrt(found.variance(0)) / loss);
    EXPECT_LT(std::fabs(z_score(found, 0, loss)), 4.5) << name;
    for (size_t p = 0; p < names.size(); ++p) {
      const bool green = names[p].ends_with(".g");  // alone: the reference moves all channels
      const std::vector<double> d =
          derivative(k, green ? names[p].substr(0, names[p].size() - 2) : names[p]);
      double truth = 0;
      for (size_t i = 0; i < d.size(); ++i) truth += green && i % 3 != 1 ? 0 : adjoint[i] * d[i];
      fmt::print("{} {}: z {:.2f}, error {:.1f} %\n", name, names[p], z_score(found, 1 + p, truth),
                 100 * std::sqrt(found.variance(1 + p)) / std::fabs(truth));
      EXPECT_LT(std::fabs(z_score(found, 1 + p, truth)), 4.5) << name << " " << names[p];
    }
  }
}

// The image is linear in the reflectance, so l2 is a parabola of known curvature H_c in channel c,
// and the mean of x - x* falls by 1 - s H_c in each step of gradient descent, however noisy the
// gradients are.
TEST(Fit, DescentOnAReflectanceFollowsItsClosedForm) {
  const Known k = known("lamp_over_plane.xml");
  const std::vector<double> image = k.reference["image"];
  const std::vector<double> slope = derivative(k, "floor_bsdf.reflectance");
  const double offset[3] = {0.1, -0.2, 0.05};
  std::vector<double> target = image;
  double curvature[3] = {};
  for (size_t i = 0; i < target.size(); ++i) {
    target[i] += offset[i % 3] * slope[i];
    curvature[i % 3] += 2 * slope[i] * slope[i] / static_cast<double>(target.size());
  }
  FitOptions options;
  options.parameters = {"floor_bsdf.reflectance"};
  options.optimiser = OptimiserKind::kGradientDescent;
  // So that a step takes off a fifth of red: x -= step natural^2 dL/dx.
  const Parameter reflectance = find_parameter(k.scene, options.parameters[0]);
  const std::vector<double> start = reflectance.value(k.scene);
  const double natural = reflectance.natural_step;
  options.step = 0.2 / curvature[0] / (natural * natural);
  RunSettings settings;
  settings.spp = 4;
  constexpr int kSteps = 12;
  Moments found(3);
  for (settings.seed = 0; settings.seed < 64; ++settings.seed) {
    Fit fit({{k.scene, image_of(k, target), {}}}, options, settings);
    for (int i = 0; i < kSteps; ++i) ASSERT_TRUE(fit.step());
    std::vector<double> values;
    for (const FitScalar& s : fit.scalars()) values.push_back(s.value);
    found.add_batch(values, 1);
  }
  for (size_t c = 0; c < 3; ++c) {
    const double left = std::pow(1 - 0.2 * curvature[c] / curvature[0], kSteps);
    const double truth = start[c] + offset[c] * (1 - left);
    fmt::print("channel {}: found {:.5f} +- {:.5f}, truth {:.5f}\n", c, found.mean(c),
               std::sqrt(found.variance(c)), truth);
    EXPECT_LT(std::fabs(z_score(found, c, truth)), 4.5);
  }
}

// A lamp is found back from the light that it throws on a floor.
TEST(Fit, FindsALampBack) {
  const Known k = known("lamp_over_plane.xml");
  FitOptions options;
  options.parameters = {"lamp.translate.x"};
  options.step = 2;
  options.step_half_life = 15;
  RunSettings settings;
  settings.spp = 32;
  Moments found(1);
  const Scene start = find_parameter(k.scene, options.parameters[0]).moved(k.scene, -0.15);
  const FitView view{start, image_of(k, k.reference["image"]), {}};
  for (settings.seed = 0; settings.seed < 16; ++settings.seed) {
    Fit fit({view}, options, settings);
    for (int i = 0; i < 90; ++i) ASSERT_TRUE(fit.step());
    found.add_batch({fit.scalars()[0].value}, 1);
  }
  // Of 16 seeds: Student's t of 15 degrees, below 5 but in one of 6000.
  EXPECT_LT(std::fabs(z_score(found, 0, 0.15)), 5);
}

// A body seen from two sides, in two scenes.
std::vector<FitView> two_views(const TempFiles& files) {
  std::vector<FitView> views;
  SceneParts parts;
  parts.width = parts.height = 12;
  const std::string mesh = write_mesh(files, "body.obj", seam_split(icosphere_mesh(1)));
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.2)) +
               obj_shape("body", mesh, false, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6"));
  for (const Vec3d& origin : {Vec3d{0, 2, 4}, Vec3d{3, 1.5, -2}}) {
    parts.origin = origin;
    Image target(12, 12, 3);
    for (size_t i = 0; i < target.data.size(); ++i) target.data[i] = 0.1f * (i % 7);
    views.push_back({make_scene(files, parts), target, {}});
  }
  return views;
}

// All that can be told apart of where a fit is.
std::vector<double> numbers(const Fit& fit) {
  const FitState state = fit.state();
  std::vector<double> all;
  const auto add = [&](const std::vector<double>& v) { all.insert(all.end(), v.begin(), v.end()); };
  for (const auto& p : state.parameters) {
    for (const auto* v : {&p.values, &p.first, &p.second}) add(*v);
  }
  for (const auto& view : state.views) {
    add(view.camera);
    for (const auto& v : view.values) add(v);
    for (const auto& shape : view.shapes) {
      for (const Vec3f& x : shape.positions) add({x.x, x.y, x.z});
      for (const Vec3d& x : shape.normals) add({x.x, x.y, x.z});
    }
  }
  return all;
}

TEST(Fit, NeitherThreadsNorABreakChangeABit) {
  const TempFiles files;
  FitOptions options;
  options.step_half_life = 3;
  options.spp_doubling = 3;
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"body.vertex_positions", "glow.radiance", "sensor.rotate.y"},
        std::vector<std::string>{"body.rotate.x", "body.translate.z", "clay.reflectance"}}) {
    options.parameters = names;
    RunSettings settings;
    settings.spp = 2;
    Fit whole(two_views(files), options, settings);
    const std::vector<double> before = numbers(whole);
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(whole.step());
    settings.threads = 3;
    Fit first(two_views(files), options, settings);
    for (int i = 0; i < 2; ++i) ASSERT_TRUE(first.step());
    Fit second(two_views(files), options, settings);
    second.restore(first.state());
    for (int i = 0; i < 2; ++i) ASSERT_TRUE(second.step());
    EXPECT_EQ(numbers(whole), numbers(second));
    EXPECT_NE(numbers(whole), before);
    EXPECT_EQ(whole.steps(), 4);
    // An interrupt leaves no trace.
    std::atomic<bool> interrupted = true;
    settings.interrupted = &interrupted;
    Fit stopped(two_views(files), options, settings);
    EXPECT_FALSE(stopped.step());
    EXPECT_EQ(numbers(stopped), before);
    EXPECT_EQ(stopped.steps(), 0);
  }
}

// The gradient of the mean over views is the mean of their gradients: each of two views together
// with one that does not have the parameter.
TEST(Fit, ViewsCountAlike) {
  const TempFiles files;
  FitOptions options;
  options.parameters = {"clay.reflectance"};
  options.optimiser = OptimiserKind::kGradientDescent;
  RunSettings settings;
  settings.spp = 2;
  const std::vector<FitView> views = two_views(files);
  std::vector<FitView> blind = views;
  for (FitView& view : blind) view.scene.bsdfs_by_id.erase("clay");
  std::vector<double> moved;
  std::vector<FitRecord> records;
  for (const auto& [first, second] :
       {std::pair(views[0], blind[1]), {blind[0], views[1]}, {views[0], views[1]}}) {
    Fit fit({first, second}, options, settings);
    const double before = fit.scalars()[0].value;
    records.push_back(*fit.step());
    moved.push_back(fit.scalars()[0].value - before);
  }
  // To the rounding of values near one half.
  EXPECT_NEAR(moved[2], moved[0] + moved[1], 0x1p-50);
  EXPECT_GT(std::fabs(moved[0]), 0x1p-40);
  EXPECT_GT(std::fabs(moved[1]), 0x1p-40);
  const FitRecord& both = records[2];
  EXPECT_EQ(both.view_losses, records[0].view_losses);
  EXPECT_DOUBLE_EQ(both.loss, (both.view_losses[0] + both.view_losses[1]) / 2);
}

// A first step of Adam takes every coordinate equally far: with a huge one, vertices would meet in
// the corners of a box.
TEST(Fit, StepsThatWouldLoseAFaceAreHalved) {
  const TempFiles files;
  FitOptions options;
  options.parameters = {"body.vertex_positions"};
  options.optimiser = OptimiserKind::kAdam;
  options.smoothing = 0;
  options.step = 1e10;
  RunSettings settings;
  settings.spp = 2;
  Fit fit(two_views(files), options, settings);
  const Mesh before = fit.views()[0].scene.shapes[1].mesh;
  const std::optional<FitRecord> record = fit.step();
  ASSERT_TRUE(record);
  EXPECT_GT(record->halvings, 0);
  EXPECT_LT(record->halvings, 30);
  const Mesh& after = fit.views()[0].scene.shapes[1].mesh;
  EXPECT_EQ(after.weld, before.weld);
  EXPECT_EQ(after.faces, before.faces);
  EXPECT_NE(after.positions, before.positions);
  for (const FaceIndices& face : after.faces) EXPECT_TRUE(has_area(after, face));
}

TEST(Fit, ValuesStayWithinTheirBounds) {
  const TempFiles files;
  FitOptions options;
  options.parameters = {"clay.reflectance", "glow.radiance", "body.translate.x"};
  options.bounds = {{"glow.radiance", 5.5, 6.5}, {"body.translate.x", -0.01, 0.02}};
  options.step = 200;
  RunSettings settings;
  settings.spp = 2;
  Fit fit(two_views(files), options, settings);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(fit.step());
    for (const FitView& view : fit.views()) {
      const auto value = [&](const char* name) {
        return find_parameter(view.scene, name).value(view.scene);
      };
      for (const double x : value("clay.reflectance")) EXPECT_TRUE(x >= 0 && x <= 1) << x;
      for (const double x : value("glow.radiance")) EXPECT_TRUE(x >= 5.5 && x <= 6.5) << x;
    }
    const double x = fit.scalars().back().value;
    EXPECT_TRUE(x == -0.01 || x == 0.02) << x;
  }
}

TEST(Fit, RefusesWhatCannotBeFitted) {
  const TempFiles files;
  const std::vector<FitView> views = two_views(files);
  const auto refused = [&](const FitOptions& options, const std::vector<FitView>& of) {
    try {
      Fit fit(of, options, {});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  FitOptions options;
  EXPECT_EQ(refused(options, views), "error: a fit needs a parameter");
  options.parameters = {"clay.reflectanse"};
  EXPECT_NE(refused(options, views).find("nearest: clay.reflectance"), std::string::npos);
  options.parameters = {"clay.reflectance", "clay.reflectance"};
  EXPECT_NE(refused(options, views).find("is given twice"), std::string::npos);
  options.parameters = {"clay.reflectance.g", "clay.reflectance"};
  EXPECT_NE(refused(options, views).find("is a channel of"), std::string::npos);
  options.parameters = {"body.vertex_positions", "body.translate.x"};
  EXPECT_NE(refused(options, views).find("move the same vertices"), std::string::npos);
  options.parameters = {"clay.reflectance"};
  options.bounds = {{"clay.reflectance", 0.7, 1}};
  EXPECT_NE(refused(options, views).find("outside of its bounds"), std::string::npos);
  options.bounds = {{"glow.radiance", 0, 1}};
  EXPECT_NE(refused(options, views).find("which is not fitted"), std::string::npos);
  options.bounds = {};
  options.step = 0;
  EXPECT_NE(refused(options, views).find("step: 0 is not a number from 1e-12 to 1e+12"),
            std::string::npos);
  options.step = 1;
  std::vector<FitView> other = views;
  other[1].mask = Image(12, 12, 1);
  EXPECT_NE(refused(options, other).find("zero everywhere"), std::string::npos);
  other[1].mask = Image(12, 11, 1);
  EXPECT_NE(refused(options, other).find("the mask has 12 x 11 pixels"), std::string::npos);
  other = views;
  other[1].target.data[7] = INFINITY;
  EXPECT_NE(refused(options, other).find("not finite in column 2, row 0"), std::string::npos);
  other = views;
  other[1].scene.shapes[1].mesh.positions[0].x += 1;
  options.parameters = {"body.vertex_positions"};
  EXPECT_NE(refused(options, other).find("the same vertices and faces"), std::string::npos);
  options.remesh = {3, 0};
  EXPECT_NE(refused(options, views).find("remesh: 0 is not a number from 1 to"), std::string::npos);
  options.remesh = {1000};
  other = views;
  for (FitView& view : other) view.scene.shapes[1].mesh.textured = true;
  EXPECT_NE(refused(options, other).find("\"body\" has textures: remeshing would lose"),
            std::string::npos);
  options.remesh = {};
  options.parameters = {"clay.reflectance"};
  options.backward.terms = {"interior", "shadow"};
  EXPECT_NE(refused(options, views).find("no term \"shadow\" here"), std::string::npos);
  options.backward.terms = {"interior"};
  Fit fit(views, options, {});
  EXPECT_THROW(fit.restore({}), InputError);
  FitState damaged = fit.state();
  damaged.views[1].values[0].pop_back();
  EXPECT_THROW(fit.restore(damaged), InputError);
}

int euler_characteristic(const Mesh& mesh) {
  std::set<uint32_t> vertices;
  std::set<std::pair<uint32_t, uint32_t>> edges;
  for (const FaceIndices& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax({mesh.weld[face[k]], mesh.weld[face[(k + 1) % 3]]});
      vertices.insert(mesh.weld[face[k]]);
      edges.emplace(a, b);
    }
  }
  return static_cast<int>(vertices.size() + mesh.faces.size()) - static_cast<int>(edges.size());
}

// The surface, its topology and its border stay; edges get the length that was asked for.
TEST(Fit, RemeshingKeepsTheSurface) {
  if (!can_remesh()) GTEST_SKIP() << "built without OpenMesh (Debian: libopenmesh-dev)";
  for (const Mesh& mesh : {icosphere_mesh(3), seam_split(torus_mesh(40, 20)), cap_mesh(3)}) {
    for (const double edge : {0.6, 1.0, 1.7}) {
      const double length = edge * mean_edge_length(mesh);
      const Remeshed made = remesh(mesh, length, {"mesh.ply"});
      const Mesh after = make_mesh(made.positions, made.faces);
      EXPECT_EQ(euler_characteristic(after), euler_characteristic(mesh));
      const auto inside_out = count_inside_out(after, 1);
      EXPECT_EQ(inside_out.has_value(), count_inside_out(mesh, 1).has_value());
      EXPECT_EQ(inside_out.value_or(0), 0u);
      EXPECT_EQ(count_crossings(after, 1), 0u);
      // Vertices lie on the surface, to floats' rounding.
      const SurfaceTree tree(mesh);
      for (const Vec3f& p : after.positions) {
        EXPECT_LT(tree.nearest(cast<double>(p)).distance, 0x1p-22);
      }
      // Chords of a sphere of radius 0.4 at least, of the longest edge that is let be, both ways.
      const double sag = 2 * std::pow(4.0 / 3 * std::max(edge, 1.0) * mean_edge_length(mesh), 2);
      EXPECT_LT(mesh_distance(after, mesh, 2000, 1, 1).hausdorff, sag / (8 * 0.4));
      EXPECT_EQ(remesh(mesh, length, {"mesh.ply"}).positions, made.positions);
      if (mesh.faces.size() == cap_mesh(3).faces.size()) continue;  // its border keeps its edges
      size_t good = 0, all = 0;
      for (const FaceIndices& face : after.faces) {
        for (int k = 0; k < 3; ++k, ++all) {
          const double side = limn::length(cast<double>(after.positions[face[k]]) -
                                           cast<double>(after.positions[face[(k + 1) % 3]]));
          good += side > 0.8 * length && side < 4.0 / 3 * length;
        }
      }
      EXPECT_GT(2 * good, all);
      fmt::print("{} faces to {}: {:.1f} % of the edges within 4/5 and 4/3\n", mesh.faces.size(),
                 after.faces.size(), 100.0 * good / all);
    }
  }
  const Mesh fan = make_mesh({{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}},
                             {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}});
  try {
    remesh(fan, 0.5, {"fan.ply"});
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what())
                  .find("fan.ply: error: the mesh cannot be remeshed: it is "
                        "not manifold at face 1"),
              std::string::npos)
        << error.what();
  }
}

TEST(Fit, RemeshedFitsGoOnWithTheSameBits) {
  if (!can_remesh()) GTEST_SKIP() << "built without OpenMesh (Debian: libopenmesh-dev)";
  const TempFiles files;
  FitOptions options;
  options.parameters = {"body.vertex_positions"};
  options.remesh = {2};
  RunSettings settings;
  settings.spp = 2;
  Fit whole(two_views(files), options, settings);
  const size_t before = whole.views()[1].scene.shapes[1].mesh.faces.size();
  for (int i = 0; i < 5; ++i) EXPECT_EQ(whole.step().value().remeshed, i == 1);
  EXPECT_GT(whole.views()[1].scene.shapes[1].mesh.faces.size(), before);
  for (const int pause : {2, 4}) {
    Fit first(two_views(files), options, settings);
    for (int i = 0; i < pause; ++i) ASSERT_TRUE(first.step());
    Fit second(two_views(files), options, settings);
    second.restore(first.state());
    for (int i = pause; i < 5; ++i) ASSERT_TRUE(second.step());
    EXPECT_EQ(numbers(whole), numbers(second)) << pause;
  }
  options.parameters = {"clay.reflectance"};
  EXPECT_THROW(Fit(two_views(files), options, settings), InputError);
}

TEST(Fit, DistancesBetweenMeshesAreTrue) {
  const Mesh plane = grid_mesh(5);
  Mesh above = grid_mesh(3);
  for (Vec3f& p : above.positions) p.z = 0.25f;
  const MeshDistance d = mesh_distance(plane, above, 500, 1, 2);
  EXPECT_DOUBLE_EQ(d.chamfer, 0.25);
  EXPECT_DOUBLE_EQ(d.hausdorff, 0.25);
  EXPECT_DOUBLE_EQ(d.hausdorff_95, 0.25);
  EXPECT_EQ(d.normal_angle, 0);
  // To the rounding of a mean of 100.
  EXPECT_NEAR(mesh_distance(plane, reversed(above), 100, 1, 1).normal_angle, kPi, 1e-13);
  EXPECT_LT(mesh_distance(plane, plane, 500, 1, 1).hausdorff, 1e-15);
  for (Vec3f& p : above.positions) p.y = 0;
  EXPECT_THROW(mesh_distance(plane, above, 10, 1, 1), InputError);
  // The nearest of all faces, by a tree over one face each.
  const Mesh torus = torus_mesh(9, 6);
  const SurfaceTree tree(torus);
  Rng rng(4, 5, 6);
  for (int i = 0; i < 100; ++i) {
    const Vec3d p = random_direction(rng) * (3 * rng.uniform());
    double nearest = 1e300;
    for (const FaceIndices& face : torus.faces) {
      Mesh one = torus;
      one.faces = {face};
      nearest = std::min(nearest, SurfaceTree(one).nearest(p).distance);
    }
    EXPECT_EQ(tree.nearest(p).distance, nearest);
  }
}

TEST(Fit, FacesInsideOutAndCrossingsAreCounted) {
  const Mesh ball = icosphere_mesh(2);
  const Vec3d rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Mesh small = transformed(ball, rows, 0.3, {0.1, 0, 0});
  const auto inside_out = [](const Mesh& mesh) { return count_inside_out(mesh, 2); };
  EXPECT_EQ(inside_out(ball), 0u);
  EXPECT_EQ(inside_out(cube_mesh()), 0u);
  EXPECT_EQ(inside_out(torus_mesh(12, 8)), 0u);
  EXPECT_EQ(inside_out(reversed(ball)), ball.faces.size());
  EXPECT_EQ(inside_out(joined(ball, reversed(small))), 0u);  // a hollow body
  EXPECT_EQ(inside_out(joined(ball, small)), small.faces.size());
  EXPECT_EQ(inside_out(grid_mesh(3)), std::nullopt);
  EXPECT_EQ(count_crossings(ball, 1), 0u);
  EXPECT_EQ(count_crossings(joined(ball, small), 1), 0u);
  EXPECT_GT(count_crossings(joined(ball, transformed(ball, rows, 1, {0.7, 0.1, 0.2})), 1), 20u);
}

}  // namespace
}  // namespace limn
