// The sun's highlight on flat gloss: a share of directions is drawn there, and nothing else
// changes.
#include "integrators/lights/mirrored_light.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "integrators/paths/path_follow.h"
#include "integrators/terms/highlight_edges.h"
#include "integrators/terms/vertex_edges.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "support/block_runs.h"
#include "support/environment_maps.h"
#include "support/meshes.h"
#include "support/running_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

// A dim sky with a sun of this radius.
std::string sun_in_sky(const TempFiles& files, double degrees, float sky = 1) {
  Image map(512, 256, 3);
  const Vec3d sun = normalize(Vec3d{0.5, 0.5, 0.4});
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const Vec3d w =
          test::map_direction((x + 0.5) / map.width, static_cast<double>(y) / (map.height - 1));
      const bool lit = dot(w, sun) > std::cos(degrees * kPi / 180);
      for (int c = 0; c < 3; ++c) map.at(x, y, c) = lit ? 400.0f : sky * (0.2f + 0.1f * c);
    }
  }
  write_exr(files.path("sun.exr"), map, false, {});
  return R"(  <emitter type="envmap" id="sky"><string name="filename" value=")" +
         files.path("sun.exr") + "\"/></emitter>\n";
}

// A dim sky, and a lamp of this radius, or a point if that is 0.
std::string lamp_in_sky(double radius) {
  const std::string place = "name=\"center\" value=\"0.4, 1.3, 1.4\"/>";
  const std::string lamp =
      radius > 0 ? "<shape type=\"sphere\" id=\"lamp\"><point " + place +
                       "<float name=\"radius\" value=\"" + std::to_string(radius) + "\"/>" +
                       area_light("glow", "3000, 3000, 3000") + "</shape>\n"
                 : R"(<emitter type="point" id="lamp"><point name="position" value="0.4, 1.3, 1.4"/>
                      <rgb name="intensity" value="6, 6, 6"/></emitter>)";
  return lamp + constant_light("sky", "0.2, 0.3, 0.4");
}

std::string bulb(const Vec3d& p, double intensity) {
  return fmt::format(R"(<emitter type="point"><point name="position" value="{}, {}, {}"/>
                        <rgb name="intensity" value="{}"/></emitter>)",
                     p.x, p.y, p.z, intensity);
}

// What shines: the sun in a map, of this radius in degrees, or a lamp of this radius.
std::string light_of(const TempFiles& files, double sun, double lamp) {
  return sun > 0 ? sun_in_sky(files, sun) : lamp_in_sky(lamp);
}

// A wall and a body over gloss.
Scene scene_with(const TempFiles& files, double alpha, double sun, double lamp = 0) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0.3, 1.5, 3.5};
  parts.target = {0, 0.5, 0};
  parts.body = square("floor", 2, -90, {0, 0, 0}, conductor("gloss", alpha)) +
               square("wall", 1, 0, {0, 1, -1}, diffuse("paint", "0.8, 0.7, 0.6")) +
               obj_shape("body", write_mesh(files, "body.obj", torus_mesh(10, 6)), true, 0.5,
                         {0, 0.7, 0.1}, diffuse("clay", "0.6, 0.5, 0.4")) +
               light_of(files, sun, lamp);
  return make_scene(files, parts);
}

struct Case {
  double alpha, sun, lamp;  // radius of the sun [degrees], or of a lamp
  Vec3d highlight;          // as DrawsFromItsDensity sees it
};
// Lobes wider than the light, and narrower; a point.
const Case kCases[] = {{0.05, 1, 0, {0.5, -0.5, 0.4}},
                       {0.02, 4, 0, {0.5, -0.5, 0.4}},
                       {0.05, 0, 0.02, {0.2, -2.1, 2.4}},
                       {0.02, 0, 0.2, {0.2, -2.1, 2.4}},
                       {0.1, 0, 0, {0.2, -2.1, 2.4}}};

struct Point {
  Point(const Scene& scene, const RayTracer& tracer, const Vec3d& origin, const Vec3d& direction) {
    Hit hit;
    EXPECT_TRUE(tracer.closest({origin, direction}, hit));
    surface = surface_on_ray<double>(scene, hit.face, origin, direction);
    wi = -direction;
  }
  SurfacePoint<double> surface;
  Vec3d wi;
};

