// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/large_array.hpp"

#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace palpate::fem {
namespace {

constexpr std::size_t kCacheLine = 64, kLargePage = std::size_t{1} << 21;
constexpr std::size_t kLargeFrom = 2 * kLargePage;  // bytes; below, the rest of a last page would weigh too much

std::align_val_t alignment_of(std::size_t bytes) { return std::align_val_t{bytes >= kLargeFrom ? kLargePage : kCacheLine}; }

}  // namespace

void* allocate_large(std::size_t bytes) {
  void* const memory = ::operator new(bytes + kCacheLine, alignment_of(bytes));
#ifdef MADV_HUGEPAGE
  // A wish: where it is refused the pages stay small.
  if (bytes >= kLargeFrom) madvise(memory, bytes / kLargePage * kLargePage, MADV_HUGEPAGE);
#endif
  return memory;
}

void free_large(void* memory, std::size_t bytes) noexcept { ::operator delete(memory, alignment_of(bytes)); }

}  // namespace palpate::fem
