// The interior term: what slides within continuous regions. The path tracer carries it, as the
// derivative of the radiance that a path finds.
#include "integrators/terms/term_table.h"

namespace limn {
namespace {

class InteriorTerm final : public Term {
 public:
  bool uses_paths() const override { return true; }
  Rgb<Lanes> add_path(const Rgb<Dual>& radiance) const override {
    return {radiance.r.d, radiance.g.d, radiance.b.d};
  }
};

}  // namespace

std::unique_ptr<Term> make_interior_term(TermInput&) { return std::make_unique<InteriorTerm>(); }

}  // namespace limn
