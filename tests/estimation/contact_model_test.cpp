// label: contract
// SPDX-License-Identifier: Apache-2.0
// Objects that lie on tables and lean on walls, rough or smooth, and rigid tools whose motion is imposed: derivatives
// against differences, lift-off and sliding against statics, and E of a block whose truth is solved without this room.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/estimation/held_body.hpp"
#include "palpate/estimation/rigid_tool.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/regions.hpp"
#include "scenes.hpp"

namespace palpate::estimation::contact_model_test {
namespace {

Support table(ContactLaw contact, double friction = 0) {
  Support support = sliding("table", Vec3::Zero(), Vec3::UnitZ());
  support.kind = SupportKind::table;
  support.contact = contact;
  support.friction_coefficient = friction;
  return support;
}

Load force_of(const std::string& tool, const Vec3& force_n, const Vec3& contact_m) {
  Load load;
  load.tool = tool;
  load.force_n = force_n;
  load.contact_m = contact_m;
  load.direction = force_n.normalized();
  return load;
}

Load motion_of(const std::string& tool, double travel_m, const Vec3& contact_m = Vec3::Zero()) {
  Load load;
  load.tool = tool;
  load.travel_m = travel_m;
  load.contact_m = contact_m;
  return load;
}

Tool round_tool(const std::string& name, ToolShape shape, double radius_m, ContactLaw contact) {
  Tool tool;
  tool.name = name;
  tool.shape = shape;
  tool.radius_m = radius_m;
  tool.contact = contact;
  return tool;
}

Push push_of(const std::string& name, const std::vector<Load>& steps) {
  Push push;
  push.name = name;
  for (const Load& load : steps) {
    push.steps.emplace_back();
    push.steps.back().loads = {load};
  }
  return push;
}

/// A block of 20 kPa on its table, under its own weight.
Recording lying_block(const Support& support, RestState state) {
  Recording recording;
  recording.supports = {support};
  recording.environment.gravity_m_s2 = Vec3(0, 0, -9.81);
  recording.density_kg_m3 = 1000;
  recording.density_std_kg_m3 = 50;
  recording.rest.state = state;
  recording.tools = {round_tool("pad", ToolShape::disc, 0.012, ContactLaw::bonded),
                     round_tool("ball", ToolShape::sphere, 0.012, ContactLaw::frictionless)};
  return recording;
}

struct Scene {
  const char* name;
  const char* material;
  Recording recording;
  std::size_t step;
  bool two_regions = false;
};

/// Two halves along x with an E of their own.
SimulatedObject in_halves(SimulatedObject object) {
  object.region_names = {"left", "right"};
  for (Index e = 0; e < object.mesh.tetrahedra.rows(); ++e)
    object.region.push_back(fem::element_centre(object.mesh, e).x() < 0.5 * block_size_m.x() ? 0 : 1);
  return object;
}

std::vector<Scene> scenes() {
  const Vec3 end(0.05, 0.02, block_size_m.z()), middle(0.03, 0.02, block_size_m.z());
  std::vector<Scene> out;
  {  // one end comes off the table
    Recording r = lying_block(table(ContactLaw::frictionless), RestState::stress_free);
    r.pushes = {push_of("down", {force_of("pad", Vec3(0, 0, -2), end)})};
    r.pushes[0].steps[0].loads[0].contact_std_m = 1e-3;
    r.force_scale_std = 0.02;
    r.force_cross_talk_std = 0.015;
    out.push_back({"smooth_table", "neo_hookean", r, 0});
    // What is measured sideways is an error: nothing holds the block that way.
    r.pushes[0].steps[0].loads[0].force_n = Vec3(0.03, -0.02, -2);
    r.pushes[0].steps[0].loads[0].force_std_n = 0.02;
    out.push_back({"smooth_table_noisy_force", "linear", r, 0});
    out.push_back({"smooth_table_two_regions", "neo_hookean", r, 0, true});
  }
  for (const RestState state : {RestState::stress_free, RestState::under_gravity}) {  // rubs over the table
    Recording r = lying_block(table(ContactLaw::friction, 0.3), state);
    r.pushes = {
        push_of("aside", {force_of("pad", Vec3(0.1, 0, -1), middle), force_of("pad", Vec3(0.45, 0.05, -1.5), middle)})};
    for (auto& step : r.pushes[0].steps) step.loads[0].force_std_n = 0.01;
    out.push_back({state == RestState::stress_free ? "rough_table" : "rough_table_seen_lying", "linear", r, 1});
    if (state == RestState::stress_free) out.push_back({"rough_table_two_regions", "neo_hookean", r, 1, true});
  }
  {
    Recording r = lying_block(table(ContactLaw::friction, 0.5), RestState::under_gravity);
    r.pushes = {push_of("ball", {motion_of("ball", 0.002, middle), motion_of("ball", 0.004, middle)})};
    r.pushes[0].travel_offset_std_m = 2e-4;
    r.pushes[0].force_tare_std_n = 0.02;
    for (auto& step : r.pushes[0].steps) {
      step.loads[0].contact_std_m = 1e-3;
      step.observations = {ToolTravel{"ball", *step.loads[0].travel_m, 1e-4}};
    }
    out.push_back({"ball_by_travel", "neo_hookean", r, 1});
    // Nothing slides under a tip that is pushed askew; before it touches it stands where it stands.
    r.environment.gravity_m_s2.setZero();
    r.supports[0].kind = SupportKind::plane;
    r.supports[0].contact = ContactLaw::bonded;
    r.tools[1].contact = ContactLaw::bonded;
    for (auto& step : r.pushes[0].steps) step.loads[0].direction = Vec3(0.3, -0.1, -1).normalized();
    r.pushes[0].steps.insert(r.pushes[0].steps.begin(), Step());
    out.push_back({"sticking_ball_by_travel", "linear", r, 2});
  }
  {
    Recording r = lying_block(table(ContactLaw::frictionless), RestState::stress_free);
    r.environment.gravity_m_s2.setZero();
    r.supports.push_back(sliding("wall", Vec3::Zero(), Vec3::UnitX()));
    r.supports.push_back(sliding("side", Vec3::Zero(), Vec3::UnitY()));
    Tool plate = round_tool("plate", ToolShape::platen, 0, ContactLaw::friction);
    plate.plane = {Vec3(0, 0, block_size_m.z()), -Vec3::UnitZ()};
    plate.friction_coefficient = 0.1;
    r.tools = {plate};
    r.pushes = {push_of("press", {motion_of("plate", 0.001), motion_of("plate", 0.003)})};
    r.pushes[0].travel_offset_std_m = 1e-4;
    out.push_back({"rough_platen", "neo_hookean", r, 1});
  }
  return out;
}

class ContactDerivatives : public testing::TestWithParam<std::size_t> {};

TEST_P(ContactDerivatives, AreThoseOfSurfaceForceAndTravel) {
  const Scene scene = scenes()[GetParam()];
  const TetMesh mesh = kuhn_block(4, 3, 2, block_size_m);
  Unknowns unknowns;
  const SimulatedObject whole = simulated(mesh, scene.material);
  ForwardModel model(scene.recording, scene.two_regions ? in_halves(whole) : whole, unknowns, tight());
  VectorX at = unknowns.prior_mean();
  if (scene.two_regions) at(first_ratio) = std::log(2.5);
  for (int k = unknowns.parameter_count(); k < unknowns.size(); ++k) at(k) += 0.3 * unknowns[k].prior_std;
  at(log_young) = std::log(2e4);
  at(poisson) = 0.3;
  const StepPrediction here = model.predict(scene.step, at);
  ASSERT_TRUE(here.converged) << here.reason;
  const auto flat = [](const StepPrediction& p) {
    VectorX all(p.surface_m.size() + 4);
    for (Index v = 0; v < p.surface_m.rows(); ++v) all.segment<3>(3 * v) = p.surface_m.row(v).transpose();
    all.tail<4>() << p.travel_m(0), p.force_n[0];
    return all;
  };
  for (int k = 0; k < unknowns.size(); ++k) {
    VectorX claimed = VectorX::Zero(flat(here).size());
    for (std::size_t c = 0; c < here.columns.size(); ++c) {
      if (here.columns[c] != k) continue;
      const Index column = static_cast<Index>(c);
      claimed.head(here.d_surface.rows()) += here.d_surface.col(column);
      claimed.tail<4>() += (VectorX(4) << here.d_travel(0, column), here.d_force[0].col(column)).finished();
    }
    const double h = k < unknowns.parameter_count() ? 2e-5 : difference_of(unknowns, k);
    const double prior = k < unknowns.parameter_count() ? 1 : unknowns[k].prior_std;
    VectorX ahead = at, behind = at;
    ahead(k) += h;
    behind(k) -= h;
    const VectorX measured = (flat(model.predict(scene.step, ahead)) - flat(model.predict(scene.step, behind))) / (2 * h);
    const auto compare = [&](Index first, Index size, double matters, const char* what) {
      const double scale = std::max(measured.segment(first, size).cwiseAbs().maxCoeff(), matters / prior);
      EXPECT_LT((claimed - measured).segment(first, size).cwiseAbs().maxCoeff(), 1e-3 * scale)
          << what << " to " << unknowns[k].name;
    };
    compare(0, here.d_surface.rows(), 1e-7, "surface");
    compare(here.d_surface.rows(), 1, 1e-7, "travel");
    compare(here.d_surface.rows() + 1, 3, 1e-4, "force");
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, ContactDerivatives, testing::Range<std::size_t>(0, scenes().size()),
                         [](const auto& each) { return std::string(scenes()[each.param].name); });

StepPrediction predicted(const Recording& recording, const TetMesh& mesh, const std::string& material,
                         std::size_t step = 0) {
  Unknowns unknowns;
  ForwardModel model(recording, simulated(mesh, material), unknowns, tight(), nullptr, 1e-10);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(2e4);
  at(poisson) = 0.3;
  return model.predict(step, at, true);
}

// A block clamped at one end over its table: lifted it knows nothing of the table, pressed down it is held by it.
TEST(ContactModel, ATableOnlyPushes) {
  const TetMesh mesh = kuhn_block(4, 3, 2, block_size_m);
  Recording recording;
  Support clamp;
  clamp.kind = SupportKind::clamp;
  clamp.vertices = nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; });
  recording.supports = {clamp, table(ContactLaw::frictionless)};
  recording.tools = {round_tool("pad", ToolShape::disc, 0.012, ContactLaw::bonded)};
  for (const double newton : {0.1, -0.1}) {
    recording.pushes = {push_of("pad", {force_of("pad", Vec3(0, 0, newton), Vec3(0.05, 0.02, block_size_m.z()))})};
    const StepPrediction with = predicted(recording, mesh, "linear");
    ASSERT_TRUE(with.converged) << with.reason;
    Recording other = recording;
    if (newton > 0) other.supports.pop_back();
    if (newton < 0) other.supports = held_both_ways(other.supports);
    const StepPrediction same = predicted(other, mesh, "linear");
    const double largest = (same.surface_m - simulated(mesh, "linear").surface.rest().vertices_m).cwiseAbs().maxCoeff();
    const double apart = (with.surface_m - same.surface_m).cwiseAbs().maxCoeff();
    // Pulled: exactly. Pressed: some of the block's bottom would rather come off.
    EXPECT_LT(apart, newton > 0 ? 1e-9 * largest : 0.1 * largest);
  }
}

// A bar between a platen and a table that only push is Hooke's, but for the layers.
TEST(ContactModel, ABarBetweenPlatenAndTableIsHookes) {
  const Vec3 size_m(0.03, 0.02, 0.05);
  const TetMesh mesh = kuhn_block(2, 2, 3, size_m);
  Recording recording;
  recording.supports = {table(ContactLaw::frictionless)};
  Tool plate = round_tool("plate", ToolShape::platen, 0, ContactLaw::frictionless);
  plate.plane = {Vec3(0, 0, size_m.z()), -Vec3::UnitZ()};
  recording.tools = {plate};
  recording.pushes = {push_of("press", {motion_of("plate", 0.004)})};
  const StepPrediction predicted_step = predicted(recording, mesh, "linear");
  ASSERT_TRUE(predicted_step.converged) << predicted_step.reason;
  const double newton = 2e4 * size_m.x() * size_m.y() * 0.004 / size_m.z();
  EXPECT_NEAR(-predicted_step.force_n[0].z(), newton, 5e-4 * newton);
}

TEST(ContactModel, SmoothTablesHoldNothingSidewaysAndRoughChosenNodesAreErrors) {
  const TetMesh mesh = kuhn_block(2, 2, 2, block_size_m);
  Recording smooth = lying_block(table(ContactLaw::frictionless), RestState::stress_free);
  smooth.pushes = {push_of("aside", {force_of("pad", Vec3(0.2, 0, -1), Vec3(0.03, 0.02, block_size_m.z()))})};
  try {
    predicted(smooth, mesh, "linear");
    FAIL() << "nothing holds 0.2 N sideways";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("give 'table' its friction"), std::string::npos) << error.what();
  }
  // Three standard deviations of the measurement: it was not there.
  Recording noisy = smooth, straight = smooth;
  noisy.pushes[0].steps[0].loads[0].force_std_n = 0.07;
  straight.pushes[0].steps[0].loads[0].force_n = Vec3(0, 0, -1);
  const StepPrediction without = predicted(noisy, mesh, "linear"), down = predicted(straight, mesh, "linear");
  ASSERT_TRUE(without.converged && down.converged);
  EXPECT_LT((without.surface_m - down.surface_m).cwiseAbs().maxCoeff(), 1e-12);
  Recording rough = smooth;
  rough.supports[0].contact = ContactLaw::friction;
  rough.supports[0].friction_coefficient = 0.5;
  EXPECT_TRUE(predicted(rough, mesh, "linear").converged);
  rough.supports[0].kind = SupportKind::plane;
  EXPECT_THROW(predicted(rough, mesh, "linear"), Error);
  Recording missed = lying_block(table(ContactLaw::friction, 0.5), RestState::stress_free);
  missed.pushes = {push_of("ball", {motion_of("ball", 0.001, Vec3(0.3, 0.02, block_size_m.z()))})};
  EXPECT_THROW(predicted(missed, mesh, "linear"), Error);
}

