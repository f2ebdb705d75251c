// label: unit
// SPDX-License-Identifier: Apache-2.0
// A block on a stiff plate on a soft mat, all three meshed, is what a support that gives way as a whole is judged by, solved by
// our own solver and by CalculiX; a bar on springs has a closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimation/pressed_bar.hpp"
#include "estimation/pushed_block.hpp"
#include "fem/calculix.hpp"
#include "palpate/core/error.hpp"

namespace palpate::estimation::yielding_support_test {
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

/// Block, plate and mat in one mesh; of its layers of cells two are the mat's, one is the plate's.
TetMesh three_layers(int along, int across, int upwards) {
  TetMesh mesh = kuhn_block(along, across, upwards, block_size_m);
  for (Index i = 0; i < mesh.nodes_m.rows(); ++i) {
    const double layer = upwards * mesh.nodes_m(i, 2) / block_size_m.z();
    mesh.nodes_m(i, 2) = layer < 2.5 ? -plate_m - mat_m + std::min(layer, 2.0) / 2 * mat_m : (layer - 3) / (upwards - 3) * block_size_m.z();
  }
  return fem::to_quadratic(mesh);
}

/// 0 in the block, 1 in the plate, 2 in the mat.
std::vector<int> layers_of(const TetMesh& mesh) {
  std::vector<int> all;
  for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
    const double z_m = fem::element_centre(mesh, e).z();
    all.push_back(z_m > 0 ? 0 : z_m > -plate_m ? 1 : 2);
  }
  return all;
}

/// Where points of the surface went in a step, and how far the tip did.
struct Moved {
  Points surface_m;
  double travel_m = 0;
};

/// What the sensors see of that: the block's top, with noise, and the travel.
Inputs seen(const Points& rest_m, const std::vector<Moved>& steps) {
  constexpr double cloud_sigma_m = 3e-4, travel_sigma_m = 3e-5;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Inputs inputs;
  for (const Moved& step : steps) {
    PointCloud cloud;
    cloud.sigma_m = VectorX::Constant(1, cloud_sigma_m);
    for (Index v = 0; v < rest_m.rows(); ++v) {
      constexpr double edge_m = 0.003;  // beside an edge the closest point is another face's
      const Vec3 at_m = rest_m.row(v), end_m = block_size_m - at_m;
      if (at_m.z() < block_size_m.z() - 1e-6 || std::min({at_m.x(), at_m.y(), end_m.x(), end_m.y()}) < edge_m) continue;
      cloud.points_m.conservativeResize(cloud.points_m.rows() + 1, 3);
      const Vec3 noise(normal(random), normal(random), normal(random));
      cloud.points_m.bottomRows<1>() = step.surface_m.row(v) + cloud_sigma_m * noise.transpose();
    }
    ToolTravel travel;
    travel.travel_m = step.travel_m + travel_sigma_m * normal(random);
    travel.sigma_m = travel_sigma_m;
    inputs.push_back({cloud, travel});
  }
  return inputs;
}

Inputs seen_on_the_mat() {
  SimulatedObject object = simulated(three_layers(20, 16, 13), "linear");
  object.region = layers_of(object.mesh);
  object.region_names = {"block", "plate", "mat"};
  const Recording recording = on_a_mat(-plate_m - mat_m);
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns);
  VectorX at = unknowns.prior_mean();
  at(log_young) = std::log(young_pa);
  at(poisson) = nu;
  at(first_ratio) = std::log(plate_young_pa / young_pa);
  at(first_ratio + 1) = std::log(mat_young_pa / young_pa);
  std::vector<Moved> steps;
  for (std::size_t s = 0; s < model.step_count(); ++s) {
    const StepPrediction step = model.predict(s, at, false);
    EXPECT_TRUE(step.converged) << step.reason;
    steps.push_back({step.surface_m, step.travel_m(0)});
  }
  return seen(model.object().surface.rest().vertices_m, steps);
}

