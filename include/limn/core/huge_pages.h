#pragma once
// An allocator for large tables with random access. With 4 KB pages nearly every access also misses
// the TLB, which on virtual machines costs more than the arithmetic around it.
#include <sys/mman.h>

#include <cstdlib>
#include <new>
#include <vector>

namespace limn {

// Requests 2 MB pages for allocations of at least that size; harmless if the system declines.
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
