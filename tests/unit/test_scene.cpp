// Scenes read from files: transforms, the camera's conventions, defaults, substitution.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "limn/core/error.h"
#include "limn/core/properties.h"
#include "limn/core/scene.h"
#include "support/temp_files.h"

namespace limn {
namespace {

Scene read(const std::string& body, const std::map<std::string, std::string>& defines = {}) {
  const TempFiles files;
  files.write("part.xml", "<scene version=\"3.0.0\"><shape type=\"cube\" id=\"part\"/></scene>");
  return read_scene(files.write("s.xml", "<scene version=\"3.0.0\">" + body + "</scene>"), defines,
                    nullptr);
}

const std::string kSensor = "<sensor type=\"perspective\"/>";

Scene with_sensor(const std::string& body) {
  return read("<sensor type=\"perspective\">" + body + "</sensor>");
}

TEST(Matrix4, InverseAndNormals) {
  Matrix4 m;
  const double rows[3][4] = {{2, 0.5, -1, 3}, {0, 1, 4, -2}, {1, 0, 0.25, 7}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) m.m[i][j] = rows[i][j];
  }
  const Matrix4 identity = m * m.inverse();
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) EXPECT_NEAR(identity.m[i][j], i == j, 1e-14);
  }
  const Vec3d u{1, 2, 3}, v{-2, 0.5, 1};
  EXPECT_NEAR(dot(m.normal(cross(u, v)), m.vector(u)), 0, 1e-13);
  EXPECT_NEAR(dot(m.normal(cross(u, v)), m.vector(v)), 0, 1e-13);
  EXPECT_EQ(m.point(u) - m.point({}), m.vector(u));
  for (int j = 0; j < 4; ++j) m.m[2][j] = m.m[0][j] + m.m[1][j];
  EXPECT_THROW(m.inverse(), std::domain_error);
}

TEST(Matrix4, InverseDoesNotDependOnTheScale) {
  for (double scale : {1e-12, 1e12}) {
    Matrix4 m;
    for (int i = 0; i < 3; ++i) m.m[i][i] = scale;
    EXPECT_DOUBLE_EQ(m.inverse().m[1][1], 1 / scale);
  }
}

// The first operation in the file is the first to act.
TEST(SceneTransform, OperationsActInOrder) {
  const Scene scene = read(kSensor +
                           "<shape type=\"rectangle\"><transform name=\"to_world\"><scale x=\"2\"/>"
                           "<rotate z=\"1\" angle=\"90\"/><translate value=\"10,20,30\"/>"
                           "<matrix value=\"1 0 0  0 1 0  0 0 2\"/></transform></shape>");
  // Corner (1, 1, 0) goes to (2, 1, 0), (-1, 2, 0), (9, 22, 30), (9, 22, 60).
  const Vec3d p = cast<double>(scene.shapes[0].mesh.positions[2]);
  EXPECT_NEAR(length(p - Vec3d{9, 22, 60}), 0, 1e-5);
}

TEST(SceneCamera, LookatPutsLeftOnTheLeft) {
  const Camera c = with_sensor(
                       "<transform name=\"to_world\"><lookat origin=\"1,2,3\" target=\"1,2,-7\" "
                       "up=\"0,5,1\"/></transform>")
                       .camera;
  EXPECT_EQ(value(c.origin), (Vec3d{1, 2, 3}));
  EXPECT_NEAR(length(value(c.forward) - Vec3d{0, 0, -1}), 0, 1e-15);
  EXPECT_NEAR(length(value(c.up) - Vec3d{0, 1, 0}), 0, 1e-15);
  EXPECT_NEAR(length(value(c.left) - Vec3d{-1, 0, 0}), 0, 1e-15);
  // A point on the world's left lies in the left half of the image, one above in the upper half.
  const auto film = c.project(Vec3<double>{0.5, 2.5, 0});
  EXPECT_LT(film.x, c.width / 2.0);
  EXPECT_LT(film.y, c.height / 2.0);
}

TEST(SceneCamera, LookatWithoutUpIsStillOrthonormal) {
  const Camera c = with_sensor(
                       "<transform name=\"to_world\"><lookat origin=\"0,0,0\" target=\"1,2,3\"/>"
                       "</transform>")
                       .camera;
  EXPECT_NEAR(determinant(value(c.left), value(c.up), value(c.forward)), 1, 1e-15);
}

TEST(SceneCamera, RayAndProjectionAgree) {
  const Camera c =
      with_sensor(
          "<film type=\"hdrfilm\"><integer name=\"width\" value=\"300\"/>"
          "<integer name=\"height\" value=\"100\"/></film><float name=\"fov\" value=\"70\"/>"
          "<float name=\"principal_point_offset_x\" value=\"0.1\"/>"
          "<float name=\"principal_point_offset_y\" value=\"-0.2\"/>"
          "<transform name=\"to_world\"><lookat origin=\"1,2,3\" target=\"4,-1,0\" "
          "up=\"0,1,0\"/></transform>")
          .camera;
  for (double x : {0.0, 17.5, 299.0}) {
    for (double y : {0.5, 60.0, 100.0}) {
      const auto ray = c.ray<double>(x, y);
      const auto film = c.project(ray.origin + ray.direction * 7.0);
      EXPECT_NEAR(film.x, x, 1e-11);
      EXPECT_NEAR(film.y, y, 1e-11);
      EXPECT_NEAR(c.depth(ray.origin + ray.direction * ray.t_min), 0.01, 1e-14);
    }
  }
}

