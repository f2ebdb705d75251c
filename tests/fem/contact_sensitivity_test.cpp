// label: contract
// SPDX-License-Identifier: Apache-2.0
// Exact sensitivities of contact states against central differences, with steps that leave the active set alone, for every
// shape, driven by pose and by force, frictionless, sticking and bonded.
#include <gtest/gtest.h>

#include <functional>

#include "fem_meshes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/fem/contact_statics.hpp"

namespace palpate::fem {
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
          {"platen_bonded_force", [](double) { return plane_shape(); }, 0.02, Touch::bonded, true, "neo_hookean"}};
}

class ContactSensitivityContract : public testing::TestWithParam<Scene> {};

TEST_P(ContactSensitivityContract, AgreesWithDifferences) {
  const Scene& scene = GetParam();
  const TetMesh mesh = to_quadratic(distorted(block_mesh(4, 4, 3, {0.1, 0.1, 0.075}), 0.003, 7));
  Boundary boundary;
  boundary.constraints = clamp(nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; }));
  boundary.forces = body_force(mesh);
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
    RigidContact tool;
    tool.shape = scene.shape(p.radius);
    tool.law = scene.law;
    tool.bond_reach_m = 1e-4;
    tool.T_base_tool = tool_pose(Vec3(0.047, 0.052, 0.075), bonded ? Vec3(0, 0, -1) : Vec3(0.05, -0.08, -1));
    tool.T_base_tool.translation() += p.shift.head<3>();
    if (p.shift.tail<3>().norm() > 0)
      tool.T_base_tool.linear() =
          Eigen::AngleAxisd(p.shift.tail<3>().norm(), p.shift.tail<3>().normalized()) * tool.T_base_tool.linear();
    if (scene.by_force) tool.free_axes = bonded ? MatrixX(MatrixX::Identity(6, 6)) : along(Vec3(0, 0, -1));
    ContactOptions options;
    options.statics.residual_tolerance = 1e-12;
    const ContactStatics body(mesh, scene.material, boundary, {tool}, options);
    ContactLoads loads = body.no_loads();
    loads.force_coefficients = p.weight;
    loads.wrench[0] = p.wrench;
    if (!scene.by_force) loads.motion[0](2) = -0.004;
    ContactEquilibrium e = body.solve(std::exp(p.log_young), p.poisson, loads);
    EXPECT_TRUE(e.converged) << e.reason;
    EXPECT_GT(e.touches[0].active_points, 20);
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
    const ContactEquilibrium a = solve(up, nullptr), b = solve(down, nullptr);
    const VectorX du = (a.displacement_m - b.displacement_m) / (2 * step);
    const Vec6 dw = (a.touches[0].wrench - b.touches[0].wrench) / (2 * step);
    const Vec3 tip = (a.touches[0].T_base_tool.translation() - b.touches[0].T_base_tool.translation()) / (2 * step);
    EXPECT_LT((du - s.displacement.col(column)).norm(), 1e-3 * du.norm() + 1e-6) << what;
    EXPECT_LT((dw - s.wrench[0].col(column)).norm(), 1e-3 * dw.norm() + 1e-4 * base.touches[0].wrench.norm()) << what;
    EXPECT_LT((tip - s.motion[0].col(column).head<3>()).norm(), 1e-3 * tip.norm() + 1e-7) << what;
  };
  EXPECT_EQ(s.displacement.cols(), s.radius[0] < 0 ? 17 : 18);
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

}  // namespace
}  // namespace palpate::fem
