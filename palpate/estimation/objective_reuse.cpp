// SPDX-License-Identifier: Apache-2.0
// What was evaluated before, used again nearby.
#include <algorithm>
#include <cmath>

#include "palpate/estimation/objective.hpp"

namespace palpate::estimation {
namespace {

constexpr std::size_t places_kept = 16;  // a step: the optimum, and those of a search over nu

/// Sorted, each once.
void tidy(std::vector<int>& unknowns) {
  std::sort(unknowns.begin(), unknowns.end());
  unknowns.erase(std::unique(unknowns.begin(), unknowns.end()), unknowns.end());
}

std::vector<int> places_in(const std::vector<int>& sorted, const std::vector<int>& unknowns) {
  std::vector<int> places;
  for (int unknown : unknowns)
    places.push_back(static_cast<int>(std::lower_bound(sorted.begin(), sorted.end(), unknown) - sorted.begin()));
  return places;
}

}  // namespace

/// Puts the nearest place that is near enough at the end of what is kept; false: there is none.
bool Objective::find_kept(std::size_t s, const VectorX& unknowns, const Loss& loss) {
  KeptPlaces& places = kept_[s];
  auto nearest = places.end();
  double least = reuse_ * reuse_;
  for (auto kept = places.begin(); kept != places.end(); ++kept) {
    if (!kept->loss.weighs_like(loss) || kept->loss.rays_of(s) != loss.rays_of(s) || (rows_wanted_ && kept->rows.empty())) continue;
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
  tidy(kept.unknowns);
  kept.at = unknowns(kept.unknowns);
  kept.normal = Evaluation::nothing(static_cast<Index>(kept.unknowns.size()));
  kept.loss = loss;
  for (const TermRows& rows : rows_[s]) add_rows(rows, loss, places_in(kept.unknowns, rows.unknowns), kept.normal);
  if (rows_wanted_) kept.rows = rows_[s];
  places.push_back(std::move(kept));
}

Objective::StepNormal Objective::moved_along(const KeptStep& kept, const VectorX& unknowns) const {
  StepNormal out = kept;
  const VectorX change = unknowns(kept.unknowns) - kept.at, bent = kept.normal.curvature * change;
  const double gain = kept.normal.gradient.dot(change) + 0.5 * change.dot(bent);
  (kept.normal.robust_cost > 0 ? out.normal.robust_cost : out.normal.cost) += gain;
  out.normal.gradient += bent;
  return out;
}

Objective::Anchor Objective::anchor_of(const std::vector<TermRows>& rows, const StepPrediction& there, const VectorX& unknowns,
                                       const Loss& loss) const {
  Anchor anchor;
  anchor.loss = loss;
  anchor.terms.resize(rows.size());
  for (std::size_t t = 0; t < rows.size(); ++t)
    if (rows[t].facets || !rows[t].surface.empty()) anchor.terms[t].emplace(*pattern_, rows[t], loss, there, unknowns);
  return anchor;
}

void Objective::prepare_anchors() {
  if (!pattern_) pattern_ = std::make_shared<const SurfacePattern>(model_.object().surface.rest());
  anchors_.resize(model_.step_count());
  rows_.resize(model_.step_count());  // those of the anchors stay
}

Loss Objective::choose_rays(const VectorX& unknowns, const Loss& loss) {
  prepare_anchors();
  for (std::size_t s = 0; s < model_.step_count(); ++s) {
    if (terms_[s].empty() || !loss.counts(s) || loss.rays_of(s) != nullptr) continue;
    ++steps_evaluated_;
    rows_[s] = rows_of(s, model_.predict_in_span(s, unknowns, part_for_rows(s, loss)), unknowns, loss, true);
    anchors_[s] = {};
    anchors_[s].loss = loss;
    anchors_[s].last = unknowns;
  }
  return with_chosen_rays(loss);
}

/// What of the surface the step's rows are made of.
SurfacePart Objective::part_for_rows(std::size_t s, const Loss& loss) const {
  const bool slopes = std::any_of(terms_[s].begin(), terms_[s].end(), [&](const auto& term) {
    return term->needs_surface_derivatives() || (!loss.along_rays && term->looks_at_surface());
  });
  return slopes ? SurfacePart::derivatives : SurfacePart::place;
}

/// So that the last prediction of a step holds what its rows are made of.
void Objective::complete(std::size_t s, const VectorX& unknowns, const Loss& loss) {
  StepPrediction& here = predictions_[s];
  if (here.d_surface.rows() > 0) return;
  if (part_for_rows(s, loss) == SurfacePart::derivatives) {
    here = model_.predict_in_span(s, unknowns, SurfacePart::derivatives);
  } else if (here.surface_m.rows() == 0) {
    model_.add_surface(s, unknowns, here);
  }
}

/// How far what the rows look at has moved since they were made, in standard deviations of a point; where that is no more than
/// `enough`, coordinates say so as a rule, and it may be too much.
double Objective::moved_since(std::size_t s, const Anchor& anchor, const VectorX& unknowns, double enough) {
  const auto furthest = [&](auto moved_m) {
    double moved = 0;
    for (std::size_t t = 0; t < anchor.terms.size(); ++t)
      if (anchor.terms[t]) moved = std::max(moved, moved_m(*anchor.terms[t]) / terms_[s][t]->typical_sigma());
    return moved;
  };
  StepPrediction& here = predictions_[s];
  if (here.surface_m.rows() == 0) {
    const double at_most = furthest([&](const SurfaceQuadratic& term) { return term.moved_at_most_m(here, unknowns, unknowns_); });
    if (at_most <= enough) return at_most;
    model_.add_surface(s, unknowns, here);
  }
  return furthest([&](const SurfaceQuadratic& term) { return term.moved_m(here, unknowns, unknowns_); });
}

/// True where the step's terms need no more of its prediction than it holds.
bool Objective::stays_in_span(std::size_t s) const {
  const StepPrediction& here = predictions_[s];
  if (here.d_surface.rows() > 0) return true;
  for (std::size_t t = 0; t < terms_[s].size(); ++t) {
    const auto& anchored = anchors_[s].terms[t];
    if (anchored ? !anchored->shares_span(here) : terms_[s][t]->looks_at_surface()) return false;
  }
  return true;
}

Objective::StepNormal Objective::follow(std::size_t s, const VectorX& unknowns, const Loss& loss) {
  const StepPrediction& here = predictions_[s];
  Anchor& anchor = anchors_[s];
  const bool same_rays = anchor.loss.rays_of(s) == loss.rays_of(s);
  double moved = std::numeric_limits<double>::infinity();  // in standard deviations of a point
  if (!anchor.terms.empty() && anchor.loss.weighs_like(loss)) {
    moved = moved_since(s, anchor, unknowns, same_rays ? 0.5 * reuse_ * anchor.patience : 0);
  } else if (anchor.terms.empty() && !same_rays && anchor.last.size() == unknowns.size() && anchor.last == unknowns &&
             anchor.loss.weighs_like(loss)) {
    moved = 0;  // rays were cast just here
  }
  if (moved == 0 && !same_rays && anchor.loss.rays_of(s) == nullptr) {  // a choice among what was cast
    for (std::size_t t = 0; t < rows_[s].size(); ++t) {
      const std::vector<char>& chosen = (*loss.rays_of(s))[t];
      for (std::size_t i = 0; i < chosen.size(); ++i)
        if (chosen[i] != counts_in) rows_[s][t].residual(static_cast<Index>(i)) = std::numeric_limits<double>::infinity();
    }
    complete(s, unknowns, loss);
    anchor = anchor_of(rows_[s], here, unknowns, loss);
  } else if (!same_rays || !(moved <= 0.5 * reuse_ * anchor.patience)) {
    ++steps_evaluated_;
    complete(s, unknowns, loss);
    std::vector<TermRows> rows = rows_of(s, here, unknowns, loss, true);
    Anchor fresh = anchor_of(rows, here, unknowns, loss);
    if (!rows_wanted_) return normal_around(fresh, s, unknowns, loss);
    // Rays that change triangles send the optimum to and fro: each time it takes a longer way to ask them again.
    fresh.patience = anchor.terms.empty() ? 1 : 2 * anchor.patience;
    anchor = std::move(fresh);
    rows_[s] = std::move(rows);
  }
  if (anchor.last.size() != unknowns.size() || anchor.last != unknowns) {
    if (!stays_in_span(s)) predictions_[s] = model_.predict_in_span(s, unknowns, SurfacePart::derivatives);
    anchor.said = normal_around(anchor, s, unknowns, loss);
    anchor.last = unknowns;
  }
  return anchor.said;
}

Objective::StepNormal Objective::normal_around(Anchor& anchor, std::size_t s, const VectorX& unknowns, const Loss& loss) {
  const StepPrediction& here = predictions_[s];
  std::vector<std::vector<int>> involved(anchor.terms.size());
  std::vector<TermRows> asked(anchor.terms.size());
  StepNormal out;
  for (std::size_t t = 0; t < anchor.terms.size(); ++t) {
    if (anchor.terms[t]) {
      involved[t] = here.columns;
      involved[t].insert(involved[t].end(), anchor.terms[t]->own().begin(), anchor.terms[t]->own().end());
    } else {
      asked[t] = terms_[s][t]->rows(here, unknowns, {loss.along_rays});
      involved[t] = asked[t].unknowns;
    }
    out.unknowns.insert(out.unknowns.end(), involved[t].begin(), involved[t].end());
  }
  tidy(out.unknowns);
  out.normal = Evaluation::nothing(static_cast<Index>(out.unknowns.size()));
  for (std::size_t t = 0; t < anchor.terms.size(); ++t) {
    const std::vector<int> places = places_in(out.unknowns, involved[t]);
    if (anchor.terms[t]) {
      anchor.terms[t]->add_to(here, unknowns, places, out.normal);
    } else {
      add_rows(asked[t], loss, places, out.normal);
      if (rows_wanted_) rows_[s][t] = std::move(asked[t]);
    }
  }
  return out;
}

Evaluation Objective::sum(const std::vector<StepNormal>& steps, const VectorX& unknowns) const {
  Evaluation out = Evaluation::nothing(unknowns_.size());
  for (const StepNormal& step : steps) {
    out.cost += step.normal.cost + step.normal.robust_cost;
    out.robust_cost += step.normal.robust_cost;
    for (std::size_t a = 0; a < step.unknowns.size(); ++a) {
      const Index row = static_cast<Index>(a);
      out.gradient(step.unknowns[a]) += step.normal.gradient(row);
      for (std::size_t b = 0; b < step.unknowns.size(); ++b) {
        const Index column = static_cast<Index>(b);
        out.hessian(step.unknowns[a], step.unknowns[b]) += step.normal.hessian(row, column);
        out.curvature(step.unknowns[a], step.unknowns[b]) += step.normal.curvature(row, column);
        out.robust_hessian(step.unknowns[a], step.unknowns[b]) += step.normal.robust_hessian(row, column);
      }
    }
  }
  add_priors(unknowns, out);
  return out;
}

Evaluation Objective::of_step(std::size_t s, const VectorX& unknowns, const Loss& loss) const {
  if (s < anchors_.size() && anchors_[s].last.size() == unknowns.size()) return sum({anchors_[s].said}, unknowns);
  Loss one = loss;
  one.every = 1;
  one.steps.assign(model_.step_count(), 0);
  one.steps[s] = 1;
  return assemble(rows_, unknowns, one);
}

Objective::Kept Objective::take_kept() {
  Kept out{std::move(kept_), std::move(anchors_), {}, pattern_};
  if (!out.anchors.empty()) out.rows = std::move(rows_);
  kept_.clear();
  anchors_.clear();
  rows_.clear();
  return out;
}

void Objective::adopt(Kept kept, const std::vector<int>& moved) {
  const auto renumber = [&](std::vector<int>& unknowns) {
    for (int& unknown : unknowns) unknown = moved[static_cast<std::size_t>(unknown)];
    return std::none_of(unknowns.begin(), unknowns.end(), [](int unknown) { return unknown < 0; });
  };
  const std::size_t steps = model_.step_count();
  kept_.assign(steps, {});
  for (std::size_t s = 0; s < std::min(kept.places.size(), steps); ++s) {
    for (KeptStep& place : kept.places[s]) {
      bool whole = renumber(place.unknowns);
      for (TermRows& rows : place.rows) whole = renumber(rows.unknowns) && whole;
      if (whole) kept_[s].push_back(std::move(place));
    }
  }
  if (!model_.superposes()) return;
  pattern_ = std::move(kept.pattern);
  anchors_.assign(steps, {});
  rows_.assign(steps, {});
  for (std::size_t s = 0; s < std::min(kept.anchors.size(), steps); ++s) {
    bool whole = kept.anchors[s].terms.size() == terms_[s].size() && kept.rows[s].size() == terms_[s].size();
    for (auto& term : kept.anchors[s].terms) whole = (!term || term->renumber(moved)) && whole;
    for (TermRows& rows : kept.rows[s]) whole = renumber(rows.unknowns) && whole;
    for (std::size_t t = 0; whole && t < terms_[s].size(); ++t) {
      if (!kept.anchors[s].terms[t]) continue;
      const std::vector<int> own = terms_[s][t]->own_unknowns(), &then = kept.anchors[s].terms[t]->own();
      whole = then.size() >= own.size() && std::equal(own.begin(), own.end(), then.begin());  // behind them come modes
    }
    if (!whole) continue;
    anchors_[s] = std::move(kept.anchors[s]);
    anchors_[s].patience = 1;
    anchors_[s].last.resize(0);
    rows_[s] = std::move(kept.rows[s]);
  }
}

}  // namespace palpate::estimation