// Half the film's width and height in the plane at distance 1, by the axis' rule.
TEST(SceneCamera, FovAxes) {
  struct Case {
    int width, height;
    const char* axis;
    double half_width, half_height;
  };
  const double t = std::tan(30 * kPi / 180), d = t / std::sqrt(5.0);
  for (const Case& k : {Case{200, 100, "x", t, t / 2}, Case{200, 100, "y", 2 * t, t},
                        Case{200, 100, "diagonal", 2 * d, d}, Case{200, 100, "smaller", 2 * t, t},
                        Case{200, 100, "larger", t, t / 2}, Case{100, 200, "smaller", t, 2 * t},
                        Case{100, 200, "larger", t / 2, t}, Case{100, 200, "diagonal", d, 2 * d}}) {
    const Camera c =
        with_sensor(
            "<film type=\"hdrfilm\"><integer name=\"width\" value=\"" + std::to_string(k.width) +
            "\"/><integer name=\"height\" value=\"" + std::to_string(k.height) +
            "\"/></film><float name=\"fov\" value=\"60\"/><string name=\"fov_axis\" value=\"" +
            k.axis + "\"/>")
            .camera;
    const Vec3d corner = c.ray<double>(0, 0).direction;
    EXPECT_NEAR(corner.x / corner.z, k.half_width, 1e-14) << k.axis;
    EXPECT_NEAR(corner.y / corner.z, k.half_height, 1e-14) << k.axis;
  }
}

// To rounding; to the bit, however many go beside a ray.
TEST(SceneCamera, RaysFoundAtOnceAreThoseAlone) {
  const CameraView<double> camera(with_sensor("").camera);
  std::vector<Camera::FilmPoint<double>> positions;
  for (int i = 0; i < 19; ++i) positions.push_back({31.7 * i, 5.3 * i - 10});
  std::vector<CameraRay<double>> rays(positions.size()), one(1);
  find_rays(camera, positions, rays);
  for (size_t i = 0; i < rays.size(); ++i) {
    const CameraRay<double> alone = camera.ray(positions[i].x, positions[i].y);
    EXPECT_EQ(rays[i].origin, alone.origin);
    EXPECT_LT(length(rays[i].direction - alone.direction), 1e-15);
    EXPECT_NEAR(rays[i].t_min / alone.t_min, 1, 1e-15);
    EXPECT_NEAR(rays[i].t_max / alone.t_max, 1, 1e-15);
    find_rays(camera, {&positions[i], 1}, one);
    EXPECT_EQ(one[0].direction, rays[i].direction);
    EXPECT_EQ(one[0].t_max, rays[i].t_max);
  }
}

TEST(SceneCamera, FocalLengthIsMeasuredAlongTheDiagonal) {
  const Camera by_default = with_sensor("").camera;
  const Camera c = with_sensor("<string name=\"focal_length\" value=\"50\"/>").camera;
  for (const Camera& camera : {by_default, c}) {
    const Vec3d corner = camera.ray<double>(0, 0).direction;
    EXPECT_NEAR(std::hypot(corner.x, corner.y) / corner.z, std::hypot(36, 24) / 100, 1e-14);
  }
}

TEST(Scene, DefaultsAreMitsubas) {
  const Scene s = read(kSensor + "<shape type=\"cube\"/>");
  EXPECT_EQ(s.max_depth, -1);
  EXPECT_EQ(s.rr_depth, 5);
  EXPECT_FALSE(s.hide_emitters);
  EXPECT_EQ(s.sample_count, 4);
  EXPECT_EQ(s.camera.width, 768);
  EXPECT_EQ(s.camera.height, 576);
  EXPECT_EQ(s.camera.near_clip, 0.01);
  EXPECT_EQ(s.camera.far_clip, 10000);
  EXPECT_EQ(s.film.crop_width, 768);
  EXPECT_EQ(s.film.filter.kind, Filter::Kind::kGaussian);
  EXPECT_EQ(s.film.filter.radius, 2);
  EXPECT_FALSE(s.film.sample_border);
  EXPECT_TRUE(s.film.half);
  EXPECT_EQ(s.environment, nullptr);
  const Vec3d z{0, 0, 1};
  EXPECT_NEAR(s.shapes[0].bsdf->eval(z, z, z).r, 0.5 / kPi, 1e-15);
}

TEST(Scene, EmittersAreBlackUnlessTold) {
  const Scene s = read(kSensor + "<shape type=\"cube\"><emitter type=\"area\"/></shape>");
  const Vec3d z{0, 0, 1};
  EXPECT_TRUE(s.shapes[0].is_emitter);
  EXPECT_EQ(s.shapes[0].radiance.g.v, 1);
  EXPECT_EQ(s.shapes[0].bsdf->eval(z, z, z).r, 0);
}

