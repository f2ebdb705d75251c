// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/process_heap.hpp"

#include <cstdint>
#include <cstdlib>

#ifdef __GLIBC__  // known once a header of the library was read
#include <malloc.h>
#include <sys/mman.h>
#endif

namespace palpate {

void keep_heap_in_large_pages() noexcept {
#if defined(__GLIBC__) && defined(MADV_HUGEPAGE)
#if __GLIBC_PREREQ(2, 33)
  constexpr std::uintptr_t large_page = std::uintptr_t{1} << 21;
  constexpr int reserve = 1 << 30, step = 64 << 20;
  // What is larger gets memory of its own, as ever (older versions take at most 32 MB here).
  if (mallopt(M_MMAP_THRESHOLD, 64 << 20) == 0) mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, -1);  // never
  mallopt(M_TOP_PAD, reserve);
  void* volatile top = std::malloc(large_page);  // more than a young heap has left, so that it grows by the reserve
  std::free(top);
  const auto begin = reinterpret_cast<std::uintptr_t>(top), end = begin + mallinfo2().keepcost;
  mallopt(M_TOP_PAD, step);
  // A page of which malloc has touched a part stays in small ones: what it wrote behind `top` lies before `first`.
  const std::uintptr_t first = (begin + 2 * large_page) / large_page * large_page, last = end / large_page * large_page;
  if (top == nullptr || first >= last || madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE) != 0) return;
  [[maybe_unused]] static void* volatile small_pages_left_empty;
  small_pages_left_empty = std::malloc(first - begin);
#endif
#endif
}

}  // namespace palpate
