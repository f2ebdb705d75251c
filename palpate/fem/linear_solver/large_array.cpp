// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/large_array.hpp"

#include <cstdint>
#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace palpate::fem {
namespace {

constexpr std::size_t kCacheLine = 64, kLargePage = std::size_t{1} << 21;
constexpr std::size_t kPage = 4096, kManyPages = 16 * kPage;
constexpr std::size_t kLargeFrom = 2 * kLargePage;  // bytes; below, the rest of a last page would weigh too much

std::align_val_t alignment_of(std::size_t bytes) { return std::align_val_t{bytes >= kLargeFrom ? kLargePage : kCacheLine}; }

}  // namespace

void* allocate_large(std::size_t bytes) {
  void* const memory = ::operator new(bytes + kCacheLine, alignment_of(bytes));
  ask_for_large_pages(memory, bytes);
  return memory;
}

void ask_for_large_pages([[maybe_unused]] void* memory, [[maybe_unused]] std::size_t bytes) noexcept {
#ifdef MADV_POPULATE_WRITE
  // Too small for large pages: all pages in one trip.
  if (bytes >= kManyPages && bytes < kLargeFrom) {
    const auto first = (reinterpret_cast<std::uintptr_t>(memory) + kPage - 1) / kPage * kPage;
    const auto last = (reinterpret_cast<std::uintptr_t>(memory) + bytes) / kPage * kPage;
    madvise(reinterpret_cast<void*>(first), last - first, MADV_POPULATE_WRITE);
  }
#endif
#ifdef MADV_HUGEPAGE
  const auto begin = (reinterpret_cast<std::uintptr_t>(memory) + kLargePage - 1) / kLargePage * kLargePage;
  const auto end = (reinterpret_cast<std::uintptr_t>(memory) + bytes) / kLargePage * kLargePage;
  if (bytes >= kLargeFrom && begin < end) madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
#endif
}

void free_large(void* memory, std::size_t bytes) noexcept { ::operator delete(memory, alignment_of(bytes)); }

}  // namespace palpate::fem
