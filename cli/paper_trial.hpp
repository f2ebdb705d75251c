// SPDX-License-Identifier: Apache-2.0
// One seeded scene of the paper, answered by both methods: same mesh, solver, points, start and threads.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/lab/paper_scenes.hpp"

namespace palpate::cli {

struct MethodAnswer {
  double young_modulus_pa = 0, poisson_ratio = 0;
  double lower_95_pa = 0, upper_95_pa = 0;  ///< NaN: the method has none
  int solves = 0, iterations = 0;
  double seconds = 0;
  bool converged = false;
  std::vector<FitIteration> path;
  std::vector<std::string> verdicts;  ///< codes
};

struct SampleAnswer {
  std::string push;
  double force_n = 0, travel_m = 0, travel_predicted_m = 0;
  MethodAnswer paper, palpate;
};

/// The paper's error function over (E, nu), m2; rows = E.
struct ErrorSurface {
  VectorX young_modulus_pa, poisson_ratio;
  MatrixX error_m2;
  double at_found_m2 = 0;  ///< where the paper's method ended
  double smallest_m2() const { return error_m2.minCoeff(); }
};

struct TrialAnswer {
  std::uint64_t seed = 0;
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< the truth
  Index tetrahedra = 0;
  MethodAnswer paper, palpate;
  MethodAnswer paper_coarse;                  ///< the paper's method on linear tetrahedra of the same mesh
  double held_out_paper_m = 0, held_out_palpate_m = 0, held_out_still_m = 0;  ///< rms of the last push, fitted without; NaN = one push
  std::vector<SampleAnswer> samples;          ///< each sample alone; only where asked for
  ErrorSurface surface;                       ///< only where asked for
};

struct TrialOptions {
  int every_sample = 0;    ///< alone: 1 = each, 2 = every second, ...; 0 = none
  int surface_points = 0;  ///< a side of the error surface; 0 = none
  int threads = 1;
};

TrialAnswer run_trial(const lab::PaperScene& scene, std::uint64_t seed, const TrialOptions& options, const OnProgress& progress);

}  // namespace palpate::cli
