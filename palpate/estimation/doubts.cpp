// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/doubts.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <string_view>

#include "palpate/core/error.hpp"
#include "palpate/estimation/homogeneity.hpp"
#include "palpate/estimation/error_budget.hpp"
#include "palpate/estimation/exact_inputs.hpp"
#include "palpate/estimation/forward_model_parts.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/held_poisson.hpp"
#include "palpate/estimation/names_of_unknowns.hpp"
#include "palpate/estimation/slips.hpp"
#include "palpate/fem/regions.hpp"

namespace palpate::estimation {
namespace {

/// The same recording where nothing about tools and feet is exactly known. The priors only make unknowns of them: the test
/// takes their information off again.
struct Doubted {
  Recording recording;
  std::vector<Doubt> asked;
  std::vector<std::vector<std::string>> unknowns;  // of each of those
};

Doubted doubted(const Recording& recording, const TetMesh& mesh) {
  Doubted out{recording, {}, {}};
  const auto ask = [&](Doubt::About about, const std::string& name, double scale_m, std::vector<std::string> unknowns) {
    const bool known =
        std::any_of(out.asked.begin(), out.asked.end(), [&](const Doubt& d) { return d.about == about && d.name == name; });
    if (known) return;
    Doubt doubt;
    doubt.about = about;
    doubt.name = name;
    doubt.scale_m = scale_m;
    out.asked.push_back(doubt);
    out.unknowns.push_back(std::move(unknowns));
  };
  for (auto& push : out.recording.pushes) {
    std::set<std::string> contacts;
    for (std::size_t s = 0; s < push.steps.size(); ++s) {
      for (auto& load : push.steps[s].loads) {
        const auto tool = std::find_if(out.recording.tools.begin(), out.recording.tools.end(),
                                       [&](const Tool& each) { return each.name == load.tool; });
        const bool round = tool->shape == ToolShape::sphere || tool->shape == ToolShape::disc;
        if (!round || !load.force_n || load.force_n->norm() == 0) continue;
        if (load.contact_std_m == 0) {
          if (contacts.insert(stretch_of(push, s) + key_of(load)).second) {
            const std::string ending = of_contact(push, s, load), shift = "contact_shift" + ending;
            ask(Doubt::About::contact, ending.substr(1, ending.size() - 2), tool->radius_m, {shift + "_1", shift + "_2"});
          }
          load.contact_std_m = tool->radius_m;
        }
        if (tool->radius_std_m == 0) {
          ask(Doubt::About::tool_radius, tool->name, tool->radius_m, {"tool_radius[" + tool->name + "]"});
          tool->radius_std_m = tool->radius_m;
        }
      }
    }
  }
  for (auto& support : out.recording.supports) {
    if (recording.free || support.contact != ContactLaw::bonded || support.spread_std_m > 0) continue;
    const double rim_m = rim_radius_m(mesh, support);
    if (!(rim_m > 0)) continue;
    ask(Doubt::About::support, support.name, rim_m, {"support_spread[" + support.name + "]"});
    support.spread_std_m = rim_m;
  }
  if (!recording.free && out.recording.supports.size() == 1 && out.recording.supports[0].compliance_std_m_per_n == 0) {
    constexpr double any_m_per_n = 1e-3;
    Support& support = out.recording.supports[0];
    ask(Doubt::About::support_compliance, support.name, support.compliance_m_per_n, {"support_compliance[" + support.name + "]"});
    support.compliance_std_m_per_n = any_m_per_n;
  }
  return out;
}

/// The same object in parts around the places that were pushed. False: as it was, where there is one place, or places lie closer
/// than elements are large.
bool divide(SimulatedObject& object, const Recording& recording) {
  const std::vector<Region> sites = sites_pushed(recording);
  if (sites.empty() || !object.region_names.empty()) return false;
  try {
    object.region = fem::regions_of(object.mesh, sites);
  } catch (const Error&) {
    return false;
  }
  for (const Region& site : sites) object.region_names.push_back(site.name);
  return true;
}

/// Where each of the fit's unknowns is among more of them, which may stand in another order: an unknown comes where it is first needed.
std::vector<int> places(const Unknowns& fitted, const Unknowns& more) {
  std::map<std::string, std::vector<int>> named;
  for (int j = 0; j < more.size(); ++j) named[more[j].name].push_back(j);
  std::map<std::string, std::size_t> seen;
  std::vector<int> at;
  for (int i = 0; i < fitted.size(); ++i) {
    const std::string& name = fitted[i].name;
    const std::vector<int>& there = named[name];
    const std::size_t number = seen[name]++;
    if (number >= there.size())
      throw Error("is fitted, and there is no such unknown where what is stated as exactly known is asked about; give names that differ to "
                  "pushes, tools and supports, or run without cross-checks",
                  "unknown " + name);
    at.push_back(there[number]);
  }
  return at;
}

/// Newton's step, and the covariance of the last unknowns of it.
struct NewtonMove {
  VectorX move;
  MatrixX covariance;
};

/// Newton's steps from the optimum with more unknowns than were fitted.
struct ScoreTests {
  const Unknowns& unknowns;
  MatrixX information;
  VectorX gradient;
  std::vector<int> moving;

