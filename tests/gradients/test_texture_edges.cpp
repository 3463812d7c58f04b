// Where textures are discontinuous: the segments, their edges and samplers, and derivatives with
// them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "edgetree/forest/forest_build.h"
#include "integrators/edges/texture_discontinuities.h"
#include "limn/core/image.h"
#include "limn/core/rng.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/integrators/gradient.h"
#include "support/check_runs.h"
#include "support/chi_square.h"
#include "support/edge_mesh_fault.h"
#include "support/forest_fault.h"
#include "support/meshes.h"
#include "support/same_mean.h"
#include "support/scenes.h"
#include "support/test_properties.h"

namespace limn {
namespace {

using Place = std::array<double, 2>;

std::shared_ptr<Texture> checkerboard(const Matrix4& to_uv = {}) {
  test::TestProperties properties("texture", "checkerboard", {{"to_uv", to_uv}});
  return make_texture(properties);
}

bool on_left(const Place& a, const Place& b, const Place& x) {
  return (b[0] - a[0]) * (x[1] - a[1]) - (b[1] - a[1]) * (x[0] - a[0]) > 0;
}
bool cross(const Texture::Discontinuity& line, const Place& a, const Place& b) {
  return on_left(line.from, line.to, a) != on_left(line.from, line.to, b) &&
         on_left(a, b, line.from) != on_left(a, b, line.to);
}
bool is_near(const Texture::Discontinuity& line, const Place& x) {
  const double dx = line.to[0] - line.from[0], dy = line.to[1] - line.from[1];
  const double across = (x[0] - line.from[0]) * dy - (x[1] - line.from[1]) * dx;
  return std::fabs(across) <= 2 * kOffCurve * std::hypot(dx, dy);
}

// There angles change too fast for segments.
bool is_by_axis(const Mesh& mesh, FaceId face, const Place& b) {
  if (mesh.uv_source == UvSource::kPlane) return false;
  const FaceIndices& ids = mesh.uv_ids[face.index()];
  Vec3d place = cast<double>(mesh.uv_places[ids[0]]) * (1 - b[0] - b[1]);
  for (int k = 0; k < 2; ++k) place = place + cast<double>(mesh.uv_places[ids[k + 1]]) * b[k];
  return std::hypot(place.x, place.y) < 1.0 / 16;
}

Texture::Discontinuities lines_of(const Texture& texture, const Mesh& mesh, FaceId face) {
  Texture::Discontinuities lines;
  EXPECT_TRUE(add_face_discontinuities(texture, mesh, face, 1000, lines));
  return lines;
}

// Between two points of a face the colour changes as often as segments lie between them. How often
// segments that stand for curves are too near to tell.
int expect_discontinuities_at_segments(const Texture& texture, const Mesh& mesh, FaceId face,
                                       Rng& rng) {
  const Texture::Discontinuities lines = lines_of(texture, mesh, face);
  const auto draw = [&] {
    const double u = std::sqrt(rng.uniform()), v = rng.uniform();
    return Place{u * v, u * (1 - v)};
  };
  int left_out = 0;
  for (int k = 0; k < 50; ++k) {
    const Place a = draw(), b = draw();
    size_t count = 0;
    bool near = is_by_axis(mesh, face, a) || is_by_axis(mesh, face, b);
    for (const Texture::Discontinuity& line : lines.inside) {
      count += cross(line, a, b);
      near = near || is_near(line, a) || is_near(line, b);
    }
    left_out += near;
    if (near && mesh.uv_source != UvSource::kPlane) continue;
    const auto color = [&](const Place& p) {
      return texture.eval(texture_point<double>(mesh, face, p)).r;
    };
    EXPECT_EQ(color(a) != color(b), count % 2 == 1) << face.index() << " " << k;
  }
  return left_out;
}

Mesh mesh_of_face(const std::array<Place, 3>& uv) {
  Mesh mesh = make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  mesh.uv_source = UvSource::kPlane;
  for (const Place& corner : uv) {
    mesh.uv_places.push_back({static_cast<float>(corner[0]), static_cast<float>(corner[1]), 0});
  }
  mesh.uv_ids = mesh.faces;
  return mesh;
}

Matrix4 turned_uv() {
  Matrix4 m;
  m.m[0][0] = 1.5, m.m[0][1] = -0.5, m.m[0][3] = 0.3, m.m[1][0] = 0.7;
  return m;
}

TEST(FaceDiscontinuities, AreThoseOfACheckerboard) {
  Rng rng(1, 0, 0);
  for (const Matrix4& to_uv : {Matrix4{}, turned_uv()}) {
    for (int i = 0; i < 50; ++i) {
      std::array<Place, 3> uv;
      for (Place& corner : uv) corner = {4 * rng.uniform() - 2, 4 * rng.uniform() - 2};
      expect_discontinuities_at_segments(*checkerboard(to_uv), mesh_of_face(uv), FaceId(0), rng);
    }
  }
}

// Of two colours in turn, so that each line is one of another colour.
TEST(FaceDiscontinuities, AreBordersOfNearestTexels) {
  const TempFiles files;
  Image image(4, 2, 1);
  for (int i = 0; i < 8; ++i) image.at(i % 4, i / 4, 0) = static_cast<float>((i + i / 4) % 2);
  write_exr(files.path("a.exr"), image, false, {});
  Rng rng(1, 0, 0);
  for (const Matrix4& to_uv : {Matrix4{}, turned_uv()}) {
    test::TestProperties properties("texture", "bitmap",
                                    {{"filename", files.path("a.exr")},
                                     {"filter_type", std::string("nearest")},
                                     {"to_uv", to_uv}});
    const std::shared_ptr<Texture> texture = make_texture(properties);
    for (int i = 0; i < 50; ++i) {
      std::array<Place, 3> uv;
      for (Place& corner : uv) corner = {4 * rng.uniform() - 2, 4 * rng.uniform() - 2};
      expect_discontinuities_at_segments(*texture, mesh_of_face(uv), FaceId(0), rng);
    }
  }
}

// On spheres and disks all lines but meridians are curves; the equator runs along sides of faces.
TEST(FaceDiscontinuities, AreCurvesOnSpheresAndDisks) {
  const TempFiles files;
  Matrix4 scaled;
  scaled.m[0][0] = 2, scaled.m[1][1] = 6;
  const auto texture = checkerboard(scaled);
  Rng rng(5, 0, 0);
  for (const char* type : {"sphere", "disk"}) {
    SceneParts parts;
    parts.body = fmt::format(R"(<shape type="{}"><bsdf type="diffuse">
                 <texture type="checkerboard" name="reflectance"/></bsdf></shape>)",
                             type);
    const Scene scene = make_scene(files, parts);
    const Mesh& mesh = scene.shapes[0].mesh;
    int left_out = 0, all = 0;
    for (uint32_t f = 0; f < mesh.faces.size(); f += 7, all += 50) {
      left_out += expect_discontinuities_at_segments(*texture, mesh, FaceId(f), rng);
    }
    EXPECT_LT(left_out, all / 5) << type;
  }
}

TEST(Checkerboard, LinesAlongSidesAreNotInside) {
  const auto texture = checkerboard();
  Texture::Discontinuities lines;
  ASSERT_TRUE(texture->add_discontinuities({{{0, 0.25}, {0.5, 0.25}, {0.5, 0.75}}}, 10, lines));
  EXPECT_EQ(lines.sides, 2);           // u = 1/2 from the second corner to the third
  ASSERT_EQ(lines.inside.size(), 1u);  // v = 1/2
  EXPECT_FALSE(texture->add_discontinuities({{{0, 0}, {9, 0}, {9, 9}}}, 10, lines));
  EXPECT_TRUE(texture->has_period_one());
  EXPECT_FALSE(checkerboard(turned_uv())->has_period_one());
  // Coordinates of files are floats: one tenth is none.
  Matrix4 five;
  five.m[0][0] = 5;
  lines = {};
  ASSERT_TRUE(
      checkerboard(five)->add_discontinuities({{{0, 0.25}, {0.1f, 0.25}, {0.1f, 0.3}}}, 10, lines));
  EXPECT_EQ(lines.sides, 2);
  EXPECT_TRUE(lines.inside.empty());
}

// A closed body, whose faces have segments at random, and its edges.
EdgeSamplerInput textured_input(const Mesh& mesh, bool black_behind) {
  Mesh moving = mesh;
  set_test_tangents(moving);
  EdgeSamplerInput input{.objects = {build_edge_mesh(moving, true)}, .environment_luminance = 1};
  Rng rng(2, 0, 0);
  std::vector<FaceSegment> segments;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const double a = rng.uniform(), b = rng.uniform();
    segments.push_back({FaceId(f), {a, 0}, {0, b}});
    if (f % 3 == 0) segments.push_back({FaceId(f), {1 - b, b}, {0, 0.5 * b}});
  }
  input.objects.push_back(texture_edges(moving, input.objects[0], black_behind, segments));
  return input;
}

