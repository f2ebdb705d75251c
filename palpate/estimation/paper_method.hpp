// SPDX-License-Identifier: Apache-2.0
// The algorithm of Frank et al. (IROS 2010, section VI and algorithm 1) as a baseline: iterative closest point of every observed
// surface to the simulated one, squared distances to the nearest vertices (eq. 5 and 6), gradient descent on (E, nu) with numerical
// derivatives, taken over wider differences where narrow ones show no way down. Mesh, solver and loads are those of `fit`, so what differs is the method.
#pragma once

#include <utility>

#include "palpate/estimation/fit.hpp"

namespace palpate::estimation {

/// Most samples (steps) that the baseline uses jointly, evenly spread: it re-simulates every one several times an iteration.
inline constexpr std::size_t paper_samples = 10;

/// What an observed point is measured to. The paper's are vertices; the surface between them shows what that does.
enum class PaperDistance { nearest_vertex, surface };

/// @param memory  used and filled, as by `fit`; nullptr: nothing is kept
/// @throws Error when no step has a point cloud or a depth image: the paper's method knows no other observation.
Identification fit_as_in_paper(const Recording& recording, const SimulatedObject& object, const Inputs& inputs,
                               const FitOptions& options, const OnProgress& progress = {}, FitMemory* memory = nullptr,
                               PaperDistance distance = PaperDistance::nearest_vertex);

/// The numerical derivative of a function known at three places (place, value): where a side has no value (infinity: no
/// equilibrium) the other one alone tells; 0 where neither does.
double slope(std::pair<double, double> behind, const std::pair<double, double>& here, std::pair<double, double> ahead);

/// Its error function (m^2, mean over points) at given parameters: for grid searches.
class PaperError {
 public:
  PaperError(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, const FitOptions& options,
             FitMemory* memory = nullptr, PaperDistance distance = PaperDistance::nearest_vertex);
  ~PaperError();
  /// Infinity where a sample has no equilibrium.
  double operator()(double young_modulus_pa, double poisson_ratio);
  double start_young_modulus_pa() const;
  std::size_t samples() const;
  std::size_t points() const;
  int solves() const;
  int load_cases() const;  ///< FitSummary::load_cases: the method itself knows no unit loads

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::estimation
