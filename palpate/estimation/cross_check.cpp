// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/cross_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "palpate/estimation/held_out.hpp"
#include "palpate/estimation/load_drift.hpp"

namespace palpate::estimation {
namespace {

constexpr std::size_t most_held_out = 6;    // pushes that are left out in turn
constexpr double nearby_m = 1e-3;           // contacts of tools without a radius that are one site

class CrossCheck {
 public:
  CrossCheck(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, double poisson_std, const OnProgress& progress)
      : poisson_std_(poisson_std), objective_(objective), model_(objective.model()), optimum_(optimum), loss_(loss), progress_(progress),
        fits_(objective, optimum, loss_, factor, progress) {}

  CrossChecks run() {
    CrossChecks out;
    if (progress_ && !progress_("cross-check", 0)) {
      out.cancelled = true;
      return out;
    }
    // A part of the data does not reach every region: its E is then the factor on all of them.
    const bool regions = objective_.unknowns().ratio_count() > 0;
    objective_.hold_ratios(true);
    std::vector<StepFlags> pushes;
    for (std::size_t s = 0; s < model_.step_count(); ++s) {
      const std::size_t p = model_.index(s).push;
      if (pushes.size() <= p) pushes.resize(p + 1, StepFlags(model_.step_count(), 0));
      pushes[p][s] = 1;
    }
    // Online, a push may have begun that has no step yet.
    std::erase_if(pushes, [](const StepFlags& steps) { return std::find(steps.begin(), steps.end(), 1) == steps.end(); });
    if (pushes.size() > 1) {
      for (std::size_t p = 0; p < pushes.size() && !fits_.cancelled(); ++p) out.pushes.push_back(fits_.young_of(pushes[p], name_of(pushes[p])));
      if (!fits_.cancelled()) out.chance_of_pushes = fits_.chance_of_one_young(out.pushes, poisson_std_);
    }
    if (!fits_.cancelled()) compare_sites(pushes, out);
    compare_levels(out);
    compare_ways(out);
    objective_.hold_ratios(false);
    if (!fits_.cancelled()) {
      // What no other push reaches cannot be predicted from them; one push is predicted from its own lower loads.
      const bool whole = pushes.size() > 1 && !regions;
      out.held_out = hold_out(fits_, whole ? whole_pushes(fits_, pushes, most_held_out) : highest_loads(fits_, pushes, most_held_out), out.pushes);
    }
    if (!fits_.cancelled()) objective_.evaluate(optimum_.unknowns, loss_);
    out.cancelled = fits_.cancelled();
    return out;
  }

 private:
  std::string name_of(const StepFlags& steps) const {
    return model_.push(static_cast<std::size_t>(std::find(steps.begin(), steps.end(), 1) - steps.begin())).name;
  }

  /// Pushes that name one site, or else touch within one patch of the first push there.
  void compare_sites(const std::vector<StepFlags>& pushes, CrossChecks& out) {
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
    for (std::size_t i = 0; i < sites.size() && !fits_.cancelled(); ++i) {
      const std::string name = sites[i].name.empty() ? "site " + std::to_string(i + 1) : sites[i].name;
      if (sites[i].pushes.size() == 1 && !out.pushes.empty()) {  // it has just been asked
        out.sites.push_back(out.pushes[sites[i].pushes.front()]);
        out.sites.back().name = name;
        continue;
      }
      StepFlags steps(model_.step_count(), 0);
      for (const std::size_t p : sites[i].pushes) {
        for (std::size_t s = 0; s < steps.size(); ++s) steps[s] = static_cast<char>(steps[s] | pushes[p][s]);
      }
      out.sites.push_back(fits_.young_of(steps, name));
    }
  }

  void compare_levels(CrossChecks& out) {
    StepFlags low(model_.step_count(), 0), high(model_.step_count(), 0);
    bool any_low = false, any_high = false;
    for (std::size_t first = 0; first < model_.step_count();) {
      std::size_t last = first;
      double largest = 0;
      while (last < model_.step_count() && model_.index(last).push == model_.index(first).push) {
        largest = std::max(largest, load_of(model_.step(last++)));
      }
      const auto is_between = [&](double least, double most) {
        for (std::size_t s = first; s < last; ++s)
          if (const double load = load_of(model_.step(s)); load > least && load <= most) return true;
        return false;
      };
      // A push of one level would make of two places two loads.
      const bool has_both = is_between(0, 0.55 * largest) && is_between(0.55 * largest, largest);
      for (std::size_t s = first; s < last && has_both; ++s) {
        const double load = load_of(model_.step(s));
        // What the unloaded frame says of pose and shape serves both.
        low[s] = load <= 0.55 * largest;
        high[s] = load == 0 || load > 0.55 * largest;
        any_low = any_low || (load > 0 && low[s] != 0);
        any_high = any_high || (load > 0 && high[s] != 0);
      }
      first = last;
    }
    if (!any_low || !any_high || fits_.cancelled()) return;
    out.low_loads = fits_.young_of(low, "low loads");
    if (!fits_.cancelled()) out.high_loads = fits_.young_of(high, "high loads");
    if (!fits_.cancelled()) out.chance_of_loads = fits_.chance_of_one_young({out.low_loads, out.high_loads}, poisson_std_);
    if (!fits_.cancelled() && drifts_with_load(out)) ask_quarters(low, high, out);
  }

