// Every parameter by name: its derivative against a small move of the scene.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "limn/core/parameter.h"
#include "support/temp_files.h"

namespace limn {
namespace {

// A smooth coarse mesh in a shape with given normals, one with computed normals, a shared BSDF, and
// one of everything else that can move.
class Parameters : public testing::Test {
 protected:
  Parameters() {
    // A tent of four faces; the fifth vertex is a copy of the first, as along a texture seam.
    files_.write("smooth.obj",
                 "v 0 0 1\nv 1 0.1 0\nv 0 1.2 0.1\nv -1 -0.1 0\nv 0 0 1\nv 0.1 -0.9 0\n"
                 "f 1 2 3\nf 1 3 4\nf 5 4 6\nf 5 6 2\n");
    const std::string file = files_.write("s.xml", R"(<scene version="3.0.0">
      <sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
        <lookat origin="1,2,5" target="0,0.5,0" up="0,1,0"/></transform></sensor>
      <bsdf type="roughconductor" id="metal"><float name="alpha" value="0.2"/>
        <string name="material" value="Cu"/></bsdf>
      <bsdf type="twosided" id="both"><ref id="metal"/></bsdf>
      <shape type="obj" id="tent"><string name="filename" value="smooth.obj"/><ref id="both"/>
      </shape>
      <shape type="sphere" id="ball"><point name="center" value="3,1,2"/><ref id="metal"/>
        <emitter type="area" id="lamp"><rgb name="radiance" value="1,2,3"/></emitter></shape>
      <shape type="cube"/>
      <emitter type="constant" id="sky"><rgb name="radiance" value="0.5"/></emitter>
      <emitter type="point" id="bulb"><point name="position" value="1,2,3"/></emitter>
      <emitter type="spot" id="torch"><rgb name="intensity" value="80"/>
        <float name="cutoff_angle" value="60"/><float name="beam_width" value="10"/>
        <transform name="to_world">
        <lookat origin="1,3,1" target="0.2,0,0.5" up="0,1,0"/></transform></emitter>
      <emitter type="directional" id="sun"><vector name="direction" value="1,-2,0.5"/></emitter>
      </scene>)");
    scene_ = read_scene(file, {}, nullptr);
    std::string field;
    for (int i = 0; i < 6; ++i) field += i == 0 || i == 4 ? "0.5 1 2\n" : "0.1 -0.2 0.3\n";
    field_ = files_.write("field.txt", field);
  }

