// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate {

struct Verdict {
  std::string code;     ///< stable, e.g. "nu_not_determined"
  std::string message;  ///< plain words: what it means and what to do
};

/// value = posterior median, interval = equal-tailed quantiles; what is inside: docs/uncertainty.md (of the mesh: refine auto).
struct Parameter {
  std::string name;    ///< young_modulus, poisson_ratio, alpha, ...
  std::string region;  ///< empty = whole object
  std::string unit;
  double value = 0, std = 0, lower_95 = 0, upper_95 = 0;
  bool determined = true;  ///< false: the data say little more than the prior
};

struct Nuisance {
  std::string name;
  std::string unit;
  double value = 0, std = 0, lower_95 = 0, upper_95 = 0;
  double prior_std = 0;
  double pull = 0;  ///< (value - prior mean) / prior standard deviation
};

/// A slip of the tool that the recording does not tell and the residuals ask for: from a step of a push on the tool touches elsewhere.
struct Slip {
  std::size_t push = 0, step = 0;
  double across_m = 0, deeper_m = 0;  ///< from before to after; 0 where nothing tells
  double chi2 = 0;                    ///< by how much it would fall
  double p_value = 1;                 ///< chance of asking for as much without one, over all places where it may be
};

enum class Termination { converged, max_iterations, cancelled, no_progress, failed };

struct FitSummary {
  double rms_m = 0;  ///< of the residuals that are lengths; NaN where nothing but forces was compared
  double chi2_per_dof = 0;
  std::size_t points_used = 0;
  std::size_t pushes = 0;
  std::size_t steps = 0;
  int iterations = 0;
  int solves = 0;  ///< static equilibria that were asked for
  /// Load cases that the finite elements were solved for. In small strains equilibria are put together of unit loads, solved
  /// with their slopes at a few Poisson ratios (none where an earlier fit did so); else as many as `solves`.
  int load_cases = 0;
};

/// Loaded steps predicted from a fit without them. Distances are rms of observed points to a surface, noise included.
struct HeldOut {
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

  bool available = false;
  std::string what;          ///< "each push in turn" or "the highest load"
  double force_error = 0;    ///< relative, of the predicted force (NaN = not predicted)
  double surface_rms_m = 0;  ///< to the predicted surface; NaN, as the next three, where no surface was seen
  double baseline_no_deformation_rms_m = 0;
  double baseline_last_step_rms_m = 0;  ///< to that of the step before
  double fitted_rms_m = unknown;        ///< to that of the fit that has seen them: hardly more than noise where the model fits
  /// How much of what that fit explains of the deformation is foretold as well, in squares, at most 1: noise drops out. NaN = the
  /// deformation is lost in the noise.
  double deformation_explained = unknown;
};

struct RegionShare {
  std::string region;
  double young_modulus_percent = 0;
};

/// E of some of the loads alone, and how far they deform the object: the farthest of them.
struct YoungAtLoad {
  Parameter young;  ///< region = "low loads", "high loads", or "quarter 1" (up to 25 % of a push's highest load) and so on
  double force_n = HeldOut::unknown, travel_m = HeldOut::unknown;
  double strain = HeldOut::unknown;       ///< travel over the object's extent along the push
  double indentation = HeldOut::unknown;  ///< travel over the radius of the touched patch; NaN = not a round one
};

/// What another law makes of the same data, on one mesh for all laws.
struct LawFit {
  std::string law;
  bool usable = false;
  std::string message;  ///< where it is not: why
  double young_modulus_pa = HeldOut::unknown, poisson_ratio = HeldOut::unknown;
  double chi2 = HeldOut::unknown;           ///< of the fit: robust costs and priors, twice
  double chi2_per_dof = HeldOut::unknown;
  HeldOut held_out;                         ///< the highest load of each push, from the lower ones
  double held_out_chi2 = HeldOut::unknown;  ///< what these loads add to chi2 while E and nu stay where the lower ones have them
};

/// What one input's uncertainty does to the answer.
struct BudgetEntry {
  std::string input;
  double young_modulus_percent = 0;  ///< of several regions: the first one's
  double poisson_shift = 0;
  std::vector<RegionShare> regions = {};  ///< E of every region, the first one's too; empty: there is one
  // Of what a recording states as exactly known (Identification::budget_if):
  std::string off_by = {};  ///< by how much it is taken to err, in words
  std::string field = {};   ///< of the recording, that would make a nuisance of it
};

/// Everything a figure needs of one step: the simulated and the observed surface at the optimum.
struct StepFit {
  std::string push;
  int step = 0;
  std::string tool;    ///< of the first load, whose force and travel these are; empty: no load, or a result of an earlier version
  Points surface_m;    ///< deformed vertices of Identification::surface (base frame)
  Points observed_m;   ///< observed points (base frame, at the fitted pose)
  VectorX residual_m;  ///< per observed point, signed
  Vec3 force_n = Vec3::Zero();
  Vec3 contact_m = Vec3::Zero();
  double tool_radius_m = 0;  ///< of the touched patch; 0 = not a round one (edge, platen)
  double travel_m = unknown, travel_predicted_m = unknown;         ///< into the object; NaN = not measured, not predicted
  double travel_predicted_std_m = unknown;
  double force_measured_n = unknown, force_predicted_n = unknown;  ///< along the push; NaN: not measured, the force was imposed
  double force_predicted_std_n = unknown;
  VectorX von_mises_pa;  ///< per vertex of surface_m; empty = not computed
  Points masked_m;       ///< what else the depth camera saw near the object (robot, table, depth edges), thinned; never fitted
  bool used = true;

  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
};

struct PosteriorGrid {
  VectorX young_modulus_pa;  ///< one axis (log spaced)
  VectorX poisson_ratio;     ///< other axis
  MatrixX density;           ///< rows = E, cols = nu, integrates to one over (log E, nu)
};

/// One accepted iteration of the fit, for the convergence figure.
struct FitIteration {
  double young_modulus_pa = 0, poisson_ratio = 0;
  double cost = 0;  ///< half the robust, weighted sum of squares (the paper's method: its error function)
  int round = 0;    ///< rounds weigh outliers differently: costs compare within one
};

struct Identification {
  std::string method = "palpate";  ///< or "paper"
  std::string material;
  std::vector<Parameter> parameters;
  std::vector<Nuisance> nuisances;
  MatrixX covariance;  ///< of (log E, nu, ...) in the order of `parameters`
  std::vector<Verdict> verdicts;
  std::optional<Slip> slip;  ///< that is not in the recording the answer is of
  FitSummary fit;
  HeldOut prediction;
  std::vector<BudgetEntry> budget;
  /// What is in no interval, since the recording states it as exact: what it would do were it off by a typical size.
  std::vector<BudgetEntry> budget_if;
  std::vector<Parameter> per_push;  ///< young_modulus of each push alone (region = push name)
  std::vector<Parameter> per_site;  ///< of all pushes at one place (region = its name); empty = one site
  std::vector<YoungAtLoad> per_load;  ///< low loads, high loads; quarters where these differ; empty = pushes have one level only
  std::vector<LawFit> laws;           ///< empty = not compared
  Termination termination = Termination::failed;
  std::string message = "identify() was not called.";
  std::map<std::string, std::string> provenance;
  std::map<std::string, double> timing_s;
  TriMesh surface;  ///< rest surface that `steps` deform
  std::vector<StepFit> steps;
  PosteriorGrid posterior;
  std::vector<FitIteration> trace;  ///< from the start to the optimum; empty = not kept
};

}  // namespace palpate