// Draws of the images are as their density says: means of functions that are zero but in a cone
// around the highlight, by draws, and by the density over directions that are uniform in the cone.
TEST(MirroredLight, DrawsFromItsDensity) {
  const TempFiles files;
  for (const auto& [alpha, sun, lamp, highlight] : kCases) {
    const Scene scene = scene_with(files, alpha, sun, lamp);
    const auto tracer = make_embree_tracer(scene, 1);
    const Lights lights(scene);
    const auto mirrored = MirroredLight::make(scene, lights);
    ASSERT_TRUE(mirrored);
    const Point at(scene, *tracer, {0.2, 0.8, 1}, {0, 0, -1});
    const Scattering<double> scattering(at.surface, at.wi, scene.shading);
    MirroredLight::Mixture mixture = mirrored->mixture(at.surface, scattering);
    EXPECT_GT(mixture.share, 0.01);
    EXPECT_LT(mixture.share, 0.5);
    mixture.share = 1;  // of the images alone
    const Vec3d x = normalize(highlight), y = normalize(cross(x, Vec3d{0, 0, 1})), z = cross(x, y);
    const double cone = 0.25;  // radians
    const auto functions = [&](const Vec3d& w) {
      const double u = dot(w, y) / cone, v = dot(w, z) / cone;
      if (dot(w, x) < std::cos(cone)) return std::array<double, 5>{};
      return std::array{1.0, u, v, u * u - v * v, std::cos(8 * u) * std::cos(8 * v)};
    };
    std::array<RunningMean, 5> drawn, expected;
    Rng rng(3, 0, 0);
    for (int i = 0; i < 400000; ++i) {
      const double u = rng.uniform(), u1 = rng.uniform(), u2 = rng.uniform();
      const auto w = MirroredLight::sample(mixture, u, u1, u2);
      const auto of_draw = functions(w.value_or(-x));
      const double c = 1 - rng.uniform() * (1 - std::cos(cone)), phi = 2 * kPi * rng.uniform();
      const double s = std::sqrt(1 - c * c);
      const Vec3d other = x * c + y * (s * std::cos(phi)) + z * (s * std::sin(phi));
      const double weight = 2 * kPi * (1 - std::cos(cone)) * MirroredLight::pdf(mixture, other, 0);
      const auto of_other = functions(other);
      for (size_t k = 0; k < drawn.size(); ++k) {
        drawn[k].add(of_draw[k]);
        expected[k].add(weight * of_other[k]);
      }
    }
    EXPECT_GT(drawn[0].mean(), 0.5);
    for (size_t k = 0; k < drawn.size(); ++k) {
      const double error = std::hypot(drawn[k].standard_error(), expected[k].standard_error());
      EXPECT_LT(error, 0.01);
      EXPECT_LT(std::fabs(drawn[k].mean() - expected[k].mean()), 4.5 * error) << k;
    }
  }
}

// Radiance from points of a surface without and with: the same mean. place: where a ray in this
// direction starts, from two uniform numbers. Returns the mean squares.
template <class Place>
std::array<RunningMean, 2> squares_by_mixture(const Scene& scene, int samples, const Place& place,
                                              const Vec3d& direction) {
  const auto tracer = make_embree_tracer(scene, 1);
  const Lights lights(scene);
  const auto mirrored = MirroredLight::make(scene, lights);
  EXPECT_TRUE(mirrored);
  std::array<RunningMean, 2> means, squares;
  Rng rng(5, 0, 0);
  for (int i = 0; i < samples; ++i) {
    const double u = rng.uniform(), v = rng.uniform();
    const Point at(scene, *tracer, place(u, v), direction);
    for (const bool on : {false, true}) {
      const PathContext context{scene,   *tracer, lights,
                                nullptr, nullptr, on ? mirrored.get() : nullptr};
      RayCount rays;
      PathTracer<double, NoVisitor> paths(context, rays);
      Walk<double, NoVisitor> walk(Rng(7, static_cast<uint64_t>(i), on), 0, nullptr);
      paths.place(walk, at.surface, at.wi);
      paths.follow_one(walk);
      const double value = walk.radiance().g;
      means[on].add(value);
      squares[on].add(value * value);
    }
  }
  const double error = std::hypot(means[0].standard_error(), means[1].standard_error());
  EXPECT_LT(std::fabs(means[0].mean() - means[1].mean()), 4.5 * error);
  fmt::print("mean square {:.3g} +- {:.2g}, without {:.3g} +- {:.2g}\n", squares[1].mean(),
             squares[1].standard_error(), squares[0].mean(), squares[0].standard_error());
  return squares;
}

// Squares are ruled no more by paths that meet the highlight by chance.
TEST(MirroredLight, ChangesNoMean) {
  const TempFiles files;
  for (const auto& [alpha, sun, lamp, highlight] : kCases) {
    const Scene scene = scene_with(files, alpha, sun, lamp);
    const auto wall = [](double u, double v) { return Vec3d{1.6 * u - 0.8, 0.2 + 1.6 * v, 0.9}; };
    const auto squares = squares_by_mixture(scene, 200000, wall, {0, 0, -1});
    EXPECT_LT(squares[1].mean() + 3 * squares[1].standard_error(), squares[0].mean()) << alpha;
  }
}

