// Converts the description of a sensor to camera, film, filter and sampler.
#include "src/scene_file/scene_sensor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/names.h"
#include "src/base/text.h"

namespace limn {

namespace {

const Makers kNoMakers;

[[noreturn]] void fail_unknown_type(const ObjectDescription& object,
                                    const std::vector<std::string>& known) {
  throw InputError(object.where, unknown_type(object.tag, object.type, known));
}

int bounded_integer(Properties& properties, const std::string& name, int64_t absent,
                    int64_t smallest) {
  const int64_t number = properties.integer(name, absent);
  constexpr int64_t kLargest = std::numeric_limits<int>::max() / 2;
  if (number < smallest || number > kLargest) {
    const int64_t bound = number < smallest ? smallest : kLargest;
    properties.fail(name, "must be at " + std::string(number < smallest ? "least " : "most ") +
                              std::to_string(bound) + ", not " + std::to_string(number));
  }
  return static_cast<int>(number);
}

double positive(Properties& properties, const std::string& name, double absent) {
  const double number = properties.number(name, absent);
  if (!(number > 0)) properties.fail(name, "must be positive");
  return number;
}

// Limits the radius: far smaller ones already cover the whole film.
double radius_of_filter(Properties& properties, const std::string& name, double absent) {
  const double number = positive(properties, name, absent);
  if (number > 1000) properties.fail(name, "must be at most 1000 pixels");
  return number;
}

double part(Properties& properties, const std::string& name, double absent) {
  const double number = properties.number(name, absent);
  if (!(number >= 0 && number <= 1)) properties.fail(name, "must lie in [0, 1]");
  return number;
}

void read_filter(const ObjectDescription& object, const SceneDescription& scene, Filter& filter) {
  DescribedProperties p(object, scene, kNoMakers);
  if (object.type == "box") {
    filter = {Filter::Kind::kBox, 0.5, 0};
  } else if (object.type == "tent") {
    filter = {Filter::Kind::kTent, radius_of_filter(p, "radius", 1), 0};
  } else if (object.type == "gaussian") {
    const double stddev = radius_of_filter(p, "stddev", 0.5);
    filter = {Filter::Kind::kGaussian, 4 * stddev, stddev};
  } else if (object.type == "mitchell") {
    filter = cubic_filter(part(p, "B", 1.0 / 3), part(p, "C", 1.0 / 3));
  } else if (object.type == "catmullrom") {
    filter = cubic_filter(0, 0.5);
  } else if (object.type == "lanczos") {
    const int lobes = bounded_integer(p, "lobes", 3, 1);
    if (lobes > 1000) p.fail("lobes", "must be at most 1000");
    filter = lanczos_filter(lobes);
  } else {
    fail_unknown_type(object, {"box", "catmullrom", "gaussian", "lanczos", "mitchell", "tent"});
  }
  p.check_all_used();
}

// Reads a string that must be one of `known`.
std::string choice(Properties& properties, const std::string& name, const std::string& absent,
                   const std::vector<std::string>& known) {
  std::string word = lower_case(properties.string(name, absent));
  for (const std::string& k : known) {
    if (k == word) return word;
  }
  properties.fail(name, unknown_name("value", word, known));
}

void read_crop(Properties& p, const Camera& camera, Film& film) {
  film.crop_x = bounded_integer(p, "crop_offset_x", 0, 0);
  film.crop_y = bounded_integer(p, "crop_offset_y", 0, 0);
  film.crop_width = bounded_integer(p, "crop_width", camera.width, 1);
  film.crop_height = bounded_integer(p, "crop_height", camera.height, 1);
  if (film.crop_x + film.crop_width > camera.width ||
      film.crop_y + film.crop_height > camera.height) {
    p.fail("the crop window reaches beyond the film (" + std::to_string(camera.width) + " x " +
           std::to_string(camera.height) + " pixels)");
  }
  check_film_size(
      p.where(), film.crop_width, film.crop_height,
      "lower width and height (with -D where the scene has parameters for them), or crop it");
}

// True for one channel. Only rgb and luminance are written.
bool read_pixel_format(Properties& p, std::vector<std::string>& warnings) {
  const std::string format = choice(p, "pixel_format", "rgb",
                                    {"luminance", "luminance_alpha", "rgb", "rgba", "xyz", "xyza"});
  const bool luminance = format.starts_with("luminance");
  const std::string written = luminance ? "luminance" : "rgb";
  if (format != written) {
    warnings.push_back(format_warning(
        p.where("pixel_format"), "pixel_format " + format + " is written as " + written +
                                     (format.ends_with("a") ? "; render --alpha adds A" : "")));
  }
  return luminance;
}

// sensors: that share the width.
void read_film(const ObjectDescription& object, const SceneDescription& description, int sensors,
               Sensor& sensor, std::vector<std::string>& warnings) {
  if (object.type != "hdrfilm") fail_unknown_type(object, {"hdrfilm"});
  DescribedProperties p(object, description, kNoMakers);
  Film& film = sensor.film;
  film.where = object.where;
  sensor.camera.width = bounded_integer(p, "width", 768, 1);
  sensor.camera.height = bounded_integer(p, "height", 576, 1);
  if (sensor.camera.width % sensors != 0) {
    p.fail("width", "must be divisible by the number of sensors, " + std::to_string(sensors));
  }
  sensor.camera.width /= sensors;
  read_crop(p, sensor.camera, film);
  film.sample_border = p.boolean("sample_border", p.boolean("high_quality_edges", false));
  const std::string file = choice(p, "file_format", "openexr", {"exr", "openexr", "pfm", "rgbe"});
  if (file == "pfm" || file == "rgbe") {
    warnings.push_back(
        format_warning(p.where("file_format"), "file_format " + file + " is written as openexr"));
  }
  film.luminance = read_pixel_format(p, warnings);
  film.half = choice(p, "component_format", "float16", {"float16", "float32"}) == "float16";
  // Ignored: sums are in double precision, and there is no banner.
  p.boolean("compensate", false);
  p.boolean("banner", false);
  if (const ObjectDescription* filter = p.nested("rfilter")) {
    read_filter(*filter, description, film.filter);
    film.where = filter->where;
  }
  p.check_all_used();
}

// Samplers of other types are read as independent: limn's points are its own (--generator).
void read_sampler(const ObjectDescription& object, const SceneDescription& description,
                  Sensor& sensor, std::vector<std::string>& warnings) {
  static const std::vector<std::string> kTypes = {"independent", "ldsampler", "multijitter",
                                                  "orthogonal", "stratified"};
  if (std::find(kTypes.begin(), kTypes.end(), object.type) == kTypes.end()) {
    fail_unknown_type(object, kTypes);
  }
  DescribedProperties p(object, description, kNoMakers);
  if (object.type != "independent") {
    warnings.push_back(format_warning(
        object.where,
        "sampler \"" + object.type + "\" is read as independent: limn chooses its own points"));
    p.boolean("jitter", true);
    p.integer("strength", 2);
  }
  sensor.sample_count = bounded_integer(p, "sample_count", 4, 1);
  const int64_t seed = p.integer("seed", 0);
  if (seed < 0) p.fail("seed", "must not be negative");
  sensor.seed = static_cast<uint64_t>(seed);
  p.check_all_used();
}

// tan(x_fov / 2) over tan(fov / 2) for a field of view along `axis` at this aspect ratio.
double x_factor(Properties& p, const std::string& axis, double aspect) {
  if (axis == "x") return 1;
  if (axis == "y") return aspect;
  if (axis == "diagonal") return 1 / std::sqrt(1 + 1 / (aspect * aspect));
  if (axis == "smaller") return aspect > 1 ? aspect : 1;
  if (axis == "larger") return aspect > 1 ? 1 : aspect;
  p.fail("fov_axis", unknown_name("axis", axis, {"diagonal", "larger", "smaller", "x", "y"}));
}

// Diagonal field of view [degrees] of a focal length on 35 mm film.
double fov_of_focal_length(Properties& p) {
  std::string text = p.string("focal_length", "50mm");
  if (text.ends_with("mm")) text.resize(text.size() - 2);
  const double focal_length = parse_double(text).value_or(0);
  if (!(focal_length > 0)) p.fail("focal_length", "must be a positive length like \"50mm\"");
  return 2 * std::atan(std::hypot(36.0, 24.0) / (2 * focal_length)) * (180 / kPi);
}

void read_fov(Properties& p, Camera& camera) {
  const double aspect = static_cast<double>(camera.width) / camera.height;
  std::string axis = lower_case(p.string("fov_axis", "x"));
  double fov = 0;
  if (p.has("fov")) {
    if (p.has("focal_length")) p.fail("focal_length", "give either fov or focal_length, not both");
    fov = p.number("fov", 0);
    if (!(fov > 0 && fov < 180)) p.fail("fov", "must lie between 0 and 180 degrees");
  } else {
    if (p.has("fov_axis")) {
      p.fail("fov_axis", "needs fov (a focal length is measured along the diagonal)");
    }
    fov = fov_of_focal_length(p);
    axis = "diagonal";
  }
  camera.fov = fov;
  camera.x_factor = x_factor(p, axis, aspect);
}

Vec3<Dual> dual(const Vec3d& v) { return {v.x, v.y, v.z}; }

// Divides the axes of a transform by their lengths, which it returns.
Vec3d normalize_axes(Matrix4& m) {
  Vec3d lengths;
  for (int column = 0; column < 3; ++column) {
    lengths[column] = std::hypot(m.m[0][column], m.m[1][column], m.m[2][column]);
    for (int row = 0; row < 3; ++row) m.m[row][column] /= lengths[column];
  }
  return lengths;
}

// Orthonormalises the camera's axes. Mirrored cameras are allowed, as in Mitsuba.
void set_axes(Properties& p, const Matrix4& m, Camera& camera) {
  constexpr double kDigits = 1e-3;  // Mitsuba's bound on scale factors
  Vec3d row[3], column[3];
  for (int i = 0; i < 3; ++i) {
    row[i] = {m.m[i][0], m.m[i][1], m.m[i][2]};
    column[i] = {m.m[0][i], m.m[1][i], m.m[2][i]};
  }
  for (int i = 0; i < 3; ++i) {
    if (!(std::fabs(length(row[i]) - 1) <= kDigits && std::fabs(length(column[i]) - 1) <= kDigits &&
          std::fabs(dot(column[i], column[(i + 1) % 3])) <= kDigits)) {
      p.fail("to_world", "a camera can be moved and rotated, not scaled or sheared");
    }
  }
  const Vec3d forward = normalize(column[2]);
  const Vec3d up = normalize(column[1] - forward * dot(forward, column[1]));
  const Vec3d left = cross(up, forward);
  camera.forward = dual(forward);
  camera.up = dual(up);
  camera.left = dual(dot(left, column[0]) > 0 ? left : -left);
  for (int k = 0; k < 3; ++k) {
    if (std::fabs(m.m[k][3]) <= kLargestCoordinate) continue;
    p.fail("to_world",
           "the pinhole has a coordinate beyond 2e12, where rays miss everything in single "
           "precision: use a larger unit");
  }
  camera.origin = dual({m.m[0][3], m.m[1][3], m.m[2][3]});
}

// Mitsuba's: in focus is a distance along the view, by default the far clip plane's. A lens of
// radius 0 is a pinhole.
void read_lens(Properties& p, Camera& camera) {
  if (!p.has("aperture_radius")) p.fail("needs aperture_radius (0: a pinhole)");
  const double radius = p.number("aperture_radius", 0);
  if (!(radius >= 0)) p.fail("aperture_radius", "must not be negative");
  camera.aperture_radius = radius;
  camera.focus_distance = positive(p, "focus_distance", camera.far_clip);
}

// The rest of a sensor, behind its film.
void read_view(DescribedProperties& p, const std::string& type, Exposure& exposure,
               Camera& camera) {
  const bool orthographic = type == "orthographic", lens = type == "thinlens";
  Course& course = exposure.cameras.emplace_back();
  exposure.shutters.push_back(read_shutter(p));
  Matrix4 to_world = read_course(p, exposure.reference, course);
  for (const Keyframe& key : course.keyframes) {
    if (key.scale != 1) p.fail("to_world", "a camera can be moved and rotated, not scaled");
  }
  Vec3d size{1, 1, 1};
  if (orthographic) {
    size = normalize_axes(to_world);
    camera.half_width = size.x;
    camera.half_square = size.y;
    camera.half_height = size.y * camera.height / camera.width;
  } else {
    read_fov(p, camera);
  }
  set_axes(p, to_world, camera);
  camera.near_clip = positive(p, "near_clip", 0.01);
  camera.far_clip = positive(p, "far_clip", 10000);
  if (!(camera.near_clip < camera.far_clip)) p.fail("far_clip", "must be larger than near_clip");
  camera.far_clip += (size.z - 1) * camera.near_clip;
  camera.near_clip *= size.z;
  if (!orthographic && !lens) {
    camera.offset_x = p.number("principal_point_offset_x", 0);
    camera.offset_y = p.number("principal_point_offset_y", 0);
  }
  if (lens) read_lens(p, camera);
  // Accepted and ignored: only a lens has a focus.
  p.number("focus_distance", camera.far_clip);
}

}  // namespace

Sensor read_sensor(const ObjectDescription& sensor, const SceneDescription& description,
                   Exposure& exposure, std::vector<std::string>& warnings,
                   const SharedParts& shared) {
  Sensor read;
  read.id = sensor.id;
  if (sensor.type != "orthographic" && sensor.type != "thinlens" && sensor.type != "perspective") {
    fail_unknown_type(sensor, {"batch", "orthographic", "perspective", "thinlens"});
  }
  DescribedProperties p(sensor, description, kNoMakers);
  ErrorList errors;
  bool is_sound = errors.keep([&] {
    if (const ObjectDescription* film = p.nested("film")) {
      read_film(*film, description, 1, read, warnings);
    } else if (shared.film) {
      read_film(*shared.film, description, shared.sensors, read, warnings);
    }
  });
  is_sound &= errors.keep([&] {
    const ObjectDescription* sampler = p.nested("sampler");
    if (!sampler) sampler = shared.sampler;
    if (sampler) read_sampler(*sampler, description, read, warnings);
  });
  is_sound &= errors.keep([&] {
    read_view(p, sensor.type, exposure, read.camera);
    p.check_all_used();
  });
  errors.throw_any();
  if (!is_sound) throw InputErrors();
  return read;
}

}  // namespace limn
