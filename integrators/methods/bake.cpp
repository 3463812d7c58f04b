// Baked views: made by lines, kept as bytes, summed under maps.
#include "limn/integrators/bake.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <sstream>

#include "integrators/contours/radiance_columns.h"
#include "integrators/contours/sky_record.h"
#include "integrators/estimates/checksum.h"
#include "integrators/lights/direct_light_check.h"
#include "integrators/methods/visibility_estimator.h"
#include "limn/core/environment.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/memory.h"
#include "limn/core/parallel.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/options.h"
#include "limn/integrators/parts.h"

namespace limn {
namespace {

constexpr const char* kTitle = "limn bake 1";

std::string fingerprint_without_sky(const Scene& scene) {
  Scene dark = scene;
  dark.environment = nullptr;
  return fingerprint(dark);
}

// The numbers' memory, which is little-endian.
template <class T>
std::string_view bytes_of(const std::vector<T>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)};
}

void check_scene_and_memory(const Scene& scene, int spp, int lines) {
  check_still(scene, "bake");
  if (!scene.environment) {
    throw InputError({scene.file},
                     "bake: the scene has no environment that a map could replace: add one, as "
                     "<emitter type=\"constant\"/>");
  }
  if (scene.max_depth != 2) {
    throw InputError({scene.file}, fmt::format("bake: direct light alone is kept: set the "
                                               "integrator's max_depth to 2 (it is {})",
                                               scene.max_depth));
  }
  for (const auto& light : scene.delta_lights) {
    throw InputError({scene.file}, fmt::format("bake: {}: only area lights and the "
                                               "environment map are supported: remove it",
                                               quoted_name("emitter", light->id)));
  }
  for (const Shape& shape : scene.shapes) {
    for (const bool front : {true, false}) {
      const Bsdf* const side = shape.bsdf->side(front);
      if (!side || side->is_lambertian()) continue;
      throw InputError(shape.where,
                       fmt::format("bake: {}: only untextured diffuse surfaces are supported, "
                                   "this is {}: make it diffuse, or render under each map",
                                   shape_in_text(shape), side->describe()));
    }
  }
  const Film& film = scene.film;
  const double points = static_cast<double>(film.crop_width) * film.crop_height * spp;
  // Two ends of each line, mostly less; in rows, then joined.
  require_memory({scene.file}, points * 2 * sizeof(float) * (7 + 2.0 * lines), "the baked view",
                 "ask for fewer samples or lines, or a smaller image");
}

// "NAME VALUE" of each line of a text.
std::map<std::string, std::string> lines_of(const std::string& text) {
  std::map<std::string, std::string> values;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const size_t space = std::min(line.find(' '), line.size());
    values[line.substr(0, space)] = line.substr(std::min(space + 1, line.size()));
  }
  return values;
}

// A number of the text in a range; -1 for anything else.
int64_t number_in(const std::string& text, int64_t most) {
  int64_t value = -1;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value <= most ? value : -1;
}

template <class T>
const char* take(const char* from, size_t count, std::vector<T>& numbers) {
  numbers.resize(count);
  std::memcpy(numbers.data(), from, count * sizeof(T));
  return from + count * sizeof(T);
}

// visit(texel, weight) for the texels of a column that make up the map between two rows.
template <class Visit>
void for_texels(const Image& texels, int column, double row, const Visit& visit) {
  const int first = std::min(static_cast<int>(row), texels.height - 1);
  const int next = std::min(first + 1, texels.height - 1);
  const auto at = [&](int y) { return static_cast<size_t>(y) * texels.width + column; };
  visit(at(first), 1 - (row - first));
  if (row > first) visit(at(next), row - first);
}

// A map of one row is the same all the way down.
Environment::Grid grid_of(const SkyMap& map) {
  check_finite(map.texels, "", "the map");
  if (!std::isfinite(map.scale) || !std::isfinite(map.turn)) {
    throw InputError("the map's scale and rotation must be finite");
  }
  Environment::Grid grid = upright_grid();
  grid.columns = map.texels.width, grid.rows = std::max(2, map.texels.height);
  return grid;
}

}  // namespace

