// SPDX-License-Identifier: Apache-2.0
// A robot that Python drives: an object with the calls of palpate.Robot (python/palpate/robot.py).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/explore.hpp"
#include "python/nouns_answer.hpp"

namespace palpate::python {

template <>
struct Noun<acquisition::RobotState> {
  using State = acquisition::RobotState;
  static constexpr const char *name = "RobotState", *about = "Read at one time.";
  static void fields(auto&& field) {
    field("time_s", &State::time_s, "of the clock that images have, too");
    field("joints_rad", &State::joints_rad, "may be empty");
    field("T_base_tip", &State::T_base_tip, "z along the tool, into the object");
    field("force_n", &State::force_n, "of the tool on the object, base frame; a constant bias is allowed");
    field("torque_nm", &State::torque_nm, "of the tool on the object about the tip, base frame; None: not measured");
  }
};

template <>
struct Noun<acquisition::RobotLimits> {
  using Limits = acquisition::RobotLimits;
  static constexpr const char *name = "RobotLimits", *about = "What the robot itself bears, whatever a push asks for; inf: no limit of its own.";
  static void fields(auto&& field) {
    field("force_n", &Limits::force_n, "of the tip along a push");
    field("travel_m", &Limits::travel_m, "into the object, from first contact");
    field("speed_m_s", &Limits::speed_m_s, "of the tip");
  }
};

/// What came of a push that a robot made.
struct MadePush {
  std::string stop, message;
  bool whole = false;
  Vec3 contact_m = Vec3::Zero();
  double highest_force_n = 0, deepest_m = 0, overshoot_n = 0;
  int steps = 0, blank_images = 0;
  std::vector<int> unsettled;
  bool compared = false, came_back = true;
  double changed_share = 0, drift_n = 0, turned_rad = 0;
  std::optional<double> blind_retreat_m;
};
MadePush made_push(const acquisition::PushReport& report);

template <>
struct Noun<MadePush> {
  static constexpr const char *name = "PushReport", *about = "What came of a push.";
  static void fields(auto&& field) {
    field("stop", &MadePush::stop, "why it ended, in a few words");
    field("message", &MadePush::message, "");
    field("whole", &MadePush::whole, "it went as far as it was to");
    field("contact_m", &MadePush::contact_m, "where contact began: the force's rise traced back to zero");
    field("highest_force_n", &MadePush::highest_force_n, "");
    field("deepest_m", &MadePush::deepest_m, "");
    field("overshoot_n", &MadePush::overshoot_n, "of the highest force above the limit, where noise does not explain it");
    field("steps", &MadePush::steps, "that were recorded");
    field("blank_images", &MadePush::blank_images, "without one pixel that has a depth: their steps have none");
    field("unsettled", &MadePush::unsettled, "steps whose force still crept");
    field("compared", &MadePush::compared, "images from before and after the push");
    field("came_back", &MadePush::came_back, "False: the object is not what it was; says nothing if not compared");
    field("changed_share", &MadePush::changed_share, "of the image's pixels");
    field("drift_n", &MadePush::drift_n, "of the force's zero by the end; it is taken off");
    field("turned_rad", &MadePush::turned_rad, "most that the tip was turned in a step since the force was tared: what a wrist's sensor reads by itself turns with it");
    field("blind_retreat_m", &MadePush::blind_retreat_m, "back along the tool by so much and straight past the object, whose size nobody knows; None: around it");
  }
};

struct LoopPush {
  std::string name;
  SuggestedPush plan;
  MadePush report;
  std::vector<Parameter> young_moduli;
  Parameter poisson_ratio;
};

template <>
struct Noun<LoopPush> {
  static constexpr const char *name = "ExploredPush", *about = "One push of `explore`, and what stood after it.";
  static void fields(auto&& field) {
    field("name", &LoopPush::name, "");
    field("plan", &LoopPush::plan, "with what was promised for after it");
    field("report", &LoopPush::report, "");
    field("young_moduli", &LoopPush::young_moduli, "of every region, or one; from all pushes so far");
    field("poisson_ratio", &LoopPush::poisson_ratio, "");
  }
};

struct Loop {
  Recording recording;
  Identified found;
  std::vector<LoopPush> pushes;
  int fruitless = 0;
  bool reached = false;
  std::string message;
};

template <>
struct Noun<Loop> {
  static constexpr const char *name = "Explored", *about = "What `explore` did and found.";
  static void fields(auto&& field) {
    field("recording", &Loop::recording, "");
    field("found", &Loop::found, "");
    field("pushes", &Loop::pushes, "");
    field("fruitless", &Loop::fruitless, "pushes that found nothing to press on");
    field("reached", &Loop::reached, "the intervals are as narrow as was asked for, and no verdict says that they are not to be believed");
    field("message", &Loop::message, "why it ended");
  }
};

py::object push_with(const py::object& robot, const py::object& scene, const py::dict& options, const py::object& on_step, const py::object& progress);
py::object explore_with(const py::object& robot, const py::object& scene, const py::object& folder, const py::dict& options, const py::object& on_step,
                        const py::object& on_push, const py::object& progress);
py::object look_around_with(const py::object& robot, int views);

}  // namespace palpate::python
