// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/from_streams.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

#include "palpate/acquisition/force_track.hpp"
#include "palpate/acquisition/nearest_time.hpp"
#include "palpate/acquisition/repeated_notes.hpp"
#include "palpate/acquisition/step_force.hpp"
#include "palpate/acquisition/stream_joints.hpp"
#include "palpate/acquisition/stream_views.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition {
namespace {

/// A step before its sensors are looked up.
struct StepTime {
  double time_s = 0;
  std::optional<bool> loaded;     ///< not given: told by the force
  std::optional<bool> unloading;  ///< not given: told by force and travel
  bool slipped = false;
};
struct PushTimes {
  PlannedPush plan;
  std::vector<StepTime> steps;
  const ContactSpan* span = nullptr;
};

std::string newtons(double value) {
  const std::string text = std::to_string(value);
  return text.substr(0, text.find('.') + 3) + " N";
}

class Assembly {
 public:
  Assembly(const StreamPlan& plan, const SensorStreams& streams)
      : plan_(plan), streams_(streams), tree_(tree_of(plan, streams)) {
    out_.recording = plan.recording;
    out_.recording.source = plan.source;
    out_.recording.warnings.insert(out_.recording.warnings.end(), streams.warnings.begin(), streams.warnings.end());
    // Joints that the description does not know (a gripper on the same topic) have no say.
    if (plan.recording.joint_names.empty() && plan.recording.robot)
      std::copy_if(streams.joint_names.begin(), streams.joint_names.end(), std::back_inserter(out_.recording.joint_names),
                   [&](const std::string& name) { return knows(*plan.recording.robot, name); });
  }

  FromStreams run() {
    align_clocks();
    views_.emplace(plan_, streams_, tree_, camera_offset_s_, cloud_offset_s_);
    if (!plan_.views_at_s.empty()) out_.recording.rest.views = views_->of_rest(of_steps_);
    track_ = track_of(plan_, streams_, tree_, wrench_offset_s_);
    spans_ = find_contacts(track_, plan_);
    for (const PushTimes& push : pushes()) add_push(push);
    for (std::string& note : of_steps_.texts()) out_.notes.push_back(std::move(note));
    if (out_.recording.pushes.empty())
      throw Error("no step could be made; check times, topics and clocks with `palpate info`", plan_.source + ": steps");
    return std::move(out_);
  }

 private:
  double clock_of(const ClockPlan& clock, const std::function<ClockOffset()>& estimate) {
    if (!clock.estimate) return clock.offset_s;
    const ClockOffset found = estimate();
    out_.clocks.push_back(found);
    double& left_s = out_.recording.time_offset_std_s;
    left_s = std::hypot(left_s, left_std_s(found));
    if (!found.usable)
      out_.notes.push_back("the clock of " + found.sensor +
                           " could not be aligned with the arm's (too little that both saw): taken as it is; state in time_offset_std_s "
                           "how far it may be off");
    return believed_offset_s(found);
  }

  void align_clocks() {
    if (plan_.camera_clock.estimate && streams_.cameras.empty())
      out_.notes.push_back(
          "camera_offset_s: estimate needs depth images, and there are clouds only: they are taken at their own times (give "
          "the offset in seconds, or let one camera's images in)");
    wrench_offset_s_ = clock_of(plan_.wrench_clock, [&] { return wrench_offset(plan_, streams_, tree_); });
    for (const DepthStream& camera : streams_.cameras)
      camera_offset_s_.push_back(
          clock_of(plan_.camera_clock, [&] { return camera_offset(plan_, tree_, camera); }));
    // Clouds come from the same device as the depth images, where there are any.
    cloud_offset_s_ = !camera_offset_s_.empty() ? camera_offset_s_.front() : plan_.camera_clock.offset_s;
  }

  std::vector<PushTimes> pushes() {
    std::vector<PushTimes> all;
    if (plan_.steps_by == StepsBy::detection) return detected();
    if (plan_.steps_by == StepsBy::marks) {
      for (const MarkSample& mark : streams_.marks) marked(mark, all);
      if (all.empty()) throw Error("there is no mark in the bag", plan_.source + ": topics.marks");
      compare_names(all);
    } else {
      for (const PlannedPush& push : plan_.pushes) {
        PushTimes& one = all.emplace_back(PushTimes{push, {}, nullptr});
        for (const double time : push.at_s) one.steps.push_back({time, {}, {}});
      }
    }
    for (PushTimes& push : all) push.span = span_of(push);
    return all;
  }

