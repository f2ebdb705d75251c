// SPDX-License-Identifier: Apache-2.0
// E and nu while a robot pushes: a recording is replayed step by step, as a robot would deliver it, and each step's estimate is
// printed; the last line is what `palpate estimate` says of the whole.
//
//   cmake --install BUILD --prefix PREFIX                                  # of palpate
//   cmake -S examples/online -B build/online -DCMAKE_PREFIX_PATH=PREFIX && cmake --build build/online
//   build/online/replay RECORDING
#include <cstdio>
#include <exception>

#include "palpate/core/process_heap.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/online.hpp"

namespace {

void print(const char* when, const palpate::Identification& so_far) {
  if (so_far.parameters.empty()) {
    std::printf("%-24s %s\n", when, so_far.message.c_str());
    return;
  }
  const palpate::Parameter &young = so_far.parameters[0], &ratio = so_far.parameters[1];
  std::printf("%-24s E %8.0f Pa [%.0f, %.0f]   nu %.3f [%.3f, %.3f]%s\n", when, young.value, young.lower_95, young.upper_95,
              ratio.value, ratio.lower_95, ratio.upper_95, so_far.verdicts.empty() ? "" : "   !");
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: replay RECORDING\n");
    return 2;
  }
  palpate::keep_heap_in_large_pages();
  palpate::Recording scene = palpate::io::read_recording(argv[1]);
  std::vector<palpate::Push> pushes;
  std::swap(pushes, scene.pushes);

  palpate::OnlineEstimator estimator(scene);
  for (const palpate::Push& push : pushes) {
    palpate::Push empty = push;
    empty.steps.clear();
    estimator.begin(empty);
    for (const palpate::Step& step : push.steps) print(push.name.c_str(), estimator.add(step));
  }
  print("all together", estimator.answer().answer);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
