// Builds the scene from its description.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>

#include "limn/core/face_overlaps.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/memory.h"
#include "limn/core/mesh_attribute.h"
#include "limn/core/names.h"
#include "limn/core/scene.h"
#include "src/mesh/curves.h"
#include "src/mesh/mesh_build.h"
#include "src/mesh/mesh_file.h"
#include "src/mesh/shapes.h"
#include "src/scene_file/scene_properties.h"
#include "src/scene_file/scene_sensor.h"

namespace limn {

namespace {

class SceneBuilder {
 public:
  SceneBuilder(const SceneDescription& description, ErrorList& errors,
               std::vector<std::string>* warnings, double smooth_as)
      : description_(description),
        errors_(errors),
        warnings_(warnings ? *warnings : unread_warnings_),
        make_nested_{[this](const ObjectDescription& object) { return bsdf(object); },
                     [this](const ObjectDescription& object) { return texture(object); },
                     smooth_as,
                     {}} {}

  Scene build() {
    scene_.file = description_.file;
    scene_.xml_files = description_.files;
    scene_.smooth_as = make_nested_.smooth_as;
    exposure_.reference = reference_time(description_);
    warnings_.insert(warnings_.end(), description_.warnings.begin(), description_.warnings.end());
    for (const auto& object : description_.objects) {
      if (object->failed) make_bsdfs_in(*object);
      instance_ = {};
      in_instance_ = false;
      errors_.keep([&] {
        read_once(*object, [&] {
          add(*object);
          note_data_file(*object);
        });
      });
    }
    // Unused BSDFs are built, too, since they may contain errors and their ids count.
    for (const auto& object : description_.objects) {
      if (object->tag == "bsdf") errors_.keep([&] { bsdf(*object); });
    }
    errors_.throw_any();
    if (scene_.sensors.empty()) {
      throw InputError(description_.where,
                       "<scene>: there is no sensor; limn renders with the scene's own: add one");
    }
    use_sensor(scene_, "0");
    add_exposure();
    if (const auto& media = description_.media; !media.empty()) {
      warnings_.push_back(format_warning(
          media.front(),
          fmt::format("media are ignored, as by Mitsuba's path: {} from here on", media.size())));
    }
    if (&warnings_ != &unread_warnings_) warn_of_overlaps(scene_, warnings_);
    return std::move(scene_);
  }

 private:
  // Runs a step that reads `object`. One that failed is neither read again nor reported again.
  template <class Step>
  static void read_once(const ObjectDescription& object, const Step& step) {
    if (object.failed) throw InputErrors();
    try {
      step();
    } catch (const InputError&) {
      object.failed = true;
      throw;
    }
  }

  // For their errors: of an object that failed before it was built.
  void make_bsdfs_in(const ObjectDescription& object) {
    for (const ChildDescription& child : object.children) {
      if (child.object->tag == "bsdf") errors_.keep([&] { bsdf(*child.object); });
    }
  }

  void add(const ObjectDescription& object) {
    if (object.tag == "integrator") {
      only_one(object, "integrator", integrator_);
      read_integrator(object, description_, scene_, warnings_);
    } else if (object.tag == "sensor" && object.type == "batch") {
      add_batch(object);
    } else if (object.tag == "sensor") {
      scene_.sensors.push_back(read_sensor(object, description_, exposure_, warnings_));
    } else if (object.tag == "shape" && object.type == "shapegroup") {
      check_group(object);
    } else if (object.tag == "shape" && object.type == "instance") {
      add_instance(object);
    } else if (object.tag == "shape") {
      add_shape(object, object.id);
    } else if (object.tag == "emitter" && !is_for_shapes(object)) {
      add_light(object);
    } else if (object.tag != "bsdf" && object.id.empty()) {
      throw InputError(object.where, "<scene>: a " + object.tag + " here needs an id, for <ref>");
    }
  }

  // An area emitter with an id may stand under <scene> for shapes that refer to it.
  static bool is_for_shapes(const ObjectDescription& object) {
    return object.type == "area" && !object.id.empty();
  }

