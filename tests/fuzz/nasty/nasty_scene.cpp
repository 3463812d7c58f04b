// Scenes that break things: cameras on faces, lamps of size 1e-6, mirrors, all scales.
#include "tests/fuzz/nasty/nasty_scene.h"

#include <fmt/format.h>

#include <fstream>

#include "limn/core/image.h"
#include "limn/core/parameter.h"
#include "limn/integrators/methods.h"
#include "tests/fuzz/nasty/nasty_mesh.h"

namespace limn::nasty {
namespace {

std::string xyz(const Vec3d& v) { return fmt::format("x=\"{}\" y=\"{}\" z=\"{}\"", v.x, v.y, v.z); }
std::string triple(const Vec3d& v) { return fmt::format("{}, {}, {}", v.x, v.y, v.z); }
std::string real(const char* name, double number) {
  return fmt::format("<float name=\"{}\" value=\"{}\"/>", name, number);
}
std::string whole(const char* name, int number) {
  return fmt::format("<integer name=\"{}\" value=\"{}\"/>", name, number);
}
std::string rgb(const char* name, const Vec3d& color) {
  return fmt::format("<rgb name=\"{}\" value=\"{}\"/>", name, triple(color));
}

class SceneWriter {
 public:
  SceneWriter(Die& die, std::string folder) : die_(die), folder_(std::move(folder)) {}

  std::string text() {
    std::string body;
    for (int i = die_.integer(1, 3); i > 0; --i) body += shape("");
    for (int i = die_.integer(0, 2); i > 0; --i) body += light();
    if (die_.chance(0.6)) body += sky();
    if (die_.chance(0.3)) body += copy_;
    return "<scene version=\"3.0.0\">\n" + integrator() + sensor() + body + "</scene>\n";
  }

 private:
  std::string id(const char* kind) { return fmt::format("{}{}", kind, count_++); }

  std::string integrator() {
    return "<integrator type=\"path\">" + whole("max_depth", die_.mostly({3, 2, 6, 1, 4, -1})) +
           whole("rr_depth", die_.pick({1, 2, 5, 1000})) +
           (die_.chance(0.1) ? "<boolean name=\"hide_emitters\" value=\"true\"/>" : "") +
           "</integrator>\n";
  }

  // Inside of things and on them, more often than not.
  Vec3d viewpoint() {
    switch (die_.integer(0, 4)) {
      case 0:
        return {};
      case 1:
        return {0, 0, 1};  // on a face of a cube
      case 2:
        return {1, 1, 1};
      case 3:
        return die_.in_cube(1);
      default:
        return die_.in_cube(1) + Vec3d{0, 1, 4};
    }
  }

  std::string sensor() {
    const Vec3d origin = viewpoint() * unit_, target = die_.in_cube(0.3) * unit_;
    std::string film =
        fmt::format("<film type=\"hdrfilm\">{}{}", whole("width", die_.integer(1, 4)),
                    whole("height", die_.integer(1, 4)));
    film += die_.pick<std::string>(
        {"<rfilter type=\"box\"/>", "<rfilter type=\"tent\"/>", "<rfilter type=\"gaussian\"/>"});
    return "<sensor type=\"perspective\">" +
           real("fov", die_.mostly({40.0, 90.0, 1.0, 1e-4, 179.9})) +
           real("near_clip", unit_ * die_.mostly({0.01, 1e-6, 1.0, 3.0, 1e-12, 1e-30})) +
           real("far_clip", unit_ * die_.mostly({1e3, 1e6, 4.0, 1e30, 1e300})) +
           fmt::format(
               "<transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" "
               "up=\"0.1, 1, 0.05\"/></transform>",
               triple(origin), triple(target)) +
           film + "</film></sensor>\n";
  }

