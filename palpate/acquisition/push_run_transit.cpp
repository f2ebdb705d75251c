// SPDX-License-Identifier: Apache-2.0
// From wherever the tip stands to where the push begins: back along its tool, around the object, and in along the push's own line.
#include <algorithm>
#include <vector>

#include "palpate/acquisition/guarded_motion.hpp"
#include "palpate/acquisition/push_run.hpp"
#include "palpate/acquisition/ways_around.hpp"

namespace palpate::acquisition {
namespace {

constexpr double beside_m = 2e-3;  // outside for good, not on the edge
constexpr double felt_m = 0.02;    // an object that was pressed has come back by then, and two looks more

Pose moved(Pose pose, const Vec3& by_m) {
  pose.translation() += by_m;
  return pose;
}

// Where no way is known to be free: what stands in it is felt.
std::vector<Pose> over(const KeepOut& box, const Pose& from, const Pose& to) {
  const double top_m = std::max({box.max_m.z() + beside_m, from.translation().z(), to.translation().z()});
  Pose up = from, there = to;
  up.translation().z() = there.translation().z() = top_m;
  Pose turned = up;
  turned.linear() = to.linear();
  return {up, turned, there, to};
}

}  // namespace

void PushRun::come_to_start() {
  {
    const OnTheWay on_the_way(robot_);
    GuardedMotion motion(robot_, options_, [this] { ask_user(); });
    if (stands_on_the_line(motion.here()))
      go_or_stop(motion, pose_at(-options_.start_distance_m), {pressed_m(motion.here()) + felt_m, recorded_.force_n > 0});
    else if (plan_.around)
      go_around(motion, *plan_.around);
    else
      go_blindly(motion);
  }
  move_to(-options_.start_distance_m, options_.approach_speed_m_s);
}

bool PushRun::stands_on_the_line(const Pose& tip) const {
  constexpr double same_m = 2e-3, same_rad = 0.02;
  const Vec3 off_m = tip.translation() - plan_.contact_m;
  const bool turned = Eigen::Quaterniond(tip.linear()).angularDistance(Eigen::Quaterniond(plan_.R_base_tip)) > same_rad;
  const bool behind = along(off_m) > options_.travel_limit_m + options_.search_distance_m;
  return !turned && !behind && (off_m - along(off_m) * plan_.direction).norm() < same_m;
}

double PushRun::pressed_m(const Pose& tip) const {
  return std::max(0.0, along(tip.translation() - recorded_.contact_m.value_or(plan_.contact_m)));
}

void PushRun::go_or_stop(GuardedMotion& motion, const Pose& to, const Leaving& leaving) {
  if (!motion.go(to, leaving)) throw Stopped{StopReason::robot_limit, "the robot refused to move on: a limit, or out of reach"};
}

void PushRun::go_around(GuardedMotion& motion, const KeepOut& around) {
  const KeepOut box = grown(around, options_.clearance_m);
  const auto out_of_it_m = [&](const Pose& tip) {
    const double out_m = way_out_m(box, tip.translation(), -tip.linear().col(2));
    return out_m > 0 ? out_m + beside_m : 0;
  };
  const Pose here = motion.here(), start = pose_at(-options_.start_distance_m);
  const double out_m = out_of_it_m(here), pressed_until_m = way_out_m(around, here.translation(), -here.linear().col(2));
  // Where the arm does not reach that far the rest is made as well as it goes: watched all the same.
  if (out_m > 0) motion.go(moved(here, -out_m * here.linear().col(2)), {pressed_until_m > 0 ? pressed_until_m + felt_m : 0});
  const Pose before_start = moved(start, -out_of_it_m(start) * plan_.direction);
  std::vector<Pose> refused;
  if (go_one_of(motion, box, before_start, refused)) return go_or_stop(motion, start);
  if (!go_one_of(motion, box, start, refused))
    throw Stopped{StopReason::robot_limit, "the robot refused every way around the object to where the push begins: limits, or out of reach"};
}

bool PushRun::go_one_of(GuardedMotion& motion, const KeepOut& box, const Pose& to, std::vector<Pose>& refused) {
  const auto was_refused = [&](const Pose& pose) {
    return std::any_of(refused.begin(), refused.end(), [&](const Pose& one) { return one.isApprox(pose, 1e-6); });
  };
  constexpr int attempts = 30;
  for (int attempt = 0; attempt < attempts; ++attempt) {
    auto ways = ways_around(box, motion.here(), to, options_.tool_length_m);
    if (ways.empty()) ways = ways_around(box, motion.here(), to, 0);  // a tool that points up is behind its tip wherever that is
    if (ways.empty()) ways = {over(box, motion.here(), to)};
    const auto way = std::find_if(ways.begin(), ways.end(),
                                  [&](const auto& one) { return std::none_of(one.begin(), one.end(), was_refused); });
    if (way == ways.end()) return false;
    const auto stops = std::find_if(way->begin(), way->end(), [&](const Pose& leg) { return !motion.go(leg); });
    if (stops == way->end()) return true;
    refused.push_back(*stops);
  }
  return false;
}

void PushRun::go_blindly(GuardedMotion& motion) {
  const Pose here = motion.here(), start = pose_at(-options_.start_distance_m);
  // As far as the robot does.
  double back_m = 0, before_m = 0;
  for (const double share : {1.0, 0.5, 0.25}) {
    back_m = share * options_.blind_retreat_m;
    if (motion.go(moved(here, -back_m * here.linear().col(2)), {back_m})) break;
    back_m = (motion.here().translation() - here.translation()).norm();
    if (back_m > 0) break;
  }
  report_.blind_retreat_m = back_m;
  for (const double share : {1.0, 0.5, 0.25}) {
    before_m = share * options_.blind_retreat_m;
    const Pose before = moved(start, -before_m * plan_.direction);
    Pose turned = motion.here();
    turned.linear() = before.linear();
    if (motion.go(turned) && motion.go(before)) return go_or_stop(motion, start);
  }
  go_or_stop(motion, start);
}

}  // namespace palpate::acquisition
