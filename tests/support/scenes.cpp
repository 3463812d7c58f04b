// XML of small scenes, put together from parts.
#include "support/scenes.h"

#include <fmt/format.h>

#include "limn/core/image.h"
#include "support/meshes.h"

namespace limn {
namespace {

std::string list(const Vec3d& v) { return fmt::format("{:.17g}, {:.17g}, {:.17g}", v.x, v.y, v.z); }

}  // namespace

std::string scene_text(const SceneParts& p) {
  return fmt::format(
      R"(<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="{}"/>
    <integer name="rr_depth" value="{}"/><boolean name="hide_emitters" value="{}"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="{:.17g}"/>
    <float name="near_clip" value="{:.17g}"/><float name="far_clip" value="{:.17g}"/>
    <transform name="to_world"><lookat origin="{}" target="{}" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="{}"/><integer name="height" value="{}"/>
      <string name="component_format" value="float32"/>{}</film>
  </sensor>
{}</scene>
)",
      p.max_depth, p.rr_depth, p.hide_emitters, p.fov, 0.01 * p.unit, 1000 * p.unit,
      list(p.origin * p.unit), list(p.target * p.unit), p.width, p.height,
      p.film.empty() ? R"(<rfilter type="box"/>)" : p.film, p.body);
}

Scene make_scene(const TempFiles& files, const SceneParts& parts) {
  return read_scene(files.write("scene.xml", scene_text(parts)), {}, nullptr);
}

std::string write_mesh(const TempFiles& files, const std::string& name, const Mesh& mesh) {
  std::string text;
  for (const Vec3f& x : mesh.positions) text += fmt::format("v {} {} {}\n", x.x, x.y, x.z);
  for (const auto& [a, b, c] : mesh.faces) {
    text += fmt::format("f {} {} {}\n", a + 1, b + 1, c + 1);
  }
  return files.write(name, text);
}

std::string obj_shape(const std::string& id, const std::string& file, bool face_normals,
                      double scale, const Vec3d& offset, const std::string& inner) {
  return fmt::format(
      R"(  <shape type="obj" id="{}"><string name="filename" value="{}"/>
    <boolean name="face_normals" value="{}"/><transform name="to_world">
      <scale value="{:.17g}"/><translate value="{}"/></transform>{}</shape>
)",
      id, file, face_normals, scale, list(offset), inner);
}

std::string square(const std::string& id, double size, double angle, const Vec3d& offset,
                   const std::string& inner) {
  return fmt::format(
      R"(  <shape type="rectangle" id="{}"><transform name="to_world"><rotate x="1" angle="{}"/>
      <scale value="{:.17g}"/><translate value="{}"/></transform>{}</shape>
)",
      id, angle, size, list(offset), inner);
}

std::string diffuse(const std::string& id, const std::string& reflectance) {
  return fmt::format(R"(<bsdf type="diffuse" id="{}"><rgb name="reflectance" value="{}"/></bsdf>)",
                     id, reflectance);
}

std::string area_light(const std::string& id, const std::string& radiance) {
  return fmt::format(R"(<emitter type="area" id="{}"><rgb name="radiance" value="{}"/></emitter>)",
                     id, radiance);
}

std::string constant_light(const std::string& id, const std::string& radiance) {
  return fmt::format(
      R"(  <emitter type="constant" id="{}"><rgb name="radiance" value="{}"/></emitter>
)",
      id, radiance);
}

std::string conductor(const std::string& id, double alpha) {
  return fmt::format(
      R"(<bsdf type="roughconductor" id="{}"><string name="distribution" value="ggx"/>
      <float name="alpha" value="{}"/></bsdf>)",
      id, alpha);
}

std::string make_sky(const TempFiles& files, const std::string& id) {
  Image map(16, 8, 3);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double phi = 2 * kPi * x / map.width;
      map.at(x, y, 0) = static_cast<float>(0.6 + 0.4 * std::sin(phi));
      map.at(x, y, 1) = static_cast<float>(0.3 + 0.1 * (8 - y));
      map.at(x, y, 2) = static_cast<float>(0.6 + 0.3 * std::cos(2 * phi));
    }
  }
  for (int c = 0; c < 3; ++c) map.at(5, 2, c) = 12;
  write_exr(files.path("sky.exr"), map, false, {});
  return fmt::format(
      R"(  <emitter type="envmap" id="{}"><string name="filename" value="{}"/></emitter>
)",
      id, files.path("sky.exr"));
}

std::string ball_over_gloss(const TempFiles& files, double alpha) {
  return square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", alpha)) +
         obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.8,
                   {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
         square("lamp", 0.5, 90, {0.3, 2.4, 0.5}, area_light("glow", "6, 5, 4")) +
         make_sky(files, "sky");
}

}  // namespace limn