  void note_data_file(const ObjectDescription& object) {
    DescribedProperties p(object, description_, make_nested_);
    if (p.has("filename")) scene_.data_files.push_back(p.file("filename"));
  }

  // Its sensors, one by one: an image each.
  void add_batch(const ObjectDescription& object) {
    DescribedProperties p(object, description_, make_nested_);
    const std::vector<const ObjectDescription*> sensors = p.all_nested("sensor");
    const SharedParts shared{p.nested("film"), p.nested("sampler"),
                             static_cast<int>(sensors.size())};
    p.check_all_used();
    if (sensors.empty()) p.fail("needs sensors");
    for (const ObjectDescription* sensor : sensors) {
      if (sensor->type == "batch") p.fail("a batch cannot contain a batch");
      scene_.sensors.push_back(read_sensor(*sensor, description_, exposure_, warnings_, shared));
    }
  }

  static void only_one(const ObjectDescription& object, const std::string& what,
                       const ObjectDescription*& earlier) {
    if (earlier) {
      throw InputError(object.where, "a second " + what + ": the first is at " +
                                         earlier->where.file + ":" +
                                         std::to_string(earlier->where.line) + ":" +
                                         std::to_string(earlier->where.column));
    }
    earlier = &object;
  }

  // One object per element, shared by all references to it.
  std::shared_ptr<Bsdf> bsdf(const ObjectDescription& object) {
    if (object.failed) throw InputErrors();
    const auto [entry, is_new] = bsdfs_.try_emplace(&object);
    if (!is_new) {
      if (!entry->second) throw InputError(object.where, "the bsdf contains itself");
      return entry->second;
    }
    constexpr int kMaxDepth = 64;  // not tuned: far below what the stack takes
    if (bsdf_depth_ == kMaxDepth) {
      object.failed = true;
      throw InputError(object.where, "bsdfs are nested more than 64 deep");
    }
    ++bsdf_depth_;
    try {
      bsdfs_[&object] = make_bsdf_of(object);
    } catch (const InputError&) {
      object.failed = true;
      --bsdf_depth_;
      throw;
    }
    --bsdf_depth_;
    return bsdfs_[&object];
  }

  std::shared_ptr<Bsdf> make_bsdf_of(const ObjectDescription& object) {
    DescribedProperties p(object, description_, make_nested_);
    std::shared_ptr<Bsdf> made = make_bsdf(p);
    p.check_all_used();
    for (int k = 0; k < made->texture_count() && object.type == "diffuse"; ++k) {
      if (made->texture(k).range().most > 1) {
        warnings_.push_back(
            format_warning(p.where("reflectance"), "the texture reflects more than it receives"));
      }
    }
    if (object.type == "bumpmap") {
      warnings_.push_back(format_warning(
          object.where, "bumpmap: derivatives of what moves take its normals as constants"));
    }
    if (!object.id.empty()) scene_.bsdfs_by_id[object.id] = made;
    return made;
  }

  // Every BSDF has textures of its own: copies of one that is read once, with the same texels.
  std::shared_ptr<Texture> texture(const ObjectDescription& object) {
    std::shared_ptr<Texture>& made = textures_[&object];
    if (!made) {
      read_once(object, [&] {
        note_data_file(object);
        DescribedProperties p(object, description_, make_nested_);
        std::shared_ptr<Texture> read = make_texture(p);
        p.check_all_used();
        made = read;
      });
    }
    return made->clone();
  }

  void add_light(const ObjectDescription& object) {
    DescribedProperties p(object, description_, make_nested_);
    const auto before = scene_.environment;
    read_light(p, scene_, nullptr);
    check_light(p);
    if (scene_.environment == before) return;
    only_one(object, "environment", environment_);
    scene_.environment_id = object.id;
  }

  static void check_light(DescribedProperties& p) {
    p.number("sampling_weight", 1);  // changes the noise alone
    p.check_all_used();
  }

  void read_nested_light(const ObjectDescription& object, Shape& shape) {
    read_once(object, [&] {
      DescribedProperties p(object, description_, make_nested_);
      read_light(p, scene_, &shape);
      check_light(p);
    });
  }

