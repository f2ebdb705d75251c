// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/held_out.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/estimation/region_at.hpp"

namespace palpate::estimation {
namespace {

constexpr double as_good_as_none = 0.02;  // of the push's highest load: nothing is foretold of the untouched object
constexpr double nearly_highest = 0.95;   // what tells the highest load is left out with it

/// Steps of a push that saw something under at least this share of its highest load.
StepFlags loaded_steps(const PartialFits& fits, const StepFlags& push, double share) {
  StepFlags loaded(push.size(), 0);
  double highest = 0;  // of those that saw something
  for (std::size_t s = 0; s < push.size(); ++s)
    if (push[s] != 0 && !fits.joint_rows(s).empty()) highest = std::max(highest, load_of(fits.model().step(s)));
  for (std::size_t s = 0; s < push.size(); ++s) {
    const double load = load_of(fits.model().step(s));
    loaded[s] = push[s] != 0 && !fits.joint_rows(s).empty() && load > 0 && load >= share * highest;
  }
  return loaded;
}

bool any(const StepFlags& steps) { return std::find(steps.begin(), steps.end(), 1) != steps.end(); }

/// Whether something loaded is left of all pushes without these steps.
bool leaves_loads(const PartialFits& fits, const std::vector<StepFlags>& pushes, const StepFlags& out) {
  return std::any_of(pushes.begin(), pushes.end(), [&](const StepFlags& push) {
    StepFlags left = loaded_steps(fits, push, as_good_as_none);
    for (std::size_t s = 0; s < left.size(); ++s) left[s] = left[s] != 0 && out[s] == 0;
    return any(left);
  });
}

/// Squared distances of the points that the joint fit took for the object.
struct Distance {
  double sum_m2 = 0;
  std::size_t count = 0;
  double mean_m2() const { return count > 0 ? sum_m2 / static_cast<double>(count) : 0; }
  double rms_m() const { return count > 0 ? std::sqrt(mean_m2()) : HeldOut::unknown; }
};

void add_distance(PartialFits& fits, std::size_t s, const StepPrediction& predicted, const VectorX& unknowns, Distance& out) {
  Loss closest = fits.loss();
  closest.along_rays = false;
  const auto rows = fits.objective().rows_of(s, predicted, unknowns, closest);
  for (std::size_t t = 0; t < rows.size(); ++t) {
    if (rows[t].unit != "m" || rows[t].observed_m.rows() == 0) continue;
    const VectorX& joint = fits.joint_rows(s)[t].residual;
    const Index components = rows[t].residual.size() / rows[t].observed_m.rows();
    for (Index i = 0; i < rows[t].residual.size(); ++i) {
      if (!std::isfinite(rows[t].residual(i)) || (rows[t].robust && !(std::abs(joint(i)) < fits.loss().tukey))) continue;
      out.sum_m2 += std::pow(rows[t].residual(i) * rows[t].sigma(i), 2);
      out.count += i % components == 0;
    }
  }
}

/// The object where its clamp holds it, with the rest surface as it is known, as if nothing had deformed it.
StepPrediction at_rest(const ForwardModel& model, std::size_t s, const VectorX& unknowns, const StepPrediction& predicted) {
  StepPrediction other = predicted;
  model.undeform(s, unknowns, other);
  return other;
}

StepPrediction with_surface(const StepPrediction& predicted, const Points& surface_m) {
  StepPrediction other = predicted;
  other.surface_m = surface_m;
  if (other.field != nullptr) other.material_m = surface_m;
  return other;
}

/// Where the surface stood before a step; of a push whose highest loads are left out, before all of them. Nothing: at rest.
const Points* surface_before(PartialFits& fits, std::size_t s, const StepFlags* left_out) {
  const ForwardModel& model = fits.model();
  for (std::size_t before = s; before > 0 && model.index(before - 1).push == model.index(s).push;) {
    --before;
    if (left_out != nullptr && (*left_out)[before] != 0) continue;
    if (fits.joint_prediction(before).surface_m.rows() == 0) break;
    return &fits.joint_prediction(before).surface_m;
  }
  return nullptr;
}

struct Sums {
  Distance predicted, undeformed, as_before, fitted;
  double force_error2 = 0;
  std::size_t forces = 0;

