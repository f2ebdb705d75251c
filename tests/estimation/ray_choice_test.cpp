// label: unit
// SPDX-License-Identifier: Apache-2.0
// Rays near an object's outline: they come and go as the object bulges, and the answer must not follow their number.
#include <gtest/gtest.h>

#include <cmath>

#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/optimise.hpp"
#include "palpate/estimation/posterior.hpp"
#include "palpate/geometry/triangle_tree.hpp"
#include "palpate/identify.hpp"
#include "palpate/lab/box_surface.hpp"
#include "palpate/lab/implicit_surface.hpp"
#include "palpate/lab/random.hpp"

namespace palpate::estimation::ray_choice_test {
namespace {

constexpr double sigma_m = 2e-3, young_pa = 2e4, true_nu = 0.3, force_n = 10;

/// Truth and fit are one body of linear tetrahedra: only what rays do is tested.
Recording on_a_table(TriMesh surface) {
  Recording recording;
  recording.rest.surface = std::move(surface);
  recording.model.material = "linear";
  recording.model.element = "tet4";
  Support table;
  table.name = "table";
  table.kind = SupportKind::plane;
  table.select = NodeSelection::plane;
  recording.supports = {table};
  return recording;
}

/// A ball on its foot that a pad presses, as a camera beside it sees it, without and with the load.
struct PressedBall {
  Recording recording;
  Unknowns unknowns;
  std::unique_ptr<ForwardModel> model;
  std::unique_ptr<Objective> objective;
  Loss loss;
  Optimum optimum;

  PressedBall() {
    const Vec3 centre(0, 0, 0.065);
    recording = on_a_table(lab::implicit_surface([centre](const Vec3& p) { return (p - centre).norm() - 0.075; },
                                                 {Vec3(-0.085, -0.085, 0), Vec3(0.085, 0.085, 0.15), 0.008}));
    Tool pad;
    pad.name = "pad";
    pad.shape = ToolShape::disc;
    pad.radius_m = 0.02;
    recording.tools = {pad};
    Push push;
    push.name = "push";
    push.steps.resize(2);
    push.steps[1].time_s = 1;
    Load load;
    load.tool = "pad";
    load.direction = -Vec3::UnitZ();
    load.contact_m = Vec3(0, 0, 0.14);
    load.force_n = force_n * load.direction;
    push.steps[1].loads = {load};
    recording.pushes = {push};
    model = std::make_unique<ForwardModel>(recording, build_simulated_object(recording), unknowns);

    VectorX truth = unknowns.prior_mean();
    truth(log_young) = std::log(young_pa);
    truth(poisson) = true_nu;
    lab::Random random(3, 0);
    Inputs inputs;
    TriMesh surface = model->object().surface.rest();
    for (std::size_t s = 0; s < model->step_count(); ++s) {
      surface.vertices_m = model->predict(s, truth).surface_m;
      inputs.push_back({seen(surface, random)});
    }
    objective = std::make_unique<Objective>(*model, inputs, unknowns);
    VectorX start = unknowns.prior_mean();  // with the cameras' poses
    start(log_young) = truth(log_young) + 0.2;
    start(poisson) = 0.2;
    optimum = optimise_annealed(*objective, start, loss, {}, {});
    loss = optimum.loss;
  }

