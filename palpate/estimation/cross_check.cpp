// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/cross_check.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace palpate::estimation {
namespace {

constexpr std::size_t most_held_out = 6;    // pushes that are left out in turn
constexpr double nearby_m = 1e-3;           // contacts of tools without a radius that are one site
constexpr double nearly = 0.1;              // of log E: one step from the joint optimum gets a part's own to a few per mille

OptimiseOptions few_iterations() {
  OptimiseOptions options;
  options.max_iterations = 10;
  options.step_tolerance = 0.02;
  return options;
}

double magnitude(const Step& step) {
  double sum = 0;
  for (const auto& load : step.loads) {
    sum += load.force_n ? load.force_n->norm() : 0;
    sum += load.travel_m ? std::abs(*load.travel_m) : 0;
  }
  return sum;
}

class CrossCheck {
 public:
  CrossCheck(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, const OnProgress& progress)
      : objective_(objective), model_(objective.model()), optimum_(optimum), loss_(loss), factor_(factor), progress_(progress) {
    joint_rows_ = objective.last_rows();
    joint_predictions_ = objective.last_predictions();
  }

  CrossChecks run() {
    CrossChecks out;
    if (progress_ && !progress_("cross-check", 0)) {
      out.cancelled = true;
      return out;
    }
    // A part of the data does not reach every region: its E is then the factor on all of them.
    const bool regions = objective_.unknowns().ratio_count() > 0;
    objective_.hold_ratios(true);
    std::vector<std::vector<char>> pushes;
    for (std::size_t s = 0; s < model_.step_count(); ++s) {
      const std::size_t p = model_.index(s).push;
      if (pushes.size() <= p) pushes.resize(p + 1, std::vector<char>(model_.step_count(), 0));
      pushes[p][s] = 1;
    }
    // Online, a push may have begun that has no step yet.
    std::erase_if(pushes, [](const std::vector<char>& steps) { return std::find(steps.begin(), steps.end(), 1) == steps.end(); });
    if (pushes.size() > 1) {
      for (std::size_t p = 0; p < pushes.size() && !cancelled_; ++p) out.pushes.push_back(young_of(pushes[p], name_of(pushes[p])));
    }
    if (!cancelled_) compare_sites(pushes, out);
    compare_levels(out);
    compare_ways(out);
    objective_.hold_ratios(false);
    if (!cancelled_) hold_out(pushes, regions, out);
    if (!cancelled_) objective_.evaluate(optimum_.unknowns, loss_);
    out.cancelled = cancelled_;
    return out;
  }

 private:
  std::string name_of(const std::vector<char>& steps) const {
    return model_.push(static_cast<std::size_t>(std::find(steps.begin(), steps.end(), 1) - steps.begin())).name;
  }

  /// Where the fit of some steps alone ends. One step of Gauss and Newton from the joint optimum needs no solution; where it
  /// leads far, the part is fitted for good.
  Optimum refit(const std::vector<char>& steps, bool hold_poisson) {
    Loss loss = loss_;
    loss.steps = steps;
    const bool was_fixed = objective_.unknowns()[poisson].fixed;
    hold_poisson = hold_poisson || was_fixed || optimum_.poisson_at_lower || optimum_.poisson_at_upper;
    objective_.hold_poisson(hold_poisson);
    const std::vector<int> moving = free_unknowns(objective_.unknowns());
    Optimum part;
    part.unknowns = optimum_.unknowns;
    part.evaluation = objective_.assemble(joint_rows_, optimum_.unknowns, loss);
    const VectorX move = MatrixX(part.evaluation.curvature(moving, moving)).ldlt().solve(-VectorX(part.evaluation.gradient(moving)));
    const Unknown& nu = objective_.unknowns()[poisson];
    for (std::size_t k = 0; k < moving.size(); ++k) part.unknowns(moving[k]) += move(static_cast<Index>(k));
    const bool inside = part.unknowns(poisson) >= nu.lower && part.unknowns(poisson) <= nu.upper;
    part.termination = Termination::converged;
    if (!move.allFinite() || std::abs(move(0)) > nearly || !inside) {
      const OnProgress keep_going = [&](std::string_view, double share) { return !progress_ || progress_("cross-check", share); };
      part = optimise(objective_, optimum_.unknowns, loss, few_iterations(), keep_going);
    }
    objective_.hold_poisson(was_fixed);
    cancelled_ = cancelled_ || part.termination == Termination::cancelled;
    return part;
  }

