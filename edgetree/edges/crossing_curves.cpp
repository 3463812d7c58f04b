// Finds intersecting faces and their intersection segments.
#include "limn/edgetree/crossing_curves.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "edgetree/edges/contacts.h"
#include "edgetree/edges/fold.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

struct Triangle {
  std::array<Vec3f, 3> corners;
  FaceRef face;
};

// The largest absolute coordinate.
double size_of(const Triangle& triangle) {
  double size = 0;
  for (const Vec3f& x : triangle.corners)
    for (int k = 0; k < 3; ++k) size = std::max(size, std::fabs(double{x[k]}));
  return size;
}

// Heights of points over the plane of a triangle, times twice its area: six times the volume of a
// tetrahedron. Corners keep the triangle's order, so that a point gets the same bits from all faces
// of its own surface.
class HeightOver {
 public:
  explicit HeightOver(const Triangle& triangle)
      : a_(cast<double>(triangle.corners[0])),
        b_(cast<double>(triangle.corners[1])),
        c_(cast<double>(triangle.corners[2])),
        normal_(cross(b_ - a_, c_ - a_)),
        triangle_(triangle) {}

  const Vec3d& normal() const { return normal_; }
  double of(const Vec3d& x) const { return dot(normal_, x - a_); }

  // Bound of the rounding error, for corners and x anywhere above the plane (the gradient's length
  // times 2 * 2^-24 |x|, as in fold_of). At least the tolerance of contacts (contacts.h), so
  // touching faces do not intersect. size: of x's triangle.
  double rounding(const Vec3d& x, double size) const {
    const double positions = fold_of(a_, b_, c_, x).rounding;
    return std::max(positions, touch_tolerance(size_of(triangle_), size) * length(normal_));
  }

 private:
  Vec3d a_, b_, c_, normal_;
  const Triangle& triangle_;
};

// Sides of a plane on which the corners of a triangle lie: heights, set to 0 within
// rounding.
struct Sides {
  std::array<double, 3> heights;
  bool both() const {
    const auto [least, most] = std::minmax({heights[0], heights[1], heights[2]});
    return least < 0 && most > 0;
  }
};

Sides sides_of(const Triangle& triangle, const HeightOver& plane) {
  Sides sides;
  for (int k = 0; k < 3; ++k) sides.heights[k] = plane.of(cast<double>(triangle.corners[k]));
  if (!sides.both()) return sides;
  const double size = size_of(triangle);
  for (int k = 0; k < 3; ++k) {
    const double rounding = plane.rounding(cast<double>(triangle.corners[k]), size);
    if (std::fabs(sides.heights[k]) <= rounding) sides.heights[k] = 0;
  }
  return sides;
}

