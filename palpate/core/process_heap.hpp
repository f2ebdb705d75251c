// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate {

/// For the first line of a program's `main`, never called by the library: the heap of the whole process grows into pages of 2 MB,
/// in large steps, and keeps what it has instead of giving it back and touching it anew. A fit allocates and frees megabytes
/// thousands of times, and every page of 4 KB costs its first touch a trip into the system (docs/benchmarks.md: a fifth to a half
/// of the time on a virtual machine). Reserves addresses, no memory; numbers do not change. glibc on Linux; elsewhere, or where
/// the system refuses, nothing happens.
void keep_heap_in_large_pages() noexcept;

}  // namespace palpate
