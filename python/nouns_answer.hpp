// SPDX-License-Identifier: Apache-2.0
// What comes back, as Python sees it: palpate/core/identification.hpp field by field, and what this front makes of predictions and
// suggestions.
#pragma once

#include "palpate/identify.hpp"
#include "palpate/prediction/predict.hpp"
#include "python/nouns_recording.hpp"

namespace palpate::python {

inline constexpr io::Names<Termination, 5> termination_names = {{{"converged", Termination::converged},
                                                                 {"max_iterations", Termination::max_iterations},
                                                                 {"cancelled", Termination::cancelled},
                                                                 {"no_progress", Termination::no_progress},
                                                                 {"failed", Termination::failed}}};
template <>
struct Words<Termination> {
  static constexpr auto& names = termination_names;
};

template <>
struct Noun<Verdict> {
  static constexpr const char *name = "Verdict", *about = "What the data do or do not determine, and what went wrong (docs/how-to-push.md).";
  static void fields(auto&& field) {
    field("code", &Verdict::code, "stable, e.g. 'nu_not_determined'");
    field("message", &Verdict::message, "what it means and what to do");
  }
};

template <>
struct Noun<Parameter> {
  static constexpr const char *name = "Parameter", *about = "Value: posterior median. Interval: equal-tailed quantiles.";
  static void fields(auto&& field) {
    field("name", &Parameter::name, "'young_modulus', 'poisson_ratio', ...");
    field("region", &Parameter::region, "'': the whole object");
    field("unit", &Parameter::unit, "");
    field("value", &Parameter::value, "");
    field("std", &Parameter::std, "");
    field("lower_95", &Parameter::lower_95, "");
    field("upper_95", &Parameter::upper_95, "");
    field("determined", &Parameter::determined, "False: the data say little more than the prior");
  }
};

template <>
struct Noun<Nuisance> {
  static constexpr const char *name = "Nuisance", *about = "What had to be found beside E and nu.";
  static void fields(auto&& field) {
    field("name", &Nuisance::name, "");
    field("unit", &Nuisance::unit, "");
    field("value", &Nuisance::value, "");
    field("std", &Nuisance::std, "");
    field("lower_95", &Nuisance::lower_95, "");
    field("upper_95", &Nuisance::upper_95, "");
    field("prior_std", &Nuisance::prior_std, "");
    field("pull", &Nuisance::pull, "(value - prior mean) / prior standard deviation");
  }
};

template <>
struct Noun<Slip> {
  static constexpr const char *name = "Slip", *about = "A slip of the tool that the recording does not tell and the residuals ask for.";
  static void fields(auto&& field) {
    field("push", &Slip::push, "");
    field("step", &Slip::step, "");
    field("across_m", &Slip::across_m, "");
    field("deeper_m", &Slip::deeper_m, "");
    field("chi2", &Slip::chi2, "by how much it would fall");
    field("p_value", &Slip::p_value, "");
  }
};

template <>
struct Noun<FitSummary> {
  static constexpr const char *name = "FitSummary", *about = "How the fit went.";
  static void fields(auto&& field) {
    field("rms_m", &FitSummary::rms_m, "");
    field("chi2_per_dof", &FitSummary::chi2_per_dof, "1 where noise is as stated");
    field("points_used", &FitSummary::points_used, "");
    field("pushes", &FitSummary::pushes, "");
    field("steps", &FitSummary::steps, "");
    field("iterations", &FitSummary::iterations, "");
    field("solves", &FitSummary::solves, "static equilibria that were asked for");
    field("load_cases", &FitSummary::load_cases, "that the finite elements were solved for");
  }
};

template <>
struct Noun<HeldOut> {
  static constexpr const char *name = "HeldOut", *about = "Loaded steps predicted from a fit without them. Distances: rms of observed points to a surface.";
  static void fields(auto&& field) {
    field("available", &HeldOut::available, "");
    field("what", &HeldOut::what, "'each push in turn' or 'the highest load'");
    field("force_error", &HeldOut::force_error, "relative; nan: not predicted");
    field("surface_rms_m", &HeldOut::surface_rms_m, "to the predicted surface");
    field("baseline_no_deformation_rms_m", &HeldOut::baseline_no_deformation_rms_m, "");
    field("baseline_last_step_rms_m", &HeldOut::baseline_last_step_rms_m, "");
    field("fitted_rms_m", &HeldOut::fitted_rms_m, "to that of the fit that has seen them");
    field("deformation_explained", &HeldOut::deformation_explained, "in squares, at most 1");
  }
};

template <>
struct Noun<RegionShare> {
  static constexpr const char *name = "RegionShare", *about = "A region's part of a budget's entry.";
  static void fields(auto&& field) {
    field("region", &RegionShare::region, "");
    field("young_modulus_percent", &RegionShare::young_modulus_percent, "");
  }
};

template <>
struct Noun<BudgetEntry> {
  static constexpr const char *name = "BudgetEntry", *about = "What one input's uncertainty does to the answer.";
  static void fields(auto&& field) {
    field("input", &BudgetEntry::input, "");
    field("young_modulus_percent", &BudgetEntry::young_modulus_percent, "");
    field("poisson_shift", &BudgetEntry::poisson_shift, "");
    field("regions", &BudgetEntry::regions, "E of every region; empty: there is one");
    field("off_by", &BudgetEntry::off_by, "of what the recording states as exact: by how much it is taken to err");
    field("field", &BudgetEntry::field, "of the recording, that would make a nuisance of it");
  }
};

template <>
struct Noun<YoungAtLoad> {
  static constexpr const char *name = "YoungAtLoad", *about = "E of some of the loads alone.";
  static void fields(auto&& field) {
    field("young", &YoungAtLoad::young, "region: 'low loads', 'high loads', 'quarter 1' (up to 25 % of the highest load) and so on");
    field("force_n", &YoungAtLoad::force_n, "");
    field("travel_m", &YoungAtLoad::travel_m, "");
    field("strain", &YoungAtLoad::strain, "travel over the object's extent along the push");
    field("indentation", &YoungAtLoad::indentation, "travel over the radius of the touched patch");
  }
};

template <>
struct Noun<LawFit> {
  static constexpr const char *name = "LawFit", *about = "What another law makes of the same data.";
  static void fields(auto&& field) {
    field("law", &LawFit::law, "");
    field("usable", &LawFit::usable, "");
    field("message", &LawFit::message, "");
    field("young_modulus_pa", &LawFit::young_modulus_pa, "");
    field("poisson_ratio", &LawFit::poisson_ratio, "");
    field("chi2", &LawFit::chi2, "");
    field("chi2_per_dof", &LawFit::chi2_per_dof, "");
    field("held_out", &LawFit::held_out, "");
    field("held_out_chi2", &LawFit::held_out_chi2, "");
  }
};

template <>
struct Noun<StepFit> {
  static constexpr const char *name = "StepFit", *about = "The simulated and the observed surface of one step at the optimum.";
  static void fields(auto&& field) {
    field("push", &StepFit::push, "");
    field("step", &StepFit::step, "");
    field("tool", &StepFit::tool, "of the first load, whose force and travel these are");
    field("surface_m", &StepFit::surface_m, "deformed vertices of Identification.surface");
    field("observed_m", &StepFit::observed_m, "base frame, at the fitted pose");
    field("residual_m", &StepFit::residual_m, "an observed point, signed");
    field("force_n", &StepFit::force_n, "");
    field("contact_m", &StepFit::contact_m, "");
    field("tool_radius_m", &StepFit::tool_radius_m, "0: not a round one");
    field("travel_m", &StepFit::travel_m, "nan: not measured");
    field("travel_predicted_m", &StepFit::travel_predicted_m, "");
    field("travel_predicted_std_m", &StepFit::travel_predicted_std_m, "");
    field("force_measured_n", &StepFit::force_measured_n, "along the push");
    field("force_predicted_n", &StepFit::force_predicted_n, "nan: it was imposed");
    field("force_predicted_std_n", &StepFit::force_predicted_std_n, "");
    field("von_mises_pa", &StepFit::von_mises_pa, "a vertex of surface_m; empty: not computed");
    field("masked_m", &StepFit::masked_m, "what else the camera saw near the object; never fitted");
    field("used", &StepFit::used, "");
  }
};

template <>
struct Noun<PosteriorGrid> {
  static constexpr const char *name = "PosteriorGrid", *about = "The posterior over E and nu.";
  static void fields(auto&& field) {
    field("young_modulus_pa", &PosteriorGrid::young_modulus_pa, "log spaced");
    field("poisson_ratio", &PosteriorGrid::poisson_ratio, "");
    field("density", &PosteriorGrid::density, "rows: E, columns: nu; integrates to one over (log E, nu)");
  }
};

template <>
struct Noun<FitIteration> {
  static constexpr const char *name = "FitIteration", *about = "One accepted iteration of the fit.";
  static void fields(auto&& field) {
    field("young_modulus_pa", &FitIteration::young_modulus_pa, "");
    field("poisson_ratio", &FitIteration::poisson_ratio, "");
    field("cost", &FitIteration::cost, "half the robust, weighted sum of squares");
    field("round", &FitIteration::round, "costs compare within one");
  }
};

template <>
struct Noun<Identification> {
  static constexpr const char *name = "Identification", *about = "What the pushes say of the object (docs/result-format.md).";
  static void fields(auto&& field) {
    field("method", &Identification::method, "'palpate' or 'paper'");
    field("material", &Identification::material, "");
    field("parameters", &Identification::parameters, "");
    field("nuisances", &Identification::nuisances, "");
    field("covariance", &Identification::covariance, "of (log E, nu, ...) in the order of parameters");
    field("verdicts", &Identification::verdicts, "");
    field("slip", &Identification::slip, "");
    field("fit", &Identification::fit, "");
    field("prediction", &Identification::prediction, "");
    field("budget", &Identification::budget, "");
    field("budget_if", &Identification::budget_if, "what is in no interval, since the recording states it as exact");
    field("per_push", &Identification::per_push, "young_modulus of each push alone (region: its name)");
    field("per_site", &Identification::per_site, "empty: one site");
    field("per_load", &Identification::per_load, "empty: pushes have one level only");
    field("laws", &Identification::laws, "empty: not compared");
    field("termination", &Identification::termination, "'converged', 'max_iterations', 'cancelled', 'no_progress' or 'failed'");
    field("message", &Identification::message, "");
    field("provenance", &Identification::provenance, "");
    field("timing_s", &Identification::timing_s, "");
    field("surface", &Identification::surface, "at rest, that steps deform");
    field("steps", &Identification::steps, "");
    field("posterior", &Identification::posterior, "");
    field("trace", &Identification::trace, "");
  }
};

template <>
struct Noun<Identified> {
  static constexpr const char *name = "Identified", *about = "The answer with the object as it was simulated.";
  static void fields(auto&& field) {
    field("answer", &Identified::answer, "");
    field("volume", &Identified::volume, "the simulated mesh at rest");
    field("region", &Identified::region, "an element of it: which of the answer's Young's moduli; empty: one");
    field("object", &Identified::object, "mesh, supports, tools, gravity and law as they were simulated; no pushes");
  }
};

template <>
struct Noun<prediction::Band> {
  static constexpr const char *name = "Band", *about = "Median and 95 %.";
  static void fields(auto&& field) {
    field("value", &prediction::Band::value, "");
    field("std", &prediction::Band::std, "");
    field("lower_95", &prediction::Band::lower_95, "");
    field("upper_95", &prediction::Band::upper_95, "");
  }
};

/// A push that has not been made.
struct PushPrediction {
  bool converged = false;
  std::string reason;
  Vec3 contact_m = Vec3::Zero(), direction = -Vec3::UnitZ();
  prediction::Band force_n, travel_m;
  double stiffness_n_m = 0;
  Points displacement_m, displacement_std_m;
  VectorX von_mises_pa, von_mises_std_pa;
  prediction::Band largest_displacement_m, largest_von_mises_pa;
  std::vector<std::string> warnings;
};

template <>
struct Noun<PushPrediction> {
  static constexpr const char *name = "PushPrediction", *about = "What a push that has not been made does.";
  static void fields(auto&& field) {
    field("converged", &PushPrediction::converged, "False: there is no equilibrium, reason says why");
    field("reason", &PushPrediction::reason, "");
    field("contact_m", &PushPrediction::contact_m, "on the surface");
    field("direction", &PushPrediction::direction, "");
    field("force_n", &PushPrediction::force_n, "along the push; what was given has no width");
    field("travel_m", &PushPrediction::travel_m, "");
    field("stiffness_n_m", &PushPrediction::stiffness_n_m, "d force / d travel there");
    field("displacement_m", &PushPrediction::displacement_m, "a node of Identified.volume");
    field("displacement_std_m", &PushPrediction::displacement_std_m, "");
    field("von_mises_pa", &PushPrediction::von_mises_pa, "a node: Cauchy stress, mean of the elements around");
    field("von_mises_std_pa", &PushPrediction::von_mises_std_pa, "");
    field("largest_displacement_m", &PushPrediction::largest_displacement_m, "");
    field("largest_von_mises_pa", &PushPrediction::largest_von_mises_pa, "");
    field("warnings", &PushPrediction::warnings, "");
  }
};

/// A push that would tell something, with what is to be expected after it.
struct SuggestedPush {
  Vec3 contact_m = Vec3::Zero(), direction = -Vec3::UnitZ();
  double force_n = 0, travel_m = 0;
  int steps = 0;
  std::string view, region;
  double seen_share = 0, young_modulus_within = 0, poisson_ratio_within = 0;
  std::string words;
};

template <>
struct Noun<SuggestedPush> {
  static constexpr const char *name = "SuggestedPush", *about = "A push, and how narrow intervals are expected to be after it.";
  static void fields(auto&& field) {
    field("contact_m", &SuggestedPush::contact_m, "");
    field("direction", &SuggestedPush::direction, "");
    field("force_n", &SuggestedPush::force_n, "the highest");
    field("travel_m", &SuggestedPush::travel_m, "at that force");
    field("steps", &SuggestedPush::steps, "levels up to it");
    field("view", &SuggestedPush::view, "the camera to see it by; '': there is none");
    field("region", &SuggestedPush::region, "that the tool presses on");
    field("seen_share", &SuggestedPush::seen_share, "of the surface around the tool, by that camera");
    field("young_modulus_within", &SuggestedPush::young_modulus_within, "half of the 95 % interval over E, of that region");
    field("poisson_ratio_within", &SuggestedPush::poisson_ratio_within, "half of the 95 % interval");
    field("words", &SuggestedPush::words, "");
  }
};

}  // namespace palpate::python
