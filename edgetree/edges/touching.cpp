// Unites touching edges: splits each into parts, each with all faces around it.
//
// Coincident boundaries. Let boundaries 1 ... n coincide as seen from p, each that of a group of
// faces that move alike, and let s_k be the speed of boundary k across its line. Shortly afterwards
// they are separate, in some order, and radiance is constant between neighbours: L_0 before the
// first and L_n after the last. The integral of radiance over directions changes at the rate
//   sum over k of s_k (L_(k-1) - L_k).
// If all have one speed s it is s (L_0 - L_n), and they are one edge. Otherwise each boundary is an
// edge of its own, with its own velocity and the radiance difference between its neighbourhoods. It
// needs all faces, and the group that moves with it. The order differs before and after contact;
// edge_difference uses the one in which surfaces separate instead of interpenetrating.
#include "limn/edgetree/touching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "edgetree/edges/contacts.h"
#include "edgetree/edges/fold.h"
#include "limn/core/check.h"

namespace limn {
namespace {

// A face around a part of an edge.
struct Neighbour {
  FaceRef face;
  EdgeId along;             // the edge of its mesh along the part, or none
  bool own = false;         // adjacent to the edge before it was united
  Vec3<Lanes> velocity[2];  // at the ends of the part
  Lanes slack;              // uncertainty of `velocity` from the rounding of positions
  uint8_t motion_group = 0;
};

using Corners = std::array<Vec3d, 3>;

class Unifier {
 public:
  Unifier(std::span<const TouchingShape> shapes, const Vec3d& viewer,
          std::vector<EdgeMesh>& objects)
      : shapes_(shapes), viewer_(viewer), objects_(objects) {
    find_speeds();
  }

  TouchingMotion unite(const Contacts& found) {
    const std::span<const Contact> contacts = found.contacts;
    for (size_t begin = 0, end; begin < contacts.size(); begin = end) {
      const EdgeRef id = contacts[begin].edge;
      for (end = begin; end < contacts.size() && contacts[end].edge == id; ++end) continue;
      cut(id, contacts.subspan(begin, end - begin));
    }
    for (uint32_t o = 0; o < objects_.size(); ++o) {
      const auto near = of_object(found.near, o);
      const auto parts = parts_.find(o);
      if (parts != parts_.end() || !near.empty())
        rewrite(o, parts != parts_.end() ? parts->second : std::vector<Part>{}, near);
    }
    for (ContactLine& line : lines_) {
      for (const NearFace& near : of_object(found.near, line.edge.object.index())) {
        const auto begin = line.faces.begin(), end = line.faces.end();
        if (near.edge == line.edge && std::find(begin, end, near.face) == end)
          line.near.push_back(near.face);
      }
    }
    return {std::move(lines_), {parting_.begin(), parting_.end()}};
  }

 private:
  // A part of an edge that stays; without faces (edge_class of the whole) for a removed edge.
  struct Part {
    EdgeId whole;
    Edge edge;
    std::vector<FaceRef> faces;
    std::vector<Incidence> incidences;
  };

  const Edge& edge(EdgeRef id) const { return objects_[id.object.index()].edge(id.edge); }
  Vec3d position(EdgeRef id, double t) const {
    const EdgeMesh& mesh = objects_[id.object.index()];
    const auto [a, b] = edge(id).vertices;
    if (t == 0) return mesh.position(a);
    if (t == 1) return mesh.position(b);
    return mesh.position(a) + (mesh.position(b) - mesh.position(a)) * t;
  }
  Vec3<Lanes> velocity(EdgeRef id, double t) const {
    const EdgeMesh& mesh = objects_[id.object.index()];
    if (mesh.tangents.empty()) return {};
    const auto [a, b] = edge(id).vertices;
    return mesh.tangent(a) * (1 - t) + mesh.tangent(b) * t;
  }
  Corners corners(FaceRef face) const {
    return face_corners<double>(*shapes_[face.shape.index()].mesh, face.face);
  }
  const Plane& plane(FaceRef face) const { return objects_[face.shape.index()].plane(face.face); }
  double size(EdgeRef id) const {
    const size_t object = id.object.index();
    return size_around(objects_[object], *shapes_[object].mesh, id.edge);
  }

