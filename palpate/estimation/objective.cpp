// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/objective.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <limits>
#include <thread>

#include "palpate/core/error.hpp"

namespace palpate::estimation {
namespace {

// 75 degrees: a sphere's ray there is a thirtieth of the radius inside the outline.
constexpr double well_inside = 0.26;

constexpr std::size_t places_kept = 16;  // a step: the optimum, and those of a search over nu

}  // namespace

double tukey_rho(double residual, double cut) {
  const double t = residual / cut;
  if (!(std::abs(t) < 1)) return cut * cut / 6;
  const double keep = 1 - t * t;
  return cut * cut / 6 * (1 - keep * keep * keep);
}

double tukey_weight(double residual, double cut) {
  const double t = residual / cut;
  if (!(std::abs(t) < 1)) return 0;
  const double keep = 1 - t * t;
  return keep * keep;
}

double tukey_information_factor(double cut) {
  double weight = 0, psi_squared = 0, psi_slope = 0;
  constexpr int steps = 4000;
  for (int i = 0; i < steps; ++i) {
    const double r = cut * (2 * (i + 0.5) / steps - 1);
    const double density = std::exp(-0.5 * r * r) / std::sqrt(2 * EIGEN_PI) * 2 * cut / steps;
    const double t2 = r * r / (cut * cut);
    const double w = (1 - t2) * (1 - t2);
    weight += density * w;
    psi_squared += density * w * w * r * r;
    psi_slope += density * (1 - t2) * (1 - 5 * t2);
  }
  return psi_slope * psi_slope / (psi_squared * weight);
}

Objective::Objective(ForwardModel& model, const std::vector<std::vector<TermInput>>& inputs, Unknowns& unknowns)
    : model_(model), unknowns_(unknowns) {
  std::size_t terms = 0;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    terms_.emplace_back();
    for (const auto& input : inputs[s]) {
      if (auto term = make_term(input, {model, s, unknowns, shared_})) terms_.back().push_back(std::move(term));
    }
    terms += terms_.back().size();
  }
  if (terms == 0) throw Error("no step has an observation that says anything about the object", "pushes");
}

namespace {

/// Adds what some rows say. @param place  where their unknowns are in `out`
void add_rows(const TermRows& rows, const Loss& loss, const std::vector<int>& place, Evaluation& out) {
  double relevance = rows.cell.empty() ? 1 : loss.surface_weight;
  if (rows.robust) relevance /= loss.widening * loss.widening;
  VectorX weight = VectorX::Constant(rows.residual.size(), relevance);
  for (Index i = 0; i < rows.residual.size(); ++i) {
    if (rows.robust) {
      out.robust_cost += relevance * tukey_rho(rows.residual(i), loss.tukey);
      weight(i) *= tukey_weight(rows.residual(i), loss.tukey);
    } else {
      out.cost += relevance * 0.5 * rows.residual(i) * rows.residual(i);
    }
  }
  VectorX finite = rows.residual;
  for (Index i = 0; i < finite.size(); ++i) {
    if (weight(i) == 0) finite(i) = 0;
  }
  const MatrixX weighted = weight.asDiagonal() * rows.jacobian;
  const MatrixX block = rows.jacobian.transpose() * weighted;
  const VectorX slope = weighted.transpose() * finite;
  for (std::size_t a = 0; a < place.size(); ++a) {
    out.gradient(place[a]) += slope(static_cast<Index>(a));
    for (std::size_t b = 0; b < place.size(); ++b) {
      const double entry = block(static_cast<Index>(a), static_cast<Index>(b));
      out.hessian(place[a], place[b]) += entry;
      if (rows.robust) out.robust_hessian(place[a], place[b]) += entry;
    }
  }
}

Evaluation nothing(Index count) {
  Evaluation out;
  out.hessian = MatrixX::Zero(count, count);
  out.robust_hessian = MatrixX::Zero(count, count);
  out.gradient = VectorX::Zero(count);
  return out;
}

}  // namespace

