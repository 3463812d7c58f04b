// Isotropic remeshing on OpenMesh's half-edges: the one door to that library.
#include "limn/integrators/remesh.h"

#include "limn/core/error.h"

#ifdef LIMN_OPENMESH
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Core/System/omstream.hh>

#include "integrators/fit/surface_tree.h"

namespace limn {

namespace {

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
  VertexAttributes(OpenMesh::Attributes::Status);
  EdgeAttributes(OpenMesh::Attributes::Status);
  HalfedgeAttributes(OpenMesh::Attributes::Status);
  FaceAttributes(OpenMesh::Attributes::Status);
};
using HalfEdges = OpenMesh::TriMesh_ArrayKernelT<Traits>;
using OpenMesh::EdgeHandle;
using OpenMesh::FaceHandle;
using OpenMesh::HalfedgeHandle;
using OpenMesh::VertexHandle;
using Point = Traits::Point;

constexpr int kRounds = 10;  // not tuned; Botsch and Kobbelt take five to ten

HalfEdges half_edges_of(const Mesh& mesh, const SourceLocation& where) {
  HalfEdges half_edges;
  std::vector<VertexHandle> handles(mesh.positions.size());
  const auto handle = [&](uint32_t v) {
    VertexHandle& h = handles[mesh.weld[v]];
    if (!h.is_valid()) {
      const Vec3d p = cast<double>(mesh.positions[v]);
      h = half_edges.add_vertex({p.x, p.y, p.z});
    }
    return h;
  };
  // What it says of bad faces is said better below.
  omerr().disable();
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& [a, b, c] = mesh.faces[f];
    if (half_edges.add_face(handle(a), handle(b), handle(c)).is_valid()) continue;
    throw InputError(where, "the mesh cannot be remeshed: it is not manifold at face " +
                                std::to_string(f) + " (counted from 0)");
  }
  return half_edges;
}

class Remesher {
 public:
  Remesher(const Mesh& mesh, double length, const SourceLocation& where)
      : m_(half_edges_of(mesh, where)), tree_(mesh), length_(length) {}

  Remeshed run() {
    for (int round = 0; round < kRounds; ++round) {
      split_long();
      collapse_short();
      flip();
      relax();
    }
    return result();
  }

 private:
  double edge_length(EdgeHandle e) const { return m_.calc_edge_length(e); }

  void split_long() {
    // Edges that appear on the way are looked at in the next round.
    const auto count = static_cast<int>(m_.n_edges());
    for (int i = 0; i < count; ++i) {
      const EdgeHandle e(i);
      if (m_.is_boundary(e) || edge_length(e) <= 4 * length_ / 3) continue;
      m_.split(e, m_.calc_edge_midpoint(e));
    }
  }

  Point normal(const Point& a, const Point& b, const Point& c) const {
    return OpenMesh::cross(b - a, c - a);
  }

  // Whether the vertex that h starts at may go to where it ends: no long edge, no face turned over.
  bool may_collapse(HalfedgeHandle h) {
    const VertexHandle from = m_.from_vertex_handle(h), to = m_.to_vertex_handle(h);
    if (m_.is_boundary(from) || !m_.is_collapse_ok(h)) return false;
    for (const VertexHandle v : m_.vv_range(from)) {
      if ((m_.point(v) - m_.point(to)).norm() > 4 * length_ / 3) return false;
    }
    for (const HalfedgeHandle out : m_.voh_range(from)) {
      const VertexHandle a = m_.to_vertex_handle(out);
      const VertexHandle b = m_.to_vertex_handle(m_.next_halfedge_handle(out));
      if (a == to || b == to) continue;
      const Point before = normal(m_.point(from), m_.point(a), m_.point(b));
      if (OpenMesh::dot(before, normal(m_.point(to), m_.point(a), m_.point(b))) <= 0) return false;
    }
    return true;
  }

