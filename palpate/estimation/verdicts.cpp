// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/verdicts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "palpate/core/quantity.hpp"
#include "palpate/estimation/deep_loads.hpp"
#include "palpate/estimation/law_comparison.hpp"
#include "palpate/estimation/load_drift.hpp"
#include "palpate/estimation/step_checks.hpp"

namespace palpate::estimation {
namespace {

constexpr double least_slip_m = 5e-4;      // less is within what a contact point means
constexpr double least_settling = 0.01;    // of E
constexpr double pattern_deviate = 4.3;    // one recording in a hundred thousand
constexpr double pattern_inflation = 1.3;  // of the variance of cell means
constexpr double softest_pa = 1;           // of gels that just keep their shape; both lie inside the ends of the search
constexpr double stiffest_pa = 1.15e12;    // of diamond

std::string number(double value, const char* format = "{:.3g}") { return fmt::format(fmt::runtime(format), value); }

void judge_end(const VerdictInput& in, std::vector<Verdict>& out) {
  if (in.optimum.termination == Termination::converged) return;
  out.push_back({"not_converged", "The fit did not converge (" + in.optimum.message +
                                      "): do not use the numbers. Check the loads, the supports and the material, or give "
                                      "the start of E that you expect."});
}

void judge_young(const VerdictInput& in, std::vector<Verdict>& out) {
  for (const auto& parameter : in.answer.parameters) {
    if (parameter.name != "young_modulus" || parameter.determined) continue;
    const double factor = parameter.upper_95 / parameter.lower_95;
    constexpr double all_solids = 1e12;
    out.push_back({"e_not_determined",
                   std::string("These data ") + (factor > all_solids ? "say nothing of" : "hardly determine") + " Young's modulus" +
                       (parameter.region.empty() ? "" : " of region '" + parameter.region + "' (does a push reach it?)") +
                       ": its interval " +
                       (factor > all_solids ? std::string("is all that is searched") : "spans a factor of " + number(factor, "{:.2g}")) +
                       ". A motion without its force, or a force without a visible deformation, cannot: press harder, and "
                       "record both."});
  }
}

/// What no solid has is a unit gone wrong, or a motion that had nothing to do with the force.
void judge_young_bound(const VerdictInput& in, std::vector<Verdict>& out) {
  for (const auto& parameter : in.answer.parameters) {
    const bool soft = parameter.value < softest_pa;
    if (parameter.name != "young_modulus" || (!soft && parameter.value < stiffest_pa)) continue;
    out.push_back({"young_modulus_at_bound",
                   "Young's modulus" + (parameter.region.empty() ? "" : " of region '" + parameter.region + "'") + " ran away to " +
                       quantity(parameter.value, "Pa") + ", where no solid is (" +
                       (soft ? "the softest gels have about 1 Pa" : "diamond has 1.1e12 Pa") +
                       "). A unit is probably wrong: forces are in newton (" +
                       (soft ? "kilonewtons make E a thousand times too small" : "millinewtons make E a thousand times too large") +
                       ") and lengths in metres (" +
                       (soft ? "millimetres make it a million times too small). Or what moved was not pressed: check the loads."
                             : "kilometres make it a million times too large). Or what was pressed did not move: check that the "
                               "surface is seen where it gives way.")});
  }
}

void judge_poisson(const VerdictInput& in, std::vector<Verdict>& out) {
  const Unknown& nu = in.objective.unknowns()[poisson];
  if (nu.fixed) return;
  bool determined = true;
  for (const auto& parameter : in.answer.parameters) {
    if (parameter.name == "poisson_ratio" && !parameter.determined) {
      determined = false;
      out.push_back({"nu_not_determined",
                     "These pushes hardly determine the Poisson ratio" + (parameter.region.empty() ? "" : " of region '" + parameter.region + "'") +
                         ": its interval [" + number(parameter.lower_95) + ", " +
                         number(parameter.upper_95) +
                         "] is mostly the prior's. Push where the object can bulge sideways in view, or deeper, or from a "
                         "second side, or fix nu (`--poisson-ratio`) if it is known; `palpate suggest --for poisson-ratio` ranks "
                         "pushes by how much they would narrow it."});
    }
  }
  std::optional<double> end;
  std::string of_region;
  if (in.optimum.poisson_at_lower || in.optimum.poisson_at_upper) end = in.optimum.poisson_at_lower ? nu.lower : nu.upper;
  const Unknowns& unknowns = in.objective.unknowns();
  for (int k = unknowns.first_own_poisson(); k < unknowns.parameter_count() && !end; ++k) {
    const double own = in.optimum.unknowns(k);
    if (own > unknowns[k].lower && own < unknowns[k].upper) continue;
    end = own;
    of_region = " of region '" + in.objective.model().object().region_names.at(static_cast<std::size_t>(1 + k - unknowns.first_own_poisson())) + "'";
  }
  if (determined && end) {
    out.push_back({"nu_at_bound", "The best Poisson ratio" + of_region + " lies at the end of its allowed range (" + number(*end, "{:.4g}") +
                                      "). If the material is not known to be like that, the model or the supports are "
                                      "likely wrong."});
  }
}

/// "residuals of travels are 5.1, of torques 3", where chance has such squares once in ten thousand fits at most: the chi-square
/// quantile by Wilson and Hilferty (1931), of as many degrees of freedom as there are readings. Three standard deviations at least: what
/// the mesh does to a travel is taken out of E and not of the residuals.
std::string readings_that_do_not_fit(const ResidualSummary& residuals) {
  constexpr double once_in_ten_thousand = 3.72, least = 3;
  std::string out;
  for (const auto& [what, readings] : {std::pair("travels", residuals.travels), std::pair("forces", residuals.forces),
                                       std::pair("torques", residuals.torques), std::pair("markers", residuals.markers)}) {
    if (readings.rows == 0) continue;
    const double rows = static_cast<double>(readings.rows), spread = 2 / (9 * rows), mean_square = readings.chi2 / rows;
    if (!(mean_square > std::max(least * least, std::pow(1 - spread + once_in_ten_thousand * std::sqrt(spread), 3)))) continue;
    out += (out.empty() ? "residuals of " : ", of ") + std::string(what) + (out.empty() ? " are " : " ") + number(std::sqrt(mean_square), "{:.2g}");
  }
  return out;
}

void judge_fit(const VerdictInput& in, std::vector<Verdict>& out) {
  const auto& r = in.residuals;
  const double outlier_share = r.points > 0 ? static_cast<double>(r.outliers) / static_cast<double>(r.points) : 0;
  const double rows = static_cast<double>(r.rows) / r.variance_inflation;
  const double limit = 1.5 + 4 * std::sqrt(2 / std::max(rows, 1.0));
  const std::string apart = readings_that_do_not_fit(r);
  if (in.answer.fit.chi2_per_dof <= limit && !apart.empty()) {
    out.push_back({"model_does_not_fit",
                   "The model does not fit all that was measured: " + apart +
                       " times what their standard deviations allow, which the many points of the surface outweigh. Check what "
                       "these readings mean (sign, unit, where travel begins, which tool), their sigma, and what is told of the tool (its "
                       "compliance, its radius)."});
  }
  if (in.answer.fit.chi2_per_dof > limit) {
    out.push_back({"model_does_not_fit",
                   "The model does not fit: residuals are " + number(std::sqrt(in.answer.fit.chi2_per_dof), "{:.2g}") +
                       " times what the sensors' standard deviations allow (chi2 per degree of freedom " +
                       number(in.answer.fit.chi2_per_dof) +
                       "). The intervals hold only for a model that fits. Check supports and their pose, the rest shape and "
                       "the sensors' sigma."});
  }
  if (outlier_share > 0.15) {
    out.push_back({"many_outliers", number(100 * outlier_share, "{:.0f}") +
                                        " % of the observed points lie off the simulated surface by more than the noise "
                                        "explains and were left out. Mask what is not the object (arm, table), or check "
                                        "the rest shape."});
  }
  const double dof = rows - static_cast<double>(in.answer.parameters.size());
  if (dof < 5) {
    out.push_back({"too_few_points", "Only " + std::to_string(r.rows) +
                                         " measured numbers: the fit cannot be tested against them. Record more steps or "
                                         "points."});
  }
}

/// One verdict for all of them: the farthest in full, others by name.
/// Of very many some are far off by chance: beyond three standard deviations, and farther than any of them is once in twenty times.
void judge_nuisances(const VerdictInput& in, std::vector<Verdict>& out) {
  constexpr double by_chance = 0.05;
  double farthest_pull = 0;
  for (const auto& nuisance : in.answer.nuisances) farthest_pull = std::max(farthest_pull, std::abs(nuisance.pull));
  if (static_cast<double>(in.answer.nuisances.size()) * std::erfc(farthest_pull / std::numbers::sqrt2) > by_chance) return;
  std::vector<const Nuisance*> beyond;
  for (const auto& nuisance : in.answer.nuisances)
    if (std::abs(nuisance.pull) > 3) beyond.push_back(&nuisance);
  if (beyond.empty()) return;
  std::stable_sort(beyond.begin(), beyond.end(), [](auto* a, auto* b) { return std::abs(a->pull) > std::abs(b->pull); });
  constexpr std::size_t most_named = 4;
  std::string others;
  for (std::size_t k = 1; k < std::min(beyond.size(), most_named); ++k) others += (k > 1 ? ", " : "") + beyond[k]->name;
  if (beyond.size() > most_named) others += " and " + std::to_string(beyond.size() - most_named) + " more";
  const Nuisance& farthest = *beyond.front();
  out.push_back({"nuisance_beyond_prior",
                 farthest.name + " ended at " + number(farthest.value) + " " + farthest.unit + ", " +
                     number(std::abs(farthest.pull), "{:.1f}") +
                     " standard deviations of its prior away from what was expected (prior " + number(farthest.prior_std) + " " +
                     farthest.unit + ")" + (others.empty() ? "" : "; beyond three of theirs: " + others) +
                     ". Something that the model takes for small is not: check it before believing E."});
}

void judge_state(const VerdictInput& in, std::vector<Verdict>& out) {
  int inverted = 0;  // of the step that has most of them
  const auto& predictions = in.objective.last_predictions();
  for (std::size_t s = 0; s < predictions.size(); ++s) {
    const int known = predictions[s].inverted_elements;
    inverted = std::max(inverted, known >= 0 ? known : in.objective.model().inverted_elements(s, in.optimum.unknowns));
  }
  if (inverted > 0 && in.answer.material == "linear") {
    out.push_back({"beyond_small_strain",
                   "In the hardest step " + std::to_string(inverted) +
                       " elements are strained beyond what small-strain elasticity can describe. Unless the object is known "
                       "to be linear, fit neo_hookean, or use smaller forces."});
  } else if (inverted > 0) {
    out.push_back({"inverted_elements", std::to_string(inverted) +
                                            " elements of the simulation are turned inside out: the load is beyond what "
                                            "this material model describes. Use neo_hookean, or smaller forces."});
  }
  if (in.recording.rest.state == RestState::under_pressure) {
    out.push_back({"apparent_modulus_only",
                   "The object is inflated: a solid model gives an apparent modulus that depends on pressure and tool, not "
                   "the elasticity of its skin."});
  }
}

/// What other laws make of an E that drifts with the load.
std::string better_law(const Identification& answer) {
  const LawFit* best = best_law(answer.laws, answer.material);
  if (best == nullptr) return "try another law (foam softens; `palpate estimate --compare-laws` fits them all, which takes its time on this mesh)";
  std::string others;
  for (const LawFit& each : answer.laws)
    if (each.law != answer.material && each.usable) others += (others.empty() ? "`" : ", `") + each.law + "`";
  if (others.empty()) return "no other law could be fitted to these data";
  if (best->law == answer.material) return "of the laws " + others + " none predicts the highest loads better from the lower ones";
  return "of the laws that were fitted to the same data (`" + answer.material + "`, " + others + ") `" + best->law +
         "` predicts the highest loads best from the lower ones, with E " + quantity(best->young_modulus_pa, "Pa") + " and nu " +
         number(best->poisson_ratio, "{:.2g}") + ": estimate with `--material " + best->law + "`";
}

std::string tangents(const VerdictInput& in) {
  std::string list;
  for (const TangentModulus& one : tangent_moduli(in.checks, in.objective.model(), in.answer.steps)) {
    list += (list.empty() ? " Tangent modulus by strain (travel over the object's extent along the push): " : ", ") + quantity(one.young_pa, "Pa") +
            " to " + number(100 * one.to_strain, "{:.2g}") + " %";
  }
  return list.empty() ? list : list + ".";
}

void judge_parts(const VerdictInput& in, std::vector<Verdict>& out) {
  const bool regions = in.objective.unknowns().ratio_count() > 0, pushes_differ = in.checks.chance_of_pushes < rare;
  if (regions && pushes_differ) {
    out.push_back({"not_homogeneous",
                   "The pushes disagree even with a stiffness for each region: a region is not the same everywhere, its border "
                   "lies elsewhere, or a contact point or support is wrong."});
  } else if (in.doubts.sites && in.doubts.sites->p_value < rare) {
    std::string around;
    for (std::size_t s = 0; s < in.doubts.sites->sites.size(); ++s)
      around += (s > 0 ? ", " : "") + quantity(std::exp(in.doubts.sites->log_young(static_cast<Index>(s))), "Pa") + " around " +
                in.doubts.sites->sites[s];
    out.push_back({"not_homogeneous",
                   "One E does not explain all places that were pushed: the residuals ask for about " + around +
                       ". The object is not the same everywhere (fit each part its own E: give the regions, or `--regions by-site`), or a "
                       "contact point or support is wrong."});
  } else if (pushes_differ) {
    const PartialYoung *softest = nullptr, *stiffest = nullptr;
    for (const auto& part : in.checks.pushes) {
      if (!part.usable) continue;
      if (softest == nullptr || part.log_young < softest->log_young) softest = &part;
      if (stiffest == nullptr || part.log_young > stiffest->log_young) stiffest = &part;
    }
    const auto at = [](const PartialYoung& part) { return quantity(std::exp(part.log_young), "Pa") + " (" + part.name + ")"; };
    out.push_back({"not_homogeneous",
                   std::string("The pushes do not agree on one E") +
                       (softest != stiffest ? ": from " + at(*softest) + " to " + at(*stiffest) + ", more than noise allows" : "") +
                       ". The object is not the same everywhere, or a contact point or support is wrong; look at E by push."});
  }
  const auto ratio = [](const PartialYoung& a, const PartialYoung& b) { return number(std::exp(a.log_young - b.log_young)); };
  if (drifts_with_load(in.checks)) {
    const bool softens = in.checks.high_loads.log_young < in.checks.low_loads.log_young;
    out.push_back({"not_linear",
                   "E drifts with the load: the higher half of the loads gives " + ratio(in.checks.high_loads, in.checks.low_loads) +
                       " times the E of the lower half, so the material " + (softens ? "softens" : "stiffens") +
                       " beyond what the law `" + in.answer.material +
                       "` describes." + tangents(in) + " For small strains believe the lower loads; " + better_law(in.answer) + "."});
  }
  if (in.checks.loading.usable && in.checks.unloading.usable && in.checks.chance_of_ways < rare) {
    out.push_back({"hysteresis", "Unloading gives " + ratio(in.checks.unloading, in.checks.loading) +
                                     " times the E of loading: the object creeps, or the tool slipped. Wait longer at each "
                                     "step, or press more slowly."});
  }
}

/// What is stated as exactly known, where the residuals ask for something else and it would matter for E or nu. The
/// likeliest one is said: they explain the same residuals, and all of them would be too many.
void judge_doubts(const VerdictInput& in, bool slipped, std::vector<Verdict>& out) {
  constexpr double least_share = 0.1;  // of a tool's radius: less is within what a patch of even pressure means
  constexpr double matters = 0.5;      // standard deviations of E or nu
  std::vector<const Parameter*> young;
  std::optional<double> poisson_std;  // of the first region's nu, which a doubt speaks of
  for (const auto& parameter : in.answer.parameters) {
    if (parameter.name == "young_modulus") young.push_back(&parameter);
    if (parameter.name == "poisson_ratio" && !poisson_std) poisson_std = parameter.std;
  }
  for (const Doubt& doubt : in.doubts.all) {
    if (doubt.p_value >= very_rare || (slipped && doubt.about == Doubt::About::contact)) continue;
    // Of the regions the one whose E would change most, in what it is known to.
    double most = 0, log_young = 0;
    std::string of_region;
    for (std::size_t r = 0; r < std::min(young.size(), static_cast<std::size_t>(doubt.log_young.size())); ++r) {
      const double change = doubt.log_young(static_cast<Index>(r)), in_std = std::abs(change) * young[r]->value / young[r]->std;
      if (!(in_std > most)) continue;
      most = in_std, log_young = change;
      if (young.size() > 1) of_region = " of region '" + young[r]->region + "'";
    }
    if (most <= matters && std::abs(doubt.poisson) <= matters * poisson_std.value_or(0)) continue;
    const bool of_foot = doubt.about == Doubt::About::support || doubt.about == Doubt::About::support_compliance;
    if (doubt.about == Doubt::About::support_compliance && doubt.scale_m + doubt.size_m < 0) continue;  // nothing comes towards a push
    if (!of_foot && std::abs(doubt.size_m) < least_share * doubt.scale_m) continue;
    const std::string size = number(1e3 * std::abs(doubt.size_m), "{:.2g}") + " mm";
    // One linear step says how far off the answer is only where that is not far.
    const bool near = std::abs(log_young) < 0.5 && std::abs(doubt.poisson) < 0.25;
    const std::string change = near ? "; E" + of_region + " would then be " + number(100 * std::expm1(log_young), "{:+.2g}") +
                                          " %, and nu " + number(doubt.poisson, "{:+.2g}") + ", from here"
                                    : "; E and nu would then be quite different";
    switch (doubt.about) {
      case Doubt::About::contact:
        out.push_back({"contact_elsewhere", "The residuals ask for a contact " + size +
                                                " aside of the stated one in push '" + doubt.name + "'" + change +
                                                ". Check contact_m and the hand-eye calibration, or let the fit find it: "
                                                "give contact_std_m."});
        return;
      case Doubt::About::tool_radius:
        out.push_back({"tool_radius_doubtful", "The residuals ask for a patch under tool '" + doubt.name +
                                                   "' whose radius is " + size +
                                                   (doubt.size_m > 0 ? " larger" : " smaller") + " than stated (" +
                                                   number(1e3 * doubt.scale_m, "{:.2g}") + " mm)" + change +
                                                   ". Check radius_m, or let the fit find it: give radius_std_m."});
        return;
      case Doubt::About::support:
        out.push_back({"boundary_suspected",
                       "The residuals ask for a foot that gives way: the rim of support '" + doubt.name + "' moves by " +
                           size + (doubt.size_m > 0 ? " outwards" : " inwards") + " under the highest load" + change +
                           ". If it is not glued, say how it lies (kind: table, contact: friction or "
                           "frictionless), or give spread_std_m."});
        return;
      case Doubt::About::support_compliance:
        out.push_back({"support_gives_way",
                       "The residuals ask for a support that gives way as a whole: '" + doubt.name + "' by " + size +
                           " a newton" + (doubt.size_m > 0 ? " more" : " less") + " than stated, the object with it" + change +
                           ". Fix it, or measure how far it gives way where you press on it and give compliance_m_per_n; or let "
                           "the fit find it: give compliance_std_m_per_n (of the support)."});
        return;
    }
  }
}

bool young_is_determined(const Identification& answer, int region) {
  for (const auto& parameter : answer.parameters)
    if (parameter.name == "young_modulus" && region-- == 0) return parameter.determined;
  return false;
}

void judge_steps(const VerdictInput& in, std::vector<Verdict>& out) {
  const ForwardModel& model = in.objective.model();
  const double factor = in.residuals.points > 0 ? tukey_information_factor(in.optimum.loss.tukey) : 1;
  const auto where = [&](std::size_t s) { return "step " + std::to_string(model.index(s).step) + " of push '" + model.push(s).name + "'"; };
  const auto millimetres = [](double metres) { return number(1e3 * metres, "{:.2g}") + " mm"; };
  const auto moved = object_motion(in.objective, in.optimum);
  if (moved && moved->p_value < very_rare) {
    out.push_back({"object_moved", "From " + where(moved->step) + " on the frames stand " + millimetres(moved->size) +
                                       " from where they stood before, more than their pose's prior allows: the object or the "
                                       "camera was moved. Fix them better, or leave out the steps from there on."});
  }
  // Where contacts are stated as exactly known they were asked together with those that may shift: once, so that the chance is right.
  const auto slip = in.doubts.slip ? in.doubts.slip : contact_slip(in.objective, in.optimum, factor);
  const bool slipped = in.answer.slip || (slip && slip->p_value < very_rare);
  if (in.answer.slip) {
    const Slip& slid = *in.answer.slip;
    out.push_back({"contact_slipped", "The tool seems to have slipped by " + millimetres(slid.across_m) + " across and " + millimetres(slid.deeper_m) +
                                          " deeper at step " + std::to_string(slid.step) + " of push '" + in.recording.pushes[slid.push].name +
                                          "': the steps from there on ask for another contact point and another zero of the travel than "
                                          "those before. Leave them out, or push along the surface's normal."});
  } else if (slipped && slip->size > least_slip_m) {
    out.push_back({"contact_slipped", "The tool seems to have slipped by " + millimetres(slip->size) + " at " + where(slip->step) +
                                          ": the steps from there on ask for another contact point than those before. Leave "
                                          "them out, or push along the surface's normal."});
  }
  judge_doubts(in, slipped, out);  // a slip looks like a contact elsewhere
  const auto settled = settling(in.objective, in.optimum, factor);
  if (settled && settled->p_value < very_rare && settled->size > least_settling) {
    const auto& loads = model.step(settled->step).loads;
    const bool moved_only = std::none_of(loads.begin(), loads.end(), [](const Load& load) { return load.force_n.has_value(); });
    out.push_back({"not_settled", (moved_only ? "While the tool stayed where it was up to " + where(settled->step) + ", the force went on falling"
                                              : "While the load stayed the same up to " + where(settled->step) + ", the object went on giving way") +
                                      ": E fell by " +
                                      number(100 * settled->size, "{:.2g}") + " %. Wait longer at each step, until it stands still."});
  }
  const Pattern pattern = residual_pattern(in.objective, in.optimum.loss);
  if (pattern.deviate > pattern_deviate && pattern.inflation > pattern_inflation) {
    out.push_back({"residual_pattern",
                   "Residuals of neighbouring points agree: means over small cells scatter " + number(std::sqrt(pattern.inflation), "{:.2g}") +
                       " times more than independent errors would. The intervals are widened for it, but look at the residual map: "
                       "where it follows the object's shape, the rest shape, a support or the material is not as modelled."});
  }
  const PatchPressure pressure = highest_pressure(in.objective, in.optimum);
  if (pressure.over_young > largest_pressure && young_is_determined(in.answer, pressure.region)) {
    out.push_back({"pressure_beyond_model", "At " + where(pressure.step) + " the mean pressure under the tool is " +
                                                number(pressure.over_young, "{:.2g}") +
                                                " times E: a patch of even pressure is then no picture of how the tool touches. Believe "
                                                "lower loads, or use a larger tool."});
  }
}

/// What is stated of a tool and cannot be heard: in silence it would be taken for part of the interval.
void judge_unheard(const VerdictInput& in, std::vector<Verdict>& out) {
  const auto driven = [&](const Tool& tool, const auto& states) {
    bool any = false, forced = false;
    for (const auto& push : in.recording.pushes) {
      for (const auto& step : push.steps) {
        for (const auto& load : step.loads) {
          if (load.tool != tool.name) continue;
          any = any || (load.travel_m && states(load));
          forced = forced || load.force_n;
        }
      }
    }
    return any && !forced;
  };
  const auto say = [&](const Tool& tool, const std::string& field, const std::string& cure) {
    out.push_back({"not_in_interval", "`" + field + "` of tool '" + tool.name + "' is not in the interval: its motion is imposed, and " + cure});
  };
  for (const Tool& tool : in.recording.tools) {
    if (tool.radius_std_m > 0 && driven(tool, [](const Load&) { return true; }))
      say(tool, "radius_std_m",
          "a tool that touches as a rigid body has exactly the shape that is stated. Estimate again with `radius_m` larger by it: that is what "
          "it does to E and nu.");
    if (tool.shape == ToolShape::platen && driven(tool, [](const Load& load) { return load.contact_std_m > 0; }))
      say(tool, "contact_std_m", "a platen has no contact point. Where its face begins is `travel_offset_std_m` of the push.");
  }
}

void judge_equilibrium(const VerdictInput& in, std::vector<Verdict>& out) {
  if (!in.certificate || !in.certificate->second_equilibrium) return;
  out.push_back({"two_equilibria",
                 "Under the highest load the simulated object has more than one equilibrium (it buckles, or caves in under the tool), and "
                 "which of them the real one took is not known. Believe lower loads, or use a larger tool."});
}

}  // namespace

std::optional<Verdict> several_minima(const Starts& starts) {
  const std::vector<Minimum> others = hardly_told_apart(starts);
  if (others.empty()) return std::nullopt;
  const auto words = [](const Minimum& at) {
    return "E " + quantity(std::exp(at.log_young), "Pa") + " with nu " + number(at.poisson, "{:.3f}");
  };
  std::string also;
  for (const Minimum& other : others) also += (also.empty() ? "" : ", ") + words(other);
  return Verdict{"several_minima", "The data fit in more than one place: the answer is " + words(starts.minima.front()) + ", but " + also +
                                       " is as likely within the noise, and the interval holds only the first. Say which it is by "
                                       "`--young-modulus-start`, or press otherwise (other loads, another place) so that they part."};
}

std::optional<Verdict> nu_not_explored(const Posterior& posterior) {
  if (!posterior.unsolved_below && !posterior.unsolved_above) return std::nullopt;
  std::string where;
  if (posterior.unsolved_below) where = number(*posterior.unsolved_below, "{:.3f}") + " and below";
  if (posterior.unsolved_above) where += (where.empty() ? "" : ", nor at ") + number(*posterior.unsolved_above, "{:.3f}") + " and above";
  return Verdict{"nu_not_explored", "No equilibrium of the object under these loads was found with a Poisson ratio of " + where +
                                        ", though the data do not exclude it: the intervals of E and nu know nothing of what lies there, or are continued there unseen. Press "
                                        "less deep, or say what nu may be (`--poisson-range`)."};
}

Verdict partly_seen(const ShapeDoubt& doubt) {
  const std::optional<ShapeEffect>& effect = doubt.effect;
  std::string said = number(100 * doubt.unseen_share, "{:.0f}") + " % of the object's surface was not seen, and is a guess. ";
  said += effect ? "Between the shapes that may stand there E goes from " + quantity(effect->softest_pa, "Pa") + " to " +
                       quantity(effect->stiffest_pa, "Pa") + "; the interval counts that as its part `unseen side` of the budget. "
                 : "What that does to E could not be found out: the interval does not hold it. ";
  return {"partly_seen", said + "A view from another side makes it smaller."};
}

std::vector<Verdict> judge(const VerdictInput& input) {
  std::vector<Verdict> verdicts;
  judge_end(input, verdicts);
  judge_fit(input, verdicts);
  judge_young(input, verdicts);
  judge_young_bound(input, verdicts);
  judge_poisson(input, verdicts);
  judge_nuisances(input, verdicts);
  judge_state(input, verdicts);
  judge_equilibrium(input, verdicts);
  judge_parts(input, verdicts);
  judge_steps(input, verdicts);
  judge_unheard(input, verdicts);
  return verdicts;
}

}  // namespace palpate::estimation
