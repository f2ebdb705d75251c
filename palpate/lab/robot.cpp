// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/robot.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/arm.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/force_curve.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/scene.hpp"
#include "palpate/sensing/reach.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::lab {
namespace {

ArmOptions arm_with_pad(const Pose& T_base_arm, double pad_radius_m) {
  ArmOptions options;
  options.T_base_arm = T_base_arm;
  options.pad_radius_m = pad_radius_m;
  return options;
}

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

struct LabRobot::Impl {
  Impl(const LabOptions& given, LabObject object_in)
      : options(given),
        object(std::move(object_in)),
        mask(arm(arm_with_pad(given.T_base_arm, object.pad_radius_m))),
        tip(mask.kinematics().link("tip")),
        hand(mask.kinematics().link("hand_tilt")),
        hand_camera(mask.kinematics().link("camera")),
        stick(mask.kinematics().link("stick")),
        joint_random(given.seed, 1),
        force_random(given.seed, 2),
        depth_random(given.seed, 3),
        torque_random(given.seed, 7) {
    if (object.sites.empty() || !object.press) throw Error("needs a site and a truth", "LabObject");
    curves.resize(object.sites.size());
    Random once(options.seed, 0);
    wrist = std::make_unique<ForceSensor>(options.force, once, Random(given.seed, 6));
    const Vec3 turn = options.camera_std_rad * once.normal3();
    T_true_stated.pretranslate(options.camera_std_m * once.normal3());
    if (turn.norm() > 0) T_true_stated.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    Random of_camera(options.seed, 5);
    options.depth.bias_m = options.depth.bias_std_m * of_camera.normal();
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
    const Vec3 low = object.surface.vertices_m.colwise().minCoeff().transpose(),
               high = object.surface.vertices_m.colwise().maxCoeff().transpose();
    table.point_m = Vec3(0.5 * (low(0) + high(0)), 0.5 * (low(1) + high(1)), low(2));
    planes.push_back(table);
    for (const Support& support : object.supports)
      if (support.kind != SupportKind::box && support.plane.normal.z() < 0.5) planes.push_back(support.plane);
    T_base_camera = options.T_base_camera.value_or(look_at(table.point_m + Vec3(-0.20, -0.42, 0.42),
                                                           table.point_m + 0.55 * (high(2) - low(2)) * Vec3::UnitZ()));
  }

