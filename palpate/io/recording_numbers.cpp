// SPDX-License-Identifier: Apache-2.0
// Numbers that were read without a fault and that nothing real has: they would give an answer, and a wrong one.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "palpate/core/observed_travel.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/io/recording_reader.hpp"

namespace palpate::io {
namespace {

constexpr double tip_within_m = 20, plane_within_m = 100;
constexpr double joint_turns_rad = 4 * EIGEN_PI;  // twice what the joint of an arm can; degrees are mostly more
constexpr double fastest_force_n_s = 1e6;
constexpr double same_direction = 0.99;

struct Extent {
  bool known = false;
  Vec3 centre = Vec3::Zero();
  double diagonal_m = 0;
};

const Points* nodes_of(const Recording& recording) {
  if (recording.rest.volume && recording.rest.volume->nodes_m.rows() > 0) return &recording.rest.volume->nodes_m;
  if (recording.rest.surface && recording.rest.surface->vertices_m.rows() > 0) return &recording.rest.surface->vertices_m;
  return nullptr;
}

Extent extent_of(const Points* nodes) {
  if (nodes == nullptr) return {};
  const Vec3 low = nodes->colwise().minCoeff(), high = nodes->colwise().maxCoeff();
  return {true, 0.5 * (low + high), (high - low).norm()};
}

/// An empty name means the step's only tool.
std::string tool_in(const Step& step, const std::string& name) {
  return name.empty() && step.loads.size() == 1 ? step.loads.front().tool : name;
}

class NumberChecker {
 public:
  NumberChecker(const Recording& recording, std::vector<Problem>& problems)
      : recording_(recording), problems_(problems), nodes_(nodes_of(recording)), extent_(extent_of(nodes_)) {}

  void check() {
    check_planes();
    for (const Tool& tool : recording_.tools) check_tool(tool);
    for (const Push& push : recording_.pushes) {
      for (std::size_t i = 0; i < push.steps.size(); ++i) {
        check_pose(push.steps[i]);
        check_rates(push.steps[i]);
        check_travels(push.steps[i]);
        check_wrenches(push.steps[i]);
        check_clouds(push.steps[i]);
        if (i > 0) check_image_times(push.steps[i - 1], push.steps[i]);
      }
    }
  }

 private:
  void add(const std::string& where, const std::string& what) { problems_.push_back({where, what}); }

  void check_planes() {
    if (nodes_ == nullptr) return;
    for (std::size_t i = 0; i < recording_.environment.planes.size(); ++i) {
      const Plane& plane = recording_.environment.planes[i];
      const VectorX height = (*nodes_ * plane.normal.normalized()).array() - plane.point_m.dot(plane.normal.normalized());
      const std::string where = fmt::format("{}: environment.planes[{}]", recording_.source, i);
      if (height.maxCoeff() < 0.05 * extent_.diagonal_m && height.minCoeff() < -0.25 * extent_.diagonal_m)
        add(where, "the whole object lies behind this plane; its normal points to the object's side, and point_m is in metres");
      else if (height.minCoeff() > plane_within_m)
        add(where, fmt::format("the plane is {:.3g} m from the object; is point_m in millimetres? It must be in metres",
                               height.minCoeff()));
    }
  }

  void check_tool(const Tool& tool) {
    if (!tool.mesh || recording_.accept_size || tool.mesh->vertices_m.rows() == 0) return;
    const double side = (tool.mesh->vertices_m.colwise().maxCoeff() - tool.mesh->vertices_m.colwise().minCoeff()).maxCoeff();
    if (side > 2 || side < 1e-5)
      add(fmt::format("{}: tools.{}", recording_.source, tool.name),
          fmt::format("its mesh is {:.3g} m long, tools of 0.01 mm to 2 m are expected; is the file in millimetres? It must be "
                      "in metres",
                      side));
  }

