// SPDX-License-Identifier: Apache-2.0
#include "palpate/sensing/arm_reach.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/sensing/reach.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::sensing {
namespace {

constexpr double tool_within_m = 5e-3, lever_m = 0.1;  // lever: what a turn of the tool is worth
constexpr double through_m = 5e-3;

/// Any pose with this z axis.
Pose pose_along(const Vec3& point_m, const Vec3& direction) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), direction).toRotationMatrix();
  pose.translation() = point_m;
  return pose;
}

struct Touch {
  std::vector<Pose> link_poses;
  Vec3 tip_m, direction;
};

std::vector<Touch> touches_of(const Kinematics& kinematics, const Recording& recording, std::vector<double>& first_joints) {
  std::vector<Touch> touches;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps) {
      if (step.loads.size() != 1 || step.joints_rad.empty()) continue;
      const Load& load = step.loads[0];
      double travel_m = load.travel_m.value_or(0);
      for (const Observation& seen : step.observations)
        if (const auto* encoder = std::get_if<ToolTravel>(&seen)) travel_m = encoder->travel_m;
      touches.push_back({kinematics.link_poses(recording.joint_names, step.joints_rad),
                         load.contact_m + travel_m * load.direction, load.direction});
      if (!first_joints.empty()) continue;
      for (const std::string& name : kinematics.free_joints()) {
        const auto at = std::find(recording.joint_names.begin(), recording.joint_names.end(), name);
        first_joints.push_back(step.joints_rad[static_cast<std::size_t>(at - recording.joint_names.begin())]);
      }
    }
  return touches;
}

/// The tool as fixed to one link, and how badly that fits.
MountedTool on_link(const std::vector<Touch>& touches, std::size_t link) {
  Vec3 mean_m = Vec3::Zero(), axis = Vec3::Zero();
  for (const Touch& touch : touches) {
    const Pose T_link_root = touch.link_poses[link].inverse();
    mean_m += T_link_root * touch.tip_m / static_cast<double>(touches.size());
    axis += T_link_root.linear() * touch.direction / static_cast<double>(touches.size());
  }
  double squares = 0;
  for (const Touch& touch : touches) {
    const Pose T_link_root = touch.link_poses[link].inverse();
    squares += (T_link_root * touch.tip_m - mean_m).squaredNorm() +
               lever_m * lever_m * (T_link_root.linear() * touch.direction - axis).squaredNorm();
  }
  MountedTool tool;
  tool.spread_m = std::sqrt(squares / static_cast<double>(touches.size()));
  if (axis.norm() > 0.1) tool.T_link_tip = pose_along(mean_m, axis.normalized());
  return tool;
}

}  // namespace

std::optional<MountedTool> find_tool(const Kinematics& kinematics, const Recording& recording) {
  std::vector<double> joints;
  const std::vector<Touch> touches = touches_of(kinematics, recording, joints);
  if (touches.size() < 2) return std::nullopt;
  const double of_a_fixed_point_m = on_link(touches, static_cast<std::size_t>(kinematics.root_link())).spread_m;
  std::optional<MountedTool> best;
  for (std::size_t l = 0; l < kinematics.robot().links.size(); ++l) {
    MountedTool tool = on_link(touches, l);
    if (best && tool.spread_m >= best->spread_m) continue;
    tool.link = kinematics.robot().links[l].name;
    tool.joints = joints;
    best = std::move(tool);
  }
  if (best->spread_m > std::min(tool_within_m, of_a_fixed_point_m / 3)) return std::nullopt;
  return best;
}

struct ArmReach::Impl {
  struct Moving {
    std::size_t link;
    Points vertices_m;
  };

  Kinematics kinematics;
  Index link;
  Pose T_link_tip;
  std::vector<double> start;
  std::vector<Plane> planes;
  std::vector<Moving> moving;

  bool clear_of_planes(const std::vector<double>& joints) const {
    const auto poses = kinematics.link_poses(kinematics.free_joints(), joints);
    for (const Moving& part : moving)
      for (const Plane& plane : planes) {
        const Vec3 normal = poses[part.link].linear().transpose() * plane.normal;
        const double origin_m = plane.normal.dot(poses[part.link].translation() - plane.point_m);
        if (((part.vertices_m * normal).array() + origin_m).minCoeff() < -through_m) return false;
      }
    return true;
  }
};

ArmReach::ArmReach(const RobotModel& robot, const MountedTool& tool, std::vector<Plane> planes) {
  Kinematics kinematics(robot);
  const Index link = kinematics.link(tool.link);
  impl_ = std::make_unique<Impl>(Impl{std::move(kinematics), link, tool.T_link_tip, tool.joints, std::move(planes), {}});
  Impl& arm = *impl_;
  const auto& joints = arm.kinematics.free_joints();
  if (arm.start.size() != joints.size()) arm.start.assign(joints.size(), 0.0);
  for (std::size_t k = 0; k < joints.size(); ++k)
    for (const RobotJoint& joint : robot.joints)
      if (joint.name == joints[k] && joint.kind != RobotJoint::Kind::continuous)
        arm.start[k] = std::clamp(arm.start[k], joint.lower, joint.upper);

  // What stands still may stand on the table, or reach below it.
  const auto rest = arm.kinematics.link_poses(joints, arm.start);
  std::vector<double> elsewhere = arm.start;
  for (double& q : elsewhere) q += 0.1;
  const auto moved = arm.kinematics.link_poses(joints, elsewhere);
  for (std::size_t l = 0; l < robot.links.size(); ++l) {
    if (rest[l].isApprox(moved[l], 1e-9)) continue;
    const auto& shapes = robot.links[l].collision.empty() ? robot.links[l].visual : robot.links[l].collision;
    for (const RobotShape& shape : shapes) {
      const Points vertices = shape_mesh(shape).vertices_m;
      Impl::Moving part{l, vertices};
      for (Index v = 0; v < vertices.rows(); ++v)
        part.vertices_m.row(v) = shape.T_link_shape * Vec3(vertices.row(v).transpose());
      arm.moving.push_back(std::move(part));
    }
  }
}
ArmReach::~ArmReach() = default;

bool ArmReach::reaches(const Vec3& contact_m, const Vec3& direction, double before_m, double beyond_m) const {
  const Impl& arm = *impl_;
  ReachOptions from_here;
  from_here.T_link_tip = arm.T_link_tip;
  from_here.position_tolerance_m = from_here.angle_tolerance_rad = 1e-4;
  from_here.starts = 1;
  ReachOptions anyhow = from_here;
  anyhow.starts = ReachOptions().starts;
  anyhow.accept = [&](const std::vector<double>& in_front) {
    if (!arm.clear_of_planes(in_front)) return false;
    std::vector<double> joints = in_front;
    for (const double at_m : {0.0, beyond_m}) {
      const auto next = reach(arm.kinematics, arm.link, pose_along(contact_m + at_m * direction, direction), joints, from_here);
      if (!next || !arm.clear_of_planes(*next)) return false;
      joints = *next;
    }
    return true;
  };
  return reach(arm.kinematics, arm.link, pose_along(contact_m - before_m * direction, direction), arm.start, anyhow).has_value();
}

}  // namespace palpate::sensing