  MeshOptions read_mesh_options(DescribedProperties& p, bool from_file) {
    MeshOptions options;
    Course own;
    options.to_world = instance_ * read_course(p, exposure_.reference, own);
    if (!own.keyframes.empty() && in_instance_) {
      p.fail("to_world", "shapes of a group move with their instance: put the animation there");
    }
    if (!in_instance_) course_ = std::move(own);
    try {
      options.to_world.inverse();
    } catch (const std::domain_error&) {
      p.fail("to_world", "the transform is not invertible: it flattens the shape");
    }
    options.flip_normals = p.boolean("flip_normals", false);
    p.number("silhouette_sampling_weight", 1);  // changes the noise of Mitsuba's derivatives
    if (from_file) {
      options.face_normals = p.boolean("face_normals", false);
    }
    return options;
  }

  // Reads the shape's mesh in object space; sets `options`.
  RawMesh read_geometry(DescribedProperties& p, MeshOptions& options) {
    const std::string& type = p.type();
    if (type == "obj" || type == "ply" || type == "serialized") return read_file(p, options);
    options = read_mesh_options(p, false);
    // Flat shapes use face normals. A mirrored flat shape keeps its outside, as in Mitsuba, which
    // transforms the normals.
    const bool curves = type == "bsplinecurve" || type == "linearcurve";
    options.face_normals = type != "sphere" && type != "cylinder" && !curves;
    if (options.face_normals && mirrors(options.to_world)) {
      options.flip_normals = !options.flip_normals;
    }
    if (type == "rectangle") return make_rectangle();
    if (type == "cube") return make_cube();
    if (type == "disk") return make_disk();
    if (type == "cylinder") return read_cylinder(p, options);
    if (type == "sphere") return read_sphere(p, options);
    if (curves) return read_curves(p, options);
    throw InputError(p.where(), unknown_type("shape", type,
                                             {"bsplinecurve", "cube", "cylinder", "disk",
                                              "instance", "linearcurve", "obj", "ply", "rectangle",
                                              "serialized", "shapegroup", "sphere"}));
  }

  RawMesh read_file(DescribedProperties& p, MeshOptions& options) {
    const std::string file = p.file("filename");
    options = read_mesh_options(p, true);
    RawMesh raw;
    if (p.type() == "serialized") {
      const int64_t index = p.integer("shape_index", 0);
      if (index < 0) p.fail("shape_index", "must not be negative");
      SerializedMesh read = parse_serialized(file, index);
      options.face_normals = options.face_normals || read.face_normals;
      raw = std::move(read.mesh);
    } else {
      raw = p.type() == "obj" ? parse_obj(file) : parse_ply(file);
    }
    if (p.boolean("flip_tex_coords", p.type() == "obj")) {
      for (Vec3f& uv : raw.uv_places) uv.y = 1 - uv.y;
    }
    return raw;
  }

  // Mitsuba's spheres and cylinders stay round under any transform.
  void warn_if_stretched(const DescribedProperties& p, const Matrix4& to_world, int axes) {
    constexpr double kRounding = 1e-5;  // of matrices written with six digits
    double least = std::numeric_limits<double>::infinity(), most = 0;
    for (int k = 0; k < axes; ++k) {
      const double size = std::hypot(to_world.m[0][k], to_world.m[1][k], to_world.m[2][k]);
      least = std::min(least, size);
      most = std::max(most, size);
    }
    if (most <= least * (1 + kRounding)) return;
    warnings_.push_back(format_warning(
        p.where("to_world"), "to_world stretches the " + p.type() + ", which Mitsuba keeps round"));
  }