  Pose pose_of(Index link, const std::vector<double>& joints) const {
    return mask.kinematics().link_poses(mask.kinematics().free_joints(), joints)[std::size_t(link)];
  }
  Pose tip_of(const std::vector<double>& joints) const { return pose_of(tip, joints); }
  // Where an image is taken from, as the joints that are read say, and how well that is known.
  void place_camera(DepthFrame& frame) const {
    frame.pose_std_m = options.camera_std_m;
    frame.pose_std_rad = options.camera_std_rad;
    frame.T_base_camera = T_base_camera;
    if (!options.camera_on_hand) return;
    const auto poses = mask.kinematics().link_poses(mask.kinematics().free_joints(), commanded);
    frame.T_base_camera = poses[std::size_t(hand_camera)];
    const Mat3 covariance = mask.kinematics().position_covariance_m2(poses, hand_camera, Vec3::Zero(), options.joint_std_rad);
    frame.pose_std_m = std::hypot(frame.pose_std_m, std::sqrt(covariance.trace() / 3));
    // Each axis of rotation is about one of three directions.
    frame.pose_std_rad = std::hypot(frame.pose_std_rad, options.joint_std_rad * std::sqrt(double(commanded.size()) / 3));
  }
  Pose true_camera() const { return options.camera_on_hand ? pose_of(hand_camera, true_joints) : T_base_camera; }
  /// The sensor before a scene of the object, so many bodies of the arm, and planes.
  DepthSensorOptions sensor_before(std::size_t arm_bodies) const {
    DepthSensorOptions sensor = options.depth;
    sensor.looks = {Look{}, object.look};
    sensor.looks.insert(sensor.looks.end(), arm_bodies, options.arm);
    sensor.looks.insert(sensor.looks.end(), planes.size(), options.table);
    return sensor;
  }
  const PushSite& site() const { return object.sites[active]; }
  // How far the encoders' tip has come beyond the object's surface at rest, wherever that has slid to; negative before.
  double reach() const {
    const Vec3 offset = tip_of(true_joints).translation() - site().contact_m - slid_m;
    const double along = offset.dot(site().direction);
    return (offset - along * site().direction).norm() < 0.014 ? along : 0;
  }
  // Of a push that is to go through this point, near the surface or on it.
  Vec3 where_it_meets(const Vec3& contact_m, const Vec3& direction) const {
    constexpr double on_it_m = 1e-6, near_m = 0.03;
    const geometry::TriangleTree surface(object.surface);
    if (surface.within(contact_m, on_it_m * on_it_m)) return contact_m;
    const auto deeper = surface.cast(contact_m, direction, near_m), before = surface.cast(contact_m, -direction, near_m);
    const double deeper_m = deeper ? deeper->range_m : 2 * near_m, before_m = before ? before->range_m : 2 * near_m;
    if (!deeper && !before) return contact_m;
    return contact_m + (deeper_m < before_m ? deeper_m : -before_m) * direction;
  }
  Vec3 sideways() const { return Vec3(site().direction.x(), site().direction.y(), 0); }
  // Travel of the pad into the object: what stick and arm yield is taken off, and the object slides rather than bear more
  // sideways than friction holds. Solved on the curve, which rises.
  double travel_at(double reach_m) {
    const auto needs = [&](double travel_m) { return travel_m + options.compliance_m_per_n * curve().force_n(curve().at(travel_m)); };
    if (reach_m <= 0 || options.compliance_m_per_n == 0) return reach_m;
    double low = 0, high = reach_m;
    for (int k = 0; k < 60; ++k) (needs(0.5 * (low + high)) < reach_m ? low : high) = 0.5 * (low + high);
    return 0.5 * (low + high);
  }
  // Of a force that is no higher than the present travel's.
  double depth_that_bears_m(double force_n) {
    double low = 0, high = travel();
    for (int k = 0; k < 60; ++k) (curve().force_n(curve().at(0.5 * (low + high))) < force_n ? low : high) = 0.5 * (low + high);
    return low;
  }
  void slide() {
    const double share = sideways().norm(), most_n = share > 1e-9 ? options.slides_at_n / share : 1e300;
    if (travel() <= 0 || curve().force_n(curve().at(travel())) <= most_n) return;
    const double bears_m = depth_that_bears_m(most_n) + options.compliance_m_per_n * most_n;
    slid_m += (reach() - bears_m) / (share * share) * sideways();
  }
  double travel() { return travel_at(reach()); }
  ForceCurve& curve() {
    if (!curves[active]) {
      const double a = object.pad_radius_m;
      curves[active] =
          std::make_unique<ForceCurve>(object.press(site()), 0.06 * object.young_modulus_pa * a * a * M_PI / 2, 0.06 * a);
    }
    return *curves[active];
  }
  bool slipped() { return travel() > options.slip_at_m; }
  static constexpr double left_after_slip = 0.4;  // of the force: a tip that slid off still leans on the object
  double force() {
    const double travelled = travel();
    if (travelled <= 0) return 0;  // nothing has to be solved before contact
    const double steady = curve().force_n(curve().at(travelled));
    return slipped() ? left_after_slip * steady : steady;
  }
  // How the object looks now: as deep as it bears the force.
  TriMesh shape() {
    TriMesh out = object.surface;
    if (const double deep_m = travel(); deep_m > 0)
      out = curve().surface(curve().at(slipped() ? depth_that_bears_m(force()) : deep_m));
    out.vertices_m.rowwise() += slid_m.transpose();
    return out;
  }
  // Of the stick's end, from where the joints put it: it yields, and where the tip slid off it bends aside.
  Vec3 tip_is_off_m() {
    Vec3 off = -options.compliance_m_per_n * force() * site().direction;
    if (slipped()) off += slid_off_m * tip_of(true_joints).linear().col(1);
    return off;
  }
  // The middle of the pad's pressure, which lies on the object.
  Vec3 force_acts_at_m() {
    Vec3 at_m = site().contact_m + slid_m + std::max(0.0, travel()) * site().direction;
    if (slipped()) at_m += slid_off_m * tip_of(true_joints).linear().col(1);
    return at_m;
  }
  static constexpr double slid_off_m = 0.005;

  LabOptions options;
  LabObject object;
  sensing::RobotMask mask;
  Index tip, hand, hand_camera, stick;
  std::vector<std::unique_ptr<ForceCurve>> curves;  // a site
  std::size_t active = 0;
  std::unique_ptr<ForceSensor> wrist;
  Plane table;
  std::vector<Plane> planes;  // the table, and what is upright
  Random joint_random, force_random, depth_random, torque_random;
  std::vector<double> commanded, true_joints;
  std::vector<std::pair<std::size_t, TriMesh>> bodies;  // link, mesh in its frame
  Camera camera;
  Pose T_base_camera, T_true_stated = Pose::Identity();
  Vec3 slid_m = Vec3::Zero();  // of the object on the table
  double clock_s = 0, moved_s = -1e3, fading_n = 0;
  std::vector<DepthFrame> around;  // what was last looked at from all sides
};

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
  const Vec3 force_n = (steady + fading) * lab.site().direction, acts_m = lab.force_acts_at_m();
  state.force_n = said.linear() * lab.wrist->read(force_n, stands.linear(), lab.clock_s, lab.force_random);
  // About the tip, as a driver reckons it from what joints and sensor say.
  const Vec3 at_wrist_nm =
      said.linear() * lab.wrist->read_torque((acts_m - stands.translation()).cross(force_n), stands.linear(), lab.torque_random);
  state.torque_nm = at_wrist_nm - (state.T_base_tip.translation() - said.translation()).cross(state.force_n);
  return state;
}

