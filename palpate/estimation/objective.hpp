// SPDX-License-Identifier: Apache-2.0
// Minus twice the log posterior (up to a constant) of a recording's steps as a robust least-squares problem, with its normal
// equations. One evaluation solves every step once.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/estimation/forward_model.hpp"
#include "palpate/estimation/normal_equations.hpp"
#include "palpate/estimation/surface_quadratic.hpp"

namespace palpate::estimation {

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
  /// Of one kind of reading beside the surface: few of them do not show in the sum over its many points.
  struct Readings {
    std::size_t rows = 0;
    double chi2 = 0;
  };
  Readings travels, forces, torques, markers;
};

class Objective {
 public:
  Objective(ForwardModel& model, const std::vector<std::vector<TermInput>>& inputs, Unknowns& unknowns);

  Evaluation evaluate(const VectorX& unknowns, const Loss& loss, const OnProgress& progress = {});

  /// Cost of predictions of some steps that were made elsewhere (start search): no derivative, no prior.
  double cost_of(const std::vector<StepPrediction>& predictions, const std::vector<std::size_t>& steps, const VectorX& unknowns,
                 const Loss& loss) const;

  /// Normal equations of rows that were made before, at the unknowns that they were made at. No step is solved.
  Evaluation assemble(const std::vector<std::vector<TermRows>>& rows, const VectorX& unknowns, const Loss& loss) const;

  /// What one step said in the last evaluation, priors included.
  Evaluation of_step(std::size_t s, const VectorX& unknowns, const Loss& loss) const;

  /// Rows of step s for a prediction that was made elsewhere.
  std::vector<TermRows> rows_of(std::size_t s, const StepPrediction& predicted, const VectorX& unknowns, const Loss& loss,
                                bool surface_slopes = false) const;

  /// `loss` with a choice of rays for every evaluated step that has none: those that met the object well inside its outline in
  /// the last evaluation. It hangs on the simulated surface and not on what was measured, so that it does not bias.
  Loss with_chosen_rays(Loss loss) const;
  /// The same where nothing was evaluated yet: casts the rays of the steps that have no choice, and an evaluation at these unknowns
  /// goes on with what they met. Of a linear body, with set_reuse.
  Loss choose_rays(const VectorX& unknowns, const Loss& loss);

  /// Normal equations of one step, of the unknowns that it depends on and without priors.
  struct StepNormal {
    std::vector<int> unknowns;
    Evaluation normal;
  };
  /// Those that were made at a place.
  struct KeptStep : StepNormal {
    VectorX at;
    Loss loss;
    std::vector<TermRows> rows;  ///< of the last place only: they are large
  };
  /// The places that a step was evaluated at, the last one at the end.
  using KeptPlaces = std::vector<KeptStep>;
  /// A step of a linear body, which costs little to predict: what its terms said where their rows were last made. No quadratic:
  /// the term is cheap to ask.
  struct Anchor {
    Loss loss;
    std::vector<std::optional<SurfaceQuadratic>> terms;
    double patience = 1;  ///< how many times as far as at first it is followed
    VectorX last;         ///< where it was asked last, and what it said; where rays were cast, as long as there are no terms
    StepNormal said;
  };
  /// What an objective hands on to that of the same steps and more.
  struct Kept {
    std::vector<KeptPlaces> places;
    std::vector<Anchor> anchors;
    std::vector<std::vector<TermRows>> rows;  ///< of the anchors
    std::shared_ptr<const SurfacePattern> pattern = {};
  };
  /// What was evaluated is used again nearby, for as long as it is near. Of a linear body: while surface and frame have moved by
  /// at most half so many standard deviations of a single point, the surface being where it is and not where it was. Of others:
  /// while the unknowns have moved by at most so many standard deviations of what a step says of them by itself.
  /// 0 (the default): every step is evaluated.
  /// @param rows  last_rows() holds every step's; a search that asks for costs only does without
  void set_reuse(double standard_deviations, bool rows = true) {
    reuse_ = standard_deviations;
    rows_wanted_ = rows;
    if (reuse_ == 0) anchors_.clear();  // evaluations from here on leave them behind
  }
  double reuse() const { return reuse_; }
  Kept take_kept();  ///< and is without it, and without last_rows()
  /// Takes over what another objective kept of the first steps. @param moved  where its unknowns are in this one, -1: gone
  void adopt(Kept kept, const std::vector<int>& moved);
  int steps_evaluated() const { return steps_evaluated_; }

  ResidualSummary summarise(const Loss& loss) const;            ///< of the last evaluation
  const std::vector<std::vector<TermRows>>& last_rows() const { return rows_; }  ///< a step: its terms
  /// True for a step in which something was observed.
  bool sees(std::size_t s) const { return !terms_[s].empty(); }
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
  StepNormal moved_along(const KeptStep& kept, const VectorX& unknowns) const;
  void prepare_anchors();
  bool stays_in_span(std::size_t s) const;
  SurfacePart part_for_rows(std::size_t s, const Loss& loss) const;
  void complete(std::size_t s, const VectorX& unknowns, const Loss& loss);
  double moved_since(std::size_t s, const Anchor& anchor, const VectorX& unknowns, double enough);
  StepNormal follow(std::size_t s, const VectorX& unknowns, const Loss& loss);
  Anchor anchor_of(const std::vector<TermRows>& rows, const StepPrediction& there, const VectorX& unknowns, const Loss& loss) const;
  StepNormal normal_around(Anchor& anchor, std::size_t s, const VectorX& unknowns, const Loss& loss);
  Evaluation sum(const std::vector<StepNormal>& steps, const VectorX& unknowns) const;
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
  std::vector<Anchor> anchors_;
  std::shared_ptr<const SurfacePattern> pattern_;
  std::atomic<int> steps_evaluated_{0};
};

}  // namespace palpate::estimation
