// Courses of shapes and cameras: their places and derivatives at a time.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"
#include "limn/core/rng.h"
#include "support/meshes.h"
#include "support/motion_scenes.h"

namespace limn {
namespace {

std::string leaf(const TempFiles& files, bool smooth) {
  return obj_shape(smooth ? "ball" : "leaf",
                   smooth ? write_mesh(files, "ball.obj", icosphere_mesh(1))
                          : write_mesh(files, "leaf.obj", grid_mesh(2)),
                   !smooth, 0.6, {0.2, 1.2, 0.3}, diffuse(smooth ? "a" : "b", "0.5"));
}
// Turning, growing and sliding shapes, and a camera that turns.
Scene moving(const TempFiles& files) {
  SceneParts parts;
  parts.body = animated(leaf(files, false), {0.5, -0.2, 1}, 70, 1.5) +
               animated(leaf(files, true), {-0.5, 0.4, 0}, -100) +
               square("lamp", 0.4, 90, {0.3, 2.8, 0.5}, area_light("glow", "6, 5, 4"));
  return scene_of_text(animated(with_shutter(parts, 0, 1), {0.3, 0, 0.1}, 20));
}

TEST(Exposure, KeyframesAreTransforms) {
  const TempFiles files;
  const Scene scene = moving(files);
  SceneParts parts;
  parts.body = leaf(files, false);
  const Scene still = scene_of_text(scene_text(parts));
  for (const double t : {0.0, 0.25, 0.5, 1.0}) {
    const Mesh mesh = at_time(scene, t).shapes[0].mesh;
    const double angle = 70 * kPi / 180 * t, size = 1 + 0.5 * t;
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
      // The place (the mesh's origin, at (0.2, 1.2, 0.3)) goes straight; what is around it turns.
      const Vec3d from{0.2, 1.2, 0.3};
      const Vec3d to = Vec3d{0.2 * std::cos(70 * kPi / 180) + 0.3 * std::sin(70 * kPi / 180), 1.2,
                             -0.2 * std::sin(70 * kPi / 180) + 0.3 * std::cos(70 * kPi / 180)} *
                           1.5 +
                       Vec3d{0.5, -0.2, 1};
      const Vec3d arm = cast<double>(still.shapes[0].mesh.positions[v]) - from;
      const Vec3d turned{arm.x * std::cos(angle) + arm.z * std::sin(angle), arm.y,
                         -arm.x * std::sin(angle) + arm.z * std::cos(angle)};
      const Vec3d exact = from + (to - from) * t + turned * size;
      EXPECT_LT(length(cast<double>(mesh.positions[v]) - exact), 1e-6) << t;
    }
  }
}

TEST(Exposure, ClosedShuttersLeaveTheScene) {
  const TempFiles files;
  SceneParts parts;
  parts.body = animated(leaf(files, false), {0.5, -0.2, 1}, 70, 1.5);
  const Scene closed = scene_of_text(with_shutter(parts, 0, 0));
  parts.body = leaf(files, false);
  EXPECT_FALSE(closed.exposure);
  EXPECT_EQ(closed.shapes[0].mesh.positions,
            scene_of_text(scene_text(parts)).shapes[0].mesh.positions);
}

TEST(Exposure, InstancesMove) {
  const TempFiles files;
  SceneParts parts;
  parts.body = R"(<shape type="shapegroup" id="group">)" + leaf(files, false) + "</shape>" +
               animated(R"(<shape type="instance"><ref id="group"/>
                        <transform name="to_world"><translate x="1"/></transform></shape>)",
                        {0.5, -0.2, 1}, 70);
  const Scene instance = scene_of_text(with_shutter(parts, 0, 1));
  const Scene late = at_time(instance, 1), early = at_time(instance, 0);
  for (size_t v = 0; v < late.shapes[0].mesh.positions.size(); ++v) {
    const Vec3d x = cast<double>(early.shapes[0].mesh.positions[v]);
    const double c = std::cos(70 * kPi / 180), s = std::sin(70 * kPi / 180);
    const Vec3d exact = Vec3d{c * x.x + s * x.z, x.y, -s * x.x + c * x.z} + Vec3d{0.5, -0.2, 1};
    EXPECT_LT(length(cast<double>(late.shapes[0].mesh.positions[v]) - exact), 1e-6);
  }
}

