// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_mapping.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>

#include "io/bag_files.hpp"
#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_survey.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io {
namespace {

using namespace palpate::io::test;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

class Mapping : public testing::Test {
 protected:
  void SetUp() override {
    write_bag(made_up(), folder.path() / "bag");
    text = folder.get("bag/mapping.yaml");
  }
  /// What is said when the mapping is changed in one place.
  std::string complaint(const std::string& from, const std::string& to) {
    EXPECT_NE(text.find(from), std::string::npos) << from;
    std::string changed = text;
    changed.replace(changed.find(from), from.size(), to);
    folder.put("bag/mapping.yaml", changed);
    try {
      read_back(folder.path() / "bag");
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  }
  TemporaryFolder folder{"bag_mapping"};
  std::string text;
};

TEST_F(Mapping, ErrorsNameFileLineFieldAndCure) {
  const struct {
    const char *from, *to;
    std::vector<const char*> said;
  } cases[] = {
      {"palpate-mapping/1", "palpate-mapping/9", {"mapping.yaml:1: format", "palpate-mapping/1"}},
      {"frames: {base", "framse: {base", {"key 'frames' is missing", "is 'framse' in line"}},
      {"frames: {base: base", "frames: {bse: base", {"key 'base' is missing", "frames"}},
      {"wrench: /wrench", "wrench: /wrenhc", {"topics.wrench", "no topic '/wrenhc'", "did you mean '/wrench'"}},
      {"wrench: /wrench", "wrench: wrench", {"topics.wrench", "starts with '/'"}},
      {"wrench: /wrench", "wrench: /tf", {"topics.wrench", "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/WrenchStamped"}},
      {"image: /camera_1/depth/image",
       "image: /camera_1/depth/imge",
       {"topics.depth[0].image", "did you mean '/camera_1/depth/image'"}},
      {"force_on_object", "force_on_objct", {"wrench.reports", "did you mean 'force_on_object'"}},
      {"tare: none", "tare: {from_s: 2, to_s: 1}", {"wrench.tare.to_s", "later"}},
      {"by: marks", "by: mark", {"steps.by", "did you mean 'marks'"}},
      {"by: marks", "by: times", {"steps.pushes[0]", "at_s"}},
      {"marks: /palpate/marks", "joints: /tf", {"steps.by", "topics.marks"}},
      {"window_s: 0.03", "window_s: -1", {"steps.window_s", "larger than 0"}},
      {"window_s: 0.03", "windw_s: 0.03", {"steps.windw_s", "did you mean 'window_s'"}},
      {"tool: \"stick\"", "tool: \"stik\"", {"steps.pushes[0].tool", "did you mean 'stick'"}},
      {"tip: tip", "tip: tcp", {"frames", "'tcp'", "is not connected", "camera_1"}},
      {"rest.vtu", "rst.vtu", {"rest.volume_mesh", "rst.vtu"}},
  };
  for (const auto& one : cases) {
    const std::string said = complaint(one.from, one.to);
    for (const char* part : one.said) EXPECT_THAT(said, HasSubstr(part)) << one.from << " -> " << one.to;
  }
}

/// The same messages in another container.
TEST_F(Mapping, ADatabaseGivesTheSameRecording) {
  const MessageSource bag = read_bag(folder.path() / "bag");
  std::vector<TestMessage> messages;
  for (const Message& one : bag.messages)
    messages.push_back({bag.topics[one.topic].name, bag.topics[one.topic].type, one.log_time_ns, std::string(one.data)});
  std::reverse(messages.begin(), messages.end());
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const SensorStreams streams = read_streams(parse_bag(sqlite_bytes(messages), "b.db3"), mapping);
  const Recording a = read_back(folder.path() / "bag"), b = acquisition::recording_from(mapping.plan, streams).recording;
  ASSERT_EQ(a.pushes.size(), b.pushes.size());
  for (std::size_t p = 0; p < a.pushes.size(); ++p) {
    ASSERT_EQ(a.pushes[p].steps.size(), b.pushes[p].steps.size());
    for (std::size_t i = 0; i < a.pushes[p].steps.size(); ++i) {
      const Step &x = a.pushes[p].steps[i], &y = b.pushes[p].steps[i];
      EXPECT_EQ(x.time_s, y.time_s);
      ASSERT_EQ(x.observations.size(), y.observations.size());
      if (!x.loads.empty()) {
        EXPECT_EQ(*x.loads[0].force_n, *y.loads[0].force_n);
      }
    }
  }
}

TEST_F(Mapping, ADamagedMessageIsLeftOutWithAWord) {
  const MessageSource bag = read_bag(folder.path() / "bag");
  MessageSource hurt = bag;
  for (Message& one : hurt.messages) {
    if (hurt.topics[one.topic].name != "/wrench") continue;
    one.data = one.data.substr(0, 9);
    break;
  }
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const SensorStreams streams = read_streams(hurt, mapping);
  EXPECT_THAT(streams.warnings, Contains(AllOf(HasSubstr("1 of 12"), HasSubstr("/wrench"))));
}

TEST_F(Mapping, StampsOfASimulationAreBroughtToTheRecordersClock) {
  MessageSource late = read_bag(folder.path() / "bag");
  for (Message& one : late.messages) one.log_time_ns += 1'700'000'000'000'000'000;
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const SensorStreams streams = read_streams(late, mapping);
  EXPECT_THAT(streams.warnings, Contains(HasSubstr("differ by")));
  const Recording back = acquisition::recording_from(mapping.plan, streams).recording;
  EXPECT_EQ(back.pushes[0].steps[1].loads.size(), 1u);
  EXPECT_NEAR(back.pushes[0].steps[1].loads[0].force_n->z(), -1.7, 1e-12);
}

/// A recorder that starts its clock by another computer's: marks are told by the recorder, forces by their headers.
TEST_F(Mapping, ClocksThatDifferBySecondsAreBroughtTogether) {
  MessageSource late = read_bag(folder.path() / "bag");
  for (Message& one : late.messages) one.log_time_ns += 20'000'000'000;
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const SensorStreams streams = read_streams(late, mapping);
  EXPECT_THAT(streams.warnings, Contains(HasSubstr("differ by")));
  EXPECT_NEAR(acquisition::recording_from(mapping.plan, streams).recording.pushes[0].steps[1].loads.at(0).force_n->z(), -1.7, 1e-12);
}

/// The same CameraInfo stands beside images as they were taken (K and D) and rectified ones (P).
TEST_F(Mapping, RectifiedImagesAreNotUndistortedAgain) {
  const MessageSource bag = read_bag(folder.path() / "bag");
  const Camera taken{64, 48, 525, 526, 31, 23, DistortionModel::plumb_bob, {0.18, -0.4, 0, 0, 0}};
  std::string info = encode(RosCameraInfo{{1, "camera_1"}, taken});
  const double fx = 525, fx_rectified = 540;
  info.replace(info.rfind(std::string(reinterpret_cast<const char*>(&fx), 8)), 8, reinterpret_cast<const char*>(&fx_rectified), 8);
  const auto camera_by = [&](const std::string& key, const std::string& topic, std::string* said = nullptr) {
    MessageSource changed = bag;
    for (Message& one : changed.messages)
      if (changed.topics[one.topic].name == "/camera_1/depth/camera_info") one.data = info;
    for (MessageTopic& one : changed.topics)
      if (one.name == "/camera_1/depth/image") one.name = topic;
    std::string mapping_text = text;
    const std::string image = "image: /camera_1/depth/image";
    mapping_text.replace(mapping_text.find(image), image.size(), key + "image: " + topic);
    folder.put("bag/changed.yaml", mapping_text);
    BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
    const SensorStreams streams = read_streams(changed, mapping);
    if (said != nullptr)
      for (const std::string& one : streams.warnings) *said += one;
    return streams.cameras.at(0).like.camera;
  };
  const std::string plain = "/camera_1/depth/image", straight = "/camera_1/depth/image_rect";
  EXPECT_EQ(camera_by("rectified: true, ", plain).fx_px, 540);
  EXPECT_EQ(camera_by("rectified: true, ", plain).distortion, DistortionModel::none);
  EXPECT_EQ(camera_by("rectified: false, ", straight).fx_px, 525);
  EXPECT_EQ(camera_by("rectified: false, ", straight).distortion, DistortionModel::plumb_bob);
  std::string said;
  EXPECT_EQ(camera_by("", straight, &said).fx_px, 540);
  EXPECT_THAT(said, AllOf(HasSubstr("taken as rectified"), HasSubstr("rectified: true or false")));
  EXPECT_EQ(camera_by("", plain, &said).fx_px, 525);
  EXPECT_THAT(said, HasSubstr("taken as not rectified"));
}

/// An arm and its gripper on one topic, the gripper first.
TEST_F(Mapping, JointsOfSeveralSendersComeTogether) {
  MessageSource bag = read_bag(folder.path() / "bag");
  std::deque<std::string> data;
  const auto tell = [&](double time_s, const std::vector<std::string>& names, const std::vector<double>& positions) {
    const auto stamp = bag.messages.front().log_time_ns + static_cast<std::int64_t>(time_s * 1e9);
    data.push_back(encode(RosJointState{{stamp, ""}, names, positions}));
    bag.messages.push_back({bag.topics.size(), stamp, data.back()});
  };
  tell(0.0, {"finger"}, {0.01});
  tell(0.1, {"j2", "j1"}, {2, 1});
  tell(0.2, {"finger"}, {0.02});
  tell(0.3, {"j1", "j2"}, {3, 4});
  MessageTopic topic;
  topic.name = "/joint_states";
  topic.type = "sensor_msgs/msg/JointState";
  topic.messages = 4;
  topic.encoding = MessageEncoding::cdr;
  bag.topics.push_back(topic);
  std::string changed = text;
  changed.replace(changed.find("wrench: /wrench"), 15, "joints: /joint_states\n  wrench: /wrench");
  folder.put("bag/changed.yaml", changed);
  BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
  const SensorStreams streams = read_streams(bag, mapping);
  EXPECT_THAT(streams.joint_names, testing::ElementsAre("finger", "j2", "j1"));
  ASSERT_EQ(streams.joints.size(), 4u);
  EXPECT_THAT(streams.joints[0].positions, testing::ElementsAre(0.01, 2, 1)) << "not seen yet: as they will first be seen";
  EXPECT_THAT(streams.joints[2].positions, testing::ElementsAre(0.02, 2, 1));
  EXPECT_THAT(streams.joints[3].positions, testing::ElementsAre(0.02, 4, 3));
}

TEST_F(Mapping, ASurveySuggestsAMappingThatNamesWhatIsThere) {
  const BagSurvey found = survey(read_bag(folder.path() / "bag"));
  EXPECT_TRUE(found.missing.empty()) << found.missing.front();
  for (const char* part :
       {"wrench: /wrench", "image: /camera_1/depth/image, info: /camera_1/depth/camera_info", "base: base, tip: tip"})
    EXPECT_THAT(found.mapping, HasSubstr(part));
  // Filled in, it is a mapping.
  std::string filled = found.mapping;
  const std::string mesh = "FILL_IN.stl";
  filled.replace(filled.find("surface_mesh: " + mesh), 14 + mesh.size(), "volume_mesh: rest.vtu");
  folder.put("bag/filled.yaml", filled);
  EXPECT_NO_THROW(read_mapping(folder.path() / "bag/filled.yaml"));
}

TEST(Survey, SaysWhatIsMissing) {
  const MessageSource empty = parse_bag(mcap_bytes({}, McapWriter::Compression::none), "a");
  const BagSurvey found = survey(empty);
  EXPECT_THAT(found.missing, Contains(HasSubstr("no force")));
  EXPECT_THAT(found.missing, Contains(HasSubstr("/tf")));
  EXPECT_THAT(found.missing, Contains(HasSubstr("depth image")));
  EXPECT_THAT(found.mapping, HasSubstr("wrench: FILL_IN"));
}

}  // namespace
}  // namespace palpate::io
