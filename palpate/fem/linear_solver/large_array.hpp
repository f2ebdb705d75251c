// SPDX-License-Identifier: Apache-2.0
// Memory for large arrays. Every page costs its first touch a trip into the system, which for pages of 4 KB took a third of a
// solve, on virtual machines two thirds of a small one; arrays that are large enough ask for pages of 2 MB, smaller ones for all
// of theirs in one trip.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace palpate::fem {

/// At a cache line's border at least. @throws std::bad_alloc
void* allocate_large(std::size_t bytes);
void free_large(void* memory, std::size_t bytes) noexcept;
/// For memory that others have allocated and nobody has touched yet. A wish: nothing is promised.
void ask_for_large_pages(void* memory, std::size_t bytes) noexcept;

/// Uninitialised memory.
template <class T>
class LargeArray {
 public:
  LargeArray() = default;
  explicit LargeArray(std::size_t size)
      : data_(static_cast<T*>(allocate_large(size * sizeof(T))), Free{size * sizeof(T)}) {}
  T* data() const { return data_.get(); }

 private:
  struct Free {
    std::size_t bytes = 0;
    void operator()(T* memory) const noexcept { free_large(memory, bytes); }
  };
  std::unique_ptr<T, Free> data_;
};

template <class T>
struct LargeAllocator {
  using value_type = T;
  LargeAllocator() = default;
  template <class U>
  LargeAllocator(const LargeAllocator<U>&) noexcept {}
  T* allocate(std::size_t size) { return static_cast<T*>(allocate_large(size * sizeof(T))); }
  void deallocate(T* memory, std::size_t size) noexcept { free_large(memory, size * sizeof(T)); }
  template <class U>
  bool operator==(const LargeAllocator<U>&) const noexcept {
    return true;
  }
};

/// Room for `size` elements of a vector that is filled next; what it held is lost.
template <class T>
void make_large_room(std::vector<T>& vector, std::size_t size) {
  if (vector.capacity() >= size) return;
  vector.clear();
  vector.shrink_to_fit();
  vector.reserve(size);
  ask_for_large_pages(vector.data(), size * sizeof(T));
}

template <class T>
using LargeVector = std::vector<T, LargeAllocator<T>>;

}  // namespace palpate::fem