// Differences of what at_time() makes of the moved scenes, by all parameters.
TEST(Exposure, DerivativesAreThoseOfPlaces) {
  const TempFiles files;
  Scene scene = moving(files);
  Rng rng(1, 0, 0);
  for (const char* start : {"leaf.velocity.x", "leaf.spin.y", "leaf.spin.z", "ball.spin.x",
                            "sensor.velocity.y", "sensor.spin.x", "sensor.spin.y"}) {
    find_parameter(scene, start).move(scene, 2 * rng.uniform() - 1);
  }
  const auto numbers = [](const Scene& at) {
    std::vector<Dual> list;
    for (const Shape& shape : at.shapes) {
      const Mesh& mesh = shape.mesh;
      for (size_t v = 0; v < mesh.positions.size(); ++v) {
        for (int k = 0; k < 3; ++k) {
          const Lanes d = mesh.position_tangents.empty() ? Lanes{} : mesh.position_tangents[v][k];
          list.push_back({double{mesh.positions[v][k]}, d});
        }
      }
      for (size_t n = 0; n < mesh.normals.size(); ++n) {
        for (int k = 0; k < 3; ++k) {
          const Lanes d = mesh.normal_tangents.empty() ? Lanes{} : mesh.normal_tangents[n][k];
          list.push_back({mesh.normals[n][k], d});
        }
      }
    }
    const Camera& c = at.camera;
    for (const auto& v : {c.origin, c.left, c.up, c.forward})
      list.insert(list.end(), {v.x, v.y, v.z});
    return list;
  };
  size_t tested = 0;
  for (const Parameter& parameter : list_parameters(scene)) {
    if (parameter.size > 1 || parameter.colour) continue;
    const double u = rng.uniform(), h = 1e-2;
    Scene seeded = deep_copy(scene);
    parameter.seed(seeded, 0);
    set_time(seeded, u);
    const auto exact = numbers(seeded);
    const auto at = [&](double step) { return numbers(at_time(parameter.moved(scene, step), u)); };
    const auto a = at(h), b = at(-h), c = at(2 * h), d = at(-2 * h);
    double most = 0, largest = 0;
    for (size_t i = 0; i < exact.size(); ++i) {
      const double slope = (8 * (a[i].v - b[i].v) - (c[i].v - d[i].v)) / (12 * h);
      most = std::max(most, std::fabs(exact[i].d[0] - slope));
      largest = std::max(largest, std::fabs(slope));
    }
    EXPECT_LT(most, 2e-4) << parameter.name << " " << u;  // floats over the step
    tested += largest > 1e-3 ? 1 : 0;
  }
  EXPECT_GE(tested, 30u);
}

TEST(Exposure, ParametersNeedAnOpenShutter) {
  const TempFiles files;
  SceneParts parts;
  parts.body = leaf(files, true);
  EXPECT_THROW(find_parameter(scene_of_text(scene_text(parts)), "ball.velocity.x"),
               UnknownParameter);
  const Scene open = scene_of_text(with_shutter(parts, 0, 1));
  EXPECT_FALSE(is_moving(open));
  EXPECT_TRUE(is_moving(find_parameter(open, "ball.velocity.x").moved(open, 0.1)));
  EXPECT_FALSE(is_moving(open));
}

TEST(Exposure, ShuttersCloseAfterTheyOpen) {
  const TempFiles files;
  Scene scene = moving(files);
  const auto expect = [&](const std::string& name, double value, const std::string& part) {
    try {
      find_parameter(scene, name).assign(scene, {value});
      ADD_FAILURE() << name;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  expect("sensor.shutter_open", 1.5, "it must not be after shutter_close, 1");
  expect("sensor.shutter_close", -0.5, "it must not be before shutter_open, 0");
  find_parameter(scene, "sensor.shutter_open").assign(scene, {0.5});
  EXPECT_EQ(scene.exposure->shutters[0].open.v, 0.5);
  EXPECT_EQ(scene.exposure->shutters[0].close.v, 1);
}

std::string message_of(const std::string& body, double open = 0, double close = 1) {
  SceneParts parts;
  parts.body = body;
  try {
    scene_of_text(with_shutter(parts, open, close));
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}
std::string keys(const std::string& last) {
  return R"(<shape type="cube"><animation name="to_world"><transform time="0"/>)" + last +
         "</animation></shape>";
}

TEST(Exposure, ErrorsHavePlaces) {
  const auto expect = [](const std::string& message, const std::string& part) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_NE(message.find(":"), std::string::npos) << message;
  };
  expect(message_of(keys(R"(<transform time="1"><scale x="2"/></transform>)")),
         "keyframes may differ by rotations, translations and uniform scales alone");
  expect(message_of(keys(R"(<transform time="1"><scale x="-1"/></transform>)")),
         "keyframes may differ");
  expect(message_of(keys(R"(<transform time="0"/>)")), "times must increase");
  expect(message_of(keys(R"(<scale x="2"/>)")), "takes <transform time=");
  expect(message_of(keys("<transform/>")), "\"time\" is missing");
  expect(message_of("", 1, 0), "shutter_close: must not be before shutter_open");
  expect(message_of(R"(<emitter type="spot"><animation name="to_world"><transform time="0"/>
                    </animation></emitter>)"),
         "must be given as <transform>, not <animation>");
}

}  // namespace
}  // namespace limn
