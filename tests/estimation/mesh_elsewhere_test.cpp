// label: unit
// SPDX-License-Identifier: Apache-2.0
// Refining under a tool does not hide what the mesh does elsewhere: in the clamp, where regions meet, in the whole body.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/fit_on_fine_mesh.hpp"
#include "palpate/fem/boundary.hpp"
#include "palpate/fem/discretisation.hpp"
#include "palpate/estimation/mesh_error.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::mesh_elsewhere_test {
namespace {

class MeshElsewhere : public testing::Test {
 protected:
  void SetUp() override {
    recording.tools[0].radius_m = 0.005;
    recording.rest.volume = kuhn_block(4, 3, 2, block_size_m);
    recording.rest.surface = SimulatedSurface::boundary_of(*recording.rest.volume, nullptr).rest();
    truth.sigma_m = 1e-5;
    truth.points = 600;
    truth.finer = 3;
    inputs = clouds_of(truth, recording);
  }
  // As where the mesh's outline is not the object's: then meshes are filled anew, and a refined one is not.
  static Filled anew(const Recording& given, double) { return {fem::refine_uniform(*given.rest.volume), given.supports}; }

  Identification within(double tolerance, Index& tetrahedra) const {
    Recording fitted = recording;
    SimulatedObject object = coarse_block();
    FitOptions options;
    options.cross_checks = options.stresses = false;
    const Identification answer = fit_on_fine_mesh(fitted, object, inputs, options, tolerance, nullptr, {}, anew);
    tetrahedra = object.mesh.tetrahedra.rows();
    return answer;
  }
  double error(const Identification& answer) const { return std::log(answer.parameters[0].value / truth.young_pa); }
  static double stated(const Identification& answer) { return std::stod(answer.provenance.at("mesh's error in E")) / 100; }
  static double in_interval(const Identification& answer) {
    for (const BudgetEntry& entry : answer.budget)
      if (entry.input == "mesh") return entry.young_modulus_percent / 100;
    return 0;
  }

  Recording recording = pushed_block_recording();
  PushedBlock truth;
  Inputs inputs;
};

// The pad is small against the elements, and yet the clamp and the bending make most of the error.
TEST_F(MeshElsewhere, TakesTheMeshThatShowedIt) {
  Index tetrahedra = 0;
  const Identification coarse = within(1, tetrahedra);
  ASSERT_EQ(tetrahedra, 144);
  ASSERT_GT(stated(coarse), 0.01);
  const Identification fine = within(0.01, tetrahedra);
  EXPECT_EQ(tetrahedra, 8 * 144);
  EXPECT_LT(stated(fine), 0.5 * stated(coarse));
  EXPECT_GT(stated(fine), 0.1 * stated(coarse)) << "what a half of the edges leaves, a quarter or so";
  EXPECT_LT(std::abs(error(fine)), 2 * fine.parameters[0].std / fine.parameters[0].value);
  EXPECT_FALSE(says(fine, "mesh_too_coarse"));
}

TEST_F(MeshElsewhere, IsTooCoarseWhereNoFinerMeshIsWithinWhatWasAskedFor) {
  Index tetrahedra = 0;
  const Identification answer = within(1e-5, tetrahedra);
  EXPECT_GT(tetrahedra, 8 * 144) << "finer ones were tried";
  EXPECT_TRUE(says(answer, "mesh_too_coarse"));
  EXPECT_GT(stated(answer), 1e-5);
  EXPECT_LT(std::abs(error(answer)), 0.005) << "the truth's mesh is no finer than that";
}

TEST_F(MeshElsewhere, IsStillTakenOutOnceToolsAreFine) {
  const SimulatedObject object = coarse_block();
  const auto everywhere = finer_model(recording, object), under_tools = finer_under_tools(recording, object);
  ASSERT_TRUE(everywhere && under_tools);
  EXPECT_TRUE(everywhere->everywhere);
  EXPECT_FALSE(under_tools->everywhere);
  std::vector<Identification> answers;
  for (const bool known : {false, true}) {
    FitOptions options;
    options.cross_checks = options.stresses = false;
    auto next = finer_under_tools(under_tools->recording, under_tools->object);
    ASSERT_TRUE(next);
    const FinerMesh mesh{&*under_tools, &*next};
    int asked = 0;
    options.take_finer = [&](const MeshDoubt& found) -> const FinerMesh* {
      if (asked++ > 0) return nullptr;
      const auto there = found.shown_by(*under_tools);
      EXPECT_TRUE(there);
      EXPECT_LT(std::abs(there->log_young), 0.5 * std::abs(found.shift.log_young));
      if (known) next->elsewhere = found.shift.plus(there->times(-1));
      return &mesh;
    };
    answers.push_back(fit(recording, object, inputs, options, {}, &*everywhere));
    EXPECT_EQ(asked, 2);
  }
  EXPECT_LT(std::abs(error(answers[1])), 0.6 * std::abs(error(answers[0])));
  EXPECT_GT(in_interval(answers[1]), 2 * in_interval(answers[0]));
  EXPECT_GT(answers[1].parameters[0].upper_95, truth.young_pa);
  EXPECT_LT(answers[1].parameters[0].lower_95, truth.young_pa);
}

}  // namespace
}  // namespace palpate::estimation::mesh_elsewhere_test