struct BakedView::PixelRow {
  std::vector<uint64_t> sizes;  // of its pixels
  std::vector<float> constant, numbers;
  NonFinite non_finite;
};

BakedView::Made BakedView::make(const Scene& scene, const RunSettings& settings, int lines) {
  check_scene_and_memory(scene, settings.spp, lines);
  RenderOptions options;
  options.method = "lines:azimuths=uniform";
  options.lines = lines;
  check_options(options);
  const VisibilityEstimator estimator(scene, settings, options);
  const Film& film = scene.film;
  const Environment::Grid grid = scene.environment->grid().value_or(upright_grid());
  std::vector<PixelRow> rows(film.crop_height);
  const auto stopped = [&] {
    return settings.interrupted && settings.interrupted->load(std::memory_order_relaxed);
  };
  const Stopwatch watch;
  ProgressCounter progress(settings, watch, rows.size());
  parallel_for(rows.size(), settings.threads, [&](size_t y) {
    PixelRow& row = rows[y];
    SkyRecord record(grid, lines);
    for (int x = 0; x < film.crop_width && !stopped(); ++x) {
      const size_t before = record.numbers().size();
      Rgb<double> sum;
      for (int64_t s = 0; s < settings.spp; ++s) {
        const PixelSample at{film.crop_x + x, film.crop_y + static_cast<int>(y), s};
        try {
          const Rgb<double> rest = estimator.record(at, 1.0 / settings.spp, record);
          if (!is_finite(rest)) throw UntraceableRay();
          sum += rest;
        } catch (const UntraceableRay&) {
          row.non_finite.add({at.x, at.y, at.s, "radiance"});
        }
      }
      for (int c = 0; c < 3; ++c) row.constant.push_back(static_cast<float>(sum[c] / settings.spp));
      row.sizes.push_back(record.numbers().size() - before);
    }
    row.numbers = record.numbers();
    progress.step();
  });
  Made made;
  made.complete = !stopped();
  BakedView& view = made.view;
  view.width_ = film.crop_width, view.height_ = film.crop_height, view.lines_ = lines;
  view.scene_ = scene.file;
  view.fingerprint_ = fingerprint_without_sky(scene);
  view.starts_ = {0};
  for (PixelRow& row : rows) {
    for (const uint64_t size : row.sizes) view.starts_.push_back(view.starts_.back() + size);
    view.constant_.insert(view.constant_.end(), row.constant.begin(), row.constant.end());
    view.numbers_.insert(view.numbers_.end(), row.numbers.begin(), row.numbers.end());
    row.numbers = {};
    made.non_finite.merge(row.non_finite);
  }
  return made;
}

std::string BakedView::bytes() const {
  std::string bytes =
      fmt::format("{}\nscene {}\nfingerprint {}\nwidth {}\nheight {}\nlines {}\nnumbers {}\n\n",
                  kTitle, scene_, fingerprint_, width_, height_, lines_, numbers_.size());
  bytes += bytes_of(constant_);
  bytes += bytes_of(starts_);
  bytes += bytes_of(numbers_);
  const std::vector<uint32_t> sum{checksum(bytes)};
  return bytes += bytes_of(sum);
}