  PartialYoung young_of(const std::vector<char>& steps, const std::string& name) {
    PartialYoung out;
    out.name = name;
    const Optimum part = refit(steps, true);
    if (cancelled_ || !part.evaluation.usable || part.termination == Termination::failed) return out;
    const MatrixX information = part.evaluation.information(factor_);
    std::vector<int> others;
    for (int k : free_unknowns(objective_.unknowns())) {
      if (k != poisson) others.push_back(k);
    }
    const Eigen::LDLT<MatrixX> factorised(information(others, others));
    const VectorX unit = VectorX::Unit(static_cast<Index>(others.size()), 0);
    const double variance = factorised.solve(unit)(0);
    out.log_young = part.unknowns(log_young);
    out.std = std::sqrt(std::max(variance, 0.0));
    out.slope = -factorised.solve(VectorX(information.col(poisson)(others)))(0);
    // A part that says nothing about E leaves it where it was: no evidence either way.
    out.usable = std::isfinite(variance) && variance > 0 && out.std < 0.5;
    return out;
  }

  /// Pushes that name one site, or else touch within one patch of the first push there.
  void compare_sites(const std::vector<std::vector<char>>& pushes, CrossChecks& out) {
    struct Site {
      std::string name;
      const Load* load = nullptr;
      std::vector<std::size_t> pushes;
    };
    std::vector<Site> sites;
    const auto first_load = [](const Push& push) -> const Load* {
      for (const Step& step : push.steps) {
        if (!step.loads.empty()) return &step.loads.front();
      }
      return nullptr;
    };
    for (std::size_t p = 0; p < pushes.size(); ++p) {
      const Push& push = model_.push(static_cast<std::size_t>(std::find(pushes[p].begin(), pushes[p].end(), 1) - pushes[p].begin()));
      const Load* load = first_load(push);
      const auto same = std::find_if(sites.begin(), sites.end(), [&](const Site& site) {
        if (!push.site.empty() || !site.name.empty()) return push.site == site.name;
        if (load == nullptr || site.load == nullptr) return load == site.load;
        return load->tool == site.load->tool &&
               (load->contact_m - site.load->contact_m).norm() <= std::max(model_.tool(load->tool).radius_m, nearby_m);
      });
      if (same == sites.end()) {
        sites.push_back({push.site, load, {p}});
      } else {
        same->pushes.push_back(p);
      }
    }
    if (sites.size() < 2) return;
    for (std::size_t i = 0; i < sites.size() && !cancelled_; ++i) {
      const std::string name = sites[i].name.empty() ? "site " + std::to_string(i + 1) : sites[i].name;
      if (sites[i].pushes.size() == 1 && !out.pushes.empty()) {  // it has just been asked
        out.sites.push_back(out.pushes[sites[i].pushes.front()]);
        out.sites.back().name = name;
        continue;
      }
      std::vector<char> steps(model_.step_count(), 0);
      for (const std::size_t p : sites[i].pushes) {
        for (std::size_t s = 0; s < steps.size(); ++s) steps[s] = static_cast<char>(steps[s] | pushes[p][s]);
      }
      out.sites.push_back(young_of(steps, name));
    }
  }

  void compare_levels(CrossChecks& out) {
    std::vector<char> low(model_.step_count(), 0), high(model_.step_count(), 0);
    bool any_low = false, any_high = false;
    for (std::size_t first = 0; first < model_.step_count();) {
      std::size_t last = first;
      double largest = 0;
      while (last < model_.step_count() && model_.index(last).push == model_.index(first).push) {
        largest = std::max(largest, magnitude(model_.step(last++)));
      }
      for (std::size_t s = first; s < last; ++s) {
        const double load = magnitude(model_.step(s));
        // What the unloaded frame says of pose and shape serves both.
        low[s] = load <= 0.55 * largest;
        high[s] = load == 0 || load > 0.55 * largest;
        any_low = any_low || (load > 0 && low[s] != 0);
        any_high = any_high || (load > 0 && high[s] != 0);
      }
      first = last;
    }
    if (!any_low || !any_high || cancelled_) return;
    out.low_loads = young_of(low, "low loads");
    if (!cancelled_) out.high_loads = young_of(high, "high loads");
  }