  // Velocity of the point x of the face's plane.
  Vec3<Lanes> velocity(FaceRef face, const Vec3d& x) const {
    const Mesh& mesh = *shapes_[face.shape.index()].mesh;
    if (mesh.position_tangents.empty()) return {};
    const Corners c = corners(face);
    const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
    const double scale = 1 / length_squared(n);
    const double b1 = dot(cross(x - c[0], c[2] - c[0]), n) * scale;
    const double b2 = dot(cross(c[1] - c[0], x - c[0]), n) * scale;
    const FaceIndices& f = mesh.face(face.face);
    return mesh.position_tangents[f[0]] * (1 - b1 - b2) + mesh.position_tangents[f[1]] * b1 +
           mesh.position_tangents[f[2]] * b2;
  }

  // Change of a face's velocity within the rounding of its corners.
  Lanes slack(FaceRef face) const {
    const Mesh& mesh = *shapes_[face.shape.index()].mesh;
    Lanes slack;
    if (mesh.position_tangents.empty()) return slack;
    const FaceIndices& f = mesh.face(face.face);
    const Corners c = corners(face);
    const double size = size_of(mesh, face.face), tolerance = touch_tolerance(size, size);
    for (int s = 0; s < 3; ++s) {
      const int next = (s + 1) % 3;
      const double side = length(c[next] - c[s]);
      if (side == 0) continue;
      const Vec3<Lanes> change = mesh.position_tangents[f[next]] - mesh.position_tangents[f[s]];
      for (int k = 0; k < 3; ++k)
        for (int i = 0; i < kLanes; ++i)
          slack[i] = std::max(slack[i], std::fabs(change[k][i]) * tolerance / side);
    }
    return slack;
  }

  void find_speeds() {
    for (const TouchingShape& shape : shapes_)
      for (const Vec3<Lanes> v : shape.mesh->position_tangents)
        for (int k = 0; k < 3; ++k)
          for (int i = 0; i < kLanes; ++i) speeds_[i] = std::max(speeds_[i], std::fabs(v[k][i]));
  }
  // Equal up to float rounding of the fastest velocity, and of the positions: velocities depend on
  // positions, which are coarse far from the origin.
  bool moves_alike(const Neighbour& a, const Neighbour& b) const {
    for (int end = 0; end < 2; ++end)
      for (int k = 0; k < 3; ++k)
        for (int i = 0; i < kLanes; ++i)
          if (std::fabs(a.velocity[end][k][i] - b.velocity[end][k][i]) >
              0x1.0p-20 * speeds_[i] + a.slack[i] + b.slack[i])
            return false;
    return true;
  }

  void cut(EdgeRef id, std::span<const Contact> contacts) {
    const double edge_length = length(position(id, 1) - position(id, 0));
    const double shortest = kShortestTouch * touch_tolerance(size(id), size(id)) / edge_length;
    std::vector<double> ends{0};
    std::vector<double> between;
    for (const Contact& contact : contacts) {
      between.push_back(contact.t0);
      between.push_back(contact.t1);
    }
    std::sort(between.begin(), between.end());
    for (const double t : between)
      if (t - ends.back() > shortest && t < 1 - shortest) ends.push_back(t);
    ends.push_back(1);
    drop(id);
    for (size_t i = 0; i + 1 < ends.size(); ++i) add_part(id, contacts, ends[i], ends[i + 1]);
  }

  void drop(EdgeRef id) { parts_[id.object.index()].push_back({id.edge, edge(id), {}, {}}); }

