// A term that no renderer needs, as a stranger would add one: this file, a row and a factory in
// term_table.h, and this file's name in a CMakeLists.txt. It adds, at the first vertex of every
// path, the velocity of a point of the second shape's first edge against the vertex:
//   amount g . (v(x) - v_vertex),   g = (0, 2, 0), x a quarter of the way along the edge.
#include "integrators/terms/term_table.h"

namespace limn {
namespace {

class PlantedTerm final : public Term {
 public:
  explicit PlantedTerm(TermInput& input) : input_(input.edges()) {}

  bool uses_vertices() const override { return true; }
  void add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const override {
    if (vertex.bounces > 0) return;
    const EdgeRef edge{ShapeId(1), EdgeId(0)};
    const EdgeMesh& mesh = input_.object(edge.object);
    const auto [a, b] = mesh.edge(edge.edge).vertices;
    constexpr double kT = 0.25;
    BoundaryForm form;
    form.x = mesh.position(a) * (1 - kT) + mesh.position(b) * kT;
    form.distance = length(form.x - vertex.surface.p);
    form.held = true;
    form.add_edge(mesh, edge, kT, {0, 2, 0});
    for (int i = 0; i < samples; ++i) {
      ++sink.cost().samples;
      if (!sink.takes(form, vertex.key)) continue;
      ++sink.cost().counted;
      sink.add(vertex.throughput);
    }
  }

 private:
  const EdgeSamplerInput& input_;
};

}  // namespace

std::unique_ptr<Term> make_planted_term(TermInput& input) {
  return std::make_unique<PlantedTerm>(input);
}

}  // namespace limn