  TempFiles files_;
  Scene scene_;
  std::string field_;
};

// All numbers of a scene that a parameter can move.
std::vector<Dual> numbers(const Scene& scene) {
  std::vector<Dual> all;
  const auto add = [&](const Vec3<Dual>& v) { all.insert(all.end(), {v.x, v.y, v.z}); };
  for (const Shape& shape : scene.shapes) {
    const Mesh& m = shape.mesh;
    for (uint32_t i = 0; i < m.positions.size(); ++i) add(m.position(VertexId(i)));
    for (size_t i = 0; i < m.normals.size(); ++i) {
      Vec3<Dual> n{m.normals[i].x, m.normals[i].y, m.normals[i].z};
      for (int k = 0; k < 3 && !m.normal_tangents.empty(); ++k) n[k].d = m.normal_tangents[i][k];
      add(n);
    }
    all.insert(all.end(), {shape.radiance.r, shape.radiance.g, shape.radiance.b});
    for (const ParameterRef& p : shape.bsdf->parameters()) {
      for (const Dual* v : p.values) all.push_back(*v);
    }
  }
  for (const ParameterRef& p : scene.environment->parameters()) {
    for (const Dual* v : p.values) all.push_back(*v);
  }
  for (const auto& light : scene.delta_lights) {
    // Where the spot falls off.
    for (const Vec3d& p : {Vec3d{1, 0.5, -1}, Vec3d{2, 0, 2}}) {
      const auto arrival = light->arriving(Vec3<Dual>{p.x, p.y, p.z});
      if (!arrival) continue;
      add(arrival->wo);
      all.insert(all.end(), {arrival->irradiance.r, arrival->irradiance.g, arrival->irradiance.b});
    }
    add(light->origin().v);
  }
  for (const Vec3<Dual>* v :
       {&scene.camera.origin, &scene.camera.left, &scene.camera.up, &scene.camera.forward}) {
    add(*v);
  }
  all.push_back(scene.camera.fov);
  return all;
}

// Central differences with step h have an error of curvature times h^2, and of the rounding of
// positions to float (magnitude up to 4) over h, which normals of the sphere's small faces
// multiply by one over the face's size.
void expect_derivative(const Scene& scene, const Parameter& parameter) {
  const double h = 0x1p-7;
  const double bound = 8 * h * h + 16 * 0x1p-23 / h;
  Scene seeded = deep_copy(scene);
  parameter.seed(seeded, 2);
  const std::vector<Dual> at = numbers(seeded);
  const std::vector<Dual> up = numbers(parameter.moved(scene, h));
  const std::vector<Dual> down = numbers(parameter.moved(scene, -h));
  ASSERT_EQ(at.size(), up.size());
  double motion = 0;
  for (size_t i = 0; i < at.size(); ++i) {
    const double difference = (up[i].v - down[i].v) / (2 * h);
    EXPECT_NEAR(at[i].d[2], difference, bound) << parameter.name << " number " << i;
    EXPECT_EQ(at[i].d[0], 0);
    motion = std::max(motion, std::fabs(difference));
  }
  EXPECT_GT(motion, 0.05) << parameter.name << " moves nothing";
}
void expect_derivative(const Scene& scene, const std::string& name) {
  expect_derivative(scene, find_parameter(scene, name));
}

TEST_F(Parameters, DerivativesMatchMoves) {
  for (const Parameter& p : list_parameters(scene_)) {
    if (p.size == 1) expect_derivative(scene_, p.name);
  }
  expect_derivative(scene_, "tent.vertex_positions:" + field_);
  expect_derivative(scene_, "tent.vertex_positions.2.y");
  expect_derivative(scene_, "tent.vertex_positions.4.z");  // a copy: its twin moves along
  expect_derivative(scene_, "tent.displacement.2");
  expect_derivative(scene_, "tent.displacement.4");
}

TEST_F(Parameters, DirectionsMoveAllNumbers) {
  int colours = 0, arrays = 0;
  for (const Parameter& p : list_parameters(scene_)) {
    if (p.numbers() == 1) continue;
    std::vector<double> direction(p.numbers());
    for (size_t i = 0; i < direction.size(); ++i)
      direction[i] = p.array.size() == 1 ? 1 : static_cast<double>(i % 3) - 0.25;
    const Parameter field = along(scene_, find_parameter_or_array(scene_, p.name), direction);
    EXPECT_EQ(field.name, p.name);
    expect_derivative(scene_, field);
    ++(p.colour ? colours : arrays);
  }
  EXPECT_GT(colours, 2);
  EXPECT_GT(arrays, 2);
  EXPECT_THROW(along(scene_, find_parameter_or_array(scene_, "tent.displacement"), {1}),
               InputError);
  EXPECT_THROW(along(scene_, find_parameter(scene_, "tent.scale"), {1}), InputError);
}

// Of all numbers of two scenes.
void expect_same(const Scene& a, const Scene& b, const std::string& name) {
  const std::vector<Dual> left = numbers(a), right = numbers(b);
  ASSERT_EQ(left.size(), right.size());
  for (size_t i = 0; i < left.size(); ++i) EXPECT_EQ(left[i].v, right[i].v) << name << " " << i;
}

// Assigning what a value would be after a move is that move; values of arrays, too.
TEST_F(Parameters, AssigningIsMoving) {
  int assigned = 0;
  for (const Parameter& p : list_parameters(scene_)) {
    std::vector<double> value = p.value(scene_);
    Scene other = deep_copy(scene_);
    if (value.empty()) {
      EXPECT_THROW(p.assign(other, {0.5}), InputError) << p.name;
      continue;
    }
    ++assigned;
    p.assign(other, value);
    expect_same(other, scene_, p.name);
    // The last vertex has no twin.
    const size_t component = p.size - 1;
    const double step = -0x1p-6;
    for (size_t i = component; i < value.size(); ++i) {
      value[i] += step;
      if (p.size > 1) value[i] = static_cast<double>(static_cast<float>(value[i]));
    }
    p.assign(other, value);
    EXPECT_EQ(p.value(other), value) << p.name;
    expect_same(other, p.moved(scene_, step, component), p.name);
    value.push_back(0);
    EXPECT_THROW(p.assign(other, value), InputError) << p.name;
    EXPECT_THROW(p.assign(other, {std::nan("")}), InputError) << p.name;
  }
  EXPECT_GT(assigned, 20);
}

// What the reader of a scene refuses.
TEST_F(Parameters, ValuesKeepTheirBounds) {
  for (const auto& [name, value] :
       std::map<std::string, double>{{"metal.alpha", -0.1},
                                     {"metal.specular_reflectance", 1.1},
                                     {"lamp.radiance", -1},
                                     {"bulb.intensity", -1},
                                     {"sun.irradiance", -1},
                                     {"torch.cutoff_angle", 10},
                                     {"torch.beam_width", 60},
                                     {"sensor.fov", 180}}) {
    const Parameter p = find_parameter(scene_, name);
    const std::vector<double> before = p.value(scene_);
    EXPECT_THROW(p.assign(scene_, {value}), InputError) << name;
    EXPECT_EQ(p.value(scene_), before) << name;
  }
}

TEST_F(Parameters, AreListed) {
  std::vector<std::string> names;
  for (const Parameter& p : list_parameters(scene_)) {
    names.push_back(p.name);
    EXPECT_GT(p.natural_step, 0) << p.name;
  }
  for (const char* name :
       {"tent.translate.x",   "ball.rotate.z",      "ball.scale",        "tent.vertex_positions",
        "ball.displacement",  "sensor.translate.y", "sensor.rotate.x",   "sensor.fov",
        "metal.alpha",        "both.alpha",         "lamp.radiance",     "sky.radiance",
        "bulb.translate.x",   "bulb.intensity",     "torch.translate.z", "torch.rotate.x",
        "torch.cutoff_angle", "torch.beam_width",   "sun.rotate.y",      "sun.irradiance"}) {
    EXPECT_EQ(std::count(names.begin(), names.end(), name), 1) << name;
  }
}

// Channels of a colour: each moves by itself, and is not listed.
TEST_F(Parameters, ColoursHaveChannels) {
  for (const char* name : {"lamp.radiance.g", "metal.specular_reflectance.b", "sun.irradiance.r"}) {
    expect_derivative(scene_, name);
  }
  const Parameter green = find_parameter(scene_, "lamp.radiance.g");
  EXPECT_EQ(green.value(scene_), std::vector<double>{2});
  green.assign(scene_, {0.5});
  const Parameter lamp = find_parameter(scene_, "lamp.radiance");
  EXPECT_EQ(lamp.value(scene_), (std::vector<double>{1, 0.5, 3}));
  EXPECT_THROW(green.assign(scene_, {-1}), InputError);
  EXPECT_EQ(lamp.shape(), std::vector<size_t>{3});
  EXPECT_TRUE(green.shape().empty());
  EXPECT_EQ(find_parameter_or_array(scene_, "tent.vertex_positions").shape(),
            (std::vector<size_t>{6, 3}));
  for (const char* name : {"metal.alpha.r", "lamp.radiance.", "lamp.radiance.rg", "lamp.radiance.x",
                           "lamp.radiance.g.g", "lamp.radiancer"}) {
    EXPECT_THROW(find_parameter(scene_, name), UnknownParameter) << name;
  }
}

// An array's components, summed over the first copies, are any motion of the shape.
TEST_F(Parameters, ComponentsOfAnArrayAddUpToAnyMotion) {
  const Parameter array = find_parameter_or_array(scene_, "tent.vertex_positions");
  const Mesh& mesh = scene_.shapes[0].mesh;
  ASSERT_EQ(array.size, 3 * mesh.positions.size());
  for (const std::string name :
       {"tent.translate.y", "tent.rotate.z", "tent.scale", "tent.vertex_positions.2.y"}) {
    const Parameter parameter = find_parameter(scene_, name);
    const std::vector<Vec3d> wanted = parameter.velocities(scene_, ShapeId(0));
    std::vector<Vec3d> sum(wanted.size());
    for (size_t c = 0; c < array.size; ++c) {
      if (mesh.weld[c / 3] != c / 3) continue;
      const double factor = wanted[c / 3][static_cast<int>(c % 3)];
      const std::vector<Vec3d> one = array.velocities(scene_, ShapeId(0), c);
      for (size_t i = 0; i < sum.size(); ++i) sum[i] += one[i] * factor;
    }
    EXPECT_EQ(sum, wanted) << name;
    EXPECT_TRUE(parameter.velocities(scene_, ShapeId(1)).empty());
  }
  Scene by_array = deep_copy(scene_), by_name = deep_copy(scene_);
  array.seed(by_array, 1, 2 * 3 + 1);
  find_parameter(scene_, "tent.vertex_positions.2.y").seed(by_name, 1);
  const std::vector<Dual> a = numbers(by_array), b = numbers(by_name);
  for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].d[1], b[i].d[1]);
}

