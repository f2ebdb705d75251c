// SPDX-License-Identifier: Apache-2.0
// A robot made of software: the lab's arm presses an object of the lab, with encoders, wrist sensor and depth camera that err
// as real ones do. It implements the interface that a driver of a real arm implements. Seeded and repeatable.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "palpate/acquisition/push_protocol.hpp"
#include "palpate/acquisition/robot.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/lab/depth_sensor.hpp"
#include "palpate/lab/force_sensor.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/lab/pressed_block.hpp"

namespace palpate::lab {

struct LabOptions {
  std::uint64_t seed = 1;
  PressedBlockOptions object;                                  ///< the truth where no object is given: a cube
  double joint_std_rad = 0.02 * 3.14159265358979323846 / 180;  ///< repeat accuracy of the modules, new with each motion
  Pose T_base_arm = Pose::Identity();  ///< where the arm stands, in the frame of the recording
  ForceSensorOptions force;           ///< at the wrist, with the hand's axes
  double relaxation = 0.05;           ///< share of a force's increase that fades after each motion ...
  double relaxation_s = 0.4;          ///< ... with this time constant
  double slip_at_m = 1e9;             ///< travel at which the tip slides off sideways by 5 mm
  double compliance_m_per_n = 0;      ///< of stick and arm: the tip stays behind the encoders by this times the force
  std::optional<double> stated_compliance_m_per_n;  ///< what the recording says of it; not given: the truth
  double stated_compliance_std_m_per_n = 0;         ///< and how well it is said to be known
  /// Sideways force at which the object starts to slide on the table; it then moves with the push, at this force, and stays
  /// where it was pushed to (Coulomb friction; without turning, and the tip keeps its place on the object).
  double slides_at_n = 1e9;
  std::optional<Pose> T_base_camera;  ///< a camera that stands; not given: one that looks at the object from the side
  bool camera_on_hand = false;        ///< one that the hand carries: it stands where the joints say, and they err
  double camera_std_m = 0.0005;       ///< error of that pose (of the mount on the hand), drawn once and stated with every image ...
  double camera_std_rad = 0.0005;     ///< ... and of its rotation
  DepthSensorOptions depth;           ///< its `looks` follow from the three below
  Look table{0.5, 1}, arm{0.4, 0.5};  ///< to a camera; the object has its own
};

/// @throws Error naming the option that is out of range.
void check(const LabOptions& options);

class LabRobot : public acquisition::Robot {
 public:
  explicit LabRobot(const LabOptions& options = {});
  /// Presses this object instead of the options' cube. @throws Error when it has no site, or options are out of range.
  LabRobot(const LabOptions& options, LabObject object);
  ~LabRobot() override;

  acquisition::RobotState read() override;
  /// A tip that meets the object elsewhere than at the site that is pushed stops there, and the force says so.
  acquisition::Motion move(const Pose& T_base_tip, double speed_m_s) override;
  void stop() override {}
  DepthFrame take_depth_image() override;
  void wait(double duration_s) override;
  double travel_sigma_m() const override;
  /// As much force as the sensor can tell: beyond its range the reading stays, however hard the tip presses.
  acquisition::RobotLimits limits() const override;
  void on_the_way(bool is) override;
  /// Of a recording that has so many steps already: what follows errs anew, and not as its beginning did. 0: nothing changes.
  void go_on_after(std::size_t steps);
  /// One image of look_around().
  std::optional<DepthFrame> look(int view, int views) override;

  /// Images of the untouched object from a camera that is carried around it: `views` - 1 on a ring that looks down by a third
  /// of a right angle (half a ring in front of a wall), the last from above. Every pose errs anew by camera_std_m and
  /// camera_std_rad. The arm is out of the way.
  /// @throws Error for less than one view
  std::vector<DepthFrame> look_around(int views) const;
  /// One such image a direction, from where the object is seen under that azimuth (from x towards y) and elevation.
  struct ViewDirection {
    double azimuth_rad = 0, elevation_rad = 0;
  };
  std::vector<DepthFrame> look_from(const std::vector<ViewDirection>& directions) const;

  /// A recording without pushes: object, support, table, tool, robot and priors, as a person would write them down.
  Recording scene() const;
  /// The push at one of the object's sites (the cube has one): the robot then presses there. @throws Error when out of range.
  acquisition::PushPlan plan(std::size_t site = 0);
  /// The push at any other place of the object: it becomes a site of its own. A place that is not quite on the surface, as one that
  /// was found by looking, stays the expected contact; what is pressed is where the push meets the surface.
  acquisition::PushPlan plan_at(const Vec3& contact_m, const Vec3& direction);
  /// Whether the arm gets there, at the contact and where the approach starts.
  bool reaches(const Vec3& contact_m, const Vec3& direction, double start_distance_m = 0.05) const;
  /// What no sensor tells: the force on the object and the travel into it now.
  double true_force_n() const;
  double true_travel_m() const;
  double true_force_scale() const;
  /// As deformed now.
  TriMesh true_surface() const;
  const LabObject& object() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::lab
