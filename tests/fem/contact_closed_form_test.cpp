// label: oracle
// SPDX-License-Identifier: Apache-2.0
// Contact against closed forms of the half space. A quarter of a block stands for it: its outer faces follow Boussinesq's
// point force, which differs from the contact's own field by the square of patch over block size. Loads are small: the
// closed forms know no motion of the surface along the tool, which makes a travel of 5 % of the radius 2 % too small.
#include <gtest/gtest.h>

#include "fem_meshes.hpp"
#include "palpate/fem/contact_statics.hpp"
#include "palpate/fem/discretisation.hpp"

namespace palpate::fem::contact_closed_form_test {
namespace {

constexpr double kYoung = 20000, kPoisson = 0.3, kSize = 0.1;
constexpr double kPlaneModulus = kYoung / (1 - kPoisson * kPoisson);

// Displacement of the half space z > 0 under a unit force along z at the origin (Boussinesq; Johnson 1985, eq. 3.18).
Vec3 boussinesq(const Vec3& x) {
  const double g = kYoung / (2 * (1 + kPoisson)), rho = x.norm(), r = std::hypot(x.x(), x.y());
  const double radial = r * (x.z() / (rho * rho * rho) - (1 - 2 * kPoisson) / (rho * (rho + x.z()))) / (4 * M_PI * g);
  const double down = (x.z() * x.z() / (rho * rho * rho) + 2 * (1 - kPoisson) / rho) / (4 * M_PI * g);
  return {r > 0 ? radial * x.x() / r : 0, r > 0 ? radial * x.y() / r : 0, down};
}

// Quarter (x, y > 0) or whole of the half space, z down from the surface at z = 0; tools push along z.
struct HalfSpace {
  TetMesh mesh;
  Boundary boundary;
  HalfSpace(double edge, double radius, double growth = 0.7, bool whole = false) {
    TetMesh block = whole ? block_mesh(6, 6, 3, {2 * kSize, 2 * kSize, kSize}) : block_mesh(3, 3, 3, {kSize, kSize, kSize});
    if (whole) block.nodes_m.leftCols<2>().array() -= kSize;
    const RefinedMesh fine = refine_near(block, Vec3::Zero(), radius, edge, growth, 6000);
    mesh = to_quadratic(fine.mesh);
    std::vector<Eigen::Triplet<double>> far;
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
      const Vec3 x = node_position(mesh, i);
      if (std::max(x.head<2>().cwiseAbs().maxCoeff(), x.z()) > kSize - 1e-9) {
        boundary.constraints.push_back({i, Mat3::Identity(), 3});
        for (int k = 0; k < 3; ++k) far.emplace_back(3 * i + k, 0, boussinesq(x)(k));
        continue;
      }
      Mat3 axes = Mat3::Zero();
      int count = 0;
      for (int k = 0; k < 2; ++k)
        if (!whole && x(k) < 1e-9) axes.col(count++) = Vec3::Unit(k);
      if (count > 0) boundary.constraints.push_back({i, axes, count});
    }
    boundary.motions.resize(3 * mesh.nodes_m.rows(), 1);
    boundary.motions.setFromTriplets(far.begin(), far.end());
  }
  struct Pressed : ContactEquilibrium {
    double layer_travel_m = 0;
  };
  Pressed press(RigidShapePtr shape, double force, Touch law = Touch::frictionless,
                const ContactOptions& options = {}) const {
    RigidContact tool;
    tool.shape = std::move(shape);
    tool.law = law;
    tool.T_base_tool = tool_pose({0, 0, -0.0005}, Vec3::UnitZ());
    tool.free_axes = along(Vec3::UnitZ());
    const ContactStatics body(mesh, "linear", boundary, {tool}, options);
    ContactLoads loads = body.no_loads();
    loads.wrench[0](2) = force / 4;
    loads.motion_coefficients(0) = force;
    Pressed out{body.solve(kYoung, kPoisson, loads)};
    if (out.converged) out.layer_travel_m = body.layer_travel_m(out)(0);
    return out;
  }
};

double travel(const HalfSpace::Pressed& e) { return e.touches[0].T_base_tool.translation().z() - e.layer_travel_m; }

// F = 4/3 E* sqrt(R) d^1.5, a^2 = R d.
TEST(HalfSpaceContact, SphereMeetsHertzAndConverges) {
  const double radius = 1, force = 0.02;
  const double expected = std::cbrt(9 * force * force / (16 * radius * kPlaneModulus * kPlaneModulus));
  const double patch = std::sqrt(radius * expected);
  double last = 1;
  for (double edge : {0.008, 0.004}) {
    const HalfSpace half(edge, 1.2 * patch);
    const HalfSpace::Pressed e = half.press(sphere_shape(radius), force);
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_NEAR(4 * e.touches[0].wrench(2), force, 1e-7 * force);
    const double error = std::abs(travel(e) / expected - 1);
    EXPECT_LT(error, 0.6 * last) << edge;
    last = error;
    // What the layer adds to the travel, by differences of its stiffness.
    ContactOptions softer, stiffer;
    softer.stiffness *= 0.98;
    stiffer.stiffness *= 1.02;
    const auto depth = [](const ContactEquilibrium& of) { return of.touches[0].T_base_tool.translation().z(); };
    const double by_differences = (depth(half.press(sphere_shape(radius), force, Touch::frictionless, softer)) -
                                   depth(half.press(sphere_shape(radius), force, Touch::frictionless, stiffer))) /
                                  std::log(1.02 / 0.98);
    EXPECT_NEAR(e.layer_travel_m, by_differences, 0.01 * by_differences) << edge;
    EXPECT_LT(e.layer_travel_m, 0.8 * e.touches[0].layer_m) << edge;  // Hertz: two thirds on faces of one size
  }
  EXPECT_LT(last, 0.004);
}

// F = 2 a E* d: the pressure is singular at the rim, which the mesh resolves at first order only.
TEST(HalfSpaceContact, FlatPunchConverges) {
  const double radius = 0.01, force = 0.005, expected = force / (2 * radius * kPlaneModulus);
  double last = 1;
  for (double edge : {0.008, 0.004, 0.002}) {
    const HalfSpace half(edge, 1.1 * radius, 1);
    const HalfSpace::Pressed e = half.press(disc_shape(radius), force);
    ASSERT_TRUE(e.converged) << e.reason;
    const double error = std::abs(travel(e) / expected - 1);
    EXPECT_LT(error, 0.75 * last) << edge;
    last = error;
    EXPECT_NEAR(e.layer_travel_m, e.touches[0].layer_m, 0.01 * e.touches[0].layer_m) << edge;  // the patch stays
  }
  EXPECT_LT(last, 0.015);
}

// A punch that does not let the surface slide is stiffer by (1 - nu) ln(3 - 4 nu) / (1 - 2 nu) (Mossakovskii 1954).
TEST(HalfSpaceContact, StickingPunchIsStifferByMossakovskii) {
  const double radius = 0.01, force = 0.005;
  const HalfSpace half(0.004, 1.1 * radius, 1);
  const HalfSpace::Pressed slides = half.press(disc_shape(radius), force),
                           sticks = half.press(disc_shape(radius), force, Touch::sticking);
  ASSERT_TRUE(slides.converged && sticks.converged) << slides.reason << sticks.reason;
  const double expected = (1 - kPoisson) * std::log(3 - 4 * kPoisson) / (1 - 2 * kPoisson);
  EXPECT_NEAR(travel(slides) / travel(sticks), expected, 0.005);
}

// Uniform pressure on a disc: mean depth 16 F (1 - nu^2) / (3 pi^2 a E), a load and no contact.
TEST(HalfSpaceLoad, DiscPressureConverges) {
  const double radius = 0.01, expected = 16 / (3 * M_PI * M_PI * radius * kPlaneModulus);
  double last = 1;
  for (double edge : {0.02, 0.01, 0.005}) {
    HalfSpace half(edge, 1.1 * radius, 1, true);
    half.boundary.forces = spread_over_patch(half.mesh, Vec3::Zero(), radius);
    const Statics body(half.mesh, "linear", half.boundary);
    const Equilibrium e = body.solve(kYoung, kPoisson, Vec3(0, 0, 1), VectorX::Ones(1));
    const double error = std::abs(half.boundary.forces.col(2).dot(e.displacement_m) / expected - 1);
    RecordProperty("error_edge_" + std::to_string(edge), std::to_string(error));
    EXPECT_LT(error, last);
    last = error;
  }
  EXPECT_LT(last, 0.01);
}

// The pressure of a flat rigid punch moves its disc down as one, by F (1 - nu^2) / (2 a E): what a punch does, without a search for contact.
TEST(HalfSpaceLoad, PunchPressureMovesItsDiscAsOne) {
  const double radius = 0.01, expected = 1 / (2 * radius * kPlaneModulus);
  double last = 1;
  for (double edge : {0.01, 0.005, 0.0025}) {
    HalfSpace half(edge, 1.1 * radius, 1, true);
    half.boundary.forces = spread_over_patch(half.mesh, {Vec3::Zero(), radius, Vec3::Zero(), Pressure::punch});
    const Statics body(half.mesh, "linear", half.boundary);
    const Equilibrium e = body.solve(kYoung, kPoisson, Vec3(0, 0, 1), VectorX::Ones(1));
    const double error = std::abs(half.boundary.forces.col(2).dot(e.displacement_m) / expected - 1);
    EXPECT_LT(error, last) << edge;
    last = error;
    double least = 1e300, most = 0;
    for (Index i = 0; i < half.mesh.nodes_m.rows(); ++i) {
      if (half.mesh.nodes_m(i, 2) > 1e-9 || half.mesh.nodes_m.row(i).norm() > 0.8 * radius) continue;
      least = std::min(least, e.displacement_m(3 * i + 2) / expected);
      most = std::max(most, e.displacement_m(3 * i + 2) / expected);
    }
    RecordProperty("error_edge_" + std::to_string(edge), std::to_string(error) + ", " + std::to_string(least) + " to " + std::to_string(most));
    if (edge < 0.003) {
      EXPECT_GT(least, 0.98);
      EXPECT_LT(most, 1.02);
    }
  }
  EXPECT_LT(last, 0.015);
}

// A sphere given as triangles is the sphere.
TEST(HalfSpaceContact, MeshToolIsTheShapeItWasMadeOf) {
  const double radius = 0.03, force = 0.3;
  TriMesh mesh;
  constexpr int rings = 48, sectors = 96;
  mesh.vertices_m.resize((rings - 1) * sectors + 2, 3);
  const auto put = [&](Index i, double polar, double around) {
    mesh.vertices_m.row(i) << radius * std::sin(polar) * std::cos(around), radius * std::sin(polar) * std::sin(around),
        radius * (std::cos(polar) - 1);
  };
  std::vector<std::array<Index, 3>> triangles;
  const auto id = [](int ring, int sector) { return 1 + (ring - 1) * sectors + sector % sectors; };
  put(0, 0, 0);
  for (int r = 1; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) put(id(r, s), M_PI * r / rings, 2 * M_PI * s / sectors);
  const Index bottom = (rings - 1) * sectors + 1;
  put(bottom, M_PI, 0);
  for (int s = 0; s < sectors; ++s) {
    triangles.push_back({0, id(1, s), id(1, s + 1)});
    triangles.push_back({bottom, id(rings - 1, s + 1), id(rings - 1, s)});
    for (int r = 1; r + 1 < rings; ++r) {
      triangles.push_back({id(r, s), id(r + 1, s), id(r + 1, s + 1)});
      triangles.push_back({id(r, s), id(r + 1, s + 1), id(r, s + 1)});
    }
  }
  mesh.triangles.resize(static_cast<Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) mesh.triangles(static_cast<Index>(t), k) = triangles[t][k];
  const HalfSpace half(0.004, 0.007);
  const HalfSpace::Pressed exact = half.press(sphere_shape(radius), force), meshed = half.press(mesh_shape(mesh), force);
  ASSERT_TRUE(exact.converged && meshed.converged) << exact.reason << meshed.reason;
  // The facets' sagitta is R (pi / 48)^2 / 8 = 0.016 mm.
  EXPECT_NEAR(travel(meshed), travel(exact), 2.5e-5);
  EXPECT_NEAR(travel(meshed) / travel(exact), 1, 0.03);
}

}  // namespace
}  // namespace palpate::fem::contact_closed_form_test
