// SPDX-License-Identifier: Apache-2.0
// Inner header of the room.
#pragma once

#include "palpate/estimation/forward_model.hpp"

namespace palpate::estimation {

/// What models were asked for and solved for that live shorter than the fit (FitSummary).
struct SolveCount {
  int solves = 0, load_cases = 0;
  void add(const ForwardModel& model) {
    solves += model.solves();
    load_cases += model.load_cases();
  }
};

/// Adds a model's when it goes, also where an error ends its work.
class CountsAtEnd {
 public:
  CountsAtEnd(const ForwardModel& model, SolveCount& count) : model_(model), count_(count) {}
  ~CountsAtEnd() { count_.add(model_); }
  CountsAtEnd(const CountsAtEnd&) = delete;
  CountsAtEnd& operator=(const CountsAtEnd&) = delete;

 private:
  const ForwardModel& model_;
  SolveCount& count_;
};

}  // namespace palpate::estimation