  void add_part(EdgeRef id, std::span<const Contact> contacts, double t0, double t1) {
    std::vector<Neighbour> around;
    const auto add = [&](FaceRef face, EdgeId along, bool own) {
      const auto same = [&](const Neighbour& n) { return n.face == face; };
      if (std::any_of(around.begin(), around.end(), same)) return;
      Neighbour n{face, along, own, {}, slack(face), 0};
      for (int i = 0; i < 2; ++i)
        n.velocity[i] =
            own ? velocity(id, i == 0 ? t0 : t1) : velocity(face, position(id, i == 0 ? t0 : t1));
      around.push_back(n);
    };
    for (const FaceRef face : objects_[id.object.index()].faces_around(id.edge))
      add(face, id.edge, true);
    const double middle = 0.5 * (t0 + t1);
    for (const Contact& contact : contacts)
      if (contact.t0 <= middle && middle <= contact.t1) add(contact.face, contact.along, false);

    Part part{id.edge, edge(id), {}, {}};
    part.edge.vertices = {vertex_at(id, t0), vertex_at(id, t1)};
    const bool flat = edge(id).edge_class == EdgeClass::kFlat;
    if (around.back().own || flat) {
      if (!around.back().own) add_crossing(id, part.edge, around);
      const auto faces = objects_[id.object.index()].faces_around(id.edge);
      part.faces.assign(faces.begin(), faces.end());
      part.incidences.resize(faces.size());
    } else if (!unite_part(id, around, part)) {
      return;
    }
    parts_[id.object.index()].push_back(std::move(part));
  }

  // Where a plane of several faces passes through another along common edges, no face has corners
  // on both sides (crossing_curves.h), and no edge is a boundary edge.
  void add_crossing(EdgeRef id, const Edge& part, std::vector<Neighbour>& around) {
    number_rims(around);
    mark_planes(id, around);
    const auto own =
        std::find_if(around.begin(), around.end(), [](const auto& n) { return n.own; });
    const Neighbour* other = nullptr;
    for (Neighbour& n : around) {
      if (n.own) n.motion_group = kNoMotionGroup;
      if (n.motion_group != kNoMotionGroup) return;  // its edge is a boundary edge
      const EdgeRef along{n.face.shape, n.along};
      if (n.along.valid() && std::tuple(along.object, along.edge) < std::tuple(id.object, id.edge))
        return;  // the other one adds it
      if (!n.own && !other && !parallel(n, *own)) other = &n;
    }
    if (!other) return;
    const EdgeMesh& mesh = objects_[id.object.index()];
    const auto [a, b] = part.vertices;
    lines_.push_back(
        contact_line(id, {mesh.position(a), mesh.position(b)}, {&*own, other}, around));
  }

  // Returns false if the part is no edge, or another edge represents it.
  bool unite_part(EdgeRef id, std::vector<Neighbour>& around, Part& part) {
    // All edges at this place agree on this order.
    std::sort(around.begin(), around.end(), [](const Neighbour& a, const Neighbour& b) {
      return std::tuple(a.face.shape, a.face.face) < std::tuple(b.face.shape, b.face.face);
    });
    number_rims(around);
    const auto own =
        std::find_if(around.begin(), around.end(), [](const auto& n) { return n.own; });
    const uint8_t motion_group = own->motion_group;
    for (const Neighbour& n : around)
      if (n.motion_group == motion_group && stands_for(n, id)) return false;
    mark_planes(id, around);
    if (std::none_of(around.begin(), around.end(),
                     [&](const auto& n) { return n.motion_group == motion_group; })) {
      add_crossing(id, part.edge, around);
      return false;
    }
    if (const auto pressed = find_pressed(id, around)) {
      const EdgeMesh& mesh = objects_[id.object.index()];
      const auto [a, b] = part.edge.vertices;
      lines_.push_back(contact_line(id, {mesh.position(a), mesh.position(b)}, *pressed, around));
      return false;
    }
    add_parting(id, around);
    part.edge.motion_group = motion_group;
    part.edge.edge_class = EdgeClass::kIrregular;
    part.edge.concave = false;
    // The edge's own faces first, in their order; then others of its mesh.
    const auto faces = objects_[id.object.index()].faces_around(id.edge);
    std::stable_sort(around.begin(), around.end(), [&](const Neighbour& a, const Neighbour& b) {
      return rank(a, id, faces) < rank(b, id, faces);
    });
    for (const Neighbour& n : around) {
      part.faces.push_back(n.face);
      part.incidences.push_back({!n.along.valid(), n.motion_group});
    }
    const bool has_second = around[1].face.shape == id.object;
    part.edge.faces[1] = has_second ? around[1].face.face : FaceId::none();
    return true;
  }

