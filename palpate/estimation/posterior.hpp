// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <optional>

#include "palpate/core/identification.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::estimation {

/// A distribution over nu on a grid, and given nu a normal one over log E: what every reported number is read from.
struct Posterior {
  VectorX poisson;            ///< grid
  VectorX weight;             ///< of each grid node, sums to one
  VectorX log_young_mean;     ///< given nu
  VectorX log_young_std;
  MatrixX region_mean;        ///< grid x further regions: their log E given nu, and its standard deviation
  MatrixX region_std;
  MatrixX correlation;        ///< of log E of all regions given nu, at the optimum (1 x 1 where there is one)
  MatrixX covariance;         ///< 2 x 2 of (log E, nu)
  double log_young_lower = -std::numeric_limits<double>::infinity();  ///< bounds of the search, which no quantile leaves
  double log_young_upper = std::numeric_limits<double>::infinity();
  bool cancelled = false;     ///< the caller asked to stop: nothing else is filled
  bool quadrature = false;    ///< conditional optima were solved at several nu (else Laplace, cut at the bounds)
  /// The next nu below the grid and above it, where no equilibrium was found though the data do not exclude it: the density says
  /// nothing of what lies there.
  std::optional<double> unsolved_below, unsolved_above;

  /// The same distribution of nu with log E of a region (0: the first, which is this one).
  Posterior of_region(Index region) const;
  double poisson_quantile(double probability) const;
  double log_young_quantile(double probability) const;
  double poisson_std() const;
  double log_young_std_total() const;
};

/// Laplace where nu is well determined and far from its bounds; elsewhere a quadrature over nu: at each of a few nodes all
/// other unknowns are optimised again and integrated out (Laplace given nu; Rue, Martino and Chopin 2009, section 3, with one
/// hyperparameter). The log posterior is the integral of its slope, a cubic polynomial between nodes: the cost itself jumps
/// where a single ray leaves the object, by more than what tells two nodes apart.
Posterior explore_posterior(Objective& objective, const Optimum& optimum, const Loss& loss, double information_factor,
                            const OnProgress& progress);

/// Covariance from grid, weights and conditional moments.
void update_covariance(Posterior& posterior);

PosteriorGrid posterior_grid(const Posterior& posterior);

}  // namespace palpate::estimation