// It points to nothing in the scene that it was resolved in.
TEST_F(Parameters, OutliveTheSceneTheyWereResolvedIn) {
  auto other = std::make_unique<Scene>(deep_copy(scene_));
  const std::vector<Parameter> list = list_parameters(*other);
  other.reset();
  for (const Parameter& p : list) {
    const std::vector<Dual> before = numbers(scene_);
    const std::vector<Dual> after = numbers(p.moved(scene_, 0.1));
    const auto same = [](const Dual& a, const Dual& b) { return a.v == b.v; };
    EXPECT_FALSE(std::equal(before.begin(), before.end(), after.begin(), same)) << p.name;
  }
}

TEST_F(Parameters, LanesAddUp) {
  Scene both = deep_copy(scene_);
  find_parameter(scene_, "tent.rotate.x").seed(both, 0);
  find_parameter(scene_, "tent.scale").seed(both, 1);
  Scene one = deep_copy(scene_);
  find_parameter(scene_, "tent.scale").seed(one, 1);
  const std::vector<Dual> a = numbers(both), b = numbers(one);
  for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].d[1], b[i].d[1]);
}

TEST_F(Parameters, MovesAreExactForLargeSteps) {
  const Mesh& before = scene_.shapes[0].mesh;
  const Mesh after = find_parameter(scene_, "tent.rotate.z").moved(scene_, kPi).shapes[0].mesh;
  const Vec3d c = bounds_of(before).center();
  for (size_t i = 0; i < before.positions.size(); ++i) {
    const Vec3d p = cast<double>(before.positions[i]), q = cast<double>(after.positions[i]);
    EXPECT_NEAR(length(Vec3d{2 * c.x - p.x, 2 * c.y - p.y, p.z} - q), 0, 0x1p-22);
  }
}