  /// "NAME", "NAME; unloading", "NAME; unloaded", "NAME; slipped", or several; without a name, one push.
  void marked(const MarkSample& mark, std::vector<PushTimes>& all) const {
    StepTime step{mark.time_s, {}, {}, mark.text.find("; slipped") != std::string::npos};
    std::string name = mark.text.substr(0, mark.text.find(';'));
    while (!name.empty() && name.back() == ' ') name.pop_back();
    if (name.empty()) name = "push 1";
    if (mark.text.find("; unloading") != std::string::npos) step.unloading = true;
    if (mark.text.find("; unloaded") != std::string::npos) step.loaded = false;
    if (mark.text.find("; loaded") != std::string::npos) step.loaded = true, step.unloading = step.unloading.value_or(false);
    auto found = std::find_if(all.begin(), all.end(), [&](const PushTimes& one) { return one.plan.name == name; });
    if (found == all.end()) {
      const auto planned =
          std::find_if(plan_.pushes.begin(), plan_.pushes.end(), [&](const PlannedPush& one) { return one.name == name; });
      all.push_back({planned == plan_.pushes.end() ? plan_.any_push : *planned, {}, nullptr});
      found = all.end() - 1;
      found->plan.name = name;
    }
    found->steps.push_back(step);
  }

  /// Of marks and mapping each has to name the same pushes.
  void compare_names(const std::vector<PushTimes>& marked) {
    std::string names;
    for (const PushTimes& one : marked) {
      names += (names.empty() ? "'" : ", '") + one.plan.name + "'";
      const bool planned = std::any_of(plan_.pushes.begin(), plan_.pushes.end(),
                                       [&](const PlannedPush& push) { return push.name == one.plan.name; });
      if (!planned && !plan_.pushes.empty())
        out_.notes.push_back("the marks name the push '" + one.plan.name +
                             "', which steps.pushes does not describe: it is taken as steps says");
    }
    for (const PlannedPush& push : plan_.pushes) {
      if (std::none_of(marked.begin(), marked.end(), [&](const PushTimes& one) { return one.plan.name == push.name; }))
        throw Error("no mark names the push '" + push.name + "'; the marks name " + names, where_of(push));
    }
  }

  std::string where_of(const PlannedPush& push) const { return push.where.empty() ? plan_.source + ": steps.pushes" : push.where; }

  /// The contact that most of the push's steps fall into.
  const ContactSpan* span_of(const PushTimes& push) const {
    const ContactSpan* best = nullptr;
    std::size_t most = 0;
    for (const ContactSpan& span : spans_) {
      const double from = track_.samples[span.begin].time_s, to = track_.samples[span.end - 1].time_s;
      const auto inside =
          static_cast<std::size_t>(std::count_if(push.steps.begin(), push.steps.end(), [&](const StepTime& step) {
            return step.time_s >= from && step.time_s <= to;
          }));
      if (inside > most) most = inside, best = &span;
    }
    return best;
  }

  std::vector<PushTimes> detected() {
    std::vector<PushTimes> all;
    if (!plan_.pushes.empty() && plan_.pushes.size() != spans_.size())
      out_.notes.push_back("pushes in steps.pushes: " + std::to_string(plan_.pushes.size()) +
                           ", contacts found in the force: " + std::to_string(spans_.size()) +
                           "; they are taken for each other in their order, so that " +
                           (plan_.pushes.size() > spans_.size() ? "the last pushes have no contact" : "the last contacts have no description") +
                           ". Look at steps.contact_threshold_n, or give the times (steps: {by: times})");
    for (std::size_t k = 0; k < spans_.size(); ++k) {
      const ContactSpan& span = spans_[k];
      PushTimes push;
      push.span = &span;
      push.plan = k < plan_.pushes.size() ? plan_.pushes[k] : plan_.any_push;
      if (push.plan.name.empty()) push.plan.name = "push " + std::to_string(k + 1);
      const double begin = track_.samples[span.begin].time_s, end = track_.samples[span.end - 1].time_s;
      const auto still = find_still_times(track_, span, plan_);
      if (still.empty()) {
        out_.notes.push_back("contact at " + seconds_text(begin) + " to " + seconds_text(end) + ": the tool never stood still for " +
                             seconds_text(plan_.hold_s) + ", so that no step was taken there (steps.hold_s, steps.still_m_s)");
        continue;
      }
      const double next = k + 1 < spans_.size() ? track_.samples[spans_[k + 1].begin].time_s : track_.samples.back().time_s + 1e-6;
      const double ended = k > 0 ? track_.samples[spans_[k - 1].end - 1].time_s : track_.samples.front().time_s;
      const double before = seen_in_free_air(begin - 0.5 * plan_.tare_s, ended, begin, span);
      const double after = seen_in_free_air(end + plan_.tare_s, end, next, span);
      if (before > track_.samples.front().time_s) push.steps.push_back({before, false, false});
      for (const StillTime& one : still) {
        push.steps.push_back({one.time_s, true, {}});
        if (!one.settled) of_steps_.add(push.plan.name + ": the force still crept in", one.time_s);
      }
      if (after < next) push.steps.push_back({after, false, true});
      all.push_back(std::move(push));
    }
    if (all.empty())
      throw Error(
          spans_.empty()
              ? "no contact was found in the force: is the sign right (wrench.reports), is z of the tip along the push, "
                "is the threshold right (steps.contact_threshold_n)?"
              : "the tool never stood still while it touched; give the times of the steps (steps: {by: times})",
          plan_.source + ": steps");
    return all;
  }