  void add_parting(EdgeRef id, const std::vector<Neighbour>& around) {
    const Vec3d along = normalize(position(id, 1) - position(id, 0));
    for (size_t i = 0; i < around.size(); ++i)
      for (size_t j = 0; j < i; ++j) {
        const auto [first, second] = std::minmax(around[i].face.shape, around[j].face.shape);
        if (part_from(around[i], around[j], along)) parting_.insert({first, second});
      }
  }

  // True if a gap opens between two faces to one side of the present, and they interpenetrate to
  // the other side: two boundaries with different motions across their line, or a boundary that
  // moves relative to the plane of a face without one. Sliding along that plane does neither.
  bool part_from(const Neighbour& a, const Neighbour& b, const Vec3d& along) const {
    if (a.motion_group == b.motion_group) return false;
    const Neighbour* const plain = a.motion_group == kNoMotionGroup   ? &a
                                   : b.motion_group == kNoMotionGroup ? &b
                                                                      : nullptr;
    for (int end = 0; end < 2; ++end) {
      const Vec3<Lanes> apart = a.velocity[end] - b.velocity[end];
      const Lanes normal = plain ? dot(apart, plane(plain->face).n) : Lanes{};
      const Lanes sliding = dot(apart, along);
      for (int i = 0; i < kLanes; ++i) {
        double most = std::fabs(normal[i]);
        for (int k = 0; k < 3 && !plain; ++k)
          most = std::max(most, std::fabs(apart[k][i] - along[k] * sliding[i]));
        if (most > 0x1.0p-20 * speeds_[i] + a.slack[i] + b.slack[i]) return true;
      }
    }
    return false;
  }

  // The edge's own face that ends at the contact, and a face of another shape that it rests on.
  struct Pressed {
    const Neighbour *standing, *under;
  };

  // Contact that closes or opens: the edge's own faces stand on the interior of all
  // others, or end there half sunk in them, or stand on a body whose edge is at the same
  // place.
  std::optional<Pressed> find_pressed(EdgeRef id, const std::vector<Neighbour>& around) const {
    auto pressed = standing_inside(id, around);
    if (!pressed) pressed = standing_flush(id, around);
    if (!pressed) return std::nullopt;
    const auto& [own, under] = *pressed;
    for (int end = 0; end < 2; ++end) {
      const Lanes apart = dot(own->velocity[end] - under->velocity[end], plane(under->face).n);
      for (int i = 0; i < kLanes; ++i)
        if (std::fabs(apart[i]) > 0x1.0p-20 * speeds_[i] + own->slack[i] + under->slack[i])
          return pressed;
    }
    return std::nullopt;
  }

  bool parallel(const Neighbour& a, const Neighbour& b) const {
    return length(cross(plane(a.face).n, plane(b.face).n)) <= 0x1.0p-12;  // as in agree()
  }

  // One face stands on a plane of others without boundaries, or one on either side of it; then the
  // one on the viewer's side counts, as seen from where the body is sunk. The orientation of the
  // plane's faces is irrelevant, as they may be seen from both sides.
  std::optional<Pressed> standing_inside(EdgeRef id, const std::vector<Neighbour>& around) const {
    const auto under =
        std::find_if(around.begin(), around.end(), [](const auto& n) { return !n.own; });
    const Vec3d x0 = position(id, 0), x1 = position(id, 1);
    const Vec3d n_under = plane(under->face).n;
    const Vec3d up = dot(n_under, viewer_ - x0) < 0 ? -n_under : n_under;
    const Neighbour* standing[2] = {nullptr, nullptr};  // behind, in front
    for (const Neighbour& n : around) {
      if (!n.own && (n.motion_group != kNoMotionGroup || !parallel(n, *under))) return std::nullopt;
      if (!n.own || parallel(n, *under)) continue;
      const bool in_front = dot(up, far_corner(n.face, x0, x1) - x0) > 0;
      if (standing[in_front]) return std::nullopt;
      standing[in_front] = &n;
    }
    if (!standing[0] && !standing[1]) return std::nullopt;
    return Pressed{standing[1] ? standing[1] : standing[0], &*under};
  }