// A floor and a box of these half sizes.
Scene over_floor_with(const TempFiles& files, const Vec3d& half, const Vec3d& center,
                      const std::string& bsdf, const std::string& light) {
  SceneParts parts;
  parts.max_depth = 4;
  Mesh box = cube_mesh();
  for (Vec3f& p : box.positions)
    p = cast<float>(center + Vec3d{half.x * p.x, half.y * p.y, half.z * p.z});
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("paint", "0.7, 0.7, 0.7")) +
               obj_shape("box", write_mesh(files, "box.obj", make_mesh(box.positions, box.faces)),
                         true, 1, {0, 0, 0}, bsdf) +
               light;
  return make_scene(files, parts);
}

// A floor beside a glossy box sees a grazing highlight in its side, although the plane of that
// would show the light itself far over it.
TEST(MirroredLight, GrazingHighlightBesideTheMirrorImage) {
  const TempFiles files;
  const Scene scene = over_floor_with(files, {0.6, 0.1, 0.42}, {0, 0.2, 0},
                                      conductor("gloss", 0.16), bulb({0.714, 3.036, 0.109}, 16));
  const auto beside = [](double u, double v) { return Vec3d{0.62 + 0.1 * u, 0.05, 0.8 * v - 0.4}; };
  const auto squares = squares_by_mixture(scene, 100000, beside, {0, -1, 0});
  // Most of the squares is direct light; rare ones rule their error.
  EXPECT_LT(5 * squares[1].standard_error(), squares[0].standard_error());
}

// A wall sees the flank of a highlight in the floor, whose middle is behind the wall's plane.
TEST(MirroredLight, FlankOfAHighlightBehindTheSurface) {
  const TempFiles files;
  SceneParts parts;
  const std::string gloss = R"(<bsdf type="roughconductor"><float name="alpha" value="0.1"/>
                               <string name="distribution" value="beckmann"/></bsdf>)";
  parts.body = square("floor", 3, -90, {0, 0, 0}, gloss) +
               square("wall", 0.3, 0, {0, 0.3, 0.4}, diffuse("paint", "0.7, 0.7, 0.7")) +
               bulb({0.1, 3, 0.1}, 16);
  const Scene scene = make_scene(files, parts);
  const auto wall = [](double u, double v) { return Vec3d{0.4 * u - 0.2, 0.1 + 0.4 * v, 0.5}; };
  const auto squares = squares_by_mixture(scene, 100000, wall, {0, 0, -1});
  EXPECT_LT(2 * squares[1].mean(), squares[0].mean());
}

// A floor sees a lamp through a plate of rough glass.
TEST(MirroredLight, RoughGlassShowsLights) {
  const TempFiles files;
  const std::string glass = R"(<bsdf type="roughdielectric"><float name="alpha" value="0.25"/>
                               <float name="int_ior" value="1.3"/></bsdf>)";
  for (const std::string& light :
       {bulb({-0.2, 2.7, -0.4}, 6),
        square("lamp", 0.14, 90, {-0.2, 2.7, -0.4}, area_light("glow", "60, 50, 40"))}) {
    const Scene scene = over_floor_with(files, {0.6, 0.01, 0.42}, {0, 0.06, 0}, glass, light);
    const auto below = [](double u, double v) { return Vec3d{u - 0.5, 0.04, 0.6 * v - 0.3}; };
    const auto squares = squares_by_mixture(scene, 100000, below, {0, -1, 0});
    EXPECT_LT(4 * squares[1].mean(), squares[0].mean());
  }
}

// With the same samples reverse mode has the interior term of forward mode, to rounding: it draws
// the same directions with the same densities.
TEST(MirroredLight, InReverse) {
  const TempFiles files;
  for (const bool sun : {true, false}) {
    const Scene scene = scene_with(files, 0.05, sun ? 1 : 0, 0.02);
    RunSettings settings;
    settings.spp = 8;
    settings.seed = 5;
    settings.threads = 1;
    GradientOptions forward_options;
    forward_options.parameters = {"wall.rotate.y", "floor.rotate.x", "gloss.alpha"};
    forward_options.terms = {"interior"};
    forward_options.method = "forest";
    const GradientResult forward = gradient(scene, forward_options, settings);
    Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
    for (size_t i = 0; i < adjoint.data.size(); ++i) {
      adjoint.data[i] = static_cast<float>(Rng(8, i, 0).uniform() - 0.5);
    }
    BackwardOptions options;
    options.parameters = forward_options.parameters;
    options.terms = {"interior"};
    options.uniform_pixels = true;
    const BackwardResult reverse = backward(scene, adjoint, options, settings);
    for (const ParameterGradient& p : forward.parameters) {
      double sum = 0, size = 0;
      for (size_t k = 0; k < adjoint.data.size(); ++k) {
        const double one = adjoint.data[k] * p.total.mean(k);
        sum += one;
        size += std::fabs(one);
      }
      EXPECT_GT(size, 0);
      EXPECT_NEAR(reverse.of(p.name).moments.mean(0), sum, 1e-11 * size) << p.name;
    }
  }
}

