// Gradients as files.
#include "tools/limn/backward_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "limn/core/error.h"
#include "limn/core/mesh.h"
#include "limn/core/parameter.h"
#include "limn/core/surface_point.h"
#include "tools/limn/command_support.h"
#include "tools/limn/table.h"

namespace limn {

namespace {

using nlohmann::json;

// V vectors and their standard errors; those of displacements lie along the vertices' normals.
struct VertexGradient {
  std::vector<Vec3d> mean, error;
};

VertexGradient of_vertices(const Mesh& mesh, const ParameterAdjoint& p) {
  const Moments& g = p.moments;
  VertexGradient vectors;
  if (p.shape.size() == 1) {
    const std::vector<Vec3d> directions = displacement_directions(mesh);
    for (size_t v = 0; v < g.size(); ++v) {
      const Vec3d& n = directions[v];
      vectors.mean.push_back(n * g.mean(v));
      const double e = std::sqrt(g.variance(v));
      vectors.error.push_back({std::fabs(n.x) * e, std::fabs(n.y) * e, std::fabs(n.z) * e});
    }
    return vectors;
  }
  for (size_t v = 0; v < g.size(); v += 3) {
    vectors.mean.push_back({g.mean(v), g.mean(v + 1), g.mean(v + 2)});
    vectors.error.push_back(
        {std::sqrt(g.variance(v)), std::sqrt(g.variance(v + 1)), std::sqrt(g.variance(v + 2))});
  }
  return vectors;
}

// Doubles in NumPy's format, version 1.0.
std::string npy_text(const ParameterAdjoint& p) {
  const Moments& g = p.moments;
  std::string header = fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}",
                                   fmt::join(p.shape, ", "));
  const size_t before = 10;  // magic, version, length
  header.append(63 - (before + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  append(bytes, static_cast<uint16_t>(header.size()));
  bytes += header;
  for (size_t i = 0; i < g.size(); ++i) append(bytes, g.mean(i));
  return bytes;
}

// As --wrt SHAPE.vertex_positions:FILE reads it.
std::string field_text(const VertexGradient& g) {
  std::string text;
  for (const Vec3d& x : g.mean) {
    text += fmt::format("{:.17g} {:.17g} {:.17g}\n", x.x, x.y, x.z);
  }
  return text;
}

// Of texels: H by W by 3.
Image to_map(const ParameterAdjoint& p, bool errors) {
  Image map(static_cast<int>(p.shape[1]), static_cast<int>(p.shape[0]), 3);
  for (size_t i = 0; i < map.data.size(); ++i) {
    const double v = errors ? std::sqrt(p.moments.variance(i)) : p.moments.mean(i);
    map.data[i] = static_cast<float>(v);
  }
  return map;
}

// What the middles of the film's pixels see: rays and hits, row by row.
struct View {
  explicit View(const Scene& scene) {
    const auto tracer = make_embree_tracer(scene, 1);
    const Film& film = scene.film;
    const auto width = static_cast<size_t>(film.crop_width);
    rays.resize(width * static_cast<size_t>(film.crop_height));
    hits.resize(rays.size());
    for (size_t i = 0; i < rays.size(); ++i) {
      rays[i] = scene.camera.ray<double>(film.crop_x + static_cast<double>(i % width) + 0.5,
                                         film.crop_y + static_cast<double>(i / width) + 0.5);
      Hit hit;
      const auto& ray = rays[i];
      if (tracer->closest({ray.origin, ray.direction, ray.t_min, ray.t_max}, hit)) hits[i] = hit;
    }
  }

  std::vector<CameraRay<double>> rays;
  std::vector<std::optional<Hit>> hits;
};

// The shape as the camera sees it, each point in the colour of the gradient along the normal: that
// of a vertex over the area around it, so that it says the same of any mesh.
Image picture(const Scene& scene, ShapeId shape, const VertexGradient& g, const View& view) {
  const Mesh& mesh = scene.shape(shape).mesh;
  std::vector<Vec3d> sum(mesh.positions.size()), normal(mesh.positions.size());
  std::vector<double> area(mesh.positions.size());
  for (size_t v = 0; v < mesh.positions.size(); ++v) sum[mesh.weld[v]] += g.mean[v];
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto c = face_corners<double>(mesh, FaceId(f));
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]) / 6;
    for (const uint32_t v : mesh.faces[f]) {
      normal[mesh.weld[v]] += n;
      area[mesh.weld[v]] += length(n);
    }
  }
  Image image(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < view.hits.size(); ++i) {
    const std::optional<Hit>& hit = view.hits[i];
    if (!hit || hit->face.shape != shape) continue;
    const auto c = face_corners<double>(mesh, hit->face.face);
    const Vec3d p = view.rays[i].origin + view.rays[i].direction * hit->t;
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    double value = 0;
    for (int k = 0; k < 3; ++k) {
      const Vec3d &a = c[(k + 1) % 3], &b = c[(k + 2) % 3];
      const double weight = dot(n, cross(a - p, b - p)) / dot(n, n);
      const uint32_t v = mesh.weld[mesh.face(hit->face.face)[k]];
      const double size = length(normal[v]);
      if (size > 0) value += weight * dot(sum[v], normal[v]) / (size * area[v]);
    }
    std::fill_n(image.data.begin() + static_cast<ptrdiff_t>(3 * i), 3, static_cast<float>(value));
  }
  return image;
}

