// SPDX-License-Identifier: Apache-2.0
// A robot in a few lines: its tip presses the soft block of the planning tests wherever it is told to, and a camera of few
// pixels looks on. The truth is linear, on a mesh twice as fine as the estimate's.
#pragma once

#include <random>

#include "estimation/planned_scene.hpp"
#include "palpate/acquisition/robot.hpp"
#include "palpate/explore.hpp"
#include "palpate/sensing/depth_render.hpp"

namespace palpate {

class BlockRobot : public acquisition::Robot {
 public:
  /// @param harder  the half beyond the middle is so many times as stiff; 1: it is one material, and nobody asks
  explicit BlockRobot(unsigned seed, double harder = 1) : random_(seed), truth_(estimation::block_object(2)), harder_(harder) {
    if (harder != 1) estimation::in_regions(truth_, halves());
    for (int k = 0; k < 3; ++k) bias_n_(k) = 0.2 * normal_(random_);
    camera_.camera = {120, 100, 320, 320, 59.5, 49.5, DistortionModel::none, {}};
    camera_.noise.sigma_m = 1e-3;
    camera_.robot_is_masked = true;  // it sees through the stick
    camera_.pose_std_m = 5e-4;
    camera_.pose_std_rad = 1e-3;
    const Vec3 forward = (Vec3(0.04, 0.04, 0.03) - estimation::camera_eye_m).normalized();
    const Vec3 right = forward.cross(Vec3::UnitZ()).normalized();
    camera_.T_base_camera.linear() << right, forward.cross(right), forward;
    camera_.T_base_camera.translation() = estimation::camera_eye_m;
    tip_.translation() = Vec3(0.04, 0.04, 0.2);
  }

  static std::vector<Region> halves() {
    Region near;
    near.name = "near";
    near.select = RegionSelection::box;
    near.box_min_m = Vec3(-1, -1, -1);
    near.box_max_m = Vec3(0.5 * estimation::soft_block_m.x(), 1, 1);
    Region far;
    far.name = "far";
    return {near, far};
  }

  /// The scene as a person would write it down.
  Recording scene() const {
    Recording scene = estimation::block_on_table();
    if (harder_ != 1) scene.regions = halves();
    scene.name = "block";
    scene.rest.volume = estimation::kuhn_block(5, 5, 4, estimation::soft_block_m);
    scene.environment.planes = {Plane{}};
    scene.model.refine = "none";
    scene.model.material = "linear";
    return scene;
  }

  acquisition::PushPlan plan(const estimation::PushCandidate& at) {
    contact_m_ = at.contact_m;
    direction_ = at.direction;
    press();
    acquisition::PushPlan plan;
    plan.tool = "pad";
    plan.contact_m = at.contact_m;
    plan.direction = at.direction;
    plan.R_base_tip = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), at.direction).toRotationMatrix();
    return plan;
  }

  acquisition::RobotState read() override {
    acquisition::RobotState state;
    state.time_s = clock_s_;
    state.T_base_tip = tip_;
    state.force_n = bias_n_ + force_n() * direction_;
    for (int k = 0; k < 3; ++k) state.force_n(k) += 0.02 * normal_(random_);
    return state;
  }
  acquisition::Motion move(const Pose& T_base_tip, double speed_m_s) override {
    clock_s_ += (T_base_tip.translation() - tip_.translation()).norm() / speed_m_s;
    tip_ = T_base_tip;
    return refuses ? acquisition::Motion::refused : acquisition::Motion::done;
  }
  void stop() override {}
  void wait(double duration_s) override { clock_s_ += duration_s; }
  double travel_sigma_m() const override { return 3e-4; }
  DepthFrame take_depth_image() override {
    DepthFrame frame = camera_;
    frame.time_s = clock_s_;
    TriMesh seen = truth_.surface.rest();
    if (per_newton_m_.size() > 0) {
      for (Index v = 0; v < seen.vertices_m.rows(); ++v)
        seen.vertices_m.row(v) += force_n() * per_newton_m_.segment<3>(3 * v).transpose();
    }
    frame.depth_m = sensing::render_depth({{&seen, Pose::Identity()}}, frame.camera, frame.T_base_camera);
    for (Index i = 0; i < frame.depth_m.size(); ++i) {
      const double noise_m = camera_.noise.sigma_m * normal_(random_);
      if (frame.depth_m.data()[i] > 0) frame.depth_m.data()[i] += static_cast<float>(noise_m);
    }
    return frame;
  }

  bool refuses = false;  ///< every motion from now on
  int places = 0;        ///< that were pressed, new ones

 private:
  double force_n() const {
    const Vec3 off_m = tip_.translation() - contact_m_;
    const double travel_m = off_m.dot(direction_);
    if ((off_m - travel_m * direction_).norm() > 0.002) return 0;  // on its way past the block
    return give_m_per_n_ > 0 ? std::max(0.0, travel_m) / give_m_per_n_ : 0;
  }
  void press() {
    Recording one = estimation::block_on_table();
    one.force_scale_std = 0;
    one.model.poisson_fixed = estimation::true_poisson;
    Load load;
    load.tool = "pad";
    load.force_n = direction_;
    load.contact_m = contact_m_;
    load.direction = direction_;
    one.pushes.emplace_back().steps.emplace_back().loads = {load};
    estimation::Unknowns unknowns;
    estimation::ForwardModel model(one, truth_, unknowns);
    VectorX at = unknowns.prior_mean();
    at(estimation::log_young) = std::log(estimation::true_young_pa);
    at(estimation::poisson) = estimation::true_poisson;
    if (harder_ != 1) at(estimation::first_ratio) = std::log(harder_);
    const auto pressed = model.predict(0, at);
    give_m_per_n_ = pressed.travel_m(0);
    const Points moved = pressed.surface_m - truth_.surface.rest().vertices_m;
    per_newton_m_ = Eigen::Map<const VectorX>(moved.data(), moved.size());
    ++places;
  }

  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  estimation::SimulatedObject truth_;
  double harder_;
  Vec3 bias_n_, contact_m_ = Vec3::Zero(), direction_ = -Vec3::UnitZ();
  DepthFrame camera_;
  Pose tip_ = Pose::Identity();
  double clock_s_ = 0, give_m_per_n_ = 0;
  VectorX per_newton_m_;
};

}  // namespace palpate