  /// Noise along the ray, and pixels beside the ball that report it all the same, as a sensor's edges do.
  static RayObservation seen(const TriMesh& surface, lab::Random& random) {
    const geometry::TriangleTree tree(surface);
    const Vec3 eye(0.35, -0.4, 0.3), z = (Vec3(0, 0, 0.065) - eye).normalized(), x = z.cross(Vec3::UnitZ()).normalized(),
                                     y = z.cross(x);
    std::vector<Vec3> directions;
    std::vector<double> ranges;
    for (double v = -0.2; v <= 0.2; v += 0.004) {
      for (double u = -0.2; u <= 0.2; u += 0.004) {
        const Vec3 direction = (z + u * x + v * y).normalized();
        const Vec3 beside = (z + 1.03 * (u * x + v * y)).normalized();
        const auto hit = tree.cast(eye, direction);
        if (!hit) continue;
        directions.push_back(tree.cast(eye, beside) ? direction : beside);
        ranges.push_back(hit->range_m + sigma_m * random.normal());
      }
    }
    RayObservation out;
    out.pose_std_m = 1e-3;
    out.pose_std_rad = 4e-3;
    const Index count = static_cast<Index>(ranges.size());
    out.rays.origins_m = eye.transpose().replicate(count, 1);
    out.rays.directions.resize(count, 3);
    out.rays.range_m.resize(count);
    out.rays.sigma_m = VectorX::Constant(count, sigma_m);
    for (Index i = 0; i < count; ++i) {
      out.rays.directions.row(i) = directions[static_cast<std::size_t>(i)];
      out.rays.range_m(i) = ranges[static_cast<std::size_t>(i)];
    }
    return out;
  }

