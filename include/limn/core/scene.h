#pragma once
// A scene ready to render: plain data, validated. Differentiable numbers are stored as Duals whose
// derivatives are zero until a parameter is seeded (parameter.h).
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
#include "limn/core/matrix.h"
#include "limn/core/mesh.h"
#include "limn/core/texture.h"

namespace limn {

// How interpolated normals are used in scattering, see shading.h.
enum class ShadingModel {
  kContinuous,  // continuous in position and direction: gradients miss nothing
  kMitsuba,     // Mitsuba 3's convention, to compare images; gradients miss its discontinuities
};

struct Exposure;  // exposure.h

// The fixed point of a shape's rotations and scales, and the shape's size.
struct Pivot {
  Vec3d center;     // world space
  double size = 1;  // over the size as it was read, which is the unit of scales
};

struct Shape {
  std::string id;  // "" if the file gives none
  SourceLocation where;
  Mesh mesh;
  // As read: from the coordinates of the mesh's file, or of Mitsuba's shape of its kind (a sphere's
  // has center and radius); the identity for curves and for meshes that are set later.
  Matrix4 to_world;
  // None: the center of the mesh's bounds. The first motion as a whole (parameter.h) keeps where
  // that is, translations move it, and other meshes end it. So all motions since add up.
  std::optional<Pivot> pivot;
  std::shared_ptr<Bsdf> bsdf;  // never null; shared between shapes that refer to one element
  bool is_emitter = false;
  // Of an area emitter: emitted from the front of every face; of a textured one the mean.
  Rgb<Dual> radiance;
  std::shared_ptr<Texture> radiance_texture;  // null if `radiance` is the same everywhere
  std::string emitter_id;                     // "" if none
};

// What messages say of a max_depth that is out of range.
inline constexpr char kDepthRange[] = "must be -1 (no limit) or at least 1 (0 gives a black image)";

// The content of a <sensor> element.
struct Sensor {
  std::string id;  // "" if none
  Camera camera;
  Film film;
  int sample_count = 4;  // samples per pixel requested
  uint64_t seed = 0;
};

struct Scene {
  std::string file;
  std::vector<std::string> xml_files;   // the scene file and its includes
  std::vector<std::string> data_files;  // referenced meshes and images
  Camera camera;
  Film film;
  int max_depth = -1;  // as in Mitsuba: 1 emission only, 2 direct light, -1 unlimited
  int rr_depth = 5;    // depth at which Russian roulette starts
  bool hide_emitters = false;
  int sample_count = 4;  // samples per pixel that the sensor requests
  uint64_t seed = 0;
  // All sensors as read from the file. use_sensor() selects one as the scene's own; the first one
  // is selected by default.
  std::vector<Sensor> sensors;
  size_t sensor = 0;  // index of the selected one
  // How things move while a shutter is open; null where none is open for a while. The scene itself
  // is as it is at the exposure's reference time.
  std::shared_ptr<Exposure> exposure;
  ShadingModel shading = ShadingModel::kContinuous;
  double smooth_as = 0;  // the roughness that smooth lobes were read with; 0: they are smooth

  std::vector<Shape> shapes;
  std::shared_ptr<Environment> environment;  // null if none
  std::string environment_id;
  std::vector<std::shared_ptr<DeltaLight>> delta_lights;     // in the order of the file
  std::map<std::string, std::shared_ptr<Bsdf>> bsdfs_by_id;  // every bsdf element with an id

  const Shape& shape(ShapeId id) const { return shapes[id.index()]; }
};

// The first shape that has smooth lobes or that light passes; null if there is none.
const Shape* find_smooth(const Scene& scene);

// Bounds of all shapes; empty without shapes.
Bounds bounds_of(const Scene& scene);

// A copy that shares no mutable data with the original.
Scene deep_copy(const Scene& scene);

// Reads the subset of Mitsuba 3's XML format described in scenes/README.md. `defines` are the -D
// name=value pairs. InputError with file:line:col. Appends warnings (for example about faces
// removed from a mesh) to `warnings`. paths: directories where files are searched last. smooth_as:
// the roughness (GGX) of BSDFs whose lobes are smooth; 0: they stay so.
Scene read_scene(const std::string& file, const std::map<std::string, std::string>& defines,
                 std::vector<std::string>* warnings, const std::vector<std::string>& paths = {},
                 double smooth_as = 0);
// read_scene for XML in a string. File names are relative to `folder` ("": the working directory);
// errors are located in FOLDER/string.
Scene read_scene_text(const std::string& text, const std::string& folder,
                      const std::map<std::string, std::string>& defines,
                      std::vector<std::string>* warnings);

// Selects a sensor of the file by index or id: replaces camera, film, sample count and seed. An id
// that equals an index means the sensor of that index. InputError lists the sensors if there is
// none of this name.
void use_sensor(Scene& scene, const std::string& name);
// The indices and ids of all sensors, for example: 0, 1 or "side".
std::string sensor_names(const Scene& scene);
// The id of the selected sensor, or its index if it has no id.
std::string sensor_name(const Scene& scene);

// Gives the selected sensor, in `sensors`, too, a film of another size [pixels], as a change of
// film.size alone does in Mitsuba: what it sees across stays, so that files of this size are the
// same where fov_axis is x. InputError for crop windows, and for sizes that no film has.
void resize_film(Scene& scene, int width, int height);

// Number of sensors in a file. InputError for an invalid scene, without reading meshes or
// images.
size_t count_sensors(const std::string& file, const std::map<std::string, std::string>& defines,
                     const std::vector<std::string>& paths = {});

// Replaces a shape's mesh by positions (V by 3, scene units) and faces (F by 3). Flat shapes stay
// flat; others get computed normals. Warnings and InputError as in make_mesh().
void set_mesh(Scene& scene, ShapeId shape, std::vector<Vec3f> positions,
              std::vector<FaceIndices> faces, std::vector<std::string>* warnings);

// Sets Scene::shading, and how materials use normals of maps (Bsdf::set_mitsuba_shading).
void set_shading(Scene& scene, ShadingModel model);

}  // namespace limn