// A film that sees the wall of these scenes alone.
SceneParts before_the_wall() {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 0.8, 0.6};
  parts.target = {0, 0.8, -1};
  parts.fov = 50;
  parts.width = parts.height = 8;
  return parts;
}

// Of too many faces to be looked through for flat parts, unless it is coarse.
std::string gloss_floor(const TempFiles& files, bool coarse, double alpha) {
  Mesh mesh = grid_mesh(coarse ? 1 : 12);
  for (Vec3f& p : mesh.positions) p = {p.x, 0, -p.y};
  mesh = make_mesh(mesh.positions, mesh.faces);
  return obj_shape("floor", write_mesh(files, "floor.obj", mesh), true, 2, {0, 0, 0.5},
                   conductor("gloss", alpha));
}

// Lines from the sun share with points of a shadow by the density of directions before it. The
// floor as a mesh of too many faces to be looked through has none of the highlight's: where a wall
// sees the shadow of a body in it, what both terms find together must be the same (with lines that
// know nothing of the highlight z is 6.6).
TEST(MirroredLight, LinesFromTheSunKnowOfIt) {
  const TempFiles files;
  GradientOptions options;
  options.parameters = {"body.translate.y"};
  options.terms = {"direct", "penumbra"};
  options.method = "silhouettes";
  std::vector<GradientResult> found;
  for (const bool coarse : {true, false}) {
    SceneParts parts = before_the_wall();
    parts.body = gloss_floor(files, coarse, 0.2) +
                 square("wall", 2, 0, {0, 1, -1}, diffuse("paint", "0.9, 0.9, 0.9")) +
                 obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.3,
                           {0.5, 0.9, 1}, diffuse("soot", "0, 0, 0")) +
                 sun_in_sky(files, 4, 0.001f);
    const Scene scene = make_scene(files, parts);
    EXPECT_EQ(MirroredLight::make(scene, Lights(scene)) != nullptr, coarse);
    found.push_back(run_blocks(scene, options, 8192, coarse));
  }
  expect_equal(found[0].parameters[0], found[1].parameters[0]);
}

// Edges in front of highlights are drawn by themselves, and left out elsewhere: with a floor of too
// many faces to be looked through, edges that know nothing of the highlight find the same, and have
// tails.
TEST(MirroredLight, EdgesInFrontOfHighlights) {
  const TempFiles files;
  GradientOptions options;
  options.parameters = {"body.translate.x"};
  options.terms = {"boundary"};
  options.method = "silhouettes";
  for (const bool sun : {true, false}) {
    std::vector<GradientResult> found;
    for (const bool coarse : {true, false}) {
      SceneParts parts = before_the_wall();
      parts.body = gloss_floor(files, coarse, sun ? 0.1 : 0.04) +
                   square("wall", 2, 0, {0, 1, -1}, diffuse("paint", "0.9, 0.9, 0.9")) +
                   obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, 0.2,
                             {0.2, 0.4, -0.5}, diffuse("clay", "0.7, 0.7, 0.7")) +
                   light_of(files, sun ? 2 : 0, 0.02);
      const Scene scene = make_scene(files, parts);
      found.push_back(run_blocks(scene, options, 4096, coarse));
    }
    expect_equal(found[0].parameters[0], found[1].parameters[0]);
    const auto squared_error = [&](int i) {
      const Moments& total = found[i].parameters[0].total;
      double sum = 0;
      for (size_t k = 0; k < total.size(); ++k) sum += total.variance(k);
      return sum;
    };
    fmt::print("squared error {:.3g}, without {:.3g}\n", squared_error(0), squared_error(1));
    EXPECT_LT(3 * squared_error(0), squared_error(1)) << sun;
  }
}

