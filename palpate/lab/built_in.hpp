// SPDX-License-Identifier: Apache-2.0
// The recording that the program makes by itself: a foam cube on a table, pressed from above with a stick, seen by a depth
// camera. The truth is a Neo-Hookean solid on the lab's own quadratic mesh, which no estimator is given.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/progress.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::lab {

struct DemoOptions {
  std::uint64_t seed = 1;
  std::optional<double> young_modulus_pa;    ///< drawn log-uniformly from 10 to 40 kPa when not given
  std::optional<double> poisson_ratio;       ///< drawn uniformly from 0.1 to 0.45 when not given
  std::string material = "neo_hookean";      ///< of the truth
  double edge_m = 0.15;                      ///< of the cube
  double disc_radius_m = 0.025;              ///< of the soft pad on the stick's tip: uniform pressure
  int levels = 4;                            ///< force levels after the unloaded one
  double depth_m = 0.012;                    ///< about how far the highest force presses the pad in
  std::vector<double> sites_m{-0.02, 0.03};  ///< contacts on the top face, along x from its centre: one push each
  int cells_in_radius = 3;                   ///< resolution of the true object under the pad
  int threads = 2;                           ///< pushes are made side by side; the answer is the same with any number

  // What the sensors do to the truth; each is also stated in the recording, as a prior.
  double force_sigma_n = 0.03;                            ///< noise of one reading, per axis
  double force_tare_std_n = 0.05;                         ///< constant error of a push, per axis
  double force_scale_std = 0.01;                          ///< common scale error
  double travel_sigma_m = 0.00035;                        ///< encoders: 0.02 degrees a joint at a metre
  double travel_offset_std_m = 0.0005;                    ///< when contact was noticed
  double camera_std_m = 0.0005, camera_std_rad = 0.0005;  ///< pose of the camera, per frame
  std::string depth_model = "realsense_d435";
};

/// Kept apart from the recording; nothing that estimates reads it.
struct DemoTruth {
  double young_modulus_pa = 0, poisson_ratio = 0;
  std::string material;
  double force_scale = 1;                              ///< measured = scale * true + tare + noise
  std::vector<Vec3> force_tare_n;                      ///< a push
  std::vector<double> travel_offset_m;                 ///< a push
  std::vector<std::vector<double>> force_n, travel_m;  ///< a push, a step: true force on the object along -z and true travel
  Index nodes = 0, tetrahedra = 0;                     ///< of the largest half model that was solved
};

struct Demo {
  Recording recording;
  DemoTruth truth;
};

/// @throws Error naming the option that is out of range, or when the true object finds no equilibrium under its load.
Demo make_demo(const DemoOptions& options = {}, const OnProgress& on_progress = {});

/// A push of the same cube that no recording holds.
struct DemoPush {
  Vec3 contact_m = Vec3::Zero();  ///< on the top face, base frame; pressed along -z
  double force_n = 0, travel_m = 0;
};
/// What the true cube does there.
/// @param site_m  along x from the middle of its top face  @throws Error as make_demo
DemoPush demo_push(const DemoOptions& options, double young_modulus_pa, double poisson_ratio, double site_m, double force_n);

/// The recording alone.
Recording make_demo_recording(std::uint64_t seed);

}  // namespace palpate::lab
