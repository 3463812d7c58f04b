#pragma once
// What is asked of BSDFs for many paths, put together by BSDF.
#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include "limn/core/bsdf.h"

namespace limn {

// At most kMost of Bsdf::Evaluation or Bsdf::Draw.
template <class Item, size_t kMost>
class ByBsdf {
 public:
  void add(const Bsdf& bsdf, const Item& item) {
    bsdfs_[count_] = &bsdf;
    items_[count_++] = item;
  }
  // f(bsdf, its items), for each.
  template <class F>
  void for_each(const F& f) {
    for (size_t first = 0, last = 0; first < count_; first = last) {
      const Bsdf* const bsdf = bsdfs_[first];
      for (size_t i = last = first; i < count_; ++i) {
        if (bsdfs_[i] != bsdf) continue;
        std::swap(bsdfs_[i], bsdfs_[last]);
        std::swap(items_[i], items_[last++]);
      }
      f(*bsdf, std::span<const Item>(&items_[first], last - first));
    }
  }

 private:
  size_t count_ = 0;
  std::array<const Bsdf*, kMost> bsdfs_;
  std::array<Item, kMost> items_;
};

}  // namespace limn
