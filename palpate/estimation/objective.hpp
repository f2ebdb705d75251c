// SPDX-License-Identifier: Apache-2.0
// Minus twice the log posterior (up to a constant) of a recording's steps as a robust least-squares problem, with its normal
// equations. One evaluation solves every step once.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/estimation/forward_model.hpp"
#include "palpate/estimation/terms/term.hpp"

namespace palpate::estimation {

/// Rays of a step that count, a term and a ray each; a term without flags: all.
using RaysOfStep = std::vector<std::vector<char>>;

/// How residuals are weighed in one evaluation.
struct Loss {
  double tukey = 4.685;    ///< cut of Tukey's biweight in standard deviations, 95 % efficient on clean data
  double widening = 1;     ///< cut over the final cut while annealing: sigma of robust rows grows with it, priors do not
  bool along_rays = true;  ///< depth residuals along the ray (else closest point)
  std::size_t every = 1;      ///< steps that count: every n-th (the first rounds of a long recording need no more)
  std::vector<char> steps;    ///< steps that count, one flag each (held-out prediction, a push alone); empty = all
  /// Rays that count, a step each; nullptr or none: all. Which rays meet the object near its outline changes with the unknowns,
  /// and a ray that passes by costs as much as an outlier: without a choice that is kept, the cost rises and falls with the
  /// number of such rays, which no gradient knows of, and favours whatever makes the object look larger.
  std::vector<std::shared_ptr<const RaysOfStep>> rays;
  double surface_weight = 1;  ///< of rows with neighbours whose errors are correlated: 1 / variance inflation

  const RaysOfStep* rays_of(std::size_t step) const { return step < rays.size() ? rays[step].get() : nullptr; }
  bool counts(std::size_t step) const { return step % every == every / 2 && (steps.empty() || steps[step] != 0); }
};

struct Evaluation {
  bool usable = false;     ///< every step has an equilibrium
  std::string reason;
  double cost = 0;         ///< sum of rho + prior, half of minus twice the log posterior
  MatrixX hessian;         ///< Gauss-Newton, priors included
  VectorX gradient;
  double robust_cost = 0;  ///< the part of the cost that robust rows make
  MatrixX robust_hessian;

  /// Inverse covariance of all unknowns under clean Gaussian data: what robust rows say counts `factor` times (see
  /// tukey_information_factor), exact rows and priors as they are.
  MatrixX information(double factor) const { return hessian + (factor - 1) * robust_hessian; }
};

/// What the residuals at an optimum look like.
struct ResidualSummary {
  std::size_t points = 0;        ///< robust rows
  std::size_t outliers = 0;      ///< of them, beyond the cut
  std::size_t missed = 0;        ///< of the outliers, rays that pass the object by
  std::size_t rows = 0;          ///< all rows
  double chi2 = 0;               ///< all rows but outliers
  double sum_squared_m2 = 0;     ///< of length residuals inside the cut
  std::size_t lengths = 0;
  double variance_inflation = 1; ///< of cell means: above 1 where neighbours err together
};

class Objective {
 public:
  Objective(ForwardModel& model, const std::vector<std::vector<TermInput>>& inputs, Unknowns& unknowns);

  Evaluation evaluate(const VectorX& unknowns, const Loss& loss, const OnProgress& progress = {});

  /// Cost of a prediction that was made elsewhere (start search): no derivative, no prior.
  double cost_of(const std::vector<StepPrediction>& predictions, const VectorX& unknowns, const Loss& loss) const;

  /// Normal equations of rows that were made before, at the unknowns that they were made at. No step is solved.
  Evaluation assemble(const std::vector<std::vector<TermRows>>& rows, const VectorX& unknowns, const Loss& loss) const;

  /// Rows of step s for a prediction that was made elsewhere.
  std::vector<TermRows> rows_of(std::size_t s, const StepPrediction& predicted, const VectorX& unknowns, const Loss& loss) const;

  /// `loss` with a choice of rays for every evaluated step that has none: those that met the object well inside its outline in
  /// the last evaluation. It hangs on the simulated surface and not on what was measured, so that it does not bias.
  Loss with_chosen_rays(Loss loss) const;

  /// Normal equations of one step, and the unknowns that they were made at.
  struct KeptStep {
    std::vector<int> unknowns;
    VectorX at;
    Evaluation normal;  ///< of those unknowns, without priors
    Loss loss;
    std::vector<TermRows> rows;  ///< of the last place only: they are large
  };
  /// The places that a step was evaluated at, the last one at the end.
  using KeptPlaces = std::vector<KeptStep>;
  /// A step is not evaluated anew while the unknowns have moved by at most this many standard deviations of what it says of them
  /// by itself since its normal equations were made: those are moved along. 0 (the default): every step is evaluated.
  /// @param rows  last_rows() holds every step's; a search that asks for costs only does without
  void set_reuse(double standard_deviations, bool rows = true) {
    reuse_ = standard_deviations;
    rows_wanted_ = rows;
  }
  const std::vector<KeptPlaces>& kept() const { return kept_; }  ///< a step; filled while reuse is set
  /// Takes over what another objective kept of the first steps. @param moved  where its unknowns are in this one, -1: gone
  void adopt(const std::vector<KeptPlaces>& kept, const std::vector<int>& moved);
  int steps_evaluated() const { return steps_evaluated_; }

  ResidualSummary summarise(const Loss& loss) const;            ///< of the last evaluation
  const std::vector<std::vector<TermRows>>& last_rows() const { return rows_; }  ///< a step: its terms
  const std::vector<StepPrediction>& last_predictions() const { return predictions_; }

  const Unknowns& unknowns() const { return unknowns_; }
  /// Keeps nu where it is in the fits that follow (conditional optima of the quadrature).
  void hold_poisson(bool held) { unknowns_[poisson].fixed = held; }
  /// The same for the ratios between regions (fits of a part of the data, which may not reach every region).
  void hold_ratios(bool held) {
    for (int k = first_ratio; k < unknowns_.parameter_count(); ++k) unknowns_[k].fixed = held;
  }
  ForwardModel& model() { return model_; }
  const ForwardModel& model() const { return model_; }
  /// Median over robust terms of |residual| in standard deviations, of the last evaluation (closest points).
  double residual_scale() const;

 private:
  bool find_kept(std::size_t s, const VectorX& unknowns, const Loss& loss);
  void keep(std::size_t s, const VectorX& unknowns, const Loss& loss);
  Evaluation sum_kept(const VectorX& unknowns, const Loss& loss) const;
  void add_priors(const VectorX& unknowns, Evaluation& out) const;

  ForwardModel& model_;
  Unknowns& unknowns_;
  std::map<std::string, int> shared_;
  std::vector<std::vector<std::unique_ptr<Term>>> terms_;
  std::vector<std::vector<TermRows>> rows_;
  std::vector<StepPrediction> predictions_;
  double reuse_ = 0;
  bool rows_wanted_ = true;
  std::vector<KeptPlaces> kept_;
  std::atomic<int> steps_evaluated_{0};
};

/// Tukey's biweight: rho (half a square near zero) and weight.
double tukey_rho(double residual, double cut);
double tukey_weight(double residual, double cut);

/// What Gauss-Newton's weighted Hessian of robust rows must be multiplied by so that its inverse is the covariance of the robust estimate
/// under clean Gaussian data: E[psi']^2 / (E[psi^2] E[w]) (Huber and Ronchetti, Robust Statistics, eq. 6.5).
double tukey_information_factor(double cut);

}  // namespace palpate::estimation
