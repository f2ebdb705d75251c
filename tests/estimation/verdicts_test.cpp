// label: unit
// SPDX-License-Identifier: Apache-2.0
// Verdicts on recordings whose truth has what they speak of, and on the nearest ones that do not have it.
#include "palpate/estimation/verdicts.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pushed_block.hpp"

namespace palpate::estimation {
namespace {

PushedBlock clear_view(const std::string& material = "linear") {
  PushedBlock truth;
  truth.material = material;
  truth.points = 600;
  truth.sigma_m = 2e-4;
  return truth;
}

Identification quick_fit(const Recording& recording, const SimulatedObject& object, const Inputs& inputs, bool cross_checks = false) {
  FitOptions options;
  options.cross_checks = cross_checks;
  options.stresses = false;
  return fit(recording, object, inputs, options);
}

std::string message(const Identification& answer, const std::string& code) {
  for (const Verdict& verdict : answer.verdicts)
    if (verdict.code == code) return verdict.message;
  return "";
}

// ---- Units

/// The block with every length written `factor` times as large, and every force `force_factor` times.
Identification miswritten(double factor, double force_factor) {
  Recording recording = pushed_block_recording();
  Inputs inputs = clouds_of(clear_view());
  for (auto& step : inputs) {
    auto& cloud = std::get<PointCloud>(step[0]);
    cloud.points_m *= factor;
    cloud.sigma_m *= factor;
  }
  recording.tools[0].radius_m *= factor;
  for (Step& step : recording.pushes[0].steps) {
    step.loads[0].contact_m *= factor;
    *step.loads[0].force_n *= force_factor;
  }
  return quick_fit(recording, simulated(fem::to_quadratic(kuhn_block(4, 3, 2, factor * block_size_m)), "linear"), inputs);
}

TEST(YoungModulusAtBound, MillimetresTakenForMetresAreSaid) {
  const Identification answer = miswritten(1000, 1);
  EXPECT_NEAR(parameter(answer, "young_modulus").value, 2e4 * 1e-6, 0.1 * 2e4 * 1e-6);
  EXPECT_NE(message(answer, "young_modulus_at_bound").find("millimetres"), std::string::npos);
}

TEST(YoungModulusAtBound, TheEndsOfTheSearchAreSaid) {
  // 2e4 Pa times 1e-8 lies below where the search ends, times 1e9 above.
  const Identification soft = miswritten(1000, 1e-2), stiff = miswritten(1, 1e9);
  EXPECT_TRUE(says(soft, "young_modulus_at_bound")) << parameter(soft, "young_modulus").value;
  EXPECT_TRUE(says(stiff, "young_modulus_at_bound")) << parameter(stiff, "young_modulus").value;
  EXPECT_NE(message(stiff, "young_modulus_at_bound").find("millinewtons"), std::string::npos);
}

TEST(YoungModulusAtBound, IsNotSaidOfGelsAndStones) {
  EXPECT_FALSE(says(miswritten(1, 1), "young_modulus_at_bound"));
  EXPECT_FALSE(says(miswritten(1, 1e-3), "young_modulus_at_bound"));  // 20 Pa
  EXPECT_FALSE(says(miswritten(1, 1e6), "young_modulus_at_bound"));   // 20 GPa
}

}  // namespace
}  // namespace palpate::estimation