  void check_pose(const Step& step) {
    if (step.T_base_tip && extent_.known) {
      const double away = (step.T_base_tip->translation() - extent_.centre).norm();
      if (away > tip_within_m + 10 * extent_.diagonal_m)
        add(step.source, fmt::format("T_base_tip is {:.3g} m from the object; is it in millimetres? It must be in metres", away));
    }
    if (!recording_.robot) return;
    for (std::size_t i = 0; i < step.joints_rad.size() && i < recording_.joint_names.size(); ++i) {
      const RobotJoint* joint = joint_named(recording_.joint_names[i]);
      if (joint == nullptr || joint->kind != RobotJoint::Kind::revolute) continue;
      if (std::abs(step.joints_rad[i]) > joint_turns_rad)
        add(step.source, fmt::format("joints_rad: '{}' is {:.4g}, which no joint turns to; is it in degrees? It must be in radians",
                                     joint->name, step.joints_rad[i]));
    }
  }

  const RobotJoint* joint_named(const std::string& name) const {
    const auto& joints = recording_.robot->joints;
    const auto found = std::find_if(joints.begin(), joints.end(), [&](const RobotJoint& one) { return one.name == name; });
    return found == joints.end() ? nullptr : &*found;
  }

  void check_rates(const Step& step) {
    for (const Load& load : step.loads) {
      if (!(load.force_rate_n_s.norm() > fastest_force_n_s)) continue;
      add(step.source, fmt::format("force_rate_n_s of '{}' is {:.3g} N/s, which cannot be; it is in newtons per second",
                                   load.tool, load.force_rate_n_s.norm()));
    }
  }

  /// Encoders say one travel: two of them contradict each other, or are one that counts twice.
  void check_travels(const Step& step) {
    std::set<std::string> seen;
    for (const Observation& one : step.observations) {
      const auto* travel = std::get_if<ToolTravel>(&one);
      if (travel == nullptr || seen.insert(tool_in(step, travel->tool)).second) continue;
      add(step.source, fmt::format("the travel of tool '{}' is observed twice in this step; keep one, or name another tool",
                                   tool_in(step, travel->tool)));
    }
  }

  /// Raw samples of a sensor follow each other in time; single-axis cells look along different directions.
  void check_wrenches(const Step& step) {
    std::vector<const Wrench*> seen;
    for (const Observation& one : step.observations) {
      const auto* wrench = std::get_if<Wrench>(&one);
      if (wrench == nullptr) continue;
      for (const Wrench* other : seen) {
        const bool another_axis = wrench->along.norm() > 0 && other->along.norm() > 0 &&
                                  std::abs(wrench->along.dot(other->along)) < same_direction;
        if (another_axis || wrench->time_s != other->time_s || tool_in(step, wrench->tool) != tool_in(step, other->tool)) continue;
        add(step.source, fmt::format("two wrenches of tool '{}' are observed at the same time ({:.10g} s); keep one, name "
                                     "another tool, or give each its time_s",
                                     tool_in(step, wrench->tool), wrench->time_s));
        return;
      }
      seen.push_back(wrench);
    }
  }

  void check_clouds(const Step& step) {
    for (const Observation& one : step.observations) {
      const auto* cloud = std::get_if<PointCloud>(&one);
      if (cloud == nullptr || cloud->sigma_m.size() == 0) continue;
      if (cloud->sigma_m.minCoeff() >= ranges::length_sigma.least && cloud->sigma_m.maxCoeff() <= ranges::length_sigma.most)
        continue;
      add(step.source, fmt::format("sigma_m of the cloud's points is {:.3g} to {:.3g} m, which cannot be; {}",
                                   cloud->sigma_m.minCoeff(), cloud->sigma_m.maxCoeff(), ranges::length_sigma.slip));
    }
  }

  void check_image_times(const Step& before, const Step& step) {
    const auto latest = [](const Step& of, const DepthFrame& like) {
      double time_s = -std::numeric_limits<double>::infinity();
      for (const Observation& one : of.observations) {
        const auto* frame = std::get_if<DepthFrame>(&one);
        if (frame != nullptr && frame->camera == like.camera) time_s = std::max(time_s, frame->time_s);
      }
      return time_s;
    };
    for (const Observation& one : step.observations) {
      const auto* frame = std::get_if<DepthFrame>(&one);
      if (frame == nullptr || latest(step, *frame) >= latest(before, *frame)) continue;
      add(step.source, fmt::format("time_s of its image goes back, to {:.10g} s from {:.10g} s in {}; order the images by time",
                                   frame->time_s, latest(before, *frame), before.source));
      return;
    }
  }