  // A cylinder about the axis from p0 to p1.
  RawMesh read_cylinder(DescribedProperties& p, MeshOptions& options) {
    const double radius = p.number("radius", 1);
    if (!(radius > 0)) p.fail("radius", "must be positive");
    const Vec3d p0 = p.point("p0", {}), axis = p.point("p1", {0, 0, 1}) - p0;
    if (!(length(axis) > 0)) p.fail("p0 and p1 coincide");
    const Frame frame(normalize(axis));
    const Vec3d columns[4] = {frame.s * radius, frame.t * radius, axis, p0};
    Matrix4 place;
    for (int column = 0; column < 4; ++column) {
      for (int row = 0; row < 3; ++row) place.m[row][column] = columns[column][row];
    }
    if (mirrors(options.to_world)) options.flip_normals = !options.flip_normals;  // as in Mitsuba
    options.to_world = options.to_world * place;
    warn_if_stretched(p, options.to_world, 2);
    return make_cylinder();
  }

  RawMesh read_sphere(DescribedProperties& p, MeshOptions& options) {
    const double radius = p.number("radius", 1);
    if (!(radius > 0)) p.fail("radius", "must be positive");
    const Vec3d center = p.point("center", {});
    Matrix4 place;
    for (int i = 0; i < 3; ++i) {
      place.m[i][i] = radius;
      place.m[i][3] = center[i];
    }
    if (mirrors(options.to_world)) options.flip_normals = !options.flip_normals;  // as in Mitsuba
    options.to_world = options.to_world * place;
    warn_if_stretched(p, options.to_world, 3);
    return make_sphere();
  }

  // Tubes about curves, in world space: their radii are not transformed.
  static RawMesh read_curves(DescribedProperties& p, MeshOptions& options) {
    const bool spline = p.type() == "bsplinecurve";
    const auto curves = parse_curves(p.file("filename"), spline ? 4 : 2, options.to_world);
    options.to_world = {};
    RawMesh raw = spline ? make_spline_tubes(curves) : make_linear_tubes(curves);
    raw.where = {p.file("filename")};
    return raw;
  }

  // Checks the free memory for shapes, at intervals.
  void check_memory(const RawMesh& raw) {
    // Memory of mesh, ray tracer and image, measured at 0.2 and 1 million faces. Edges take more.
    constexpr double kBytesPerFace = 180;
    constexpr double kWorthAsking = 1e8;
    unasked_ += kBytesPerFace * static_cast<double>(raw.faces.size());
    if (unasked_ < kWorthAsking) return;
    require_memory(raw.where, unasked_, "the shapes up to here", "use fewer, or coarser ones");
    unasked_ = 0;
  }

  // The shapes of a group wait for instances.
  std::vector<const ObjectDescription*> check_group(const ObjectDescription& group) {
    DescribedProperties p(group, description_, make_nested_);
    const std::vector<const ObjectDescription*> shapes = p.all_nested("shape");
    p.check_all_used();
    for (const ObjectDescription* shape : shapes) {
      if (shape->type == "shapegroup" || shape->type == "instance") {
        throw InputError(shape->where, "a shapegroup takes no " + shape->type);
      }
    }
    return shapes;
  }

  // Copies the shapes of a group. Those of its second instance have ids that end in ".2", ...
  void add_instance(const ObjectDescription& object) {
    DescribedProperties p(object, description_, make_nested_);
    course_ = {};
    const Matrix4 to_world = read_course(p, exposure_.reference, course_);
    const std::vector<const ObjectDescription*> groups = p.all_nested("shape");
    p.check_all_used();
    if (groups.size() != 1 || groups[0]->type != "shapegroup") p.fail("needs one shapegroup");
    const int number = ++instances_[groups[0]];
    instance_ = to_world;
    in_instance_ = true;
    for (const ObjectDescription* shape : check_group(*groups[0])) {
      const std::string suffix = number == 1 ? "" : "." + std::to_string(number);
      read_once(*shape, [&] { add_shape(*shape, shape->id + suffix); });
      if (scene_.shapes.back().is_emitter) p.fail("a shapegroup with an emitter");
      instanced_faces_ += scene_.shapes.back().mesh.faces.size();
      if (instanced_faces_ > kMostInstancedFaces) {
        p.fail("instances are copied: more than 10000000 faces");
      }
    }
    instance_ = {};
    in_instance_ = false;
  }

