// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/robot.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/arm.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/scene.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::lab {
namespace {

Mat3 downwards() {
  Mat3 rotation;
  rotation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return rotation;
}

ArmOptions arm_with_pad(double pad_radius_m) {
  ArmOptions options;
  options.pad_radius_m = pad_radius_m;
  return options;
}

// Equilibria at rising forces, solved when they are first needed; between two of them everything is interpolated.
class ForceCurve {
 public:
  explicit ForceCurve(const PressedBlockOptions& options)
      : block_(options), step_n_(0.06 * options.young_modulus_pa * options.pad_radius_m * options.pad_radius_m * M_PI / 2) {
    forces_.push_back(0);
    travels_.push_back(0);
    surfaces_.push_back(block_.surface());
  }

  struct Place {
    std::size_t below = 0;
    double share = 0;
  };
  Place at(double travel_m) {
    while (travels_.back() < travel_m) {
      block_.press(forces_.back() + step_n_);
      forces_.push_back(block_.force_n());
      travels_.push_back(block_.travel_m());
      surfaces_.push_back(block_.surface());
    }
    if (travel_m <= 0) return {};
    std::size_t k = 1;
    while (travels_[k] < travel_m) ++k;
    return {k - 1, (travel_m - travels_[k - 1]) / (travels_[k] - travels_[k - 1])};
  }
  double force_n(const Place& p) const {
    return p.share == 0 ? forces_[p.below] : (1 - p.share) * forces_[p.below] + p.share * forces_[p.below + 1];
  }
  TriMesh surface(const Place& p) const {
    TriMesh mesh = surfaces_[p.below];
    if (p.share > 0) mesh.vertices_m = (1 - p.share) * mesh.vertices_m + p.share * surfaces_[p.below + 1].vertices_m;
    return mesh;
  }

 private:
  PressedBlock block_;
  double step_n_;
  std::vector<double> forces_, travels_;
  std::vector<TriMesh> surfaces_;
};

}  // namespace

void check(const LabOptions& o) {
  const auto need = [](bool good, const char* field, const char* rule) {
    if (!good) throw Error(rule, std::string("LabOptions.") + field);
  };
  need(o.joint_std_rad >= 0, "joint_std_rad", "must not be negative");
  need(o.force_sigma_n >= 0, "force_sigma_n", "must not be negative");
  need(o.force_unit_n >= 0, "force_unit_n", "must not be negative");
  need(o.force_bias_n >= 0, "force_bias_n", "must not be negative");
  need(o.force_drift_n_s >= 0, "force_drift_n_s", "must not be negative");
  need(o.relaxation >= 0 && o.relaxation < 1, "relaxation", "must be in [0, 1)");
  need(o.relaxation_s > 0, "relaxation_s", "must be positive");
  check(o.depth);
}

struct LabRobot::Impl {
  explicit Impl(const LabOptions& given)
      : options(given),
        mask(arm(arm_with_pad(given.object.pad_radius_m))),
        tip(mask.kinematics().link("tip")),
        curve(given.object),
        joint_random(given.seed, 1),
        force_random(given.seed, 2),
        depth_random(given.seed, 3) {
    Random once(options.seed, 0);
    bias_n = options.force_bias_n * once.normal3();
    drift_n_s = options.force_drift_n_s * once.normal3();
    commanded = true_joints = {0, 0.3, 1.2, 0, 1.6, 0, 0.05};
    for (std::size_t i = 0; i < mask.kinematics().robot().links.size(); ++i)
      for (const RobotShape& shape : mask.kinematics().robot().links[i].visual) {
        TriMesh mesh = sensing::shape_mesh(shape);
        for (Eigen::Index v = 0; v < mesh.vertices_m.rows(); ++v)
          mesh.vertices_m.row(v) = shape.T_link_shape * Vec3(mesh.vertices_m.row(v));
        bodies.emplace_back(i, std::move(mesh));
      }
    camera.width_px = 640;
    camera.height_px = 480;
    camera.fx_px = camera.fy_px = 606;
    camera.cx_px = 322.4;
    camera.cy_px = 238.1;
    const Vec3& base = options.object.base_centre_m;
    T_base_camera = options.T_base_camera.value_or(
        look_at(base + Vec3(-0.20, -0.42, 0.42), base + Vec3(0, 0, 0.55 * options.object.edge_m)));
  }