bool before(const Vec3f& a, const Vec3f& b) {
  return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

// The intersection of an edge with a plane between its ends: the same bits from both faces of the
// edge.
Vec3d meet(Vec3f a, Vec3f b, double height_a, double height_b) {
  if (before(b, a)) {
    std::swap(a, b);
    std::swap(height_a, height_b);
  }
  const Vec3d from = cast<double>(a);
  return from + (cast<double>(b) - from) * (height_a / (height_a - height_b));
}

// An interval of the line where two planes intersect.
struct Interval {
  std::array<Vec3d, 2> ends;
  std::array<double, 2> places;  // positions of the ends along the line, ascending
};

// The interval inside of a triangle with corners on both sides of the other's plane.
Interval interval_of(const Triangle& triangle, const Sides& sides, const Vec3d& along,
                     const Vec3d& origin) {
  Interval interval;
  int count = 0;
  const auto add = [&](const Vec3d& x) {
    interval.ends[count] = x;
    interval.places[count++] = dot(along, x - origin);
  };
  for (int k = 0; k < 3; ++k) {
    const Vec3f &a = triangle.corners[k], &b = triangle.corners[(k + 1) % 3];
    const double height_a = sides.heights[k], height_b = sides.heights[(k + 1) % 3];
    if (height_a == 0) add(cast<double>(a));
    if ((height_a < 0 && height_b > 0) || (height_a > 0 && height_b < 0))
      add(meet(a, b, height_a, height_b));
  }
  if (interval.places[0] > interval.places[1]) {
    std::swap(interval.ends[0], interval.ends[1]);
    std::swap(interval.places[0], interval.places[1]);
  }
  return interval;
}

std::optional<IntersectionSegment> cross_faces(const Triangle& first, const Triangle& second) {
  const HeightOver over_first(first);
  const Sides of_second = sides_of(second, over_first);
  if (!of_second.both()) return std::nullopt;
  const HeightOver over_second(second);
  const Sides of_first = sides_of(first, over_second);
  if (!of_first.both()) return std::nullopt;
  const Vec3d along = cross(over_first.normal(), over_second.normal());
  const Vec3d origin = cast<double>(first.corners[0]);
  const Interval a = interval_of(first, of_first, along, origin);
  const Interval b = interval_of(second, of_second, along, origin);
  const int begin = b.places[0] > a.places[0], end = b.places[1] < a.places[1];
  if (!((end ? b : a).places[1] > (begin ? b : a).places[0])) return std::nullopt;
  const IntersectionSegment segment{{first.face, second.face},
                                    {(begin ? b : a).ends[0], (end ? b : a).ends[1]}};
  // Sides that only meet in a point overlap by rounding errors.
  const double size = std::max(length(segment.ends[0]), length(segment.ends[1]));
  if (length(segment.ends[1] - segment.ends[0]) <= 0x1p-22 * size) return std::nullopt;
  return segment;
}

int common_corners(const Triangle& a, const Triangle& b) {
  int count = 0;
  for (const Vec3f& x : a.corners)
    for (const Vec3f& y : b.corners) count += x == y;
  return count;
}

Triangle triangle_of(std::span<const Mesh* const> meshes, FaceRef face) {
  const Mesh& mesh = *meshes[face.shape.index()];
  const auto& [a, b, c] = mesh.face(face.face);
  return {{mesh.positions[a], mesh.positions[b], mesh.positions[c]}, face};
}

auto key(FaceRef face) { return std::pair(face.shape, face.face); }

Vec3<Lanes> velocity_on(const Mesh& mesh, FaceId id, const Vec3d& normal, const Vec3d& x) {
  if (mesh.position_tangents.empty()) return {};
  const FaceIndices& face = mesh.face(id);
  Vec3d corners[3];
  for (int k = 0; k < 3; ++k) corners[k] = cast<double>(mesh.positions[face[k]]);
  Vec3<Lanes> velocity;
  for (int k = 0; k < 3; ++k) {
    const Vec3d &a = corners[(k + 1) % 3], &b = corners[(k + 2) % 3];
    const double weight = dot(normal, cross(a - x, b - x)) / length_squared(normal);
    velocity += mesh.position_tangents[face[k]] * weight;
  }
  return velocity;
}

Vec3d normal_of(const Mesh& mesh, FaceId id) {
  const auto& [i, j, k] = mesh.face(id);
  const Vec3d a = cast<double>(mesh.positions[i]);
  return cross(cast<double>(mesh.positions[j]) - a, cast<double>(mesh.positions[k]) - a);
}

// Appends the intersection line of a segment's faces, without its incident faces.
void append_line(std::span<const Mesh* const> meshes, const IntersectionSegment& segment,
                 bool moves, EdgeMesh& edges) {
  const auto first = static_cast<uint32_t>(edges.positions.size());
  Edge edge;
  edge.edge_class = EdgeClass::kIntersection;
  for (int i = 0; i < 2; ++i) {
    const Vec3d& x = segment.ends[i];
    const FaceRef face = segment.faces[i];
    const Vec3d n = normalize(normal_of(*meshes[face.shape.index()], face.face));
    edge.vertices[i] = VertexId(first + i);
    edge.faces[i] = FaceId(first + i);
    edges.positions.push_back(x);
    if (moves) edges.tangents.push_back(intersection_velocity(meshes, segment, x));
    edges.planes.push_back({n, -dot(n, x)});
    edges.extent = std::max(edges.extent, length(x));
  }
  edges.edges.push_back(edge);
}

template <class Items>
void append(std::vector<typename Items::value_type>& list, const Items& items) {
  list.insert(list.end(), items.begin(), items.end());
}

}  // namespace

