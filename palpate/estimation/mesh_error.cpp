// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/mesh_error.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>

#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/held_poisson.hpp"
#include "palpate/estimation/own_poisson.hpp"
#include "palpate/estimation/unknown_names.hpp"
#include "palpate/estimation/young_bounds.hpp"
#include "palpate/fem/materials.hpp"

namespace palpate::estimation {
std::optional<AnswerShift> mesh_shift(const Recording& recording, const SimulatedObject& object, const Objective& objective,
                                      const Optimum& optimum, const Loss& loss, const FinerModel& finer,
                                      const FitOptions& options, const OnProgress& progress,
                                      std::shared_ptr<ForwardModel::Solved>* solved) {
  // All steps, the unloaded ones too: they hold the nuisances that a change of the surface could else be taken for.
  Loss all = loss;
  all.every = 1;
  all.steps.clear();
  for (const auto& rows : objective.last_rows()) all.steps.push_back(rows.empty() ? 0 : 1);
  // What lifts off is held here, so the fit's own surfaces say nothing of the change.
  const bool linear = fem::material_law(object.material).is_linear() &&
                      std::none_of(recording.supports.begin(), recording.supports.end(), lifts_off);
  const bool kept = solved != nullptr && linear;
  int load_cases = 0;
  const auto small_strains = [&](Recording copy, SimulatedObject body) {
    // Both meshes integrate alike: as the fit did, or as this ratio alone asks for.
    auto statics = statics_options(copy, body, options);
    if (!kept) {
      // By its bounds: were it said to be known, regions would lose the nu of their own.
      copy.model.poisson_lower = copy.model.poisson_upper = optimum.unknowns(poisson);
      if (!linear) statics = statics_options(body, options, highest_poisson(objective.unknowns(), optimum.unknowns));
    }
    body.material = "linear";
    statics.loads_expected = static_cast<int>(all.steps.size());
    copy.supports = held_both_ways(std::move(copy.supports));
    Unknowns unknowns;
    auto held = std::make_unique<Recording>(std::move(copy));
    // The change is a per cent itself: a few ratios are enough.
    ForwardModel model(*held, std::move(body), unknowns, statics, kept && *solved ? *solved : objective.model().surface_modes(), 1e-3);
    if (kept) *solved = model.solved();
    const VectorX at = values_by_name(unknowns, objective.unknowns(), optimum.unknowns);
    std::vector<StepPrediction> predicted(model.step_count());
    for (std::size_t s = 0; s < model.step_count(); ++s) {
      if (all.steps[s] != 0) predicted[s] = model.predict(s, at, false);
    }
    load_cases += model.load_cases();
    return predicted;
  };
  if (progress && !progress("mesh error", 0)) return std::nullopt;
  const auto coarse = linear ? objective.last_predictions() : small_strains(recording, object);
  const auto fine = small_strains(finer.recording, finer.object);
  if (progress && !progress("mesh error", 1)) return std::nullopt;

  std::vector<std::vector<TermRows>> changed(coarse.size());
  for (std::size_t s = 0; s < coarse.size(); ++s) {
    if (all.steps[s] == 0) continue;
    const Points change_m = fine[s].surface_m - coarse[s].surface_m;
    // Of an imposed motion: what it asks for. A force that is given is the same on both.
    if (change_m.isZero(0) && fine[s].travel_m == coarse[s].travel_m && fine[s].force_n == coarse[s].force_n) {
      changed[s] = objective.last_rows()[s];
      continue;
    }
    StepPrediction moved = objective.last_predictions()[s];
    moved.surface_m += change_m;
    if (moved.field != nullptr) moved.material_m += change_m;
    moved.travel_m += fine[s].travel_m - coarse[s].travel_m;
    for (std::size_t l = 0; l < moved.force_n.size(); ++l) moved.force_n[l] += fine[s].force_n[l] - coarse[s].force_n[l];
    changed[s] = objective.rows_of(s, moved, optimum.unknowns, loss);
  }
  const Evaluation before = objective.assemble(objective.last_rows(), optimum.unknowns, all);
  const Evaluation after = objective.assemble(changed, optimum.unknowns, all);
  // A region's own nu that is held stays where it is, and E with it. The shared one goes beyond its bound: `move` knows what that means.
  std::vector<int> moving = free_unknowns(objective.unknowns());
  std::erase_if(moving, [&](int k) { return k != poisson && is_held(objective.unknowns(), optimum.unknowns, optimum.evaluation.gradient, k); });
  MatrixX curvature = before.curvature;
  bound_young(curvature, objective.unknowns());  // else the mesh would move what nothing tells by rounding over rounding
  const VectorX change = MatrixX(curvature(moving, moving))
                             .ldlt()
                             .solve(VectorX(before.gradient(moving)) - VectorX(after.gradient(moving)));
  if (!change.allFinite()) return std::nullopt;
  const double whole = 1 / (1 - finer.left());
  AnswerShift shift;
  shift.load_cases = load_cases;
  const Unknowns& list = objective.unknowns();
  shift.region_log_young = VectorX::Zero(list.ratio_count());
  shift.region_poisson = VectorX::Zero(list.own_poisson_count());
  for (std::size_t k = 0; k < moving.size(); ++k) {
    const double moved = whole * change(static_cast<Index>(k));
    if (moving[k] == log_young) shift.log_young = moved;
    if (moving[k] == poisson) shift.poisson = moved;
    if (moving[k] < first_ratio || moving[k] >= list.parameter_count()) continue;
    if (moving[k] < list.first_own_poisson())
      shift.region_log_young(moving[k] - first_ratio) = moved;
    else
      shift.region_poisson(moving[k] - list.first_own_poisson()) = moved;
  }
  shift.region_log_young.array() += shift.log_young;
  return shift.plus(finer.elsewhere);
}

namespace {

/// A function on an even grid, linear between its nodes. Beyond them it goes on as it bends over as much of the grid as it has to go on:
/// a log density upwards no more than straight.
class OnGrid {
 public:
  OnGrid(const VectorX& grid, const VectorX& values, double beyond, bool concave)
      : first_(grid(0)), spacing_((grid(grid.size() - 1) - first_) / static_cast<double>(grid.size() - 1)), values_(values), concave_(concave),
        stride_(std::clamp<Index>(static_cast<Index>(std::lround(std::abs(beyond) / spacing_)), 1, (grid.size() - 1) / 2)) {}

