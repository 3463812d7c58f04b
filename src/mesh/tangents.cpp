// How tangents grow: by lanes, and from one for all to one each.
#include "limn/core/tangents.h"

#include <algorithm>
#include <utility>

namespace limn {
namespace {

bool alike(const Vec3<Lanes>& a, const Vec3<Lanes>& b) {
  bool same = true;
  for (int k = 0; k < 3; ++k)
    for (int lane = 0; lane < kLanes; ++lane) same &= a[k][lane] == b[k][lane];
  return same;
}

}  // namespace

// Appends a vector's lanes to the data.
void Tangents::write(const Vec3<Lanes>& v) {
  for (int k = 0; k < 3; ++k)
    for (int lane = 0; lane < lanes_; ++lane) data_.push_back(v[k][lane]);
}

// Makes room for the lanes of v that are not zero.
void Tangents::widen(const Vec3<Lanes>& v) {
  int needed = lanes_;
  for (int lane = lanes_; lane < kLanes; ++lane)
    if (v.x[lane] != 0 || v.y[lane] != 0 || v.z[lane] != 0) needed = lane + 1;
  if (needed == lanes_) return;
  const size_t count = data_.size() / stride();
  std::vector<double> wide(3 * static_cast<size_t>(needed) * count);
  const double* from = std::as_const(data_).data();
  for (size_t i = 0; i < 3 * count; ++i) std::copy_n(from + i * lanes_, lanes_, &wide[i * needed]);
  data_ = std::move(wide);
  lanes_ = needed;
}

void Tangents::expand() {
  if (!one_) return;
  one_ = false;
  const SharedVector<double> first = std::move(data_);
  data_.reserve(stride() * std::max(size_ + 1, expected_));
  for (size_t i = 0; i < size_; ++i)
    for (const double x : first) data_.push_back(x);
}

void Tangents::assign(size_t n, const Vec3<Lanes>& v) {
  clear();
  if (n > 0) push_back(v);
  size_ = n;
}

void Tangents::resize(size_t n) {
  if (n == 0) return clear();
  if (n < size_ && !one_) data_.resize(stride() * n);
  size_ = std::min(size_, n);
  while (size_ < n) push_back({});
}

void Tangents::push_back(const Vec3<Lanes>& v) {
  widen(v);
  if (size_ > 0 && !(one_ && alike(v, (*this)[0]))) expand();
  if (size_ == 0 || !one_) write(v);
  ++size_;
}

void Tangents::set(size_t i, const Vec3<Lanes>& v) {
  widen(v);
  if (alike(v, (*this)[i])) return;
  if (size_ > 1) expand();
  double* to = &data_[one_ ? 0 : i * stride()];
  for (int k = 0; k < 3; ++k)
    for (int lane = 0; lane < lanes_; ++lane) to[k * lanes_ + lane] = v[k][lane];
}

}  // namespace limn
