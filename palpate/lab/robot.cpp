// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/robot.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/robot_parts.hpp"

namespace palpate::lab {
namespace {

// The cube of the options as an object with one site.
LabObject cube_of(const PressedBlockOptions& block) {
  LabObject object;
  object.name = "cube";
  object.description = "a foam cube";
  const Vec3 half(0.5 * block.size_m.x(), 0.5 * block.size_m.y(), 0), up(0, 0, block.size_m.z());
  object.surface = box_surface(block.base_centre_m - half, block.base_centre_m + half + up, 1);
  Support table;
  table.kind = SupportKind::plane;
  table.name = "table";
  table.plane.point_m = block.base_centre_m;
  object.supports.push_back(table);
  object.sites.push_back({"top", block.base_centre_m + Vec3(block.site_m, 0, 0) + up, -Vec3::UnitZ()});
  object.pad_radius_m = block.pad_radius_m;
  object.material = block.material;
  object.young_modulus_pa = block.young_modulus_pa;
  object.poisson_ratio = block.poisson_ratio;
  object.extra = block.extra;
  object.press = [block](const PushSite&) { return std::make_unique<PressedBlock>(block); };
  return object;
}

}  // namespace

void check(const LabOptions& o) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("LabOptions.") + field);
  };
  need(o.joint_std_rad >= 0, "joint_std_rad", "must not be negative");
  need(o.camera_std_m >= 0, "camera_std_m", "must not be negative");
  need(o.camera_std_rad >= 0, "camera_std_rad", "must not be negative");
  need(o.relaxation >= 0 && o.relaxation < 1, "relaxation", "must be in [0, 1)");
  need(o.relaxation_s > 0, "relaxation_s", "must be positive");
  need(o.slip_at_m > 0, "slip_at_m", "must be positive");
  need(o.compliance_m_per_n >= 0, "compliance_m_per_n", "must not be negative");
  need(o.stated_compliance_std_m_per_n >= 0, "stated_compliance_std_m_per_n", "must not be negative");
  need(!o.stated_compliance_m_per_n || *o.stated_compliance_m_per_n >= 0, "stated_compliance_m_per_n", "must not be negative");
  need(o.slides_at_n > 0, "slides_at_n", "must be positive");
  need(!(o.camera_on_hand && o.T_base_camera), "camera_on_hand", "has no place for a camera that stands (T_base_camera)");
  need(o.T_base_arm.matrix().allFinite(), "T_base_arm", "must be finite");
  check(o.force);
  check(o.depth);
}

LabRobot::LabRobot(const LabOptions& options) : LabRobot(options, cube_of(options.object)) {}
LabRobot::LabRobot(const LabOptions& options, LabObject object) {
  check(options);
  impl_ = std::make_unique<Impl>(options, std::move(object));
}
LabRobot::~LabRobot() = default;

acquisition::RobotState LabRobot::read() {
  Impl& lab = *impl_;
  acquisition::RobotState state;
  state.time_s = lab.clock_s;
  state.joints_rad = lab.commanded;
  state.T_base_tip = lab.tip_of(lab.commanded);
  if (lab.slipped()) state.T_base_tip.translation() += Impl::slid_off_m * state.T_base_tip.linear().col(1);
  const double steady = lab.force();
  const double fading = steady > 0 ? lab.fading_n * std::exp(-(lab.clock_s - lab.moved_s) / lab.options.relaxation_s) : 0;
  const Pose stands = lab.pose_of(lab.hand, lab.true_joints), said = lab.pose_of(lab.hand, lab.commanded);
  const Vec3 pressed_n = (steady + fading) * lab.site().direction, acts_m = lab.force_acts_at_m(), met_n = lab.met_n();
  Random& noise = lab.on_the_way ? lab.way_force_random : lab.force_random;
  state.force_n = said.linear() * lab.wrist->read(pressed_n + met_n, stands.linear(), lab.clock_s, noise);
  // About the tip, as a driver reckons it from what joints and sensor say.
  const Vec3 true_nm = (acts_m - stands.translation()).cross(pressed_n) +
                       (lab.tip_of(lab.true_joints).translation() - stands.translation()).cross(met_n);
  const Vec3 at_wrist_nm = said.linear() * lab.wrist->read_torque(true_nm, pressed_n + met_n, stands.linear(), lab.clock_s,
                                                                 lab.on_the_way ? lab.way_force_random : lab.torque_random);
  state.torque_nm = at_wrist_nm - (state.T_base_tip.translation() - said.translation()).cross(state.force_n);
  return state;
}

