#pragma once
// A small list of items grouped by the object that each belongs to.
#include <array>
#include <cstddef>
#include <span>
#include <utility>

namespace limn {

// At most kMost items, each with a key: an object of type Key.
template <class Key, class Item, size_t kMost>
class Grouped {
 public:
  void add(const Key& key, const Item& item) {
    keys_[count_] = &key;
    items_[count_++] = item;
  }
  // Calls f(key, items of that key) once per key. Reorders the items.
  template <class F>
  void for_each(const F& f) {
    for (size_t first = 0, last = 0; first < count_; first = last) {
      const Key* const key = keys_[first];
      for (size_t i = last = first; i < count_; ++i) {
        if (keys_[i] != key) continue;
        std::swap(keys_[i], keys_[last]);
        std::swap(items_[i], items_[last++]);
      }
      f(*key, std::span<const Item>(&items_[first], last - first));
    }
  }

 private:
  size_t count_ = 0;
  std::array<const Key*, kMost> keys_;
  std::array<Item, kMost> items_;
};

}  // namespace limn
