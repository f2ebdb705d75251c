// label: contract
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/mcap.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <map>
#include <random>

#include "io/broken_bytes.hpp"
#include "io/compressed_depth.hpp"
#include "palpate/io/file.hpp"
#include "palpate/io/ros_messages.hpp"

namespace palpate::io::mcap_test {
namespace {

using namespace palpate::io::test;

std::string noise(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::string bytes(size, '\0');
  for (char& letter : bytes) letter = static_cast<char>(random() & 0xff);
  return bytes;
}

/// Two topics, out of order in time, more than one chunk.
std::string two_topics(McapWriter::Compression compression) {
  McapWriter writer("ros2", compression);
  const auto image =
      writer.add_channel("/camera/depth", "sensor_msgs/msg/Image", ros_type("sensor_msgs/msg/Image").definition);
  const auto wrench = writer.add_channel("/wrench", "geometry_msgs/msg/WrenchStamped",
                                         ros_type("geometry_msgs/msg/WrenchStamped").definition);
  for (unsigned i = 0; i < 8; ++i) {
    writer.add_message(image, 1000 + 100 * i, noise(300000, i));
    writer.add_message(wrench, 1010 + 100 * (7 - i),
                       encode(RosWrench{{static_cast<std::int64_t>(i), "tool"}, {1, 2, i + 0.5}, {0, 0, 0}}));
  }
  return writer.finish();
}

class EveryCompression : public testing::TestWithParam<McapWriter::Compression> {};

TEST_P(EveryCompression, GivesBackEveryMessageInTheOrderOfTime) {
  const McapFile file = McapFile::parse(two_topics(GetParam()), "a.mcap");
  EXPECT_TRUE(file.warnings.empty());
  EXPECT_EQ(file.profile, "ros2");
  ASSERT_EQ(file.channels.size(), 2u);
  EXPECT_EQ(file.channels.at(1).topic, "/camera/depth");
  EXPECT_EQ(file.channels.at(1).schema_name, "sensor_msgs/msg/Image");
  EXPECT_EQ(file.channels.at(2).message_encoding, "cdr");
  ASSERT_EQ(file.messages.size(), 16u);
  for (std::size_t i = 1; i < 16; ++i) EXPECT_LE(file.messages[i - 1].log_time_ns, file.messages[i].log_time_ns);
  EXPECT_EQ(file.messages[0].data, noise(300000, 0));
  EXPECT_EQ(decode_wrench(file.messages[1].data, "m").force_n, Vec3(1, 2, 7.5));
}

TEST_P(EveryCompression, WhatWasWrittenBeforeACutIsRead) {
  const std::string whole = two_topics(GetParam());
  std::size_t last = 0;
  for (std::size_t eighth = 1; eighth < 8; ++eighth) {
    const McapFile file = McapFile::parse(whole.substr(0, whole.size() * eighth / 8), "a.mcap");
    EXPECT_FALSE(file.warnings.empty());
    EXPECT_GE(file.messages.size(), last);
    last = file.messages.size();
  }
  EXPECT_GE(last, 7u) << "the first of two chunks";
}

TEST_P(EveryCompression, DamageIsSurvived) {
  const Reader read = [](std::string_view bytes, const std::string& name) { McapFile::parse(std::string(bytes), name); };
  survives(read, damaged(two_topics(GetParam()), 60));
  for (const std::string& bytes : garbage()) EXPECT_TRUE(refuses(read, bytes));
}

TEST_P(EveryCompression, ADamagedChunkIsLeftOutWithAWord) {
  std::string bytes = two_topics(GetParam());
  bytes[100000] = static_cast<char>(bytes[100000] ^ 0x55);
  const McapFile file = McapFile::parse(bytes, "a.mcap");
  EXPECT_EQ(file.warnings.size(), 1u);
  EXPECT_GT(file.messages.size(), 0u);
  EXPECT_LT(file.messages.size(), 16u);
}

INSTANTIATE_TEST_SUITE_P(Mcap, EveryCompression,
                         testing::Values(McapWriter::Compression::none, McapWriter::Compression::zstd),
                         [](const auto& one) { return one.param == McapWriter::Compression::none ? "none" : "zstd"; });

/// Written by the npm packages @mcap/core, @foxglove/rosmsg2-serialization and lz4js.
TEST(Mcap, AFileOfAnotherWriterIsRead) {
  const std::string path = std::string(PALPATE_SOURCE_DIR) + "/tests/io/files/peer_lz4.mcap";
  const McapFile file = McapFile::parse(read_file(path), path);
  EXPECT_TRUE(file.warnings.empty());
  EXPECT_EQ(file.written_by, "peer");
  ASSERT_EQ(file.messages.size(), 12u);
  EXPECT_EQ(file.messages[7].log_time_ns, 1007u);
  const RosWrench wrench = decode_wrench(file.messages[7].data, path);
  EXPECT_EQ(wrench.force_n, Vec3(7, 0.5, -2));
  EXPECT_EQ(wrench.torque_nm, Vec3(0, 0, 0.25));
  EXPECT_EQ(wrench.header.stamp_ns, 7000000005);
  EXPECT_EQ(wrench.header.frame, "tool");
}

const RosHeader header{1234567890123456789, "camera"};

TEST(RosMessages, ComeBackAsTheyWereWritten) {
  std::srand(5);
  RosPointCloud cloud{header, {}};
  cloud.cloud.points_m = Points::Random(20, 3).cast<float>().cast<double>();
  const RosPointCloud cloud_back = decode_point_cloud(encode(cloud), "m");
  EXPECT_EQ(cloud_back.cloud.points_m, cloud.cloud.points_m);
  EXPECT_EQ(cloud_back.header.stamp_ns, header.stamp_ns);
  EXPECT_EQ(cloud_back.header.frame, "camera");

  RosImage real{header, (DepthImage::Random(4, 5).array() + 2).matrix()};
  EXPECT_EQ(decode_image(encode(real), "m").depth_m, real.depth_m);
  RosImage whole{header, DepthImage::Constant(4, 5, static_cast<float>(1234 * 0.001))};
  EXPECT_EQ(decode_image(encode(whole), "m").depth_m, whole.depth_m);
  EXPECT_LT(encode(whole).size(), encode(real).size());

  RosCameraInfo info{header, {640, 480, 500, 501, 319.5, 239.5, DistortionModel::rational, {1, 2, 3, 4, 5, 6, 7, 8}}};
  const Camera back = decode_camera_info(encode(info), "m").camera;
  EXPECT_EQ(back.width_px, 640);
  EXPECT_EQ(back.cy_px, 239.5);
  EXPECT_EQ(back.distortion, DistortionModel::rational);
  EXPECT_EQ(back.distortion_coefficients, info.camera.distortion_coefficients);

  // 24 bytes before the last stand binning_x, binning_y and the region: x, y, height, width.
  std::string part = encode(info);
  const auto put = [&](std::size_t place, std::uint32_t value) { std::memcpy(part.data() + part.size() - 25 + 4 * place, &value, 4); };
  for (const auto& [place, value] : std::map<std::size_t, std::uint32_t>{{0, 2}, {1, 4}, {2, 40}, {3, 80}, {4, 240}, {5, 320}}) put(place, value);
  const Camera seen = decode_camera_info(part, "m").camera;
  EXPECT_EQ(seen.width_px, 160);
  EXPECT_EQ(seen.height_px, 60);
  EXPECT_EQ(seen.fx_px, 250);
  EXPECT_EQ(seen.fy_px, 501 / 4.0);
  EXPECT_EQ(seen.cx_px, (319.5 - 40) / 2);
  EXPECT_EQ(seen.cy_px, (239.5 - 80) / 4);
  info.camera.distortion_coefficients.resize(14, 0.0);
  EXPECT_EQ(decode_camera_info(encode(info), "m").camera.distortion_coefficients.size(), 8u) << "no prism, no tilt";
  for (const std::size_t count : {12, 7}) {
    info.camera.distortion_coefficients.assign(count, 0.01);
    EXPECT_THROW(decode_camera_info(encode(info), "m"), Error) << count;
  }

  const RosJointState joints{header, {"a", "elbow", "c"}, {0.1, 0.2, 0.3}};
  EXPECT_EQ(decode_joint_state(encode(joints), "m").names, joints.names);
  EXPECT_EQ(decode_joint_state(encode(joints), "m").position, joints.position);

  RosTransform transform{header, "tip", Pose::Identity()};
  transform.T_parent_child.translate(Vec3(1, 2, 3)).rotate(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  const auto transforms = decode_transforms(encode(std::vector<RosTransform>{transform, transform}), "m");
  ASSERT_EQ(transforms.size(), 2u);
  EXPECT_EQ(transforms[1].child, "tip");
  EXPECT_TRUE(transforms[1].T_parent_child.isApprox(transform.T_parent_child, 1e-12));
  EXPECT_EQ(decode_string(encode(std::string("<robot/>")), "m"), "<robot/>");
}

TEST(RosMessages, CompressedDepthIsMillimetresOrInverse) {
  DepthImage depth = DepthImage::Random(6, 8).cwiseAbs() * 4 + DepthImage::Constant(6, 8, 0.3f);
  depth(1, 2) = 0;  // no data
  const DepthImage whole = decode_compressed_depth(compressed_depth_message(header, depth), "m").depth_m;
  const RosImage inverse = decode_compressed_depth(compressed_depth_message(header, depth, true), "m");
  EXPECT_EQ(inverse.header.frame, "camera");
  for (Eigen::Index i = 0; i < depth.size(); ++i) {
    const float was = depth.data()[i];
    EXPECT_NEAR(whole.data()[i], was, 0.0005001) << "millimetres";
    // Half a unit of the inverse is depth^2 / (2 A).
    EXPECT_NEAR(inverse.depth_m.data()[i], was, was * was / inverse_a * 0.51 + 1e-6) << i;
  }
  EXPECT_EQ(inverse.depth_m(1, 2), 0);
}

/// Bytes laid out by hand from the rules of CDR: each number aligned to its size, strings with length and NUL.
TEST(RosMessages, AlignmentIsThatOfCdr) {
  const std::string expected =
      std::string("\0\1\0\0", 4) + std::string("\x01\0\0\0", 4) + std::string("\x02\0\0\0", 4) +  // stamp
      std::string("\x03\0\0\0", 4) + std::string("ab\0", 3) + std::string(1, '\0') +              // frame, padding
      std::string("\0\0\0\0\0\0\xf0\x3f", 8) + std::string(40, '\0');                             // 1.0, zeros
  EXPECT_EQ(encode(RosWrench{{1000000002, "ab"}, {1, 0, 0}, {0, 0, 0}}), expected);
}

TEST(RosMessages, DamageIsSurvivedAndCutsAreRefused) {
  RosPointCloud cloud{header, {}};
  cloud.cloud.points_m = Points::Random(20, 3);
  const std::vector<std::pair<std::string, Reader>> all = {
      {encode(cloud), [](std::string_view bytes, const std::string& name) { decode_point_cloud(bytes, name); }},
      {encode(RosImage{header, DepthImage::Constant(9, 9, 1.5f)}),
       [](std::string_view bytes, const std::string& name) { decode_image(bytes, name); }},
      {encode(RosCameraInfo{header, {640, 480, 500, 501, 319.5, 239.5, DistortionModel::none, {}}}),
       [](std::string_view bytes, const std::string& name) { decode_camera_info(bytes, name); }},
      {encode(RosJointState{header, {"a", "b"}, {1, 2}}),
       [](std::string_view bytes, const std::string& name) { decode_joint_state(bytes, name); }},
      {encode(RosWrench{header, {1, 2, 3}, {4, 5, 6}}),
       [](std::string_view bytes, const std::string& name) { decode_wrench(bytes, name); }},
      {encode(std::vector<RosTransform>{{header, "tip", Pose::Identity()}}),
       [](std::string_view bytes, const std::string& name) { decode_transforms(bytes, name); }},
      {compressed_depth_message(header, DepthImage::Constant(9, 9, 1.5f)),
       [](std::string_view bytes, const std::string& name) { decode_compressed_depth(bytes, name); }},
      {compressed_depth_message(header, DepthImage::Constant(9, 9, 1.5f), true),
       [](std::string_view bytes, const std::string& name) { decode_compressed_depth(bytes, name); }},
  };
  for (const auto& [bytes, reader] : all) {
    EXPECT_FALSE(refuses(reader, bytes)) << "whole, it is read";
    survives(reader, damaged(bytes, 200));
    for (std::size_t eighth = 1; eighth < 7; ++eighth)
      EXPECT_TRUE(refuses(reader, bytes.substr(0, bytes.size() * eighth / 8)));
    for (const std::string& junk : garbage()) refuses(reader, junk);
  }
}

TEST(RosMessages, EveryTypeHasADefinition) {
  for (const RosType& type : ros_types()) EXPECT_GT(std::string(type.definition).size(), 10u) << type.name;
  EXPECT_THROW(ros_type("nav_msgs/msg/Path"), Error);
}

}  // namespace
}  // namespace palpate::io::mcap_test
