// SPDX-License-Identifier: Apache-2.0
// What every benchmark here starts with: the heap as the program `palpate` has it.
#include <benchmark/benchmark.h>

#include "palpate/core/process_heap.hpp"

int main(int argc, char** argv) {
  palpate::keep_heap_in_large_pages();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