  // Where something may move. Shapes turn about the centers of their bounds.
  void add_exposure() {
    const double still = exposure_.reference;
    const auto closed = [&](const Shutter& s) { return s.open.v == still && s.close.v == still; };
    if (std::ranges::all_of(exposure_.shutters, closed)) return;
    for (size_t s = 0; s < scene_.shapes.size(); ++s) {
      exposure_.shapes[s].center = bounds_of(scene_.shapes[s].mesh).center();
    }
    scene_.exposure = std::make_shared<Exposure>(std::move(exposure_));
  }

  // The textures of a shape, by what they give.
  static std::vector<std::pair<std::string, Texture*>> textures_of(const Shape& shape) {
    std::vector<std::pair<std::string, Texture*>> textures;
    for (int k = 0; k < shape.bsdf->texture_count(); ++k) {
      textures.emplace_back(shape.bsdf->texture_name(k), &shape.bsdf->texture(k));
    }
    if (shape.radiance_texture) textures.emplace_back("radiance", shape.radiance_texture.get());
    return textures;
  }

  // Gives a mesh without texture coordinates those of its faces where textures read them.
  void complete_uv(const Shape& shape, RawMesh& raw) {
    if (raw.uv_source != UvSource::kNone) return;
    for (const auto& [name, texture] : textures_of(shape)) {
      if (!texture->needs_uv()) continue;
      raw.uv_source = UvSource::kFaces;
      raw.uv_places = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
      raw.uv_ids.assign(raw.faces.size(), {0, 1, 2});
      warnings_.push_back(format_warning(
          shape.where, "no texture coordinates in " + raw.where.file + ", needed by the " +
                           (texture->is_tangent() ? "directions" : "texture") + " of \"" + name +
                           "\": each face has its barycentric coordinates, as in Mitsuba"));
      return;
    }
  }

  // That the mesh has what textures read. Returns the attributes among that.
  static std::vector<std::string> check_textures(const Shape& shape, const RawMesh& raw) {
    std::vector<std::string> wanted;
    for (const auto& [name, texture] : textures_of(shape)) {
      const std::string attribute = texture->attribute();
      if (attribute.empty()) continue;
      std::vector<std::string> known;
      for (const RawMesh::Attribute& a : raw.attributes) known.push_back(a.name);
      if (std::find(known.begin(), known.end(), attribute) == known.end()) {
        throw InputError(shape.where, "no attribute " + attribute + " in " + raw.where.file +
                                          ", needed by the texture of \"" + name + "\" (" +
                                          known_names(known) + ")");
      }
      wanted.push_back(attribute);
    }
    return wanted;
  }

  // Keeps the attributes of these names.
  static void add_attributes(const RawMesh& raw, const std::vector<std::string>& names,
                             Mesh& mesh) {
    for (const auto& [name, values] : raw.attributes) {
      if (std::find(names.begin(), names.end(), name) == names.end()) continue;
      for (size_t i = 0; i < values.size(); ++i) {
        for (const float v : values[i]) {
          if (std::isfinite(v)) continue;
          throw InputError(raw.where,
                           name + " " + std::to_string(i) + " (counted from 0) is not finite");
        }
      }
      mesh.attributes.push_back(std::make_shared<MeshAttribute>(name, values));
    }
  }

  // That attributes have values that their textures may give.
  static void check_attributes(const Shape& shape) {
    for (const auto& [name, texture] : textures_of(shape)) {
      for (const auto& attribute : shape.mesh.attributes) {
        if (attribute->name() != texture->attribute()) continue;
        const double scale = texture->attribute_scale();
        const Texture::Range valid{texture->valid().least / scale, texture->valid().most / scale};
        attribute->restrict_to(valid);
        const Texture::Range range = attribute->range();
        if (range.least >= valid.least && range.most <= valid.most) continue;
        throw InputError(
            shape.where,
            fmt::format("the values of {} lie in [{:g}, {:g}], but {} needs "
                        "[{:g}, {:g}]: give the texture a scale",
                        attribute->name(), range.least, range.most, name, valid.least, valid.most));
      }
    }
  }