  std::string bsdf() {
    const Vec3d color{die_.uniform(0, 1), die_.mostly({1.0, 0.0, 0.5}), die_.uniform(0, 1)};
    if (die_.chance(0.25)) return "<bsdf type=\"twosided\">" + one_sided(color) + "</bsdf>";
    if (die_.chance(0.1)) {
      const std::string front = one_sided(color);
      return "<bsdf type=\"twosided\">" + front + one_sided(color) + "</bsdf>";
    }
    return one_sided(color);
  }
  std::string one_sided(const Vec3d& color) {
    if (die_.chance(0.5)) {
      return fmt::format("<bsdf type=\"diffuse\" id=\"{}\">{}</bsdf>", id("matt"),
                         rgb("reflectance", color));
    }
    const std::string alpha = real("alpha", die_.mostly({0.2, 0.05, 1e-4, 1.0, 1e-2, 0.5}));
    return fmt::format(
        "<bsdf type=\"roughconductor\" id=\"{}\"><string name=\"distribution\" value=\"{}\"/>{}{}"
        "</bsdf>",
        id("gloss"), die_.chance(0.5) ? "ggx" : "beckmann", alpha,
        die_.chance(0.5) ? rgb("specular_reflectance", color) : "");
  }

  std::string transform() {
    std::string text = "<transform name=\"to_world\">";
    if (die_.chance(0.3)) {
      const double s = die_.mostly({0.5, 1e-3, 10.0, 1e-6, 1e-12, 1e3, 1e8});
      text += die_.chance(0.8)
                  ? fmt::format("<scale value=\"{}\"/>", s)
                  : fmt::format("<scale {}/>", xyz({1, s, die_.chance(0.5) ? -1. : 1.}));
    }
    if (die_.chance(0.5)) {
      text += fmt::format("<rotate {} angle=\"{}\"/>", xyz(die_.in_cube(1) + Vec3d{0.1, 0, 0}),
                          die_.mostly({30.0, 90.0, 180.0, 1e-6, 45.0}));
    }
    if (die_.chance(0.5)) {
      text += fmt::format("<translate {}/>",
                          xyz(die_.in_cube(1) * die_.mostly({1.0, 0.0, 1e-7, 1e3, 1e5, 1e10})));
    }
    if (unit_ != 1) text += fmt::format("<scale value=\"{}\"/>", unit_);
    return text + "</transform>";
  }

  // inner: an emitter, or nothing.
  std::string shape(const std::string& inner) {
    std::string text;
    if (die_.chance(0.3)) {
      text = fmt::format("<shape type=\"{}\" id=\"{}\">",
                         die_.pick({"rectangle", "cube", "sphere", "disk", "cylinder"}), "ID");
    } else {
      const std::string name = fmt::format("mesh{}.obj", count_++);
      std::ofstream(folder_ + "/" + name) << obj_text(nasty_mesh(die_));
      text = fmt::format(
          "<shape type=\"obj\" id=\"ID\"><string name=\"filename\" value=\"{}\"/><boolean "
          "name=\"face_normals\" value=\"{}\"/>",
          name, die_.chance(0.5));
    }
    if (die_.chance(0.1)) text += "<boolean name=\"flip_normals\" value=\"true\"/>";
    text += transform() + inner + (die_.chance(0.9) ? bsdf() : "") + "</shape>\n";
    const auto named = [&] {
      std::string result = text;
      return result.replace(result.find("\"ID\""), 4, "\"" + id("shape") + "\"");
    };
    // The same again, exactly, in the same place.
    if (copy_.empty() && inner.empty() && text.find("id=\"", text.find("ID\"") + 3) == text.npos) {
      copy_ = named();
    }
    return named();
  }

