#pragma once
// Values made where they are kept.
#include <new>
#include <type_traits>

namespace limn {

// Puts what make() returns in the place of `old`, where it is made. To make it elsewhere and copy
// it costs more than it looks like: the wide loads of a copy wait until the narrow stores just
// before them are in the cache. make() must not read `old`.
template <class T, class Make>
[[gnu::always_inline]] inline void renew(T& old, const Make& make) {
  static_assert(std::is_trivially_destructible_v<T>);
  ::new (static_cast<void*>(&old)) T(make());
}

}  // namespace limn