  // Two bodies with two faces each, one face of each in contact. When pressed, an upright
  // body on an upright or widening one ends in the other's plane, and both boundaries are
  // one. Of two upright bodies the later shape ends, since coincident faces show the
  // first.
  std::optional<Pressed> standing_flush(EdgeRef id, const std::vector<Neighbour>& around) const {
    if (around.size() != 4) return std::nullopt;
    const Vec3d x0 = position(id, 0), along = position(id, 1) - x0;
    const auto inside = [&](const Neighbour& n, const Neighbour& of) {
      return dot(cross(plane(n.face).n, along), far_corner(of.face, x0, x0 + along) - x0);
    };
    const auto meet = [&](const Neighbour& a, const Neighbour& b) {
      return parallel(a, b) && dot(plane(a.face).n, plane(b.face).n) < 0 &&
             inside(a, a) * inside(a, b) > 0;
    };
    for (const Neighbour& cap : around) {
      for (const Neighbour& under : around) {
        if (!cap.own || under.own || cap.motion_group == under.motion_group || !meet(cap, under))
          continue;
        const Neighbour *standing = nullptr, *other = nullptr;
        for (const Neighbour& n : around) {
          if (&n == &cap || &n == &under) continue;
          (n.own ? standing : other) = &n;
        }
        if (!standing || !other || standing->motion_group != cap.motion_group ||
            other->motion_group != under.motion_group || other->face.shape != under.face.shape ||
            under.face.shape == id.object)
          return std::nullopt;
        const double own_lean = dot(plane(standing->face).n, plane(under.face).n);
        const double lean = dot(plane(other->face).n, plane(cap.face).n);
        const double rounding = 0x1.0p-12;
        const bool later = under.face.shape < id.object;
        if (std::fabs(own_lean) > rounding || lean > (later ? rounding : -rounding))
          return std::nullopt;
        return Pressed{standing, &under};
      }
    }
    return std::nullopt;
  }

  static ContactLine contact_line(EdgeRef id, const std::array<Vec3d, 2>& ends,
                                  const Pressed& pressed, const std::vector<Neighbour>& around) {
    ContactLine line{id, ends, pressed.standing->motion_group, {}, {}};
    const auto add = [&](const Neighbour& n) {
      line.faces.push_back(n.face);
      line.incidences.push_back({!n.along.valid(), n.motion_group});
    };
    add(*pressed.standing);
    add(*pressed.under);
    for (const Neighbour& n : around)
      if (&n != pressed.standing && &n != pressed.under) add(n);
    return line;
  }

  static size_t rank(const Neighbour& n, EdgeRef id, std::span<const FaceRef> faces) {
    if (n.own) return std::find(faces.begin(), faces.end(), n.face) - faces.begin();
    return n.face.shape == id.object ? faces.size() : faces.size() + 1;
  }

  // Assigns motion groups to neighbours; the last group takes all that are left.
  void number_rims(std::vector<Neighbour>& around) const {
    std::vector<const Neighbour*> motion_groups;
    for (Neighbour& n : around) {
      if (!n.along.valid()) {
        n.motion_group = kNoMotionGroup;
        continue;
      }
      const auto same = [&](const Neighbour* first) { return moves_alike(n, *first); };
      const auto found = std::find_if(motion_groups.begin(), motion_groups.end(), same);
      n.motion_group = static_cast<uint8_t>(
          std::min<size_t>(found - motion_groups.begin(), kMostMotionGroups - 1));
      if (found == motion_groups.end()) motion_groups.push_back(&n);
    }
  }

  // True if the neighbour's edge, which moves as edge `id` does, represents that edge.
  bool stands_for(const Neighbour& n, EdgeRef id) const {
    const EdgeRef other{n.face.shape, n.along};
    return edge(other).edge_class != EdgeClass::kFlat &&
           std::tuple(other.object, other.edge) < std::tuple(id.object, id.edge);
  }

  // Clears the groups of faces that continue each other across the edge.
  void mark_planes(EdgeRef id, std::vector<Neighbour>& around) const {
    for (size_t i = 0; i < around.size(); ++i)
      for (size_t j = 0; j < i; ++j) {
        if (around[i].motion_group != around[j].motion_group ||
            around[i].motion_group == kNoMotionGroup)
          continue;
        if (continues(id, around[i].face, around[j].face))
          around[i].motion_group = around[j].motion_group = kNoMotionGroup;
      }
  }