  /// How E drifts.
  /// @param low, high  what was compared: pushes without levels are in neither
  void ask_quarters(const StepFlags& low, const StepFlags& high, CrossChecks& out) {
    std::array<StepFlags, 4> quarters;
    std::array<bool, 4> any{};
    quarters.fill(StepFlags(model_.step_count(), 0));
    for (std::size_t s = 0; s < model_.step_count(); ++s) {
      if (low[s] == 0 && high[s] == 0) continue;
      const double load = load_of(model_.step(s));
      double largest = 0;
      for (std::size_t other = 0; other < model_.step_count(); ++other)
        if (model_.index(other).push == model_.index(s).push) largest = std::max(largest, load_of(model_.step(other)));
      const std::size_t its = load > 0 ? static_cast<std::size_t>(std::ceil(4 * load / largest)) - 1 : 0;
      for (std::size_t q = 0; q < 4; ++q) quarters[q][s] = load == 0 || q == its;
      any[its] = any[its] || load > 0;
    }
    if (std::count(any.begin(), any.end(), true) < 3) return;
    constexpr std::array<const char*, 4> names{"quarter 1", "quarter 2", "quarter 3", "quarter 4"};
    for (std::size_t q = 0; q < 4 && !fits_.cancelled(); ++q) {
      if (!any[q]) continue;
      const PartialYoung quarter = fits_.young_of(quarters[q], names[q]);
      if (quarter.usable) out.quarters.push_back(quarter);
    }
  }

  /// The same places under the same loads, on the way in and on the way back: a push without a way back, or loads that the way back
  /// has none of, would make of another place or of a material that stiffens one that remembers.
  void compare_ways(CrossChecks& out) {
    constexpr double alike = 0.1;  // of the push's highest load: what is let go never stands exactly where it was pressed
    StepFlags forth(model_.step_count(), 0), back(model_.step_count(), 0);
    bool any = false;
    for (std::size_t first = 0, last = 0; first < model_.step_count(); first = last) {
      Range in, out_again;
      for (last = first; last < model_.step_count() && model_.index(last).push == model_.index(first).push; ++last)
        (model_.step(last).unloading ? out_again : in).take(load_of(model_.step(last)));
      const double margin = alike * std::max(in.most, out_again.most);
      const Range both{std::max(in.least, out_again.least) - margin, std::min(in.most, out_again.most) + margin};
      const auto has_both = [&](bool unloading) {
        for (std::size_t s = first; s < last; ++s)
          if (model_.step(s).unloading == unloading && both.holds(load_of(model_.step(s)))) return true;
        return false;
      };
      if (!has_both(false) || !has_both(true)) continue;
      any = true;
      for (std::size_t s = first; s < last; ++s) {
        const double load = load_of(model_.step(s));
        // What the unloaded frame says of pose and shape serves both.
        forth[s] = load == 0 || (!model_.step(s).unloading && both.holds(load));
        back[s] = load == 0 || (model_.step(s).unloading && both.holds(load));
      }
    }
    if (!any || fits_.cancelled()) return;
    out.loading = fits_.young_of(forth, "loading");
    if (!fits_.cancelled()) out.unloading = fits_.young_of(back, "unloading");
    if (!fits_.cancelled()) out.chance_of_ways = fits_.chance_of_one_young({out.loading, out.unloading}, poisson_std_);
  }

  /// Of loads; an unloaded step has none.
  struct Range {
    double least = std::numeric_limits<double>::infinity(), most = 0;
    void take(double load) {
      if (load > 0) least = std::min(least, load), most = std::max(most, load);
    }
    bool holds(double load) const { return load > 0 && load >= least && load <= most; }
  };

  double poisson_std_;
  Objective& objective_;
  ForwardModel& model_;
  const Optimum& optimum_;
  Loss loss_;
  const OnProgress& progress_;
  PartialFits fits_;
};

}  // namespace

CrossChecks cross_check(Objective& objective, const Optimum& optimum, const Loss& loss, double factor, double poisson_std,
                        const OnProgress& progress) {
  return CrossCheck(objective, optimum, loss, factor, poisson_std, progress).run();
}

}  // namespace palpate::estimation