  Index finite_rows(double nu, const Loss& by) {
    VectorX at = optimum.unknowns;
    at(poisson) = nu;
    objective->evaluate(at, by);
    Index finite = 0;
    for (const auto& step : objective->last_rows())
      for (const TermRows& rows : step) finite += rows.residual.array().isFinite().count();
    return finite;
  }
};

TEST(RayChoice, TheSameRaysCountForEveryPoissonRatio) {
  PressedBall ball;
  ASSERT_EQ(ball.optimum.termination, Termination::converged) << ball.optimum.message;
  ASSERT_EQ(ball.loss.rays.size(), 2u);
  Loss all = ball.loss;
  all.rays.clear();
  const double nu = ball.optimum.unknowns(poisson);
  const auto apart = [&](const Loss& loss) { return std::abs(ball.finite_rows(0.05, loss) - ball.finite_rows(0.48, loss)); };
  EXPECT_GE(apart(all), 5) << "the scene has no outline worth a test";
  EXPECT_EQ(apart(ball.loss), 0) << "a ray that counts came or went";
  // The choice leaves out what grazes, not what faces the camera.
  EXPECT_GT(ball.finite_rows(nu, ball.loss), 0.9 * ball.finite_rows(nu, all));
}

/// Beyond a sharp edge there is no facet that a ray grazes before it misses: rays that count come and go at full weight.
TEST(RayChoice, ARayThatComesToMissASharpEdgeGoesOnAsTheEdge) {
  Recording recording = on_a_table(lab::box_surface({-0.05, -0.05, 0}, {0.05, 0.05, 0.1}, 8));
  Tool pad;
  pad.name = "pad";
  pad.shape = ToolShape::disc;
  pad.radius_m = 0.02;
  recording.tools = {pad};
  Load load;
  load.tool = "pad";
  load.direction = -Vec3::UnitZ();
  load.contact_m = Vec3(0, 0, 0.1);
  load.force_n = force_n * load.direction;
  Push push;
  push.name = "push";
  push.steps.resize(1);
  push.steps[0].loads = {load};
  recording.pushes = {push};
  Unknowns unknowns;
  ForwardModel model(recording, build_simulated_object(recording), unknowns);
  VectorX stiff = unknowns.prior_mean();
  stiff(log_young) = std::log(5 * young_pa);
  stiff(poisson) = true_nu;

  // Rays that end on the top beside its far edge, which sinks as the cube gets softer.
  TriMesh surface = model.object().surface.rest();
  surface.vertices_m = model.predict(0, stiff).surface_m;
  const geometry::TriangleTree tree(surface);
  const Vec3 eye(0.1, -0.5, 0.25);
  std::vector<std::pair<Vec3, double>> seen;
  for (double x = -0.045; x < 0.045; x += 0.005) {
    for (double inside = 1e-4; inside < 2e-2; inside *= 1.1) {
      const Vec3 direction = (Vec3(x, 0.05 - inside, 0.1) - eye).normalized();
      if (const auto hit = tree.cast(eye, direction)) seen.emplace_back(direction, hit->range_m);
    }
  }
  RayObservation observation;
  RayCloud& rays = observation.rays;
  const Index count = static_cast<Index>(seen.size());
  rays.origins_m = eye.transpose().replicate(count, 1);
  rays.directions.resize(count, 3);
  rays.range_m.resize(count);
  rays.sigma_m = VectorX::Constant(count, sigma_m);
  for (Index i = 0; i < count; ++i) {
    rays.directions.row(i) = seen[static_cast<std::size_t>(i)].first;
    rays.range_m(i) = seen[static_cast<std::size_t>(i)].second + 1e-3;
  }
  Objective objective(model, {{observation}}, unknowns);
  Loss loss;
  objective.evaluate(stiff, loss);
  const Loss chosen = objective.with_chosen_rays(loss);

  Index missed = 0, off = 0;
  double steepest = 0;
  double before = objective.evaluate(stiff, chosen).cost;
  for (double softer = 0.002; softer < 0.4; softer += 0.002) {
    VectorX at = stiff;
    at(log_young) -= softer;
    const Evaluation here = objective.evaluate(at, chosen);
    const TermRows& rows = objective.last_rows()[0][0];
    const VectorX residual = rows.residual;
    const MatrixX slopes = rows.jacobian;
    const VectorX facing = rows.facing;
    EXPECT_NEAR(here.cost, before, 0.5) << "a ray that counts jumped at " << softer;
    before = here.cost;
    VectorX beside = at;
    beside(log_young) -= 1e-6;
    objective.evaluate(beside, chosen);
    const TermRows& moved = objective.last_rows()[0][0];
    for (Index i = 0; i < count; ++i) {
      if (!std::isfinite(residual(i)) || facing(i) > 0 || moved.facing(i) > 0) continue;
      ++missed;
      off += std::abs((residual(i) - moved.residual(i)) / 1e-6 - slopes(i, 0)) > 0.01;
      steepest = std::max(steepest, std::abs(slopes(i, 0)));
    }
  }
  EXPECT_GT(steepest, 0.05) << "nothing to compare";
  EXPECT_LT(off, 0.03 * double(missed)) << "of " << missed << ": more than those whose nearest point jumps from edge to edge";
  EXPECT_GT(missed, 100) << "no ray came to miss";
}

/// Counted are rays that meet the box at a right angle nearly, wherever they meet it.
std::pair<Index, double> counted(const SimulatedObject& object, const Recording& recording, double pixel_rad, double margin_rad) {
  Unknowns unknowns;
  ForwardModel model(recording, object, unknowns);
  const VectorX at = unknowns.prior_mean();
  const geometry::TriangleTree tree(model.object().surface.rest());
  const Vec3 eye(0, -0.6, 0.05);
  std::vector<Vec3> directions;
  std::vector<double> ranges;
  for (double v = -0.12; v < 0.12; v += pixel_rad)
    for (double u = -0.12; u < 0.12; u += pixel_rad) {
      const Vec3 direction = Vec3(u, 1, v).normalized();
      if (const auto hit = tree.cast(eye, direction)) directions.push_back(direction), ranges.push_back(hit->range_m);
    }
  RayObservation seen;
  const Index count = static_cast<Index>(ranges.size());
  seen.rays.origins_m = eye.transpose().replicate(count, 1);
  seen.rays.directions.resize(count, 3);
  for (Index i = 0; i < count; ++i) seen.rays.directions.row(i) = directions[static_cast<std::size_t>(i)].transpose();
  seen.rays.range_m = Eigen::Map<const VectorX>(ranges.data(), count);
  seen.rays.sigma_m = VectorX::Constant(count, sigma_m);
  seen.outline_margin_rad = margin_rad;
  Objective objective(model, {{seen}}, unknowns);
  objective.evaluate(at, {});
  const Loss chosen = objective.with_chosen_rays({});
  double nearest = 1;  // to an edge of the front, in the picture
  Index counts = 0;
  for (Index i = 0; i < count; ++i) {
    if ((*chosen.rays[0])[0][static_cast<std::size_t>(i)] != counts_in) continue;
    ++counts;
    const Vec3 ray = seen.rays.directions.row(i) / seen.rays.directions(i, 1);
    nearest = std::min(nearest, 0.05 / 0.55 - std::max(std::abs(ray.x()), std::abs(ray.z())));
  }
  // Those that were not chosen are left in the next evaluation too.
  objective.evaluate(at, chosen);
  EXPECT_EQ(objective.last_rows()[0][0].residual.array().isFinite().count(), counts);
  return {counts, nearest};
}

TEST(RayChoice, LeavesTheRaysBesideTheOutline) {
  Recording recording = on_a_table(lab::box_surface({-0.05, -0.05, 0}, {0.05, 0.05, 0.1}, 6));
  Push push;
  push.name = "untouched";
  push.steps.resize(1);
  recording.pushes = {push};
  const SimulatedObject object = build_simulated_object(recording);
  constexpr double pixel_rad = 0.002, margin_rad = 0.0065;
  const auto [all, at_rim] = counted(object, recording, pixel_rad, 0);
  const auto [some, inside] = counted(object, recording, pixel_rad, margin_rad);
  EXPECT_LT(at_rim, pixel_rad);
  EXPECT_GE(inside, margin_rad);
  EXPECT_LT(inside, margin_rad + pixel_rad);
  EXPECT_NEAR(double(some) / double(all), std::pow(1 - margin_rad / (0.05 / 0.55), 2), 0.02);
  // What is hardly wider than twice the margin has nothing else to say.
  const auto [few, here] = counted(object, recording, 0.01, 0.03);
  EXPECT_EQ(few, counted(object, recording, 0.01, 0).first);
  EXPECT_LT(here, 0.01);
}

TEST(RayChoice, IsMadeFromOneCast) {
  PressedBall ball;
  ASSERT_EQ(ball.optimum.termination, Termination::converged) << ball.optimum.message;
  const VectorX at = ball.optimum.unknowns;
  Loss none = ball.loss;
  none.rays.clear();
  ball.objective->evaluate(at, none);
  const Loss expected = ball.objective->with_chosen_rays(none);
  const double cost = ball.objective->evaluate(at, expected).cost;

  ball.objective->set_reuse(0.3);
  const int before = ball.objective->steps_evaluated();
  const Loss chosen = ball.objective->choose_rays(at, none);
  ASSERT_EQ(chosen.rays.size(), expected.rays.size());
  for (std::size_t s = 0; s < chosen.rays.size(); ++s) EXPECT_EQ(*chosen.rays[s], *expected.rays[s]) << s;
  EXPECT_EQ(ball.objective->steps_evaluated(), before + 2);
  EXPECT_NEAR(ball.objective->evaluate(at, chosen).cost, cost, 1e-9 * cost);
  EXPECT_EQ(ball.objective->steps_evaluated(), before + 2) << "cast twice at one place";
  VectorX moved = at;
  moved(log_young) += 1;
  ball.objective->evaluate(moved, chosen);
  EXPECT_EQ(ball.objective->steps_evaluated(), before + 3) << "the pressed step: the other one has no load";
}

TEST(RayChoice, TheSearchOverThePoissonRatioAgreesWithTheFit) {
  PressedBall ball;
  ASSERT_EQ(ball.optimum.termination, Termination::converged) << ball.optimum.message;
  const Posterior posterior =
      explore_posterior(*ball.objective, ball.optimum, ball.loss, tukey_information_factor(ball.loss.tukey), {});
  ASSERT_TRUE(posterior.quadrature) << "sharper than what is searched";
  const double std_nu = posterior.poisson_std();
  EXPECT_NEAR(posterior.poisson_quantile(0.5), ball.optimum.unknowns(poisson), 0.3 * std_nu);
  EXPECT_NEAR(posterior.log_young_quantile(0.5), ball.optimum.unknowns(log_young), 0.3 * posterior.log_young_std_total());
}

}  // namespace
}  // namespace palpate::estimation::ray_choice_test