  bool continues(EdgeRef id, FaceRef a, FaceRef b) const {
    const TouchingShape &shape_a = shapes_[a.shape.index()], &shape_b = shapes_[b.shape.index()];
    if (shape_a.look != shape_b.look || shape_a.textured || !agree(plane(a).n, plane(b).n))
      return false;
    const auto normal_a = shading_normal(a), normal_b = shading_normal(b);
    if (!normal_a || !normal_b || !agree(*normal_a, *normal_b)) return false;
    const Vec3d x0 = position(id, 0), x1 = position(id, 1);
    const Vec3d c = far_corner(a, x0, x1), d = far_corner(b, x0, x1);
    const Vec3d side = cross(plane(a).n, x1 - x0);
    if (dot(side, c - x0) * dot(side, d - x0) >= 0) return false;
    const Fold fold = fold_of(x0, x1, c, d);
    return std::fabs(fold.volume) <= 2 * fold.rounding;  // edges were rounded separately
  }

  // The tolerance of flat edges (edges.cpp).
  static bool agree(const Vec3d& a, const Vec3d& b) {
    return dot(a, b) > 0 && length(cross(a, b)) <= 0x1.0p-12;
  }

  // The shading normal of a face, if it is constant.
  std::optional<Vec3d> shading_normal(FaceRef face) const {
    const Mesh& mesh = *shapes_[face.shape.index()].mesh;
    if (mesh.normal_source == NormalSource::kFace) return plane(face).n;
    const FaceIndices& ids = mesh.normal_ids[face.face.index()];
    const Vec3d& n = mesh.normals[ids[0]];
    if (!(n == mesh.normals[ids[1]]) || !(n == mesh.normals[ids[2]])) return std::nullopt;
    return n;
  }

  Vec3d far_corner(FaceRef face, const Vec3d& x0, const Vec3d& x1) const {
    const Vec3d along = normalize(x1 - x0);
    const Corners c = corners(face);
    return *std::max_element(c.begin(), c.end(), [&](const Vec3d& a, const Vec3d& b) {
      return length_squared(cross(along, a - x0)) < length_squared(cross(along, b - x0));
    });
  }

  // The vertex at parameter t of the edge; new unless t is an end.
  VertexId vertex_at(EdgeRef id, double t) {
    if (t == 0) return edge(id).vertices[0];
    if (t == 1) return edge(id).vertices[1];
    const auto [found, is_new] = cuts_.emplace(std::tuple(id.object, id.edge, t), VertexId::none());
    if (!is_new) return found->second;
    EdgeMesh& mesh = objects_[id.object.index()];
    found->second = VertexId(static_cast<uint32_t>(mesh.positions.size()));
    mesh.positions.push_back(position(id, t));
    mesh.cuts.push_back({edge(id).vertices, t});
    if (!mesh.tangents.empty()) mesh.tangents.push_back(velocity(id, t));
    return found->second;
  }

  static std::span<const NearFace> of_object(std::span<const NearFace> near, uint32_t object) {
    const auto [begin, end] = std::equal_range(
        near.begin(), near.end(), NearFace{{ShapeId(object), {}}, {}},
        [](const NearFace& a, const NearFace& b) { return a.edge.object < b.edge.object; });
    return {begin, end};
  }

  // Appends faces near to the whole edge that are not around its part.
  static void append_near(std::span<const NearFace> near, EdgeId whole,
                          std::span<const FaceRef> faces, EdgeMesh& mesh) {
    const size_t before = mesh.faces_and_near.size();
    const auto [begin, end] = std::equal_range(
        near.begin(), near.end(), NearFace{{{}, whole}, {}},
        [](const NearFace& a, const NearFace& b) { return a.edge.edge < b.edge.edge; });
    if (begin != end)
      mesh.faces_and_near.insert(mesh.faces_and_near.end(), faces.begin(), faces.end());
    for (auto i = begin; i != end; ++i)
      if (std::find(faces.begin(), faces.end(), i->face) == faces.end())
        mesh.faces_and_near.push_back(i->face);
    if (mesh.faces_and_near.size() == before + faces.size()) mesh.faces_and_near.resize(before);
    mesh.near_offsets.push_back(static_cast<uint32_t>(mesh.faces_and_near.size()));
  }