TEST_F(Parameters, CopiesShareNothingWithTheOriginalAndKeepSharing) {
  const Scene moved = find_parameter(scene_, "metal.alpha").moved(scene_, 0.1);
  const auto alpha = [](const Scene& s, size_t shape) {
    for (const ParameterRef& p : s.shapes[shape].bsdf->parameters()) {
      if (p.name == "alpha") return p.values[0]->v;
    }
    return -1.0;
  };
  EXPECT_DOUBLE_EQ(alpha(moved, 0), 0.3);  // through twosided
  EXPECT_DOUBLE_EQ(alpha(moved, 1), 0.3);
  EXPECT_DOUBLE_EQ(alpha(scene_, 0), 0.2);
  EXPECT_EQ(moved.shapes[1].bsdf, moved.bsdfs_by_id.at("metal"));
  EXPECT_NE(moved.shapes[1].bsdf, scene_.shapes[1].bsdf);
}

TEST_F(Parameters, UnknownNamesListTheNearest) {
  try {
    find_parameter(scene_, "tent.translate.w");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(error.what(),
              files_.path("s.xml") +
                  ": error: unknown parameter \"tent.translate.w\" (nearest: tent.translate.x, "
                  "tent.translate.y, tent.translate.z, ball.translate.x, ball.translate.y)");
  }
}