// Faces cut into four, so many times.
Mesh cut_faces(Mesh mesh, int times) {
  for (int k = 0; k < times; ++k) {
    std::vector<Vec3f> positions;
    std::vector<FaceIndices> faces;
    for (const auto& [a, b, c] : mesh.faces) {
      const Vec3f p = mesh.positions[a], q = mesh.positions[b], r = mesh.positions[c];
      const Vec3f pq = (p + q) * 0.5f, qr = (q + r) * 0.5f, rp = (r + p) * 0.5f;
      for (const auto& corners : {std::array{p, pq, rp}, {pq, q, qr}, {rp, qr, r}, {pq, qr, rp}}) {
        const auto first = static_cast<uint32_t>(positions.size());
        positions.insert(positions.end(), corners.begin(), corners.end());
        faces.push_back({first, first + 1, first + 2});
      }
    }
    mesh = make_mesh(positions, faces);
  }
  return mesh;
}

// A floor close to a glossy box sees the sun's grazing highlight in the side over it, which ends at
// the box's own edges, below in one between two faces in view. A box of too many faces has none.
TEST(MirroredLight, GrazingHighlightEndsAtEdgesOfTheGloss) {
  const TempFiles files;
  GradientOptions options;
  options.parameters = {"body.translate.z"};
  options.terms = {"boundary"};
  options.method = "silhouettes";
  std::vector<GradientResult> found;
  for (const bool coarse : {true, false}) {
    SceneParts parts;
    parts.width = parts.height = 8;
    parts.origin = {0.1, 1.2, 1.4};
    parts.target = {0.1, 0, 0.4};
    const Mesh mesh = coarse ? cube_mesh() : cut_faces(cube_mesh(), 3);
    parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("paint", "0.7, 0.7, 0.7")) +
                 obj_shape("body", write_mesh(files, "body.obj", mesh), true, 0.4, {0, 0.45, 0},
                           conductor("gloss", 0.16)) +
                 R"(<emitter type="directional"><vector name="direction" value="-0.2, -1, -0.05"/>
                    <rgb name="irradiance" value="2, 2, 2"/></emitter>)";
    found.push_back(run_blocks(make_scene(files, parts), options, 2048, coarse));
  }
  expect_equal(found[0].parameters[0], found[1].parameters[0]);
  const auto variance = [&](int i) { return found[i].parameters[0].image_sum.variance(0); };
  fmt::print("squared error {:.3g}, without {:.3g}\n", variance(0), variance(1));
  EXPECT_LT(3 * variance(0), variance(1));
}

// Of all that the view stands for, in parts of edges.
double length_held(const HighlightEdges& highlight, const EdgeSamplerInput& edges,
                   const HighlightEdges::View& view, const EdgeQuery& query, Rng& rng) {
  constexpr int kPlaces = 16;
  double sum = 0;
  for (uint32_t o = 0; o < edges.objects.size(); ++o) {
    const EdgeMesh& mesh = edges.objects[o];
    for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
      const EdgeRef edge{ShapeId(o), EdgeId(e)};
      if (!is_candidate(mesh, edge.edge, query.p) || is_own_edge(edges, query, edge)) continue;
      for (int k = 0; k < kPlaces; ++k) {
        const double t = (k + rng.uniform()) / kPlaces;
        if (highlight.hold(view, query, {edge, t, 1, 1})) sum += 1.0 / kPlaces;
      }
    }
  }
  return sum;
}

