#pragma once
// A scene ready to render: plain data with checked values. Every differentiable number is stored as
// a Dual whose derivative lanes are zero until a parameter is seeded (parameter.h).
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/bsdf.h"
#include "limn/core/camera.h"
#include "limn/core/environment.h"
#include "limn/core/error.h"
#include "limn/core/film.h"
#include "limn/core/mesh.h"

namespace limn {

// How interpolated normals enter the scattering function, see shading.h.
enum class ShadingModel {
  kContinuous,  // continuous in position and directions: gradients have no hidden jumps
  kMitsuba,  // Mitsuba 3's convention, for comparing images; its jumps are missing from gradients
};

struct Shape {
  std::string id;  // "" if the file gives none
  SourceLocation where;
  Mesh mesh;
  std::shared_ptr<Bsdf> bsdf;  // never null; shared between shapes that refer to one element
  bool is_emitter = false;
  Rgb<Dual> radiance;      // of an area emitter: from the front of every face
  std::string emitter_id;  // "" if none
};

// What a <sensor> element says.
struct Sensor {
  std::string id;  // "" if none
  Camera camera;
  Film film;
  int sample_count = 4;  // samples per pixel that it asks for
  uint64_t seed = 0;
};

struct Scene {
  std::string file;
  std::vector<std::string> xml_files;   // the file and what it includes
  std::vector<std::string> data_files;  // meshes and images that it mentions
  Camera camera;
  Film film;
  int max_depth = -1;  // as in Mitsuba: 1 emission only, 2 direct light, -1 no limit
  int rr_depth = 5;    // Russian roulette from this depth on
  bool hide_emitters = false;
  int sample_count = 4;  // samples per pixel that the sensor asks for
  uint64_t seed = 0;
  // Of the file, as they were read: use_sensor() makes one of them the scene's, at first that in
  // front.
  std::vector<Sensor> sensors;
  size_t sensor = 0;  // the one that is the scene's
  ShadingModel shading = ShadingModel::kContinuous;

  std::vector<Shape> shapes;
  std::shared_ptr<Environment> environment;  // null if none
  std::string environment_id;
  std::vector<std::shared_ptr<DeltaLight>> delta_lights;     // in the order of the file
  std::map<std::string, std::shared_ptr<Bsdf>> bsdfs_by_id;  // every bsdf element with an id

  const Shape& shape(ShapeId id) const { return shapes[id.index()]; }
};

// Of all shapes; empty if there is none.
Bounds bounds_of(const Scene& scene);

// A copy that shares nothing mutable with the original.
Scene deep_copy(const Scene& scene);

// Reads the subset of Mitsuba 3's XML that scenes/README.md describes. `defines` are the -D
// name=value pairs. Throws InputError with file:line:col. Warnings (for example about faces left
// out of a mesh) are appended to `warnings`.
Scene read_scene(const std::string& file, const std::map<std::string, std::string>& defines,
                 std::vector<std::string>* warnings);
// The same from the XML itself. Files that it names are looked for in `folder` ("": where the
// program runs); the file of places in errors is FOLDER/string.
Scene read_scene_text(const std::string& text, const std::string& folder,
                      const std::map<std::string, std::string>& defines,
                      std::vector<std::string>* warnings);

// Camera, film, samples and seed become those of a sensor of the file, named by its number from 0
// or its id; an id that is a sensor's number stands for that one. InputError that lists them if
// there is none.
void use_sensor(Scene& scene, const std::string& name);
// Their numbers and ids, as in: 0, 1 or "side".
std::string sensor_names(const Scene& scene);
// Of the scene's own: its id, or its number where it has none.
std::string sensor_name(const Scene& scene);

// How many sensors a file has. InputError where it is no scene as far as that is looked at: no mesh
// or image is read.
size_t count_sensors(const std::string& file, const std::map<std::string, std::string>& defines);

// Gives a shape another mesh: positions (V by 3, scene units) and faces (F by 3, into them). Flat
// shapes stay flat, all others get computed normals. Warnings and InputError as make_mesh().
void set_mesh(Scene& scene, ShapeId shape, std::vector<Vec3f> positions,
              std::vector<FaceIndices> faces, std::vector<std::string>* warnings);

}  // namespace limn
