// label: unit
// SPDX-License-Identifier: Apache-2.0
// A linear body's surface in few coordinates: the same surface, and a quadratic form of its vertices says the same of them.
#include "palpate/estimation/surface_quadratic.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/objective.hpp"
#include "pushed_block.hpp"

namespace palpate::estimation::surface_quadratic_test {
namespace {

/// Forces that err in all directions, at contacts that may be elsewhere.
Recording uncertain_push() {
  Recording recording = pushed_block_recording();
  recording.pushes[0].force_tare_std_n = 2e-3;
  for (Step& step : recording.pushes[0].steps) step.loads[0].contact_std_m = 1e-3;
  return recording;
}

struct Scene {
  Recording recording;
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  VectorX here, there;

  explicit Scene(Recording of = uncertain_push()) : recording(std::move(of)) {
    PushedBlock truth;
    truth.material = "linear";
    Inputs inputs = clouds_of(truth, recording);
    for (auto& step : inputs) {
      std::get<PointCloud>(step[0]).pose_std_m = 5e-4;
      std::get<PointCloud>(step[0]).pose_std_rad = 2e-3;
    }
    model = std::make_unique<ForwardModel>(recording, coarse_block("linear"), unknowns);
    objective = std::make_unique<Objective>(*model, inputs, unknowns);
    here = unknowns.prior_mean();
    here(log_young) = std::log(truth.young_pa);
    here(poisson) = 0.3;
    model->predict(1, here);  // what is solved for is there from now on
    there = here;
    for (int k = 0; k < unknowns.size(); ++k) there(k) += k == log_young ? 0.1 : k == poisson ? -0.12 : 0.3 * unknowns[k].prior_std;
  }
};

TEST(SpanPlace, IsWhereTheSurfaceGoes) {
  Scene scene;
  for (const VectorX& at : {scene.here, scene.there}) {
    const StepPrediction all = scene.model->predict(1, at), few = scene.model->predict_in_span(1, at, SurfacePart::place);
    ASSERT_TRUE(few.in_span);
    EXPECT_EQ(few.d_surface.rows(), 0) << "nothing is saved";
    EXPECT_EQ(few.columns, all.columns);
    const double size_m = (all.surface_m - scene.model->object().surface.rest().vertices_m).norm();
    EXPECT_LT((few.surface_m - all.surface_m).norm(), 1e-6 * size_m);
    EXPECT_LT((few.travel_m - all.travel_m).norm(), 1e-9 * all.travel_m.norm());
    EXPECT_LT((few.d_travel - all.d_travel).norm(), 1e-9 * all.d_travel.norm());
    for (std::size_t k = 0; k < all.columns.size(); ++k) {
      SpanPlace slope = *few.in_span;
      slope.at = few.in_span->d_at.col(static_cast<Index>(k));
      const VectorX expected = all.d_surface.col(static_cast<Index>(k));
      EXPECT_LT((slope.moved_m() - expected).norm(), 1e-5 * expected.norm()) << scene.unknowns[all.columns[k]].name;
    }
  }
}

TEST(SpanPlace, SurfaceMayComeLater) {
  Scene scene;
  StepPrediction later = scene.model->predict_in_span(1, scene.there, SurfacePart::coordinates);
  const StepPrediction at_once = scene.model->predict_in_span(1, scene.there, SurfacePart::place);
  ASSERT_TRUE(later.in_span);
  EXPECT_EQ(later.surface_m.rows(), 0) << "nothing is saved";
  EXPECT_EQ(later.columns, at_once.columns);
  EXPECT_EQ(later.travel_m, at_once.travel_m);
  EXPECT_EQ(later.in_span->at, at_once.in_span->at);
  EXPECT_EQ(later.field, at_once.field);
  scene.model->add_surface(1, scene.there, later);
  EXPECT_EQ(later.surface_m, at_once.surface_m);
  EXPECT_EQ(later.material_m, at_once.material_m);
}

TEST(SpanPlace, NoVertexMovesFurtherThanCoordinatesSay) {
  Scene scene;
  const StepPrediction from = scene.model->predict_in_span(1, scene.here, SurfacePart::place);
  for (const double share : {1.0, 0.3, 1e-3}) {
    const StepPrediction to = scene.model->predict_in_span(1, scene.here + share * (scene.there - scene.here), SurfacePart::place);
    const double furthest_m = (to.surface_m - from.surface_m).rowwise().norm().maxCoeff();
    const double at_most_m = to.in_span->at_most_from_m(from.in_span->at);
    EXPECT_GE(at_most_m, furthest_m * (1 - 1e-12));
    EXPECT_LT(at_most_m, 10 * furthest_m) << "of no use";
  }
  EXPECT_EQ(from.in_span->at_most_from_m(from.in_span->at), 0);
}

TEST(SpanPlace, IsNotSaidOfABodyThatAClampTurns) {
  Recording recording = uncertain_push();
  recording.supports[0].pose_std_m = recording.supports[0].pose_std_rad = 1e-3;
  Scene scene(recording);
  const StepPrediction turned = scene.model->predict_in_span(1, scene.there, SurfacePart::place);
  EXPECT_FALSE(turned.in_span);
  EXPECT_EQ(turned.d_surface, scene.model->predict(1, scene.there).d_surface);
}

TEST(SurfaceQuadratic, SaysTheSameOfFieldsAsOfVertices) {
  Scene scene;
  const Loss loss;
  const SurfacePattern pattern(scene.model->object().surface.rest());
  const StepPrediction then = scene.model->predict_in_span(1, scene.here, SurfacePart::derivatives);
  const std::vector<TermRows> rows = scene.objective->rows_of(1, then, scene.here, loss, true);
  SurfaceQuadratic form(pattern, rows[0], loss, then, scene.here);
  const StepPrediction all = scene.model->predict(1, scene.there), few = scene.model->predict_in_span(1, scene.there, SurfacePart::place);
  EXPECT_FALSE(form.shares_span(all));
  ASSERT_TRUE(form.shares_span(few));
  const auto ask = [&](const StepPrediction& now) {
    std::vector<int> places = now.columns;
    places.insert(places.end(), form.own().begin(), form.own().end());
    Evaluation out = Evaluation::nothing(scene.unknowns.size());
    form.add_to(now, scene.there, places, out);
    return out;
  };
  const Evaluation of_vertices = ask(all), of_fields = ask(few);
  EXPECT_GT(of_vertices.robust_cost, 0);
  EXPECT_NEAR(of_fields.robust_cost, of_vertices.robust_cost, 1e-6 * of_vertices.robust_cost);
  EXPECT_LT((of_fields.gradient - of_vertices.gradient).norm(), 1e-5 * of_vertices.gradient.norm());
  for (int k = 0; k < scene.unknowns.size(); ++k) {
    const VectorX expected = of_vertices.curvature.col(k);
    EXPECT_LT((of_fields.curvature.col(k) - expected).norm(), 1e-5 * expected.norm() + 1e-12) << scene.unknowns[k].name;
  }
}

TEST(SurfaceQuadratic, BoundsByCoordinatesHowFarTheSurfaceHasMoved) {
  Scene scene, other;
  const SurfacePattern pattern(scene.model->object().surface.rest());
  const StepPrediction then = scene.model->predict_in_span(1, scene.here, SurfacePart::place);
  const std::vector<TermRows> rows = scene.objective->rows_of(1, scene.model->predict(1, scene.here), scene.here, {}, true);
  const SurfaceQuadratic form(pattern, rows[0], {}, then, scene.here);
  const StepPrediction whole = scene.model->predict_in_span(1, scene.there, SurfacePart::place);
  const StepPrediction few = scene.model->predict_in_span(1, scene.there, SurfacePart::coordinates);
  const double moved_m = form.moved_m(whole, scene.there, scene.unknowns);
  const double at_most_m = form.moved_at_most_m(few, scene.there, scene.unknowns);
  EXPECT_GT(moved_m, 0);
  EXPECT_GE(at_most_m, moved_m * (1 - 1e-12));
  EXPECT_LT(at_most_m, 10 * moved_m);
  EXPECT_EQ(form.moved_at_most_m(then, scene.here, scene.unknowns), 0);
  const StepPrediction elsewhere = other.model->predict_in_span(1, scene.there, SurfacePart::coordinates);
  EXPECT_TRUE(std::isinf(form.moved_at_most_m(elsewhere, scene.there, scene.unknowns)));
}

TEST(SurfaceQuadratic, KnowsFieldsOfAnotherBodyFromItsOwn) {
  Scene scene, other;
  const SurfacePattern pattern(scene.model->object().surface.rest());
  const StepPrediction then = scene.model->predict_in_span(1, scene.here, SurfacePart::derivatives);
  const std::vector<TermRows> rows = scene.objective->rows_of(1, then, scene.here, {}, true);
  const SurfaceQuadratic form(pattern, rows[0], {}, then, scene.here);
  EXPECT_TRUE(form.shares_span(scene.model->predict_in_span(1, scene.there, SurfacePart::place)));
  EXPECT_FALSE(form.shares_span(other.model->predict_in_span(1, scene.there, SurfacePart::place)));
}

}  // namespace
}  // namespace palpate::estimation::surface_quadratic_test