BakedView BakedView::of_bytes(const std::string& bytes, const std::string& file) {
  const auto fail = [&](const std::string& what) { throw InputError({file}, what); };
  const std::string title = bytes.substr(0, bytes.find('\n'));
  if (!title.starts_with("limn bake ")) fail("is no file of `limn bake`");
  if (title != kTitle) fail("was written by another version of limn: bake the scene again");
  const size_t end = bytes.find("\n\n");
  if (end == std::string::npos) fail("is cut off: bake the scene again");
  auto head = lines_of(bytes.substr(0, end));
  BakedView view;
  view.scene_ = head["scene"], view.fingerprint_ = head["fingerprint"];
  const int64_t width = number_in(head["width"], kMaxPixels);
  const int64_t height = number_in(head["height"], kMaxPixels);
  const int64_t lines = number_in(head["lines"], kMostLines);
  const int64_t count = number_in(head["numbers"], std::numeric_limits<int64_t>::max() / 8);
  if (width < 1 || height < 1 || width * height > kMaxPixels || lines < 1 || count < 0) {
    fail("is damaged: bake the scene again");
  }
  view.width_ = static_cast<int>(width), view.height_ = static_cast<int>(height);
  view.lines_ = static_cast<int>(lines);
  const auto pixels = static_cast<size_t>(width * height);
  const size_t size = pixels * 3 * sizeof(float) + (pixels + 1) * sizeof(uint64_t) +
                      static_cast<size_t>(count) * sizeof(float) + sizeof(uint32_t);
  if (bytes.size() - (end + 2) != size) fail("is cut off or damaged: bake the scene again");
  const char* at = take(bytes.data() + end + 2, pixels * 3, view.constant_);
  at = take(at, pixels + 1, view.starts_);
  at = take(at, static_cast<size_t>(count), view.numbers_);
  uint32_t sum;
  std::memcpy(&sum, at, sizeof(sum));
  const std::string_view before(bytes.data(), bytes.size() - sizeof(sum));
  if (sum != checksum(before)) fail("is damaged: bake the scene again");
  return view;
}

void BakedView::check_scene(const Scene& scene) const {
  if (fingerprint_without_sky(scene) == fingerprint_) return;
  throw InputError({scene.file},
                   "is not the scene that was baked: its shapes, materials, lights, camera or film "
                   "differ: bake it again");
}

// A map as sums over its columns, and where the azimuth 0 of records lies in it.
struct BakedView::Columns {
  Columns(const SkyMap& map, int lines, int threads);
  // Column of an azimuth of records, as RadianceColumns::meridian takes it.
  double column(double turns) const {
    const double columns = (turns + turn) * sums.grid().columns - 0.5;
    return columns < 0 ? columns + sums.grid().columns : columns;
  }
  // What a point looks straight into, and the ends of a point's ranges.
  void look(const Vec3d& w, RadianceColumns::Ends& ends) const;
  void weigh(const SkyRecord::Point& point, std::span<const float> angles,
             RadianceColumns::Ends& ends) const;

  RadianceColumns sums;
  double turn;
  std::vector<float> cosines, sines;  // of the lines' azimuths with offset 0
};

BakedView::Columns::Columns(const SkyMap& map, int lines, int threads)
    : sums(
          grid_of(map),
          [&](int column, double row) {
            const Image& texels = map.texels;
            Rgb<double> radiance;
            for_texels(texels, column, row, [&](size_t texel, double weight) {
              const float* x = &texels.data[texel * texels.channels];
              const size_t g = texels.channels == 3 ? 1 : 0;
              radiance += Rgb<double>{x[0], x[g], x[2 * g]} * (weight * map.scale);
            });
            return radiance;
          },
          threads),
      turn(map.turn / 360 - std::floor(map.turn / 360)) {
  for (int j = 0; j < lines; ++j) {
    const double psi = 2 * kPi * j / lines;
    cosines.push_back(static_cast<float>(std::cos(psi)));
    sines.push_back(static_cast<float>(std::sin(psi)));
  }
}

void BakedView::Columns::look(const Vec3d& w, RadianceColumns::Ends& ends) const {
  const double turns = std::atan2(w.x, -w.z) / (2 * kPi);
  sums.look(sums.meridian(column(turns < 0 ? turns + 1 : turns)),
            std::atan2(std::hypot(w.x, w.z), w.y), ends);
}

