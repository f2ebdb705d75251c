// label: contract
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/urdf.hpp"

#include <gtest/gtest.h>

#include "io/broken_bytes.hpp"
#include "io/recording_folder.hpp"

namespace palpate::io::urdf_test {
namespace {

using namespace palpate::io::test;

const std::string arm = R"(<?xml version="1.0"?>
<!-- a comment -->
<robot name="arm &amp; hand">
  <link name="base"/>
  <link name="upper">
    <visual><origin xyz="0 0 0.1" rpy="0.1 -0.2 3"/><geometry><cylinder radius="0.02" length="0.2"/></geometry></visual>
    <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>
  </link>
  <link name="finger"><visual><geometry><sphere radius='0.01'/></geometry></visual></link>
  <link name="thumb"/>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.3" rpy="0 0 1.5707963267948966"/><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 2"/><limit lower="-1.5" upper="1.5" velocity="2" effort="10"/>
  </joint>
  <joint name="slide" type="prismatic"><parent link="upper"/><child link="finger"/><axis xyz="1 0 0"/><limit lower="0" upper="0.04"/></joint>
  <joint name="other" type="continuous"><parent link="upper"/><child link="thumb"/><mimic joint="slide" multiplier="-1" offset="0.01"/></joint>
  <transmission name="ignored"/>
</robot>
)";

const Reader reader = [](std::string_view bytes, const std::string& name) { parse_urdf(bytes, name, "."); };

TEST(Urdf, LinksJointsAndShapesAreRead) {
  const RobotModel robot = parse_urdf(arm, "arm.urdf", ".");
  EXPECT_EQ(robot.name, "arm & hand");
  ASSERT_EQ(robot.links.size(), 4u);
  ASSERT_EQ(robot.joints.size(), 3u);
  const RobotJoint& shoulder = robot.joints[0];
  EXPECT_EQ(shoulder.kind, RobotJoint::Kind::revolute);
  EXPECT_EQ(shoulder.axis, Vec3(0, 0, 1));
  EXPECT_EQ(shoulder.upper, 1.5);
  EXPECT_TRUE((shoulder.T_parent_joint * Vec3(1, 0, 0)).isApprox(Vec3(0, 1, 0.3), 1e-12));
  EXPECT_EQ(robot.joints[2].mimic, "slide");
  EXPECT_EQ(robot.joints[2].mimic_multiplier, -1);
  EXPECT_EQ(robot.joints[2].axis, Vec3(1, 0, 0)) << "the default";
  EXPECT_EQ(robot.links[1].visual.at(0).kind, RobotShape::Kind::cylinder);
  EXPECT_EQ(robot.links[1].visual[0].size_m, Vec3(0.02, 0.2, 0));
  EXPECT_EQ(robot.links[1].collision.at(0).size_m, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(robot.links[2].visual.at(0).size_m.x(), 0.01);
}

/// rpy turns about the fixed axes: first x, then y, then z.
TEST(Urdf, RollPitchYawComeInThisOrder) {
  const Mat3 rotation = parse_urdf(arm, "arm.urdf", ".").links[1].visual[0].T_link_shape.linear();
  const Mat3 x = Eigen::AngleAxisd(0.1, Vec3::UnitX()).matrix(), y = Eigen::AngleAxisd(-0.2, Vec3::UnitY()).matrix(),
             z = Eigen::AngleAxisd(3, Vec3::UnitZ()).matrix();
  EXPECT_TRUE(rotation.isApprox(z * y * x, 1e-12));
}

TEST(Urdf, WrittenAndReadAgain) {
  RobotModel robot = parse_urdf(arm, "arm.urdf", ".");
  Pose upright = Pose::Identity();  // pitch of 90 degrees, where roll and yaw cannot be told apart
  upright.linear() = Eigen::AngleAxisd(0.3, Vec3::UnitZ()).matrix() * Eigen::AngleAxisd(M_PI / 2, Vec3::UnitY()).matrix();
  robot.joints[1].T_parent_joint = upright;
  const auto files = urdf_files(robot, "arm");
  const RobotModel back = parse_urdf(files.at("arm.urdf"), "arm.urdf", ".");
  ASSERT_EQ(back.joints.size(), robot.joints.size());
  for (std::size_t i = 0; i < robot.joints.size(); ++i) {
    EXPECT_EQ(back.joints[i].name, robot.joints[i].name);
    EXPECT_EQ(back.joints[i].lower, robot.joints[i].lower);
    EXPECT_TRUE(back.joints[i].T_parent_joint.isApprox(robot.joints[i].T_parent_joint, 1e-12)) << i;
  }
  EXPECT_EQ(back.links[1].collision[0].size_m, robot.links[1].collision[0].size_m);
}

TEST(Urdf, MeshesAreFoundBesideIt) {
  const TemporaryFolder folder("urdf");
  MeshData mesh = cube();
  mesh.triangles.resize(1, 3);
  mesh.triangles << 0, 1, 2;
  mesh.tetrahedra.resize(0, 4);
  folder.put("meshes/part.stl", mesh_format_named("stl").write(mesh));
  const auto with = [&](const std::string& file) {
    return "<robot name=\"r\"><link name=\"a\"><visual><geometry><mesh filename=\"" + file +
           "\" scale=\"0.5 1 1\"/></geometry></visual></link></robot>";
  };
  for (const char* file : {"package://my_robot/meshes/part.stl", "meshes/part.stl"}) {
    const RobotModel robot = parse_urdf(with(file), "r.urdf", folder.path());
    EXPECT_FLOAT_EQ(static_cast<float>(robot.links[0].visual[0].mesh.vertices_m.col(0).maxCoeff()), 0.05f);
  }
  EXPECT_THROW(parse_urdf(with("meshes/other.stl"), "r.urdf", folder.path()), Error);
  EXPECT_THROW(parse_urdf(with("package://my_robot/../../etc/passwd.stl"), "r.urdf", folder.path()), Error);
}

TEST(Urdf, AShapeThatCannotBeReadIsLeftOutWithAWordWhereTheCallerWantsIt) {
  const std::string text =
      "<robot name='r'><link name='a'><visual><geometry><mesh filename='package://r/meshes/a.dae'/></geometry></visual>"
      "<collision><geometry><box size='1 1 1'/></geometry></collision></link></robot>";
  EXPECT_THROW(parse_urdf(text, "r.urdf", "."), Error);
  std::vector<std::string> left_out;
  const RobotModel robot = parse_urdf(text, "r.urdf", ".", &left_out);
  EXPECT_TRUE(robot.links[0].visual.empty());
  EXPECT_EQ(robot.links[0].collision.size(), 1u);
  ASSERT_EQ(left_out.size(), 1u);
  EXPECT_NE(left_out[0].find("visual"), std::string::npos) << left_out[0];
  EXPECT_NE(left_out[0].find("a.dae"), std::string::npos) << left_out[0];
}

TEST(Urdf, WhatMakesNoTreeIsRefused) {
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"child link=\"upper\"", "child link=\"nowhere\""},
           {"<child link=\"thumb\"", "<child link=\"finger\""},
           {"<parent link=\"base\"/>", "<parent link=\"thumb\"/>"},
           {"type=\"revolute\"", "type=\"floating\""},
           {"mimic joint=\"slide\"", "mimic joint=\"slip\""},
           {"<link name=\"thumb\"/>", "<link name=\"thumb\"/><link name=\"alone\"/>"},
           {"<link name=\"thumb\"/>", "<link name=\"thumb\"/><link name=\"thumb\"/>"},
           {"xyz=\"0 0 0.3\"", "xyz=\"0 nan 0.3\""},
           {"lower=\"-1.5\"", "lower=\"2\""},
           {"radius=\"0.02\"", "radius=\"-0.02\""},
           {"xyz=\"0 0 2\"", "xyz=\"0 0 0\""},
           {"&amp;", "&unknown;"},
           {"<robot ", "<!DOCTYPE r [<!ENTITY a \"b\">]><robot "}}) {
    EXPECT_TRUE(refuses(reader, replaced(arm, from, to))) << to;
  }
}

TEST(Urdf, CutOffAndDamagedFilesAreRefusedOrSurvived) {
  for (const std::string& bytes : truncated(arm)) EXPECT_TRUE(refuses(reader, bytes));
  for (const std::string& bytes : garbage()) EXPECT_TRUE(refuses(reader, bytes));
  survives(reader, damaged(arm, 400));
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  EXPECT_TRUE(refuses(reader, deep));
}

TEST(Urdf, WindowsLineEndsAreFine) { EXPECT_EQ(parse_urdf(with_crlf(arm), "arm.urdf", ".").links.size(), 4u); }

}  // namespace
}  // namespace palpate::io::urdf_test
