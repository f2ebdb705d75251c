// label: unit
// SPDX-License-Identifier: Apache-2.0
// Frames that no topic of a bag tells and its mapping does: the end of a stick, a camera by a calibration of one's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io::bag_fixed_frames_test {
namespace {

using namespace palpate::io::test;
using testing::Contains;
using testing::HasSubstr;

class FixedFrames : public testing::Test {
 protected:
  void SetUp() override {
    write_bag(made_up(), folder.path() / "bag");
    text = folder.get("bag/mapping.yaml");
  }
  struct Made {
    Recording recording;
    std::vector<std::string> warnings;
  };
  /// What is made of the bag with other frames in its mapping.
  Made made(const std::string& frames) {
    const std::string before = "frames: {base: base, tip: tip}";
    EXPECT_NE(text.find(before), std::string::npos);
    std::string changed = text;
    changed.replace(changed.find(before), before.size(), frames);
    folder.put("bag/mapping.yaml", changed);
    BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
    const SensorStreams streams = read_streams(read_bag(folder.path() / "bag"), mapping);
    Made result{acquisition::recording_from(mapping.plan, streams).recording, streams.warnings};
    return result;
  }
  std::string complaint(const std::string& frames) {
    try {
      made(frames);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  }
  TemporaryFolder folder{"fixed_frames"};
  std::string text;
};

Pose pose(const Vec3& position_m, const Eigen::Quaterniond& rotation) {
  Pose made = Pose::Identity();
  made.translation() = position_m;
  made.linear() = rotation.toRotationMatrix();
  return made;
}

std::vector<Pose> tips_of(const Recording& recording) {
  std::vector<Pose> poses;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      if (step.T_base_tip) poses.push_back(*step.T_base_tip);
  return poses;
}

std::vector<Pose> cameras_of(const Recording& recording) {
  std::vector<Pose> poses;
  for (const Push& push : recording.pushes)
    for (const Step& step : push.steps)
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one)) poses.push_back(frame->T_base_camera);
  return poses;
}

TEST_F(FixedFrames, TheEndOfAStickIsWhereTheMappingPutsIt) {
  const std::vector<Pose> before = tips_of(made("frames: {base: base, tip: tip}").recording);
  // A stick askew on the flange, in two parts, whose order in the list is of no matter.
  const Made askew = made(
      "frames:\n  base: base\n  tip: stick_end\n  fixed:\n"
      "    - {parent: stick, child: stick_end, T_parent_child: {position_m: [0, 0, 0.12], quaternion_xyzw: [0, 0, 0, 1]}}\n"
      "    - parent: tip\n      child: stick\n      T_parent_child: [[1, 0, 0, 0.01], [0, 0, -1, 0], [0, 1, 0, 0.03], [0, 0, 0, 1]]\n");
  const std::vector<Pose> after = tips_of(askew.recording);
  ASSERT_FALSE(before.empty());
  ASSERT_EQ(after.size(), before.size());
  const Pose stick = pose({0.01, 0, 0.03}, Eigen::Quaterniond(Eigen::AngleAxisd(EIGEN_PI / 2, Vec3::UnitX()))) * pose({0, 0, 0.12}, Eigen::Quaterniond::Identity());
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_TRUE(after[i].isApprox(before[i] * stick, 1e-12)) << i;
  EXPECT_THAT(askew.warnings, testing::Not(Contains(HasSubstr("frames.fixed"))));
}

TEST_F(FixedFrames, ACalibrationStandsInPlaceOfWhatTheTransformsSay) {
  const Made one = made(
      "frames: {base: base, tip: tip, fixed: [{parent: base, child: camera, "
      "T_parent_child: {position_m: [0.1, 0.2, 0.9], quaternion_xyzw: [1, 0, 0, 0]}}]}");
  const std::vector<Pose> cameras = cameras_of(one.recording);
  ASSERT_FALSE(cameras.empty());
  for (const Pose& camera : cameras) EXPECT_TRUE(camera.isApprox(pose({0.1, 0.2, 0.9}, {0, 1, 0, 0}), 1e-12));
  EXPECT_THAT(one.warnings, Contains(HasSubstr("'camera' stands on 'base' as frames.fixed says, not on 'base' as the bag's transforms say")));
}

