// Attributes of meshes as textures.
#include "limn/core/mesh_attribute.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "limn/core/check.h"
#include "limn/core/image.h"
#include "src/texture/types.h"

namespace limn {

MeshAttribute::MeshAttribute(std::string name, Values values)
    : name_(std::move(name)), of_faces_(name_.starts_with("face_")), values_(std::move(values)) {}

std::array<uint32_t, 3> MeshAttribute::corners(const Mesh& mesh, FaceId face) const {
  if (!of_faces_) return mesh.face(face);
  const uint32_t id = mesh.file_faces.empty() ? face.index() : mesh.file_faces[face.index()];
  return {id, id, id};
}

template <class S>
Rgb<S> MeshAttribute::lookup(const Values& values, const TexturePoint<S>& point) const {
  const std::array<uint32_t, 3> ids = corners(*point.mesh, point.face);
  Rgb<S> v;
  for (int c = 0; c < 3; ++c) {
    const auto channel = static_cast<size_t>(c);
    const double first = values[ids[0]][channel];
    v[c] = first + (values[ids[1]][channel] - first) * point.b[0] +
           (values[ids[2]][channel] - first) * point.b[1];
  }
  return v;
}

Rgb<double> MeshAttribute::eval(const TexturePoint<double>& point) const {
  return lookup(values_, point);
}

Rgb<Dual> MeshAttribute::eval(const TexturePoint<Dual>& point) const {
  Rgb<Dual> v = lookup(values_, point);
  for (int lane = 0; lane < kLanes; ++lane) {
    const Values& tangents = tangents_[static_cast<size_t>(lane)];
    if (tangents.empty()) continue;
    const TexturePoint<double> here{point.mesh, point.face, {point.b[0].v, point.b[1].v}, {}};
    const Rgb<double> d = lookup(tangents, here);
    for (int c = 0; c < 3; ++c) v[c].d[lane] += d[c];
  }
  return v;
}

TexelMap::TexelWeights MeshAttribute::weights(const TexturePoint<double>& point) const {
  const std::array<uint32_t, 3> ids = corners(*point.mesh, point.face);
  if (of_faces_) return {{{ids[0], 1}, {0, 0}, {0, 0}, {0, 0}}};
  const double b1 = point.b[0], b2 = point.b[1];
  return {{{ids[0], 1 - b1 - b2}, {ids[1], b1}, {ids[2], b2}, {0, 0}}};
}

Texture::Range MeshAttribute::range() const {
  Texture::Range range{values_[0][0], values_[0][0]};
  for (const std::array<float, 3>& value : values_) {
    for (const double v : value) {
      range.least = std::min(range.least, v);
      range.most = std::max(range.most, v);
    }
  }
  return range;
}

void MeshAttribute::restrict_to(const Texture::Range& valid) {
  valid_ = {std::max(valid_.least, valid.least), std::min(valid_.most, valid.most)};
}

TexelMap::Map MeshAttribute::map() const {
  Map map{static_cast<int>(values_.size()), 1, 0, valid_.least, valid_.most};
  for (const std::array<float, 3>& value : values_) {
    for (const double v : value) map.mean += std::fabs(v);
  }
  map.mean /= 3 * static_cast<double>(values_.size());
  return map;
}

Image MeshAttribute::texels() const {
  Image image(static_cast<int>(values_.size()), 1, 3);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = values_[i / 3][i % 3];
  return image;
}

void MeshAttribute::set_texels(const Image& texels) {
  CHECK_EQ(texels.data.size(), 3 * values_.size());
  for (size_t i = 0; i < texels.data.size(); ++i) values_[i / 3][i % 3] = texels.data[i];
}

void MeshAttribute::add_texel_tangents(const Image& velocity, int lane) {
  Values& tangents = tangents_[static_cast<size_t>(lane)];
  tangents.resize(values_.size());
  for (size_t i = 0; i < velocity.data.size(); ++i) tangents[i / 3][i % 3] += velocity.data[i];
}

const MeshAttribute& attribute_of(const Mesh& mesh, const std::string& name) {
  size_t i = 0;
  while (mesh.attributes[i]->name() != name) {
    ++i;
    DCHECK_LT(i, mesh.attributes.size());
  }
  return *mesh.attributes[i];
}

namespace {

class AttributeTexture final : public Texture {
 public:
  AttributeTexture(std::string name, double scale) : name_(std::move(name)), scale_(scale) {}

  Rgb<double> eval(const TexturePoint<double>& point) const override {
    return of_use(attribute_of(*point.mesh, name_).eval(point) * scale_);
  }
  Rgb<Dual> eval(const TexturePoint<Dual>& point) const override {
    return of_use(attribute_of(*point.mesh, name_).eval(point) * scale_);
  }
  std::shared_ptr<Texture> for_numbers() const override {
    const auto copy = std::make_shared<AttributeTexture>(*this);
    copy->of_numbers_ = true;
    return copy;
  }
  // Of no mesh in particular: the middle of what the numbers may be.
  Rgb<double> mean() const override { return grey(0.5 * std::min(valid_.most, 1.0)); }
  Range range() const override { return valid_; }
  bool needs_uv() const override { return false; }
  bool discontinuous_between_faces() const override { return name_.starts_with("face_"); }
  std::string attribute() const override { return name_; }
  double attribute_scale() const override { return scale_; }
  const TexelMap& texels_on(const Mesh& mesh) const override { return attribute_of(mesh, name_); }
  TexelWeights texel_weights(const TexturePoint<double>& point) const override {
    TexelWeights weights = attribute_of(*point.mesh, name_).weights(point);
    for (TexelWeight& w : weights) w.weight *= scale_;
    return weights;
  }
  std::vector<ParameterRef> parameters() override { return {}; }
  std::shared_ptr<Texture> clone() const override {
    return std::make_shared<AttributeTexture>(*this);
  }
  std::string describe() const override {
    return scale_ == 1 ? name_ : fmt::format("{} times {:g}", name_, scale_);
  }

 private:
  template <class S>
  Rgb<S> of_use(const Rgb<S>& c) const {
    return of_numbers_ ? grey(luminance(c)) : c;
  }

  std::string name_;
  double scale_;
};

}  // namespace

std::shared_ptr<Texture> read_mesh_attribute(Properties& properties) {
  const std::string name = properties.string("name", "");
  if (!name.starts_with("vertex_") && !name.starts_with("face_")) {
    properties.fail("name", "must be that of an attribute: vertex_... or face_...");
  }
  const double scale = properties.number("scale", 1);
  if (!(scale > 0 && std::isfinite(scale))) properties.fail("scale", "must be positive");
  return std::make_shared<AttributeTexture>(name, scale);
}

}  // namespace limn
