// label: unit
// SPDX-License-Identifier: Apache-2.0
// Recordings that a program put together: what no file could hold is named by its place.
#include "palpate/core/recording_values.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "palpate/core/error.hpp"

namespace palpate::recording_values_test {
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

/// A plane whose normal was twice as long stood twice as far from everything.
TEST(RecordingValues, DirectionsAreOfUnitLength) {
  const auto with_plane = [](const Vec3& normal) { return wrong([&](Recording& r) { r.environment.planes = {Plane{Vec3::Zero(), normal}}; }); };
  EXPECT_EQ(with_plane(Vec3(0, 0, 2)), "environment.planes[0].normal: is a direction: its length must be 1, is 2; normalise it\n");
  EXPECT_EQ(with_plane(Vec3(0, 0, 1.009)), "") << "few digits, which files may have, too";
  EXPECT_THAT(with_plane(Vec3(0, 0, 1.011)), HasSubstr("normal"));
  EXPECT_THAT(with_plane(Vec3::Zero()), HasSubstr("normal"));
  for (const SupportKind kind : {SupportKind::plane, SupportKind::table, SupportKind::wall, SupportKind::clamp}) {
    const auto held = [&](const Vec3& normal) {
      return wrong([&](Recording& r) {
        Support& support = r.supports.emplace_back();
        support.kind = kind;
        support.plane.normal = normal;
      });
    };
    EXPECT_EQ(held(-Vec3::UnitX()), "");
    EXPECT_THAT(held(Vec3(0, 3, 0)), HasSubstr("supports[0].plane.normal: is a direction")) << int(kind);
  }
  const auto tool = [](ToolShape shape, const Vec3& direction) {
    return wrong([&](Recording& r) {
      Tool& other = r.tools.emplace_back();
      other.name = "other";
      other.shape = shape;
      other.axis = other.plane.normal = direction;
    });
  };
  for (const ToolShape shape : {ToolShape::capsule, ToolShape::edge, ToolShape::platen}) {
    EXPECT_EQ(tool(shape, Vec3::UnitY()), "");
    EXPECT_THAT(tool(shape, Vec3(0, 2, 0)), HasSubstr(shape == ToolShape::platen ? "tools[1].plane.normal: is a" : "tools[1].axis: is a"));
  }
  EXPECT_EQ(tool(ToolShape::sphere, Vec3::Zero()), "") << "has neither";
}

/// What a program can say and no file: it was taken as exact, or read where nothing was.
TEST(RecordingValues, FilesAndProgramsMustSayTheSame) {
  const auto support = [](SupportKind kind, const std::function<void(Support&)>& spoil) {
    return wrong([&](Recording& r) {
      Support& one = r.supports.emplace_back();
      one.kind = kind;
      one.box_max_m = Vec3::Ones();
      spoil(one);
    });
  };
  EXPECT_EQ(support(SupportKind::box, [](Support&) {}), "");
  EXPECT_THAT(support(SupportKind::box, [](Support& s) { s.box_max_m.z() = 0; }), HasSubstr("supports[0].box_max_m: must be larger than box_min_m"));
  EXPECT_THAT(support(SupportKind::vertices, [](Support& s) { s.vertices = {0, 4}; }), HasSubstr("supports[0].vertices: names vertices from 0 to 4, there are 4"));
  EXPECT_THAT(support(SupportKind::plane, [](Support& s) { s.tolerance_m = 0; }), HasSubstr("supports[0].tolerance_m: must be a number above 0"));
  EXPECT_THAT(support(SupportKind::table, [](Support& s) { s.contact = ContactLaw::friction; }), HasSubstr("supports[0].friction_coefficient: must be a number above 0"));
  EXPECT_THAT(support(SupportKind::plane, [](Support& s) { s.contact = ContactLaw::frictionless, s.spread_std_m = 1e-3; }),
              HasSubstr("supports[0].spread_std_m: is for a support that is bonded"));
  const auto of_views = [](Recording& r) {
    r.rest.views = {std::get<DepthFrame>(r.pushes[0].steps[0].observations[0])};
    r.rest.surface.reset();
  };
  EXPECT_THAT(wrong([&](Recording& r) { of_views(r), r.supports.emplace_back().vertices = {0}; }), HasSubstr("supports[0].vertices: needs a mesh at rest"));
  EXPECT_THAT(wrong([&](Recording& r) { r.tools[0].pressure = Pressure::punch; }), HasSubstr("tools[0].pressure: is that under a disc"));
  EXPECT_EQ(wrong([&](Recording& r) { r.tools[0].pressure = Pressure::punch, r.tools[0].shape = ToolShape::disc; }), "");
  EXPECT_THAT(wrong([&](Recording& r) { r.tools[0].radius_std_m = 0.02; }), HasSubstr("tools[0].radius_std_m: is larger than the radius itself"));
  EXPECT_THAT(wrong([&](Recording& r) { r.density_kg_m3 = 30, r.density_std_kg_m3 = 40; }), HasSubstr("density_std_kg_m3: is larger than the density"));
  EXPECT_THAT(wrong([&](Recording& r) { r.environment.gravity_m_s2.z() = -9.81; }), HasSubstr("environment.gravity_m_s2: acts, but density_kg_m3 is not given"));
  const auto frame = [](Recording& r) -> DepthFrame& { return std::get<DepthFrame>(r.pushes[0].steps[1].observations[0]); };
  EXPECT_THAT(wrong([&](Recording& r) { frame(r).camera.distortion_coefficients = {0.1, 0, 0, 0}; }),
              HasSubstr("observations[0].camera.distortion_coefficients: has 4 numbers; plumb_bob has 4 or 5, rational 8, fisheye 4, none 0"));
  EXPECT_THAT(wrong([&](Recording& r) { frame(r).camera.fx_px = 1e6; }), HasSubstr("observations[0].camera.fx_px: is 1e+06 px, which cannot be"));
  EXPECT_THAT(wrong([&](Recording& r) { frame(r).T_base_camera.linear() *= -1; }), HasSubstr("observations[0].T_base_camera: is no rigid transform"));
  EXPECT_THAT(wrong([&](Recording& r) { r.pushes[0].steps[1].time_s = 1.7e18; }), HasSubstr("pushes[0].steps[1].time_s: is 1.7e+18 s, which cannot be"));
  EXPECT_THAT(wrong([&](Recording& r) {
                Load& load = r.pushes[0].steps[1].loads[0];
                load.force_n.reset(), load.travel_m = 1e-3, load.force_rate_n_s = Vec3::UnitZ();
              }),
              HasSubstr("loads[0].force_rate_n_s: belongs to a force that is given"));
}

/// A mesh of other columns was read past its end.
TEST(RecordingValues, ATetrahedronHasFourNodesOrTen) {
  const auto of_columns = [](Eigen::Index columns) {
    return wrong([&](Recording& r) {
      r.rest.volume = TetMesh{r.rest.surface->vertices_m, Tetrahedra::Zero(1, columns)};
      r.rest.surface.reset();
    });
  };
  EXPECT_EQ(of_columns(4), "");
  EXPECT_EQ(of_columns(10), "");
  for (const Eigen::Index columns : {3, 5, 8, 11}) EXPECT_THAT(of_columns(columns), HasSubstr("rest.volume.tetrahedra: has " + std::to_string(columns) + " columns"));
}

TEST(RecordingValues, RegionsAreThoseThatAFileMayName) {
  const auto regions = [](const std::function<void(std::vector<Region>&)>& spoil) {
    return wrong([&](Recording& r) {
      r.rest.volume = TetMesh{r.rest.surface->vertices_m, Tetrahedra::Zero(2, 4)};
      r.rest.volume->tetrahedra.rowwise() = Eigen::Matrix<Index, 1, 4>(0, 1, 2, 3);
      r.rest.surface.reset();
      r.regions.resize(2);
      r.regions[0].name = "low";
      r.regions[0].select = RegionSelection::box;
      r.regions[0].box_max_m = Vec3::Ones();
      r.regions[1].name = "high";
      spoil(r.regions);
    });
  };
  using All = std::vector<Region>;
  EXPECT_EQ(regions([](All&) {}), "");
  EXPECT_THAT(regions([](All& all) { all[1].name.clear(); }), HasSubstr("regions[1].name: must not be empty"));
  EXPECT_THAT(regions([](All& all) { all[0].box_min_m.x() = nan; }), HasSubstr("regions[0].box_min_m: holds NaN"));
  EXPECT_THAT(regions([](All& all) { all[0].box_max_m.x() = 0; }), HasSubstr("regions[0].box_max_m: must be larger"));
  EXPECT_THAT(regions([](All& all) { all[0].select = RegionSelection::rest; }), HasSubstr("regions[1].select: is 'rest', and another"));
  const auto points = [](All& all, const Points& at) { all[0].select = RegionSelection::points, all[0].points_m = at; };
  EXPECT_THAT(regions([&](All& all) { points(all, Points::Constant(1, 3, infinity)); }), HasSubstr("regions[0].points_m: holds NaN or infinity"));
  EXPECT_THAT(regions([&](All& all) { points(all, Points(0, 3)); }), HasSubstr("regions[0].points_m: holds no point"));
  EXPECT_THAT(regions([&](All& all) { points(all, Points::Zero(1, 3)); }), HasSubstr("regions: around points leave no rest"));
  const auto elements = [](All& all, const std::vector<Index>& of) { all[0].select = RegionSelection::elements, all[0].elements = of; };
  EXPECT_EQ(regions([&](All& all) { elements(all, {1}); }), "");
  EXPECT_THAT(regions([&](All& all) { elements(all, {0, 2}); }), HasSubstr("regions[0].elements: names element 2, the volume has 2"));
  EXPECT_THAT(regions([&](All& all) { elements(all, {1, 1}); }), HasSubstr("regions[0].elements: names element 1, which was named before"));
  EXPECT_THAT(wrong([](Recording& r) {
                Region& one = r.regions.emplace_back();
                one.select = RegionSelection::elements;
                one.elements = {0};
              }),
              HasSubstr("regions[0].elements: needs a volume at rest"));
}

TEST(RecordingValues, WhatIsWrongIsNamedByItsPlace) {
  const auto step = [](Recording& r) -> Step& { return r.pushes[0].steps[1]; };
  const auto load = [](Recording& r) -> Load& { return r.pushes[0].steps[1].loads[0]; };
  const auto seen = [](Recording& r, std::size_t o) -> Observation& { return r.pushes[0].steps[1].observations[o]; };
  const std::string in_step = "pushes[0].steps[1].", in_load = in_step + "loads[0].";
  const auto observed = [&](int o, const std::string& field) { return in_step + "observations[" + std::to_string(o) + "]." + field; };
  const auto held = [](Recording& r, SupportKind kind) -> Support& {
    Support& support = r.supports.emplace_back();
    support.kind = kind;
    support.box_max_m = Vec3::Ones();
    return support;
  };
  const auto tool = [](Recording& r, ToolShape shape) -> Tool& {
    Tool& other = r.tools.emplace_back();
    other.name = "other";
    other.shape = shape;
    return other;
  };
  const auto two_markers = [&](Recording& r) -> Markers& {
    Markers& markers = std::get<Markers>(seen(r, 2));
    markers.rest_m = markers.observed_m = Points::Zero(2, 3);
    markers.observed_m.row(1).setConstant(nan);
    return markers;
  };
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
      {"rest.surface_correlation_m", [&](Recording& r) { r.rest.surface_correlation_m = nan; }},
      {"rest.surface_correlation_m", [&](Recording& r) { r.rest.surface_correlation_m = 0; }},
      {"rest.observed_triangles", [&](Recording& r) { r.rest.observed_triangles = Triangles::Constant(1, 3, 4); }},
      {"rest.volume.tetrahedra", [&](Recording& r) { r.rest.volume = TetMesh{r.rest.surface->vertices_m, Tetrahedra(0, 0)}; }},
      {"supports[0].plane.point_m", [&](Recording& r) { held(r, SupportKind::plane).plane.point_m.x() = nan; }},
      {"supports[0].plane.normal", [&](Recording& r) { held(r, SupportKind::table).plane.normal.x() = infinity; }},
      {"supports[0].tolerance_m", [&](Recording& r) { held(r, SupportKind::wall).tolerance_m = nan; }},
      {"supports[0].tolerance_m", [&](Recording& r) { held(r, SupportKind::plane).tolerance_m = -1e-3; }},
      {"supports[0].box_min_m", [&](Recording& r) { held(r, SupportKind::box).box_min_m.x() = nan; }},
      {"supports[0].vertices", [&](Recording& r) { held(r, SupportKind::vertices).vertices = {-1}; }},
      {"supports[0].friction_coefficient", [&](Recording& r) { held(r, SupportKind::table).friction_coefficient = -1; }},
      {"environment.planes[0].point_m", [&](Recording& r) { r.environment.planes.emplace_back().point_m.z() = nan; }},
      {"environment.gravity_m_s2", [&](Recording& r) { r.environment.gravity_m_s2.z() = -981, r.density_kg_m3 = 30; }},
      {"tools[1].axis", [&](Recording& r) { tool(r, ToolShape::edge).axis.x() = nan; }},
      {"tools[1].plane.point_m", [&](Recording& r) { tool(r, ToolShape::platen).plane.point_m.x() = nan; }},
      {"tools[1].vertices", [&](Recording& r) { tool(r, ToolShape::vertices).vertices = {0, 70}; }},
      {"tools[1].mesh", [&](Recording& r) { tool(r, ToolShape::mesh); }},
      {"tools[1].mesh.vertices_m", [&](Recording& r) { (tool(r, ToolShape::mesh).mesh = r.rest.surface)->vertices_m(0, 0) = nan; }},
      {"tools[1].mesh.triangles", [&](Recording& r) { (tool(r, ToolShape::mesh).mesh = r.rest.surface)->triangles(0, 0) = 4; }},
      {"tools[1].friction_coefficient", [&](Recording& r) { tool(r, ToolShape::sphere).contact = ContactLaw::friction; }},
      {in_step + "T_base_tip", [&](Recording& r) { (step(r).T_base_tip = Pose::Identity())->linear() *= 2; }},
      {observed(0, "camera.distortion_coefficients"),
       [&](Recording& r) {
         Camera& camera = std::get<DepthFrame>(seen(r, 0)).camera;
         camera.distortion = DistortionModel::fisheye;
         camera.distortion_coefficients = {0.1, nan, 0, 0};
       }},
      {observed(0, "noise.lens_scatter_std"), [&](Recording& r) { std::get<DepthFrame>(seen(r, 0)).noise.lens_scatter_std = -0.01; }},
      {observed(2, "rest_std_m"), [&](Recording& r) { std::get<Markers>(seen(r, 2)).rest_std_m = -1; }},
      {observed(2, "rest_std_m"), [&](Recording& r) { std::get<Markers>(seen(r, 2)).rest_std_m = nan; }},
      {observed(2, "names"), [&](Recording& r) { two_markers(r).names = {"a", "a"}; }},
      {observed(2, "rest_m"), [&](Recording& r) { two_markers(r).rest_m(0, 0) = infinity; }},
      {observed(2, "observed_m"), [&](Recording& r) { two_markers(r).observed_m(0, 0) = infinity; }},
      {observed(4, "time_s"), [&](Recording& r) { std::get<Wrench>(seen(r, 4)).time_s = nan; }},
      {observed(4, "along"), [&](Recording& r) { std::get<Wrench>(seen(r, 4)).along.x() = nan; }},
      {observed(4, "along"), [&](Recording& r) { std::get<Wrench>(seen(r, 4)).along = Vec3(0, 0, 2); }},
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
}  // namespace palpate::recording_values_test