  /// The time at which the object is looked at without a load: that asked for, or where no picture was taken then, that of the
  /// nearest picture between two contacts with the tool off the object. Some cameras take one picture a step.
  double seen_in_free_air(double wanted_s, double from_s, double to_s, const ContactSpan& span) const {
    constexpr double clear_m = 0.002;
    const bool has_images = !streams_.cameras.empty();
    if (!has_images && streams_.clouds.empty()) return wanted_s;
    const std::vector<double>& times = has_images ? streams_.cameras.front().times_s : streams_.clouds.front().times_s;
    const double offset_s = has_images ? camera_offset_s_.front() : cloud_offset_s_;
    if (nearest_gap_s(times, offset_s, wanted_s) < plan_.image_gap_s) return wanted_s;
    double best_s = wanted_s, gap_s = std::numeric_limits<double>::infinity();
    for (const double one : times) {
      const double time_s = one + offset_s;
      if (time_s <= from_s || time_s >= to_s || std::abs(time_s - wanted_s) >= gap_s) continue;
      const auto tip = tree_.lookup(plan_.base_frame, plan_.tip_frame, time_s);
      if (!tip || span.direction.dot(tip->translation() - span.contact_m) > -clear_m) continue;
      best_s = time_s;
      gap_s = std::abs(time_s - wanted_s);
    }
    return best_s;
  }

  std::optional<StepForce> force_at(double time_s, double seen_s) const {
    const auto before = [&](double end_s) {
      const auto& samples = track_.samples;
      const auto later = [](double t, const sensing::ContactSample& s) { return t < s.time_s; };
      // Times have come through integers: the sample at the step's own time belongs to it.
      const auto last = std::upper_bound(samples.begin(), samples.end(), end_s + 1e-6, later);
      auto first = last;
      while (first != samples.begin() && std::prev(first)->time_s >= end_s - plan_.window_s) --first;
      return step_force({first, last}, std::min(seen_s, end_s));
    };
    const auto force = before(time_s);
    if (!force || force->rate_n_s.isZero(0) || seen_s <= time_s) return force;
    // An image that came later: the line is not drawn beyond what was measured, the tool may have stopped.
    const auto then = before(seen_s);
    return then && !then->rate_n_s.isZero(0) ? then : force;
  }

