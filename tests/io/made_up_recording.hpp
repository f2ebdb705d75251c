// SPDX-License-Identifier: Apache-2.0
// A recording with all that a bag can say.
#pragma once

#include "io/recording_folder.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::io::test {

inline Recording made_up() {
  Recording recording;
  recording.name = "made up";
  const MeshData mesh = cube();
  recording.rest.volume = TetMesh{mesh.points_m, mesh.tetrahedra};
  Support table;
  table.kind = SupportKind::plane;
  table.name = "table";
  table.tolerance_m = 0.001;
  recording.supports.push_back(table);
  recording.environment.planes.push_back(Plane{});
  Tool stick;
  stick.name = "stick";
  stick.shape = ToolShape::disc;
  stick.radius_m = 0.02;
  recording.tools.push_back(stick);
  recording.density_kg_m3 = 30;
  recording.force_scale_std = 0.01;
  recording.force_cross_talk_std = 0.015;
  for (int p = 0; p < 2; ++p) {
    Push push;
    push.name = "push " + std::to_string(p + 1);
    push.site = p == 0 ? "left" : "right";
    push.force_tare_std_n = 0.02 + p;
    push.travel_offset_std_m = 0.0005;
    for (int i = 0; i < 4; ++i) {
      Step step;
      step.time_s = 3.1 * i;  // both pushes begin at 0
      step.unloading = i == 3;
      step.slipped = i == 2;
      Pose tip = Pose::Identity();
      tip.rotate(Eigen::AngleAxisd(3.0, Vec3(1, 0.1, 0).normalized()));
      tip.pretranslate(Vec3(0.05 + 0.01 * p, 0.05, 0.1 - 0.0031 * i));
      step.T_base_tip = tip;
      if (i > 0) {
        Load load;
        load.tool = "stick";
        load.force_n = Vec3(0.1, -0.2, -1.7 * i);
        load.force_std_n = 0.013 * i;
        load.contact_m = Vec3(0.05 + 0.01 * p, 0.05, 0.1);
        load.direction = -Vec3::UnitZ();
        load.contact_std_m = 0.001;
        step.loads.push_back(load);
        step.observations.emplace_back(ToolTravel{"stick", 0.0031 * i + 0.0002, 0.0004 + 1e-5 * i});
      }
      DepthFrame frame;
      frame.time_s = step.time_s;
      frame.camera = {8, 6, 10, 11, 3.5, 2.5, DistortionModel::none, {}};
      frame.T_base_camera = Eigen::Translation3d(0, 0, 0.5 + 0.01 * i) * Eigen::AngleAxisd(3.1, Vec3::UnitX());
      frame.noise.sigma_m = 0.002;
      frame.noise.bias_std_m = 0.001;
      frame.noise.shared_std_m = 0.0003;
      frame.noise.lens_scatter_std = 0.01;
      frame.pose_std_m = 0.0005;
      frame.depth_m = DepthImage::Constant(6, 8, 0.4321f + 0.01f * static_cast<float>(i));
      if (i != 2) {
        frame.mask = MaskImage::Zero(6, 8);
        frame.mask(1, 2) = 1;
        frame.robot_is_masked = true;
      }
      step.observations.emplace_back(frame);
      PointCloud cloud;
      cloud.points_m = Points::Constant(3, 3, 0.125 + 0.25 * i);  // exact in single precision
      cloud.normals = Points(0, 3);
      cloud.sigma_m = VectorX::Constant(1, 0.0015);
      step.observations.emplace_back(cloud);
      push.steps.push_back(step);
    }
    recording.pushes.push_back(push);
  }
  return recording;
}

}  // namespace palpate::io::test