void BakedView::Columns::weigh(const SkyRecord::Point& point, std::span<const float> angles,
                               RadianceColumns::Ends& ends) const {
  struct Line {
    RadianceColumns::Meridian meridian;
    float across;
  };
  static thread_local std::vector<Line> lines;
  const size_t count = cosines.size();
  lines.resize(count);
  const double per_line = 1 / static_cast<double>(count), psi = 2 * kPi * point.offset * per_line;
  const auto x = static_cast<float>(point.w.x * std::cos(psi) + point.w.z * std::sin(psi));
  const auto z = static_cast<float>(point.w.x * std::sin(psi) - point.w.z * std::cos(psi));
  const double first = column(point.offset * per_line), apart = sums.grid().columns * per_line;
  for (size_t j = 0; j < count; ++j) {
    lines[j] = {sums.meridian(first + apart * static_cast<double>(j)),
                x * sines[j] + z * cosines[j]};
  }
  ends.resize(angles.size());
  // The last end of each line has its sign bit, and is added; the others take turns.
  float sign = 1;
  for (size_t i = angles.size(), j = count; i-- > 0;) {
    const bool last = std::signbit(angles[i]);
    sign = last ? 1 : -sign;
    j -= last;
    ends.cell[i] = lines[j].meridian.column;
    ends.share[i] = lines[j].meridian.share;
    ends.across[i] = lines[j].across;
    ends.sign[i] = sign;
  }
  sums.weigh(angles, static_cast<float>(point.w.y), ends);
}

// Light of a pixel from the map is the sum of point(scale, ends), scale times RadianceColumns::sum.
template <class Point>
void BakedView::walk(size_t pixel, const Columns& map, const Point& point) const {
  static thread_local RadianceColumns::Ends ends;
  const auto visit = [&](const SkyRecord::Point& at, std::span<const float> angles) {
    if (at.is_view()) {
      map.look(at.w, ends);
    } else {
      map.weigh(at, angles, ends);
    }
    point(at.is_view() ? at.scale : at.scale * (2 * kPi / lines_), ends);
  };
  SkyRecord::for_each(
      std::span(numbers_).subspan(starts_[pixel], starts_[pixel + 1] - starts_[pixel]), lines_,
      visit);
}

Image BakedView::relight(const SkyMap& sky, int threads) const {
  const Columns map(sky, lines_, threads);
  Image image(width_, height_, 3);
  parallel_for(height_, threads, [&](size_t y) {
    for (size_t pixel = y * width_; pixel < (y + 1) * width_; ++pixel) {
      Rgb<double> sum{constant_[3 * pixel], constant_[3 * pixel + 1], constant_[3 * pixel + 2]};
      walk(pixel, map, [&](const Rgb<double>& scale, const RadianceColumns::Ends& ends) {
        sum += map.sums.sum(ends) * scale;
      });
      for (int c = 0; c < 3; ++c) image.data[3 * pixel + c] = static_cast<float>(sum[c]);
    }
  });
  return image;
}

Image BakedView::texel_adjoint(const SkyMap& sky, const Image& adjoint) const {
  if (adjoint.width != width_ || adjoint.height != height_) {
    throw InputError(fmt::format("the adjoint has {} x {} pixels, the baked view {} x {}",
                                 adjoint.width, adjoint.height, width_, height_));
  }
  check_finite(adjoint, "", "the adjoint image");
  const Columns map(sky, lines_, 1);
  RadianceColumns::Adjoint cells = map.sums.zero_adjoint();  // or InputError
  for (size_t pixel = 0; pixel < static_cast<size_t>(width_) * height_; ++pixel) {
    const auto channel = [&](int c) {
      return double{adjoint.data[pixel * adjoint.channels + (adjoint.channels == 3 ? c : 0)]};
    };
    const Rgb<double> d{channel(0), channel(1), channel(2)};
    walk(pixel, map, [&](const Rgb<double>& scale, const RadianceColumns::Ends& ends) {
      RadianceColumns::add(ends, d * scale, cells);
    });
  }
  const Image& texels = sky.texels;
  std::vector<double> sums(static_cast<size_t>(texels.width) * texels.height * 3);
  map.sums.finish(std::move(cells), [&](int column, double row, const Rgb<double>& d) {
    for_texels(texels, column, row, [&](size_t texel, double weight) {
      for (int c = 0; c < 3; ++c) sums[3 * texel + c] += d[c] * (weight * sky.scale);
    });
  });
  Image result(texels.width, texels.height, 3);
  for (size_t i = 0; i < sums.size(); ++i) result.data[i] = static_cast<float>(sums[i]);
  return result;
}

}  // namespace limn