// Where points of outlines are drawn in front of highlights and where they are left out elsewhere
// is the same: the length of all that is left out, in parts of edges, by draws and by looking
// everywhere. Caps of two lamps overlap; a cube has sharp edges both of whose faces are seen, which
// are left to others.
TEST(MirroredLight, EdgesAreDrawnWhereTheyAreLeftOut) {
  const TempFiles files;
  SceneParts parts;
  const std::string second =
      R"(  <emitter type="point"><point name="position" value="0.6, 1.3, 1.4"/>
    <rgb name="intensity" value="6, 6, 6"/></emitter>)";
  parts.body = square("floor", 2, -90, {0, 0, 0}, conductor("gloss", 0.05)) +
               square("wall", 1, 0, {0, 1, -1}, diffuse("paint", "0.8, 0.7, 0.6")) +
               obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.1,
                         {0.1, 0.3, -0.5}, diffuse("clay", "0.6, 0.5, 0.4")) +
               obj_shape("ring", write_mesh(files, "ring.obj", torus_mesh(10, 6)), true, 0.2,
                         {0.2, 0.35, -0.45}, diffuse("soot", "0.1, 0.1, 0.1")) +
               lamp_in_sky(0) + second;
  Scene scene = make_scene(files, parts);
  find_parameter(scene, "wall.translate.z").seed(scene, 0);
  const auto tracer = make_embree_tracer(scene, 1);
  const Lights lights(scene);
  const PathContext context{scene, *tracer, lights};
  TermInput input(context, 1, {1, 1, 1, 1}, edge_sampler_type("forest"), 1);
  const auto mirrored = MirroredLight::make(scene, lights);
  ASSERT_TRUE(mirrored);
  const HighlightEdges highlight(scene, input.edges(), input.edge_sampler(), *mirrored);
  RunningMean drawn, left_out;
  Rng rng(11, 0, 0);
  int views = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3<Dual> origin{0.6 * rng.uniform() - 0.3, 0.5 + 0.6 * rng.uniform(), 0.9};
    const Vec3<Dual> forward{0.0, 0.0, -1.0};
    Hit hit;
    // Bodies are below most points; what they hide is not asked.
    if (!tracer->closest({value(origin), value(forward)}, hit) || hit.face.shape != ShapeId(1))
      continue;
    const auto surface = surface_on_ray<Dual>(scene, hit.face, origin, forward);
    const Scattering<Dual> scattering(surface, -forward, scene.shading);
    const PathVertex vertex = plain_vertex(surface, scattering, scene.shading, 0, {}, rng);
    const EdgeQuery query = query_at(vertex);
    HighlightEdges::View view;
    highlight.list(vertex, query, view);
    views += view.count;
    constexpr int kSamples = 4;
    std::vector<DirectPoint> points;
    TermCost cost;
    highlight.draw(view, query, Rng(12, static_cast<uint64_t>(i), 0), kSamples, cost, points);
    double length = 0;
    for (const auto& [region, sample] : points) {
      EXPECT_TRUE(highlight.hold(view, query, sample));
      length += 1 / (sample.probability * sample.pdf_t * kSamples);
    }
    drawn.add(length);
    left_out.add(length_held(highlight, input.edges(), view, query, rng));
  }
  const double error = std::hypot(drawn.standard_error(), left_out.standard_error());
  fmt::print("{} views: drawn {:.4f} +- {:.2g}, left out {:.4f} +- {:.2g}\n", views, drawn.mean(),
             drawn.standard_error(), left_out.mean(), left_out.standard_error());
  EXPECT_GT(views, 1000);
  EXPECT_LT(std::fabs(drawn.mean() - left_out.mean()), 4.5 * error);
}

// A floor beside a corner of a glossy box sees a grazing highlight in one of its sides, and behind
// the plane of that, outside of it, an edge of another one that sweeps ten times the angle. Nearly
// a third of the points that are drawn are on edges of the lit side.
TEST(MirroredLight, EdgesBehindTheGlossAreNotBeforeIt) {
  const TempFiles files;
  SceneParts parts;
  Mesh box = cube_mesh();
  for (Vec3f& p : box.positions) p = {0.6f * p.x, 0.2f + 0.1f * p.y, 0.42f * p.z};
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("paint", "0.7, 0.7, 0.7")) +
               obj_shape("box", write_mesh(files, "box.obj", make_mesh(box.positions, box.faces)),
                         true, 1, {0, 0, 0}, conductor("gloss", 0.16)) +
               R"(<emitter type="point"><point name="position" value="0.714, 3.036, 0.109"/>
                  <rgb name="intensity" value="16, 16, 16"/></emitter>)";
  Scene scene = make_scene(files, parts);
  find_parameter(scene, "box.translate.z").seed(scene, 0);
  const auto tracer = make_embree_tracer(scene, 1);
  const Lights lights(scene);
  const PathContext context{scene, *tracer, lights};
  TermInput input(context, 1, {1, 1, 1, 1}, edge_sampler_type("forest"), 1);
  const auto mirrored = MirroredLight::make(scene, lights);
  ASSERT_TRUE(mirrored);
  const HighlightEdges highlight(scene, input.edges(), input.edge_sampler(), *mirrored);
  Rng rng(13, 0, 0);
  const Vec3<Dual> origin{0.607679, 1.0, 0.44904}, down{0.0, -1.0, 0.0};
  Hit hit;
  ASSERT_TRUE(tracer->closest({value(origin), value(down)}, hit));
  const auto surface = surface_on_ray<Dual>(scene, hit.face, origin, down);
  const Scattering<Dual> scattering(surface, -down, scene.shading);
  const PathVertex vertex = plain_vertex(surface, scattering, scene.shading, 0, {}, rng);
  const EdgeQuery query = query_at(vertex);
  HighlightEdges::View view;
  highlight.list(vertex, query, view);
  std::vector<DirectPoint> points;
  TermCost cost;
  highlight.draw(view, query, rng, 1000, cost, points);
  size_t in_plane = 0;
  for (const auto& [region, sample] : points) {
    const EdgeMesh& mesh = input.edges().object(sample.edge.object);
    const auto& ends = mesh.edge(sample.edge.edge).vertices;
    if (mesh.position(ends[0]).x > 0.5 && mesh.position(ends[1]).x > 0.5) ++in_plane;
  }
  fmt::print("{} of {} points\n", in_plane, points.size());
  EXPECT_GT(points.size(), 500u);
  EXPECT_GT(7 * in_plane, points.size());
}

