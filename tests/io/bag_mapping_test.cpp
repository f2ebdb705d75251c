// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag_mapping.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>

#include "io/bag_files.hpp"
#include "io/compressed_depth.hpp"
#include "io/made_up_recording.hpp"
#include "io/read_back.hpp"
#include "palpate/core/error.hpp"
#include "palpate/io/bag_survey.hpp"
#include "palpate/io/bag_write.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io::bag_mapping_test {
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
      {"palpate-mapping/1", "palpate-recording/1", {"mapping.yaml:1: format", "is a recording"}},
      {"frames: {base", "framse: {base", {"key 'frames' is missing", "is 'framse' in line"}},
      {"frames: {base: base", "frames: {bse: base", {"key 'base' is missing", "frames"}},
      {"wrench: /wrench", "wrench: /wrenhc", {"topics.wrench", "no topic '/wrenhc'", "did you mean '/wrench'"}},
      {"wrench: /wrench", "wrench: wrench", {"topics.wrench", "starts with '/'"}},
      {"wrench: /wrench", "wrench: /tf", {"topics.wrench", "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/WrenchStamped"}},
      {"image: /camera/depth/image",
       "image: /camera/depth/imge",
       {"topics.depth[0].image", "did you mean '/camera/depth/image'"}},
      {"force_on_object", "force_on_objct", {"wrench.reports", "did you mean 'force_on_object'"}},
      {"tare: none", "tare: {from_s: 2, to_s: 1}", {"wrench.tare.to_s", "later"}},
      {"by: marks", "by: mark", {"steps.by", "did you mean 'marks'"}},
      {"by: marks", "by: times", {"steps.pushes[0]", "at_s"}},
      {"marks: /palpate/marks", "joints: /tf", {"steps.by", "topics.marks"}},
      {"window_s: 0.03", "window_s: -1", {"steps.window_s", "larger than 0"}},
      {"window_s: 0.03", "windw_s: 0.03", {"steps.windw_s", "did you mean 'window_s'"}},
      {"tool: \"stick\"", "tool: \"stik\"", {"steps.pushes[0].tool", "did you mean 'stick'"}},
      {"tip: tip", "tip: tcp", {"mapping.yaml:", "frames.tip", "'tcp'", "is not connected", "camera"}},
      {"frames: {base: base",
       "frames: {base: bse",
       {"mapping.yaml:", "frames.base", "no transform names the base frame 'bse'", "base, camera"}},
      {"image: /camera/depth/image",
       "image: /tf",
       {"topics.depth[0].image", "Image or sensor_msgs/msg/CompressedImage is expected"}},
      {"image: /camera/depth/image",
       "image: /camera/mask",
       {"topics.depth[0].image", "encoding 'mono8'", "16UC1 or 32FC1", "Is it the mask?"}},
      {"mask: /camera/mask",
       "mask: /camera/depth/image",
       {"topics.depth[0].mask", "encoding '32FC1'", "a mask is mono8"}},
      {"name: \"push 1\"", "name: \"psuh 1\"", {"steps.pushes[0]", "no mark names the push 'psuh 1'", "'push 1', 'push 2'"}},
      {"window_s: 0.03", "window_s: 1e9", {"steps.window_s", "0.001 to 60 s"}},
      {"frames: {base",
       "clocks: {wrench_offset_s: estimate, largest_offset_s: 1e6}\nframes: {base",
       {"clocks.largest_offset_s", "0.01 to 10 s"}},
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
  const Camera taken{8, 6, 525, 526, 3, 2, DistortionModel::plumb_bob, {0.18, -0.4, 0, 0, 0}};
  std::string info = encode(RosCameraInfo{{1, "camera"}, taken});
  const double fx = 525, fx_rectified = 540;
  info.replace(info.rfind(std::string(reinterpret_cast<const char*>(&fx), 8)), 8, reinterpret_cast<const char*>(&fx_rectified), 8);
  const auto camera_by = [&](const std::string& key, const std::string& topic, std::string* said = nullptr) {
    MessageSource changed = bag;
    for (Message& one : changed.messages)
      if (changed.topics[one.topic].name == "/camera/depth/camera_info") one.data = info;
    for (MessageTopic& one : changed.topics)
      if (one.name == "/camera/depth/image") one.name = topic;
    std::string mapping_text = text;
    const std::string image = "image: /camera/depth/image";
    mapping_text.replace(mapping_text.find(image), image.size(), key + "image: " + topic);
    folder.put("bag/changed.yaml", mapping_text);
    BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
    const SensorStreams streams = read_streams(changed, mapping);
    if (said != nullptr)
      for (const std::string& one : streams.warnings) *said += one;
    return streams.cameras.at(0).like.camera;
  };
  const std::string plain = "/camera/depth/image", straight = "/camera/depth/image_rect";
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