  Pose tip_of(const std::vector<double>& joints) const {
    return mask.kinematics().link_poses(mask.kinematics().free_joints(), joints)[std::size_t(tip)];
  }
  // The pad's face is level with the top of the untouched cube at travel 0.
  double travel() const {
    const Pose pose = tip_of(true_joints);
    const Vec3 offset = pose.translation() - options.object.base_centre_m;
    const bool above = std::abs(offset.x() - options.object.site_m) < 0.01 && std::abs(offset.y()) < 0.01;
    return above ? options.object.edge_m - offset.z() : 0;
  }
  bool slipped() const { return travel() > options.slip_at_m; }
  double force() {
    const double steady = slipped() ? 0.4 * curve.force_n(curve.at(travel())) : curve.force_n(curve.at(travel()));
    return steady;
  }

  LabOptions options;
  sensing::RobotMask mask;
  Index tip;
  ForceCurve curve;
  Random joint_random, force_random, depth_random;
  Vec3 bias_n, drift_n_s;
  std::vector<double> commanded, true_joints;
  std::vector<std::pair<std::size_t, TriMesh>> bodies;  // link, mesh in its frame
  Camera camera;
  Pose T_base_camera;
  double clock_s = 0, moved_s = -1e3, fading_n = 0;
};

LabRobot::LabRobot(const LabOptions& options) {
  check(options);
  impl_ = std::make_unique<Impl>(options);
}
LabRobot::~LabRobot() = default;

acquisition::RobotState LabRobot::read() {
  Impl& lab = *impl_;
  acquisition::RobotState state;
  state.time_s = lab.clock_s;
  state.joints_rad = lab.commanded;
  state.T_base_tip = lab.tip_of(lab.commanded);
  if (lab.slipped()) state.T_base_tip.translation() += Vec3(0, 0.005, 0);
  const double steady = lab.force();
  const double fading = steady > 0 ? lab.fading_n * std::exp(-(lab.clock_s - lab.moved_s) / lab.options.relaxation_s) : 0;
  Vec3 force = lab.bias_n + lab.drift_n_s * lab.clock_s + Vec3(0, 0, -steady - fading) +
               lab.options.force_sigma_n * lab.force_random.normal3();
  if (lab.options.force_unit_n > 0)
    for (int k = 0; k < 3; ++k) force(k) = lab.options.force_unit_n * std::round(force(k) / lab.options.force_unit_n);
  state.force_n = force;
  return state;
}

acquisition::Motion LabRobot::move(const Pose& T_base_tip, double speed_m_s) {
  Impl& lab = *impl_;
  if (!(speed_m_s > 0)) throw Error("must be positive", "speed_m_s");
  const auto joints = reach(lab.mask.kinematics(), lab.tip, T_base_tip, lab.commanded);
  if (!joints) return acquisition::Motion::refused;
  const double before = lab.force();
  lab.clock_s += (T_base_tip.translation() - lab.tip_of(lab.commanded).translation()).norm() / speed_m_s;
  lab.commanded = *joints;
  lab.true_joints = *joints;
  for (double& q : lab.true_joints) q += lab.options.joint_std_rad * lab.joint_random.normal();
  lab.moved_s = lab.clock_s;
  lab.fading_n = lab.options.relaxation * std::max(0.0, lab.force() - before);
  return acquisition::Motion::done;
}

void LabRobot::wait(double duration_s) { impl_->clock_s += duration_s; }