  const Recording& recording_;
  std::vector<Problem>& problems_;
  const Points* nodes_;
  Extent extent_;
};

/// Says each thing once, however many steps have it.
class OddNumbers {
 public:
  explicit OddNumbers(const Recording& recording) : recording_(recording), extent_(extent_of(nodes_of(recording))) {}

  std::vector<std::string> all() {
    const double g = recording_.environment.gravity_m_s2.norm();
    if (g > 0 && (g < 9.5 || g > 10.1))
      say(fmt::format("gravity_m_s2 is {:.4g} m/s2 long; on earth it is 9.81", g), recording_.source);
    for (const Tool& tool : recording_.tools) {
      look_at(tool);
      if (tool.shape == ToolShape::sphere && tool.radius_m > 0 && tool.radius_std_m == 0) look_at_ball(tool);
    }
    const double usual_n = usual_force();
    constexpr double strong_arm_n = 500;
    if (usual_n > strong_arm_n)
      say(fmt::format("most forces are above {:.3g} N, more than arms that push soft objects have; are they in newtons?", strong_arm_n), recording_.source);
    for (const Push& push : recording_.pushes) {
      look_at_signs(push);
      look_at_directions(push);
      if (usual_n > 0 && push.force_tare_std_n > usual_n && !push.steps.empty())
        say(fmt::format("force_tare_std_n of {:.3g} N is more than most forces ({:.3g} N)", push.force_tare_std_n, usual_n),
            push.steps.front().source);
      for (const Step& step : push.steps) {
        for (const Load& load : step.loads) look_at(load, usual_n, step);
        for (const Observation& one : step.observations) {
          if (const auto* frame = std::get_if<DepthFrame>(&one)) look_at(*frame, step);
          if (const auto* cloud = std::get_if<PointCloud>(&one); cloud && cloud->sigma_m.size() > 0)
            look_at_sigma(cloud->sigma_m.minCoeff(), "the cloud's points", step);
          if (const auto* wrench = std::get_if<Wrench>(&one)) look_at_time(wrench->time_s, "wrench", step);
          const auto* travel = std::get_if<ToolTravel>(&one);
          if (travel && travel->travel_m < -(5 * travel->sigma_m + 3 * push.travel_offset_std_m + 1e-4) && !step.loads.empty())
            say("the observed travel is negative: the tool would stand off the object; is its sign right?", step.source);
        }
        look_at_joints(step);
      }
    }
    look_at_what_is_seen();
    return std::move(said_);
  }

 private:
  /// The pose of another camera, or the inverse of its own, shows what is elsewhere.
  void look_at_what_is_seen() {
    if (!extent_.known) return;
    std::size_t seen = 0;
    const Step* first = nullptr;
    for (const Push& push : recording_.pushes)
      for (const Step& step : push.steps)
        for (const Observation& one : step.observations) {
          const auto* frame = std::get_if<DepthFrame>(&one);
          const auto* cloud = std::get_if<PointCloud>(&one);
          if (frame == nullptr && cloud == nullptr) continue;
          if (frame != nullptr ? shows_object(*frame) : shows_object(*cloud)) return;  // others may look away
          ++seen;
          if (first == nullptr) first = &step;
        }
    if (first != nullptr)
      say(fmt::format("none of the {} images and clouds shows anything where the object is; is T_base_camera the camera's pose in the base frame, not "
                      "its inverse, in metres, and the surface in the base frame, too?",
                      seen),
          first->source);
  }

  bool is_near(const Vec3& point_m) const { return (point_m - extent_.centre).norm() <= extent_.diagonal_m; }

  bool shows_object(const PointCloud& cloud) const {
    for (Index i = 0; i < cloud.points_m.rows(); ++i)
      if (is_near(cloud.points_m.row(i))) return true;
    return false;
  }

  /// A lens bends rays by less than the object's size.
  bool shows_object(const DepthFrame& frame) const {
    const Index every = std::max<Index>(1, std::min(frame.depth_m.rows(), frame.depth_m.cols()) / 100);
    for (Index row = 0; row < frame.depth_m.rows(); row += every)
      for (Index column = 0; column < frame.depth_m.cols(); column += every) {
        const double z_m = frame.depth_m(row, column);
        if (!(z_m > 0)) continue;
        const Vec3 at_m(z_m * (double(column) - frame.camera.cx_px) / frame.camera.fx_px, z_m * (double(row) - frame.camera.cy_px) / frame.camera.fy_px,
                        z_m);
        if (is_near(frame.T_base_camera * at_m)) return true;
      }
    return false;
  }

