// label: unit
// SPDX-License-Identifier: Apache-2.0
// Contact knows neither pascal nor metre: stiffness and size scale the answer and change no step of the way to it. Where the
// last digit of a place is felt, the solver stops there and says so.
#include <gtest/gtest.h>

#include "fem_meshes.hpp"
#include "palpate/fem/contact_statics.hpp"

namespace palpate::fem::contact_scale_test {
namespace {

constexpr double kYoung = 20000, kFriction = 0.6;

struct RestingBlock {
  double size_m = 0.1;
  double aside_m = 0.5;     ///< from the origin, where digits are lost
  double uneven_m = 0.0;    ///< of the sole, over its size
  double stiffness = 1000;  ///< of the layer

  ContactStatics body() const {
    TetMesh mesh = block_mesh(3, 3, 3, Vec3::Constant(size_m));
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
      if (mesh.nodes_m(i, 2) == 0) mesh.nodes_m(i, 2) += uneven_m * size_m * std::sin(1.0 + static_cast<double>(i));
    mesh.nodes_m.col(0).array() += aside_m;
    Boundary boundary;
    boundary.forces = spread_over_patch(mesh, Vec3(aside_m + 0.5 * size_m, 0.5 * size_m, size_m), 0.3 * size_m);
    RigidContact table;
    table.shape = plane_shape();
    table.T_base_tool = tool_pose(Vec3::Zero(), Vec3::UnitZ());
    table.law = Touch::friction;
    table.friction_coefficient = kFriction;
    table.seat_m = 1e-3 * size_m;
    table.stiffness = stiffness;
    ContactOptions options;
    options.statics.residual_tolerance = 1e-8;
    return ContactStatics(mesh, "neo_hookean", boundary, {table}, options);
  }
};

ContactEquilibrium press(const ContactStatics& body, double young_pa, const Vec3& force_n) {
  ContactLoads loads = body.no_loads();
  loads.force_coefficients = force_n;
  return body.solve(young_pa, 0.3, loads);
}

// A hundredth of E over a face of the block; part of the sole slides.
Vec3 usual_force(double young_pa, double size_m) { return young_pa * size_m * size_m * Vec3(0.003, -0.001, -0.01); }

TEST(ContactScale, SevenDecadesOfStiffnessTakeTheSameSteps) {
  const RestingBlock block;
  const ContactStatics body = block.body();
  const ContactEquilibrium usual = press(body, kYoung, usual_force(kYoung, block.size_m));
  ASSERT_TRUE(usual.converged) << usual.reason;
  EXPECT_GT(usual.touches[0].slipping_points, 0);
  for (const double young : {1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9}) {
    const ContactEquilibrium e = press(body, young, usual_force(young, block.size_m));
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_EQ(e.newton_steps, usual.newton_steps) << young;
    EXPECT_EQ(e.factorisations, usual.factorisations) << young;
    EXPECT_LT((e.displacement_m - usual.displacement_m).norm(), 1e-9 * usual.displacement_m.norm()) << young;
    EXPECT_LT((e.touches[0].wrench / young - usual.touches[0].wrench / kYoung).norm(),
              1e-9 * usual.touches[0].wrench.norm() / kYoung);
  }
}

TEST(ContactScale, FromAMillimetreToTenMetres) {
  const RestingBlock block;
  const ContactEquilibrium usual = press(block.body(), kYoung, usual_force(kYoung, block.size_m));
  for (const double factor : {0.01, 0.1, 10.0, 100.0}) {
    RestingBlock other = block;
    other.size_m *= factor;
    other.aside_m *= factor;
    const ContactEquilibrium e = press(other.body(), kYoung, usual_force(kYoung, other.size_m));
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_EQ(e.newton_steps, usual.newton_steps) << factor;
    EXPECT_LT((e.displacement_m / factor - usual.displacement_m).norm(), 1e-9 * usual.displacement_m.norm()) << factor;
  }
}

// The same newtons on ever stiffer bodies: small strain is the limit, and the layer's compression sinks towards the last
// digit of the places. No more steps are taken for it, and the floor that is told is what the residual is stopped at.
TEST(ContactScale, StopsAtTheRoundingThatItStates) {
  RestingBlock block;
  block.uneven_m = 5e-4;
  const ContactStatics body = block.body();
  const Vec3 force = usual_force(kYoung, block.size_m);
  const ContactEquilibrium soft = press(body, 1e6, force);
  ASSERT_TRUE(soft.converged) << soft.reason;
  EXPECT_LT(soft.rounding, 1e-8);
  double last = 0;
  for (const double young : {1e7, 1e8, 1e9, 1e10}) {
    const ContactEquilibrium e = press(body, young, force);
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_LE(e.newton_steps, soft.newton_steps + 1) << young;
    EXPECT_LE(e.residual, std::max(1e-8, e.rounding)) << young;
    EXPECT_GT(e.rounding, 5 * last) << young;  // the share of the force that is lost grows as E
    last = e.rounding;
    // Small strain is still 2e-3 away at 1e6 Pa; what rounding takes stays within what is told.
    EXPECT_LT((e.displacement_m * young - soft.displacement_m * 1e6).norm(),
              (3e-3 + 10 * e.rounding) * soft.displacement_m.norm() * 1e6)
        << young;
  }
}

TEST(ContactScale, WithoutLoadThereIsNothingToDo) {
  RestingBlock block;
  block.uneven_m = 2e-3;  // some of the sole lies deeper in the table than its tolerance
  const ContactStatics body = block.body();
  for (const double young : {1e2, 1e5, 1e9}) {
    const ContactEquilibrium e = press(body, young, Vec3::Zero());
    ASSERT_TRUE(e.converged) << e.reason;
    EXPECT_LT(e.displacement_m.lpNorm<Eigen::Infinity>(), 1e-12 * block.size_m);
  }
}

// What cannot be held is an answer with a reason, also when nothing of it could be reached.
TEST(ContactScale, PulledOffARoughTableEndsWithAReason) {
  const RestingBlock block;
  const ContactEquilibrium e = press(block.body(), kYoung, -usual_force(kYoung, block.size_m));
  EXPECT_FALSE(e.converged);
  EXPECT_FALSE(e.reason.empty());
  EXPECT_EQ(e.increments, 0);
}

}  // namespace
}  // namespace palpate::fem::contact_scale_test