TEST_F(Parameters, WhatHasNoIdIsNamedByItsFileOrType) {
  files_.write("nameless.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>
      <bsdf type="diffuse" id="cube_1"/>
      <shape type="cube"/>
      <shape type="obj"><string name="filename" value="smooth.obj"/></shape>
      <shape type="cube"><bsdf type="diffuse"><rgb name="reflectance" value="0.25"/></bsdf></shape>
      <shape type="cube"><ref id="cube_1"/></shape>
      <shape type="disk"><emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>
      <emitter type="point"/><emitter type="point"/></scene>)");
  const Scene scene = read_scene(files_.path("nameless.xml"), {}, nullptr);
  const std::vector<std::string> ids{"cube", "smooth", "cube_2", "cube_3", "disk"};
  for (size_t i = 0; i < ids.size(); ++i) EXPECT_EQ(scene.shapes[i].id, ids[i]);
  EXPECT_EQ(scene.delta_lights[1]->id, "point_1");
  const auto red = [&](const std::string& name) {
    return find_parameter_or_array(scene, name).value(scene)[0];
  };
  EXPECT_EQ(red("cube.bsdf.reflectance"), 0.5);
  EXPECT_EQ(red("cube_2.bsdf.reflectance.value"), 0.25);
  EXPECT_THROW(red("cube_2.bsdf.reflectance.value.value"), InputError);
  EXPECT_EQ(red("disk.emitter.radiance"), 3);
  EXPECT_EQ(scene.bsdfs_by_id.at("cube_1"), scene.shapes[3].bsdf);
  EXPECT_FALSE(scene.bsdfs_by_id.contains("cube_3.bsdf"));
}

TEST_F(Parameters, MitsubasNamesCountWhatIsNested) {
  files_.write("nested.xml", R"(<scene version="3.0.0"><sensor type="perspective"/>
      <shape type="cube" id="one"><bsdf type="mask"><bsdf type="twosided"><bsdf type="diffuse">
        <rgb name="reflectance" value="0.25"/></bsdf></bsdf></bsdf></shape>
      <bsdf type="twosided" id="two"><bsdf type="diffuse"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.75"/></bsdf></bsdf></scene>)");
  const Scene scene = read_scene(files_.path("nested.xml"), {}, nullptr);
  for (const auto& [name, value] :
       {std::pair{"one.bsdf.nested_bsdf.brdf_0.reflectance.value", 0.25},
        {"one.bsdf.brdf_0.reflectance.r", 0.25},
        {"two.brdf_0.reflectance.value", 0.5},
        {"two.brdf_1.reflectance", 0.75}}) {
    const Parameter found = find_parameter_or_array(scene, name);
    EXPECT_EQ(found.name, name);
    EXPECT_EQ(found.value(scene)[0], value);
  }
  EXPECT_THROW(find_parameter_or_array(scene, "one.bsdf.brdf_1.reflectance"), InputError);
}