/// What a sensor's clock is off by: said in seconds, or not at all where the recorder's clock is taken.
TEST_F(Mapping, OffsetsAndTheRecordersClockAreTaken) {
  const auto streams_with = [&](const std::string& clocks, std::int64_t stamped_late_ns, Recording* made) {
    MessageSource bag = read_bag(folder.path() / "bag");
    for (Message& one : bag.messages) one.log_time_ns -= stamped_late_ns;
    folder.put("bag/changed.yaml", text + clocks);
    BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
    const SensorStreams streams = read_streams(bag, mapping);
    if (made != nullptr) *made = acquisition::recording_from(mapping.plan, streams).recording;
    return streams;
  };
  const auto image_s = [](const Recording& recording, std::size_t step) {
    for (const Observation& one : recording.pushes.at(0).steps.at(step).observations)
      if (const auto* frame = std::get_if<DepthFrame>(&one)) return frame->time_s;
    return std::nan("");
  };
  Recording plain, moved, late;
  streams_with("", 0, &plain);
  // Images are looked for within 10 ms of a step: 4 ms are within, 20 ms are not.
  streams_with("clocks: {camera_offset_s: 0.004, wrench_offset_s: -0.002}\n", 0, &moved);
  EXPECT_NEAR(image_s(moved, 1) - image_s(plain, 1), 0.004, 1e-9);
  EXPECT_NEAR(moved.pushes[0].steps[1].loads.at(0).force_n->z(), -1.7, 1e-12)
      << "two samples on both sides of a force, still in the window";
  streams_with("clocks: {camera_offset_s: 0.02}\n", 0, &late);
  EXPECT_TRUE(std::isnan(image_s(late, 1)));

  // Headers that are 0.3 s ahead of the recorder: too little to pass for another clock.
  const SensorStreams by_header = streams_with("", 300'000'000, nullptr),
                      by_log = streams_with("clocks: {stamp: log}\n", 300'000'000, nullptr);
  const SensorStreams true_ones = streams_with("", 0, nullptr);
  EXPECT_NEAR(by_header.wrenches.at(0).time_s - true_ones.wrenches.at(0).time_s, 0.3, 1e-9);
  EXPECT_NEAR(by_log.wrenches.at(0).time_s, true_ones.wrenches.at(0).time_s, 1e-9);
  EXPECT_NEAR(by_log.cameras.at(0).times_s.at(2), true_ones.cameras.at(0).times_s.at(2), 1e-9);
}

TEST_F(Mapping, SaysWhetherTheRobotIsToBeTakenOutOfClouds) {
  const auto wanted = [&](const std::string& key) {
    std::string changed = text;
    const std::size_t at = changed.find("topic: /points");
    EXPECT_NE(at, std::string::npos);
    changed.erase(at, changed.find("sigma_m", at) - at);
    changed.insert(at, "topic: /points, " + key);
    const std::size_t end = changed.find("}", at), other = changed.find(", mask_robot", at + 14 + key.size());
    if (other < end) changed.erase(other, end - other);
    folder.put("bag/changed.yaml", changed);
    BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
    return read_streams(read_bag(folder.path() / "bag"), mapping).clouds.at(0).mask_robot;
  };
  EXPECT_EQ(wanted(""), std::nullopt);
  EXPECT_EQ(wanted("mask_robot: true, "), true);
  EXPECT_EQ(wanted("mask_robot: false, "), false);
}

TEST_F(Mapping, AMarkThatNoPushDescribesIsSaid) {
  const std::size_t second = text.find("    - {name: \"push 2\"");
  ASSERT_NE(second, std::string::npos);
  std::string first_alone = text.substr(0, second);
  first_alone.replace(first_alone.find("steps:\n"), 7, "steps:\n  contact_m: [0.06, 0.05, 0.1]\n  direction: [0, 0, -1]\n");
  folder.put("bag/changed.yaml", first_alone);
  BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
  const SensorStreams streams = read_streams(read_bag(folder.path() / "bag"), mapping);
  EXPECT_THAT(acquisition::recording_from(mapping.plan, streams).notes,
              Contains(HasSubstr("name the push 'push 2', which steps.pushes does not describe")));
}

