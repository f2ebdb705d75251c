// label: unit
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/recording.hpp"

#include <gtest/gtest.h>

#include <regex>

#include "geometry/shapes.hpp"
#include "io/broken_bytes.hpp"
#include "io/recording_folder.hpp"
#include "palpate/io/depth_file.hpp"

namespace palpate::io::recording_test {
namespace {

using namespace palpate::io::test;

TEST(ReadRecording, ATableOfForcesAndClouds) {
  const TemporaryFolder folder("table");
  put_cube_recording(folder);
  const Recording recording = read_recording(folder.path());
  EXPECT_EQ(recording.name, "cube");
  ASSERT_TRUE(recording.rest.volume);
  EXPECT_EQ(recording.rest.volume->tetrahedra.rows(), 5);
  ASSERT_EQ(recording.supports.size(), 1u);
  EXPECT_EQ(recording.supports[0].vertices, (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(recording.tools.at(0).vertices, (std::vector<Index>{6, 7}));
  EXPECT_EQ(recording.model.material, "linear");
  EXPECT_EQ(recording.model.poisson_upper, 0.4995);
  ASSERT_EQ(recording.pushes.size(), 1u);
  ASSERT_EQ(recording.pushes[0].steps.size(), 2u);
  const Step& step = recording.pushes[0].steps[1];
  EXPECT_EQ(*step.loads.at(0).force_n, Vec3(0.5, 0, -2));
  EXPECT_EQ(step.loads[0].force_relative_std, 0.02);
  const auto& cloud = std::get<PointCloud>(step.observations.at(0));
  EXPECT_EQ(cloud.points_m.rows(), 25);
  EXPECT_EQ(cloud.sigma_m[0], 0.0005);
  EXPECT_EQ(recording.input_hashes.size(), 6u);
  EXPECT_EQ(recording.input_hashes.at("fixed.csv"), sha256_hex("0\n1\n2\n3\n"));
}

const std::string everything = R"(format: palpate-recording/1
description: "every kind of key"
rest:
  surface_mesh: cube_mm.stl
  scale_to_m: 0.001
  state: under_gravity
  surface_std_m: 0.0005
  surface_correlation_m: 0.03
supports:
  - {kind: clamp, name: base, point_m: [0, 0, 0], normal: [0, 0, 1], pose_std_m: 0.003, pose_std_rad: 0.03, pose_varies: push, spread_std_m: 0.001, compliance_m_per_n: 0.0002, compliance_std_m_per_n: 0.00005}
  - {kind: box, min_m: [-1, -1, -1], max_m: [1, 1, 0.001], contact: frictionless}
  - {kind: table, point_m: [0, 0, 0], normal: [0, 0, 1], contact: friction, friction_coefficient: 0.5}
regions:
  - {name: low, kind: box, min_m: [-1, -1, -1], max_m: [1, 1, 0.03]}
  - {name: corner, kind: points, vertices: [6]}
  - {name: sites, kind: points, points_m: [[0, 0, 0.1], [0.1, 0.1, 0.07]]}
environment: {gravity_m_s2: [0, 0, -9.81], planes: [{point_m: [0, 0, 0], normal: [0, 0, 1]}]}
density_kg_m3: {value: 1070, std: 10}
force_scale_std: 0.01
time_offset_std_s: 0.004
tools:
  - {name: ball, shape: sphere, radius_m: 0.01, radius_std_m: 0.002, contact: frictionless, compliance_m_per_n: 0.0001, compliance_std_m_per_n: 0.00002}
  - {name: line, shape: edge, axis: [0, 1, 0], length_m: 0.1, contact: bonded}
  - {name: plate, shape: platen, point_m: [0, 0, 0.1], normal: [0, 0, -1], contact: frictionless}
  - {name: stamp, shape: mesh, file: stamp.ply, contact: bonded}
cameras:
  - name: top
    width_px: 8
    height_px: 6
    fx_px: 10
    fy_px: 10
    cx_px: 3.5
    cy_px: 2.5
    distortion: {model: plumb_bob, coefficients: [0.1, -0.01, 0, 0, 0]}
    depth_unit_m: 0.001
    T_base_camera: {position_m: [0.05, 0.05, 0.6], quaternion_xyzw: [1, 0, 0, 0]}
    pose_std_m: 0.001
    pose_std_rad: 0.01
    noise: {model: constant, sigma_m: 0.002, bias_std_m: 0.003}
markers: {rest_m: {a: [0, 0, 0.11], "b c": [0.1, 0, 0.11]}, rest_std_m: 0.001}
robot: {urdf: arm.urdf, joints: [elbow, shoulder]}
model: {material: neo_hookean, element: tet10, refine: auto, poisson_range: [0.3, 0.49], poisson_by_region: true}
pushes:
  - name: one
    site: head
    force_tare_std_n: 0.1
    travel_offset_std_m: 0.0002
    torque_tare_std_nm: 0.02
    tip_std_m: 0.0015
    steps:
      - time_s: 0
        observations:
          - {kind: markers, sigma_m: 0.0002, observed_m: {a: [0, 0, 0.1]}}
          - {kind: depth, camera: top, file: depth.png, mask: mask.png, pose_std_m: 0.002}
      - time_s: 1.5
        unloading: true
        slipped: true
        joints_rad: [0.1, 0.2]
        T_base_tip: [[1, 0, 0, 0.05], [0, 1, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]]
        loads:
          - {tool: ball, force_n: 3, direction: [0, 0, -1], contact_m: [0.05, 0.05, 0.1], force_std_n: 0.05, contact_std_m: 0.001, force_rate_n_s: [0, 0.1, -2]}
          - {tool: plate, travel_m: 0.002}
        observations:
          - {kind: travel, tool: ball, travel_m: 0.004, sigma_m: 0.0001}
          - {kind: wrench, tool: plate, force_n: 7, force_sigma_n: 0.1}
          - {kind: wrench, tool: ball, force_n: [0, 0, -3], force_sigma_n: 0.1, torque_nm: [0.1, 0, 0], torque_sigma_nm: 0.01, time_s: 1.6}
          - {kind: markers, sigma_m: 0.0002, file: seen.csv}
  - name: two
    table: two.csv
    every_step:
      loads: [{tool: ball, direction: [0, 0, -1], contact_m: [0.05, 0.05, 0.1]}, {tool: line, direction: [0, 0, -1], contact_m: [0, 0, 0.1]}]
      observations:
        - {kind: cloud, name: left, sigma_m: 0.001}
        - {kind: cloud, name: right, sigma_m: 0.002}
        - {kind: wrench, tool: ball, force_sigma_n: 0.1}
        - {kind: markers, sigma_m: 0.001}
)";

const std::string arm =
    R"(<robot name="arm"><link name="base"/><link name="upper"><visual><origin xyz="0 0 0.1" rpy="0.1 0.2 0.3"/>
<geometry><cylinder radius="0.02" length="0.2"/></geometry></visual></link><link name="lower"><collision><geometry>
<mesh filename="package://arm/stamp.ply" scale="2 2 2"/></geometry></collision></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.2"/></joint></robot>)";

void put_everything(const TemporaryFolder& folder) {
  MeshData surface;
  surface.points_m = cube().points_m * 1000;
  surface.triangles.resize(12, 3);
  surface.triangles << 0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4, 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3,
      4, 7;
  folder.put("cube_mm.stl", mesh_format_named("stl").write(surface));
  surface.points_m *= 1e-5;
  folder.put("stamp.ply", mesh_format_named("ply").write(surface));
  folder.put("arm.urdf", arm);
  DepthImage depth = DepthImage::Constant(6, 8, 0.5f);
  depth(0, 0) = 0;
  folder.put("depth.png", depth_png(depth, 0.001));
  MaskImage mask = MaskImage::Zero(6, 8);
  mask(1, 1) = 1;
  folder.put("mask.png", mask_png(mask));
  folder.put("seen.csv", "name,x_m,y_m,z_m\nb c,0.1,0,0.105\na,,,\n");
  folder.put("l0.xyz", cloud_text());
  folder.put("r0.xyz", cloud_text(0.98));
  folder.put("r1.xyz", cloud_text(0.97));
  folder.put("two.csv",
             "time_s,ball.force_n,line.travel_m,left.cloud,right.cloud,observed_force_x_n,observed_force_y_n,observed_force_"
             "z_n,a.x_m,a.y_m,a.z_m,"
             "elbow_rad,shoulder_rad,unloading,slipped\n0,1,0.001,l0.xyz,r0.xyz,0,0,-1,0,0,0.1,0.5,0.6,0,0\n1,2,0.002,,r1.xyz,0,0,-2,,"
             ",,0.5,0.7,1,1\n");
  folder.put("recording.yaml", everything);
}

TEST(ReadRecording, EveryKindOfKey) {
  const TemporaryFolder folder("everything");
  put_everything(folder);
  const Recording recording = read_recording(folder.path() / "recording.yaml");
  ASSERT_TRUE(recording.rest.surface);
  EXPECT_NEAR(recording.rest.surface->vertices_m.maxCoeff(), 0.1, 1e-9);
  EXPECT_EQ(recording.rest.state, RestState::under_gravity);
  EXPECT_EQ(recording.supports.at(0).kind, SupportKind::clamp);
  EXPECT_EQ(recording.supports[0].select, NodeSelection::plane);
  EXPECT_EQ(recording.supports[0].pose_varies, PoseVaries::push);
  EXPECT_EQ(recording.supports[0].spread_std_m, 0.001);
  EXPECT_EQ(recording.supports[0].compliance_m_per_n, 0.0002);
  EXPECT_EQ(recording.supports[0].compliance_std_m_per_n, 0.00005);
  EXPECT_EQ(recording.tools.at(0).radius_std_m, 0.002);
  EXPECT_EQ(recording.tools[0].compliance_std_m_per_n, 0.00002);
  EXPECT_EQ(recording.time_offset_std_s, 0.004);
  EXPECT_EQ(recording.supports.at(2).contact, ContactLaw::friction);
  EXPECT_EQ(recording.density_std_kg_m3, 10);
  ASSERT_EQ(recording.regions.size(), 3u);
  EXPECT_EQ(recording.regions[0].select, RegionSelection::box);
  EXPECT_EQ(recording.regions[0].box_max_m, Vec3(1, 1, 0.03));
  EXPECT_EQ(recording.regions[1].points_m.row(0), recording.rest.surface->vertices_m.row(6));
  EXPECT_EQ(recording.regions[2].points_m.row(1), Vec3(0.1, 0.1, 0.07).transpose());
  ASSERT_TRUE(recording.robot);
  EXPECT_EQ(recording.robot->links.at(2).collision.at(0).mesh.vertices_m.maxCoeff(), 0.002);
  EXPECT_EQ(recording.joint_names, (std::vector<std::string>{"elbow", "shoulder"}));
  EXPECT_EQ(recording.pushes.at(0).force_tare_std_n, 0.1);
  EXPECT_EQ(recording.pushes[0].torque_tare_std_nm, 0.02);
  EXPECT_EQ(recording.pushes[0].tip_std_m, 0.0015);

  const Step& first = recording.pushes[0].steps.at(0);
  const auto& markers = std::get<Markers>(first.observations.at(0));
  EXPECT_EQ(markers.rest_m.row(1), Vec3(0.1, 0, 0.11).transpose());
  EXPECT_FALSE(markers.observed_m.row(1).allFinite());
  const auto& frame = std::get<DepthFrame>(first.observations.at(1));
  EXPECT_EQ(frame.depth_m(0, 1), 0.5f);
  EXPECT_EQ(frame.mask(1, 1), 1);
  EXPECT_EQ(frame.pose_std_m, 0.002);
  EXPECT_EQ(frame.T_base_camera.linear()(2, 2), -1);

  const Step& second = recording.pushes[0].steps.at(1);
  EXPECT_TRUE(second.unloading);
  EXPECT_TRUE(second.slipped);
  EXPECT_EQ(*second.loads.at(0).force_n, Vec3(0, 0, -3));
  EXPECT_EQ(second.loads[0].force_rate_n_s, Vec3(0, 0.1, -2));
  EXPECT_EQ(*second.loads.at(1).travel_m, 0.002);
  EXPECT_EQ(second.loads[1].direction, Vec3(0, 0, -1));
  const auto& axial = std::get<Wrench>(second.observations.at(1));
  EXPECT_EQ(axial.force_n, Vec3(0, 0, -7));
  EXPECT_EQ(axial.along, Vec3(0, 0, -1));
  EXPECT_EQ(axial.tool, "plate");
  EXPECT_EQ(std::get<Wrench>(second.observations.at(2)).time_s, 1.6);
  EXPECT_TRUE(std::get<Markers>(second.observations.at(3)).observed_m.row(1).allFinite());

  const std::vector<Step>& rows = recording.pushes.at(1).steps;
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(*rows[1].loads.at(0).force_n, Vec3(0, 0, -2));
  EXPECT_EQ(*rows[1].loads.at(1).travel_m, 0.002);
  EXPECT_EQ(rows[0].observations.size(), 4u);
  EXPECT_EQ(rows[1].observations.size(), 2u) << "an empty cell leaves an observation out";
  EXPECT_EQ(rows[1].joints_rad, (std::vector<double>{0.5, 0.7}));
  EXPECT_TRUE(rows[1].unloading);
  EXPECT_TRUE(rows[1].slipped);
  EXPECT_FALSE(rows[0].slipped);
}

/// What was read, written and read again is the same to the last bit where the format can say it.
TEST(WriteRecording, GivesBackWhatWasWritten) {
  const TemporaryFolder folder("before"), after("after");
  put_everything(folder);
  const Recording recording = read_recording(folder.path());
  write_recording(recording, after.path() / "copy");
  const Recording back = read_recording(after.path() / "copy");
  EXPECT_EQ(back.rest.surface->vertices_m, recording.rest.surface->vertices_m);
  EXPECT_EQ(back.supports.size(), recording.supports.size());
  EXPECT_EQ(back.supports[0].pose_std_rad, recording.supports[0].pose_std_rad);
  EXPECT_EQ(back.supports[0].spread_std_m, recording.supports[0].spread_std_m);
  EXPECT_EQ(back.supports[0].compliance_m_per_n, recording.supports[0].compliance_m_per_n);
  EXPECT_EQ(back.supports[0].compliance_std_m_per_n, recording.supports[0].compliance_std_m_per_n);
  EXPECT_EQ(back.tools[0].radius_std_m, recording.tools[0].radius_std_m);
  EXPECT_EQ(back.tools[0].compliance_std_m_per_n, recording.tools[0].compliance_std_m_per_n);
  EXPECT_EQ(back.time_offset_std_s, recording.time_offset_std_s);
  EXPECT_EQ(back.pushes[0].steps[1].loads[0].force_rate_n_s, recording.pushes[0].steps[1].loads[0].force_rate_n_s);
  EXPECT_TRUE(back.model.poisson_by_region);
  ASSERT_EQ(back.regions.size(), recording.regions.size());
  for (std::size_t r = 0; r < back.regions.size(); ++r) {
    EXPECT_EQ(back.regions[r].name, recording.regions[r].name);
    EXPECT_EQ(back.regions[r].select, recording.regions[r].select);
    EXPECT_EQ(back.regions[r].box_min_m, recording.regions[r].box_min_m);
    EXPECT_EQ(back.regions[r].points_m, recording.regions[r].points_m);
  }
  EXPECT_EQ(back.tools[1].axis, recording.tools[1].axis);
  EXPECT_EQ(back.tools[3].mesh->vertices_m, recording.tools[3].mesh->vertices_m);
  EXPECT_EQ(back.description, recording.description);
  ASSERT_TRUE(back.robot);
  EXPECT_TRUE(back.robot->links[1].visual[0].T_link_shape.isApprox(recording.robot->links[1].visual[0].T_link_shape, 1e-12));
  EXPECT_EQ(back.robot->links[2].collision[0].mesh.vertices_m, recording.robot->links[2].collision[0].mesh.vertices_m);
  ASSERT_EQ(back.pushes.size(), recording.pushes.size());
  for (std::size_t p = 0; p < back.pushes.size(); ++p) {
    EXPECT_EQ(back.pushes[p].force_tare_std_n, recording.pushes[p].force_tare_std_n);
    EXPECT_EQ(back.pushes[p].torque_tare_std_nm, recording.pushes[p].torque_tare_std_nm);
    EXPECT_EQ(back.pushes[p].tip_std_m, recording.pushes[p].tip_std_m);
    ASSERT_EQ(back.pushes[p].steps.size(), recording.pushes[p].steps.size());
    for (std::size_t s = 0; s < back.pushes[p].steps.size(); ++s) {
      const Step& a = recording.pushes[p].steps[s];
      const Step& b = back.pushes[p].steps[s];
      EXPECT_EQ(a.time_s, b.time_s);
      EXPECT_EQ(a.joints_rad, b.joints_rad);
      ASSERT_EQ(a.loads.size(), b.loads.size());
      for (std::size_t i = 0; i < a.loads.size(); ++i) {
        EXPECT_EQ(a.loads[i].force_n, b.loads[i].force_n);
        EXPECT_EQ(a.loads[i].travel_m, b.loads[i].travel_m);
        EXPECT_EQ(a.loads[i].direction, b.loads[i].direction);
      }
      ASSERT_EQ(a.observations.size(), b.observations.size());
      for (std::size_t i = 0; i < a.observations.size(); ++i) {
        ASSERT_EQ(a.observations[i].index(), b.observations[i].index());
        if (const auto* cloud = std::get_if<PointCloud>(&a.observations[i])) {
          EXPECT_EQ(cloud->points_m, std::get<PointCloud>(b.observations[i]).points_m);
          EXPECT_EQ(cloud->sigma_m, std::get<PointCloud>(b.observations[i]).sigma_m);
        }
        if (const auto* frame = std::get_if<DepthFrame>(&a.observations[i])) {
          const auto& other = std::get<DepthFrame>(b.observations[i]);
          EXPECT_EQ(frame->depth_m, other.depth_m);
          EXPECT_EQ(frame->mask, other.mask);
          EXPECT_EQ(frame->robot_is_masked, other.robot_is_masked);
          EXPECT_EQ(frame->T_base_camera.matrix(), other.T_base_camera.matrix());
          EXPECT_EQ(frame->noise, other.noise);
          EXPECT_EQ(frame->camera.distortion_coefficients, other.camera.distortion_coefficients);
        }
        if (const auto* wrench = std::get_if<Wrench>(&a.observations[i])) {
          EXPECT_EQ(wrench->force_n, std::get<Wrench>(b.observations[i]).force_n);
          EXPECT_EQ(wrench->along, std::get<Wrench>(b.observations[i]).along);
          EXPECT_EQ(wrench->time_s, std::get<Wrench>(b.observations[i]).time_s);
          EXPECT_EQ(wrench->has_torque, std::get<Wrench>(b.observations[i]).has_torque);
          EXPECT_EQ(wrench->torque_nm, std::get<Wrench>(b.observations[i]).torque_nm);
        }
      }
    }
  }
  EXPECT_THROW(write_recording(recording, after.path() / "copy"), Error) << "nothing is overwritten";
}

TEST(WriteRecording, HostileNamesSurvive) {
  const TemporaryFolder folder("hostile");
  put_cube_recording(folder);
  Recording recording = read_recording(folder.path());
  recording.name = "a: \"b\" \\ {c}\n# d\t\x01 \xc3\xa9";
  recording.pushes[0].name = "- ] }, : null";
  write_recording(recording, folder.path() / "copy");
  const Recording back = read_recording(folder.path() / "copy");
  EXPECT_EQ(back.name, recording.name);
  EXPECT_EQ(back.pushes[0].name, recording.pushes[0].name);
}

/// Beside the target may lie what is called as a part of it would be.
TEST(WriteRecording, NothingOfOthersIsTouchedAndNothingIsLeft) {
  namespace fs = std::filesystem;
  const TemporaryFolder folder("beside");
  put_cube_recording(folder);
  const Recording recording = read_recording(folder.path());
  const fs::path root = folder.path() / "out";
  fs::create_directories(root / "copy.part");
  folder.put("out/copy.part/diary.txt", "mine");
  write_recording(recording, root / "copy");
  EXPECT_EQ(folder.get("out/copy.part/diary.txt"), "mine");
  EXPECT_EQ(read_recording(root / "copy").pushes.size(), recording.pushes.size());

  fs::create_directory(root / "empty");
  fs::create_directory_symlink("empty", root / "link");
  write_recording(recording, root / "link");
  EXPECT_TRUE(fs::is_symlink(root / "link"));
  EXPECT_EQ(read_recording(root / "empty").pushes.size(), recording.pushes.size());

  fs::create_directory_symlink("nowhere", root / "dangling");
  EXPECT_THROW(write_recording(recording, root / "dangling"), Error);
  Recording broken = recording;
  Markers lost;
  lost.names = {"a"};
  lost.rest_m = Points::Constant(1, 3, NAN);
  lost.observed_m = Points::Zero(1, 3);
  broken.pushes[0].steps.back().observations = {lost};
  EXPECT_THROW(write_recording(broken, root / "broken"), Error);
  EXPECT_FALSE(fs::exists(root / "broken"));
  for (const auto& one : fs::recursive_directory_iterator(root))
    EXPECT_TRUE(one.path().extension() != ".part" || one.path() == root / "copy.part") << one.path();
  EXPECT_FALSE(fs::exists(root / "copy.part2"));
}

TEST(RecordingWriter, AfterEveryStepTheFolderIsAWholeRecording) {
  const TemporaryFolder folder("steps");
  put_cube_recording(folder);
  Recording recording = read_recording(folder.path());
  const std::vector<Step> steps = recording.pushes[0].steps;
  recording.pushes.clear();
  RecordingWriter writer(folder.path() / "live", recording);
  Push push;
  push.name = "live";
  writer.begin_push(push);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    writer.add_step(steps[i]);
    EXPECT_EQ(read_recording_unchecked(folder.path() / "live").pushes.at(0).steps.size(), i + 1);
  }
  // A run that was cut goes on where it stopped.
  RecordingWriter again(folder.path() / "live", read_recording_unchecked(folder.path() / "live"));
  Step later = steps[1];
  later.time_s = 7;
  std::get<PointCloud>(later.observations[0]).points_m *= 0.98;
  again.add_step(later);
  const Recording whole = read_recording(folder.path() / "live");
  ASSERT_EQ(whole.pushes.size(), 1u);
  EXPECT_EQ(whole.pushes[0].steps.size(), 3u);

  // What is known only after the last step.
  again.end_push({Vec3(0, 0.01, 0.1), 2});
  const Recording ended = read_recording(folder.path() / "live");
  const auto force = [](const Recording& of, std::size_t step) { return *of.pushes[0].steps[step].loads.at(0).force_n; };
  EXPECT_EQ(force(ended, 1), force(whole, 1)) << "of before";
  EXPECT_LT((force(ended, 2) - force(whole, 2) + 5 * Vec3(0, 0.01, 0.1)).norm(), 1e-12);
  write_recording(ended, folder.path() / "copy");
  EXPECT_EQ(force(read_recording(folder.path() / "copy"), 2), force(ended, 2)) << "taken off once";
  again.begin_push(push);
  EXPECT_THROW(again.end_push({}), Error);
  RecordingWriter(folder.path() / "fast", whole).end_push({Vec3(0, 0, 2), 2});
  EXPECT_THROW(read_recording(folder.path() / "fast"), Error) << "2 N a second";
}

// What a reader would refuse is not written: hours of pushing would end in a folder that nobody can read.
TEST(RecordingWriter, JointsAreThoseThatTheRobotNames) {
  const TemporaryFolder folder("joints");
  put_cube_recording(folder);
  Recording recording = read_recording(folder.path());
  Step step = recording.pushes[0].steps[0];
  recording.pushes.clear();
  recording.robot.reset();
  step.joints_rad = {0.1, 0.2};
  Push push;
  push.name = "live";
  RecordingWriter nameless(folder.path() / "nameless", recording);
  nameless.begin_push(push);
  nameless.add_step(step);
  EXPECT_TRUE(read_recording_unchecked(folder.path() / "nameless").pushes.at(0).steps.at(0).joints_rad.empty());
  recording.robot = RobotModel{};
  recording.joint_names = {"shoulder"};
  RecordingWriter writer(folder.path() / "named", recording);
  writer.begin_push(push);
  try {
    writer.add_step(step);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "joints_rad");
    EXPECT_NE(error.message().find("has 2 values, 'robot: joints' names 1"), std::string::npos) << error.what();
  }
  step.joints_rad = {0.1};
  writer.add_step(step);
}

TEST(ReadRecording, EveryExampleOfTheDocumentationIsUnderstood) {
  const std::string page = read_file(std::string(PALPATE_SOURCE_DIR) + "/docs/recording-format.md");
  int examples = 0;
  for (std::size_t at = page.find("```yaml\n"); at != std::string::npos; at = page.find("```yaml\n", at + 1)) {
    const std::size_t start = at + 8, end = page.find("```", start);
    if (page.compare(start, 27, "format: palpate-recording/1") != 0) continue;  // a bag's mapping has a test of its own
    const TemporaryFolder folder("documentation");
    folder.put("recording.yaml", page.substr(start, end - start));
    ++examples;
    try {
      read_recording(folder.path());
      ADD_FAILURE() << "the example's files are not there";
    } catch (const Error& error) {  // all that may be missing is the first data file
      EXPECT_NE(error.message().find("there is no file"), std::string::npos) << error.what();
    }
  }
  EXPECT_GE(examples, 5);
}

/// The page's block that starts with `start`.
std::string block_of(const std::string& page, const std::string& start) {
  const std::size_t at = page.find("\n" + start);
  EXPECT_NE(at, std::string::npos) << start;
  return page.substr(at + 1, page.find("```", at) - at - 1);
}

TEST(ReadRecording, TheDocumentationsPlainFilesAreReadAsItSays) {
  const std::string page = read_file(std::string(PALPATE_SOURCE_DIR) + "/docs/recording-format.md");
  const TemporaryFolder folder("plain_files");
  folder.put("recording.yaml", block_of(page, "format: palpate-recording/1\nname: my_foam"));
  folder.put("steps.csv", block_of(page, "time_s,force_x_n,force_y_n,force_z_n,observed_travel_m,depth,tip_x_m"));
  const TriMesh box = shapes::box({0.15, 0.15, 0.15}, {0.425, -0.075, 0});
  MeshData scan;
  scan.points_m = box.vertices_m;
  scan.triangles = box.triangles;
  folder.put("scan.ply", mesh_format_named("ply").write(scan));
  for (const char* file : {"depth/0000.png", "depth/0001.png", "depth/0002.png"})
    folder.put(file, depth_png(DepthImage::Constant(480, 640, 0.5f), 0.001));
  const Recording recording = read_recording(folder.path());
  ASSERT_EQ(recording.pushes.size(), 1u);
  const auto& steps = recording.pushes[0].steps;
  ASSERT_EQ(steps.size(), 3u);
  EXPECT_EQ(steps[0].observations.size(), 1u) << "no travel in free air";
  for (std::size_t i : {1u, 2u}) {
    const Load& load = steps[i].loads.at(0);
    ASSERT_EQ(steps[i].observations.size(), 2u);
    const auto& travel = std::get<ToolTravel>(steps[i].observations[0]);
    ASSERT_TRUE(steps[i].T_base_tip);
    EXPECT_NEAR(travel.travel_m, load.direction.dot(steps[i].T_base_tip->translation() - load.contact_m), 1e-12) << "as the page says";
    EXPECT_LT(load.force_n->z(), -2);
    EXPECT_LT((steps[i].T_base_tip->linear() * Vec3::UnitZ() - load.direction).norm(), 1e-12) << "the tool's axis goes along the push";
    EXPECT_TRUE(std::holds_alternative<DepthFrame>(steps[i].observations[1]));
  }
  for (const std::string& warning : recording.warnings) EXPECT_EQ(warning.find("nothing masks"), std::string::npos) << warning;
}

}  // namespace
}  // namespace palpate::io::recording_test