/// Puts the nearest place that is near enough at the end of what is kept; false: there is none.
bool Objective::find_kept(std::size_t s, const VectorX& unknowns, const Loss& loss) {
  KeptPlaces& places = kept_[s];
  auto nearest = places.end();
  double least = reuse_ * reuse_;
  for (auto kept = places.begin(); kept != places.end(); ++kept) {
    if (kept->loss.tukey != loss.tukey || kept->loss.widening != loss.widening || kept->loss.along_rays != loss.along_rays ||
        kept->loss.surface_weight != loss.surface_weight || kept->loss.rays_of(s) != loss.rays_of(s) ||
        (rows_wanted_ && kept->rows.empty())) {
      continue;
    }
    const VectorX change = unknowns(kept->unknowns) - kept->at;
    const double moved = change.dot(kept->normal.hessian * change);
    if (moved <= least) {
      least = moved;
      nearest = kept;
    }
  }
  if (nearest == places.end()) return false;
  std::rotate(nearest, nearest + 1, places.end());
  return true;
}

void Objective::keep(std::size_t s, const VectorX& unknowns, const Loss& loss) {
  KeptPlaces& places = kept_[s];
  if (places.size() == places_kept) {  // the one that was of no use for longest goes, the last one with rows stays
    places.erase(std::find_if(places.begin(), places.end(), [](const KeptStep& p) { return p.rows.empty(); }));
  }
  if (rows_wanted_)
    for (KeptStep& other : places) other.rows.clear();
  KeptStep kept;
  for (const TermRows& rows : rows_[s]) kept.unknowns.insert(kept.unknowns.end(), rows.unknowns.begin(), rows.unknowns.end());
  std::sort(kept.unknowns.begin(), kept.unknowns.end());
  kept.unknowns.erase(std::unique(kept.unknowns.begin(), kept.unknowns.end()), kept.unknowns.end());
  kept.at = unknowns(kept.unknowns);
  kept.normal = nothing(static_cast<Index>(kept.unknowns.size()));
  kept.loss = loss;
  for (const TermRows& rows : rows_[s]) {
    std::vector<int> place;
    for (int unknown : rows.unknowns) {
      place.push_back(static_cast<int>(std::lower_bound(kept.unknowns.begin(), kept.unknowns.end(), unknown) - kept.unknowns.begin()));
    }
    add_rows(rows, loss, place, kept.normal);
  }
  kept.normal.cost += kept.normal.robust_cost;
  if (rows_wanted_) kept.rows = rows_[s];
  places.push_back(std::move(kept));
}

void Objective::adopt(const std::vector<KeptPlaces>& kept, const std::vector<int>& moved) {
  kept_.assign(model_.step_count(), {});
  const auto renumber = [&](std::vector<int>& unknowns) {
    for (int& unknown : unknowns) unknown = moved[static_cast<std::size_t>(unknown)];
    return std::none_of(unknowns.begin(), unknowns.end(), [](int unknown) { return unknown < 0; });
  };
  for (std::size_t s = 0; s < std::min(kept.size(), kept_.size()); ++s) {
    for (KeptStep place : kept[s]) {
      bool whole = renumber(place.unknowns);
      for (TermRows& rows : place.rows) whole = renumber(rows.unknowns) && whole;
      if (whole) kept_[s].push_back(std::move(place));
    }
  }
}

Evaluation Objective::sum_kept(const VectorX& unknowns, const Loss& loss) const {
  Evaluation out = nothing(unknowns_.size());
  for (std::size_t s = 0; s < kept_.size(); ++s) {
    if (kept_[s].empty() || !loss.counts(s)) continue;
    const KeptStep& kept = kept_[s].back();
    const VectorX change = unknowns(kept.unknowns) - kept.at;
    const VectorX bent = kept.normal.hessian * change;
    const double gain = kept.normal.gradient.dot(change) + 0.5 * change.dot(bent);
    out.cost += kept.normal.cost + gain;
    out.robust_cost += kept.normal.robust_cost + (kept.normal.robust_cost > 0 ? gain : 0);
    for (std::size_t a = 0; a < kept.unknowns.size(); ++a) {
      const Index row = static_cast<Index>(a);
      out.gradient(kept.unknowns[a]) += kept.normal.gradient(row) + bent(row);
      for (std::size_t b = 0; b < kept.unknowns.size(); ++b) {
        const Index column = static_cast<Index>(b);
        out.hessian(kept.unknowns[a], kept.unknowns[b]) += kept.normal.hessian(row, column);
        out.robust_hessian(kept.unknowns[a], kept.unknowns[b]) += kept.normal.robust_hessian(row, column);
      }
    }
  }
  add_priors(unknowns, out);
  return out;
}

