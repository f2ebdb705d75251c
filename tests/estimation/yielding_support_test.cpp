// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block on a stiff plate on a soft mat, all three meshed, is what a support that gives way as a whole is judged by; a bar on
// springs has a closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimation/pressed_bar.hpp"
#include "estimation/pushed_block.hpp"
#include "palpate/core/error.hpp"

namespace palpate::estimation {
namespace {

constexpr double young_pa = 2e4, nu = 0.3;
constexpr double mat_m = 0.001, plate_m = 0.004, mat_young_pa = 375, plate_young_pa = 5e7;

/// Of a thin bonded mat under a stiff plate: it cannot get out of the way sideways.
double mat_compliance_m_per_n() {
  const double oedometric_pa = mat_young_pa * (1 - nu) / ((1 + nu) * (1 - 2 * nu));
  return mat_m / (oedometric_pa * block_size_m.x() * block_size_m.y());
}

/// Pressed from above at three places of its top, seen as a cloud of its top and read as travel.
Recording on_a_mat(double floor_m) {
  Recording recording = glued_block_recording({}, 0, 0);
  recording.supports[0].name = "table";
  recording.supports[0].plane = {Vec3(0, 0, floor_m), Vec3::UnitZ()};
  recording.model.material = "linear";
  recording.model.poisson_fixed = nu;
  recording.tools[0].radius_m = 0.014;
  const Push like = recording.pushes[0];
  recording.pushes.clear();
  for (const Vec3& at_m : {Vec3(0.045, 0.02, 0.03), Vec3(0.015, 0.02, 0.03), Vec3(0.03, 0.025, 0.03)}) {
    Push& push = recording.pushes.emplace_back(like);
    push.name = "push " + std::to_string(recording.pushes.size());
    for (const double newton : {0.0, 0.2, 0.4}) {
      Load load;
      load.tool = "finger";
      load.force_n = Vec3(0, 0, -newton);
      load.contact_m = at_m;
      push.steps.emplace_back().loads = {load};
    }
  }
  return recording;
}

/// What the sensors see of the three layers: the block's top, and how far the tip went.
Inputs seen_on_the_mat(double cloud_sigma_m, double travel_sigma_m) {
  TetMesh mesh = kuhn_block(20, 16, 13, block_size_m);
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {  // two layers of cells are the mat's, one is the plate's
    const double layer = 13 * mesh.nodes_m(i, 2) / block_size_m.z();
    mesh.nodes_m(i, 2) = layer < 2.5 ? -plate_m - mat_m + std::min(layer, 2.0) / 2 * mat_m : (layer - 3) / 10 * block_size_m.z();
  }
  SimulatedObject object = simulated(fem::to_quadratic(mesh), "linear");
  for (Index e = 0; e < object.mesh.tetrahedra.rows(); ++e) {
    const double z_m = fem::element_centre(object.mesh, e).z();
    object.region.push_back(z_m > 0 ? 0 : z_m > -plate_m ? 1 : 2);
  }
  object.region_names = {"block", "plate", "mat"};
  const Recording recording = on_a_mat(-plate_m - mat_m);
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = nu;
  at(first_ratio) = std::log(plate_young_pa / young_pa);
  at(first_ratio + 1) = std::log(mat_young_pa / young_pa);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Inputs inputs;
  const Points& rest_m = model.object().surface.rest().vertices_m;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const StepPrediction seen = model.predict(s, at, false);
    EXPECT_TRUE(seen.converged) << seen.reason;
    PointCloud cloud;
    cloud.sigma_m = VectorX::Constant(1, cloud_sigma_m);
    for (Index v = 0; v < rest_m.rows(); ++v) {
      constexpr double edge_m = 0.003;  // beside an edge the closest point is another face's
      const Vec3 at_m = rest_m.row(v), end_m = block_size_m - at_m;
      if (at_m.z() < block_size_m.z() - 1e-6 || std::min({at_m.x(), at_m.y(), end_m.x(), end_m.y()}) < edge_m) continue;
      cloud.points_m.conservativeResize(cloud.points_m.rows() + 1, 3);
      const Vec3 noise(normal(random), normal(random), normal(random));
      cloud.points_m.bottomRows<1>() = seen.surface_m.row(v) + cloud_sigma_m * noise.transpose();
    }
    ToolTravel travel;
    travel.travel_m = seen.travel_m(0) + travel_sigma_m * normal(random);
    travel.sigma_m = travel_sigma_m;
    inputs.push_back({cloud, travel});
  }
  return inputs;
}

Identification fitted(double stated_m_per_n, double stated_std_m_per_n) {
  static const Inputs inputs = seen_on_the_mat(3e-4, 3e-5);
  Recording recording = on_a_mat(0);
  recording.supports[0].compliance_m_per_n = stated_m_per_n;
  recording.supports[0].compliance_std_m_per_n = stated_std_m_per_n;
  return fit(recording, simulated(fem::to_quadratic(kuhn_block(10, 8, 5, block_size_m)), "linear"), inputs, {});
}

/// @param within  a share of E
void is_right(const Identification& answer, double within) {
  const Parameter& young = parameter(answer, "young_modulus");
  EXPECT_NEAR(young.value, young_pa, within * young_pa);
  EXPECT_LT(young.lower_95, young_pa);
  EXPECT_GT(young.upper_95, young_pa);
  EXPECT_LT(answer.fit.chi2_per_dof, 1.1);
  EXPECT_FALSE(says(answer, "support_gives_way"));
}

TEST(YieldingSupport, IsFoundWhereItIsNotKnown) {
  const double true_m_per_n = mat_compliance_m_per_n();
  const Identification answer = fitted(0, 10 * true_m_per_n);
  is_right(answer, 0.1);  // what lies under the tip and what lies under the object give way alike: three places tell them apart
  const auto found = std::find_if(answer.nuisances.begin(), answer.nuisances.end(),
                                  [](const Nuisance& one) { return one.name == "support_compliance[table]"; });
  ASSERT_NE(found, answer.nuisances.end());
  std::printf("found %.3g +- %.2g m/N (of %.3g), E %.0f +- %.0f Pa\n", found->value, found->std, true_m_per_n, parameter(answer, "young_modulus").value,
              parameter(answer, "young_modulus").std);
  EXPECT_EQ(found->unit, "m/N");
  EXPECT_NEAR(found->value, true_m_per_n, 0.1 * true_m_per_n);  // the mat bulges at its edges, and is softer sideways
}

TEST(YieldingSupport, IsTakenOffWhereItIsKnown) {
  const Identification answer = fitted(mat_compliance_m_per_n(), 0.05 * mat_compliance_m_per_n());
  is_right(answer, 0.03);
  std::printf("known to 5 %%: E %.0f +- %.0f Pa\n", parameter(answer, "young_modulus").value, parameter(answer, "young_modulus").std);
}

TEST(YieldingSupport, IsDoubtedWhereItIsTakenToBeFirm) {
  const Identification answer = fitted(0, 0);
  EXPECT_TRUE(says(answer, "support_gives_way"));
  EXPECT_LT(parameter(answer, "young_modulus").upper_95, 0.9 * young_pa) << "it matters";
  std::printf("taken to be firm: E %.0f Pa, of %.0f\n", parameter(answer, "young_modulus").value, young_pa);
}

TEST(YieldingSupport, OfABarUnderADrivenPlatenHasAClosedForm) {
  constexpr double bar_young_pa = 3e4, compliance_m_per_n = 4e-4;
  Recording recording = pressed_bar(linear_force_n, bar_young_pa, 0.2);
  recording.model.poisson_fixed = 0.2;
  const double bar_m_per_n = 0.01 / linear_force_n(bar_young_pa, 0.2, 0.01);
  for (Step& step : recording.pushes[0].steps)
    std::get<Wrench>(step.observations[0]).force_n = Vec3(0, 0, -*step.loads[0].travel_m / (bar_m_per_n + compliance_m_per_n));
  const SimulatedObject bar = simulated(kuhn_block(2, 1, 2, bar_m), "linear");
  FitOptions options;
  options.cross_checks = false;
  const double firm_pa = parameter(fit(recording, bar, wrenches_of(recording), options), "young_modulus").value;
  EXPECT_NEAR(firm_pa, bar_young_pa * bar_m_per_n / (bar_m_per_n + compliance_m_per_n), 1e-3 * bar_young_pa);
  recording.supports[0].compliance_m_per_n = compliance_m_per_n;
  EXPECT_NEAR(parameter(fit(recording, bar, wrenches_of(recording), options), "young_modulus").value, bar_young_pa, 1e-3 * bar_young_pa);
}

TEST(YieldingSupport, OneOfTwoIsAnErrorThatNamesIt) {
  Recording recording = on_a_mat(0);
  recording.supports.push_back(sliding("wall", Vec3::Zero(), Vec3::UnitX()));
  recording.supports[0].compliance_m_per_n = 1e-4;
  Unknowns unknowns;
  try {
    ForwardModel(recording, coarse_block("linear"), unknowns);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("supports.table"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("the only support"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace palpate::estimation