std::vector<IntersectionSegment> find_intersections(std::span<const Mesh* const> meshes,
                                                    std::span<const FacePair> pairs, int threads) {
  constexpr size_t kBlock = 4096;  // not tuned
  std::vector<std::vector<IntersectionSegment>> blocks((pairs.size() + kBlock - 1) / kBlock);
  parallel_for(blocks.size(), threads, [&](size_t block) {
    const size_t begin = block * kBlock;
    for (const FacePair& pair : pairs.subspan(begin, std::min(kBlock, pairs.size() - begin))) {
      const Triangle a = triangle_of(meshes, pair.first), b = triangle_of(meshes, pair.second);
      // Faces with a common edge meet only there or in a plane.
      if (common_corners(a, b) > 1) continue;
      if (const auto segment = cross_faces(a, b)) blocks[block].push_back(*segment);
    }
  });
  std::vector<IntersectionSegment> segments;
  for (const auto& block : blocks) segments.insert(segments.end(), block.begin(), block.end());
  std::sort(segments.begin(), segments.end(),
            [](const IntersectionSegment& a, const IntersectionSegment& b) {
              return std::pair(key(a.faces[0]), key(a.faces[1])) <
                     std::pair(key(b.faces[0]), key(b.faces[1]));
            });
  return segments;
}

// With unit normals n and m, speeds s and t along them, and l = n x m: v . n = s, v . m = t and
// v . l = 0 hold for v = (s m x l + t l x n) / |l|^2.
Vec3<Lanes> intersection_velocity(std::span<const Mesh* const> meshes,
                                  const IntersectionSegment& segment, const Vec3d& x) {
  Vec3d normals[2];
  Lanes speeds[2];
  for (int i = 0; i < 2; ++i) {
    const auto [shape, face] = segment.faces[i];
    const Mesh& mesh = *meshes[shape.index()];
    const Vec3d normal = normal_of(mesh, face);
    normals[i] = normalize(normal);
    speeds[i] = dot(velocity_on(mesh, face, normal, x), normals[i]);
  }
  const Vec3d line = cross(normals[0], normals[1]);
  const double scale = 1 / length_squared(line);
  const Vec3d by_first = cross(normals[1], line) * scale;
  const Vec3d by_second = cross(line, normals[0]) * scale;
  const auto component = [&](int k) { return speeds[0] * by_first[k] + speeds[1] * by_second[k]; };
  return {component(0), component(1), component(2)};
}

EdgeMesh intersection_edges(std::span<const Mesh* const> meshes,
                            std::span<const IntersectionSegment> segments,
                            std::span<const ContactLine> contacts) {
  EdgeMesh result;
  const bool moves = std::any_of(meshes.begin(), meshes.end(),
                                 [](const Mesh* mesh) { return !mesh->position_tangents.empty(); });
  const auto end_faces = [&] {
    result.face_offsets.push_back(static_cast<uint32_t>(result.incident_faces.size()));
  };
  end_faces();
  for (const IntersectionSegment& segment : segments) {
    append_line(meshes, segment, moves, result);
    for (const FaceRef face : segment.faces) {
      result.incident_faces.push_back(face);
      result.incidences.push_back({.through = true, .motion_group = kNoMotionGroup});
    }
    end_faces();
  }
  const bool near = std::any_of(contacts.begin(), contacts.end(),
                                [](const ContactLine& line) { return !line.near.empty(); });
  if (near) result.near_offsets.assign(segments.size() + 1, 0);
  for (const ContactLine& line : contacts) {
    append_line(meshes, {{line.faces[0], line.faces[1]}, line.ends}, moves, result);
    result.edges.back().motion_group = line.motion_group;
    append(result.incident_faces, line.faces);
    append(result.incidences, line.incidences);
    end_faces();
    if (!near) continue;
    if (!line.near.empty()) {
      append(result.faces_and_near, line.faces);
      append(result.faces_and_near, line.near);
    }
    result.near_offsets.push_back(static_cast<uint32_t>(result.faces_and_near.size()));
  }
  return result;
}

}  // namespace limn
