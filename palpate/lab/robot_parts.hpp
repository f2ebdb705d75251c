// SPDX-License-Identifier: Apache-2.0
// What the lab's robot is made of. Inner header of the room.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/arm.hpp"
#include "palpate/lab/force_curve.hpp"
#include "palpate/lab/random.hpp"
#include "palpate/lab/robot.hpp"
#include "palpate/lab/scene.hpp"
#include "palpate/sensing/reach.hpp"
#include "palpate/sensing/robot_mask.hpp"

namespace palpate::lab {

inline ArmOptions arm_of(const LabOptions& lab, const LabObject& object) {
  ArmOptions options;
  options.T_base_arm = lab.T_base_arm;
  options.pad_radius_m = object.pad_radius_m;
  options.camera_on_hand = lab.camera_on_hand;
  return options;
}

// Small strains of what is held all the time, or by pads alone: nothing lifts off, and no contact grows.
inline bool moves_in_proportion(const LabObject& object) {
  const auto pushes_only = [](const Support& one) { return one.kind == SupportKind::table || one.kind == SupportKind::wall; };
  return fem::material_law(object.material).is_linear() && !object.punch &&
         std::none_of(object.supports.begin(), object.supports.end(), pushes_only);
}

struct LabRobot::Impl {
  Impl(const LabOptions& given, LabObject object_in)
      : options(given),
        object(std::move(object_in)),
        mask(arm(arm_of(given, object))),
        tip(mask.kinematics().link("tip")),
        hand(mask.kinematics().link("hand_tilt")),
        hand_camera(given.camera_on_hand ? mask.kinematics().link("camera") : hand),
        stick(mask.kinematics().link("stick")),
        joint_random(given.seed, 1),
        force_random(given.seed, 2),
        depth_random(given.seed, 3),
        torque_random(given.seed, 7),
        way_joint_random(given.seed, 8),
        way_force_random(given.seed, 9),
        at_rest(object.surface) {
    if (object.sites.empty() || !object.press) throw Error("needs a site and a truth", "LabObject");
    curves.resize(object.sites.size());
    Random once(options.seed, 0);
    wrist = std::make_unique<ForceSensor>(options.force, once, Random(given.seed, 6));
    const Vec3 turn = options.camera_std_rad * once.normal3();
    T_true_stated.pretranslate(options.camera_std_m * once.normal3());
    if (turn.norm() > 0) T_true_stated.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    Random of_camera(options.seed, 5);
    options.depth.bias_m = options.depth.bias_std_m * of_camera.normal();
    commanded = moved_to = true_joints = {0, 0.3, 1.2, 0, 1.6, 0, 0.05};
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
    low_m = low;
    high_m = high;
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
  // As the tool is round its roll may be any, but it does not turn along a straight way: what the wrist sensor errs by in its own axes
  // would turn with it, and no tare could know.
  std::optional<std::vector<double>> reached(const Pose& pose, const std::vector<double>& from) const {
    const Mat3 stood = tip_of(from).linear();
    const Vec3 had = stood.col(2), wanted = pose.linear().col(2);
    if (had.dot(wanted) > 1 - 1e-6) {
      Pose same_roll = pose;
      same_roll.linear() = Eigen::Quaterniond::FromTwoVectors(had, wanted) * stood;
      sensing::ReachOptions whole;
      whole.any_roll = false;
      whole.starts = 1;
      if (auto joints = sensing::reach(mask.kinematics(), tip, same_roll, from, whole)) return joints;
    }
    return sensing::reach(mask.kinematics(), tip, pose, from);
  }
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
  // Deeper in it than nothing, of the stick's round end; away from where the active site is pressed, whose truth is solved for.
  Vec3 into_elsewhere_m(const Vec3& tip_m) const {
    constexpr double pressed_within_m = 0.014, before_site_m = 0.02;
    const Vec3 point_m = tip_m - slid_m, offset = point_m - site().contact_m;
    const double along = offset.dot(site().direction);
    if (along > -before_site_m && (offset - along * site().direction).norm() < pressed_within_m) return Vec3::Zero();
    const double radius_m = ArmOptions{}.stick_radius_m;
    const bool near = at_rest.within(point_m, radius_m * radius_m);
    const bool inside = (point_m - low_m).minCoeff() > 0 && (high_m - point_m).minCoeff() > 0 &&
                        at_rest.crossings(point_m, Vec3(0.48, 0.36, 0.8)) % 2 == 1;
    if (!near && !inside) return Vec3::Zero();
    const Vec3 away_m = at_rest.closest(point_m).point_m - point_m;
    if (!(away_m.norm() > 1e-9)) return radius_m * (tip_of(true_joints).linear().col(2));
    return (inside ? -(radius_m + away_m.norm()) : radius_m - away_m.norm()) * away_m.normalized();
  }
  /// How far along a straight motion the tip gets before it stands in the object: a share of it, or all.
  double goes_as_far_as(const Vec3& from_m, const Vec3& to_m) const {
    if (into_elsewhere_m(from_m).norm() > 0) return 1;  // out of there, too
    const int pieces = std::max(1, int(std::ceil((to_m - from_m).norm() / 0.001)));
    for (int k = 1; k <= pieces; ++k)
      if (into_elsewhere_m(from_m + double(k) / pieces * (to_m - from_m)).norm() > 0) return std::min(1.0, (k + 0.5) / pieces);
    return 1;
  }
  /// Of the tip on the object where it is not pushed: stiff, so that nobody overlooks it.
  Vec3 met_n() const {
    constexpr double stiff_n_m = 2e4;
    return stiff_n_m * into_elsewhere_m(tip_of(true_joints).translation());
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
          std::make_unique<ForceCurve>(object.press(site()), 0.06 * object.young_modulus_pa * a * a * M_PI / 2, 0.06 * a,
                                       moves_in_proportion(object));
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
  // Ways between pushes have noise of their own, and leave no trace in how the arm stands at the next push: what a recording holds
  // is not changed by how the tip came there.
  Random way_joint_random, way_force_random;
  bool on_the_way = false;
  geometry::TriangleTree at_rest;
  Vec3 low_m = Vec3::Zero(), high_m = Vec3::Zero();  // of the object's surface
  std::vector<double> commanded, true_joints;
  std::vector<double> moved_to;  // by the last motion of a push
  std::vector<std::pair<std::size_t, TriMesh>> bodies;  // link, mesh in its frame
  Camera camera;
  Pose T_base_camera, T_true_stated = Pose::Identity();
  Vec3 slid_m = Vec3::Zero();  // of the object on the table
  double clock_s = 0, moved_s = -1e3, fading_n = 0;
  std::vector<DepthFrame> around;  // what was last looked at from all sides
};

}  // namespace palpate::lab