  void compare_ways(CrossChecks& out) {
    std::vector<char> forth(model_.step_count(), 0), back(model_.step_count(), 0);
    bool any = false;
    for (std::size_t s = 0; s < model_.step_count(); ++s) {
      const bool unloaded = magnitude(model_.step(s)) == 0;
      const bool unloading = model_.step(s).unloading;
      any = any || (unloading && !unloaded);
      forth[s] = unloaded || !unloading;
      back[s] = unloaded || unloading;
    }
    if (!any || cancelled_) return;
    out.loading = young_of(forth, "loading");
    if (!cancelled_) out.unloading = young_of(back, "unloading");
  }

  /// Sum of squared distances of the points that the joint fit took for the object, and their number.
  struct Distance {
    double sum_m2 = 0;
    std::size_t count = 0;
    double rms() const { return count > 0 ? std::sqrt(sum_m2 / static_cast<double>(count)) : 0; }
  };
  void add_distance(std::size_t s, const StepPrediction& predicted, const VectorX& unknowns, Distance& out) const {
    Loss closest = loss_;
    closest.along_rays = false;
    const auto rows = objective_.rows_of(s, predicted, unknowns, closest);
    for (std::size_t t = 0; t < rows.size(); ++t) {
      if (rows[t].unit != "m" || rows[t].observed_m.rows() == 0) continue;
      const VectorX& joint = joint_rows_[s][t].residual;
      const Index components = rows[t].residual.size() / rows[t].observed_m.rows();
      for (Index i = 0; i < rows[t].residual.size(); ++i) {
        if (!std::isfinite(rows[t].residual(i)) || (rows[t].robust && !(std::abs(joint(i)) < loss_.tukey))) continue;
        out.sum_m2 += std::pow(rows[t].residual(i) * rows[t].sigma(i), 2);
        out.count += i % components == 0;
      }
    }
  }

  StepPrediction with_surface(const StepPrediction& predicted, const Points& surface_m) const {
    StepPrediction other = predicted;
    other.surface_m = surface_m;
    if (other.field != nullptr) other.material_m = surface_m;
    return other;
  }

  void hold_out(const std::vector<std::vector<char>>& pushes, bool regions, CrossChecks& out) {
    std::vector<std::vector<char>> left_out;
    if (regions) {  // what no other push reaches cannot be predicted from them
      for (std::size_t p = 0; p < std::min(pushes.size(), most_held_out); ++p) {
        std::size_t highest = model_.step_count();
        for (std::size_t s = 0; s < model_.step_count(); ++s) {
          if (pushes[p][s] == 0 || joint_rows_[s].empty()) continue;
          if (highest == model_.step_count() || magnitude(model_.step(s)) > magnitude(model_.step(highest))) highest = s;
        }
        if (highest == model_.step_count()) continue;
        left_out.emplace_back(model_.step_count(), 0);
        left_out.back()[highest] = 1;
      }
      out.held_out.what = "the highest load of each push in turn";
    } else if (pushes.size() > 1) {
      left_out.assign(pushes.begin(), pushes.begin() + static_cast<std::ptrdiff_t>(std::min(pushes.size(), most_held_out)));
      out.held_out.what = pushes.size() <= most_held_out ? "each push in turn"
                                                         : "each of the first " + std::to_string(most_held_out) + " pushes in turn";
    } else if (model_.step_count() > 2) {
      left_out.assign(1, std::vector<char>(model_.step_count(), 0));
      left_out[0].back() = 1;
      out.held_out.what = "last step";
    }
    Distance predicted, undeformed, as_before;
    double force_error2 = 0;
    std::size_t forces = 0;
    for (const auto& held : left_out) {
      std::vector<char> rest(held.size());
      for (std::size_t s = 0; s < held.size(); ++s) rest[s] = held[s] == 0;
      const Optimum others = refit(rest, false);
      if (cancelled_ || !others.evaluation.usable) return;
      bool force_driven = false;
      for (std::size_t s = 0; s < held.size(); ++s) {
        if (held[s] == 0 || joint_rows_[s].empty()) continue;
        const StepPrediction now = model_.predict(s, others.unknowns);
        if (!now.converged) return;
        add_distance(s, now, others.unknowns, predicted);
        add_distance(s, with_surface(now, model_.object().surface.rest().vertices_m), others.unknowns, undeformed);
        const bool first = s == 0 || model_.index(s - 1).push != model_.index(s).push || joint_predictions_[s - 1].surface_m.rows() == 0;
        add_distance(s, with_surface(now, first ? model_.object().surface.rest().vertices_m : joint_predictions_[s - 1].surface_m),
                     others.unknowns, as_before);
        for (std::size_t l = 0; l < model_.step(s).loads.size(); ++l) {
          const Load& load = model_.step(s).loads[l];
          force_driven = force_driven || (load.force_n && load.force_n->norm() > 0);
          if (!load.travel_m) continue;
          for (const auto& observation : model_.step(s).observations) {
            const auto* wrench = std::get_if<Wrench>(&observation);
            if (wrench == nullptr || wrench->force_n.norm() == 0 || (!wrench->tool.empty() && wrench->tool != load.tool)) continue;
            force_error2 += (now.force_n[l] - wrench->force_n).squaredNorm() / wrench->force_n.squaredNorm();
            ++forces;
          }
        }
      }
      // Statics depend on F / E: the force that would bend the object as seen is the measured one times E of the others over E
      // of this part alone.
      if (force_driven) {
        const bool known = !out.pushes.empty() && !regions;
        if (regions) objective_.hold_ratios(true);
        const PartialYoung alone = known ? out.pushes[static_cast<std::size_t>(&held - left_out.data())] : young_of(held, "");
        if (regions) objective_.hold_ratios(false);
        if (cancelled_) return;
        if (alone.usable) {
          force_error2 += std::pow(std::exp(others.unknowns(log_young) - alone.log_young) - 1, 2);
          ++forces;
        }
      }
    }
    out.held_out.available = predicted.count > 0 || forces > 0;
    out.held_out.surface_rms_m = predicted.rms();
    out.held_out.baseline_no_deformation_rms_m = undeformed.rms();
    out.held_out.baseline_last_step_rms_m = as_before.rms();
    out.held_out.force_error = forces > 0 ? std::sqrt(force_error2 / static_cast<double>(forces)) : StepFit::unknown;
  }

