// label: contract
// SPDX-License-Identifier: Apache-2.0
// Exact sensitivities of contact states against central differences, with steps that leave the active set alone, for every
// shape, driven by pose and by force, frictionless, with Coulomb friction, sticking and bonded; and along sequences of steps.
#include <gtest/gtest.h>

#include <functional>

#include "fem_meshes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/contact_statics.hpp"

namespace palpate::fem::contact_sensitivity_test {
namespace {

struct Scene {
  const char* name;
  std::function<RigidShapePtr(double)> shape;  // of a radius
  double radius;
  Touch law;
  bool by_force;
  const char* material;
};

TriMesh wedge() {
  TriMesh mesh;
  mesh.vertices_m.resize(6, 3);
  mesh.vertices_m << -0.03, -0.02, -0.03, 0.03, -0.02, -0.03, 0.03, 0.02, -0.03, -0.03, 0.02, -0.03, -0.03, 0, 0.0, 0.03, 0,
      0.0;
  mesh.triangles.resize(8, 3);
  mesh.triangles << 0, 2, 1, 0, 3, 2, 0, 1, 5, 0, 5, 4, 3, 5, 2, 3, 4, 5, 0, 4, 3, 1, 2, 5;
  return mesh;
}

std::vector<Scene> scenes() {
  const auto sphere = [](double r) { return sphere_shape(r); };
  return {{"sphere_pose", sphere, 0.03, Touch::frictionless, false, "neo_hookean"},
          {"sphere_force", sphere, 0.03, Touch::frictionless, true, "neo_hookean"},
          {"sphere_force_linear", sphere, 0.03, Touch::frictionless, true, "linear"},
          {"sphere_sticking_pose", sphere, 0.03, Touch::sticking, false, "neo_hookean"},
          {"sphere_sticking_force", sphere, 0.03, Touch::sticking, true, "linear"},
          {"disc_force", [](double r) { return disc_shape(r); }, 0.02, Touch::frictionless, true, "neo_hookean"},
          {"capsule_force", [](double r) { return capsule_shape(r, 0.03); }, 0.02, Touch::frictionless, true, "neo_hookean"},
          {"edge_pose", [](double r) { return edge_shape(r, 0.04); }, 0.012, Touch::frictionless, false, "neo_hookean"},
          {"mesh_force", [](double) { return mesh_shape(wedge(), 0.006); }, 0.02, Touch::frictionless, true, "neo_hookean"},
          {"sphere_friction_pose", sphere, 0.03, Touch::friction, false, "neo_hookean"},
          {"sphere_friction_force", sphere, 0.03, Touch::friction, true, "linear"},
          {"disc_friction_force", [](double r) { return disc_shape(r); }, 0.02, Touch::friction, true, "neo_hookean"},
          {"platen_bonded_force", [](double) { return plane_shape(); }, 0.02, Touch::bonded, true, "neo_hookean"}};
}

// A block that is clamped at its foot.
struct HeldBlock {
  TetMesh mesh = to_quadratic(distorted(block_mesh(4, 4, 3, {0.1, 0.1, 0.075}), 0.003, 7));
  Boundary boundary;
  HeldBlock() {
    boundary.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
    boundary.forces = body_force(mesh);
  }
};

// A tool a little beside the middle of its top; pressed by force along -z, or moved.
RigidContact tool_on_top(RigidShapePtr shape, Touch law, bool by_force) {
  const bool bonded = law == Touch::bonded;
  RigidContact tool;
  tool.shape = std::move(shape);
  tool.law = law;
  tool.friction_coefficient = 0.15;
  tool.bond_reach_m = 1e-4;
  tool.T_base_tool = tool_pose(Vec3(0.047, 0.052, 0.075), bonded ? Vec3(0, 0, -1) : Vec3(0.05, -0.08, -1));
  if (by_force) tool.free_axes = bonded ? MatrixX(MatrixX::Identity(6, 6)) : along(Vec3(0, 0, -1));
  return tool;
}

// A low block on a rough table: its weight (three columns) and a force spread over its top (three more).
struct LyingBlock {
  TetMesh mesh = to_quadratic(distorted(block_mesh(4, 3, 2, {0.08, 0.06, 0.04}), 0.002, 5));
  Boundary boundary;
  RigidContact table;
  LyingBlock(double table_height_m, double friction_coefficient) {
    const auto top = nodes_where(mesh, [](const Vec3& x) { return x.z() > 0.039; });
    boundary.forces = hstack({body_force(mesh), spread_over_nodes(static_cast<Index>(mesh.nodes_m.rows()), top)});
    table.shape = plane_shape();
    table.law = Touch::friction;
    table.friction_coefficient = friction_coefficient;
    table.T_base_tool = tool_pose(Vec3(0.04, 0.03, table_height_m), Vec3::UnitZ());
  }
};

ContactOptions exact(double tolerance) {
  ContactOptions options;
  options.statics.residual_tolerance = options.friction_tolerance = tolerance;
  return options;
}

// What central differences say of displacements, and of the first tool's wrench and place.
struct Differences {
  VectorX displacement;
  Vec6 wrench;
  Vec3 tip;
  Differences(const ContactEquilibrium& ahead, const ContactEquilibrium& behind, double step)
      : displacement((ahead.displacement_m - behind.displacement_m) / (2 * step)),
        wrench((ahead.touches[0].wrench - behind.touches[0].wrench) / (2 * step)),
        tip((ahead.touches[0].T_base_tool.translation() - behind.touches[0].T_base_tool.translation()) / (2 * step)) {}
};

class ContactSensitivityContract : public testing::TestWithParam<Scene> {};

TEST_P(ContactSensitivityContract, AgreesWithDifferences) {
  const Scene& scene = GetParam();
  const HeldBlock block;
  struct Point {
    double log_young = std::log(20000.0), poisson = 0.35;
    VectorX weight = Vec3(200, 0, -3000);
    Vec6 shift = Vec6::Zero(), wrench = Vec6::Zero();
    double radius = 0;
  } at;
  at.radius = scene.radius;
  at.wrench.head<3>() = Vec3(0.2, 0.1, -1.5);
  const bool bonded = scene.law == Touch::bonded;
  const auto solve = [&](const Point& p, ContactSensitivity* sensitivity) {
    RigidContact tool = tool_on_top(scene.shape(p.radius), scene.law, scene.by_force);
    tool.T_base_tool.translation() += p.shift.head<3>();
    if (p.shift.tail<3>().norm() > 0)
      tool.T_base_tool.linear() =
          Eigen::AngleAxisd(p.shift.tail<3>().norm(), p.shift.tail<3>().normalized()) * tool.T_base_tool.linear();
    ContactOptions options = exact(1e-12);
    if (scene.law == Touch::friction) options.increments = 3;  // slips in each
    const ContactStatics body(block.mesh, scene.material, block.boundary, {tool}, options);
    ContactLoads loads = body.no_loads();
    loads.force_coefficients = p.weight;
    loads.wrench[0] = p.wrench;
    if (!scene.by_force) loads.motion[0](2) = -0.004;
    ContactEquilibrium e = body.solve(std::exp(p.log_young), p.poisson, loads);
    EXPECT_TRUE(e.converged) << e.reason;
    EXPECT_GT(e.touches[0].active_points, 20);
    if (scene.law == Touch::friction) {
      EXPECT_GE(e.touches[0].slipping_points, 5);
      EXPECT_LE(e.touches[0].slipping_points, e.touches[0].active_points - 5) << "some stick, some slide";
    }
    if (sensitivity) *sensitivity = body.sensitivity(e);
    return e;
  };
  ContactSensitivity s;
  const ContactEquilibrium base = solve(at, &s);
  // Absolute parts: what differences of converged states leave over (a shift moves u by about its own length).
  const auto check = [&](const std::string& what, double step, Index column,
                         const std::function<void(Point&, double)>& change) {
    Point up = at, down = at;
    change(up, step);
    change(down, -step);
    const Differences d(solve(up, nullptr), solve(down, nullptr), step);
    EXPECT_LT((d.displacement - s.displacement.col(column)).norm(), 1e-3 * d.displacement.norm() + 1e-6) << what;
    EXPECT_LT((d.wrench - s.wrench[0].col(column)).norm(), 1e-3 * d.wrench.norm() + 1e-4 * base.touches[0].wrench.norm())
        << what;
    EXPECT_LT((d.tip - s.motion[0].col(column).head<3>()).norm(), 1e-3 * d.tip.norm() + 1e-7) << what;
  };
  EXPECT_EQ(s.displacement.cols(), s.radius[0] < 0 ? 17 : 18);  // one region: no columns for it
  check("log E", 1e-6, s.log_young, [](Point& p, double h) { p.log_young += h; });
  check("nu", 1e-6, s.poisson, [](Point& p, double h) { p.poisson += h; });
  check("weight", 1e-2, s.first_force + 2, [](Point& p, double h) { p.weight(2) += h; });
  for (int k = 0; k < 6; ++k) {
    if (bonded) break;  // all six are free
    check("pose " + std::to_string(k), k < 3 ? 1e-9 : 1e-7, s.first_pose[0] + k,
          [k](Point& p, double h) { p.shift(k) += h; });
  }
  if (scene.by_force) check("force", 1e-6, s.first_wrench[0] + 2, [](Point& p, double h) { p.wrench(2) += h; });
  if (s.radius[0] >= 0) check("radius", 1e-9, s.radius[0], [](Point& p, double h) { p.radius += h; });
}

INSTANTIATE_TEST_SUITE_P(Scenes, ContactSensitivityContract, testing::ValuesIn(scenes()),
                         [](const auto& each) { return std::string(each.param.name); });

// Two regions, one four times as stiff, under a rubbing ball: against differences, and all of them together are E.
TEST(ContactRegions, DerivativesToTheirStiffnessAreThoseOfDifferences) {
  const HeldBlock block;
  for (const char* material : {"linear", "neo_hookean"})
    for (const Dilatation dilatation : {Dilatation::pointwise, Dilatation::averaged})
      for (const bool by_force : {true, false}) {
        ContactOptions options = exact(1e-12);
        options.statics.dilatation = dilatation;
        for (Index e = 0; e < block.mesh.tetrahedra.rows(); ++e)
          options.statics.region.push_back(block.mesh.nodes_m.row(block.mesh.tetrahedra(e, 0)).x() < 0.051 ? 0 : 1);
        const RigidContact ball = tool_on_top(sphere_shape(0.03), Touch::friction, by_force);
        ContactStatics body(block.mesh, material, block.boundary, {ball}, options);
        ContactLoads loads = body.no_loads();
        if (by_force) loads.wrench[0].head<3>() = Vec3(0.2, 0.1, -1.5);
        if (!by_force) loads.motion[0].head<3>() = Vec3(0.001, 0, -0.004);
        const auto solve = [&](double log_second, double log_first = 0) {
          body.set_region_stiffness(Eigen::Vector2d(std::exp(log_first), 4 * std::exp(log_second)));
          ContactEquilibrium e = body.solve(2e4, 0.35, loads);
          EXPECT_TRUE(e.converged) << e.reason;
          return e;
        };
        constexpr double h = 1e-6;
        for (int region = 0; region < 2; ++region) {
          const ContactEquilibrium ahead = region == 0 ? solve(0, h) : solve(h), behind = region == 0 ? solve(0, -h) : solve(-h);
          const ContactEquilibrium at = solve(0);
          EXPECT_GT(at.touches[0].slipping_points, 4);
          const ContactSensitivity s = body.sensitivity(at);
          const Differences d(ahead, behind, h);
          const Index column = s.first_stiffness + region;
          EXPECT_LT((d.displacement - s.displacement.col(column)).norm(), 1e-3 * d.displacement.norm()) << material << region;
          EXPECT_LT((d.wrench - s.wrench[0].col(column)).norm(), 1e-3 * d.wrench.norm() + 1e-4 * at.touches[0].wrench.norm());
          const VectorX all = s.displacement.col(s.first_stiffness) + s.displacement.col(s.first_stiffness + 1);
          EXPECT_LT((all - s.displacement.col(s.log_young)).norm(), 1e-6 * d.displacement.norm() + 1e-6 * all.norm());
        }
      }
}

// The same of nu: the first region's is the whole's.
TEST(ContactRegions, DerivativesToTheirPoissonRatiosAreThoseOfDifferences) {
  const HeldBlock block;
  for (const char* material : {"linear", "neo_hookean"})
    for (const Dilatation dilatation : {Dilatation::pointwise, Dilatation::averaged}) {
      ContactOptions options = exact(1e-12);
      options.statics.dilatation = dilatation;
      for (Index e = 0; e < block.mesh.tetrahedra.rows(); ++e)
        options.statics.region.push_back(block.mesh.nodes_m.row(block.mesh.tetrahedra(e, 0)).x() < 0.051 ? 0 : 1);
      options.statics.region_poisson = Eigen::Vector2d(std::nan(""), 0.2);
      ContactStatics body(block.mesh, material, block.boundary, {tool_on_top(sphere_shape(0.03), Touch::friction, false)}, options);
      ContactLoads loads = body.no_loads();
      loads.motion[0].head<3>() = Vec3(0.001, 0, -0.004);
      const auto solve = [&](double first, double second) {
        body.set_region_poisson(Eigen::Vector2d(std::nan(""), 0.2 + second));
        ContactEquilibrium e = body.solve(2e4, 0.35 + first, loads);
        EXPECT_TRUE(e.converged) << e.reason;
        return e;
      };
      constexpr double h = 1e-6;
      for (int region = 0; region < 2; ++region) {
        const ContactEquilibrium ahead = region == 0 ? solve(h, 0) : solve(0, h), behind = region == 0 ? solve(-h, 0) : solve(0, -h);
        const ContactEquilibrium at = solve(0, 0);
        ContactLoadsAlong along = body.no_loads_along(1);
        (region == 0 ? along.poisson(0) : along.region_poisson(1, 0)) = 1;
        const ContactPathSensitivity s = body.sensitivity_along(at, along, body.rest_along(1));
        const Differences d(ahead, behind, h);
        EXPECT_LT((d.displacement - s.displacement.col(0)).norm(), 1e-3 * d.displacement.norm()) << material << region;
        EXPECT_LT((d.wrench - s.wrench[0].col(0)).norm(), 1e-3 * d.wrench.norm() + 1e-4 * at.touches[0].wrench.norm()) << material << region;
      }
    }
}

// A guess saves work and leaves the answer and its derivatives as they are.
TEST(ContactGuess, SavesWorkAndNotDigits) {
  const LyingBlock block(0, 0.4);
  const auto run = [&](ContactStatics& body, double young, const std::vector<ContactEquilibrium>* guesses) {
    std::vector<ContactEquilibrium> steps;
    ContactLoads loads = body.no_loads();
    loads.force_coefficients.resize(6);
    for (const Vec3& force : {Vec3(0, 0, -1), Vec3(0.4, 0.1, -1.5), Vec3(0.7, 0, -2)}) {
      loads.force_coefficients << 0, 0, -9810, force;
      const ContactEquilibrium* from = steps.empty() ? nullptr : &steps.back();
      ContactEquilibrium e = body.solve(young, 0.3, loads, from, {}, guesses ? &(*guesses)[steps.size()] : nullptr);
      EXPECT_TRUE(e.converged) << e.reason;
      steps.push_back(e);
    }
    return steps;
  };
  ContactStatics body(block.mesh, "neo_hookean", block.boundary, {block.table}, exact(1e-10)),
      fresh(block.mesh, "neo_hookean", block.boundary, {block.table}, exact(1e-10));
  const auto before = run(body, 2e4, nullptr), guessed = run(body, 2.02e4, &before), plain = run(fresh, 2.02e4, nullptr);
  for (std::size_t s = 0; s < plain.size(); ++s) {
    EXPECT_LT((guessed[s].displacement_m - plain[s].displacement_m).norm(), 1e-7 * plain[s].displacement_m.norm()) << s;
    EXPECT_LT((guessed[s].touches[0].wrench - plain[s].touches[0].wrench).norm(), 1e-7 * plain[s].touches[0].wrench.norm()) << s;
    EXPECT_EQ(guessed[s].increments, plain[s].increments) << s;
    EXPECT_LE(2 * guessed[s].factorisations, plain[s].factorisations) << s;
  }
  const auto derivative = [&](const std::vector<ContactEquilibrium>& steps, const ContactStatics& of) {
    ContactPathSensitivity d = of.rest_along(2);
    for (const ContactEquilibrium& e : steps) {
      ContactLoadsAlong along = of.no_loads_along(2);
      along.log_young(0) = along.poisson(1) = 1;
      d = of.sensitivity_along(e, along, d);
    }
    return d.displacement;
  };
  const MatrixX a = derivative(guessed, body), b = derivative(plain, fresh);
  EXPECT_LT((a - b).norm(), 1e-6 * b.norm());
}

// A block on a table with friction: its weight, then a push aside and down in two steps, the second one back a little. What it
// does at the end depends on every step before.
TEST(ContactPath, CarriesDerivativesThroughStepsInSequence) {
  const LyingBlock block(0.0005, 0.3);  // pressed in a little, so that all of it touches
  ContactOptions options = exact(1e-12);
  options.increments = 2;
  const ContactStatics body(block.mesh, "neo_hookean", block.boundary, {block.table}, options);
  // Parameters: log E, nu, density, push aside of the first push and of the second, all in sequence.
  const auto run = [&](const VectorX& p, ContactPathSensitivity* d) {
    ContactLoads loads = body.no_loads();
    loads.force_coefficients = VectorX::Zero(6);
    ContactEquilibrium e;
    for (int step = 0; step < 3; ++step) {
      loads.force_coefficients(2) = -9.81 * p(2);
      if (step == 1) loads.force_coefficients.tail<3>() = Vec3(p(3), 0, -2);
      if (step == 2) loads.force_coefficients.tail<3>() = Vec3(p(3) - 0.25, p(4), -2.2);
      const ContactEquilibrium last = e;
      e = body.solve(std::exp(p(0)), p(1), loads, step > 0 ? &last : nullptr);
      EXPECT_TRUE(e.converged) << step << ": " << e.reason;
      if (d == nullptr) continue;
      const Index known = step == 0 ? 3 : step == 1 ? 4 : 5;  // parameters come as the steps need them
      ContactLoadsAlong along = body.no_loads_along(known);
      along.log_young(0) = along.poisson(1) = 1;
      along.force_coefficients(2, 2) = -9.81;
      if (step >= 1) along.force_coefficients(3, 3) = 1;
      if (step == 2) along.force_coefficients(4, 4) = 1;
      *d = body.sensitivity_along(e, along, step == 0 ? body.rest_along(known) : *d);
    }
    return e;
  };
  VectorX at(5);
  at << std::log(20000.0), 0.35, 1100, 0.55, 0.1;
  ContactPathSensitivity d;
  const ContactEquilibrium base = run(at, &d);
  EXPECT_GT(base.touches[0].slipping_points, 20);
  EXPECT_LT(base.touches[0].slipping_points, base.touches[0].active_points - 20);
  RecordProperty("factorisations", base.factorisations);
  ASSERT_EQ(d.displacement.cols(), 5);
  for (Index k = 0; k < 5; ++k) {
    VectorX up = at, down = at;
    const double step = k == 2 ? 1e-3 : 1e-6;
    up(k) += step;
    down(k) -= step;
    const Differences seen(run(up, nullptr), run(down, nullptr), step);
    EXPECT_LT((seen.displacement - d.displacement.col(k)).norm(), 1e-3 * seen.displacement.norm()) << k;
    EXPECT_LT((seen.wrench - d.wrench[0].col(k)).norm(), 1e-3 * seen.wrench.norm() + 1e-6) << k;
  }
}

}  // namespace
}  // namespace palpate::fem::contact_sensitivity_test
