// SPDX-License-Identifier: Apache-2.0
// Before any Young's modulus is believed: pushes on a body whose answer is known, a spring of known stiffness or a rigid
// block, tell how far force scale, compliance of stick and arm, and the camera's place against the robot are off.
//
//   force on the body      f = (reading - tare) / (1 + scale error)
//   encoder's travel       f (1 / k + c) + zero
//   surface                moves by f / k along the push, as one piece, seen through a camera that stands elsewhere than
//   stated first touch            the tip then lies on the body's surface
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/estimation/fit.hpp"

namespace palpate::estimation {

struct SelfCheckOptions {
  std::optional<double> stiffness_n_per_m;  ///< of the spring, along every push; nothing: the block is rigid
  double stiffness_relative_std = 0.002;    ///< how well that is known
  double placed_std_m = 0,
         placed_std_rad = 0;  ///< of the body in the robot's base frame (0: where the recording says, exactly)
  double touch_std_m = 5e-4;  ///< of the tip at first contact, along the push
  // Wide: the check has to find errors that nobody stated.
  double hand_eye_std_m = 0.05, hand_eye_std_rad = 0.1;
  double force_scale_std = 0.5;
  double compliance_std_m_per_n = 1e-2;
  int max_iterations = 40;
};

/// One error: found, with its interval, against what the recording states.
struct CheckedError {
  /// force_scale, compliance, hand_eye_x ..., hand_eye_rotation_x ... (about the body's middle, SelfCheck::pivot_m), depth_bias,
  /// force_tare[push]
  std::string name;
  std::string unit;
  double value = 0, std = 0, lower_95 = 0, upper_95 = 0;
  double stated_std = 0;    ///< of the recording; 0: it was taken as exact
  bool determined = false;  ///< false: these pushes say nothing of it
  bool consistent = true;   ///< within three standard deviations of statement and check together
};

struct SelfCheck {
  std::vector<CheckedError> errors;
  std::vector<Verdict> verdicts;  ///< what is not consistent, with cures; empty: believe the calibration
  double chi2_per_dof = 0;
  double travel_rms_m = 0, depth_rms_m = 0;  ///< residuals
  std::size_t travels = 0, rays = 0, touches = 0;
  std::size_t rays_given = 0, touches_missed = 0;  ///< with those that pass the body by, or end elsewhere
  Vec3 pivot_m = Vec3::Zero();  ///< the middle of the body's vertices, base frame: hand_eye turns about it
  /// From where the camera is said to stand to where it stands: T_base_camera = hand_eye_correction * T_base_camera as stated.
  Pose hand_eye_correction = Pose::Identity();
  bool converged = false;
  std::string message;
};

/// @param recording  pushes with measured forces and read travels on the body; rest surface = the body in the base frame
/// @param body       its surface at rest
/// @param inputs     one list a step (rays are used)
/// @throws Error when no push carries a force and a travel, or options are out of range.
SelfCheck self_check(const Recording& recording, const TriMesh& body, const Inputs& inputs,
                     const SelfCheckOptions& options = {});

}  // namespace palpate::estimation