TEST(TextureEdges, AreEdges) {
  for (const bool black_behind : {true, false}) {
    const EdgeSamplerInput input = textured_input(torus_mesh(9, 6), black_behind);
    const EdgeMesh& edges = input.objects[1];
    EXPECT_EQ(fault_of(edges), "");
    EXPECT_EQ(edges.count(EdgeClass::kTexture), edges.edges.size());
    EXPECT_EQ(fault_of(build_forest(input, 2, {}), input.objects), "");
    Rng rng(3, 0, 0);
    size_t seen = 0;
    for (uint32_t e = 0; e < edges.edges.size(); ++e) {
      const Vec3d p = random_direction(rng) * 3;
      const Edge& edge = edges.edges[e];
      const bool front = edges.plane(edge.faces[0]).distance(p) > 0;
      seen += front;
      EXPECT_EQ(is_candidate(edges, EdgeId(e), p), front || !black_behind);
      EXPECT_FALSE(is_outline(edges, EdgeId(e), p));
    }
    EXPECT_GT(seen, 0u);
    EXPECT_LT(seen, edges.edges.size());
    EdgeMesh broken = edges;
    broken.incidences[3].through = false;
    EXPECT_EQ(fault_of(broken), "edge 3: its face ends there");
    broken = edges;
    broken.places.pop_back();
    EXPECT_EQ(fault_of(broken), "edge 0: there are other than V places");
  }
}

