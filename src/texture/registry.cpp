// The table of texture types, and what they share.
#include <fmt/format.h>

#include <cmath>

#include "limn/core/image.h"
#include "limn/core/names.h"
#include "src/texture/types.h"

namespace limn {
namespace {

struct TextureType {
  const char* name;
  std::shared_ptr<Texture> (*read)(Properties& properties);
};

constexpr TextureType kTypes[] = {
    {"bitmap", read_bitmap},
    {"checkerboard", read_checkerboard},
    {"mesh_attribute", read_mesh_attribute},
};

}  // namespace

Image TexelMap::texels() const { return {}; }

std::shared_ptr<Texture> make_texture(Properties& properties) {
  for (const TextureType& type : kTypes) {
    if (properties.type() == type.name) return type.read(properties);
  }
  throw InputError(properties.where(),
                   unknown_type("texture", properties.type(), names_of(kTypes)));
}

bool UvTransform::is_identity() const {
  return m[0][0] == 1 && m[0][1] == 0 && m[0][2] == 0 && m[1][0] == 0 && m[1][1] == 1 &&
         m[1][2] == 0;
}

bool UvTransform::keeps_integers() const {
  for (const auto& row : m) {
    if (row[0] != std::round(row[0]) || row[1] != std::round(row[1])) return false;
  }
  return true;
}

std::string UvTransform::describe() const {
  if (is_identity()) return "";
  return fmt::format(", to_uv {:g} {:g} {:g}, {:g} {:g} {:g}", m[0][0], m[0][1], m[0][2], m[1][0],
                     m[1][1], m[1][2]);
}

UvTransform read_to_uv(Properties& properties) {
  const Matrix4 t = properties.transform("to_uv");
  UvTransform uv;
  for (int i = 0; i < 2; ++i) {
    uv.m[i][0] = t.m[i][0];
    uv.m[i][1] = t.m[i][1];
    uv.m[i][2] = t.m[i][3];
  }
  return uv;
}

}  // namespace limn
