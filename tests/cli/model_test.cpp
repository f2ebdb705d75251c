// label: unit
// SPDX-License-Identifier: Apache-2.0
// `palpate model`, as a user and a script see it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "geometry/shapes.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/io/mesh_file.hpp"
#include "palpate/io/recording.hpp"
#include "said_by.hpp"
#include "temporary_folder.hpp"

namespace palpate::model_test {
namespace {

using testing::Contains;
using testing::HasSubstr;
namespace fs = std::filesystem;

struct Outcome {
  int exit_code = -1;
  nlohmann::json json;
};

class Model : public testing::Test {
 protected:
  Outcome run(const std::string& arguments) const {
    const test::Said said = test::said_by(std::string(PALPATE_CLI) + " model " + arguments + " --json --quiet 2>/dev/null");
    return {said.exit_code, nlohmann::json::parse(said.text, nullptr, false)};
  }

  const test::TemporaryFolder files_{"model"};
  const fs::path folder_ = files_.path();
};

TEST_F(Model, a_surface_in_millimetres_becomes_files_that_can_be_read_back) {
  io::write_mesh(folder_ / "ball.stl", shapes::sphere(40, 4));
  const auto o = run((folder_ / "ball.stl").string() + " --unit mm --tetrahedra 800 -o " + (folder_ / "out").string());
  ASSERT_EQ(o.exit_code, 0) << o.json;
  for (const char* key : {"tetrahedra", "nodes", "inverted", "min_dihedral_deg", "max_dihedral_deg", "volume_m3",
                          "volume_error", "surface_rms_m", "hausdorff_m", "warnings"})
    EXPECT_TRUE(o.json.contains(key)) << key;
  EXPECT_NEAR(o.json["volume_m3"].get<double>(), 4.0 / 3 * M_PI * std::pow(0.04, 3), 3e-6);
  EXPECT_EQ(o.json["inverted"], 0);
  for (const char* name : {"model.vtu", "model.msh", "model.vtk"}) {
    const TetMesh back = io::read_tet_mesh(folder_ / "out" / name);
    EXPECT_EQ(back.tetrahedra.rows(), o.json["tetrahedra"].get<Index>()) << name;
  }
  EXPECT_EQ(io::read_tri_mesh(folder_ / "out/surface.ply").triangles.rows(), 5120);
  std::ifstream picture(folder_ / "out/model.png", std::ios::binary);
  std::string head(8, ' ');
  picture.read(head.data(), 8);
  EXPECT_EQ(head, "\x89PNG\r\n\x1a\n");
  EXPECT_GT(fs::file_size(folder_ / "out/model.png"), 10000U);
}

TEST_F(Model, sizes_that_make_no_sense_are_refused_and_nothing_is_left_behind) {
  io::write_mesh(folder_ / "ball.stl", shapes::sphere(0.04, 4));
  const std::string file = (folder_ / "ball.stl").string(), out = " -o " + (folder_ / "out").string();
  EXPECT_EQ(run(file + out + " --tetrahedra -5").exit_code, 2);
  EXPECT_EQ(run(file + out + " --edge=-1").exit_code, 2);
  EXPECT_EQ(run(file + out + " --edge=nan").exit_code, 2);
  EXPECT_EQ(run(file + out + " --tetrahedra 0").exit_code, 2);
  EXPECT_EQ(run(file + out + " --edge 1e-7").exit_code, 3);
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  fs::create_directories(folder_ / "taken" / "model.msh");
  EXPECT_EQ(run(file + " --tetrahedra 300 -o " + (folder_ / "taken").string()).exit_code, 3);
  EXPECT_FALSE(fs::exists(folder_ / "taken" / "model.msh.part"));
}

TEST_F(Model, open_input_has_no_volume_error_and_a_sheet_is_refused) {
  TriMesh bowl = shapes::sphere(0.04, 4);
  bowl.triangles.conservativeResize(bowl.triangles.rows() - 300, 3);
  io::write_mesh(folder_ / "bowl.obj", bowl);
  const auto open = run((folder_ / "bowl.obj").string() + " --tetrahedra 800 -o " + (folder_ / "out").string());
  ASSERT_EQ(open.exit_code, 0) << open.json;
  EXPECT_TRUE(open.json["volume_error"].is_null());
  EXPECT_THAT(open.json["warnings"].get<std::vector<std::string>>(), Contains(HasSubstr("holes")));
  io::write_mesh(folder_ / "sheet.obj", shapes::make({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}));
  const auto sheet = run((folder_ / "sheet.obj").string() + " -o " + (folder_ / "out").string());
  EXPECT_EQ(sheet.exit_code, 3);
  EXPECT_THAT(sheet.json["error"]["message"].get<std::string>(), HasSubstr("encloses nothing"));
}

/// Depth image of a ball on a table, seen by a camera that looks at the origin.
DepthFrame view(const geometry::TriangleTree& tree, const Vec3& eye) {
  DepthFrame f;
  f.camera.width_px = f.camera.height_px = 160;
  f.camera.fx_px = f.camera.fy_px = 300;
  f.camera.cx_px = f.camera.cy_px = 79.5;
  f.noise.sigma_m = 0.0005;
  const Vec3 z = (Vec3(0, 0, 0.04) - eye).normalized(), x = z.cross(Vec3(0.1, 0, 1)).normalized(), y = z.cross(x);
  f.T_base_camera.linear() << x, y, z;
  f.T_base_camera.translation() = eye;
  f.depth_m = DepthImage::Zero(160, 160);
  for (int r = 0; r < 160; ++r)
    for (int c = 0; c < 160; ++c) {
      const Vec3 d = f.T_base_camera.linear() * Vec3((c - 79.5) / 300, (r - 79.5) / 300, 1);
      double range = -eye.z() / d.z() > 0 ? -eye.z() / d.z() : 0;
      if (const auto hit = tree.cast(eye, d)) range = hit->range_m;
      f.depth_m(r, c) = static_cast<float>(range);
    }
  return f;
}

TEST_F(Model, views_of_a_recording_are_fused_and_completed_on_the_table) {
  const geometry::TriangleTree ball(shapes::sphere(0.04, 5, Vec3(0, 0, 0.04)));
  Recording recording;
  recording.name = "ball";
  recording.environment.planes = {Plane{Vec3::Zero(), Vec3::UnitZ()}};
  recording.free = true;
  for (int k = 0; k < 4; ++k)
    recording.rest.views.push_back(view(ball, Vec3(0.25 * std::cos(1.57 * k), 0.25 * std::sin(1.57 * k), 0.2)));
  Tool tip;
  tip.name = "tip";
  tip.radius_m = 0.005;
  recording.tools = {tip};
  Load load;
  load.tool = "tip";
  load.force_n = Vec3(0, 0, -1);
  load.contact_m = Vec3(0, 0, 0.08);
  Step step;
  step.loads = {load};
  ToolTravel travel;
  travel.travel_m = 0.001;
  travel.sigma_m = 0.0001;
  step.observations = {travel};
  Push push;
  push.name = "top";
  push.steps = {step};
  recording.pushes = {push};
  io::write_recording(recording, folder_ / "recording");
  const auto o = run((folder_ / "recording").string() + " --tetrahedra 2000 -o " + (folder_ / "out").string());
  ASSERT_EQ(o.exit_code, 0) << o.json;
  const double truth = 4.0 / 3 * M_PI * std::pow(0.04, 3);
  EXPECT_GT(o.json["volume_m3"].get<double>(), 0.97 * truth);
  EXPECT_LT(o.json["volume_m3"].get<double>(), 1.25 * truth);  // under the equator the flanks are upright
  EXPECT_GT(o.json["unseen_share"].get<double>(), 0.05);
  EXPECT_EQ(o.json["inverted"], 0);
}

}  // namespace
}  // namespace palpate::model_test
