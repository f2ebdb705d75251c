// SPDX-License-Identifier: Apache-2.0
// Next best push: which push would shrink the interval of E, of nu or of both the most. The Fisher information of every
// candidate comes from the fit's own forward model and measurement terms, so it holds the same nuisances with the same
// priors (Chaloner and Verdinelli 1995: Bayesian D-optimality for `both`, c-optimality for one of them).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/progress.hpp"
#include "palpate/estimation/push_candidates.hpp"
#include "palpate/estimation/terms/term.hpp"

namespace palpate::estimation {

enum class PushGoal { young_modulus, poisson_ratio, both };
/// "young-modulus", "poisson-ratio", "both". @throws Error listing them.
PushGoal push_goal(const std::string& name);

/// What a camera (or scanner) sees of the object at rest from one place.
struct PlannedView {
  std::string name;
  TermInput sees;  ///< RayObservation: rays that hit the object; PointCloud: points on it
};

/// How a push will be measured, with standard deviations.
struct SensorPlan {
  std::vector<PlannedView> views;        ///< one of them is chosen with the push
  std::optional<double> travel_sigma_m;  ///< encoders along the push; nothing: not read
  double travel_offset_std_m = 0;
  double force_std_n = 0, force_relative_std = 0, force_tare_std_n = 0;
  double contact_std_m = 0;
  double variance_inflation = 1;  ///< of surface points that err together (docs/estimator.md)
  int levels = 4;                 ///< force steps up to the limit; each is a choice of how hard to push
};

/// What is known of log E and nu before the push. Of an object in R regions (two or more) E is that of the first, and the others are
/// known by the log of their ratio to it, as in the fit (estimation::Unknowns).
struct Knowledge {
  double young_modulus_pa = 2e4, poisson_ratio = 0.3;  ///< where information is computed
  std::vector<std::string> regions;                    ///< R names; empty: one stiffness everywhere
  VectorX log_ratio;                                   ///< R - 1: where information is computed
  MatrixX information = MatrixX::Zero(3, 3);           ///< of (log E, nu, R - 1 log ratios, force scale, `shared`), their priors included
  /// Errors that all pushes share, as the force's scale (tool radius, compliance, density, supports, lens, a camera that stands): so many
  /// are the last of `information` once pushes are ranked, each with its prior: planned pushes tell of them together. What they did in
  /// pushes that were fitted is taken for an error of its own, since an answer does not say which way it went.
  Index shared = 0;
  /// Covariance of (log E of every region, nu) that no push takes away: the mesh's, the unseen side's and the foot's. Empty: none.
  MatrixX uncured;
  bool touched = false;                                ///< false: nothing but priors, E is a guess

  double young_modulus_of(int region) const;  ///< Pa; 0: the first, or the whole object
};

/// Priors alone: nothing of E, the recording's range of nu and scale of force, ratios as wide as the fit's.
Knowledge before_touch(const Recording& recording, double young_modulus_pa);
/// The posterior so far. The force's scale is a common error that is held apart: further pushes do not average it out.
/// @throws Error when the answer has no Young's modulus or Poisson ratio, or no covariance.
Knowledge after_fit(const Recording& recording, const Identification& answer);

/// Standard deviations of log E and nu.
struct ExpectedSpread {
  double log_young_std = 0, poisson_std = 0;  ///< in regions: of the least known one
  VectorX region_log_young_std;               ///< R; one entry where there is one stiffness
  double young_volume = 0, volume = 0;        ///< root of the determinant of the covariance of every log E; with nu
  double score(PushGoal goal) const;          ///< what is minimised: a standard deviation, or the root of the determinant
};

struct RatedPush {
  PushCandidate candidate;
  int view = -1;            ///< index in SensorPlan::views; -1: there are none
  double force_n = 0;       ///< highest
  double travel_m = 0;      ///< at that force, small strains; the encoder's, with what the tool's compliance gives way
  int steps = 0;            ///< levels up to it
  double seen_share = 0;    ///< of the surface around the tool, by that view
  ExpectedSpread expected;  ///< after the push
  int region = 0;           ///< that the tool presses on
  MatrixX information;      ///< that it adds, as that of PushRanking::knowledge, every nuisance of its own integrated out
};

struct PushRanking {
  Knowledge knowledge;  ///< that was given, with the errors that these pushes share
  PushGoal goal = PushGoal::both;
  ExpectedSpread so_far;              ///< infinite where nothing is known
  std::vector<RatedPush> pushes;      ///< best first
  int out_of_view = 0, too_soft = 0;  ///< candidates left out: no view shows them; supports do not carry the push
};

struct RankOptions {
  PushGoal goal = PushGoal::both;
  PushLimits limits;
  double least_seen_share = 0.2;  ///< of the surface around the tool
  int threads = 1;                ///< 0: as many as the machine has
};

/// @param scene      supports, environment, tools and priors of the object; its pushes are not looked at
/// @param object     simulated with small strains, whatever its law: one factorisation for all candidates; its regions count
///                   where `knowledge` has them
/// @param tool       name in scene.tools
/// @throws Error as ForwardModel does; on a plan without sensors; where regions of object and knowledge differ.
PushRanking rank_pushes(const Recording& scene, const SimulatedObject& object, const std::string& tool,
                        const std::vector<PushCandidate>& candidates, const SensorPlan& sensors, const Knowledge& knowledge,
                        const RankOptions& options, const OnProgress& progress = {});

/// In place of errors that all pushes share, if there are any, those with this information by themselves (of a ranking, the last of its
/// knowledge's diagonal).
Knowledge with_shared(Knowledge known, const VectorX& information);

/// What is expected after these pushes on top of what is known.
ExpectedSpread expected_after(const Knowledge& knowledge, const std::vector<const RatedPush*>& pushes);

/// Indices into ranking.pushes: of every place and direction the hardest push, best first. How hard to push is limited, not
/// chosen, once a push is made.
std::vector<std::size_t> hardest_pushes(const PushRanking& ranking);

/// Indices into ranking.pushes, each the best after those before it; the same push may come twice.
std::vector<std::size_t> plan_sequence(const PushRanking& ranking, int count);

}  // namespace palpate::estimation
