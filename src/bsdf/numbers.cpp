// Colours and numbers of BSDFs: constants or textures.
#include <fmt/format.h>

#include <algorithm>

#include "limn/core/bsdf.h"
#include "limn/core/check.h"
#include "limn/core/tangent.h"

namespace limn {

Bsdf::Bsdf(const Bsdf& other)
    : texture_count_(other.texture_count_),
      lobes_(other.lobes_),
      texture_names_(other.texture_names_) {
  for (const auto& texture : other.textures_) textures_.push_back(texture->clone());
}

BsdfColour Bsdf::colour(const char* name, const ConstantOrTexture& source) {
  BsdfColour colour;
  Rgb<double> c = source.constant;
  if (source.texture) {
    colour.texture = texture_count_++;
    CHECK_LE(texture_count_, kMostTextures);
    textures_.push_back(source.texture);
    texture_names_.emplace_back(name);
    c = source.texture->mean();
    colour.most = std::max(1.0, source.texture->range().most);  // holds as texels move in [0, 1]
  }
  colour.constant = {c.r, c.g, c.b};
  return colour;
}

BsdfNumber Bsdf::number(const char* name, const ConstantOrTexture& source) {
  const BsdfColour grey =
      source.texture ? colour(name, source.texture->for_numbers()) : colour(name, source);
  return {grey.constant.r, grey.texture};
}

bool Bsdf::needs_tangent() const {
  for (int k = 0; k < texture_count_; ++k) {
    if (texture(k).is_tangent()) return true;
  }
  return false;
}

int Bsdf::add_tangent(const char* name) {
  const int k = colour(name, make_tangent()).texture;
  textures_[k]->set_mixes_channels();
  return k;
}

void Bsdf::add_texture_parameters(int texture, std::vector<ParameterRef>& list) {
  for (ParameterRef& p : textures_[texture]->parameters()) {
    p.name = texture_names_[texture] + "." + p.name;
    p.mixes_channels = textures_[texture]->mixes_channels();
    list.push_back(std::move(p));
  }
}

void Bsdf::add_parameter(const char* name, BsdfColour& colour, double least, double most,
                         std::vector<ParameterRef>& list) {
  if (colour.texture >= 0) return add_texture_parameters(colour.texture, list);
  Rgb<Dual>& c = colour.constant;
  list.push_back({name, {&c.r, &c.g, &c.b}, ParameterRef::Unit::kValue, least, most});
}

void Bsdf::add_parameter(const char* name, BsdfNumber& number, double least, double most,
                         std::vector<ParameterRef>& list) {
  if (number.texture >= 0) return add_texture_parameters(number.texture, list);
  list.push_back({name, {&number.constant}, ParameterRef::Unit::kValue, least, most});
}

std::string Bsdf::text_of(const BsdfColour& colour) const {
  if (colour.texture >= 0) return textures_[colour.texture]->describe();
  const Rgb<double> c = value(colour.constant);
  return fmt::format("{:g} {:g} {:g}", c.r, c.g, c.b);
}

std::string Bsdf::text_of(const BsdfNumber& number) const {
  if (number.texture >= 0) return textures_[number.texture]->describe();
  return fmt::format("{:g}", number.constant.v);
}

}  // namespace limn
