// The BSDFs by the names of their types.
#include "limn/core/names.h"
#include "src/bsdf/types.h"

namespace limn {
namespace {

struct BsdfType {
  const char* name;
  std::shared_ptr<Bsdf> (*read)(Properties& properties);
};

constexpr BsdfType kTypes[] = {
    {"diffuse", read_diffuse},
    {"roughconductor", read_roughconductor},
    {"twosided", read_twosided},
};

}  // namespace

std::shared_ptr<Bsdf> make_bsdf(Properties& properties) {
  for (const BsdfType& type : kTypes) {
    if (properties.type() == type.name) return type.read(properties);
  }
  throw InputError(properties.where(),
                   unknown_name("bsdf type", properties.type(), names_of(kTypes)));
}

Rgb<double> read_reflectance(Properties& properties, const char* name, double absent) {
  const Rgb<double> c = properties.rgb(name, grey(absent));
  for (int i = 0; i < 3; ++i) {
    if (!(c[i] >= 0 && c[i] <= 1)) properties.fail(name, "a reflectance must lie in [0, 1]");
  }
  return c;
}

}  // namespace limn
