// SPDX-License-Identifier: Apache-2.0
// Rows of residuals to normal equations: how they are weighed, and what their sum says.
#pragma once

#include <memory>
#include <vector>

#include "palpate/estimation/shared_noise.hpp"
#include "palpate/estimation/terms/term.hpp"

namespace palpate::estimation {

/// A RayChoice for every ray of a step, a term each; a term without any: all count.
using RaysOfStep = std::vector<std::vector<char>>;

/// How residuals are weighed in one evaluation.
struct Loss {
  double tukey = 4.685;    ///< cut of Tukey's biweight in standard deviations, 95 % efficient on clean data
  double widening = 1;     ///< cut over the final cut while annealing: sigma of robust rows grows with it, priors do not
  bool along_rays = true;  ///< depth residuals along the ray (else closest point)
  Index most_points = 0;      ///< of a cloud or an image, evenly chosen, where closest points are asked for; 0: all
  std::size_t every = 1;      ///< steps that count: every n-th (the first rounds of a long recording need no more)
  std::vector<char> steps;    ///< steps that count, one flag each (held-out prediction, a push alone); empty = all
  /// Rays that count, a step each; nullptr or none: all. Which rays meet the object near its outline changes with the unknowns,
  /// and a ray that passes by costs as much as an outlier: without a choice that is kept, the cost rises and falls with the
  /// number of such rays, which no gradient knows of, and favours whatever makes the object look larger.
  std::vector<std::shared_ptr<const RaysOfStep>> rays;
  double surface_weight = 1;  ///< of rows with neighbours whose errors are correlated: 1 / variance inflation
  /// Noise that neighbours share, once it was found; nullptr: none. Robust weights are then what they were there.
  std::shared_ptr<const SharedNoises> noise = {};

  const RaysOfStep* rays_of(std::size_t step) const { return step < rays.size() ? rays[step].get() : nullptr; }
  bool counts(std::size_t step) const { return step % every == every / 2 && (steps.empty() || steps[step] != 0); }
  /// The same for rows of a step, whichever rays count.
  bool weighs_like(const Loss& other) const {
    return tukey == other.tukey && widening == other.widening && along_rays == other.along_rays &&
           surface_weight == other.surface_weight && noise == other.noise;
  }
};

struct Evaluation {
  bool usable = false;     ///< every step has an equilibrium
  std::string reason;
  double cost = 0;         ///< sum of rho + prior, half of minus twice the log posterior
  MatrixX hessian;         ///< Gauss-Newton, priors included
  VectorX gradient;
  double robust_cost = 0;  ///< the part of the cost that robust rows make
  MatrixX robust_hessian;
  MatrixX curvature;  ///< of the cost on average: as `hessian`, but where Tukey's loss bends less than its weights say

  static Evaluation nothing(Index unknowns);

  /// Inverse covariance of all unknowns under clean Gaussian data: what robust rows say counts `factor` times (see
  /// tukey_information_factor), exact rows and priors as they are.
  MatrixX information(double factor) const { return hessian + (factor - 1) * robust_hessian; }
};

/// Tukey's biweight: rho (half a square near zero) and weight.
double tukey_rho(double residual, double cut);
double tukey_weight(double residual, double cut);
double tukey_slope(double residual, double cut);  ///< second derivative of rho

/// What Gauss-Newton's weighted Hessian of robust rows must be multiplied by so that its inverse is the covariance of the robust estimate
/// under clean Gaussian data: E[psi']^2 / (E[psi^2] E[w]) (Huber and Ronchetti, Robust Statistics, eq. 6.5).
double tukey_information_factor(double cut);

/// What the loss makes of some rows.
struct WeighedRows {
  double each = 1;  ///< what every square counts before the loss
  VectorX weight;   ///< a row: how often its square counts; nothing but outliers that weigh nothing may have a residual that is not finite
  double cost = 0;  ///< sum of rho
  /// Curvature of the loss over the weights, on average over the rows: below one where Tukey's loss bends less than its weights say.
  double bend = 1;
};
WeighedRows weigh(const TermRows& rows, const Loss& loss);
/// Adds what some rows say. Robust rows' cost goes to `robust_cost` only. @param places  where their unknowns are in `out`
void add_rows(const TermRows& rows, const Loss& loss, const std::vector<int>& places, Evaluation& out);

}  // namespace palpate::estimation
