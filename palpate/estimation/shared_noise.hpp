// SPDX-License-Identifier: Apache-2.0
// Depth noise that neighbours of one frame share: how much of it there is and how far it reaches, as the frames show, and what
// normal equations are once it is integrated out.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/SparseCore>
#include <memory>
#include <optional>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::estimation {

class Objective;
struct Loss;
struct TermRows;

/// Covariance of the errors of two points of a frame that lie d apart, in units of their stated standard deviations:
/// share exp(-d^2 / (2 length_m^2)), beside what every point errs by itself.
struct NoiseCorrelation {
  double share = 0;     ///< of the stated variance
  double length_m = 0;
  double own = 1;       ///< variance that every point has for itself: never above the stated one, less where that holds the share, too
  double deviate = 0;   ///< in standard deviations of what noise without neighbours would show
};

/// What residuals of neighbours within a frame agree in, and neighbours in the frames before and after it do not: noise is new in
/// every frame, and what the model is wrong in comes again. nullopt: nothing of the kind can be told from chance, or no push has
/// two frames. Of the last evaluation.
std::optional<NoiseCorrelation> correlation_of_noise(const Objective& objective, const Loss& loss);

/// The shared noise of one frame, in the low rank of its values at places that lie everywhere on what is seen (Quinonero-Candela and
/// Rasmussen 2005, section 4: subset of regressors): residuals share M P^-1 M', with M the modes and P the prior. Where it is
/// integrated out, a weighted sum of squares r' W r becomes r' (W - W M (c P + M' W M)^-1 M' W) r, c being what the weights are of
/// those that it was made with.
class SharedNoise {
 public:
  using Modes = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  /// @param rows  of the frame, where they end up in the fit @param loss  its weights stay what they are there
  SharedNoise(const TermRows& rows, const Loss& loss, const NoiseCorrelation& correlation);

  const Modes& modes() const { return modes_; }      ///< points x places
  const MatrixX& prior() const { return prior_; }    ///< places x places
  const VectorX& weight() const { return weight_; }  ///< of each square: from the loss, and what it errs by itself
  /// (P + M' W M)^-1 columns
  MatrixX shrunk(const MatrixX& columns) const { return factor_.solve(columns); }

  /// What cells' mean squares are, on average over cells, where points err by themselves by their stated standard deviations and by
  /// this together. @param sum, count  to add to
  void add_cells(const TermRows& rows, double& sum, double& count) const;

 private:
  double own_;
  VectorX weight_;
  Modes modes_;
  MatrixX prior_;
  Eigen::LLT<MatrixX> factor_;
};

/// The shared noise of all frames.
struct SharedNoises {
  NoiseCorrelation correlation;
  /// A step: its terms, nullptr where there is none. Empty: noise reaches so little far, or the recording is so long, that it is not
  /// integrated out.
  std::vector<std::vector<std::shared_ptr<const SharedNoise>>> terms;
  double of_cells = 1;  ///< inflation of the variance of cell means, that it explains
  double of_wide = 1;   ///< the same of means over all that is wide against its length: the most that it can do

  std::shared_ptr<const SharedNoise> of(std::size_t step, std::size_t term) const {
    return step < terms.size() && term < terms[step].size() ? terms[step][term] : nullptr;
  }
};

/// That of the last evaluation; nullptr where none is found.
std::shared_ptr<const SharedNoises> shared_noise(const Objective& objective, const Loss& loss);

}  // namespace palpate::estimation