Evaluation Objective::evaluate(const VectorX& unknowns, const Loss& loss, const OnProgress& progress) {
  Evaluation out;
  rows_.assign(model_.step_count(), {});
  predictions_.assign(model_.step_count(), {});
  if (reuse_ > 0) kept_.resize(model_.step_count());
  // Every worker solves and linearises its own steps; what follows adds them up in order, so that digits do not depend on
  // who finished first.
  std::atomic<std::size_t> done{0};
  std::atomic<bool> stop{false};
  std::vector<std::exception_ptr> faults(model_.workers());
  const auto work = [&](std::size_t worker) {
    try {
      for (std::size_t s = model_.first_step_of(worker); s < model_.first_step_of(worker + 1) && !stop; ++s) {
        if (terms_[s].empty() || !loss.counts(s)) continue;
        if (reuse_ > 0 && find_kept(s, unknowns, loss)) {
          if (rows_wanted_) rows_[s] = kept_[s].back().rows;
          continue;
        }
        ++steps_evaluated_;
        predictions_[s] = model_.predict(s, unknowns);
        if (!predictions_[s].converged) stop = true;
        if (stop) return;
        rows_[s] = rows_of(s, predictions_[s], unknowns, loss);
        if (reuse_ > 0) keep(s, unknowns, loss);
        ++done;
        // Only the calling thread speaks to the caller.
        if (worker == 0 && progress && !progress("fit", static_cast<double>(done) / static_cast<double>(model_.step_count()))) {
          out.reason = "cancelled";
          stop = true;
        }
      }
    } catch (...) {
      faults[worker] = std::current_exception();
      stop = true;
    }
  };
  std::vector<std::thread> helpers;
  for (std::size_t worker = 1; worker < model_.workers(); ++worker) helpers.emplace_back(work, worker);
  work(0);
  for (auto& helper : helpers) helper.join();
  for (const auto& fault : faults) {
    if (fault) std::rethrow_exception(fault);
  }
  if (out.reason == "cancelled") return out;
  for (std::size_t s = 0; s < model_.step_count(); ++s) {
    if (!predictions_[s].converged && !predictions_[s].reason.empty()) {
      out.reason = "step " + std::to_string(model_.index(s).step) + " of " + model_.push(s).name + ": " + predictions_[s].reason;
      return out;
    }
  }

  return reuse_ > 0 ? sum_kept(unknowns, loss) : assemble(rows_, unknowns, loss);
}

Evaluation Objective::assemble(const std::vector<std::vector<TermRows>>& all_rows, const VectorX& unknowns, const Loss& loss) const {
  Evaluation out = nothing(unknowns_.size());
  for (std::size_t s = 0; s < all_rows.size(); ++s) {
    if (!loss.counts(s)) continue;
    for (const TermRows& rows : all_rows[s]) add_rows(rows, loss, rows.unknowns, out);
  }
  out.cost += out.robust_cost;
  add_priors(unknowns, out);
  return out;
}

void Objective::add_priors(const VectorX& unknowns, Evaluation& out) const {
  for (int k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    if (!std::isfinite(unknown.prior_std) || unknown.fixed) continue;
    const double precision = 1 / (unknown.prior_std * unknown.prior_std);
    const double off = unknowns(k) - unknown.prior_mean;
    out.cost += 0.5 * precision * off * off;
    out.gradient(k) += precision * off;
    out.hessian(k, k) += precision;
  }
  out.usable = std::isfinite(out.cost);
}