  // Of a textured emitter: by which lights are chosen.
  static void set_mean_radiance(Shape& shape) {
    Rgb<double> sum;
    double area = 0;
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      constexpr int kPoints = 8;  // along a side; not tuned
      const auto c = face_corners<double>(shape.mesh, FaceId(f));
      const double part = length(cross(c[1] - c[0], c[2] - c[0]));
      for (int i = 0; i < kPoints * kPoints; ++i) {
        std::array<double, 2> b{(i % kPoints + 0.5) / kPoints, (i / kPoints + 0.5) / kPoints};
        if (b[0] + b[1] > 1) b = {1 - b[0], 1 - b[1]};
        const auto point = texture_point<double>(shape.mesh, FaceId(f), b);
        sum += shape.radiance_texture->eval(point) * (part / (kPoints * kPoints));
      }
      area += part;
    }
    const Rgb<double> mean = sum * (1 / area);
    shape.radiance = {mean.r, mean.g, mean.b};
  }

  void add_shape(const ObjectDescription& object, const std::string& id) {
    DescribedProperties p(object, description_, make_nested_);
    Shape shape;
    shape.id = id;
    shape.where = object.where;
    MeshOptions options;
    RawMesh raw;
    std::vector<std::shared_ptr<Bsdf>> bsdfs;
    const bool has_mesh = errors_.keep([&] { raw = read_geometry(p, options); });
    bool is_sound = errors_.keep([&] {
      bsdfs = p.bsdfs();
      if (bsdfs.size() > 1) p.fail("has " + std::to_string(bsdfs.size()) + " bsdfs (one at most)");
    });
    is_sound &= errors_.keep([&] {
      const ObjectDescription* emitter = p.nested("emitter");
      if (emitter) read_nested_light(*emitter, shape);
    });
    is_sound &= has_mesh && errors_.keep([&] { p.check_all_used(); });
    if (!is_sound) throw InputErrors();
    if (raw.where.file.empty()) raw.where = object.where;
    check_memory(raw);
    const double grey_value = shape.is_emitter ? 0.0 : 0.5;
    shape.bsdf = bsdfs.empty() ? make_diffuse(grey(grey_value)) : bsdfs[0];
    if (bsdfs.empty() && !shape.is_emitter) scene_.bsdfs_by_id[id + ".bsdf"] = shape.bsdf;
    options.textured = shape.bsdf->texture_count() > 0 || shape.radiance_texture;
    options.tangents = shape.bsdf->needs_tangent();
    complete_uv(shape, raw);
    const std::vector<std::string> attributes = check_textures(shape, raw);
    options.file_faces = std::any_of(attributes.begin(), attributes.end(),
                                     [](const auto& name) { return name.starts_with("face_"); });
    shape.to_world = options.to_world;
    shape.mesh = build_mesh(raw, options, &warnings_);
    add_attributes(raw, attributes, shape.mesh);
    check_attributes(shape);
    if (shape.radiance_texture) set_mean_radiance(shape);
    scene_.shapes.push_back(std::move(shape));
    exposure_.shapes.push_back(course_);
  }