  // parts: sorted by edge, a whole edge before its parts.
  void rewrite(uint32_t object, std::span<const Part> parts, std::span<const NearFace> near) {
    EdgeMesh& mesh = objects_[object];
    EdgeMesh old;
    old.shape = mesh.shape;
    old.edges = std::exchange(mesh.edges, {});
    old.face_offsets = std::exchange(mesh.face_offsets, {0});
    old.incident_faces = std::exchange(mesh.incident_faces, {});
    struct Source {
      const Edge* edge;
      const Part* part;  // null: the edge is unchanged
    };
    std::vector<Source> sources, changed;
    sources.reserve(old.edges.size() + parts.size());
    size_t next = 0;
    for (uint32_t e = 0; e < old.edges.size(); ++e) {
      if (next == parts.size() || parts[next].whole != EdgeId(e)) {
        sources.push_back({&old.edges[e], nullptr});
        continue;
      }
      for (++next; next < parts.size() && parts[next].whole == EdgeId(e); ++next)
        changed.push_back({&parts[next].edge, &parts[next]});
    }
    const auto before = [](const Source& a, const Source& b) {
      const auto ends = [](const Source& s) {
        return std::minmax(s.edge->vertices[0], s.edge->vertices[1]);
      };
      return ends(a) < ends(b);
    };
    std::stable_sort(changed.begin(), changed.end(), before);
    // The edges of a mesh are sorted.
    const auto middle = sources.insert(sources.end(), changed.begin(), changed.end());
    DCHECK(std::is_sorted(sources.begin(), middle, before));
    std::inplace_merge(sources.begin(), middle, sources.end(), before);
    mesh.edges.reserve(sources.size());
    mesh.face_offsets.reserve(sources.size() + 1);
    mesh.incident_faces.reserve(2 * sources.size());
    mesh.near_offsets.reserve(sources.size() + 1);
    mesh.near_offsets.assign(1, 0);
    for (const Source& source : sources) {
      mesh.edges.push_back(*source.edge);
      const EdgeId whole = source.part
                               ? source.part->whole
                               : EdgeId(static_cast<uint32_t>(source.edge - old.edges.data()));
      const FaceList faces = source.part ? FaceList(source.part->faces) : old.faces_around(whole);
      append_near(near, whole, faces, mesh);
      mesh.incident_faces.insert(mesh.incident_faces.end(), faces.begin(), faces.end());
      mesh.incidences.resize(mesh.incident_faces.size());
      if (source.part) {
        std::copy(source.part->incidences.begin(), source.part->incidences.end(),
                  mesh.incidences.end() - static_cast<ptrdiff_t>(faces.size()));
      }
      mesh.face_offsets.push_back(static_cast<uint32_t>(mesh.incident_faces.size()));
    }
    if (std::all_of(mesh.incidences.begin(), mesh.incidences.end(),
                    [](const Incidence& i) { return i == Incidence{}; })) {
      mesh.incidences.clear();
    }
    if (mesh.faces_and_near.empty()) mesh.near_offsets.clear();
  }

  std::span<const TouchingShape> shapes_;
  const Vec3d viewer_;
  std::vector<EdgeMesh>& objects_;
  Lanes speeds_;                                 // largest component of a velocity
  std::map<uint32_t, std::vector<Part>> parts_;  // of each object
  std::vector<ContactLine> lines_;
  std::set<std::array<ShapeId, 2>> parting_;
  std::map<std::tuple<ShapeId, EdgeId, double>, VertexId> cuts_;
};

}  // namespace

TouchingMotion unite_touching_edges(std::span<const TouchingShape> shapes,
                                    std::span<const FacePair> pairs, const Vec3d& viewer,
                                    int threads, std::vector<EdgeMesh>& objects) {
  std::vector<const Mesh*> meshes;
  for (const TouchingShape& shape : shapes) meshes.push_back(shape.mesh);
  const Contacts found = find_contacts(objects, meshes, pairs, viewer, threads);
  if (found.contacts.empty() && found.near.empty()) return {};
  return Unifier(shapes, viewer, objects).unite(found);
}

}  // namespace limn
