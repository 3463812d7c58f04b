#pragma once
// Numbers that a mesh's file gives its vertices or faces.
#include <array>
#include <string>
#include <vector>

#include "limn/core/texture.h"

namespace limn {

// One texel per vertex or face of the file, of three channels; one number stands three times. On a
// face, those of its vertices are interpolated linearly.
class MeshAttribute final : public TexelMap {
 public:
  // name: begins with "vertex_" or "face_". values: one for each vertex or face, finite.
  MeshAttribute(std::string name, std::vector<std::array<float, 3>> values);

  const std::string& name() const { return name_; }
  bool of_faces() const { return of_faces_; }
  Rgb<double> eval(const TexturePoint<double>& point) const;
  Rgb<Dual> eval(const TexturePoint<Dual>& point) const;
  // The last weights are 0.
  TexelWeights weights(const TexturePoint<double>& point) const;
  Texture::Range range() const;
  // As Texture::set_valid; several textures may restrict it.
  void restrict_to(const Texture::Range& valid);

  Map map() const override;  // of one row
  Image texels() const override;
  void set_texels(const Image& texels) override;
  void add_texel_tangents(const Image& velocity, int lane) override;

 private:
  using Values = std::vector<std::array<float, 3>>;
  std::array<uint32_t, 3> corners(const Mesh& mesh, FaceId face) const;
  template <class S>
  Rgb<S> lookup(const Values& values, const TexturePoint<S>& point) const;

  std::string name_;
  bool of_faces_;
  Values values_;
  std::array<Values, kLanes> tangents_;  // empty: zero in that lane
  Texture::Range valid_{-std::numeric_limits<float>::max(), std::numeric_limits<float>::max()};
};

// The attribute of this name, which the mesh must have.
const MeshAttribute& attribute_of(const Mesh& mesh, const std::string& name);

}  // namespace limn