TEST(RigidTool, StartsWhereItJustTouches) {
  const TetMesh mesh = kuhn_block(3, 2, 2, block_size_m);
  Tool ball = round_tool("ball", ToolShape::sphere, 0.01, ContactLaw::frictionless);
  Load load = motion_of("ball", 0, Vec3(0.031, 0.017, block_size_m.z()));
  for (const double tilt : {0.0, 0.4}) {
    load.direction = Vec3(std::sin(tilt), 0, -std::cos(tilt));
    const fem::RigidContact contact = rigid_tool(mesh, ball, load);
    const Vec3 centre = contact.T_base_tool * Vec3(0, 0, -ball.radius_m);
    EXPECT_NEAR(centre.z(), block_size_m.z() + ball.radius_m, 1e-3 * ball.radius_m) << tilt;
    const Vec3 line = load.contact_m - centre;
    EXPECT_LT(line.cross(load.direction).norm(), 1e-12) << "on the line of the push";
  }
}

/// What sensors would say of a block on a rough table: solved by the contact solver alone on a mesh twice as fine as the
/// fit's.
class LyingBlock : public testing::Test {
 protected:
  LyingBlock() {
    recording = lying_block(table(ContactLaw::friction, 0.5), RestState::under_gravity);
    recording.density_std_kg_m3 = 0;
    recording.tools[0].radius_m = 0.018;
    recording.model.material = "linear";
    recording.model.poisson_fixed = 0.3;
    recording.pushes = {push_of("end", {})};
    for (const double newton : {0.38, 0.44}) {  // pulls one end up, of a weight of 0.7 N; and aside
      Step step;
      step.loads = {force_of("pad", Vec3(0.1, 0, 1) * newton, Vec3(0.046, 0.02, block_size_m.z()))};
      recording.pushes[0].steps.push_back(step);
    }
    const TetMesh mesh = fem::to_quadratic(kuhn_block(6, 4, 3, block_size_m));
    fem::Boundary boundary;
    boundary.forces = fem::body_force(mesh);
    const auto pad = fem::spread_over_patch(mesh, recording.pushes[0].steps[0].loads[0].contact_m, 0.018);
    Eigen::SparseMatrix<double> all(boundary.forces.rows(), 6);
    all.leftCols(3) = boundary.forces;
    all.rightCols(3) = pad;
    boundary.forces = all;
    fem::RigidContact ground;
    ground.shape = fem::plane_shape();
    ground.T_base_tool = fem::tool_pose(Vec3::Zero(), Vec3::UnitZ());
    ground.law = fem::Touch::friction;
    ground.friction_coefficient = 0.5;
    ground.seat_m = 1e-6;
    ground.stiffness = 1000;
    const fem::ContactStatics body(mesh, "linear", boundary, {ground});
    fem::ContactLoads loads = body.no_loads();
    loads.force_coefficients(2) = -9810;
    fem::ContactEquilibrium state = body.solve(young_pa, 0.3, loads);
    const VectorX lying = state.displacement_m;
    const SimulatedSurface surface = SimulatedSurface::boundary_of(mesh, nullptr);
    for (Step& step : recording.pushes[0].steps) {
      loads.force_coefficients.tail<3>() = *step.loads[0].force_n;
      state = body.solve(young_pa, 0.3, loads, &state);
      EXPECT_TRUE(state.converged) << state.reason;
      PointCloud cloud;
      const Points& rest = surface.rest().vertices_m;
      const MatrixX moved = surface.restrict(VectorX(state.displacement_m - lying));
      cloud.points_m = rest;
      for (Index v = 0; v < rest.rows(); ++v) cloud.points_m.row(v) += moved.col(0).segment<3>(3 * v).transpose();
      cloud.sigma_m = VectorX::Constant(1, 2e-5);
      inputs.push_back({cloud});
    }
    lifted_m = state.displacement_m(3 * 6 + 2);  // the corner below the end that is pulled
  }
  static constexpr double young_pa = 2e4;
  Recording recording;
  Inputs inputs;
  double lifted_m = 0;
};

