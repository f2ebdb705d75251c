// SPDX-License-Identifier: Apache-2.0
// What the lab's camera sees: where it stands, or carried around the untouched object.
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/lab/robot.hpp"
#include "palpate/lab/robot_parts.hpp"
#include "palpate/lab/scene.hpp"

namespace palpate::lab {

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

}  // namespace palpate::lab