  const SceneDescription& description_;
  ErrorList& errors_;
  std::vector<std::string> unread_warnings_;
  std::vector<std::string>& warnings_;
  Makers make_nested_;
  Scene scene_;
  std::map<const ObjectDescription*, std::shared_ptr<Bsdf>> bsdfs_;
  std::map<const ObjectDescription*, std::shared_ptr<Texture>> textures_;
  int bsdf_depth_ = 0;
  static constexpr size_t kMostInstancedFaces = 10000000;  // not tuned
  Matrix4 instance_;                                       // of the shapes that are added
  bool in_instance_ = false;
  Course course_;  // of the shape or the instance that is added
  Exposure exposure_;
  std::map<const ObjectDescription*, int> instances_;
  size_t instanced_faces_ = 0;
  double unasked_ = 0;  // bytes of shapes since the last check
  const ObjectDescription* integrator_ = nullptr;
  const ObjectDescription* environment_ = nullptr;
};

// A text without its numbers and quoted names, and these, each once: warnings of a kind differ in
// place, numbers and names alone.
std::pair<std::string, std::string> kind_and_details(const std::string& text) {
  std::string kind;
  std::vector<std::string> details;
  for (size_t i = 0; i < text.size();) {
    size_t end = i;
    if (text[i] == '"') {
      end = std::min(text.find('"', i + 1), text.size() - 1) + 1;
    } else if (std::isdigit(static_cast<unsigned char>(text[i]))) {
      end = std::min(text.find_first_not_of("0123456789.", i), text.size());
    }
    if (end == i) {
      kind += text[i++];
      continue;
    }
    kind += text[i] == '"' ? "\"\"" : "#";
    const std::string detail = text.substr(i, end - i);
    if (std::ranges::find(details, detail) == details.end()) details.push_back(detail);
    i = end;
  }
  return {kind, fmt::format("{}", fmt::join(details, ", "))};
}

// From the third of a kind on, warnings become one that lists their places.
void shorten(std::vector<std::string>& warnings) {
  static const std::string kMark = ": warning: ";
  std::map<std::string, std::vector<size_t>> kinds;  // indices of warnings
  for (size_t i = 0; i < warnings.size(); ++i) {
    const size_t mark = warnings[i].find(kMark);
    if (mark != std::string::npos)
      kinds[kind_and_details(warnings[i].substr(mark)).first].push_back(i);
  }
  for (const auto& [kind, members] : kinds) {
    if (members.size() < 4) continue;
    const auto place = [&, &members = members](size_t k) {  // without its folder
      const std::string where = warnings[members[k]].substr(0, warnings[members[k]].find(kMark));
      return where.substr(where.rfind('/') + 1);
    };
    std::string list = warnings[members[2]].substr(0, warnings[members[2]].find(kMark)) + kMark +
                       fmt::format("like that of {}, {} more: ", place(1), members.size() - 2);
    for (size_t k = 2; k < members.size(); ++k) {
      const std::string& text = warnings[members[k]];
      const std::string details = kind_and_details(text.substr(text.find(kMark))).second;
      list += (k > 2 ? ", " : "") + place(k) + (details.empty() ? "" : " (" + details + ")");
    }
    for (size_t k = 3; k < members.size(); ++k) warnings[members[k]].clear();
    warnings[members[2]] = list;
  }
  std::erase(warnings, std::string());
}

// text: see load_scene_tree(). All errors that are independent are thrown as one.
Scene read(const std::string& file, const SceneInput& input, const std::string* text,
           std::vector<std::string>* warnings, double smooth_as) {
  ErrorList errors;
  std::optional<Scene> scene;
  errors.keep([&] {
    const SceneDescription description = describe_scene(file, input, text, errors);
    scene = SceneBuilder(description, errors, warnings, smooth_as).build();
  });
  errors.throw_any();
  if (warnings) shorten(*warnings);
  return std::move(*scene);
}

}  // namespace

Scene read_scene(const std::string& file, const std::map<std::string, std::string>& defines,
                 std::vector<std::string>* warnings, const std::vector<std::string>& paths,
                 double smooth_as) {
  return read(file, {defines, paths}, nullptr, warnings, smooth_as);
}

size_t count_sensors(const std::string& file, const std::map<std::string, std::string>& defines,
                     const std::vector<std::string>& paths) {
  size_t count = 0;
  ErrorList errors;
  errors.keep([&] {
    for (const auto& object : describe_scene(file, {defines, paths}, nullptr, errors).objects) {
      if (object->tag != "sensor") continue;
      if (object->type != "batch") ++count;
      for (const ChildDescription& child : object->children) {
        count += child.object->tag == "sensor" ? 1 : 0;
      }
    }
  });
  errors.throw_any();
  return count;
}

Scene read_scene_text(const std::string& text, const std::string& folder,
                      const std::map<std::string, std::string>& defines,
                      std::vector<std::string>* warnings) {
  const std::string file = (std::filesystem::path(folder) / "string").string();
  return read(file, {defines, {}}, &text, warnings, 0);
}

}  // namespace limn