std::vector<TermRows> Objective::rows_of(std::size_t s, const StepPrediction& predicted, const VectorX& unknowns,
                                         const Loss& loss) const {
  const RaysOfStep* chosen = loss.along_rays ? loss.rays_of(s) : nullptr;
  std::vector<TermRows> rows;
  for (std::size_t t = 0; t < terms_[s].size(); ++t) {
    const bool some = chosen != nullptr && !(*chosen)[t].empty();
    rows.push_back(terms_[s][t]->rows(predicted, unknowns, {loss.along_rays, some ? &(*chosen)[t] : nullptr}));
  }
  return rows;
}

Loss Objective::with_chosen_rays(Loss loss) const {
  loss.rays.resize(std::max(loss.rays.size(), rows_.size()));
  for (std::size_t s = 0; s < rows_.size(); ++s) {
    if (loss.rays[s] != nullptr || rows_[s].empty()) continue;
    RaysOfStep chosen(rows_[s].size());
    for (std::size_t t = 0; t < chosen.size(); ++t) {
      const VectorX& facing = rows_[s][t].facing;
      chosen[t].resize(static_cast<std::size_t>(facing.size()));
      for (Index i = 0; i < facing.size(); ++i) chosen[t][static_cast<std::size_t>(i)] = facing(i) > well_inside ? 1 : 0;
    }
    loss.rays[s] = std::make_shared<const RaysOfStep>(std::move(chosen));
  }
  return loss;
}

double Objective::cost_of(const std::vector<StepPrediction>& predictions, const VectorX& unknowns, const Loss& loss) const {
  double cost = 0;
  for (std::size_t s = 0; s < predictions.size(); ++s) {
    if (predictions[s].surface_m.rows() == 0) continue;
    for (const TermRows& rows : rows_of(s, predictions[s], unknowns, loss)) {
      for (Index i = 0; i < rows.residual.size(); ++i) {
        cost += rows.robust ? tukey_rho(rows.residual(i), loss.tukey) : 0.5 * rows.residual(i) * rows.residual(i);
      }
    }
  }
  return cost;
}

double Objective::residual_scale() const {
  std::vector<double> sizes;
  for (const auto& step : rows_) {
    for (const auto& rows : step) {
      if (!rows.robust) continue;
      for (Index i = 0; i < rows.residual.size(); ++i) sizes.push_back(std::abs(rows.residual(i)));
    }
  }
  if (sizes.empty()) return 0;
  auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle / 0.6745;
}

ResidualSummary Objective::summarise(const Loss& loss) const {
  ResidualSummary summary;
  double between = 0, total = 0;
  std::size_t cells = 0, in_cells = 0;
  for (const auto& step : rows_) {
    for (const auto& rows : step) {
      std::map<int, std::pair<double, std::size_t>> cell_sums;
      for (Index i = 0; i < rows.residual.size(); ++i) {
        const double r = rows.residual(i);
        if (rows.robust) ++summary.points;
        if (std::isinf(r)) {  // a ray beside the silhouette: no residual that could be tested
          ++summary.outliers;
          ++summary.missed;
          continue;
        }
        ++summary.rows;
        const bool inside = std::abs(r) < loss.tukey;
        if (rows.robust && !inside) ++summary.outliers;
        if (inside || !rows.robust) summary.chi2 += r * r;  // what was called an outlier does not test the model
        if (rows.unit == "m" && (inside || !rows.robust)) {
          summary.sum_squared_m2 += std::pow(r * rows.sigma(i), 2);
          ++summary.lengths;
        }
        if (!rows.cell.empty() && inside) {
          auto& [sum, n] = cell_sums[rows.cell[static_cast<std::size_t>(i)]];
          sum += r;
          ++n;
          total += r * r;
          ++in_cells;
        }
      }
      for (const auto& [cell, sums] : cell_sums) {
        between += sums.first * sums.first / static_cast<double>(sums.second);
        ++cells;
      }
    }
  }
  if (cells > 0 && total > 0) {
    // Mean squares between and within cells, in units of the stated variance: where residuals are far smaller than that,
    // their pattern says nothing about the sensor.
    const double mean_square = total / static_cast<double>(in_cells);
    const double excess = between / static_cast<double>(cells) - mean_square;
    summary.variance_inflation = 1 + std::max(0.0, excess) / std::max(1.0, mean_square);
  }
  return summary;
}

}  // namespace palpate::estimation
