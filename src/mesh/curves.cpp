// Rings of points about a curve, and triangles between each two of them.
#include "src/mesh/curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "src/base/text.h"

namespace limn {
namespace {

// Triangles per segment of a curve where there are few, and about how many there may be in all.
constexpr int kMostSides = 32, kLeastSides = 6;
constexpr int kMostSteps = 16, kLeastSteps = 2;
constexpr double kManyFaces = 2e6;

struct Resolution {
  int sides, steps;  // around, and along a segment
};

Resolution resolution_of(size_t segments) {
  const double each = kManyFaces / static_cast<double>(segments);
  const double share = std::min(1.0, std::sqrt(each / (2 * kMostSides * kMostSteps)));
  return {std::max(kLeastSides, static_cast<int>(kMostSides * share)),
          std::max(kLeastSteps, static_cast<int>(kMostSteps * share))};
}

// One ring: points `center` + radius (cos a rad + sin a rot), a from 0 to 2 pi.
struct Ring {
  Vec3d center, along;  // along: unit
  double radius;
  // The normal is that of a cone: of the direction from the center, times the first, plus `along`
  // times the second; `bend` takes curvature into account.
  double outward = 1, forward = 0;
  Vec3d bend = {};
  double v = 0;  // texture coordinate
};

class Tube {
 public:
  Tube(RawMesh& mesh, int sides) : mesh_(mesh), sides_(static_cast<uint32_t>(sides)) {}

  void begin() { first_ = true; }

  void add(const Ring& ring) {
    turn_to(ring.along);
    const auto start = static_cast<uint32_t>(mesh_.positions.size());
    const auto normals = static_cast<uint32_t>(mesh_.normals.size());
    const auto places = static_cast<uint32_t>(mesh_.uv_places.size());
    const Vec3d rot = cross(ring.along, rad_);
    const double offset = texture_offset(ring.along, rot);
    for (uint32_t i = 0; i <= sides_; ++i) {
      const double turn = static_cast<double>(i) / sides_;
      mesh_.uv_places.push_back({static_cast<float>(turn + offset), static_cast<float>(ring.v), 0});
      if (i == sides_) break;
      const double a = 2 * kPi * turn;
      const Vec3d out = std::cos(a) * rad_ + std::sin(a) * rot;
      if (ring.radius > 0 || i == 0) {
        mesh_.positions.push_back(ring.center + ring.radius * out);
      }
      mesh_.normals.push_back((ring.outward - dot(out, ring.bend)) * out +
                              ring.forward * ring.along);
    }
    if (!first_) connect(start, normals, places, ring.radius > 0);
    first_ = false;
    start_ = start;
    normals_ = normals;
    places_ = places;
    wide_ = ring.radius > 0;
  }

 private:
  // The frame turns with the curve, so that tubes are not twisted; at first it is Mitsuba's.
  void turn_to(const Vec3d& along) {
    if (first_) {
      rad_ = mitsuba_radial(along);
      offset_ = 0;
    } else {
      rad_ = rad_ - dot(rad_, along) * along;
      if (length(rad_) < 1e-6) rad_ = mitsuba_radial(along);
      rad_ = normalize(rad_);
    }
  }

  static Vec3d mitsuba_radial(const Vec3d& along) {
    const Vec3d guide{0, 0, 1};
    Vec3d rot = guide - dot(guide, along) * along;
    rot = length(rot) > 0 ? normalize(rot) : Vec3d{0, 1, 0};
    return normalize(cross(rot, along));
  }

  // By how much Mitsuba's u is larger: near that of the ring before, up to whole turns.
  double texture_offset(const Vec3d& along, const Vec3d& rot) {
    const Vec3d theirs = mitsuba_radial(along);
    const double turn = -std::atan2(dot(theirs, rot), dot(theirs, rad_)) / (2 * kPi);
    offset_ = turn + std::round(offset_ - turn);
    return offset_;
  }

  void connect(uint32_t start, uint32_t normals, uint32_t places, bool wide) {
    for (uint32_t i = 0; i < sides_; ++i) {
      const uint32_t next = (i + 1) % sides_;
      const auto before = [&](uint32_t k) { return start_ + (wide_ ? k : 0); };
      const auto after = [&](uint32_t k) { return start + (wide ? k : 0); };
      if (wide_) {
        mesh_.faces.push_back({before(i), before(next), after(next)});
        mesh_.normal_ids.push_back({normals_ + i, normals_ + next, normals + next});
        mesh_.uv_ids.push_back({places_ + i, places_ + i + 1, places + i + 1});
      }
      if (wide) {
        mesh_.faces.push_back({before(i), after(next), after(i)});
        mesh_.normal_ids.push_back({normals_ + i, normals + next, normals + i});
        mesh_.uv_ids.push_back({places_ + i, places + i + 1, places + i});
      }
    }
  }

