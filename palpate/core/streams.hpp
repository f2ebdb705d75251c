// SPDX-License-Identifier: Apache-2.0
// What sensors said while somebody else's recorder ran: one series a sensor, each by its own clock, not yet cut into pushes
// and steps. And the plan by which `acquisition` cuts them.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"

namespace palpate {

struct PoseSample {
  double time_s = 0;
  Pose T_parent_child = Pose::Identity();
};

/// One edge of the tree of frames.
struct FrameLink {
  std::string parent, child;
  bool is_fixed = false;            ///< holds at all times
  std::vector<PoseSample> samples;  ///< times rise
};

struct JointSample {
  double time_s = 0;
  std::vector<double> positions;  ///< radians or metres, in the order of SensorStreams::joint_names
};

struct WrenchSample {
  double time_s = 0;
  Vec3 force_n = Vec3::Zero();  ///< in the sensor's frame
  Vec3 torque_nm = Vec3::Zero();
};

struct MarkSample {
  double time_s = 0;
  std::string text;
};

/// Images of one camera. They are unpacked when they are asked for: most of them never are.
struct DepthStream {
  std::string name;   ///< for messages
  std::string frame;  ///< optical frame of the camera
  DepthFrame like;    ///< camera, noise and pose priors of every image
  std::optional<bool> mask_robot;  ///< absent: where the robot is described and its pose is known
  std::vector<double> times_s;                   ///< rise
  std::function<DepthImage(std::size_t)> image;  ///< @throws Error when the message is damaged
  std::function<MaskImage(std::size_t)> mask;    ///< absent, or of the image of that number; an empty mask is none
};

struct CloudStream {
  std::string name, frame;
  double sigma_m = std::numeric_limits<double>::quiet_NaN();
  double pose_std_m = 0, pose_std_rad = 0;
  std::optional<bool> mask_robot;  ///< absent: where the robot is described and its pose is known
  std::vector<double> times_s;
  std::function<PointCloud(std::size_t)> cloud;  ///< in `frame`
};

struct SensorStreams {
  std::vector<FrameLink> frames;
  std::vector<std::string> joint_names;
  std::vector<JointSample> joints;
  std::string wrench_frame;
  std::vector<WrenchSample> wrenches;
  std::vector<DepthStream> cameras;
  std::vector<CloudStream> clouds;
  std::vector<MarkSample> marks;
  double end_s = 0;  ///< of the last sample; the first is at 0
  std::vector<std::string> warnings;
};

/// An offset between two clocks: given, or to be estimated.
struct ClockPlan {
  bool estimate = false;
  double offset_s = 0;  ///< added to the sensor's times to get those of the arm
};

struct PlannedPush {
  std::string name, site, tool;
  std::string where;  ///< file, line and field, for messages
  std::optional<Vec3> contact_m;  ///< not given: the tip where the force first rose
  std::optional<Vec3> direction;  ///< not given: z of the tip's frame
  double force_tare_std_n = 0, travel_offset_std_m = 0, contact_std_m = 0;
  std::vector<double> travel_sigma_m;  ///< empty: the travel is no observation; one number, or one a loaded step
  std::optional<double> force_std_n;   ///< not given: standard error of the mean over the window
  double force_relative_std = 0;
  std::vector<double> at_s;  ///< StepsBy::times
};

enum class StepsBy {
  times,      ///< PlannedPush::at_s
  marks,      ///< a message a step
  detection,  ///< where the tool stands still in contact and the force has settled
};
enum class Tare {
  none,            ///< the sensor was tared
  before_contact,  ///< mean over `tare_s` before each push
  between,         ///< mean over a given time
};

/// How streams become a recording. Everything of the object stands in `recording`, which has no pushes yet.
struct StreamPlan {
  Recording recording;
  std::string base_frame, tip_frame, wrench_frame;  ///< wrench_frame: empty = what the messages say
  std::string base_where, tip_where;                ///< file, line and field, for messages
  ClockPlan camera_clock, wrench_clock;
  double largest_offset_s = 0.5;  ///< searched on both sides of zero

  bool force_on_object = false;  ///< false: the sensor reports what the tool's side does to it
  Tare tare = Tare::before_contact;
  double tare_s = 1.0, tare_from_s = 0, tare_to_s = 0;
  double tool_mass_kg = 0;  ///< beyond the sensor; 0 = its weight is left to the tare
  Vec3 tool_centre_m = Vec3::Zero();
  Vec3 gravity_m_s2 = Vec3(0, 0, -9.81);

  std::vector<double> views_at_s;  ///< images of the object untouched, when they were taken: its rest views
  std::string views_where;         ///< file, line and field, for messages

  StepsBy steps_by = StepsBy::detection;
  double window_s = 0.5;             ///< over which the force of a step is averaged, before its time
  double image_gap_s = 0.5;          ///< an image belongs to a step when it is nearer than this
  double contact_threshold_n = 0.3;  ///< along the push
  double still_m_s = 0.001;          ///< the tip stands still below this speed ...
  double hold_s = 1.0;               ///< ... for at least so long
  PlannedPush any_push;              ///< of a push that `pushes` does not describe
  std::vector<PlannedPush> pushes;   ///< by number (detection), by name (marks)
  std::string source;                ///< file, for messages
};

}  // namespace palpate
