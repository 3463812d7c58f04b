#pragma once
// A vector whose copies share its memory until one of them is changed: copies of a scene differ in
// few arrays of few meshes.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace limn {

// As std::vector, but that its functions which are not const copy what is shared first. So read
// through const objects. Copies may be read by different threads, and each be changed by one.
template <class T>
class SharedVector {
 public:
  using value_type = T;

  SharedVector() = default;
  SharedVector(std::vector<T> items) : items_(std::make_shared<std::vector<T>>(std::move(items))) {
    keep();
  }
  SharedVector(std::initializer_list<T> items) : SharedVector(std::vector<T>(items)) {}
  SharedVector(const SharedVector&) = default;
  SharedVector& operator=(const SharedVector&) = default;
  SharedVector(SharedVector&& other) noexcept { *this = std::move(other); }
  SharedVector& operator=(SharedVector&& other) noexcept {
    items_ = std::exchange(other.items_, nullptr);
    data_ = std::exchange(other.data_, nullptr);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }

  operator std::span<const T>() const { return {data_, size_}; }
  explicit operator std::vector<T>() const { return {begin(), end()}; }
  bool empty() const { return size_ == 0; }
  size_t size() const { return size_; }
  size_t capacity() const { return items_ ? items_->capacity() : 0; }
  const T* data() const { return data_; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }
  const T& operator[](size_t i) const { return data_[i]; }
  const T& front() const { return *data_; }
  const T& back() const { return data_[size_ - 1]; }
  bool operator==(const SharedVector& other) const {
    return data_ == other.data_ ? size_ == other.size_
                                : std::equal(begin(), end(), other.begin(), other.end());
  }

  T* data() { return own().data(); }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  T& operator[](size_t i) { return own()[i]; }
  T& back() { return own().back(); }
  void clear() { *this = SharedVector(); }
  void reserve(size_t n) { own().reserve(n), keep(); }
  void resize(size_t n, const T& item = {}) { own().resize(n, item), keep(); }
  void assign(size_t n, const T& item) { *this = std::vector<T>(n, item); }
  void push_back(const T& item) { own().push_back(item), keep(); }
  void pop_back() { own().pop_back(), keep(); }

 private:
  std::vector<T>& own() {
    if (!items_) items_ = std::make_shared<std::vector<T>>();
    if (items_.use_count() > 1) items_ = std::make_shared<std::vector<T>>(*items_);
    // Another thread that let go of a copy has read it by now: use_count() itself orders nothing.
    std::atomic_thread_fence(std::memory_order_acquire);
    keep();
    return *items_;
  }
  void keep() {
    data_ = items_->data();
    size_ = items_->size();
  }

  std::shared_ptr<std::vector<T>> items_;
  const T* data_ = nullptr;  // of items_: one step nearer
  size_t size_ = 0;
};

}  // namespace limn