double norm(const Moments& g) {
  double sum = 0;
  for (size_t i = 0; i < g.size(); ++i) sum += g.mean(i) * g.mean(i);
  return std::sqrt(sum);
}

// Of the whole array: the root of the summed variances.
double error_of(const Moments& g) {
  double sum = 0;
  for (size_t i = 0; i < g.size(); ++i) sum += g.variance(i);
  return std::sqrt(sum);
}

std::string six_digits(double value) { return fmt::format("{:.6g}", value); }
std::string error_cell(double error) {
  return std::isfinite(error) ? fmt::format("{:.2g}", error) : "-";
}

// A number, or the channels of a colour.
json write_numbers(const ParameterAdjoint& p, Table& table) {
  json values = json::array(), errors = json::array();
  for (size_t i = 0; i < p.moments.size(); ++i) {
    const double value = p.moments.mean(i), error = std::sqrt(p.moments.variance(i));
    values.push_back(value);
    errors.push_back(number(error));
    table.add({p.shape.empty() ? p.name : p.name + "." + "rgb"[i], p.unit, six_digits(value),
               error_cell(error), ""});
  }
  const bool one = p.shape.empty();
  json entry = {{"name", p.name},
                {"unit", p.unit},
                {"value", one ? values[0] : values},
                {"stderr", one ? errors[0] : errors}};
  if (!one) entry["shape"] = p.shape;
  return entry;
}

// What both kinds of arrays have.
json describe_array(const ParameterAdjoint& p, const BackwardFiles::Array& array, double scale,
                    const std::string& main_file, Table& table) {
  table.add({p.name, p.unit, six_digits(norm(p.moments)), error_cell(error_of(p.moments)),
             main_file + " (norm of the array)"});
  return {{"name", p.name},
          {"unit", p.unit},
          {"shape", p.shape},
          {"norm", norm(p.moments)},
          {"stderr", number(error_of(p.moments))},
          {"array", array.npy},
          {"picture", array.png},
          {"scale", scale}};
}

