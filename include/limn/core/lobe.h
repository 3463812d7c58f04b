#pragma once
// What an edge sampler may know of a BSDF without seeing it: how much it scatters at most, and
// which transformed cosine comes near it. Only importances follow from this: whatever a lobe says,
// estimates stay unbiased as long as its bound is positive where the scattering function is.
#include <cstdint>
#include <optional>

#include "limn/core/vec.h"

namespace limn {

class LobeModel;

// The lobe of a BSDF at a point: a model and its parameters. A value, compared by value.
struct LobeSummary {
  const LobeModel* model;  // never null; lasts as long as the program
  double alpha = 1;        // roughness, for the models that have one
  double albedo = 1;       // upper bound of the directional albedo over channels and directions
  LobeSummary();           // the hemisphere, see below
  LobeSummary(const LobeModel& m, double a, double bound) : model(&m), alpha(a), albedo(bound) {}
  bool operator==(const LobeSummary&) const = default;
};

// A row of a table of linearly transformed cosines (Heitz et al. 2016), fitted by tools/fit_ltc.
struct LtcRow {
  enum class Table : uint8_t { kGgx, kBeckmann };
  Table table;
  double alpha;
};

// One kind of lobe; a constant, whose address names it, and never deleted. The class itself is the
// hemisphere: exact for Lambert's law, and what a BSDF of which nothing is known may use with an
// albedo of 1 (draws then follow the cosine alone). A BSDF with another lobe derives from it in its
// own file. n: unit normal, wi: unit, towards the viewer, cos_i = n.wi > 0, wo: unit.
class LobeModel {
 public:
  // Unit direction about which the scattering function falls off.
  virtual Vec3d axis(const Vec3d& n, const Vec3d& /*wi*/) const { return n; }
  // Angle from the axis over which it changes notably, at most 1 [rad].
  virtual double width(const LobeSummary& /*lobe*/) const { return 1; }
  // Upper bound of the scattering function, cosine included, over all wo with n.wo <= cos_o and
  // axis.wo <= cos_axis; cos_o > 0 [1/sr].
  virtual double bound(const LobeSummary& lobe, double /*cos_i*/, double cos_o,
                       double /*cos_axis*/) const {
    return lobe.albedo / kPi * cos_o;
  }
  // The transformed cosine that comes near it; none for the plain cosine about n.
  virtual std::optional<LtcRow> ltc(const LobeSummary& /*lobe*/) const { return std::nullopt; }
};

inline constexpr LobeModel kHemisphere;
inline LobeSummary::LobeSummary() : model(&kHemisphere) {}

// Rough mirrors: microfacets with Smith's masking. The bound is for F <= albedo.
const LobeModel& ggx_lobe();
const LobeModel& beckmann_lobe();

}  // namespace limn