TEST(TextureEdges, MoveWithTheirFaces) {
  Mesh mesh = icosphere_mesh(0);
  Vec3<Lanes> v;
  v.x = Lanes{0.1, 0.3, 0, 0}, v.z = Lanes{0.7, 0, 0, 1.0 / 3};
  mesh.position_tangents.assign(mesh.positions.size(), v);
  const FaceSegment segment{FaceId(0), {0.3, 0.1}, {0.1, 0.7}};
  const EdgeMesh edges = texture_edges(mesh, build_edge_mesh(mesh, true), true, {&segment, 1});
  // Exactly: relative to what moves along they are at rest.
  for (const Vec3<Lanes> tangent : edges.tangents) {
    for (int k = 0; k < kLanes; ++k) {
      EXPECT_EQ(tangent.x[k], v.x[k]);
      EXPECT_EQ(tangent.z[k], v.z[k]);
    }
  }
}

TEST(TextureEdges, SamplersDrawThemAsTheyState) {
  Rng rng(4, 0, 0);
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    for (const bool black_behind : {true, false}) {
      const EdgeSamplerInput input = textured_input(icosphere_mesh(1), black_behind);
      const auto sampler = type.make(input, 1);
      EdgeQuery query;
      query.p = random_direction(rng) * 2;
      query.n = normalize(-query.p);
      query.wi = normalize(query.n + random_direction(rng) * 0.7);
      constexpr int kDraws = 20000;
      std::vector<double> expected, observed;
      double sum = 0, of_textures = 0;
      const size_t first = input.objects[0].edges.size();
      for (uint32_t o = 0; o < 2; ++o) {
        for (uint32_t e = 0; e < input.objects[o].edges.size(); ++e) {
          const double p = sampler->probability(query, {ShapeId(o), EdgeId(e)});
          if (o == 1) of_textures += p;
          sum += p;
          expected.push_back(p * kDraws);
        }
      }
      EXPECT_GT(of_textures, 0.05) << type.name;
      EXPECT_LE(sum, 1 + 1e-12) << type.name;
      expected.push_back(std::max(0.0, 1 - sum) * kDraws);
      if (expected.back() < 1e-6) expected.back() = 0;
      observed.assign(expected.size(), 0);
      for (int i = 0; i < kDraws; ++i) {
        const auto s = sampler->sample(query, rng);
        if (!s) {
          ++observed.back();
          continue;
        }
        const size_t cell = (s->edge.object.index() == 1 ? first : 0) + s->edge.edge.index();
        ++observed[cell];
        ASSERT_EQ(s->pdf_t, sampler->pdf_t(query, s->edge, s->t)) << type.name;
      }
      EXPECT_GT(test::chi_square_test(observed, expected).p_value, 1e-6) << type.name;
    }
  }
}