// What a point of a wall makes of the highlight on the floor before it, of these delta lights.
struct WallPoint {
  WallPoint(const TempFiles& files, const std::string& emitters, double gloss = 0.05)
      : scene(make(files, emitters, gloss)), lights(scene) {
    const auto tracer = make_embree_tracer(scene, 1);
    mirrored = MirroredLight::make(scene, lights);
    const Point at(scene, *tracer, {0.2, 0.8, 1.5}, {0, 0, -1});
    if (mirrored)
      mixture = mirrored->mixture(at.surface, Scattering<double>(at.surface, at.wi, scene.shading));
  }
  static Scene make(const TempFiles& files, const std::string& emitters, double gloss) {
    SceneParts parts;
    parts.body = square("floor", 2, -90, {0, 0, 0}, conductor("gloss", gloss)) +
                 square("wall", 1, 0, {0, 1, -1}, diffuse("paint", "0.3, 0.3, 0.3")) + emitters;
    return make_scene(files, parts);
  }
  Scene scene;
  Lights lights;
  std::unique_ptr<MirroredLight> mirrored;
  MirroredLight::Mixture mixture;
};

std::string spot(const Vec3d& p, const Vec3d& target, double cutoff, double intensity) {
  return fmt::format(
      R"(<emitter type="spot"><rgb name="intensity" value="{}"/>
         <float name="cutoff_angle" value="{}"/><transform name="to_world">
         <lookat origin="{}, {}, {}" target="{}, {}, {}" up="0, 0, 1"/></transform></emitter>)",
      intensity, cutoff, p.x, p.y, p.z, target.x, target.y, target.z);
}

// The share that a highlight takes follows what lamps light about the point, wherever they hang or
// look.
TEST(MirroredLight, ShareFollowsWhatIsLitAround) {
  const TempFiles files;
  // (0, 1, 0) is the middle of the scene: no place is special.
  const double in_middle = WallPoint(files, bulb({0, 1, 0}, 5)).mixture.share;
  const double beside = WallPoint(files, bulb({0, 1, 1e-3}, 5)).mixture.share;
  EXPECT_GT(in_middle, 0.02);
  EXPECT_LT(in_middle, 0.45);
  EXPECT_NEAR(beside, in_middle, 1e-3);
  // A lamp that lights where the highlight is, and neither the middle nor the point: more than of a
  // bulb in the same place, and yet no more than of what its light makes of other surfaces.
  const Vec3d high{0.2, 1.2, 1};
  const std::string down = spot(high, {0.2, 0, -0.2}, 15, 5);
  const MirroredLight::Mixture lit = WallPoint(files, down).mixture;
  ASSERT_EQ(lit.count, 1);
  EXPECT_GT(lit.share, WallPoint(files, bulb(high, 5)).mixture.share);
  EXPECT_LT(lit.share, 0.45);
  // A weak highlight beside a strong lamp that lights the wall alone, and is not mirrored.
  const std::string strong = spot({0.2, 1.5, 1}, {0.2, 0.8, -1}, 10, 5000);
  const MirroredLight::Mixture weak = WallPoint(files, bulb({0, 1, 0}, 1) + strong).mixture;
  ASSERT_EQ(weak.count, 1);
  EXPECT_GT(weak.share, 0);
  EXPECT_LT(10 * weak.share, in_middle);
}

// Images of nearly the same scene draw the same highlight with the same number: neither which lamps
// are kept nor their order hangs on which of equal ones is brighter by the difference.
TEST(MirroredLight, OrderIsThatOfTheFile) {
  const TempFiles files;
  for (const int lamps : {2, 6}) {
    std::vector<MirroredLight::Mixture> found;
    for (const double shift : {-1e-4, 0.0, 1e-4}) {
      std::string emitters;
      for (int i = 0; i < lamps; ++i) {
        const double angle = 2 * kPi * (i + 0.5) / lamps;
        // The last one is brighter than the others.
        emitters += bulb({shift + 0.7 * std::sin(angle), 1.3, 0.7 * std::cos(angle)},
                         lamps == 6 && i == 5 ? 20 : 6);
      }
      found.push_back(WallPoint(files, emitters, 0.2).mixture);
    }
    ASSERT_EQ(found[1].count, std::min(lamps, 4));
    for (const size_t other : {size_t{0}, size_t{2}}) {
      ASSERT_EQ(found[other].count, found[1].count);
      for (int i = 0; i < found[1].count; ++i) {
        EXPECT_LT(length(found[other].highlight(i).toward - found[1].highlight(i).toward), 1e-3)
            << i;
      }
    }
    // The brightest is among them though it comes last.
    EXPECT_TRUE(lamps == 2 || found[1].part[3] > found[1].part[2]);
  }
}