  void add_push(const PushTimes& times) {
    const PlannedPush& plan = times.plan;
    Push push;
    push.name = plan.name;
    push.site = plan.site;
    push.travel_offset_std_m = plan.travel_offset_std_m;
    push.force_tare_std_n = plan.force_tare_std_n;
    Vec3 tare = Vec3::Zero();
    const bool touches = std::any_of(times.steps.begin(), times.steps.end(), [](const StepTime& at) { return at.loaded.value_or(true); });
    if (plan_.tare != Tare::none && touches) {
      if (times.span == nullptr)
        throw Error("push '" + push.name +
                        "': no contact was found in the force at its steps, so that it cannot be tared before it; look at their times, or "
                        "give wrench.tare",
                    plan_.source + ": wrench");
      tare = times.span->tare_n;
      if (push.force_tare_std_n == 0)
        push.force_tare_std_n =
            times.span->free_air_std_n / std::sqrt(double(std::max<std::size_t>(1, times.span->free_air_samples)));
    }
    if (!plan.contact_m && times.span == nullptr && touches)
      throw Error("push '" + push.name + "': no contact was found in the force at its steps; look at their times, or give its contact_m",
                  where_of(plan));
    const Vec3 contact = plan.contact_m ? *plan.contact_m : times.span != nullptr ? times.span->contact_m : Vec3::Zero();
    Vec3 direction = plan.direction ? *plan.direction : Vec3::Zero();
    const ForceDrift drift = times.span != nullptr ? times.span->drift : ForceDrift();
    double highest_n = 0, deepest_m = 0, drifted_n = 0;
    std::size_t loaded_steps = 0;
    std::vector<double> moving;  // times of steps whose force had not settled
    for (const StepTime& at : times.steps) {
      const double seen_s = views_->seen_at(at.time_s);
      const auto force = force_at(at.time_s, seen_s);
      const bool on_its_way = force && !force->rate_n_s.isZero(0);
      const auto tip = tree_.lookup(plan_.base_frame, plan_.tip_frame, on_its_way ? seen_s : at.time_s);
      if (!force && at.loaded.value_or(true)) {
        of_steps_.add(push.name + ": no force within " + seconds_text(plan_.window_s) + " before", at.time_s, ": left out");
        continue;
      }
      if (direction.norm() == 0 && touches) {
        if (times.span != nullptr)
          direction = times.span->direction;
        else if (tip)
          direction = tip->linear().col(2).normalized();
        else
          throw Error("push '" + push.name + "': give its direction", where_of(plan));
      }
      Step step;
      step.time_s = at.time_s;
      step.slipped = at.slipped;
      step.source = plan_.source + ": " + push.name + " at " + seconds_text(at.time_s);
      step.T_base_tip = tip;
      step.joints_rad = joints_of(at.time_s);
      const Vec3 drifted = drift.at(at.time_s);
      const Vec3 pressing = force ? Vec3(force->force_n - tare - drifted) : Vec3(Vec3::Zero());
      const double along = pressing.dot(direction), travel = tip ? direction.dot(tip->translation() - contact) : 0;
      const double noise = times.span != nullptr ? 5 * times.span->free_air_std_n : 0;
      const bool loaded = at.loaded.value_or(along > std::max(plan_.contact_threshold_n, noise));
      step.unloading = at.unloading.value_or(loaded ? along < highest_n && travel < deepest_m - 1e-4 : highest_n > 0);
      highest_n = std::max(highest_n, along);
      deepest_m = std::max(deepest_m, travel);
      drifted_n = std::max(drifted_n, drifted.norm());
      if (loaded) {
        Load load;
        load.tool = plan.tool;
        load.force_n = pressing;
        load.force_std_n = plan.force_std_n ? *plan.force_std_n : force->std_n;
        load.force_relative_std = plan.force_relative_std;
        load.force_rate_n_s = force->rate_n_s;
        if (on_its_way) moving.push_back(step.time_s);
        load.contact_m = contact;
        load.direction = direction;
        load.contact_std_m = plan.contact_std_m;
        step.loads.push_back(load);
        if (!plan.travel_sigma_m.empty() && tip)
          step.observations.emplace_back(
              ToolTravel{plan.tool, travel, plan.travel_sigma_m[std::min(loaded_steps, plan.travel_sigma_m.size() - 1)]});
        ++loaded_steps;
      }
      views_->look(step, of_steps_);
      push.steps.push_back(std::move(step));
    }
    if (drifted_n > 0.05 * highest_n && highest_n > 0)
      out_.notes.push_back(push.name + ": the zero of the force moved by " + newtons(drifted_n) + " during the push (" +
                           newtons(highest_n) + " at most); taken off evenly over its time. Let the sensor warm up, and keep cables from pulling");
    if (plan.travel_sigma_m.size() > 1 && plan.travel_sigma_m.size() != loaded_steps)
      out_.notes.push_back(push.name + ": travel_sigma_m holds " + std::to_string(plan.travel_sigma_m.size()) + " numbers for " +
                           std::to_string(loaded_steps) + " loaded steps; the last one stands for those that follow");
    if (!moving.empty())
      out_.notes.push_back(push.name + ": the force was changing in " + std::to_string(moving.size()) +
                           (moving.size() == 1 ? " step" : " steps") + ", the first at " + seconds_text(moving.front()) +
                           "; taken at the time of the image, with its rate" +
                           (out_.recording.time_offset_std_s > 0
                                ? ""
                                : " (state time_offset_std_s, or what the clocks of force and camera differ by is taken as exactly known)"));
    if (!push.steps.empty()) out_.recording.pushes.push_back(std::move(push));
  }

  /// In the order of the recording's joint names; empty where one is missing.
  std::vector<double> joints_of(double time_s) const {
    const auto all = joints_at(streams_, plan_.recording.robot, time_s);
    std::vector<double> positions;
    for (const std::string& name : out_.recording.joint_names) {
      const auto place = std::find(streams_.joint_names.begin(), streams_.joint_names.end(), name);
      if (!all || place == streams_.joint_names.end()) return {};
      positions.push_back((*all)[static_cast<std::size_t>(place - streams_.joint_names.begin())]);
    }
    return positions;
  }

  const StreamPlan& plan_;
  const SensorStreams& streams_;
  FrameTree tree_;
  Track track_;
  std::vector<ContactSpan> spans_;
  double wrench_offset_s_ = 0, cloud_offset_s_ = 0;
  std::vector<double> camera_offset_s_;
  std::optional<StreamViews> views_;
  RepeatedNotes of_steps_;
  FromStreams out_;
};

}  // namespace

FromStreams recording_from(const StreamPlan& plan, const SensorStreams& streams) {
  const auto told = with_joints_of_transforms(plan.recording.robot, streams);
  return Assembly(plan, told ? *told : streams).run();
}

}  // namespace palpate::acquisition
