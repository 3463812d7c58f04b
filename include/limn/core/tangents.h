#pragma once
// Derivatives of the vectors of a mesh in all lanes, in as little memory as they need: one for all
// where all are alike (a translation), and no lanes behind the last that is not zero. Copies share
// it until one of them is changed.
#include <cstddef>

#include "limn/core/dual.h"
#include "limn/core/prefetch.h"
#include "limn/core/shared_vector.h"
#include "limn/core/vec.h"

namespace limn {

class Tangents {
 public:
  bool empty() const { return size_ == 0; }
  size_t size() const { return size_; }
  // Constant, so that a write to a copy does not compile: set() writes.
  const Vec3<Lanes> operator[](size_t i) const {
    const double* from = address(i);
    Vec3<Lanes> v;
    if (lanes_ == 1) {  // the common case, without a loop
      v.x[0] = from[0], v.y[0] = from[1], v.z[0] = from[2];
      return v;
    }
    for (int k = 0; k < 3; ++k)
      for (int lane = 0; lane < lanes_; ++lane) v[k][lane] = from[k * lanes_ + lane];
    return v;
  }
  // True only if all are the same; it may be false if set() made them so.
  bool all_alike() const { return one_; }
  size_t bytes() const { return data_.capacity() * sizeof(double); }

  // Brings vector i into the cache.
  void fetch(size_t i) const {
    prefetch(address(i));
    if (lanes_ > 2) prefetch(address(i) + stride() - 1);
  }

  void clear() { *this = {}; }
  // Memory for n vectors, should they differ.
  void reserve(size_t n) { expected_ = n; }
  void assign(size_t n, const Vec3<Lanes>& v);
  void resize(size_t n);  // new ones are zero
  void push_back(const Vec3<Lanes>& v);
  void set(size_t i, const Vec3<Lanes>& v);

  class Iterator {
   public:
    Iterator(const Tangents& of, size_t i) : of_(of), i_(i) {}
    Vec3<Lanes> operator*() const { return of_[i_]; }
    Iterator& operator++() { return ++i_, *this; }
    bool operator!=(const Iterator& other) const { return i_ != other.i_; }

   private:
    const Tangents& of_;
    size_t i_;
  };
  Iterator begin() const { return {*this, 0}; }
  Iterator end() const { return {*this, size_}; }

 private:
  const double* address(size_t i) const { return data_.data() + (one_ ? 0 : i * stride()); }
  size_t stride() const { return 3 * static_cast<size_t>(lanes_); }
  void write(const Vec3<Lanes>& v);
  void widen(const Vec3<Lanes>& v);
  void expand();

  size_t size_ = 0, expected_ = 0;
  int lanes_ = 1;    // 1 to kLanes
  bool one_ = true;  // data_ holds the first, for all
  SharedVector<double> data_;
};

}  // namespace limn