  void say(const std::string& what, const std::string& where) {
    if (known_.insert(what).second) said_.push_back(where.empty() ? what : where + ": " + what);
  }

  void look_at(const Tool& tool) {
    const std::string where = fmt::format("{}: tools.{}", recording_.source, tool.name);
    if (extent_.known && tool.radius_m > extent_.diagonal_m)
      say(fmt::format("radius_m of {:.4g} m is more than the whole object ({:.4g} m)", tool.radius_m, extent_.diagonal_m), where);
    if (tool.friction_coefficient > 2) say(fmt::format("a friction_coefficient of {:.3g} is unusual", tool.friction_coefficient), where);
  }

  /// Median of the forces that act.
  double usual_force() const {
    std::vector<double> all;
    for (const Push& push : recording_.pushes)
      for (const Step& step : push.steps)
        for (const Load& load : step.loads)
          if (load.force_n && load.force_n->norm() > 0) all.push_back(load.force_n->norm());
    if (all.empty()) return 0;
    const std::size_t middle = (all.size() - 1) / 2;
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(middle), all.end());
    return all[middle];
  }

  /// One step in which a tool pulls among steps in which it presses is a sign lost on the way.
  void look_at_signs(const Push& push) {
    int presses = 0;
    const Step* pulls = nullptr;
    for (const Step& step : push.steps) {
      for (const Load& load : step.loads) {
        if (!load.force_n) continue;
        const double along_n = load.force_n->dot(load.direction), unsure_n = 5 * (load.force_std_n + push.force_tare_std_n);
        presses += along_n > unsure_n ? 1 : 0;
        if (along_n < -std::max(unsure_n, 0.5 * load.force_n->norm()) && pulls == nullptr) pulls = &step;
      }
    }
    if (pulls != nullptr && presses == 0)
      say(fmt::format("force_n pulls, against 'direction', in all of push '{}'; it is the force of the tool on the object: is its sign right?", push.name),
          pulls->source);
    if (pulls != nullptr && presses > 0)
      say(fmt::format("force_n pulls, against 'direction', where other steps of push '{}' press; is its sign right?", push.name),
          pulls->source);
  }

  /// A tool that neither slides nor sticks badly is pushed along its way, within what friction carries sideways.
  void look_at_directions(const Push& push) {
    constexpr double sideways_rad = EIGEN_PI / 3;
    for (const Step& step : push.steps) {
      for (const Load& load : step.loads) {
        if (!load.force_n || load.force_n->norm() <= 5 * (load.force_std_n + push.force_tare_std_n)) continue;
        const double angle_rad = std::acos(std::clamp(load.force_n->normalized().dot(load.direction.normalized()), -1.0, 1.0));
        if (angle_rad < sideways_rad || angle_rad > EIGEN_PI - sideways_rad) continue;  // what pulls is said elsewhere
        return say(fmt::format("force_n of push '{}' points {:.0f} degrees away from 'direction', aside of the push; is one of them in another frame, or "
                               "along another axis?",
                               push.name, angle_rad * 180 / EIGEN_PI),
                   step.source);
      }
    }
  }

  /// A measured force acts on a patch of the tool's radius; a ball's patch grows with its depth (Hertz 1882). Where its travel was
  /// read a fit goes by that.
  void look_at_ball(const Tool& ball) {
    double deepest_m = 0;
    bool is_unknown = false;
    for (const Push& push : recording_.pushes) {
      if (shows_what_it_touches(ball, push) && !recording_.free) continue;
      for (const Step& step : push.steps)
        for (const Load& load : step.loads) {
          if (load.tool != ball.name || !load.force_n || load.force_n->norm() == 0) continue;
          is_unknown = true;
          if (const ToolTravel* travel = observed_travel(step, load)) deepest_m = std::max(deepest_m, travel->travel_m);
        }
    }
    const double touched_m = std::sqrt(ball.radius_m * deepest_m);
    constexpr double nearly_all = 0.8;
    if (!is_unknown || touched_m > nearly_all * ball.radius_m) return;
    const std::string seen =
        deepest_m > 0 ? fmt::format("at its deepest, {:.3g} m, it touches about {:.2g} m", deepest_m, touched_m) : "it touches less where it is shallow";
    say(fmt::format("a measured force of '{}' is taken to press all of its radius ({:.3g} m), but a ball touches about the root of radius times depth: "
                    "{}. E comes out too low then; observe its travel in every step that presses, or give the patch's radius as a disc's, or radius_std_m",
                    ball.name, ball.radius_m, seen),
        recording_.source);
  }