acquisition::Motion LabRobot::move(const Pose& T_base_tip, double speed_m_s) {
  Impl& lab = *impl_;
  if (!(speed_m_s > 0)) throw Error("must be positive", "speed_m_s");
  const auto reached = [&](const Pose& pose) { return lab.reached(pose, lab.on_the_way ? lab.commanded : lab.moved_to); };
  auto joints = reached(T_base_tip);
  if (!joints) return acquisition::Motion::refused;
  const double before = lab.force();
  const Pose from = lab.tip_of(lab.commanded);
  const Vec3 truly_from_m = lab.tip_of(lab.true_joints).translation();
  std::vector<double> errors_rad;
  for (std::size_t i = 0; i < joints->size(); ++i)
    errors_rad.push_back(lab.options.joint_std_rad * (lab.on_the_way ? lab.way_joint_random : lab.joint_random).normal());
  const auto come_to = [&](const std::vector<double>& there) {
    lab.commanded = lab.true_joints = there;
    for (std::size_t i = 0; i < there.size(); ++i) lab.true_joints[i] += errors_rad[i];
  };
  come_to(*joints);
  const double share = lab.goes_as_far_as(truly_from_m, lab.tip_of(lab.true_joints).translation());
  if (share < 1) {  // it stands against the object
    Pose stopped = T_base_tip;
    stopped.translation() = from.translation() + share * (T_base_tip.translation() - from.translation());
    if (const auto nearer = reached(stopped)) come_to(*nearer);
  }
  if (!lab.on_the_way) lab.moved_to = lab.commanded;
  lab.clock_s += share * (T_base_tip.translation() - from.translation()).norm() / speed_m_s;
  lab.slide();
  lab.moved_s = lab.clock_s;
  lab.fading_n = lab.options.relaxation * std::max(0.0, lab.force() - before);
  return acquisition::Motion::done;
}

void LabRobot::go_on_after(std::size_t steps) {
  Impl& lab = *impl_;
  if (steps == 0) return;
  const auto of = [&](std::uint64_t stream) { return Random(lab.options.seed, stream + 16 * std::uint64_t(steps)); };
  lab.joint_random = of(1);
  lab.force_random = of(2);
  lab.depth_random = of(3);
  lab.torque_random = of(7);
  lab.way_joint_random = of(8);
  lab.way_force_random = of(9);
}

void LabRobot::on_the_way(bool is) { impl_->on_the_way = is; }
void LabRobot::wait(double duration_s) { impl_->clock_s += duration_s; }

double LabRobot::travel_sigma_m() const {
  const Impl& lab = *impl_;
  const auto poses = lab.mask.kinematics().link_poses(lab.mask.kinematics().free_joints(), lab.commanded);
  const Vec3& along = lab.site().direction;
  const Mat3 covariance = lab.mask.kinematics().position_covariance_m2(poses, lab.tip, Vec3::Zero(), lab.options.joint_std_rad);
  return std::max(1e-5, std::sqrt(along.dot(covariance * along)));
}

acquisition::RobotLimits LabRobot::limits() const {
  acquisition::RobotLimits limits;
  limits.force_n = readable_along_n(impl_->options.force);  // the stick is straight: a push is along the hand
  return limits;
}