TEST(TextureEdges, AreNotListedAsOutlines) {
  const EdgeSamplerInput input = textured_input(icosphere_mesh(1), false);
  const auto sampler = make_edge_sampler("forest", input, 1);
  EdgeQuery query;
  query.p = {0, 0, 3};
  query.n = query.wi = {0, 0, -1};
  std::vector<ListedEdge> listed;
  ASSERT_TRUE(sampler->list_outlines(query, {}, listed));
  EXPECT_FALSE(listed.empty());
  for (const ListedEdge& edge : listed) EXPECT_EQ(edge.id.object, ShapeId(0));
}

// Edges of a smooth and of a flat surface become sharp where coordinates differ, by other than
// integers if these make none, where a line runs along a side, and everywhere if asked for.
TEST(TextureEdges, Seams) {
  Mesh grid = grid_mesh(1);  // two faces
  grid.uv_source = UvSource::kPlane;
  const auto classes = [&](const TextureSeams& seams) {
    return build_edge_mesh(grid, true, ShapeId(0), &seams).count(EdgeClass::kSharp);
  };
  grid.uv_places = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  grid.uv_places.resize(8);
  const FaceIndices& a = grid.faces[0];
  const FaceIndices& b = grid.faces[1];
  const auto coordinates = [&](float shift) {
    grid.uv_places.assign(2 * grid.positions.size(), {});
    for (size_t v = 0; v < grid.positions.size(); ++v) {
      const Vec3f x = grid.positions[v];
      grid.uv_places[v] = {x.x, x.y, 0};
      grid.uv_places[grid.positions.size() + v] = {x.x + shift, x.y, 0};
    }
    const auto n = static_cast<uint32_t>(grid.positions.size());
    grid.uv_ids = {a, {b[0] + n, b[1] + n, b[2] + n}};
  };
  coordinates(0);
  EXPECT_EQ(classes({.coordinates = true}), 0u);
  EXPECT_EQ(classes({.everywhere = true}), 1u);
  EXPECT_EQ(build_edge_mesh(grid, true).count(EdgeClass::kSharp), 0u);
  coordinates(1);
  EXPECT_EQ(classes({.coordinates = true}), 1u);
  EXPECT_EQ(classes({.coordinates = true, .period_one = true}), 0u);
  coordinates(0.5);
  EXPECT_EQ(classes({.coordinates = true, .period_one = true}), 1u);
  coordinates(0);
  size_t along = 0;
  for (int k = 0; k < 3; ++k) {
    along += classes({.sides = {static_cast<uint8_t>(1 << k), 0}});
    along += classes({.sides = {0, static_cast<uint8_t>(1 << k)}});
  }
  EXPECT_EQ(along, 2u);
}