TEST_F(Mapping, WhatTheMappingLeavesAloneIsListed) {
  const BagSurvey found = survey(read_bag(folder.path() / "bag"));
  const auto unused = [&](const std::string& changed) {
    folder.put("bag/changed.yaml", changed);
    std::vector<std::string> names;
    for (const UnusedTopic& one : unused_topics(found, read_mapping(folder.path() / "bag/changed.yaml")))
      names.push_back(one.key + " " + one.topic);
    return names;
  };
  EXPECT_THAT(unused(text), testing::IsEmpty());
  std::string blind = text;
  const std::size_t begin = blind.find("  depth:\n"), end = blind.find("  clouds:\n");
  ASSERT_LT(begin, end);
  blind.erase(begin, end - begin);
  EXPECT_THAT(unused(blind), testing::ElementsAre("topics.depth /camera/depth/camera_info", "topics.depth /camera/depth/image",
                                                  "topics.depth /camera/mask"));
  std::string chosen = text;
  chosen.replace(chosen.find("  wrench: /wrench"), 17, "  transforms: [/tf_static]\n  wrench: /wrench");
  EXPECT_THAT(unused(chosen), testing::ElementsAre("topics.transforms /tf"));
}

TEST_F(Mapping, PicturesThatAreThereTwiceAreSuggestedOnce) {
  MessageSource bag = read_bag(folder.path() / "bag");
  const auto packed = [&](const std::string& name) {
    bag.topics.push_back({name, "sensor_msgs/msg/CompressedImage", MessageEncoding::cdr, 1});
    static const std::string data = compressed_depth_message({1, "camera"}, DepthImage::Constant(6, 8, 0.5f));
    bag.messages.push_back({bag.topics.size() - 1, bag.messages.back().log_time_ns, data});
  };
  packed("/camera/depth/image/compressedDepth");
  packed("/other/depth/compressedDepth");
  const BagSurvey found = survey(bag);
  EXPECT_EQ(found.topics.back().use, "depth images");
  EXPECT_THAT(found.mapping, Not(HasSubstr("image: /camera/depth/image/compressedDepth")));
  EXPECT_THAT(found.mapping, AllOf(HasSubstr("image: /camera/depth/image,"), HasSubstr("image: /other/depth/compressedDepth,")));
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  const auto unused = unused_topics(found, mapping);
  ASSERT_EQ(unused.size(), 1u);
  EXPECT_EQ(unused[0].topic, "/other/depth/compressedDepth");
}

/// The same pictures as image_transport packs them, of both kinds.
TEST_F(Mapping, PackedDepthImagesAreTakenThroughAMapping) {
  for (const bool inverse : {false, true}) {
    MessageSource bag = read_bag(folder.path() / "bag");
    std::deque<std::string> data;
    for (MessageTopic& topic : bag.topics) {
      if (topic.name != "/camera/depth/image") continue;
      topic.name += "/compressedDepth";
      topic.type = "sensor_msgs/msg/CompressedImage";
      for (Message& one : bag.messages) {
        if (&bag.topics[one.topic] != &topic) continue;
        const RosImage raw = decode_image(one.data, "m");
        data.push_back(compressed_depth_message(raw.header, raw.depth_m, inverse));
        one.data = data.back();
      }
    }
    std::string changed = text;
    changed.insert(changed.find("/camera/depth/image") + 19, "/compressedDepth");
    folder.put("bag/changed.yaml", changed);
    BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
    const SensorStreams streams = read_streams(bag, mapping);
    const acquisition::FromStreams made = acquisition::recording_from(mapping.plan, streams);
    EXPECT_TRUE(made.notes.empty()) << made.notes.front();
    for (const Observation& one : made.recording.pushes.at(1).steps.at(2).observations)
      if (const auto* frame = std::get_if<DepthFrame>(&one)) {
        EXPECT_NEAR(frame->depth_m(3, 4), 0.4521f, 0.0006);
      }
  }
  std::string wrong = text;
  const MessageSource bag = read_bag(folder.path() / "bag");
  MessageSource colour = bag;
  std::string jpeg = CdrWriter()
                         .number(std::int32_t{1})
                         .number(std::uint32_t{0})
                         .text("camera")
                         .text("rgb8; jpeg compressed bgr8")
                         .octets("abc")
                         .take();
  for (MessageTopic& topic : colour.topics)
    if (topic.name == "/camera/depth/image") topic.type = "sensor_msgs/msg/CompressedImage";
  for (Message& one : colour.messages)
    if (colour.topics[one.topic].name == "/camera/depth/image") one.data = jpeg;
  BagMapping mapping = read_mapping(folder.path() / "bag/mapping.yaml");
  try {
    read_streams(colour, mapping);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("topics.depth[0].image"), HasSubstr("rgb8; jpeg"), HasSubstr("compressedDepth")));
  }
}

