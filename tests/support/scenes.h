#pragma once
// Small scenes for tests: XML put together from parts, and meshes written to files.
#include <string>

#include "limn/core/mesh.h"
#include "limn/core/scene.h"
#include "support/temp_files.h"

namespace limn {

struct SceneParts {
  int max_depth = 3;
  int rr_depth = 1000;
  bool hide_emitters = false;
  double unit = 1;  // length of one unit of the camera's positions in scene units
  Vec3d origin{0, 2, 6}, target{0, 0.5, 0};
  double fov = 40;
  int width = 16, height = 16;
  std::string film;  // further children of the film, e.g. a filter; a box if empty
  std::string body;  // shapes, bsdfs, emitters
};

// The whole file.
std::string scene_text(const SceneParts& parts);
Scene make_scene(const TempFiles& files, const SceneParts& parts);

// OBJ without normals; the vertices keep their order.
std::string write_mesh(const TempFiles& files, const std::string& name, const Mesh& mesh);

// An OBJ shape moved by `scale` and then by `offset`; `inner`: its bsdf or emitter.
std::string obj_shape(const std::string& id, const std::string& file, bool face_normals,
                      double scale, const Vec3d& offset, const std::string& inner);
// A square of half-width `size`, turned by `angle` degrees about x from facing +z, then moved.
std::string square(const std::string& id, double size, double angle, const Vec3d& offset,
                   const std::string& inner);
std::string diffuse(const std::string& id, const std::string& reflectance);
std::string area_light(const std::string& id, const std::string& radiance);
std::string constant_light(const std::string& id, const std::string& radiance);
std::string conductor(const std::string& id, double alpha);  // ggx, reflects everything

// A sky that differs in every direction, with one bright part; returns the emitter.
std::string make_sky(const TempFiles& files, const std::string& id);

// A body with a bit of everything: "ball" of "clay" over a "floor" of "gloss", with "lamp" ("glow")
// and "sky".
std::string ball_over_gloss(const TempFiles& files, double alpha);

}  // namespace limn