  double operator()(double x) const {
    const double at = (x - first_) / spacing_, last = static_cast<double>(values_.size() - 1);
    if (at < 0) return beyond(-at, 0, stride_);
    if (at > last) return beyond(at - last, static_cast<Index>(values_.size()) - 1, -stride_);
    const Index k = std::min(static_cast<Index>(at), static_cast<Index>(values_.size()) - 2);
    const double share = at - static_cast<double>(k);
    return (1 - share) * values_(k) + share * values_(k + 1);
  }

 private:
  double beyond(double nodes, Index edge, Index inwards) const {
    const double off = nodes / static_cast<double>(stride_), near = values_(edge + inwards), bend = values_(edge + 2 * inwards) - 2 * near + values_(edge);
    return values_(edge) - off * (near - values_(edge)) + (concave_ ? 0.5 * off * (off + 1) * std::min(bend, 0.0) : 0);
  }

  double first_, spacing_;
  const VectorX& values_;
  bool concave_;
  Index stride_;
};

}  // namespace

void move(Posterior& posterior, const AnswerShift& shift, double poisson_lower, double poisson_upper) {
  const Index size = static_cast<Index>(posterior.poisson.size());
  constexpr double close = 1e-9;
  if (size < 3) {
    posterior.log_young_mean.array() += shift.log_young;
    update_covariance(posterior);
    return;
  }
  const double first = posterior.poisson(0), last = posterior.poisson(size - 1);
  if (first + std::min(shift.poisson, 0.0) >= poisson_lower + close && last + std::max(shift.poisson, 0.0) <= poisson_upper - close) {
    posterior.poisson.array() += shift.poisson;
    posterior.log_young_mean.array() += shift.log_young;
    update_covariance(posterior);
    return;
  }
  // What the data say is moved, and cut at the bounds anew. What comes in over a bound was never asked for: it is taken to go on beyond as
  // it bends before.
  const VectorX before = posterior.poisson, log_density = posterior.weight.cwiseMax(1e-300).array().log(), mean = posterior.log_young_mean,
                std_dev = posterior.log_young_std;
  const OnGrid density(before, log_density, shift.poisson, true), ridge(before, mean, shift.poisson, false), width(before, std_dev, 0, false);
  posterior.poisson = VectorX::LinSpaced(size, std::max(poisson_lower, std::min(first, first + shift.poisson)),
                                         std::min(poisson_upper, std::max(last, last + shift.poisson)));
  for (Index i = 0; i < size; ++i) {
    const double from = posterior.poisson(i) - shift.poisson;
    posterior.weight(i) = density(from);
    posterior.log_young_mean(i) = ridge(from) + shift.log_young;
    posterior.log_young_std(i) = width(std::clamp(from, first, last));
  }
  posterior.weight = (posterior.weight.array() - posterior.weight.maxCoeff()).exp();
  posterior.weight /= posterior.weight.sum();
  update_covariance(posterior);
}

void widen(Posterior& posterior, const AnswerShift& shift, double poisson_lower, double poisson_upper) {
  const double sd = std::abs(shift.poisson);
  const Index size = static_cast<Index>(posterior.poisson.size());
  if (size < 2) {
    posterior.log_young_std = (posterior.log_young_std.array().square() + shift.log_young * shift.log_young).sqrt();
    update_covariance(posterior);
    return;
  }
  const double first = posterior.poisson(0), last = posterior.poisson(size - 1);
  const double spacing = (last - first) / static_cast<double>(size - 1);
  // Widen the grid and spread every node's weight over it: but not by less than its own steps, which makes no difference to
  // nu, while nodes of the old and the new grid that fall apart by more would lose their weight.
  VectorX grid = posterior.poisson, weight = posterior.weight;
  if (sd > 2 * spacing) {
    grid = VectorX::LinSpaced(size, std::max(poisson_lower, first - 5 * sd), std::min(poisson_upper, last + 5 * sd));
    for (Index i = 0; i < size; ++i)
      weight(i) = posterior.weight.dot((-0.5 * ((posterior.poisson.array() - grid(i)) / sd).square()).exp().matrix());
    weight /= weight.sum();
  }
  // Keep the ridge log E(nu), turned as far as the error turns it.
  const double variance = posterior.covariance(1, 1), wider = variance + sd * sd;
  const double slope = variance > 0 ? posterior.covariance(0, 1) / variance : 0;
  const double wider_slope = wider > 0 ? (posterior.covariance(0, 1) + shift.log_young * shift.poisson) / wider : 0;
  const double left = std::pow(shift.log_young, 2) + slope * slope * variance - wider_slope * wider_slope * wider;
  const double centre = posterior.weight.dot(posterior.poisson);
  VectorX mean(size), std_dev(size);
  for (Index i = 0; i < size; ++i) {
    const double at = std::clamp((grid(i) - first) / spacing, 0.0, static_cast<double>(size - 1));
    const Index k = std::min<Index>(static_cast<Index>(at), size - 2);
    const double share = at - static_cast<double>(k);
    mean(i) = (1 - share) * posterior.log_young_mean(k) + share * posterior.log_young_mean(k + 1) +
              slope * (grid(i) - first - at * spacing) + (wider_slope - slope) * (grid(i) - centre);
    const double own = (1 - share) * posterior.log_young_std(k) + share * posterior.log_young_std(k + 1);
    std_dev(i) = std::sqrt(std::max(own * own + left, 0.01 * own * own));
  }
  posterior.poisson = grid;
  posterior.weight = weight;
  posterior.log_young_mean = mean;
  posterior.log_young_std = std_dev;
  update_covariance(posterior);
}

}  // namespace palpate::estimation