const std::string kCheckers = R"(<texture type="checkerboard" name="reflectance">
                                 <rgb name="color0" value=".8, .7, .6"/>
                                 <rgb name="color1" value=".1, .2, .3"/>)";

// A cylinder with interpolated normals, and a board, both checkered or of a texture that is left
// open, over gloss that mirrors them.
Scene still_life(const TempFiles& files, double scale, const std::string& texture = kCheckers) {
  SceneParts parts;
  parts.origin = {0, 2, 4};
  parts.film = R"(<rfilter type="tent"/>)";
  const std::string board = fmt::format(
      R"(<bsdf type="diffuse">{}
         <transform name="to_uv"><scale x="{}" y="{}"/></transform></texture></bsdf>)",
      texture, scale, scale);
  parts.body =
      square("floor", 2, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
      square("board", 0.8, -60, {0.6, 0.8, -0.6}, board) +
      R"(<shape type="cylinder" id="can"><transform name="to_world"><rotate x="1" angle="-75"/>
                  <scale value="0.6"/><translate x="-0.5" y="0.3"/></transform>)" +
      board + "</shape>" + square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6")) +
      constant_light("sky", "0.5, 0.5, 0.5");
  return make_scene(files, parts);
}

Scene checkered_ball(const TempFiles& files, double scale) {
  SceneParts parts;
  parts.body = fmt::format(
                   R"(<shape type="sphere" id="ball"><transform name="to_world">
                   <rotate x="1" angle="30"/></transform><bsdf type="diffuse">
                   <texture type="checkerboard" name="reflectance"><rgb name="color0" value=".9"/>
                   <transform name="to_uv"><scale x="{}" y="{}"/></transform></texture>
                   </bsdf></shape>)",
                   scale, scale) +
               constant_light("sky", "1, 1, 1");
  return make_scene(files, parts);
}

TEST(TextureEdges, OfASphereAgreeWithDifferences) {
  const TempFiles files;
  const Scene scene = checkered_ball(files, 4);
  for (const char* name : {"ball.rotate.y", "ball.rotate.x", "ball.translate.y", "sensor.fov"})
    expect_agreement(scene, name, 1024);
}

TEST(TextureEdges, DerivativesAgreeWithDifferences) {
  const TempFiles files;
  const Scene scene = still_life(files, 2);
  for (const char* name : {"board.translate.x", "can.rotate.y", "can.scale", "floor.translate.y",
                           "sensor.translate.x", "sensor.fov"})
    expect_agreement(scene, name, 256);
}

// Without texture coordinates textures and tangents are discontinuous at every edge of a mesh.
TEST(TextureEdges, OfFacesWithoutUvAgreeWithDifferences) {
  const TempFiles files;
  SceneParts parts;
  const std::string ball = write_mesh(files, "ball.obj", icosphere_mesh(0));
  parts.body = obj_shape("ball", ball, false, 0.8, {-1, 1, 0},
                         R"(<bsdf type="diffuse">)" + kCheckers + "</texture></bsdf>") +
               obj_shape("gem", ball, false, 0.8, {1, 1, 0},
                         R"(<bsdf type="roughconductor"><float name="alpha_u" value="0.15"/>
                            <float name="alpha_v" value="0.6"/></bsdf>)") +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6")) +
               constant_light("sky", "0.5, 0.5, 0.5");
  const Scene scene = make_scene(files, parts);
  for (const char* name : {"ball.rotate.y", "gem.rotate.y", "gem.translate.x", "sensor.fov"})
    expect_agreement(scene, name, 512);
}

std::string nearest(const std::string& file, const std::string& wrap) {
  return fmt::format(R"(<texture type="bitmap" name="reflectance">
                     <string name="filename" value="{}"/><boolean name="raw" value="true"/>
                     <string name="filter_type" value="nearest"/>
                     <string name="wrap_mode" value="{}"/>)",
                     file, wrap);
}

