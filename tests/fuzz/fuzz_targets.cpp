// Each reader of files, called with bytes, and what must hold of the result.
#include "fuzz/fuzz_targets.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "limn/core/image.h"
#include "limn/core/mesh.h"
#include "limn/core/scene.h"
#include "src/light/environment_map.h"
#include "src/mesh/mesh_file.h"
#include "src/scene_file/spectrum.h"

namespace limn {

namespace {

void demand(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

// A folder in memory, where there is one, for as long as the process lives.
class Folder {
 public:
  Folder() {
    const std::filesystem::path memory = "/dev/shm";
    const auto parent =
        std::filesystem::exists(memory) ? memory : std::filesystem::temp_directory_path();
    path_ = parent / ("limn_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(path_);
    // What scenes may refer to.
    write("a.obj", text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
    write("part.xml", text("<scene version=\"3.0.0\"><shape type=\"cube\"/></scene>"));
    Image sky(2, 2, 3);
    sky.data.assign(sky.data.size(), 1.0f);
    write_exr((path_ / "a.exr").string(), sky, true, {});
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string write(const char* name, Bytes bytes) const {
    const std::string file = (path_ / name).string();
    std::ofstream stream(file, std::ios::binary);
    stream.write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
    stream.close();
    demand(stream.good(), "the input can be written");
    return file;
  }

 private:
  static Bytes text(const char* text) {
    return {reinterpret_cast<const uint8_t*>(text), std::strlen(text)};
  }
  std::filesystem::path path_;
};

std::string written(const char* name, Bytes bytes) {
  static const Folder folder;
  return folder.write(name, bytes);
}

template <class V>
bool is_finite(const V& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void check_mesh(const Mesh& mesh) {
  demand(!mesh.faces.empty(), "a mesh has faces");
  demand(mesh.weld.size() == mesh.positions.size(), "as many welds as positions");
  for (const Vec3f& p : mesh.positions) demand(is_finite(p), "positions are finite");
  for (const FaceIndices& face : mesh.faces)
    for (const uint32_t v : face) demand(v < mesh.positions.size(), "vertices exist");
  for (const Vec3d& n : mesh.normals)
    demand(std::fabs(length(n) - 1) < 1e-9, "normals have the length 1");
  demand(mesh.normals.empty() || mesh.normal_ids.size() == mesh.faces.size(), "normals of faces");
  for (const FaceIndices& ids : mesh.normal_ids)
    for (const uint32_t n : ids) demand(n < mesh.normals.size(), "normals exist");
}

void run_xml(Bytes bytes) {
  const std::string file = written("scene.xml", bytes);
  try {
    std::vector<std::string> warnings;
    const Scene scene = read_scene(file, {}, &warnings);
    demand(scene.camera.width > 0 && scene.camera.height > 0 && scene.sample_count > 0,
           "a film has pixels and samples");
    for (const Shape& shape : scene.shapes) {
      demand(shape.bsdf != nullptr, "a shape has a bsdf");
      check_mesh(shape.mesh);
    }
  } catch (const InputError&) {
  }
}

void run_mesh(const char* name, Bytes bytes) {
  const std::string file = written(name, bytes);
  for (const bool face_normals : {false, true}) {
    try {
      check_mesh(read_mesh(file, face_normals));
    } catch (const InputError&) {
    }
  }
}
void run_obj(Bytes bytes) { run_mesh("mesh.obj", bytes); }
void run_ply(Bytes bytes) { run_mesh("mesh.ply", bytes); }

// The first meshes of a file.
void run_serialized(Bytes bytes) {
  const std::string file = written("mesh.serialized", bytes);
  for (const int64_t index : {0, 1, 2}) {
    try {
      check_mesh(build_mesh(parse_serialized(file, index).mesh, {}, nullptr));
    } catch (const InputError&) {
    }
  }
}

void run_spectrum(Bytes bytes) {
  const std::string text(bytes.begin(), bytes.end());
  const std::string file = written("a.spd", bytes);
  for (const bool from_file : {false, true}) {
    try {
      const auto samples = from_file ? read_spectrum_file(file) : parse_spectrum(text, {"a"});
      for (const ColourUse use :
           {ColourUse::kReflectance, ColourUse::kUnbounded, ColourUse::kEmission}) {
        const Rgb<double> c = integrate_spectrum(samples, use);
        for (int i = 0; i < 3; ++i) demand(std::isfinite(c[i]) && c[i] >= 0, "colours are finite");
      }
    } catch (const InputError&) {
    }
  }
}

void run_velocity(Bytes bytes) {
  const std::string file = written("velocity.txt", bytes);
  try {
    for (const Vec3d& v : read_vertex_vectors(file)) demand(is_finite(v), "vectors are finite");
  } catch (const InputError&) {
  }
}

void run_exr(Bytes bytes) {
  const std::string file = written("image.exr", bytes);
  try {
    const Image image = read_exr(file);
    demand(image.width > 0 && image.height > 0, "an image has pixels");
    demand(image.channels == 1 || image.channels == 3, "an image has one channel or three");
    demand(image.data.size() == size_t{1} * image.width * image.height * image.channels,
           "an image has its values");
  } catch (const InputError&) {
  }
  try {
    read_exr_attributes(file);
  } catch (const InputError&) {
  }
}

void run_image(const char* name, Bytes bytes) {
  const std::string file = written(name, bytes);
  try {
    const StoredImage image = read_stored_image(file);
    demand(image.width > 0 && image.height > 0, "an image has pixels");
    demand(image.channels == 1 || image.channels == 3, "an image has one channel or three");
    demand(image.bytes.size() + image.floats.size() ==
               size_t{1} * image.width * image.height * image.channels,
           "an image has its values");
    for (const float v : read_image(file).data) demand(v >= 0 && std::isfinite(v), "values");
  } catch (const InputError&) {
  }
}
void run_png(Bytes bytes) { run_image("image.png", bytes); }
void run_jpeg(Bytes bytes) { run_image("image.jpg", bytes); }
void run_rgbe(Bytes bytes) { run_image("image.hdr", bytes); }
void run_bmp(Bytes bytes) { run_image("image.bmp", bytes); }

// A width, a channel count and the texels, as many rows as come.
void run_environment(Bytes bytes) {
  if (bytes.size() < 2) return;
  const int width = 1 + bytes[0] % 64, channels = bytes[1] % 2 ? 3 : 1;
  const size_t row = static_cast<size_t>(width) * channels * sizeof(float);
  const auto height = static_cast<int>((bytes.size() - 2) / row);
  if (height == 0) return;
  Image image(width, height, channels);
  std::memcpy(image.data.data(), bytes.data() + 2, height * row);
  for (const float v : image.data)
    if (!std::isfinite(v)) return;  // refused by the reader of the emitter
  const EnvironmentMap map(image);
  demand(std::isfinite(map.mean_luminance()), "a mean is finite");
  using Follows = EnvironmentMap::Follows;
  for (const Follows follows : {Follows::kRadiance, Follows::kPeaks}) {
    const MapDensity& density = map.density(follows);
    for (int first = 0; first < 16; first += wide::kWidth) {
      const EnvironmentMap::Drawn drawn =
          map.sample(density, wide::gather([&](int k) { return (first + k + 0.5) / 16; }),
                     wide::gather([&](int k) { return (7 * (first + k) % 16 + 0.5) / 16; }));
      for (int k = 0; k < wide::kWidth; ++k) {
        demand(is_finite(wide::lane(drawn.direction, k)), "a direction is finite");
        demand(drawn.pdf[k] > 0 && std::isfinite(drawn.pdf[k]), "what is drawn has a density");
      }
    }
  }
}

}  // namespace

const FuzzTarget kAllFuzzTargets[kFuzzTargets] = {{"xml", run_xml},
                                                  {"obj", run_obj},
                                                  {"ply", run_ply},
                                                  {"exr", run_exr},
                                                  {"velocity", run_velocity},
                                                  {"environment", run_environment},
                                                  {"serialized", run_serialized},
                                                  {"spectrum", run_spectrum},
                                                  {"png", run_png},
                                                  {"jpeg", run_jpeg},
                                                  {"rgbe", run_rgbe},
                                                  {"bmp", run_bmp}};

const FuzzTarget& fuzz_target(const std::string& name) {
  for (const FuzzTarget& target : kAllFuzzTargets)
    if (target.name == name) return target;
  std::abort();
}

}  // namespace limn
