#pragma once
// In-place replacement of values.
#include <new>
#include <type_traits>

namespace limn {

// Replaces `old` by the result of make(), constructed in place. Constructing elsewhere and copying
// is slow: the wide loads of the copy stall until preceding narrow stores reach the cache. make()
// must not read `old`.
template <class T, class Make>
[[gnu::always_inline]] inline void renew(T& old, const Make& make) {
  static_assert(std::is_trivially_destructible_v<T>);
  ::new (static_cast<void*>(&old)) T(make());
}

}  // namespace limn
