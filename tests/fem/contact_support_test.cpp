// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Tables, walls and platens that hold without glue, against statics, Coulomb's law, Winkler's foundation and Hertz.
#include <gtest/gtest.h>

#include "fem_meshes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/contact_statics.hpp"

namespace palpate::fem::contact_support_test {
namespace {

constexpr double kYoung = 20000;
const Vec3 kSize(0.08, 0.06, 0.04);

RigidContact table(Touch law, double friction = 0) {
  RigidContact contact;
  contact.name = "table";
  contact.shape = plane_shape();
  contact.T_base_tool = tool_pose(Vec3::Zero(), Vec3::UnitZ());
  contact.law = law;
  contact.friction_coefficient = friction;
  return contact;
}

RigidContact platen(double height, Touch law, const MatrixX& free_axes = MatrixX(6, 0)) {
  RigidContact contact = table(law);
  contact.name = "platen";
  contact.T_base_tool = tool_pose(Vec3(0, 0, height), -Vec3::UnitZ());
  contact.free_axes = free_axes;
  return contact;
}

Boundary weight_only(const TetMesh& mesh) {
  Boundary b;
  b.forces = body_force(mesh);
  return b;
}

// A platen glued to the top presses with N and drags the block over the table. While all of it sticks the force grows with
// the motion; once all of it slides it is mu N, and it stays.
TEST(Table, BlockSlidesAtCoulombsForce) {
  const TetMesh mesh = block_mesh(4, 3, 2, kSize);
  const double friction = 0.4, press = 2;
  ContactOptions options;
  options.increments = 4;
  const ContactStatics body(mesh, "linear", Boundary(),
                            {table(Touch::friction, friction), platen(kSize.z(), Touch::bonded, along(Vec3::UnitZ()))},
                            options);
  ContactLoads loads = body.no_loads();
  loads.wrench[1](2) = -press;
  const ContactEquilibrium pressed = body.solve(kYoung, 0.3, loads);
  ASSERT_TRUE(pressed.converged) << pressed.reason;
  EXPECT_NEAR(pressed.touches[0].wrench(2), press, 1e-6 * press);

  double last = 0;
  ContactEquilibrium state = pressed;
  for (const auto& [motion, slides] : {std::pair{2e-5, false}, {3e-3, true}, {5e-3, true}}) {
    loads.motion[1](0) = motion;
    state = body.solve(kYoung, 0.3, loads, &state);
    ASSERT_TRUE(state.converged) << motion << ": " << state.reason;
    const double drag = -state.touches[0].wrench(0);
    EXPECT_NEAR(drag, state.touches[1].wrench(0), 1e-5 * press);
    EXPECT_NEAR(state.touches[0].wrench(2), press, 1e-5 * press);
    if (slides) {
      // Squeezed out sideways, the block does not slide exactly along the drag.
      EXPECT_NEAR(drag, friction * press, 1e-4 * friction * press);
      EXPECT_EQ(state.touches[0].slipping_points, state.touches[0].active_points);
    } else {
      EXPECT_GT(drag, last);
      EXPECT_LT(drag, 0.5 * friction * press);
      EXPECT_LT(state.touches[0].slipping_points, state.touches[0].active_points);
    }
    last = drag;
  }
}

// On a slope (gravity tilted) the block stays below the friction angle; above it nothing holds it, and that is said.
TEST(Table, BlockStaysBelowTheFrictionAngle) {
  const TetMesh mesh = block_mesh(4, 3, 2, kSize);
  const ContactStatics body(mesh, "linear", weight_only(mesh), {table(Touch::friction, 0.5)});
  ContactLoads loads = body.no_loads();
  const double weight = 9.81 * 1000 * kSize.prod();
  loads.force_coefficients = 9810 * Vec3(0, 0, -1);
  const ContactEquilibrium level = body.solve(kYoung, 0.3, loads);
  ASSERT_TRUE(level.converged) << level.reason;
  EXPECT_NEAR(level.touches[0].wrench(2), weight, 1e-6 * weight);
  loads.force_coefficients = 9810 * Vec3(0.4, 0, -1);
  const ContactEquilibrium held = body.solve(kYoung, 0.3, loads, &level);
  ASSERT_TRUE(held.converged) << held.reason;
  EXPECT_NEAR(held.touches[0].wrench(0), -0.4 * weight, 1e-5 * weight);
  loads.force_coefficients = 9810 * Vec3(0.6, 0, -1);
  const ContactEquilibrium lost = body.solve(kYoung, 0.3, loads, &held);
  EXPECT_FALSE(lost.converged);
  EXPECT_NE(lost.reason.find("nothing carries"), std::string::npos) << lost.reason;
  // What was reached is the friction angle.
  EXPECT_NEAR(lost.loads.force_coefficients(0) / 9810, 0.5, 0.003);
  EXPECT_TRUE(lost.displacement_m.allFinite());
}

// A stiff block on a soft layer is a rigid block on Winkler's foundation: pulled up at one end beyond the kern it lifts off
// and touches over three times the distance of the resultant from the other end.
TEST(Table, BlockLiftsOffAsOnWinklersFoundation) {
  const TetMesh mesh = block_mesh(12, 6, 4, kSize);
  Boundary boundary = weight_only(mesh);
  const auto end = nodes_where(mesh, [](const Vec3& x) { return x.x() > kSize.x() - 1e-9; });
  boundary.forces = hstack({boundary.forces, spread_over_nodes(static_cast<Index>(mesh.nodes_m.rows()), end)});
  RigidContact ground = table(Touch::frictionless);
  ground.stiffness = 1e-3;
  ContactOptions options;
  options.points_per_edge = 6;
  const ContactStatics body(mesh, "linear", boundary, {ground}, options);
  ContactLoads loads = body.no_loads();
  const double weight = 9.81 * kSize.prod(), pull = 0.4 * weight;
  loads.force_coefficients = VectorX::Zero(6);
  loads.force_coefficients(2) = -9.81;
  loads.force_coefficients(5) = pull;
  const ContactEquilibrium e = body.solve(1e6, 0.3, loads);
  ASSERT_TRUE(e.converged) << e.reason;
  const double arm = kSize.x() * (0.5 * weight - pull) / (weight - pull), touching = 3 * arm;
  const TouchResult& touch = e.touches[0];
  EXPECT_NEAR(touch.wrench(2), weight - pull, 1e-6 * weight);
  EXPECT_NEAR(-touch.wrench(4) / touch.wrench(2), arm, 1e-3 * arm);
  EXPECT_NEAR(touch.area_m2, touching * kSize.y(), 0.02 * touching * kSize.y());
  EXPECT_NEAR(touch.patch_m.col(0).maxCoeff(), touching, 0.02 * touching);
  // Layer of stiffness 1e-3 E over the size of a face (half of a cell of 6.67 x 10 mm).
  const double layer = 1e-3 * 1e6 / std::sqrt(0.5 * kSize.x() / 12 * kSize.y() / 6);
  EXPECT_NEAR(touch.penetration_m, 2 * (weight - pull) / (layer * touching * kSize.y()), 0.02 * touch.penetration_m);
}

// Uniaxial compression between frictionless platens, by force and by pose: F = E A d / L once the layers are taken off.
TEST(Platen, ByForceAndByPoseIsTheBar) {
  const TetMesh mesh = to_quadratic(distorted(block_mesh(3, 3, 2, {0.06, 0.06, 0.04}), 0.002, 3));
  const double area = 0.06 * 0.06, force = 1.5;
  VectorX layers;
  const auto solve = [&](bool by_force, double value) {
    const ContactStatics body(
        mesh, "linear", Boundary(),
        {table(Touch::frictionless), platen(0.04, Touch::frictionless, by_force ? along(Vec3::UnitZ()) : MatrixX(6, 0))});
    ContactLoads loads = body.no_loads();
    (by_force ? loads.wrench[1] : loads.motion[1])(2) = -value;
    ContactEquilibrium e = body.solve(kYoung, 0.3, loads);
    EXPECT_TRUE(e.converged) << e.reason;
    layers = body.layer_travel_m(e);
    return e;
  };
  const ContactEquilibrium pushed = solve(true, force);
  const double travel = 0.04 - pushed.touches[1].T_base_tool.translation().z();
  EXPECT_NEAR(travel - pushed.touches[0].layer_m - pushed.touches[1].layer_m, force * 0.04 / (kYoung * area), 1e-7 * travel);
  EXPECT_NEAR(layers(1), pushed.touches[0].layer_m + pushed.touches[1].layer_m, 1e-6 * layers(1));
  const ContactEquilibrium moved = solve(false, travel);
  EXPECT_NEAR(layers(1), pushed.touches[0].layer_m + pushed.touches[1].layer_m, 1e-6 * layers(1));
  EXPECT_NEAR(-moved.touches[1].wrench(2), force, 1e-6 * force);
  EXPECT_NEAR(moved.touches[0].wrench(2), force, 1e-6 * force);
}

// Bonded platens make the same block stiffer, and pull as well as push.
TEST(Platen, BondedHoldsAgainstPulling) {
  const TetMesh mesh = to_quadratic(block_mesh(3, 3, 2, {0.06, 0.06, 0.04}));
  const auto force_at = [&](Touch law, double travel) {
    const ContactStatics body(mesh, "linear", Boundary(), {table(law), platen(0.04, law)});
    ContactLoads loads = body.no_loads();
    loads.motion[1](2) = travel;
    const ContactEquilibrium e = body.solve(kYoung, 0.45, loads);
    EXPECT_TRUE(e.converged) << e.reason;
    return e.touches[1].wrench(2);
  };
  const double push = force_at(Touch::bonded, -1e-3), pull = force_at(Touch::bonded, 1e-3);
  EXPECT_NEAR(push, -pull, 1e-7 * pull);
  EXPECT_LT(push, 1.1 * force_at(Touch::frictionless, -1e-3));
  EXPECT_EQ(force_at(Touch::frictionless, 1e-3), 0);
}

// Ball of radius R from a cube's lattice (Nowell's mapping), with curved faces.
TetMesh ball(int cells, double radius) {
  TetMesh mesh = block_mesh(cells, cells, cells, {2, 2, 2});
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const Vec3 p = mesh.nodes_m.row(i).transpose().array() - 1, s = p.cwiseProduct(p);
    mesh.nodes_m.row(i) = radius * Vec3(p.x() * std::sqrt(1 - s.y() / 2 - s.z() / 2 + s.y() * s.z() / 3),
                                        p.y() * std::sqrt(1 - s.z() / 2 - s.x() / 2 + s.z() * s.x() / 3),
                                        p.z() * std::sqrt(1 - s.x() / 2 - s.y() / 2 + s.x() * s.y() / 3))
                                       .transpose();
  }
  mesh = to_quadratic(mesh);
  const Tetrahedra faces = boundary_faces(mesh);
  for (Index k = 0; k < faces.size(); ++k)
    mesh.nodes_m.row(faces.data()[k]) *= radius / mesh.nodes_m.row(faces.data()[k]).norm();
  return mesh;
}

// Pressed between two plates: free with both plates driven (rigid motions projected out), and lying on a table that is
// fixed. Both are the same state, and the closed form's within its error (a/R = 0.2) and the mesh's (a face is as large as
// the patch).
TEST(FreeBall, BetweenTwoOpposedPushes) {
  const double radius = 0.03, force = 0.2;
  const TetMesh mesh = ball(8, radius);
  Boundary free;
  free.inertia_relief = true;
  RigidContact below = platen(0, Touch::frictionless, along(Vec3::UnitZ())),
               above = platen(radius + 0.001, Touch::frictionless, along(Vec3::UnitZ()));
  below.T_base_tool = tool_pose(Vec3(0, 0, -radius - 0.001), Vec3::UnitZ());
  const auto gap = [](const ContactEquilibrium& e) {
    return e.touches[1].T_base_tool.translation().z() - e.touches[0].T_base_tool.translation().z();
  };
  const ContactStatics both(mesh, "linear", free, {below, above});
  ContactLoads loads = both.no_loads();
  loads.wrench[0](2) = force;
  loads.wrench[1](2) = -force;
  const ContactEquilibrium e = both.solve(kYoung, 0.3, loads);
  ASSERT_TRUE(e.converged) << e.reason;
  EXPECT_NEAR(e.touches[0].wrench(2), force, 1e-7 * force);
  EXPECT_NEAR(e.touches[1].wrench(2), -force, 1e-7 * force);

  below.free_axes = MatrixX(6, 0);
  below.T_base_tool.translation().z() = -radius;
  const ContactStatics lying(mesh, "linear", Boundary(), {below, above});
  loads.wrench[0].setZero();
  const ContactEquilibrium on_table = lying.solve(kYoung, 0.3, loads);
  ASSERT_TRUE(on_table.converged) << on_table.reason;
  EXPECT_NEAR(on_table.touches[0].wrench(2), force, 1e-6 * force);
  EXPECT_NEAR(gap(on_table), gap(e), 1e-6 * radius);

  // Half-space travel less what the other plate's field takes back at the centre (Tatara 1991).
  const double modulus = kYoung / (1 - 0.3 * 0.3), patch = std::cbrt(0.75 * force * radius / modulus);
  const double apart2 = patch * patch + 4 * radius * radius;
  const double far = 2 * 1.3 * radius * radius / std::pow(apart2, 1.5) + 0.91 / std::sqrt(apart2);
  const double expected = 2 * (patch * patch / radius - force * far / (M_PI * kYoung));
  const double closing = 2 * radius - gap(e) - e.touches[0].layer_m - e.touches[1].layer_m;
  EXPECT_NEAR(closing, expected, 0.06 * expected);
}

TEST(ContactErrors, AreNamed) {
  const TetMesh mesh = block_mesh(2, 2, 2, kSize);
  RigidContact glued = table(Touch::bonded);
  glued.T_base_tool.translation().z() = -1;
  const ContactStatics away(mesh, "linear", Boundary(), {glued});
  EXPECT_THROW(away.solve(kYoung, 0.3, away.no_loads()), Error);
  RigidContact twice = table(Touch::frictionless);
  twice.free_axes = MatrixX::Zero(6, 2);
  twice.free_axes.row(2).setOnes();
  EXPECT_THROW(ContactStatics(mesh, "linear", Boundary(), {twice}), Error);
  EXPECT_THROW(ContactStatics(mesh, "linear", Boundary(), {RigidContact()}), Error);
  Tool nodes;
  nodes.shape = ToolShape::vertices;
  EXPECT_THROW(shape_of(nodes), Error);
  // A tool that is pushed away from the object never meets it.
  Boundary held;
  held.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
  RigidContact away_tool = platen(0.05, Touch::frictionless, along(Vec3::UnitZ()));
  const ContactStatics body(mesh, "linear", held, {away_tool});
  ContactLoads loads = body.no_loads();
  loads.wrench[0](2) = 1;
  const ContactEquilibrium e = body.solve(kYoung, 0.3, loads);
  EXPECT_FALSE(e.converged);
  EXPECT_NE(e.reason.find("never meets"), std::string::npos) << e.reason;
}

}  // namespace
}  // namespace palpate::fem::contact_support_test
