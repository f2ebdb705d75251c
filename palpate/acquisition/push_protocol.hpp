// SPDX-License-Identifier: Apache-2.0
// The paper's way to push (Frank et al. 2010, section V): look, approach until contact, raise the force step by step, let it
// settle, record; stop at 50 N or 10 cm or when something goes wrong; go back step by step, retreat and look again.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "palpate/acquisition/keep_out.hpp"
#include "palpate/acquisition/robot.hpp"
#include "palpate/core/force_drift.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/sensing/push_events.hpp"

namespace palpate::acquisition {

struct PushPlan {
  std::string name;
  std::string site;
  std::string tool;                    ///< name in Recording::tools
  Vec3 contact_m = Vec3::Zero();       ///< where the surface is expected
  Vec3 direction = -Vec3::UnitZ();     ///< unit vector, into the object
  Mat3 R_base_tip = Mat3::Identity();  ///< orientation of the tip throughout
  /// What the tip goes around on its way here. Nothing: it is not known how large the object is (PushOptions::blind_retreat_m).
  std::optional<KeepOut> around;
};

/// A tip's orientation for a push: z along it, x as near to the base's forward as that allows (a round tip's roll is free).
Mat3 tip_along(const Vec3& direction);

struct PushOptions {
  double force_limit_n = 50.0;      ///< the paper's; a step is recorded there, however large force_step_n is
  double travel_limit_m = 0.10;     ///< the paper's
  double force_step_n = 2.0;        ///< between recorded steps; each is recorded a motion after its force was reached
  int unloading_steps = 2;          ///< recorded on the way back, equally spaced in force
  double start_distance_m = 0.05;   ///< before the expected contact: where the approach starts and the push ends
  double search_distance_m = 0.03;  ///< beyond it: how far to look for contact
  /// Of the tip between two looks at the force; less where the object is so stiff that it would pass a force step or the limit.
  double increment_m = 0.0005;
  double clearance_m = 0.04;         ///< of the tip's middle around the object's box, on its way between pushes; more than the tool's radius
  double tool_length_m = 0.25;       ///< behind the tip: what keeps out of that box, too
  double look_every_m = 0.01;        ///< of the tip between two looks at the force, on its way
  /// Change of the force on its way that means something is hit, at least; more where contact.threshold_n is. A wrist feels its own
  /// stick turn by the arm's repeat error, of which a threshold for soft objects has no room.
  double obstacle_threshold_n = 0.3;
  double blind_retreat_m = 0.15;     ///< along the tool, before and after a straight way past an object whose size nobody knows
  double approach_speed_m_s = 0.02;
  double push_speed_m_s = 0.005;
  double sample_period_s = 0.02;
  int free_air_samples = 50;         ///< for the tare and its noise
  double settling_timeout_s = 10.0;  ///< a step that has not settled by then is recorded and reported
  double contact_std_m = 0.0;        ///< prior on the contact point that the recording will state
  double changed_share = 2e-4;       ///< of the pixels after the push, beyond which the object did not come back
  sensing::ContactOptions contact;
  /// The window is long enough for 0.05 N of noise at 50 Hz to leave the slope known to 0.01 N/s.
  sensing::SettlingOptions settling{0.05, 0.005, 2.0};
  sensing::SlipOptions slip;  ///< its least_force_n is at least force_step_n
};

/// @throws Error naming the option that is out of range.
void check(const PushOptions& options);

/// The push as a robot of these limits makes it: the lower of both.
/// @throws Error naming the limit that is not positive.
PushOptions within(const RobotLimits& limits, PushOptions options);

/// Prior of the travel's zero, m: it is traced back to about half an increment, from tips that are known to `travel_sigma_m`.
double travel_offset_std_m(const PushOptions& options, double travel_sigma_m);

enum class StopReason {
  force_limit,  ///< as the options had it
  travel_limit,
  robot_force_limit,  ///< of RobotLimits, lower than the options'
  robot_travel_limit,
  slip,
  contact_lost,
  no_contact,
  robot_limit,  ///< the robot refused a motion
  obstacle,     ///< something was felt on the way between pushes
  moved,        ///< a push that goes on finds contact elsewhere than the part that is recorded
  user
};
const char* to_words(StopReason reason);
/// The push was whole: as far as it was to go.
bool is_at_a_limit(StopReason reason);

struct PushReport {
  StopReason stop = StopReason::user;
  std::string message;            ///< plain words
  Vec3 contact_m = Vec3::Zero();  ///< where contact began: the force's rise traced back to zero
  double highest_force_n = 0, deepest_m = 0;  ///< of the whole push, with what an earlier run has recorded of it
  /// Of the highest force above the limit, where noise does not explain it; more than a tenth of the limit means that the object
  /// was stiffer than a motion foresaw (at the first touch up to stiffness times increment_m).
  double overshoot_n = 0;
  /// Nobody knows how large the object is: the way there went straight past it, after this much back along the tool.
  std::optional<double> blind_retreat_m;
  int steps = 0;               ///< recorded now, resumed ones not counted
  int blank_images = 0;        ///< without one pixel that has a depth: their steps have none
  std::vector<int> unsettled;  ///< indices (in the push) of steps whose force still crept
  Vec3 tare_n = Vec3::Zero();  ///< taken off every force
  double turned_rad = 0;       ///< most that the tip was turned since the tare in a step: what the wrist's sensor errs by in its own axes turned, too
  /// From the tare to the free air after the retreat; not taken off the steps that were handed over. Nothing: no such free air,
  /// or no step under load that was handed over.
  std::optional<ForceDrift> drift;
  double drift_n = 0;          ///< what it had come to by then
  bool compared = false;       ///< images from before and after the push, taken from one place
  bool came_back = true;       ///< false: what the camera sees after the push is not what it saw before; says nothing if not compared
  double changed_share = 0;    ///< of its pixels (sensing::changed_share)
};

/// Called with each finished step, after the force has settled and everything is read: a crash loses at most the step in
/// flight.
using OnStep = std::function<void(const Push& push, const Step& step)>;

/// Runs one push, within the robot's own limits. The tip comes from wherever it stands: back along its tool, around the object and
/// in along the push's own line, in short pieces with a look at the force after each (StopReason::obstacle).
/// @param keep_going  asked before every motion and while it waits; false stops the robot where it is (StopReason::user)
/// @param so_far  steps of the same push that an earlier run has recorded: they are not recorded again, and the force rises
///                from where they end; where the way back had begun, from its top once more. Travel counts from their zero,
///                forces from a new tare, whose difference to theirs is in the forces' standard deviations.
/// @throws Error for bad options or plan, and whatever robot or on_step throw: the tip is then away from the object, if the robot
///         still moved.
PushReport run_push(Robot& robot, const PushPlan& plan, const PushOptions& options, const OnStep& on_step,
                    const std::function<bool()>& keep_going = {}, const Push* so_far = nullptr);

/// Back along the tool by the start distance, out of an object that it may be so deep in: as far as the robot does, in short pieces.
/// @throws Error when something is hit  @returns early, with the robot stopped, where the user says so
void step_back(Robot& robot, double deep_m, const PushOptions& options, const std::function<bool()>& keep_going = {});

/// Runs one push and hands it over whole, the sensor's drift taken off.
Push whole_push(Robot& robot, const PushPlan& plan, const PushOptions& options);

}  // namespace palpate::acquisition