/// ROS 1 lays its messages out without CDR's header and gaps, with a number in front of each stamp.
std::string ros1_of(const std::string& type, std::string_view cdr) {
  std::string out;
  const auto header = [&](const RosHeader& one) {
    for (const std::int64_t value : {std::int64_t{7}, one.stamp_ns / 1000000000, one.stamp_ns % 1000000000})
      store(out, static_cast<std::uint32_t>(value));
    put_text(out, one.frame);
  };
  const auto vector = [&](const Vec3& value) {
    for (int axis = 0; axis < 3; ++axis) store(out, value[axis]);
  };
  if (type == "std_msgs/msg/String") {
    put_text(out, decode_string(cdr, "m"));
  } else if (type == "geometry_msgs/msg/WrenchStamped") {
    const RosWrench wrench = decode_wrench(cdr, "m");
    header(wrench.header), vector(wrench.force_n), vector(wrench.torque_nm);
  } else if (type == "tf2_msgs/msg/TFMessage") {
    const auto transforms = decode_transforms(cdr, "m");
    store(out, static_cast<std::uint32_t>(transforms.size()));
    for (const RosTransform& one : transforms) {
      header(one.header), put_text(out, one.child), vector(one.T_parent_child.translation());
      const Eigen::Quaterniond rotation(one.T_parent_child.linear());
      vector(rotation.vec()), store(out, rotation.w());
    }
  }
  return out;
}

TEST_F(Mapping, ABagOfRos1GivesTheSameForces) {
  const MessageSource bag = read_bag(folder.path() / "bag");
  std::vector<TestMessage> messages;
  for (const Message& one : bag.messages) {
    const MessageTopic& topic = bag.topics[one.topic];
    const std::string data = ros1_of(topic.type, one.data);
    if (!data.empty()) messages.push_back({topic.name, topic.type, one.log_time_ns, data});
  }
  std::string blind = text;
  blind.erase(blind.find("  depth:\n"), blind.find("frames: {") - blind.find("  depth:\n"));
  folder.put("bag/blind.yaml", blind);
  const auto made = [&](const MessageSource& source) {
    BagMapping mapping = read_mapping(folder.path() / "bag/blind.yaml");
    const SensorStreams streams = read_streams(source, mapping);
    EXPECT_TRUE(streams.warnings.empty()) << streams.warnings.front();
    return acquisition::recording_from(mapping.plan, streams).recording;
  };
  const Recording a = made(bag), b = made(parse_bag(ros1_bytes(messages, "lz4"), "b.bag"));
  ASSERT_EQ(a.pushes.size(), b.pushes.size());
  for (std::size_t p = 0; p < a.pushes.size(); ++p) {
    ASSERT_EQ(a.pushes[p].steps.size(), b.pushes[p].steps.size());
    EXPECT_EQ(a.pushes[p].name, b.pushes[p].name);
    for (std::size_t i = 1; i < a.pushes[p].steps.size(); ++i) {
      EXPECT_EQ(*a.pushes[p].steps[i].loads.at(0).force_n, *b.pushes[p].steps[i].loads.at(0).force_n);
      EXPECT_TRUE(a.pushes[p].steps[i].T_base_tip->isApprox(*b.pushes[p].steps[i].T_base_tip, 1e-12));
    }
  }
}

TEST_F(Mapping, ARobotsDescriptionIsTakenFromItsTopic) {
  MessageSource bag = read_bag(folder.path() / "bag");
  const std::string urdf = "<robot name='arm'><link name='base'/><link name='hand'/><joint name='j1' type='revolute'><parent link='base'/>"
                           "<child link='hand'/><axis xyz='0 0 1'/><limit lower='-3' upper='3' effort='1' velocity='1'/></joint></robot>";
  const std::string data = encode(urdf);
  bag.topics.push_back({"/robot_description", "std_msgs/msg/String", MessageEncoding::cdr, 1});
  bag.messages.push_back({bag.topics.size() - 1, bag.messages.back().log_time_ns, data});
  std::string changed = text;
  changed.replace(changed.find("wrench: /wrench"), 15, "robot_description: /robot_description\n  wrench: /wrench");
  folder.put("bag/changed.yaml", changed);
  BagMapping mapping = read_mapping(folder.path() / "bag/changed.yaml");
  EXPECT_FALSE(mapping.plan.recording.robot);
  read_streams(bag, mapping);
  ASSERT_TRUE(mapping.plan.recording.robot);
  EXPECT_EQ(mapping.plan.recording.robot->name, "arm");
  EXPECT_EQ(mapping.plan.recording.robot->joints.at(0).name, "j1");

  bag.messages.pop_back();
  mapping = read_mapping(folder.path() / "bag/changed.yaml");
  try {
    read_streams(bag, mapping);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("topics.robot_description"), HasSubstr("holds no message")));
  }
}

TEST_F(Mapping, ASurveySuggestsAMappingThatNamesWhatIsThere) {
  const BagSurvey found = survey(read_bag(folder.path() / "bag"));
  EXPECT_TRUE(found.missing.empty()) << found.missing.front();
  for (const char* part :
       {"wrench: /wrench", "image: /camera/depth/image, info: /camera/depth/camera_info", "base: base, tip: tip"})
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
}  // namespace palpate::io::bag_mapping_test
