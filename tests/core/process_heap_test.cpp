// label: unit
// SPDX-License-Identifier: Apache-2.0
// What a program gains that keeps its heap: memory that was freed is not touched for the first time again.
#include "palpate/core/process_heap.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <cstring>

namespace palpate::process_heap_test {
namespace {

long page_faults_of_one_array(std::size_t bytes) {
  const auto faults = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_minflt;
  };
  const long before = faults();
  char* const memory = static_cast<char*>(std::malloc(bytes));
  for (std::size_t i = 0; i < bytes; i += 4096) static_cast<volatile char*>(memory)[i] = 1;
  std::free(memory);
  return faults() - before;
}

TEST(ProcessHeap, ArraysThatComeAndGoTouchTheirPagesOnce) {
#if !defined(__GLIBC__) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "another allocator than that of glibc";
#elif !__GLIBC_PREREQ(2, 35)
  GTEST_SKIP() << "this glibc gives arrays above 32 MB memory of their own in any case";
#endif
  constexpr std::size_t bytes = 40 << 20, pages = bytes / 4096;
  page_faults_of_one_array(bytes);
  EXPECT_GT(page_faults_of_one_array(bytes), static_cast<long>(pages / 600)) << "nothing to gain here: the test says nothing";
  keep_heap_in_large_pages();
  page_faults_of_one_array(bytes);
  EXPECT_EQ(page_faults_of_one_array(bytes), 0);
}

TEST(ProcessHeap, MayBeAskedForTwice) {
  keep_heap_in_large_pages();
  keep_heap_in_large_pages();
  page_faults_of_one_array(1 << 20);
  EXPECT_EQ(page_faults_of_one_array(1 << 20), 0);
}

}  // namespace
}  // namespace palpate::process_heap_test