TEST(TextureEdges, OfTexelsAgreeWithDifferences) {
  const TempFiles files;
  Image image(5, 3, 3);
  Rng rng(2, 0, 0);
  for (float& x : image.data) x = static_cast<float>(rng.uniform());
  write_exr(files.path("a.exr"), image, false, {});
  for (const char* wrap : {"repeat", "mirror", "clamp"}) {
    const Scene scene = still_life(files, 1.5, nearest(files.path("a.exr"), wrap));
    for (const char* name : {"board.translate.x", "can.rotate.y", "sensor.fov"})
      expect_agreement(scene, name, 256);
  }
}

// Two texels by two are a checkerboard, sample by sample.
TEST(TextureEdges, OfTexelsAreACheckerboards) {
  const TempFiles files;
  Image image(2, 2, 3);
  const float colors[2][3] = {{0.8f, 0.7f, 0.6f}, {0.1f, 0.2f, 0.3f}};
  for (int i = 0; i < 4; ++i) {
    for (int c = 0; c < 3; ++c) image.at(i % 2, i / 2, c) = colors[(i % 2 + i / 2) % 2][c];
  }
  write_exr(files.path("a.exr"), image, false, {});
  GradientOptions options;
  options.parameters = {"board.translate.x", "can.rotate.y"};
  RunSettings settings;
  settings.spp = 4;
  const GradientResult texels =
      gradient(still_life(files, 2, nearest(files.path("a.exr"), "repeat")), options, settings);
  const GradientResult squares = gradient(still_life(files, 2), options, settings);
  for (size_t p = 0; p < 2; ++p) {
    const Moments &a = texels.parameters[p].total, &b = squares.parameters[p].total;
    double apart = 0, size = 0;
    for (size_t i = 0; i < a.size(); ++i) {
      apart += std::fabs(a.mean(i) - b.mean(i));
      size += std::fabs(b.mean(i));
    }
    EXPECT_GT(size, 0);
    EXPECT_LT(apart, 1e-5 * size);  // colours are floats
  }
}

// Where regions of light are apart, no list of outlines has the edges inside of a lamp.
TEST(TextureEdges, OfLampsCountWithRegionsApart) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.body =
      square("floor", 2, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
      square("lamp", 0.8, 90, {0.2, 1.5, 0},
             R"(<emitter type="area" id="glow"><texture type="checkerboard" name="radiance">
                      <rgb name="color0" value="1, .8, .6"/><rgb name="color1" value="0, .1, .2"/>
                      </texture></emitter>)");
  const Scene scene = make_scene(files, parts);
  expect_same_mean(scene, {"lamp.translate.x", "lamp.rotate.y"}, {"silhouettes", "adaptive"}, 512);
  expect_agreement(scene, "lamp.translate.x", 512);
}

TEST(TextureEdges, TooManyAndMeridiansAreTold) {
  const TempFiles files;
  GradientOptions options;
  RunSettings settings;
  settings.spp = 1;
  const Scene scene = still_life(files, 2);
  options.parameters = {"board.translate.x"};
  for (const std::string& warning : gradient(scene, options, settings).warnings)
    EXPECT_EQ(warning.find("incomplete"), warning.npos) << warning;
  const Scene fine = still_life(files, 1e6);
  try {
    gradient(fine, options, settings);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(
        std::string(e.what()).find("its texture is discontinuous along more than 1000000 edges"),
        std::string::npos)
        << e.what();
  }
  // What moves nothing needs no edges.
  options.parameters = {"glow.radiance"};
  EXPECT_NO_THROW(gradient(fine, options, settings));
  for (const double scale : {2.0, 2.5}) {
    const Scene ball = checkered_ball(files, scale);
    options.parameters = {"ball.translate.x"};
    bool told = false;
    for (const std::string& warning : gradient(ball, options, settings).warnings) {
      told = told || warning.find("the textures of \"ball\" are discontinuous where the angle") !=
                         warning.npos;
    }
    EXPECT_EQ(told, scale == 2.5);
  }
}

}  // namespace
}  // namespace limn