  /// Takes an unknown's prior off, and lets it move.
  void free(const std::vector<int>& more) {
    for (const int k : more) {
      information(k, k) -= 1 / (unknowns[k].prior_std * unknowns[k].prior_std);
      moving.push_back(k);
    }
  }
  std::optional<NewtonMove> freeing(const std::vector<int>& more) const {
    ScoreTests with = *this;
    with.free(more);
    const Eigen::LDLT<MatrixX> factorised(MatrixX(with.information(with.moving, with.moving)));
    if (factorised.info() != Eigen::Success || !factorised.isPositive()) return std::nullopt;
    const Index size = static_cast<Index>(with.moving.size()), count = static_cast<Index>(more.size());
    NewtonMove out;
    out.move = -factorised.solve(VectorX(gradient(with.moving)));
    out.covariance = factorised.solve(MatrixX(MatrixX::Identity(size, size).rightCols(count))).bottomRows(count);
    if (!out.move.allFinite() || !out.covariance.allFinite()) return std::nullopt;
    return out;
  }
};

}  // namespace

Doubts look_for_doubts(const Recording& recording, const Objective& objective, const Optimum& optimum, const Inputs& inputs,
                       const FitOptions& options, double factor, double misfit, const OnProgress& progress,
                       SolveCount& took, std::shared_ptr<ForwardModel::Solved>* solved) {
  const ForwardModel& fitted = objective.model();
  Doubted more = doubted(recording, fitted.object().mesh);
  Inputs more_inputs = inputs;
  const std::vector<ExactInput> exact = free_exact_inputs(recording, inputs, fitted.object().mesh, more.recording, more_inputs);
  SimulatedObject object = fitted.object();
  const bool divided = !fitted.touches() && divide(object, recording);
  if (divided) more.recording.model.poisson_by_region = false;  // places are asked for their E alone
  if (more.asked.empty() && !divided && exact.empty()) return {};
  Unknowns unknowns;
  constexpr double between_ratios = 1e-3;  // of a linear body's answers: the test is no finer
  ForwardModel model(more.recording, object, unknowns, statics_options(recording, fitted.object(), options),
                     solved != nullptr && *solved ? *solved : fitted.surface_modes(), between_ratios);
  if (solved != nullptr) *solved = model.solved();
  const CountsAtEnd counts(model, took);
  model.start_from(fitted);
  Objective wider(model, more_inputs, unknowns);
  const std::vector<int> at = places(objective.unknowns(), unknowns);
  ForwardModel::Changes changes = fitted.changes();
  for (auto& change : changes)
    if (change) change = change->renumbered(at, unknowns.size());
  model.set_changes(std::move(changes));
  Optimum there = optimum;
  there.unknowns = unknowns.prior_mean();
  // Nothing moves but what was fitted and what is doubted; budget_if looks at the others' columns. A torque that says nothing of a
  // contact stated as exactly known speaks here, with what it errs by.
  std::vector<int> of_torques;
  for (int k = unknowns.parameter_count(); k < unknowns.size(); ++k) {
    const std::string& name = unknowns[k].name;
    if (name.rfind("torque_tare[", 0) == 0 || name.rfind("tip_offset[", 0) == 0) of_torques.push_back(k);
    unknowns[k].fixed = true;
  }
  for (const int k : of_torques) unknowns[k].fixed = false;
  for (const auto& names : more.unknowns)
    for (const int k : unknowns.named(names)) unknowns[k].fixed = false;
  for (std::size_t k = 0; k < at.size(); ++k) {
    const int old = static_cast<int>(k);
    there.unknowns(at[k]) = optimum.unknowns(old);
    unknowns[at[k]] = objective.unknowns()[old];
  }
  const OnProgress check = [&](std::string_view, double share) { return !progress || progress("cross-check", share); };
  there.evaluation = wider.evaluate(there.unknowns, optimum.loss, check);
  if (!there.evaluation.usable) return {};

  Doubts out;
  // What was fitted. A Poisson ratio held at its bound does not follow here either.
  std::vector<int> moving;
  for (int k : moving_unknowns(objective.unknowns(), optimum.unknowns, optimum.evaluation.gradient))
    moving.push_back(at[static_cast<std::size_t>(k)]);
  out.budget_if = budget_if(exact, unknowns, there.evaluation.curvature, moving, fitted.object().region_names);
  if (fitted.touches()) return out;
  out.slip = contact_slip(wider, there, factor);
  for (const int k : of_torques)
    if (std::find(moving.begin(), moving.end(), k) == moving.end()) moving.push_back(k);
  const ScoreTests as_stated{unknowns, there.evaluation.information(factor), there.evaluation.gradient, moving};
  const auto of_sites = [&](const ScoreTests& tests) -> std::optional<SiteStiffness> {
    const std::vector<int> ratios = unknowns.ratios();
    const auto step = tests.freeing(ratios);
    if (!step || moving.front() != log_young) return std::nullopt;
    return site_stiffness(object.region_names, there.unknowns(log_young) + step->move(0),
                          step->move.tail(static_cast<Index>(ratios.size())), misfit * step->covariance);
  };
  if (divided) out.sites = of_sites(as_stated);
  // What differs from place to place is not asked of contacts and feet as well: they are asked what is left.
  const bool apart = out.sites && out.sites->p_value < rare;
  ScoreTests tests = as_stated;
  if (apart) tests.free(unknowns.ratios());
  const auto as_fitted = tests.freeing({});
  if (!as_fitted) return out;
  for (std::size_t d = 0; d < more.asked.size(); ++d) {
    const std::vector<int> these = unknowns.named(more.unknowns[d]);
    const Index count = static_cast<Index>(these.size());
    const auto step = count > 0 ? tests.freeing(these) : std::nullopt;
    if (!step) continue;
    const VectorX asked = step->move.tail(count);
    Doubt doubt = more.asked[d];
    doubt.unknowns = these;
    doubt.chi2 = asked.dot(step->covariance.ldlt().solve(asked)) / misfit;
    doubt.size_m = count == 1 ? asked(0) : asked.norm();
    doubt.p_value = std::min(1.0, chi_square_tail(doubt.chi2, static_cast<int>(count)) * static_cast<double>(more.asked.size()));
    const VectorX change = step->move.head(as_fitted->move.size()) - as_fitted->move;
    doubt.log_young = log_young_of_regions(unknowns, tests.moving) * change;
    for (std::size_t k = 0; k < tests.moving.size(); ++k) {
      if (tests.moving[k] == poisson) doubt.poisson = change(static_cast<Index>(k));
    }
    out.all.push_back(doubt);
  }
  std::stable_sort(out.all.begin(), out.all.end(), [](const Doubt& a, const Doubt& b) { return a.chi2 > b.chi2; });
  // No slip is asked for where places differ: far from a single E, what a linear step leaves of that looks like slips.
  if (!apart) out.unrecorded_slip = find_slip(wider, there, moving, factor, misfit, out.all.empty() ? 0 : out.all.front().chi2);
  // And the other way round, where one of those is there all the same.
  if (apart && !out.all.empty() && out.all.front().p_value < very_rare) {
    ScoreTests with_doubt = as_stated;
    with_doubt.free(out.all.front().unknowns);
    out.sites = of_sites(with_doubt);
  }
  return out;
}

}  // namespace palpate::estimation