// The scenes of a finite difference draw by the highlight of the one between them: a panel that has
// left its old plane by the step must not see what its other side mirrored there.
TEST(MirroredLight, PanelsSeeNothingInThemselves) {
  const TempFiles files;
  const auto panel_at = [&](double height) {
    SceneParts parts;
    parts.max_depth = 3;
    const std::string both = R"(<bsdf type="twosided">)" + conductor("gloss", 0.1) + "</bsdf>";
    parts.body = square("panel", 1, -90, {0, height, 0}, both) +
                 square("wall", 3, 0, {0, 0, -2}, diffuse("paint", "0.8, 0.7, 0.6")) +
                 bulb({0, 1, 0.3}, 6) + bulb({0, -1, 0.3}, 6);
    return make_scene(files, parts);
  };
  const Scene still = panel_at(0);
  const Lights lights(still);
  const auto mirrored = MirroredLight::make(still, lights);
  ASSERT_TRUE(mirrored);
  for (const double height : {-1e-3, 0.0, 1e-3}) {
    const Scene moved = panel_at(height);
    const auto tracer = make_embree_tracer(moved, 1);
    const auto share = [&](const Vec3d& origin, const Vec3d& direction) {
      const Point at(moved, *tracer, origin, direction);
      const Scattering<double> scattering(at.surface, at.wi, moved.shading);
      return mirrored->mixture(at.surface, scattering).share;
    };
    for (const double side : {1.0, -1.0}) {
      const Vec3d origin{0, side, -0.3};  // where the lamp that is before it shows itself
      EXPECT_EQ(share(origin, normalize(Vec3d{0, 0, 0} - origin)), 0);
      EXPECT_GT(share({0, side * 0.5, 0}, {0, 0, -1}), 0);  // the wall
    }
  }
}

// Nothing to mirror, nothing to see it by: no share, and no image changes.
TEST(MirroredLight, IsNotWhereNothingMirrors) {
  const TempFiles files;
  const Scene rough = scene_with(files, 0.6, 1);
  EXPECT_FALSE(MirroredLight::make(rough, Lights(rough)));
  const Scene scene = scene_with(files, 0.05, 1);
  const Lights lights(scene);
  const auto tracer = make_embree_tracer(scene, 1);
  Point at(scene, *tracer, {0.2, 0.8, 1}, {0, 0, -1});
  const Scattering<double> scattering(at.surface, at.wi, scene.shading);
  const auto mirrored = MirroredLight::make(scene, lights);
  EXPECT_GT(mirrored->mixture(at.surface, scattering).share, 0);
  at.surface.p.y = -0.5;  // below the floor
  EXPECT_EQ(mirrored->mixture(at.surface, scattering).share, 0);
  at.surface.p = {30, 0.8, -1};  // far beside it
  EXPECT_EQ(mirrored->mixture(at.surface, scattering).share, 0);
}

// A dielectric coat reflects little light: images do not draw its highlights, derivatives do.
TEST(MirroredLight, ImagesAreSparedFaintHighlights) {
  const TempFiles files;
  const auto images = [&](const std::string& gloss, MirroredLight::Use use) {
    SceneParts parts;
    parts.body = square("floor", 2, -90, {0, 0, 0}, gloss) +
                 square("wall", 1, 0, {0, 1, -1}, diffuse("paint", "0.3, 0.3, 0.3")) +
                 bulb({0, 1.5, 1}, 5);
    const Scene scene = make_scene(files, parts);
    return MirroredLight::make(scene, Lights(scene), use) != nullptr;
  };
  const std::string metal = conductor("gloss", 0.1);
  const std::string coat =
      "<bsdf type=\"roughplastic\"><float name=\"alpha\" value=\"0.1\"/></bsdf>";
  EXPECT_TRUE(images(metal, MirroredLight::Use::kImage));
  EXPECT_FALSE(images(coat, MirroredLight::Use::kImage));
  EXPECT_TRUE(images(coat, MirroredLight::Use::kDerivatives));
}

}  // namespace
}  // namespace limn
