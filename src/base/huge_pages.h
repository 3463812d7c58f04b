#pragma once
// Memory for large tables that are read at random places: with pages of 4 KB nearly every such read
// also misses the TLB, which on virtual machines costs more than all arithmetic around it.
#include <sys/mman.h>

#include <cstdlib>
#include <new>
#include <vector>

namespace limn {

// Asks the system for pages of 2 MB from that size on; nothing else changes if it declines.
template <class T>
struct HugePageAllocator {
  using value_type = T;
  HugePageAllocator() = default;
  template <class U>
  explicit HugePageAllocator(const HugePageAllocator<U>&) {}

  T* allocate(size_t count) {
    constexpr size_t kPage = size_t{1} << 21;
    const size_t alignment = count * sizeof(T) >= kPage ? kPage : 64;
    const size_t size = (count * sizeof(T) + alignment - 1) / alignment * alignment;
    void* memory = std::aligned_alloc(alignment, size);
    if (!memory) throw std::bad_alloc();
    if (alignment == kPage) madvise(memory, size, MADV_HUGEPAGE);
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, size_t) { std::free(memory); }
  bool operator==(const HugePageAllocator&) const { return true; }
};

template <class T>
using HugePageVector = std::vector<T, HugePageAllocator<T>>;

}  // namespace limn