Recording LabRobot::scene() const {
  const Impl& lab = *impl_;
  Recording recording;
  recording.name = lab.object.name;
  recording.description = "Simulated: palpate's software arm presses " + lab.object.description +
                          (lab.object.punch ? " with a stiff round face" : " with a round soft pad");
  recording.rest.surface = lab.object.surface;
  recording.rest.state = lab.object.state;
  recording.supports = lab.object.supports;
  for (const TrueRegion& one : lab.object.regions) recording.regions.push_back(one.region);
  recording.environment.planes = lab.planes;
  recording.force_scale_std = lab.options.force.scale_std;
  recording.force_cross_talk_std = lab.options.force.cross_talk_std;
  Tool pad;
  pad.name = "stick";
  pad.shape = ToolShape::disc;
  pad.radius_m = lab.object.pad_radius_m;
  if (lab.object.punch) {
    pad.pressure = Pressure::punch;
    pad.contact = ContactLaw::frictionless;
  }
  pad.compliance_m_per_n = lab.options.stated_compliance_m_per_n.value_or(lab.options.compliance_m_per_n);
  pad.compliance_std_m_per_n = lab.options.stated_compliance_std_m_per_n;
  recording.tools.push_back(pad);
  recording.joint_names = lab.mask.kinematics().free_joints();
  recording.robot = lab.mask.kinematics().robot();
  recording.model.material = lab.object.material;
  return recording;
}

acquisition::PushPlan LabRobot::plan(std::size_t site) {
  Impl& lab = *impl_;
  if (site >= lab.object.sites.size())
    throw Error("the object has " + std::to_string(lab.object.sites.size()) + " sites", "site " + std::to_string(site));
  lab.active = site;
  acquisition::PushPlan plan;
  plan.name = "push " + std::to_string(site + 1);
  plan.site = lab.site().name;
  plan.tool = "stick";
  plan.contact_m = lab.site().contact_m;
  plan.direction = lab.site().direction;
  plan.R_base_tip = acquisition::tip_along(plan.direction);
  plan.around = acquisition::keep_out(lab.object.surface.vertices_m, lab.planes);
  return plan;
}

acquisition::PushPlan LabRobot::plan_at(const Vec3& contact_m, const Vec3& direction) {
  Impl& lab = *impl_;
  const auto& sites = lab.object.sites;
  const Vec3 met_m = lab.where_it_meets(contact_m, direction);
  std::size_t site = 0;
  const auto is_there = [&](const PushSite& one) {
    return (one.contact_m - met_m).norm() < 1e-9 && (one.direction - direction).norm() < 1e-9;
  };
  while (site < sites.size() && !is_there(sites[site])) ++site;
  if (site == sites.size()) {
    lab.object.sites.push_back({"place " + std::to_string(site + 1), met_m, direction});
    lab.curves.emplace_back();
  }
  acquisition::PushPlan there = plan(site);
  there.contact_m = contact_m;
  return there;
}

bool LabRobot::reaches(const Vec3& contact_m, const Vec3& direction, double start_distance_m) const {
  const Impl& lab = *impl_;
  Pose pose = Pose::Identity();
  pose.linear() = acquisition::tip_along(direction);
  std::vector<double> joints = lab.commanded;
  for (const double before_m : {start_distance_m, 0.0}) {
    pose.translation() = contact_m - before_m * direction;
    const auto found = sensing::reach(lab.mask.kinematics(), lab.tip, pose, joints);
    if (!found) return false;
    joints = *found;
  }
  return true;
}

double LabRobot::true_force_n() const { return impl_->force(); }
double LabRobot::true_travel_m() const { return std::max(0.0, impl_->travel()); }
TriMesh LabRobot::true_surface() const { return impl_->shape(); }
double LabRobot::true_force_scale() const { return impl_->wrist->scale(); }
const LabObject& LabRobot::object() const { return impl_->object; }

}  // namespace palpate::lab
