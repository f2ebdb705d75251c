// SPDX-License-Identifier: Apache-2.0
// `palpate.check`: the rig before the object, as `palpate check` of the program.
#pragma once

#include "palpate/estimation/self_check.hpp"
#include "python/nouns_answer.hpp"

namespace palpate::python {

template <>
struct Noun<estimation::CheckedError> {
  using Found = estimation::CheckedError;
  static constexpr const char *name = "CheckedError", *about = "One error of the rig, against what the recording states of it.";
  static void fields(auto&& field) {
    field("name", &Found::name, "'force_scale', 'compliance', 'hand_eye_x', 'hand_eye_rotation_x', ..., 'depth_bias', 'force_tare[PUSH]'");
    field("unit", &Found::unit, "'1' is a share");
    field("value", &Found::value, "as it was found; compliance: beyond what is stated");
    field("std", &Found::std, "");
    field("lower_95", &Found::lower_95, "");
    field("upper_95", &Found::upper_95, "");
    field("stated_std", &Found::stated_std, "by the recording; 0: as exact");
    field("determined", &Found::determined, "False: these pushes say nothing of it");
    field("consistent", &Found::consistent, "within three standard deviations of statement and check together");
  }
};

/// What was found, and whether all of it agrees with the recording.
struct RigCheck : estimation::SelfCheck {
  bool consistent = false;
};

template <>
struct Noun<RigCheck> {
  static constexpr const char *name = "SelfCheck", *about = "What pushes on a known body say of force, arm and camera (docs/how-to-push.md).";
  static void fields(auto&& field) {
    field("consistent", &RigCheck::consistent, "what these pushes determine is as the recording states, and the body fits; `determined` of errors says what they leave open");
    field("errors", &RigCheck::errors, "");
    field("verdicts", &RigCheck::verdicts, "what is not consistent or not determined, with cures");
    field("chi2_per_dof", &RigCheck::chi2_per_dof, "near 1 where noise is as stated");
    field("travel_rms_m", &RigCheck::travel_rms_m, "of what is left of travels");
    field("depth_rms_m", &RigCheck::depth_rms_m, "of what is left along the rays");
    field("travels", &RigCheck::travels, "that were compared");
    field("rays", &RigCheck::rays, "that end on the body; 0: nothing is known of the camera");
    field("touches", &RigCheck::touches, "first touches that meet the body");
    field("rays_given", &RigCheck::rays_given, "with those that pass the body by, or end elsewhere");
    field("touches_missed", &RigCheck::touches_missed, "");
    field("pivot_m", &RigCheck::pivot_m, "the body's middle, base frame: hand_eye turns about it");
    field("hand_eye_correction", &RigCheck::hand_eye_correction, "the camera stands at hand_eye_correction @ T_base_camera as stated");
    field("converged", &RigCheck::converged, "");
    field("message", &RigCheck::message, "why not");
  }
};

py::object check_with(const py::object& recording, const py::dict& options);

}  // namespace palpate::python