  void collapse_short() {
    for (int i = 0; i < static_cast<int>(m_.n_edges()); ++i) {
      const EdgeHandle e(i);
      if (m_.status(e).deleted() || edge_length(e) >= 4 * length_ / 5) continue;
      for (const int side : {0, 1}) {
        const HalfedgeHandle h = m_.halfedge_handle(e, side);
        if (!may_collapse(h)) continue;
        m_.collapse(h);
        break;
      }
    }
    m_.garbage_collection();
  }

  int excess(VertexHandle v, int change) const {
    const int by = static_cast<int>(m_.valence(v)) + change - (m_.is_boundary(v) ? 4 : 6);
    return by * by;
  }

  void flip() {
    for (int i = 0; i < static_cast<int>(m_.n_edges()); ++i) {
      const EdgeHandle e(i);
      if (m_.is_boundary(e) || !m_.is_flip_ok(e)) continue;
      const HalfedgeHandle h = m_.halfedge_handle(e, 0), o = m_.halfedge_handle(e, 1);
      const VertexHandle a = m_.from_vertex_handle(h), b = m_.to_vertex_handle(h);
      const VertexHandle c = m_.to_vertex_handle(m_.next_halfedge_handle(h));
      const VertexHandle d = m_.to_vertex_handle(m_.next_halfedge_handle(o));
      const int before = excess(a, 0) + excess(b, 0) + excess(c, 0) + excess(d, 0);
      const int after = excess(a, -1) + excess(b, -1) + excess(c, 1) + excess(d, 1);
      if (after >= before) continue;
      const Point &pa = m_.point(a), &pb = m_.point(b), &pc = m_.point(c), &pd = m_.point(d);
      const Point mean = normal(pa, pb, pc) + normal(pb, pa, pd);
      if (OpenMesh::dot(mean, normal(pa, pd, pc)) <= 0) continue;
      if (OpenMesh::dot(mean, normal(pb, pc, pd)) <= 0) continue;
      m_.flip(e);
    }
  }

  // Towards the mean of the neighbours along the surface, then back onto the first surface.
  void relax() {
    std::vector<Point> moved(m_.n_vertices());
    for (const VertexHandle v : m_.vertices()) {
      const Point p = m_.point(v);
      moved[v.idx()] = p;
      if (m_.is_boundary(v) || m_.valence(v) == 0) continue;
      Point mean(0, 0, 0), n(0, 0, 0);
      for (const VertexHandle w : m_.vv_range(v)) mean += m_.point(w);
      mean /= static_cast<double>(m_.valence(v));
      for (const HalfedgeHandle out : m_.voh_range(v)) {
        const VertexHandle a = m_.to_vertex_handle(out);
        n += normal(p, m_.point(a), m_.point(m_.to_vertex_handle(m_.next_halfedge_handle(out))));
      }
      if (n.norm() > 0) mean += n * (OpenMesh::dot(n, p - mean) / n.sqrnorm());
      const Vec3d back = tree_.nearest({mean[0], mean[1], mean[2]}).point;
      moved[v.idx()] = {back.x, back.y, back.z};
    }
    for (const VertexHandle v : m_.vertices()) m_.set_point(v, moved[v.idx()]);
  }

  Remeshed result() const {
    Remeshed result;
    for (const VertexHandle v : m_.vertices()) {
      const Point& p = m_.point(v);
      result.positions.push_back(cast<float>(Vec3d{p[0], p[1], p[2]}));
    }
    for (const FaceHandle f : m_.faces()) {
      FaceIndices face;
      int k = 0;
      for (const VertexHandle v : m_.fv_range(f)) face[k++] = static_cast<uint32_t>(v.idx());
      result.faces.push_back(face);
    }
    return result;
  }

  HalfEdges m_;
  SurfaceTree tree_;
  double length_;
};

}  // namespace

Remeshed remesh(const Mesh& mesh, double length, const SourceLocation& where) {
  return Remesher(mesh, length, where).run();
}

bool can_remesh() { return true; }

}  // namespace limn

#else

namespace limn {

Remeshed remesh(const Mesh&, double, const SourceLocation& where) {
  throw InputError(where,
                   "this limn was built without OpenMesh, so it cannot remesh: install "
                   "libopenmesh-dev, and build it again");
}

bool can_remesh() { return false; }

}  // namespace limn

#endif
