// label: unit
// SPDX-License-Identifier: Apache-2.0
// Recordings that a program put together: what no file could hold is named by its place.
#include "palpate/core/recording_values.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "palpate/core/error.hpp"

namespace palpate {
namespace {

using testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();

Recording right() {
  Recording recording;
  TriMesh surface;
  surface.vertices_m.resize(4, 3);
  surface.vertices_m << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  surface.triangles.resize(4, 3);
  surface.triangles << 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3;
  recording.rest.surface = surface;
  Tool stick;
  stick.name = "stick";
  stick.radius_m = 0.01;
  recording.tools = {stick};
  Push push;
  push.name = "push 1";
  for (int s = 0; s < 2; ++s) {
    Step& step = push.steps.emplace_back();
    step.time_s = s;
    Load load;
    load.tool = "stick";
    load.force_n = Vec3(0, 0, -s);
    step.loads = {load};
    DepthFrame frame;
    frame.camera = {4, 3, 5, 5, 1.5, 1, DistortionModel::none, {}};
    frame.depth_m = DepthImage::Zero(3, 4);
    PointCloud cloud;
    cloud.points_m = Points::Zero(2, 3);
    cloud.sigma_m = VectorX::Constant(1, 1e-3);
    Markers markers;
    markers.sigma_m = 1e-3;
    ToolTravel travel;
    travel.sigma_m = 1e-4;
    Wrench wrench;
    wrench.force_sigma_n = 0.1;
    wrench.has_torque = true;
    wrench.torque_sigma_nm = 0.01;
    step.observations = {frame, cloud, markers, travel, wrench};
  }
  recording.pushes = {push};
  return recording;
}

/// What is said of a right recording that was spoilt, a line each.
std::string wrong(const std::function<void(Recording&)>& spoil) {
  Recording recording = right();
  spoil(recording);
  std::string all;
  for (const WrongValue& one : wrong_values(recording)) all += one.where + ": " + one.what + "\n";
  return all;
}

TEST(RecordingValues, WhatIsRightIsRight) {
  EXPECT_TRUE(wrong_values(right()).empty());
  EXPECT_NO_THROW(demand_right_values({}));
}

TEST(RecordingValues, WhatAnalysesWouldStumbleOverIsNamed) {
  const auto cloud = [](Recording& recording) -> PointCloud& { return std::get<PointCloud>(recording.pushes[0].steps[1].observations[1]); };
  const auto markers = [](Recording& recording) -> Markers& { return std::get<Markers>(recording.pushes[0].steps[1].observations[2]); };
  EXPECT_THAT(wrong([&](Recording& r) { cloud(r).points_m.resize(0, 3); }), HasSubstr("steps[1].observations[1].points_m: is empty"));
  EXPECT_THAT(wrong([&](Recording& r) { cloud(r).normals = Points::Zero(3, 3); }), HasSubstr("normals: has 3 rows for 2 points"));
  EXPECT_THAT(wrong([&](Recording& r) { cloud(r).sigma_m = VectorX::Constant(3, 1e-3); }), HasSubstr("sigma_m: has 3 values; give one, or one a point (2)"));
  EXPECT_THAT(wrong([&](Recording& r) { markers(r).rest_m = Points::Zero(2, 3); }), HasSubstr("observed_m: has 0 rows, rest_m 2 and names 0"));
  EXPECT_THAT(wrong([&](Recording& r) { r.pushes[0].steps[1].loads[0].travel_m = 0.001; }), HasSubstr("loads[0].travel_m: and force_n are both given"));
  EXPECT_THAT(wrong([&](Recording& r) { r.density_kg_m3 = 1.1; }), HasSubstr("density_kg_m3: is outside 5 to 30000 kg/m3; is it in g/cm3?"));
}

/// A force has nothing to be spread over; a body that is moved from two places was taken to go from the first.
TEST(RecordingValues, WhereAToolPressesIsNamed) {
  EXPECT_THAT(wrong([](Recording& r) { r.tools[0].radius_m = 0; }), HasSubstr("pushes[0].steps[1].loads[0].force_n: acts on 'stick', whose radius_m is 0"));
  const auto moved = [&](const Vec3& aside_m, const Vec3& direction) {
    return wrong([&](Recording& r) {
      for (Step& step : r.pushes[0].steps) {
        step.loads[0].force_n.reset();
        step.loads[0].travel_m = 0.001 * step.time_s;
      }
      Load& last = r.pushes[0].steps[1].loads[0];
      last.contact_m += aside_m;
      last.direction = direction;
    });
  };
  EXPECT_EQ(moved(Vec3::Zero(), -Vec3::UnitZ()), "");
  EXPECT_EQ(moved(Vec3(1e-4, 0, 0), Vec3(0.01, 0, -1)), "") << "as encoders repeat";
  EXPECT_THAT(moved(Vec3(0.004, 0, 0), -Vec3::UnitZ()), HasSubstr("pushes[0].steps[1].loads[0].contact_m: is elsewhere than where push 'push 1' moved 'stick' first"));
  EXPECT_THAT(moved(Vec3::Zero(), -Vec3::UnitX()), HasSubstr("pushes[0].steps[1].loads[0].direction: is another one"));
}

/// As files refuse them: the likely slip is named.
TEST(RecordingValues, AWrongUnitIsNamedWithWhatIsPossible) {
  const auto wrong = [](const std::function<void(Recording&)>& spoil) {
    Recording recording = right();
    spoil(recording);
    const auto found = wrong_values(recording);
    return found.size() == 1 ? found[0].where + ": " + found[0].what : std::to_string(found.size()) + " are wrong";
  };
  const auto seen = [](Recording& r, std::size_t o) -> Observation& { return r.pushes[0].steps[1].observations[o]; };
  EXPECT_EQ(wrong([](Recording& r) { r.tools[0].radius_m = 10; }),
            "tools[0].radius_m: is 10 m, which cannot be: 0 to 1 m is possible; is it in millimetres? It must be in metres");
  EXPECT_THAT(wrong([](Recording& r) { r.force_scale_std = 2; }), HasSubstr("force_scale_std: is 2, which cannot be: 0 to 1 is possible; is it in percent?"));
  EXPECT_THAT(wrong([](Recording& r) { r.tools[0].compliance_m_per_n = 0.4; }), HasSubstr("is it in mm/N?"));
  EXPECT_THAT(wrong([](Recording& r) { r.supports.emplace_back().pose_std_rad = 2; }), HasSubstr("supports[0].pose_std_rad: is 2 rad"));
  EXPECT_THAT(wrong([&](Recording& r) { std::get<DepthFrame>(seen(r, 0)).noise.sigma_m = 2; }), HasSubstr("observations[0].noise.sigma_m: is 2 m"));
  EXPECT_THAT(wrong([&](Recording& r) { std::get<PointCloud>(seen(r, 1)).sigma_m(0) = 2; }), HasSubstr("observations[1].sigma_m: is 2 m"));
  EXPECT_THAT(wrong([&](Recording& r) { std::get<Wrench>(seen(r, 4)).force_sigma_n = 1e6; }), HasSubstr("is it in millinewtons or grams?"));
  EXPECT_THAT(wrong([](Recording& r) { r.pushes[0].steps[0].loads[0].contact_std_m = 3; }), HasSubstr("loads[0].contact_std_m: is 3 m"));
  EXPECT_THAT(wrong([](Recording& r) { r.tools[0].shape = ToolShape::platen; }),
              HasSubstr("pushes[0].steps[1].loads[0].force_n: acts on 'stick', which has no patch that a force is spread over: give its motion (travel_m)"));
  EXPECT_EQ(wrong([](Recording& r) { r.tools.push_back(r.tools[0]); }), "tools[1].name: 'stick' is that of tools[0] too; names must differ");
  EXPECT_EQ(wrong([](Recording& r) { r.pushes.push_back(r.pushes[0]); }), "pushes[1].name: 'push 1' is that of pushes[0] too; names must differ");
}

TEST(RecordingValues, WhatIsWrongIsNamedByItsPlace) {
  const auto step = [](Recording& r) -> Step& { return r.pushes[0].steps[1]; };
  const auto load = [](Recording& r) -> Load& { return r.pushes[0].steps[1].loads[0]; };
  const auto seen = [](Recording& r, std::size_t o) -> Observation& { return r.pushes[0].steps[1].observations[o]; };
  const std::string in_step = "pushes[0].steps[1].", in_load = in_step + "loads[0].";
  const auto observed = [&](int o, const std::string& field) { return in_step + "observations[" + std::to_string(o) + "]." + field; };
  const std::vector<std::pair<std::string, std::function<void(Recording&)>>> cases = {
      {"force_scale_std", [&](Recording& r) { r.force_scale_std = nan; }},
      {"force_cross_talk_std", [&](Recording& r) { r.force_cross_talk_std = -0.1; }},
      {"density_kg_m3", [&](Recording& r) { r.density_kg_m3 = infinity; }},
      {"environment.gravity_m_s2", [&](Recording& r) { r.environment.gravity_m_s2.z() = nan; }},
      {"rest", [&](Recording& r) { r.rest.surface.reset(); }},
      {"rest.surface.triangles", [&](Recording& r) { r.rest.surface->triangles(0, 0) = 4; }},
      {"rest.surface.triangles", [&](Recording& r) { r.rest.surface->triangles.resize(0, 3); }},
      {"rest.surface.vertices_m", [&](Recording& r) { r.rest.surface->vertices_m(0, 0) = nan; }},
      {"tools[0].radius_m", [&](Recording& r) { r.tools[0].radius_m = -1; }},
      {"pushes[0].force_tare_std_n", [&](Recording& r) { r.pushes[0].force_tare_std_n = -1; }},
      {in_step + "time_s", [&](Recording& r) { step(r).time_s = nan; }},
      {in_step + "time_s", [&](Recording& r) { step(r).time_s = -1; }},
      {"pushes[0].steps[2].time_s", [&](Recording& r) { r.pushes[0].steps.push_back(step(r)); }},
      {in_step + "joints_rad", [&](Recording& r) { step(r).joints_rad = {0, nan}; }},
      {in_load + "tool", [&](Recording& r) { load(r).tool = "stik"; }},
      {in_load + "force_n", [&](Recording& r) { load(r).force_n.reset(); }},
      {in_load + "force_n", [&](Recording& r) { load(r).force_n->x() = nan; }},
      {in_load + "travel_m", [&](Recording& r) { load(r).force_n.reset(), load(r).travel_m = infinity; }},
      {in_load + "force_std_n", [&](Recording& r) { load(r).force_std_n = -1e-3; }},
      {in_load + "contact_m", [&](Recording& r) { load(r).contact_m.y() = nan; }},
      {in_load + "direction", [&](Recording& r) { load(r).direction.setZero(); }},
      {observed(0, "depth_m"), [&](Recording& r) { std::get<DepthFrame>(seen(r, 0)).depth_m.resize(4, 3); }},
      {observed(0, "mask"), [&](Recording& r) { std::get<DepthFrame>(seen(r, 0)).mask = MaskImage::Zero(2, 2); }},
      {observed(0, "camera"), [&](Recording& r) { std::get<DepthFrame>(seen(r, 0)).camera.fx_px = 0; }},
      {observed(0, "T_base_camera"), [&](Recording& r) { std::get<DepthFrame>(seen(r, 0)).T_base_camera.translation().x() = nan; }},
      {observed(1, "points_m"), [&](Recording& r) { std::get<PointCloud>(seen(r, 1)).points_m(1, 1) = nan; }},
      {observed(1, "sigma_m"), [&](Recording& r) { std::get<PointCloud>(seen(r, 1)).sigma_m(0) = nan; }},
      {observed(2, "sigma_m"), [&](Recording& r) { std::get<Markers>(seen(r, 2)).sigma_m = 0; }},
      {observed(3, "travel_m"), [&](Recording& r) { std::get<ToolTravel>(seen(r, 3)).travel_m = nan; }},
      {observed(3, "sigma_m"), [&](Recording& r) { std::get<ToolTravel>(seen(r, 3)).sigma_m = nan; }},
      {observed(3, "tool"), [&](Recording& r) { std::get<ToolTravel>(seen(r, 3)).tool = "finger"; }},
      {observed(4, "force_sigma_n"), [&](Recording& r) { std::get<Wrench>(seen(r, 4)).force_sigma_n = -1; }},
      {observed(4, "torque_nm"), [&](Recording& r) { std::get<Wrench>(seen(r, 4)).torque_nm.z() = infinity; }},
  };
  for (const auto& [where, spoil] : cases) {
    Recording recording = right();
    spoil(recording);
    const std::vector<WrongValue> wrong = wrong_values(recording);
    ASSERT_EQ(wrong.size(), 1u) << where;
    EXPECT_EQ(wrong[0].where, where);
    EXPECT_FALSE(wrong[0].what.empty());
    try {
      demand_right_values(wrong);
      ADD_FAILURE();
    } catch (const Error& error) {
      EXPECT_EQ(error.where(), where);
    }
  }
}

}  // namespace
}  // namespace palpate
