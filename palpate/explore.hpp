// SPDX-License-Identifier: Apache-2.0
// The door that closes the loop: push, estimate, take the next best push, until E and nu are known as well as was asked for,
// or the pushes are used up.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/identify.hpp"
#include "palpate/suggest.hpp"

namespace palpate {

/// Which of the candidates comes next. All but `next_best` are there to be compared with.
enum class PushOrder {
  next_best,     ///< the first of the fewest pushes that are expected to reach the goal, planned anew after each estimate
  random,        ///< a seeded order over the same candidates
  best_repeated  ///< the one that is expected to need the fewest repetitions before the first touch, again and again
};

struct ExploreOptions {
  double young_modulus_within = 0.05;  ///< half of the 95 % interval over E, of every region
  double poisson_ratio_within = 0.03;  ///< half of the 95 % interval
  int max_pushes = 8;
  PushOrder order = PushOrder::next_best;
  std::uint64_t seed = 1;         ///< of the random order
  /// Limits, candidates; its cameras and sensors are the robot's. With a goal other than `both`, the next push is the best
  /// for that parameter, whatever the other needs.
  SuggestOptions suggest;
  int levels = 4;                 ///< force steps of a push
  double touch_travel_m = 0.002;  ///< of the trial touch that sizes the first push's steps; it is not recorded
  acquisition::PushOptions push;  ///< limits of force and travel are the lowest of these, the plan's and the robot's
  IdentifyOptions identify;
  /// The scene's pushes are those of a run that was cut off: they are estimated once and count as made. The tip goes back along the
  /// tool first, for it may still stand in the object. false: pushes of the scene are not looked at.
  bool go_on = false;
};

/// @throws Error naming the option that is out of range.
void check(const ExploreOptions& options);

/// One push of the loop, and what it gave.
struct ExploredPush {
  std::string name;
  /// Of an earlier run, whose recording says where it pushed and what came of it: what was planned, why it ended and what stood
  /// after it is not known. Only the last of them has an estimate, from all of them.
  bool earlier = false;
  estimation::RatedPush plan;  ///< `expected` is what was promised for after it; infinite where that is not known
  int pushes_planned = 0;      ///< from this one on, until the goal; 0: not within max_pushes, or not planned
  acquisition::PushReport report;
  std::vector<Parameter> young_moduli;     ///< of every region, or one; estimated from all pushes so far
  Parameter poisson_ratio;
  estimation::ExpectedSpread found;        ///< standard deviations of that estimate
};

/// What fixed lists over the same candidates are expected to need for the goal, at the stiffness that was found. Nothing: not within
/// ten times max_pushes.
struct FixedLists {
  int candidates = 0;           ///< pushes that could have been made
  std::optional<int> random;    ///< in the middle of many orders that were drawn before the first push
  std::optional<int> repeated;  ///< the place that needs the fewest, again and again
};

struct Explored {
  Recording recording;
  Identified identified;  ///< of `pushes`; cancelled only where the user stopped the first estimate of all, else the last whole one stands
  PushScene scene;
  std::vector<ExploredPush> pushes;  ///< that were estimated; the recording may have one more, whose estimate the user stopped
  std::optional<FixedLists> fixed_lists;  ///< nothing: no estimate to expect them by, or stopped on request
  int fruitless = 0;     ///< pushes that found nothing to press on; they count, and their places are not tried again
                         ///< (of an earlier run those that recorded a step)
  /// The goal: the last estimate converged, its intervals are narrow, and no verdict says that they are not to be believed.
  bool reached = false;
  std::string message;   ///< why it ended, in plain words
};

struct ExploreHooks {
  /// How this robot makes a push at this place (orientation of the tip, its own bookkeeping). Required.
  std::function<acquisition::PushPlan(const estimation::PushCandidate& candidate)> plan;
  std::function<void(const Push& push)> on_push_begin;    ///< before its first step is handed over
  acquisition::OnStep on_step;                            ///< every recorded step
  std::function<void(const acquisition::PushReport& report)> on_push_end;  ///< after its last step; not for one of no step
  std::function<void(const ExploredPush& push)> on_push;  ///< after each estimate
  std::function<bool()> keep_going;                       ///< false: stop where it is
  OnProgress on_progress;                                 ///< false: as keep_going, and what is being worked out is not waited for
};

/// @param scene  object, supports, tools and priors; with `regions`, every part's E is wanted. Pushes: see ExploreOptions::go_on;
///               one without a step under load is fruitless, one that was cut off counts by the loads that it has
/// @throws Error where no push is possible, no hook plans one, or no answer can exist.
Explored explore(acquisition::Robot& robot, const Recording& scene, const ExploreOptions& options,
                 const ExploreHooks& hooks);

/// Half of a 95 % interval over E (relative) and of nu.
double young_modulus_half_width(const Parameter& young_modulus);
/// Of the least known region. Of a push without an estimate: infinite.
double young_modulus_half_width(const ExploredPush& push);
double poisson_ratio_half_width(const Parameter& poisson_ratio);

}  // namespace palpate