TEST_F(LyingBlock, IsAsStiffAsItIsAlthoughItLiftsOff) {
  EXPECT_GT(lifted_m, 1e-4) << "one end is off the table";
  FitOptions options;
  options.cross_checks = options.stresses = false;
  const SimulatedObject object = simulated(fem::to_quadratic(kuhn_block(4, 3, 2, block_size_m)), "linear");
  const Identification answer = fit(recording, object, inputs, options);
  ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
  EXPECT_NEAR(answer.parameters[0].value, young_pa, 0.05 * young_pa) << "the mesh of the fit is coarse";
  // Held in both directions it cannot lift off, and nothing fits.
  Recording held = recording;
  held.supports = held_both_ways(held.supports);
  const Identification wrong = fit(held, object, inputs, options);
  EXPECT_LT(wrong.parameters[0].value, 0.75 * young_pa);
  EXPECT_GT(wrong.fit.rms_m, 3 * answer.fit.rms_m);
  RecordProperty("lifted_um", std::to_string(1e6 * lifted_m));
  RecordProperty("young_kpa", std::to_string(1e-3 * answer.parameters[0].value));
  RecordProperty("held_both_ways_kpa", std::to_string(1e-3 * wrong.parameters[0].value));
  RecordProperty("rms_um", std::to_string(1e6 * answer.fit.rms_m));
  RecordProperty("held_both_ways_rms_um", std::to_string(1e6 * wrong.fit.rms_m));
  RecordProperty("solves", answer.fit.solves);
}

}  // namespace
}  // namespace palpate::estimation::contact_model_test