acquisition::Motion LabRobot::move(const Pose& T_base_tip, double speed_m_s) {
  Impl& lab = *impl_;
  if (!(speed_m_s > 0)) throw Error("must be positive", "speed_m_s");
  const auto joints = sensing::reach(lab.mask.kinematics(), lab.tip, T_base_tip, lab.commanded);
  if (!joints) return acquisition::Motion::refused;
  const double before = lab.force();
  lab.clock_s += (T_base_tip.translation() - lab.tip_of(lab.commanded).translation()).norm() / speed_m_s;
  lab.commanded = *joints;
  lab.true_joints = *joints;
  for (double& q : lab.true_joints) q += lab.options.joint_std_rad * lab.joint_random.normal();
  lab.slide();
  lab.moved_s = lab.clock_s;
  lab.fading_n = lab.options.relaxation * std::max(0.0, lab.force() - before);
  return acquisition::Motion::done;
}

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

std::optional<DepthFrame> LabRobot::look(int view, int views) {
  std::vector<DepthFrame>& around = impl_->around;  // their errors are drawn one after the other
  if (around.size() != std::size_t(std::max(0, views))) around = look_around(views);
  return around.at(std::size_t(view));
}

DepthFrame LabRobot::take_depth_image() {
  Impl& lab = *impl_;
  DepthFrame frame;
  frame.time_s = lab.clock_s;
  frame.camera = lab.camera;
  lab.place_camera(frame);
  frame.noise = stated_noise(lab.options.depth);
  const auto& names = lab.mask.kinematics().free_joints();
  const auto poses = lab.mask.kinematics().link_poses(names, lab.true_joints);
  const geometry::TriangleTree object(lab.shape());
  const Vec3 off_m = lab.tip_is_off_m();
  std::vector<std::unique_ptr<geometry::TriangleTree>> arm_trees;
  Scene scene;
  scene.bodies.push_back(&object);
  for (const auto& [link, mesh] : lab.bodies) {
    TriMesh posed = mesh;
    for (Eigen::Index v = 0; v < mesh.vertices_m.rows(); ++v)
      posed.vertices_m.row(v) = poses[link] * Vec3(mesh.vertices_m.row(v));
    if (Index(link) == lab.stick) posed.vertices_m.rowwise() += off_m.transpose();
    arm_trees.push_back(std::make_unique<geometry::TriangleTree>(std::move(posed)));
    scene.bodies.push_back(arm_trees.back().get());
  }
  scene.planes = lab.planes;
  frame.depth_m = sense_depth(cast_view(scene, frame.camera, lab.true_camera() * lab.T_true_stated), frame.camera,
                              lab.sensor_before(lab.bodies.size()), lab.depth_random);
  frame.mask = lab.mask.mask(frame, names, lab.commanded);
  return frame;
}

std::vector<DepthFrame> LabRobot::look_around(int views) const {
  if (views < 1) throw Error("must be at least 1", "views");
  const bool wall = impl_->planes.size() > 1;  // behind it there is nothing to see: the ring is a half one then
  std::vector<ViewDirection> directions;
  for (int k = 0; k < views - 1; ++k)
    directions.push_back({wall ? M_PI * (k + 0.5) / (views - 1) + M_PI / 2 : 2 * M_PI * k / (views - 1) + M_PI / 4, M_PI / 6});
  directions.push_back({0, std::atan2(1, 0.05)});
  return look_from(directions);
}

std::vector<DepthFrame> LabRobot::look_from(const std::vector<ViewDirection>& directions) const {
  const Impl& lab = *impl_;
  const Vec3 low = lab.object.surface.vertices_m.colwise().minCoeff().transpose(),
             high = lab.object.surface.vertices_m.colwise().maxCoeff().transpose();
  const Vec3 middle = 0.5 * (low + high);
  const double away_m = std::max(0.35, 2.2 * (high - low).norm());
  const geometry::TriangleTree object(lab.object.surface);
  Scene scene;
  scene.bodies.push_back(&object);
  scene.planes = lab.planes;
  Random random(lab.options.seed, 4);
  std::vector<DepthFrame> frames;
  for (const auto& [around, down] : directions) {
    if (!(down > 0 && down < M_PI / 2)) throw Error("must lie between 0 and a right angle", "elevation_rad");
    const Vec3 eye = middle + away_m * Vec3(std::cos(down) * std::cos(around), std::cos(down) * std::sin(around), std::sin(down));
    DepthFrame frame;
    frame.camera = lab.camera;
    frame.T_base_camera = look_at(eye, middle);
    frame.pose_std_m = lab.options.camera_std_m;
    frame.pose_std_rad = lab.options.camera_std_rad;
    frame.noise = stated_noise(lab.options.depth);
    Pose T_base_true = frame.T_base_camera;
    const Vec3 turn = lab.options.camera_std_rad * random.normal3();
    if (turn.norm() > 0) T_base_true.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    T_base_true.pretranslate(lab.options.camera_std_m * random.normal3());
    frame.depth_m = sense_depth(cast_view(scene, frame.camera, T_base_true), frame.camera, lab.sensor_before(0), random);
    frames.push_back(std::move(frame));
  }
  return frames;
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
double LabRobot::true_force_scale() const { return impl_->wrist->scale(); }
const LabObject& LabRobot::object() const { return impl_->object; }

}  // namespace palpate::lab
