// label: oracle
// SPDX-License-Identifier: Apache-2.0
// What both methods of `palpate paper` are told, on recordings of the lab whose truth is known.
#include "cli/paper_methods.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "cli/paper_views.hpp"

namespace palpate::cli::paper_methods_test {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

estimation::FitOptions without_checks() {
  estimation::FitOptions options;
  options.cross_checks = options.stresses = false;
  return options;
}

TEST(PaperMethods, ASlipThatAFitDoesNotFindItIsTold) {
  const lab::PaperScene& scene = lab::paper_scene("cube");
  const lab::PaperFault slip{"slip", "aside and deeper", 0.005, 0.003, 0, 1};
  const lab::PaperTrial trial = lab::make_paper_trial(scene, 3, {}, slip);
  const Prepared given = prepare(observed(trial.recording), {.tetrahedra = 815}, nullptr, {});
  estimation::FitOptions finding = without_checks();
  finding.find_slips = true;
  Found found;
  const MethodAnswer first = by_palpate(given, finding, nullptr, {}, &found);
  ASSERT_THAT(first.verdicts, Contains("contact_slipped"));

  const estimation::FitOptions blind = without_checks();  // that finds none by itself
  const MethodAnswer untold = by_palpate(given, blind, nullptr, {});
  const MethodAnswer told = by_palpate_told_of_slips(given, found.slipped, blind, nullptr, {});
  EXPECT_THAT(untold.verdicts, Not(Contains("contact_slipped")));
  EXPECT_THAT(told.verdicts, Contains("contact_slipped"));
  EXPECT_NEAR(told.young_modulus_pa, first.young_modulus_pa, 1e-3 * first.young_modulus_pa) << "as if it had found it";
  const auto off = [&](const MethodAnswer& answer) { return std::abs(std::log(answer.young_modulus_pa / trial.young_modulus_pa)); };
  EXPECT_LT(off(told), 0.5 * off(untold));
  EXPECT_GT(told.load_cases, untold.load_cases) << "both fits count";

  // What it finds by itself, or what nobody found, it is not told.
  EXPECT_EQ(by_palpate_told_of_slips(given, found.slipped, finding, nullptr, {}).young_modulus_pa, first.young_modulus_pa);
  EXPECT_EQ(by_palpate_told_of_slips(given, given.recording, blind, nullptr, {}).young_modulus_pa, untold.young_modulus_pa);
}

TEST(PaperViews, FourViewsShowHowTheirModelWasMade) {
  lab::PaperScene scene = lab::paper_scene("cube");
  scene.shape = lab::PaperShape::four_views;
  const lab::PaperTrial trial = lab::make_paper_trial(scene, 3);
  ASSERT_EQ(trial.recording.rest.views.size(), 4u);
  EXPECT_FALSE(trial.recording.rest.surface);
  const Prepared given = prepare(observed(trial.recording), choice_of(scene, false), nullptr, {});
  const auto views = views_of_model(trial.recording, given);
  ASSERT_EQ(views.size(), 4u);
  EXPECT_THAT(views[1].what, HasSubstr("4 views"));
  EXPECT_THAT(views[3].what, HasSubstr(std::to_string(given.object.mesh.tetrahedra.rows())));
  EXPECT_NE(views[0].png, views[1].png) << "three more clouds";
  // A cube of 15 cm again, and not only the sides that one view shows.
  const Points& nodes_m = given.object.surface.rest().vertices_m;
  const Vec3 size_m = nodes_m.colwise().maxCoeff() - nodes_m.colwise().minCoeff();
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(size_m(axis), 0.15, 0.005) << axis;
}

}  // namespace
}  // namespace palpate::cli::paper_methods_test