TEST_F(FixedFrames, AHandThatCarriesTheCameraCarriesItAlong) {
  const Pose T_tip_camera = pose({0.05, 0, -0.1}, Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Vec3::UnitY())));
  const Eigen::Quaterniond q(T_tip_camera.linear());
  std::ostringstream frames;
  frames.precision(17);
  frames << "frames: {base: base, tip: tip, fixed: [{parent: tip, child: camera, T_parent_child: {position_m: [0.05, 0, -0.1], quaternion_xyzw: ["
         << q.x() << ", " << q.y() << ", " << q.z() << ", " << q.w() << "]}}]}";
  const Recording carried = made(frames.str()).recording;
  std::size_t seen = 0;
  for (const Push& push : carried.pushes)
    for (const Step& step : push.steps)
      for (const Observation& one : step.observations)
        if (const auto* frame = std::get_if<DepthFrame>(&one); frame != nullptr && step.T_base_tip) {
          EXPECT_TRUE(frame->T_base_camera.isApprox(*step.T_base_tip * T_tip_camera, 1e-9));
          ++seen;
        }
  EXPECT_GT(seen, 0u);
}

TEST_F(FixedFrames, ErrorsNameFileLineFieldAndCure) {
  const std::string somewhere = "T_parent_child: {position_m: [0, 0, 0.1], quaternion_xyzw: [0, 0, 0, 1]}";
  const struct {
    std::string fixed;
    std::vector<const char*> said;
  } cases[] = {
      {"{parent: tpi, child: end, " + somewhere + "}", {"mapping.yaml:", "frames.fixed[0].parent", "'tpi'", "did you mean 'tip'"}},
      {"{parent: tip, child: base, " + somewhere + "}", {"frames.fixed[0].child", "base frame", "inverse"}},
      {"{parent: tip, child: tip, " + somewhere + "}", {"frames.fixed[0].child", "parent itself"}},
      {"{parent: '', child: tip, " + somewhere + "}", {"frames.fixed[0].parent", "name"}},
      {"{parent: tip, child: end}", {"frames.fixed[0]", "T_parent_child", "quaternion_xyzw"}},
      {"{parent: tip, child: end, T_parent_child: {position_m: [0, 0, 0.1], quaternion_xyzw: [0, 0, 0, 2]}}",
       {"frames.fixed[0].T_parent_child.quaternion_xyzw", "length"}},
      {"{parent: tip, child: end, " + somewhere + "}, {parent: base, child: end, " + somewhere + "}",
       {"frames.fixed[1]", "'end'", "fixed to 'tip' already"}},
      {"{parent: a, child: b, " + somewhere + "}, {parent: b, child: a, " + somewhere + "}", {"frames.fixed[0]", "hangs on 'b' itself", "inverse"}},
      {"{parent: hand_mount, child: end, " + somewhere + "}", {"frames.fixed[0].parent", "'hand_mount'", "Known are base, "}},
  };
  for (const auto& one : cases) {
    const std::string said = complaint("frames: {base: base, tip: tip, fixed: [" + one.fixed + "]}");
    for (const char* part : one.said) EXPECT_THAT(said, HasSubstr(part)) << one.fixed;
  }
}

TEST_F(FixedFrames, AFrameIsNotTornOffTheBase) {
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  mapping.fixed_frames = {{"optical", "tip", Pose::Identity(), "mapping.yaml:3: frames.fixed[0]", "mapping.yaml:3: frames.fixed[0].parent"}};
  MessageSource bag = read_bag(folder.path() / "bag");
  // The camera's driver tells its own tree, which hangs on nothing, and the calibration was written the wrong way round.
  const std::string data = encode(std::vector<RosTransform>{{{bag.messages.front().log_time_ns, "camera_link"}, "optical", Pose::Identity()}});
  const auto tf = std::find_if(bag.topics.begin(), bag.topics.end(), [](const MessageTopic& one) { return one.type == "tf2_msgs/msg/TFMessage"; });
  ASSERT_NE(tf, bag.topics.end());
  bag.messages.push_back({std::size_t(tf - bag.topics.begin()), bag.messages.back().log_time_ns, data});
  try {
    read_streams(bag, mapping);
    FAIL();
  } catch (const Error& error) {
    for (const char* part : {"mapping.yaml:3: frames.fixed[0]", "tear 'tip' off 'base'", "'optical' is not connected", "inverse"})
      EXPECT_THAT(error.what(), HasSubstr(part));
  }
  // The right way round the camera hangs on the tip, with what its driver says.
  mapping.fixed_frames = {{"tip", "camera_link", Pose::Identity(), "", ""}};
  EXPECT_NO_THROW(read_streams(bag, mapping));
}

}  // namespace
}  // namespace palpate::io::bag_fixed_frames_test