std::string message_of(const Scene& scene, const std::string& name) {
  try {
    find_parameter(scene, name);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST_F(Parameters, ArraysSayHowToNameAPart) {
  const std::string at = files_.path("s.xml") + ": error: ";
  EXPECT_EQ(message_of(scene_, "tent.vertex_positions"),
            at + "parameter \"tent.vertex_positions\" is an array of 18 numbers, and one is "
                 "wanted: \"tent.vertex_positions:FILE\" for a field of vectors, "
                 "\"tent.vertex_positions.0.x\" for one number");
  EXPECT_EQ(message_of(scene_, "tent.vertex_positions.6.x"),
            at + "parameter \"tent.vertex_positions.6.x\": the mesh has vertices 0 to 5");
  EXPECT_EQ(message_of(scene_, "tent.displacement"),
            at + "parameter \"tent.displacement\" is an array of 6 numbers, and one is wanted: "
                 "\"tent.displacement.0\" for one number");
  EXPECT_EQ(message_of(scene_, "tent.displacement.6"),
            at + "parameter \"tent.displacement.6\": the mesh has vertices 0 to 5");
  EXPECT_EQ(message_of(scene_, "tent.displacement.-1"),
            at + "parameter \"tent.displacement.-1\": the mesh has vertices 0 to 5");
  for (const char* name :
       {"tent.vertex_positions:", "tent.vertex_positions.1", "tent.vertex_positions.1.w",
        "tent.vertex_positions.x.1", "tent.vertex_positionsx", "tent.vertex_positions.-1.xy",
        "tent.displacement.", "tent.displacement.x", "tent.displacement.1.x",
        "tent.displacement:"}) {
    EXPECT_TRUE(message_of(scene_, name).starts_with(at + "unknown parameter")) << name;
  }
}

// The bounds of a shape that turns have their center here and there: all steps go about one point.
TEST_F(Parameters, StepsOfATurnAddUp) {
  for (const char* name : {"tent.rotate.x", "tent.rotate.y", "tent.rotate.z"}) {
    const Parameter turn = find_parameter(scene_, name);
    const Scene once = turn.moved(scene_, 1.2);
    const Scene half = turn.moved(scene_, 0.5);
    const Scene twice = find_parameter(half, name).moved(half, 0.7);
    const Vec3d there = bounds_of(half.shapes[0].mesh).center();
    EXPECT_GT(length(there - bounds_of(scene_.shapes[0].mesh).center()), 0.01) << name;
    const auto &a = once.shapes[0].mesh.positions, &b = twice.shapes[0].mesh.positions;
    for (size_t v = 0; v < a.size(); ++v) {
      // Coordinates below 4 are rounded to floats twice.
      EXPECT_LT(length(cast<double>(a[v]) - cast<double>(b[v])), 0x1p-20) << name;
    }
  }
}

// Translations take along what a shape turns about and is scaled about, scales are in sizes of the
// start: steps in turns are one turn, one scale and one translation.
TEST_F(Parameters, StepsInTurnsAddUp) {
  const ShapeId tent(0);
  const std::vector<std::pair<const char*, double>> steps{
      {"tent.translate.x", 0.5}, {"tent.rotate.y", 0.7},     {"tent.scale", 0.4},
      {"tent.translate.z", -1},  {"tent.translate.x", -0.2}, {"tent.scale", -0.6},
      {"tent.rotate.y", -1.1}};
  Scene stepped = deep_copy(scene_);
  std::map<std::string, double> sums;
  for (const auto& [name, step] : steps) {
    const Parameter there = find_parameter(stepped, name);
    // The derivative is that of the steps.
    const Scene more = there.moved(stepped, 1e-3), less = there.moved(stepped, -1e-3);
    const std::vector<Vec3d> velocities = there.velocities(stepped, tent);
    for (size_t v = 0; v < velocities.size(); ++v) {
      const Vec3d difference = cast<double>(more.shapes[0].mesh.positions[v]) -
                               cast<double>(less.shapes[0].mesh.positions[v]);
      // Coordinates below 4 in floats, over steps of 0.002; a turn's third derivative.
      EXPECT_LT(length(difference / 2e-3 - velocities[v]), 1e-3) << name << " " << v;
    }
    there.move(stepped, step);
    sums[name] += step;
  }
  Scene once = deep_copy(scene_);
  for (const char* name : {"tent.rotate.y", "tent.scale", "tent.translate.x", "tent.translate.z"}) {
    find_parameter(scene_, name).move(once, sums[name]);
  }
  const auto &a = once.shapes[0].mesh.positions, &b = stepped.shapes[0].mesh.positions;
  for (size_t v = 0; v < a.size(); ++v) {
    // Coordinates below 4 are rounded to floats seven times.
    EXPECT_LT(length(cast<double>(a[v]) - cast<double>(b[v])), 0x1p-18) << v;
  }
}

// Along the mean normal of the faces around a vertex, weighted by their angles there, for any
// shading; found once, the directions stay while the vertices go on.
TEST_F(Parameters, DisplacementsGoAlongNormals) {
  const Mesh& mesh = scene_.shapes[0].mesh;
  std::vector<Vec3d> expected(mesh.positions.size());
  for (const FaceIndices& face : mesh.faces) {
    Vec3d c[3];
    for (int k = 0; k < 3; ++k) c[k] = cast<double>(mesh.positions[face[k]]);
    const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
    for (int k = 0; k < 3; ++k) {
      const Vec3d a = normalize(c[(k + 1) % 3] - c[k]), b = normalize(c[(k + 2) % 3] - c[k]);
      expected[mesh.weld[face[k]]] += n * std::acos(dot(a, b));
    }
  }
  for (const bool flat : {false, true}) {
    Scene scene = deep_copy(scene_);
    if (flat) scene.shapes[0].mesh.normal_source = NormalSource::kFace;
    const Parameter array = find_parameter_or_array(scene, "tent.displacement");
    EXPECT_EQ(array.shape(), std::vector<size_t>{6});
    EXPECT_TRUE(array.value(scene).empty());
    for (size_t v = 0; v < array.size; ++v) {
      const std::vector<Vec3d> velocities = array.velocities(scene, ShapeId(0), v);
      for (size_t i = 0; i < velocities.size(); ++i) {
        const bool moves = mesh.weld[i] == mesh.weld[v];
        const Vec3d wanted = moves ? normalize(expected[mesh.weld[v]]) : Vec3d{};
        EXPECT_LT(length(velocities[i] - wanted), 1e-12) << v << " " << i;
      }
    }
    const std::vector<Vec3d> held = array.directions(scene);
    array.move(scene, 0.4, 2);
    EXPECT_EQ(array.directions(scene), held);
    const Parameter now = find_parameter_or_array(scene, "tent.displacement");
    EXPECT_NE(now.directions(scene), held);
    EXPECT_TRUE(array.velocities(scene, ShapeId(1)).empty());
  }
}

TEST_F(Parameters, SeedAndComponentAreChecked) {
  Scene copy = deep_copy(scene_);
  const Parameter array = find_parameter_or_array(scene_, "tent.vertex_positions");
  EXPECT_DEATH(array.seed(copy, kLanes), "parameter.cpp.*lane < kLanes .4 and 4.");
  EXPECT_DEATH(array.seed(copy, -1), "parameter.cpp.*0 <= lane .0 and -1.");
  EXPECT_DEATH(array.seed(copy, 0, 18), "parameter.cpp.*component < size .18 and 18.");
  EXPECT_DEATH(array.moved(copy, 0.1, 18), "component < size");
}

TEST_F(Parameters, VectorFilesMustFit) {
  const std::string shorter = files_.write("short.txt", "0 0 1\n0 0 1\n");
  EXPECT_EQ(message_of(scene_, "tent.vertex_positions:" + shorter),
            shorter + ": error: the file has 2 vectors, but the mesh of \"tent\" has 6 vertices");
  const std::string torn = files_.write("torn.txt", "0 0 1\n0 0 0\n0 0 0\n0 0 0\n0 0 2\n0 0 0\n");
  EXPECT_EQ(message_of(scene_, "tent.vertex_positions:" + torn),
            torn +
                ": error: vertices 0 and 4 (counted from 0) of \"tent\" are at the same position "
                "but move apart");
  const double step = find_parameter(scene_, "tent.vertex_positions:" + field_).natural_step;
  EXPECT_GT(step, 0);
}

}  // namespace
}  // namespace limn