  std::string light() {
    const Vec3d color = Vec3d{1, 0.8, 0.6} * die_.mostly({5.0, 1.0, 1e-3, 1e6, 1e12, 0.0});
    const Vec3d at = (die_.in_cube(1) + Vec3d{0, 2, 0}) * unit_;
    const std::string to_world = fmt::format(
        "<transform name=\"to_world\"><lookat origin=\"{}\" target=\"{}\" up=\"0.1, 0.2, "
        "1\"/></transform>",
        triple(at), triple(die_.in_cube(0.5) * unit_));
    switch (die_.integer(0, 4)) {
      case 0:
        return fmt::format(
            "<emitter type=\"point\" id=\"{}\"><point name=\"position\" {}/>{}"
            "</emitter>\n",
            id("point"), xyz(at), rgb("intensity", color));
      case 1:
        return fmt::format("<emitter type=\"spot\" id=\"{}\">{}{}</emitter>\n", id("spot"),
                           to_world, rgb("intensity", color));
      case 2:
        return fmt::format(
            "<emitter type=\"directional\" id=\"{}\"><vector name=\"direction\" {}/>"
            "{}</emitter>\n",
            id("sun"), xyz({0.1, -1, 0.2}), rgb("irradiance", color));
      case 3: {
        const double size = unit_ * die_.mostly({0.3, 0.01, 1e-4, 1e-6, 3.0});
        return fmt::format(
            "<shape type=\"{}\" id=\"{}\"><transform name=\"to_world\"><scale value=\"{}\"/>"
            "<rotate x=\"1\" angle=\"{}\"/><translate {}/></transform>{}</shape>\n",
            die_.pick({"rectangle", "disk", "sphere", "cube"}), id("lamp"), size,
            die_.pick({90.0, 80.0}), xyz(at), area(color));
      }
      default:
        return shape(area(color));
    }
  }
  std::string area(const Vec3d& color) {
    return fmt::format("<emitter type=\"area\" id=\"{}\">{}</emitter>", id("glow"),
                       rgb("radiance", color));
  }

  std::string sky() {
    if (die_.chance(0.6)) {
      return fmt::format("<emitter type=\"constant\" id=\"sky\">{}</emitter>\n",
                         rgb("radiance", {0.4, 0.5, 0.7}));
    }
    Image map(die_.integer(1, 16), die_.integer(1, 9), 3);
    const double bright = die_.mostly({1.0, 0.0, 1e5});
    for (float& texel : map.data) texel = static_cast<float>(die_.uniform(0, 1));
    if (bright > 0) map.at(0, map.height / 2, 1) = static_cast<float>(bright);
    write_exr(folder_ + "/sky.exr", map, false, {});
    return fmt::format(
        "<emitter type=\"envmap\" id=\"sky\"><string name=\"filename\" value=\"sky.exr\"/>{}"
        "</emitter>\n",
        real("scale", die_.mostly({1.0, 0.0, 1e3})));
  }

  Die& die_;
  std::string folder_;
  // The length of one, for all of the scene.
  double unit_ = die_.mostly({1.0, 1.0, 1e-3, 1e3, 1e-8, 1e8, 1e-12, 1e11});
  int count_ = 0;
  std::string copy_;
};

// A number that the parameter's name stands for alone.
std::string scalar_of(Die& die, const Parameter& parameter, const std::string& folder) {
  if (parameter.size == 1) return parameter.name;
  const auto vertices = static_cast<int>(parameter.size / 3);
  if (die.chance(0.5)) {
    return fmt::format("{}.{}.{}", parameter.name, die.integer(0, vertices - 1),
                       die.pick({"x", "y", "z"}));
  }
  const std::string file = folder + "/velocities.txt";
  std::ofstream stream(file);
  // Mostly one velocity for all, so that copies of a vertex stay together.
  const Vec3d shared = die.in_cube(1);
  const bool single = die.chance(0.8);
  for (int i = 0; i < vertices; ++i) {
    const Vec3d v = single ? shared : die.in_cube(1);
    stream << fmt::format("{} {} {}\n", v.x, v.y, v.z);
  }
  return parameter.name + ":" + file;
}

}  // namespace

std::string write_scene(Die& die, const std::string& folder) {
  const std::string file = folder + "/scene.xml";
  std::ofstream(file) << SceneWriter(die, folder).text();
  return file;
}

Request nasty_request(Die& die, const Scene& scene, const std::string& folder) {
  Request request;
  const std::vector<Parameter> all = list_parameters(scene);
  for (int i = die.mostly({1, 2, 4, 5}); i > 0; --i)
    request.options.parameters.push_back(scalar_of(die, die.pick(all), folder));
  if (die.chance(0.5)) request.options.method = die.pick(method_names(Task::kGradient));
  if (die.chance(0.5)) request.options.samples = std::nullopt;
  request.settings.spp = die.mostly({2, 1, 4, 16, 17});
  request.settings.seed = static_cast<uint64_t>(die.integer(0, 1 << 20));
  request.settings.threads = die.integer(1, 2);
  return request;
}

}  // namespace limn::nasty