  void look_at(const Load& load, double usual_n, const Step& step) {
    if (!load.force_n) return;
    const double force_n = load.force_n->norm();
    if (force_n > 1e4) say(fmt::format("the force of '{}' is above 10 kN; is it in mN?", load.tool), step.source);
    if (force_n > 100 * usual_n)
      say(fmt::format("the force of {:.3g} N is more than a hundred times that of most steps ({:.3g} N)", force_n, usual_n), step.source);
    if (force_n > 0 && load.force_std_n > force_n)
      say(fmt::format("the force of '{}' is known to worse than itself (force_std_n {:.3g} N); such steps tell next to nothing",
                      load.tool, load.force_std_n),
          step.source);
  }

  void look_at(const DepthFrame& frame, const Step& step) {
    const Camera& camera = frame.camera;
    const double shape = camera.fx_px / camera.fy_px;
    if (shape < 0.5 || shape > 2)
      say(fmt::format("fx_px {:.4g} and fy_px {:.4g} of its camera are far from each other; pixels are mostly square",
                      camera.fx_px, camera.fy_px),
          step.source);
    const auto far_aside = [](double at_px, int size_px) { return at_px < 0.1 * size_px || at_px > 0.9 * size_px; };
    if (far_aside(camera.cx_px, camera.width_px) || far_aside(camera.cy_px, camera.height_px))
      say(fmt::format("cx_px {:.4g}, cy_px {:.4g} of its camera are far from the middle of the image of {} x {} pixels", camera.cx_px,
                      camera.cy_px, camera.width_px, camera.height_px),
          step.source);
    if (frame.noise.model == "constant") look_at_sigma(frame.noise.sigma_m, "the depth", step);
    look_at_time(frame.time_s, "image", step);
  }

  void look_at_sigma(double sigma_m, const std::string& whose, const Step& step) {
    if (extent_.known && sigma_m > 0.2 * extent_.diagonal_m)
      say(fmt::format("sigma_m of {} is {:.3g} m for an object of {:.3g} m; nothing is seen so, is it in metres?", whose, sigma_m,
                      extent_.diagonal_m),
          step.source);
    else if (sigma_m < 1e-7)
      say(fmt::format("sigma_m of {} is {:.3g} m, finer than any sensor; intervals will be too narrow", whose, sigma_m), step.source);
  }

  void look_at_time(double time_s, const char* what, const Step& step) {
    constexpr double far_s = 60;
    if (time_s != 0 && std::abs(time_s - step.time_s) > far_s)
      say(fmt::format("time_s of a{} {} is more than a minute from that of its step; are both of one clock?",
                      *what == 'i' ? "n" : "", what),
          step.source);
  }

  void look_at_joints(const Step& step) {
    if (!recording_.robot) return;
    for (std::size_t i = 0; i < step.joints_rad.size() && i < recording_.joint_names.size(); ++i) {
      for (const RobotJoint& joint : recording_.robot->joints) {
        if (joint.name != recording_.joint_names[i] || !(joint.lower < joint.upper)) continue;
        constexpr double slack = 0.05;
        if (step.joints_rad[i] < joint.lower - slack || step.joints_rad[i] > joint.upper + slack)
          say(fmt::format("joint '{}' is beyond its limits ({:.3g} to {:.3g}); joints_rad is in radians", joint.name, joint.lower,
                          joint.upper),
              step.source);
      }
    }
  }

  const Recording& recording_;
  Extent extent_;
  std::set<std::string> known_;
  std::vector<std::string> said_;
};

}  // namespace

void check_numbers(const Recording& recording, std::vector<Problem>& problems) { NumberChecker(recording, problems).check(); }

std::vector<std::string> odd_numbers(const Recording& recording) { return OddNumbers(recording).all(); }

}  // namespace palpate::io