json write_vertices(const Scene& scene, const ParameterAdjoint& p,
                    const BackwardFiles::Array& array, const View& view, Table& table) {
  const VertexGradient gradient = of_vertices(scene.shape(array.shape).mesh, p);
  const Image image = picture(scene, array.shape, gradient, view);
  const double scale = signed_scale(image);
  write_file(array.ply, ply_text(scene.shape(array.shape).mesh,
                                 {{"g", gradient.mean}, {"e", gradient.error}}));
  write_file(array.npy, npy_text(p));
  write_file(array.txt, field_text(gradient));
  write_signed_png(array.png, image, scale);
  json entry = describe_array(p, array, scale, array.ply, table);
  entry["mesh"] = array.ply;
  entry["field"] = array.txt;
  return entry;
}

// A field that --wrt EMITTER.data:FILE reads.
json write_texels(const ParameterAdjoint& p, const BackwardFiles::Array& array, Table& table) {
  const Image map = to_map(p, false);
  const double scale = signed_scale(map);
  write_exr(array.exr, map, false, {});
  if (p.moments.batches() > 1) write_exr(array.stderr_exr, to_map(p, true), false, {});
  write_file(array.npy, npy_text(p));
  write_signed_png(array.png, map, scale);
  json entry = describe_array(p, array, scale, array.exr, table);
  entry["field"] = array.exr;
  return entry;
}

}  // namespace

std::vector<PlannedFile> BackwardFiles::planned(const std::string& also) const {
  std::vector<PlannedFile> files{{"-o", json}, {"-o", adjoint}, {"-o", adjoint_picture}};
  for (const Array& array : arrays) {
    for (const std::string& file :
         {array.ply, array.npy, array.txt, array.png, array.exr, array.stderr_exr})
      if (!file.empty()) files.push_back({"-o, --wrt " + array.parameter, file});
  }
  files.push_back({"--json", also});
  return files;
}

BackwardFiles plan_files(const Scene& scene, const std::vector<std::string>& parameters,
                         const std::string& folder) {
  const auto in_folder = [&](const std::string& name) {
    return (std::filesystem::path(folder) / name).string();
  };
  BackwardFiles files;
  files.json = in_folder("gradient.json");
  files.adjoint = in_folder("adjoint.exr");
  files.adjoint_picture = in_folder("adjoint.png");
  const auto add = [&](const Parameter& parameter) {
    if (parameter.size == 1) return;
    const std::string name = file_part(parameter.name);
    if (parameter.array.size() == 3) {
      files.arrays.push_back({parameter.name, ShapeId(), "", in_folder(name + ".npy"), "",
                              in_folder(name + ".png"), in_folder(name + ".exr"),
                              in_folder(name + "_stderr.exr")});
      return;
    }
    for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
      if (parameter.velocities(scene, ShapeId(s)).empty()) continue;
      files.arrays.push_back({parameter.name, ShapeId(s), in_folder(name + ".ply"),
                              in_folder(name + ".npy"), in_folder(name + ".txt"),
                              in_folder(name + ".png"), "", ""});
    }
  };
  for (const std::string& name : parameters) add(find_parameter_or_array(scene, name));
  if (parameters.empty()) {
    for (const Parameter& parameter : list_parameters(scene)) {
      if (!parameter.repeats) add(parameter);
    }
  }
  return files;
}

json write_parameters(const Scene& scene, const BackwardFiles& files, const BackwardResult& result,
                      bool quiet) {
  const View view(scene);
  std::map<std::string, const BackwardFiles::Array*> arrays;
  for (const auto& array : files.arrays) arrays.emplace(array.parameter, &array);
  Table table(
      {{"parameter", true}, {"unit", true}, {"derivative"}, {"std. error"}, {"file", true}});
  json list = json::array();
  for (const ParameterAdjoint& p : result.parameters) {
    const auto at = arrays.find(p.name);
    if (at == arrays.end()) {
      list.push_back(write_numbers(p, table));
    } else if (at->second->shape.valid()) {
      list.push_back(write_vertices(scene, p, *at->second, view, table));
    } else {
      list.push_back(write_texels(p, *at->second, table));
    }
  }
  if (!quiet) fmt::print("\n{}\n", table.text());
  return list;
}

}  // namespace limn