  Objective& objective_;
  ForwardModel& model_;
  const Optimum& optimum_;
  Loss loss_;
  double factor_;
  const OnProgress& progress_;
  std::vector<std::vector<TermRows>> joint_rows_;
  std::vector<StepPrediction> joint_predictions_;
  bool cancelled_ = false;
};

}  // namespace

CrossChecks cross_check(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, const OnProgress& progress) {
  return CrossCheck(objective, optimum, loss, factor, progress).run();
}

double homogeneity_p_value(const std::vector<PartialYoung>& parts, double poisson_std) {
  double weight_sum = 0, slope = 0;
  int count = 0;
  for (const auto& part : parts) {
    if (!part.usable) continue;
    const double weight = 1 / (part.std * part.std + contact_model_std * contact_model_std);
    weight_sum += weight;
    slope += weight * part.slope;
    ++count;
  }
  if (count < 2) return 1;
  slope /= weight_sum;
  double sum = 0, mean = 0, squares = 0;
  for (const auto& part : parts) {
    if (!part.usable) continue;
    const double by_poisson = (part.slope - slope) * poisson_std;
    const double weight = 1 / (part.std * part.std + contact_model_std * contact_model_std + by_poisson * by_poisson);
    sum += weight;
    mean += weight * part.log_young;
    squares += weight * part.log_young * part.log_young;
  }
  return chi_square_tail(std::max(0.0, squares - mean * mean / sum), count - 1);
}

double chi_square_tail(double value, int degrees_of_freedom) {
  if (!(value > 0)) return 1;
  // Regularised incomplete gamma function Q(k/2, x/2): recurrence upwards from k = 1 or 2 (Abramowitz and Stegun 26.4.6-7).
  const double half = 0.5 * value;
  const bool odd = degrees_of_freedom % 2 == 1;
  double tail = odd ? std::erfc(std::sqrt(half)) : std::exp(-half);
  double term = odd ? 2 * std::sqrt(half / EIGEN_PI) * std::exp(-half) : half * std::exp(-half);
  for (int k = odd ? 3 : 4; k <= degrees_of_freedom; k += 2) {
    tail += term;
    term *= half / (0.5 * k);
  }
  return std::min(tail, 1.0);
}

}  // namespace palpate::estimation
