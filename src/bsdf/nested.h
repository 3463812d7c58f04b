#pragma once
// A BSDF made of others, each seen from the side from which it is: what its files have in common.
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "src/bsdf/sides.h"
#include "src/bsdf/types.h"

namespace limn {

// Its own textures come first, then those of the nested BSDFs in their order.
class NestingBsdf : public SidedBsdf {
 public:
  Texture& texture(int k) const final {
    if (k < own_textures_) return Bsdf::texture(k);
    const auto [nested, index] = find(k);
    return nested_[nested]->texture(index);
  }
  std::string texture_name(int k) const final {
    if (k < own_textures_) return Bsdf::texture_name(k);
    const auto [nested, index] = find(k);
    return prefix(nested) + nested_[nested]->texture_name(index);
  }
  std::span<std::shared_ptr<Bsdf>> nested() final { return nested_; }
  bool is_constant() const final {
    for (size_t i = 0; i < nested_.size(); ++i) {
      for (const bool front : {true, false}) {
        const Bsdf* const side = nested_[i]->side(front);
        if (side && !side->is_constant()) return false;
      }
    }
    return own_is_constant();
  }

 protected:
  explicit NestingBsdf(std::vector<std::shared_ptr<Bsdf>> nested) : nested_(std::move(nested)) {}
  NestingBsdf(const NestingBsdf& other)
      : SidedBsdf(other),
        nested_(other.nested_),
        own_textures_(other.own_textures_),
        first_{other.first_[0], other.first_[1]} {
    for (auto& bsdf : nested_) bsdf = bsdf->clone();
  }
  // For constructors, after textures of their own. straight: whether light also passes by itself.
  void add_nested(bool straight);
  virtual bool own_is_constant() const = 0;

  // Of the i-th nested BSDF; null if that side is black.
  const Bsdf* side_of(size_t i, bool front) const { return nested_[i]->side(front); }
  // The values of the textures of the i-th BSDF's side.
  template <class S>
  const Rgb<S>* at_of(size_t i, bool front, const Rgb<S>* at) const {
    return at ? at + first_[front][i] : nullptr;
  }
  void add_nested_parameters(std::vector<ParameterRef>& list) {
    for (size_t i = 0; i < nested_.size(); ++i) {
      for (ParameterRef& p : nested_[i]->parameters()) {
        p.name = prefix(i) + p.name;
        list.push_back(std::move(p));
      }
    }
  }
  // Of the names of what the i-th has.
  std::string prefix(size_t i) const {
    return nested_.size() == 1 ? "" : "bsdf_" + std::to_string(i) + ".";
  }
  size_t size() const { return nested_.size(); }

 private:
  std::pair<size_t, int> find(int k) const {
    k -= own_textures_;
    size_t i = 0;
    while (k >= nested_[i]->texture_count()) k -= nested_[i++]->texture_count();
    return {i, k};
  }

  std::vector<std::shared_ptr<Bsdf>> nested_;
  int own_textures_ = 0;
  std::vector<int> first_[2];  // [front][i]: of all textures, the first of the i-th's side
};

// Nested BSDFs of an element, `count` of them. InputError if there are more or less, or if they
// have more textures than a BSDF may have beside `own` ones, or more smooth lobes beside `rays`.
std::vector<std::shared_ptr<Bsdf>> read_nested(Properties& properties, size_t count, int own,
                                               int rays);

// A number (0.5), clamped to [0, 1], or a texture of such.
ConstantOrTexture read_unit_number(Properties& properties, const char* name);

// A number in [0, 1]: where it is less or more the end of that range, which has no slope.
template <class S>
S within_unit(const S& x) {
  return value(x) < 0 ? S(0.0) : value(x) > 1 ? S(1.0) : x;
}

}  // namespace limn