  void add_force(double relative_error2) {
    force_error2 += relative_error2;
    ++forces;
  }
};

/// Squares of what an imposed motion was predicted to ask for too much, and of what was read.
struct Reactions {
  double error2_n2 = 0, read2_n2 = 0;
};

void add_reactions(const Step& step, const StepPrediction& now, Reactions& out) {
  for (std::size_t l = 0; l < step.loads.size(); ++l) {
    const Load& load = step.loads[l];
    if (!load.travel_m) continue;
    for (const auto& observation : step.observations) {
      const auto* wrench = std::get_if<Wrench>(&observation);
      if (wrench == nullptr || wrench->force_n.norm() == 0 || (!wrench->tool.empty() && wrench->tool != load.tool)) continue;
      const Vec3 off_n = now.force_n[l] - wrench->force_n;
      out.error2_n2 += wrench->along.norm() > 0 ? std::pow(wrench->along.dot(off_n), 2) : off_n.squaredNorm();
      out.read2_n2 += wrench->force_n.squaredNorm();
    }
  }
}

bool is_force_driven(const Step& step) {
  return std::any_of(step.loads.begin(), step.loads.end(), [](const Load& load) { return load.force_n && load.force_n->norm() > 0; });
}

/// log E of the region that the first load of some steps presses.
double log_young_where(const ForwardModel& model, const StepFlags& some, const VectorX& unknowns) {
  int region = 0;
  for (std::size_t s = some.size(); s-- > 0;)
    if (some[s] != 0 && is_force_driven(model.step(s))) region = region_at(model.object(), model.step(s).loads.front().contact_m);
  return unknowns(log_young) + (region > 0 ? unknowns(first_ratio + region - 1) : 0);
}

/// And the unloaded steps of the same pushes.
StepFlags with_unloaded_steps(const ForwardModel& model, const StepFlags& some) {
  StepFlags out = some;
  for (std::size_t s = 0; s < some.size(); ++s) {
    for (std::size_t other = 0; other < some.size() && load_of(model.step(s)) == 0; ++other)
      out[s] = static_cast<char>(out[s] | (some[other] != 0 && model.index(other).push == model.index(s).push));
  }
  return out;
}

/// Of the mean squares of what was seen.
double explained(const Sums& sums) {
  constexpr double seen = 8;  // standard deviations by which the deformation stands out of the noise of as many points
  const double of_all_m2 = sums.undeformed.mean_m2() - sums.fitted.mean_m2();
  if (!(of_all_m2 * static_cast<double>(sums.fitted.count) > seen * seen * sums.fitted.mean_m2())) return HeldOut::unknown;
  return std::min(1.0, (sums.undeformed.mean_m2() - sums.predicted.mean_m2()) / of_all_m2);
}

}  // namespace

double load_of(const Step& step) {
  double sum = 0;
  for (const auto& load : step.loads) {
    sum += load.force_n ? load.force_n->norm() : 0;
    sum += load.travel_m ? std::abs(*load.travel_m) : 0;
  }
  return sum;
}

LeftOut whole_pushes(const PartialFits& fits, const std::vector<StepFlags>& pushes, std::size_t most) {
  LeftOut out;
  out.whole_pushes = true;
  out.what = pushes.size() <= most ? "each push in turn" : "each of the first " + std::to_string(most) + " pushes in turn";
  for (std::size_t p = 0; p < std::min(pushes.size(), most); ++p) {
    if (!any(loaded_steps(fits, pushes[p], as_good_as_none)) || !leaves_loads(fits, pushes, pushes[p])) continue;
    out.sets.push_back(pushes[p]);
    out.push.push_back(p);
  }
  return out;
}

LeftOut highest_loads(const PartialFits& fits, const std::vector<StepFlags>& pushes, std::size_t most) {
  LeftOut out;
  out.what = pushes.size() == 1 ? "the highest load" : "the highest load of each push in turn";
  for (std::size_t p = 0; p < std::min(pushes.size(), most); ++p) {
    StepFlags highest = loaded_steps(fits, pushes[p], nearly_highest);
    if (!any(highest) || !leaves_loads(fits, pushes, highest)) continue;
    out.sets.push_back(std::move(highest));
    out.push.push_back(p);
  }
  return out;
}

HeldOut hold_out(PartialFits& fits, const LeftOut& left_out, const std::vector<PartialYoung>& pushes, std::vector<Optimum>* learned) {
  ForwardModel& model = fits.model();
  HeldOut out;
  out.what = left_out.what;
  Sums sums;
  for (std::size_t k = 0; k < left_out.sets.size(); ++k) {
    const StepFlags& held = left_out.sets[k];
    StepFlags rest(held.size());
    for (std::size_t s = 0; s < held.size(); ++s) rest[s] = held[s] == 0;
    const Optimum others = fits.refit(rest, false);
    if (fits.cancelled() || !others.evaluation.usable) return out;
    if (learned != nullptr) learned->push_back(others);
    const StepFlags loaded = loaded_steps(fits, held, as_good_as_none);
    bool force_driven = false;
    Reactions reactions;
    for (std::size_t s = 0; s < held.size(); ++s) {
      if (loaded[s] == 0) continue;
      const StepPrediction now = model.predict(s, others.unknowns);
      if (!now.converged) return out;
      add_distance(fits, s, now, others.unknowns, sums.predicted);
      const StepPrediction still = at_rest(model, s, others.unknowns, now);
      const Points* before_m = surface_before(fits, s, left_out.whole_pushes ? nullptr : &held);
      add_distance(fits, s, still, others.unknowns, sums.undeformed);
      add_distance(fits, s, before_m != nullptr ? with_surface(now, *before_m) : still, others.unknowns, sums.as_before);
      add_distance(fits, s, fits.joint_prediction(s), fits.optimum().unknowns, sums.fitted);
      add_reactions(model.step(s), now, reactions);
      force_driven = force_driven || is_force_driven(model.step(s));
    }
    // Light steps, of which noise is a large share, weigh as they should.
    if (reactions.read2_n2 > 0) sums.add_force(reactions.error2_n2 / reactions.read2_n2);
    if (!force_driven) continue;
    // Statics depend on F / E: the force that would bend the object as seen is the measured one times E of the others over E
    // of this part alone, both at the others' nu and where it is pressed. What the push's unloaded steps say of pose and shape serves both.
    const bool known = left_out.whole_pushes && left_out.push[k] < pushes.size();
    fits.objective().hold_ratios(true);  // of regions: the part's E is the factor on all of them
    const PartialYoung young = known ? pushes[left_out.push[k]] : fits.young_of(with_unloaded_steps(model, held), "");
    fits.objective().hold_ratios(false);
    if (fits.cancelled()) return out;
    if (!young.usable) continue;
    const double there = log_young_where(model, held, others.unknowns), here = log_young_where(model, held, fits.optimum().unknowns);
    const double own = here + young.log_young - fits.optimum().unknowns(log_young) +
                       young.slope * (others.unknowns(poisson) - fits.optimum().unknowns(poisson));
    sums.add_force(std::pow(std::exp(there - own) - 1, 2));
  }
  out.available = sums.predicted.count > 0 || sums.forces > 0;
  out.surface_rms_m = sums.predicted.rms_m();
  out.baseline_no_deformation_rms_m = sums.undeformed.rms_m();
  out.baseline_last_step_rms_m = sums.as_before.rms_m();
  out.fitted_rms_m = sums.fitted.rms_m();
  out.force_error = sums.forces > 0 ? std::sqrt(sums.force_error2 / static_cast<double>(sums.forces)) : HeldOut::unknown;
  out.deformation_explained = explained(sums);
  return out;
}

}  // namespace palpate::estimation
