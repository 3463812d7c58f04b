#pragma once
// A summary of a BSDF for edge samplers: an upper bound of its albedo, and a linearly transformed
// cosine that approximates it. It is used as importance only: estimates stay unbiased as long as
// its bound is positive wherever the scattering function is.
#include <algorithm>
#include <cstdint>
#include <optional>

#include "limn/core/vec.h"

namespace limn {

class LobeModel;

// The least share of the cosine in a glossy lobe's importance: positive wherever the lobe is. Not
// tuned.
inline constexpr double kLtcFloor = 0.1;

// The lobe of a BSDF at a point: a model and its parameters. Compared by value.
struct LobeSummary {
  const LobeModel* model;  // never null; static storage duration
  double alpha = 1;        // roughness, for the models that have one
  double albedo = 1;       // upper bound of the directional albedo over channels and directions
  // Diffuse light beside a glossy lobe: its part of the albedo, and the reflectance of the glossy
  // part at normal incidence, which rises towards 1 at grazing angles (Fresnel).
  double diffuse = 0;
  double facing = 1;
  LobeSummary();  // the hemisphere, see below
  LobeSummary(const LobeModel& m, double a, double bound) : model(&m), alpha(a), albedo(bound) {}
  bool operator==(const LobeSummary&) const = default;

  // The share of the plain cosine in the importance, for a viewer at cos_i: at least kLtcFloor.
  double cosine_share(double cos_i) const {
    const double away = 1 - cos_i, squared = away * away;
    const double glossy = facing + (1 - facing) * (squared * squared * away);  // Schlick 1994
    return std::max(kLtcFloor, diffuse / (diffuse + glossy));
  }
};

// An entry of a table of linearly transformed cosines (Heitz et al. 2016), fitted by tools/fit_ltc.
struct LtcRow {
  enum class Table : uint8_t { kGgx, kBeckmann };
  Table table;
  double alpha;
};

// A kind of lobe: a constant with static storage duration, identified by its address. This class is
// the hemisphere: exact for Lambert's law, and a safe choice with albedo 1 for an unknown BSDF
// (edges are then drawn by the cosine alone). Other lobes derive from it, next to their BSDF. n:
// unit normal; wi: unit, towards the viewer, cos_i = n.wi > 0; wo: unit.
class LobeModel {
 public:
  // The unit direction around which the lobe is concentrated.
  virtual Vec3d axis(const Vec3d& n, const Vec3d& /*wi*/) const { return n; }
  // The angle from the axis over which the lobe changes notably, at most 1 [rad].
  virtual double width(const LobeSummary& /*lobe*/) const { return 1; }
  // Upper bound of the scattering function, cosine included, over all wo with n.wo <= cos_o and
  // axis.wo <= cos_axis; cos_o > 0 [1/sr].
  virtual double bound(const LobeSummary& lobe, double /*cos_i*/, double cos_o,
                       double /*cos_axis*/) const {
    return lobe.albedo / kPi * cos_o;
  }
  // The linearly transformed cosine that approximates the lobe; none for a cosine about n.
  virtual std::optional<LtcRow> ltc(const LobeSummary& /*lobe*/) const { return std::nullopt; }
};

inline constexpr LobeModel kHemisphere;
inline LobeSummary::LobeSummary() : model(&kHemisphere) {}

// Rough conductors: microfacets with Smith's masking. The bound assumes F <= albedo.
const LobeModel& ggx_lobe();
const LobeModel& beckmann_lobe();

}  // namespace limn