double LabRobot::travel_sigma_m() const {
  const Impl& lab = *impl_;
  const auto poses = lab.mask.kinematics().link_poses(lab.mask.kinematics().free_joints(), lab.commanded);
  // Of the three axes' sum, about the part along the push; two positions (contact and now) make a travel.
  const double all = lab.mask.kinematics().position_std_m(poses, lab.tip, Vec3::Zero(), lab.options.joint_std_rad);
  return std::max(1e-5, std::sqrt(2.0 / 3.0) * all);
}

DepthFrame LabRobot::take_depth_image() {
  Impl& lab = *impl_;
  DepthFrame frame;
  frame.time_s = lab.clock_s;
  frame.camera = lab.camera;
  frame.T_base_camera = lab.T_base_camera;
  frame.noise = lab.options.depth.noise;
  const auto& names = lab.mask.kinematics().free_joints();
  const auto poses = lab.mask.kinematics().link_poses(names, lab.true_joints);
  const geometry::TriangleTree object(lab.curve.surface(lab.curve.at(lab.travel())));
  std::vector<std::unique_ptr<geometry::TriangleTree>> arm_trees;
  Scene scene;
  scene.bodies.push_back(&object);
  for (const auto& [link, mesh] : lab.bodies) {
    TriMesh posed = mesh;
    for (Eigen::Index v = 0; v < mesh.vertices_m.rows(); ++v)
      posed.vertices_m.row(v) = poses[link] * Vec3(mesh.vertices_m.row(v));
    arm_trees.push_back(std::make_unique<geometry::TriangleTree>(std::move(posed)));
    scene.bodies.push_back(arm_trees.back().get());
  }
  scene.planes.push_back(Plane{lab.options.object.base_centre_m, Vec3::UnitZ()});
  frame.depth_m =
      sense_depth(cast_view(scene, frame.camera, frame.T_base_camera), frame.camera, lab.options.depth, lab.depth_random);
  frame.mask = lab.mask.mask(frame, names, lab.commanded);
  return frame;
}

Recording LabRobot::scene() const {
  const Impl& lab = *impl_;
  const PressedBlockOptions& object = lab.options.object;
  Recording recording;
  recording.name = "lab";
  recording.description = "Simulated: palpate's software arm presses a foam cube with a round soft pad";
  RobotShape cube;
  cube.kind = RobotShape::Kind::box;
  cube.size_m = Vec3::Constant(object.edge_m);
  recording.rest.surface = sensing::shape_mesh(cube);
  recording.rest.surface->vertices_m.rowwise() += (object.base_centre_m + 0.5 * object.edge_m * Vec3::UnitZ()).transpose();
  recording.rest.state = RestState::stress_free;
  Support table;
  table.kind = SupportKind::plane;
  table.name = "table";
  table.plane.point_m = object.base_centre_m;
  recording.supports.push_back(table);
  recording.environment.planes.push_back(table.plane);
  Tool pad;
  pad.name = "stick";
  pad.shape = ToolShape::disc;
  pad.radius_m = object.pad_radius_m;
  recording.tools.push_back(pad);
  recording.joint_names = lab.mask.kinematics().free_joints();
  recording.robot = lab.mask.kinematics().robot();
  recording.model.material = object.material;
  return recording;
}

acquisition::PushPlan LabRobot::plan() const {
  const PressedBlockOptions& object = impl_->options.object;
  acquisition::PushPlan plan;
  plan.name = "push 1";
  plan.tool = "stick";
  plan.contact_m = object.base_centre_m + Vec3(object.site_m, 0, object.edge_m);
  plan.direction = -Vec3::UnitZ();
  plan.R_base_tip = downwards();
  return plan;
}

double LabRobot::true_force_n() const { return impl_->force(); }
double LabRobot::true_travel_m() const { return std::max(0.0, impl_->travel()); }

}  // namespace palpate::lab