  RawMesh& mesh_;
  uint32_t sides_;
  Vec3d rad_;
  double offset_ = 0;
  bool first_ = true, wide_ = false;
  uint32_t start_ = 0, normals_ = 0, places_ = 0;  // of the ring before
};

RawMesh empty_mesh() {
  RawMesh mesh{{}, {}, {}, {}, {}};
  mesh.uv_source = UvSource::kPlane;
  return mesh;
}

size_t count_segments(std::span<const Curve> curves, size_t least) {
  size_t count = 0;
  for (const Curve& curve : curves) count += curve.size() + 1 - least;
  return count;
}

// The ring at t in [0, 1] of the segment whose first control point is `c`.
Ring spline_ring(const ControlPoint* c, double t) {
  const double s = 1 - t;
  const double weights[3][4] = {
      {s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * s * s * s - 6 * s * s + 4) / 6,
       t * t * t / 6},
      {-s * s / 2, (3 * t * t - 4 * t) / 2, (4 * s - 3 * s * s) / 2, t * t / 2},
      {s, 3 * t - 2, 3 * s - 2, t}};
  Vec3d p[3];
  double radius[2] = {0, 0};
  for (int order = 0; order < 3; ++order) {
    for (int k = 0; k < 4; ++k) {
      p[order] += weights[order][k] * c[k].p;
      if (order < 2) radius[order] += weights[order][k] * c[k].radius;
    }
  }
  const double speed = length(p[1]);
  Ring ring{p[0], speed > 0 ? p[1] / speed : Vec3d{0, 0, 1}, radius[0]};
  ring.outward = speed * speed;
  ring.forward = -radius[1] * speed;
  ring.bend = radius[0] * p[2];
  return ring;
}

}  // namespace

std::vector<Curve> parse_curves(const std::string& file, size_t least, const Matrix4& to_world) {
  const std::string text = read_whole_file(file);
  std::vector<Curve> curves;
  SourceLocation where{file, 0, 1};
  int begun = 0;  // the line of the curve's first point; 0: outside of curves
  const auto finish = [&] {
    if (begun > 0 && curves.back().size() < least) {
      throw InputError({file, begun, 1}, fmt::format("a curve of {} control points: needs {}",
                                                     curves.back().size(), least));
    }
    begun = 0;
  };
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\n', at), text.size());
    const auto words = split(std::string_view(text).substr(at, end - at), " \t\r");
    at = end + 1;
    ++where.line;
    if (words.empty()) {
      finish();
      continue;
    }
    if (words.size() != 4) throw InputError(where, "expected four numbers: x y z radius");
    std::array<double, 4> x;
    for (size_t k = 0; k < 4; ++k) {
      const auto number = parse_double(words[k]);
      if (!number || !std::isfinite(*number)) {
        throw InputError(where, fmt::format("expected a number, not \"{}\"", words[k]));
      }
      x[k] = *number;
    }
    if (x[3] < 0) throw InputError(where, "the radius must not be negative");
    if (begun == 0) {
      curves.emplace_back();
      begun = where.line;
    }
    curves.back().push_back({to_world.point({x[0], x[1], x[2]}), x[3]});
  }
  finish();
  if (curves.empty()) throw InputError({file}, "has no control points");
  return curves;
}

RawMesh make_spline_tubes(std::span<const Curve> curves) {
  RawMesh mesh = empty_mesh();
  const size_t segments = count_segments(curves, 4);
  const Resolution resolution = resolution_of(segments);
  Tube tube(mesh, resolution.sides);
  size_t segment = 0;
  for (const Curve& curve : curves) {
    tube.begin();
    for (size_t k = 0; k + 3 < curve.size(); ++k, ++segment) {
      for (int i = k > 0; i <= resolution.steps; ++i) {
        const double t = static_cast<double>(i) / resolution.steps;
        Ring ring = spline_ring(&curve[k], t);
        ring.v = (static_cast<double>(segment) + t) / static_cast<double>(segments);
        tube.add(ring);
      }
    }
  }
  return mesh;
}

RawMesh make_linear_tubes(std::span<const Curve> curves) {
  RawMesh mesh = empty_mesh();
  const size_t segments = count_segments(curves, 2);
  const Resolution resolution = resolution_of(segments);
  Tube tube(mesh, resolution.sides);
  size_t segment = 0;
  for (const Curve& curve : curves) {
    for (size_t k = 0; k + 1 < curve.size(); ++k, ++segment) {
      const ControlPoint &a = curve[k], &b = curve[k + 1];
      const double distance = length(b.p - a.p);
      if (distance == 0) continue;
      const Vec3d along = (b.p - a.p) / distance;
      // Latitude of the circles at which the cone touches both spheres.
      const double touch = std::asin(std::clamp((a.radius - b.radius) / distance, -1.0, 1.0));
      const auto add = [&](const ControlPoint& c, double latitude, double t) {
        const double up = std::sin(latitude), out = std::max(0.0, std::cos(latitude));
        Ring ring{c.p + c.radius * up * along, along, c.radius * (out > 1e-9 ? out : 0)};
        ring.outward = out;
        ring.forward = up;
        ring.v = (static_cast<double>(segment) + t) / static_cast<double>(segments);
        tube.add(ring);
      };
      tube.begin();
      // The sphere of a joint is closed by the segment before it.
      const int rings = resolution.steps;
      for (int i = k > 0 ? rings : 0; i <= rings; ++i) {
        add(a, -kPi / 2 + (touch + kPi / 2) * i / rings, 0);
      }
      for (int i = 0; i <= rings; ++i) add(b, touch + (kPi / 2 - touch) * i / rings, 1);
    }
  }
  return mesh;
}

}  // namespace limn
