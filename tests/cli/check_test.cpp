// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate check` on a rigid block that a robot with a yielding arm and a camera that stands elsewhere has pushed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>

#include "geometry/shapes.hpp"
#include "palpate/io/recording.hpp"
#include "palpate/sensing/depth_render.hpp"
#include "temporary_folder.hpp"

namespace check_test {
namespace {

namespace fs = std::filesystem;
using namespace palpate;

/// @param camera_off_m  where the camera really stands, from where it is said to
Recording pushed_block(const Vec3& camera_off_m, double compliance_m_per_n) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Recording recording;
  recording.name = "rigid block";
  recording.rest.surface = shapes::box(Vec3(0.1, 0.1, 0.08), Vec3(0.5, -0.05, 0));
  Support table;
  table.kind = SupportKind::plane;
  table.tolerance_m = 0.002;
  recording.supports = {table};
  recording.force_scale_std = 0.01;
  Tool stick;
  stick.name = "stick";
  stick.shape = ToolShape::disc;
  stick.radius_m = 0.01;
  recording.tools = {stick};
  DepthFrame camera;
  camera.camera = {200, 160, 260, 260, 99.5, 79.5, DistortionModel::none, {}};
  const Vec3 eye(0.3, -0.3, 0.35), forward = (Vec3(0.55, 0, 0.04) - eye).normalized(),
                                   right = forward.cross(Vec3::UnitZ()).normalized();
  camera.T_base_camera.linear() << right, forward.cross(right), forward;
  camera.T_base_camera.translation() = eye;
  camera.noise.sigma_m = 5e-4;
  camera.pose_std_m = 5e-4;
  camera.pose_std_rad = 5e-4;
  const std::pair<Vec3, Vec3> places[] = {
      {{0.55, 0, 0.08}, {0, 0, -1}}, {{0.5, 0, 0.04}, {1, 0, 0}}, {{0.55, -0.05, 0.04}, {0, 1, 0}}};
  for (const auto& [contact, direction] : places) {
    Push& push = recording.pushes.emplace_back();
    push.name = "push " + std::to_string(recording.pushes.size());
    push.force_tare_std_n = 0.02;
    push.travel_offset_std_m = 2e-4;
    for (const double force : {0.0, 6.0, 12.0, 18.0}) {
      Step& step = push.steps.emplace_back();
      step.time_s = static_cast<double>(push.steps.size());
      if (force > 0) {
        Load load;
        load.tool = "stick";
        load.force_n = (force + 0.01 * normal(random)) * direction;
        load.force_std_n = 0.01;
        load.contact_m = contact;
        load.direction = direction;
        step.loads = {load};
        ToolTravel travel;
        travel.tool = "stick";
        travel.sigma_m = 1e-4;
        travel.travel_m = compliance_m_per_n * force + travel.sigma_m * normal(random);
        step.observations.emplace_back(travel);
      }
      DepthFrame frame = camera;
      Pose true_pose = camera.T_base_camera;
      true_pose.pretranslate(camera_off_m);
      frame.depth_m = sensing::render_depth({{&*recording.rest.surface, Pose::Identity()}}, camera.camera, true_pose);
      for (Index i = 0; i < frame.depth_m.size(); ++i)
        if (frame.depth_m.data()[i] > 0)
          frame.depth_m.data()[i] += static_cast<float>(camera.noise.sigma_m * normal(random));
      step.observations.emplace_back(frame);
    }
  }
  return recording;
}

struct Answer {
  int exit_code = -1;
  nlohmann::json json;
  std::string text;  ///< what people read
};

Answer check(const Recording& recording, const std::string& options) {
  const test::TemporaryFolder files("check");
  const fs::path folder = files / "block", out = files / "answer.json";
  io::write_recording(recording, folder);
  const std::string command = std::string(PALPATE_CLI) + " check " + folder.string() + " --json " + options + " > " +
                              out.string() + " 2> " + (files / "text").string();
  Answer answer;
  answer.exit_code = WEXITSTATUS(std::system(command.c_str()));
  std::ifstream file(out);
  answer.json = nlohmann::json::parse(file, nullptr, false);
  std::ifstream text(files / "text");
  answer.text.assign(std::istreambuf_iterator<char>(text), {});
  return answer;
}

const nlohmann::json& error_named(const nlohmann::json& json, const std::string& name) {
  for (const auto& error : json["errors"])
    if (error["name"] == name) return error;
  throw std::runtime_error("no error " + name);
}

TEST(Check, GoodRigPasses) {
  const Answer answer = check(pushed_block(Vec3::Zero(), 0), "--rigid");
  EXPECT_EQ(answer.exit_code, 0) << answer.json.dump(1);
  EXPECT_TRUE(answer.json["consistent"].get<bool>());
  // A rigid block says nothing of the force's scale; digits beyond what is known are noise to the eye.
  EXPECT_THAT(answer.text, testing::HasSubstr("nothing is known of force_scale\n"));
  EXPECT_THAT(answer.text, testing::Not(testing::ContainsRegex("[.][0-9][0-9][0-9][0-9][0-9]")));
}

TEST(Check, CameraAndComplianceThatAreOffAreFoundAndNamed) {
  const Vec3 off_m(0.006, -0.004, 0.003);
  const Answer answer = check(pushed_block(off_m, 2e-4), "--rigid");
  EXPECT_EQ(answer.exit_code, 1);
  for (int d = 0; d < 3; ++d) {
    const auto& error = error_named(answer.json, std::string("hand_eye_") + "xyz"[d]);
    EXPECT_NEAR(error["value"].get<double>(), off_m(d), 5e-4) << error.dump();
    EXPECT_FALSE(error["consistent"].get<bool>());
  }
  EXPECT_NEAR(error_named(answer.json, "compliance")["value"].get<double>(), 2e-4, 1e-5);
  std::vector<std::string> codes;
  for (const auto& verdict : answer.json["verdicts"]) codes.push_back(verdict["code"]);
  EXPECT_THAT(codes, testing::IsSupersetOf({"hand_eye_off", "compliance_off", "force_scale_not_determined"}));
  EXPECT_THAT(answer.text, testing::ContainsRegex("stick and arm give way by 0[.]20[0-9]? mm per newton more than"));
  EXPECT_THAT(answer.text, testing::Not(testing::HasSubstr("is consistent with what the recording states")));
  EXPECT_THAT(answer.text, testing::Not(testing::ContainsRegex("[.][0-9][0-9][0-9][0-9][0-9]")));
}

TEST(Check, TheBodyMustBeSaidAndBeOneOfTwo) {
  const Recording recording = pushed_block(Vec3::Zero(), 0);
  EXPECT_EQ(check(recording, "").exit_code, 2);
  EXPECT_EQ(check(recording, "--rigid --stiffness 500").exit_code, 2);
  EXPECT_EQ(check(recording, "--rigid --placed-within -1").json["error"]["message"], "--placed-within: must be 0 or a number above it, is -1 (`palpate check --help`)");
}

}  // namespace
}  // namespace check_test