TEST(Scene, ParametersAreSubstituted) {
  const std::string body =
      "<default name=\"r\" value=\"3\"/><default name=\"rr\" value=\"$r$r\"/>"
      "<integrator type=\"path\"><integer name=\"max_depth\" value=\"$r\"/>"
      "<integer name=\"rr_depth\" value=\"$rr\"/></integrator>" +
      kSensor + "<shape type=\"cube\" id=\"\\$r\"/>";
  EXPECT_EQ(read(body).max_depth, 3);
  EXPECT_EQ(read(body).rr_depth, 33);
  EXPECT_EQ(read(body).shapes[0].id, "$r");
  EXPECT_EQ(read(body, {{"r", "2"}}).rr_depth, 22);
}

TEST(Scene, IncludesReferencesAndAliases) {
  const Scene s =
      read(kSensor +
           "<shape type=\"disk\"><ref name=\"x\" id=\"other\"/></shape>"
           "<include filename=\"part.xml\"/><alias id=\"mine\" as=\"other\"/>"
           "<shape type=\"cube\"><ref id=\"mine\"/></shape>"
           "<bsdf type=\"diffuse\" id=\"mine\"/><bsdf type=\"diffuse\" id=\"unused\"/>");
  ASSERT_EQ(s.shapes.size(), 3u);
  EXPECT_EQ(s.shapes[1].id, "part");
  EXPECT_EQ(s.shapes[0].bsdf, s.shapes[2].bsdf);
  EXPECT_EQ(s.shapes[0].bsdf, s.bsdfs_by_id.at("mine"));
  EXPECT_EQ(s.bsdfs_by_id.count("unused"), 1u);
}

// The first sensor is the scene's; the others wait.
// An id that is a number does not hide the sensor of that number.
TEST(Scene, HasSensorsNamedByNumbers) {
  Scene s = read(
      "<sensor type=\"perspective\" id=\"1\"><float name=\"fov\" value=\"30\"/></sensor>"
      "<sensor type=\"perspective\" id=\"2\"><float name=\"fov\" value=\"60\"/></sensor>");
  for (const auto& [name, fov] : {std::pair{"0", 30.0}, {"1", 60.0}, {"2", 60.0}}) {
    use_sensor(s, name);
    EXPECT_EQ(s.camera.fov.v, fov) << name;
  }
}

TEST(Scene, HasSeveralSensors) {
  Scene s = read(
      "<sensor type=\"perspective\"><float name=\"fov\" value=\"30\"/></sensor>"
      "<sensor type=\"perspective\" id=\"side\"><float name=\"fov\" value=\"60\"/>"
      "<film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/></film>"
      "<sampler type=\"independent\"><integer name=\"sample_count\" value=\"7\"/>"
      "<integer name=\"seed\" value=\"5\"/></sampler></sensor>");
  EXPECT_EQ(s.sensors.size(), 2u);
  EXPECT_EQ(s.camera.fov.v, 30);
  EXPECT_EQ(s.film.crop_width, 768);
  for (const char* name : {"side", "1"}) {
    use_sensor(s, "0");
    EXPECT_EQ(s.camera.fov.v, 30);
    EXPECT_EQ(s.sample_count, 4);
    use_sensor(s, name);
    EXPECT_EQ(s.camera.fov.v, 60);
    EXPECT_EQ(s.film.crop_width, 8);
    EXPECT_EQ(s.camera.width, 8);
    EXPECT_EQ(s.sample_count, 7);
    EXPECT_EQ(s.seed, 5u);
  }
  for (const char* name : {"2", "", "front"}) {
    try {
      use_sensor(s, name);
      ADD_FAILURE() << name;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("(known: 0, 1 or \"side\")"), std::string::npos);
    }
  }
}

TEST(Scene, KnowsTheFilesItWasReadFrom) {
  const TempFiles files;
  const std::string mesh = files.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  files.write("part.xml", "<scene version=\"3.0.0\"><shape type=\"cube\"/></scene>");
  const std::string file = files.write(
      "s.xml", "<scene version=\"3.0.0\">" + kSensor + "<include filename=\"part.xml\"/>" +
                   "<shape type=\"obj\"><string name=\"filename\" value=\"m.obj\"/></shape>" +
                   "</scene>");
  const Scene s = read_scene(file, {}, nullptr);
  EXPECT_EQ(s.xml_files, (std::vector<std::string>{file, files.path("part.xml")}));
  EXPECT_EQ(s.data_files, std::vector<std::string>{mesh});
}

TEST(Scene, ConstantSpectrumOfAReflectanceIsGrey) {
  const Scene s = read(kSensor +
                       "<shape type=\"disk\"><bsdf type=\"diffuse\">"
                       "<spectrum name=\"reflectance\" value=\"0.25\"/></bsdf></shape>");
  const Vec3d z{0, 0, 1};
  EXPECT_NEAR(s.shapes[0].bsdf->eval(z, z, z).b, 0.25 / kPi, 1e-15);
}

}  // namespace
}  // namespace limn
