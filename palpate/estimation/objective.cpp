// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/objective.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <limits>
#include <thread>

#include "palpate/core/error.hpp"
#include "palpate/estimation/cell_sums.hpp"

namespace palpate::estimation {

Objective::Objective(ForwardModel& model, const std::vector<std::vector<TermInput>>& inputs, Unknowns& unknowns)
    : model_(model), unknowns_(unknowns) {
  std::size_t terms = 0;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    terms_.emplace_back();
    int frames = 0;
    for (const auto& input : inputs[s]) {
      const bool is_frame = std::holds_alternative<PointCloud>(input) || std::holds_alternative<RayObservation>(input);
      const TermContext context{model, s, unknowns, shared_, is_frame ? frames++ : 0};
      if (auto term = make_term(input, context)) terms_.back().push_back(std::move(term));
    }
    for (const auto& term : terms_.back()) terms += term->is_about_object();
  }
  if (terms == 0) throw Error("no step has an observation that says anything about the object", "pushes");
}

Evaluation Objective::evaluate(const VectorX& unknowns, const Loss& loss, const OnProgress& progress) {
  Evaluation out;
  const bool anchored = reuse_ > 0 && model_.superposes();
  if (anchored) {
    prepare_anchors();
  } else {
    rows_.assign(model_.step_count(), {});
  }
  predictions_.assign(model_.step_count(), {});
  if (reuse_ > 0) kept_.resize(model_.step_count());
  std::vector<StepNormal> normals(reuse_ > 0 ? model_.step_count() : 0);
  // Every worker solves and linearises its own steps; what follows adds them up in order, so that digits do not depend on
  // who finished first.
  std::atomic<std::size_t> done{0};
  std::atomic<bool> stop{false};
  std::vector<std::exception_ptr> faults(model_.workers());
  const auto work = [&](std::size_t worker) {
    try {
      for (std::size_t s = model_.first_step_of(worker); s < model_.first_step_of(worker + 1) && !stop; ++s) {
        if (terms_[s].empty() || !loss.counts(s)) continue;
        if (anchored) {
          predictions_[s] = model_.predict_in_span(s, unknowns, anchors_[s].terms.empty() ? part_for_rows(s, loss) : SurfacePart::coordinates);
          normals[s] = follow(s, unknowns, loss);
        } else if (reuse_ > 0 && find_kept(s, unknowns, loss)) {
          if (rows_wanted_) rows_[s] = kept_[s].back().rows;
          normals[s] = moved_along(kept_[s].back(), unknowns);
          continue;
        } else {
          ++steps_evaluated_;
          predictions_[s] = model_.predict(s, unknowns);
          // The others go on: which of them were solved, and from where, must not depend on who was faster.
          if (!predictions_[s].converged || stop) return;
          rows_[s] = rows_of(s, predictions_[s], unknowns, loss);
          if (reuse_ > 0) {
            keep(s, unknowns, loss);
            normals[s] = kept_[s].back();
          }
        }
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

  return reuse_ > 0 ? sum(normals, unknowns) : assemble(rows_, unknowns, loss);
}

Evaluation Objective::assemble(const std::vector<std::vector<TermRows>>& all_rows, const VectorX& unknowns, const Loss& loss) const {
  Evaluation out = Evaluation::nothing(unknowns_.size());
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
    out.curvature(k, k) += precision;
  }
  out.usable = std::isfinite(out.cost);
}

std::vector<TermRows> Objective::rows_of(std::size_t s, const StepPrediction& predicted, const VectorX& unknowns,
                                         const Loss& loss, bool surface_slopes) const {
  const RaysOfStep* chosen = loss.along_rays ? loss.rays_of(s) : nullptr;
  std::vector<TermRows> rows;
  for (std::size_t t = 0; t < terms_[s].size(); ++t) {
    const bool some = chosen != nullptr && !(*chosen)[t].empty();
    rows.push_back(terms_[s][t]->rows(predicted, unknowns, {loss.along_rays, some ? &(*chosen)[t] : nullptr, surface_slopes, loss.most_points}));
    if (!loss.noise) continue;
    auto noise = loss.noise->of(s, t);  // of the same points
    if (noise && noise->weight().size() == rows.back().residual.size()) rows.back().shared_noise = std::move(noise);
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
      for (Index i = 0; i < facing.size(); ++i) chosen[t][static_cast<std::size_t>(i)] = facing(i) > 1 ? counts_in : facing(i) > 0 ? grazes : passes_by;
    }
    loss.rays[s] = std::make_shared<const RaysOfStep>(std::move(chosen));
  }
  return loss;
}

double Objective::cost_of(const std::vector<StepPrediction>& predictions, const std::vector<std::size_t>& steps, const VectorX& unknowns,
                          const Loss& loss) const {
  double cost = 0;
  for (std::size_t s : steps) {
    for (const TermRows& rows : rows_of(s, predictions[s], unknowns, loss)) {
      for (Index i = 0; i < rows.residual.size(); ++i) {
        cost += rows.robust ? tukey_rho(rows.residual(i), loss.tukey) : 0.5 * rows.residual(i) * rows.residual(i);
      }
    }
  }
  return cost;
}

double Objective::residual_scale() const {
  std::vector<double> sizes;  // of what has one: rays that pass by say nothing of the spread of those that hit
  bool any = false;
  for (const auto& step : rows_) {
    for (const auto& rows : step) {
      if (!rows.robust) continue;
      any = any || rows.residual.size() > 0;
      for (Index i = 0; i < rows.residual.size(); ++i)
        if (std::isfinite(rows.residual(i))) sizes.push_back(std::abs(rows.residual(i)));
    }
  }
  if (sizes.empty()) return any ? std::numeric_limits<double>::infinity() : 0;
  auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle / 0.6745;
}

namespace {

ResidualSummary::Readings& readings_like(const TermRows& rows, ResidualSummary& summary) {
  return rows.observed_m.rows() > 0 ? summary.markers : rows.unit == "N" ? summary.forces : rows.unit == "m" ? summary.travels : summary.torques;
}

}  // namespace

ResidualSummary Objective::summarise(const Loss& loss) const {
  ResidualSummary summary;
  double between = 0, total = 0;
  std::size_t cells = 0, in_cells = 0;
  for (std::size_t s = 0; s < rows_.size(); ++s) {
    const RaysOfStep* const choice = loss.along_rays ? loss.rays_of(s) : nullptr;
    for (std::size_t t = 0; t < rows_[s].size(); ++t) {
      const TermRows& rows = rows_[s][t];
      const bool chosen = choice != nullptr && t < choice->size() && (*choice)[t].size() == static_cast<std::size_t>(rows.residual.size());
      CellSums cell_sums(rows.cell);
      if (!rows.robust) {
        ResidualSummary::Readings& readings = readings_like(rows, summary);
        readings.rows += static_cast<std::size_t>(rows.residual.size());
        readings.chi2 += rows.residual.squaredNorm();
      }
      for (Index i = 0; i < rows.residual.size(); ++i) {
        const double r = rows.residual(i);
        if (chosen && (*choice)[t][static_cast<std::size_t>(i)] == grazes) continue;
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
          cell_sums.add(rows.cell[static_cast<std::size_t>(i)], r);
          total += r * r;
          ++in_cells;
        }
      }
      cell_sums.for_each([&](const CellSums::Cell& cell) {
        between += cell.sum * cell.sum / cell.count;
        ++cells;
      });
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
