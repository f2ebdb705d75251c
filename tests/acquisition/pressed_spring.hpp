// SPDX-License-Identifier: Apache-2.0
// Streams of a made-up lab whose truth is known in closed form: a spring that is pressed in stages, seen by a sensor that is
// mounted askew, biased and late.
#pragma once

#include <cmath>
#include <random>

#include "palpate/acquisition/from_streams.hpp"

namespace palpate::acquisition::test {

constexpr double stiffness_n_m = 400, top_m = 0.1;

/// Height of the tip: down in stages of 5 mm from 2 cm above the object, up again in two.
inline double height_m(double time_s) {
  struct Stage {
    double until_s, to_m;
  };
  // Each stage moves at 10 mm/s and then stands.
  const Stage stages[] = {{4, 0.12}, {8, 0.095}, {12, 0.09}, {16, 0.085}, {20, 0.08}, {24, 0.09}, {30, 0.12}};
  double height = 0.12, begin = 0;
  for (const Stage& stage : stages) {
    const double way = stage.to_m - height, duration = std::abs(way) / 0.01;
    if (time_s < stage.until_s) return height + way * (duration > 0 ? std::min(1.0, (time_s - begin) / duration) : 1.0);
    height = stage.to_m;
    begin = stage.until_s;
  }
  return height;
}
inline double force_n(double time_s) { return stiffness_n_m * std::max(0.0, top_m - height_m(time_s)); }

struct LabOptions {
  double wrench_late_s = 0, camera_late_s = 0;
  double noise_n = 0.02;
  Vec3 bias_n{1.5, -0.7, 3};
  Vec3 drift_n_s = Vec3::Zero();  ///< of the bias, sensor axes
};

inline Pose tip_at(double time_s) {
  Pose pose = Pose::Identity();
  pose.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;  // z down
  pose.translation() = Vec3(0.3, 0.1, height_m(time_s));
  return pose;
}

/// The camera looks down; its picture is the tool as a square patch at the tip's depth before a plane 1 m away.
inline DepthImage picture(double time_s) {
  DepthImage image = DepthImage::Constant(48, 64, 1.0f);
  image.block(20, 20, 10, 10).setConstant(static_cast<float>(0.9 - height_m(time_s)));
  image.block(5, 30 + static_cast<int>(std::lround(1000 * height_m(time_s))) % 20, 10, 4).setConstant(0.7f);
  return image;
}

inline SensorStreams lab(const LabOptions& options = {}) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  SensorStreams streams;
  FrameLink tip{"base", "tip", false, {}}, sensor{"tip", "sensor", true, {}}, camera{"base", "camera", true, {}};
  for (int i = 0; i <= 3000; ++i) tip.samples.push_back({0.01 * i, tip_at(0.01 * i)});
  Pose askew = Pose::Identity();
  askew.rotate(Eigen::AngleAxisd(0.8, Vec3(1, 2, 3).normalized()));
  sensor.samples.push_back({0, askew});
  camera.samples.push_back({0, Pose::Identity()});
  streams.frames = {tip, sensor, camera};
  streams.wrench_frame = "sensor";
  for (int i = 0; i < 6000; ++i) {
    const double time = 0.005 * i;
    const Vec3 on_object(0, 0, -force_n(time));
    const Mat3 R_base_sensor = tip_at(time).linear() * askew.linear();
    const Vec3 noise(normal(random), normal(random), normal(random));
    streams.wrenches.push_back({time + options.wrench_late_s,
                                -(R_base_sensor.transpose() * on_object) + options.bias_n + time * options.drift_n_s + options.noise_n * noise,
                                Vec3::Zero()});
  }
  DepthStream depth;
  depth.name = "/depth";
  depth.frame = "camera";
  depth.like.camera = {64, 48, 50, 50, 31.5, 23.5, DistortionModel::none, {}};
  depth.like.noise.sigma_m = 0.002;
  for (int i = 0; i < 900; ++i) depth.times_s.push_back(i / 30.0 + options.camera_late_s);
  depth.image = [late = options.camera_late_s, times = depth.times_s](std::size_t i) { return picture(times[i] - late); };
  streams.cameras.push_back(depth);
  streams.end_s = 30;
  return streams;
}

inline StreamPlan stream_plan() {
  StreamPlan plan;
  plan.base_frame = "base";
  plan.tip_frame = "tip";
  plan.any_push.tool = "stick";
  plan.any_push.travel_sigma_m = {0.0005};
  Tool stick;
  stick.name = "stick";
  plan.recording.tools.push_back(stick);
  plan.source = "mapping.yaml";
  return plan;
}

inline double travel_of(const Step& step) {
  for (const Observation& one : step.observations)
    if (const auto* travel = std::get_if<ToolTravel>(&one)) return travel->travel_m;
  return std::nan("");
}

}  // namespace palpate::acquisition::test