/// The same of what CalculiX makes of the three layers.
Inputs seen_on_the_mat_by_calculix() {
  const TetMesh mesh = three_layers(16, 12, 9);
  std::vector<fem::CalculixPart> parts = {{{}, plate_young_pa, nu}, {{}, mat_young_pa, nu}};
  const std::vector<int> layer = layers_of(mesh);
  for (std::size_t e = 0; e < layer.size(); ++e)
    if (layer[e] > 0) parts[static_cast<std::size_t>(layer[e]) - 1].elements.push_back(static_cast<Index>(e));
  std::vector<Index> held;
  for (Index n = 0; n < mesh.nodes_m.rows(); ++n)
    if (mesh.nodes_m(n, 2) < 1e-9 - plate_m - mat_m) held.push_back(n);
  const Recording recording = on_a_mat(-plate_m - mat_m);
  std::vector<Moved> steps;
  for (const Push& push : recording.pushes) {
    const VectorX load = -fem::spread_over_patch(mesh, push.steps[0].loads[0].contact_m, recording.tools[0].radius_m).col(2);
    const VectorX moved_m = fem::calculix_displacements(mesh, held, load, false, young_pa, nu, parts);  // by 1 N
    EXPECT_TRUE(moved_m.allFinite()) << "ccx gave no result";
    for (const Step& step : push.steps) {
      const double force_n = step.loads[0].force_n->norm();
      steps.push_back({mesh.nodes_m + force_n * Eigen::Map<const Points>(moved_m.data(), mesh.nodes_m.rows(), 3), force_n * load.dot(moved_m)});
    }
  }
  return seen(mesh.nodes_m, steps);
}

Identification fitted(const Inputs& inputs, double stated_m_per_n, double stated_std_m_per_n) {
  Recording recording = on_a_mat(0);
  recording.supports[0].compliance_m_per_n = stated_m_per_n;
  recording.supports[0].compliance_std_m_per_n = stated_std_m_per_n;
  return fit(recording, simulated(fem::to_quadratic(kuhn_block(10, 8, 5, block_size_m)), "linear"), inputs, {});
}

Identification fitted(double stated_m_per_n, double stated_std_m_per_n) {
  static const Inputs inputs = seen_on_the_mat();
  return fitted(inputs, stated_m_per_n, stated_std_m_per_n);
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

void is_found(const Identification& answer) {
  is_right(answer, 0.1);  // what lies under the tip and what lies under the object give way alike: three places tell them apart
  const double true_m_per_n = mat_compliance_m_per_n();
  const auto found = std::find_if(answer.nuisances.begin(), answer.nuisances.end(),
                                  [](const Nuisance& one) { return one.name == "support_compliance[table]"; });
  ASSERT_NE(found, answer.nuisances.end());
  std::printf("found %.3g +- %.2g m/N (of %.3g), E %.0f +- %.0f Pa\n", found->value, found->std, true_m_per_n, parameter(answer, "young_modulus").value,
              parameter(answer, "young_modulus").std);
  EXPECT_EQ(found->unit, "m/N");
  EXPECT_NEAR(found->value, true_m_per_n, 0.1 * true_m_per_n);  // the mat bulges at its edges, and is softer sideways
}

TEST(YieldingSupport, IsFoundWhereItIsNotKnown) { is_found(fitted(0, 10 * mat_compliance_m_per_n())); }

TEST(YieldingSupport, AsCalculixHasItIsFoundAndTakenOff) {
  if (!fem::calculix_is_there()) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  const double true_m_per_n = mat_compliance_m_per_n();
  const Inputs inputs = seen_on_the_mat_by_calculix();
  is_found(fitted(inputs, 0, 10 * true_m_per_n));
  const Identification known = fitted(inputs, true_m_per_n, 0.05 * true_m_per_n), firm = fitted(inputs, 0, 0);
  is_right(known, 0.03);
  EXPECT_TRUE(says(firm, "support_gives_way"));
  EXPECT_LT(parameter(firm, "young_modulus").upper_95, 0.9 * young_pa) << "it matters";
  std::printf("known to 5 %%: E %.0f +- %.0f Pa; taken to be firm: %.0f Pa\n", parameter(known, "young_modulus").value, parameter(known, "young_modulus").std,
              parameter(firm, "young_modulus").value);
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
}  // namespace palpate::estimation::yielding_support_test
