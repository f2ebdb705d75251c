// label: oracle
// SPDX-License-Identifier: Apache-2.0
// What a planned push promises against what it delivers: the push is made on a finer mesh, with errors of every sensor, and
// fitted.
#include "palpate/estimation/next_push.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "palpate/core/error.hpp"
#include "planned_scene.hpp"

namespace palpate::estimation::next_push_test {
namespace {

Knowledge untouched() { return before_touch(block_on_table(), true_young_pa); }

PushRanking ranked(const std::vector<PushCandidate>& candidates, const Knowledge& knowledge, PushGoal goal) {
  const SimulatedObject object = block_object(1);
  RankOptions options;
  options.goal = goal;
  return rank_pushes(block_on_table(), object, "pad", candidates, block_sensors(object.surface.rest()), knowledge, options);
}

std::vector<double> ranks(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> rank(values.size());
  for (std::size_t i = 0; i < order.size(); ++i) rank[order[i]] = static_cast<double>(i);
  return rank;
}

/// Spearman's.
double rank_correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto ra = ranks(a), rb = ranks(b);
  const double n = static_cast<double>(a.size()), mean = 0.5 * (n - 1);
  double ab = 0, aa = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (ra[i] - mean) * (rb[i] - mean);
    aa += (ra[i] - mean) * (ra[i] - mean);
  }
  return ab / aa;
}

TEST(NextPush, PromisesWhatAFitOfTheRealPushDelivers) {
  const auto candidates = block_candidates(6, 1);
  ASSERT_GE(candidates.size(), 6u);
  const PushRanking ranking = ranked(candidates, untouched(), PushGoal::young_modulus);
  const SensorPlan sensors = block_sensors(block_object(1).surface.rest());
  std::vector<double> promised_e, delivered_e, promised_nu, delivered_nu;
  for (const RatedPush& push : ranking.pushes) {
    if (push.steps == 2) continue;  // two forces a place are enough to fit
    MadePushes made(static_cast<unsigned>(promised_e.size() + 1));
    made.make(push, sensors);
    const Identification answer = made.fitted();
    ASSERT_EQ(answer.termination, Termination::converged) << answer.message;
    const double young_std = std::sqrt(answer.covariance(0, 0)), poisson_std = std::sqrt(answer.covariance(1, 1));
    promised_e.push_back(push.expected.log_young_std);
    delivered_e.push_back(young_std);
    promised_nu.push_back(push.expected.poisson_std);
    delivered_nu.push_back(poisson_std);
    std::printf(
        "at (%.3f %.3f %.3f) along (%+.2f %+.2f %+.2f) %.2f N %.1f mm: log E %.4f promised, %.4f delivered; nu %.4f, %.4f\n",
        push.candidate.contact_m.x(), push.candidate.contact_m.y(), push.candidate.contact_m.z(),
        push.candidate.direction.x(), push.candidate.direction.y(), push.candidate.direction.z(), push.force_n,
        1e3 * push.travel_m, push.expected.log_young_std, young_std, push.expected.poisson_std, poisson_std);
    EXPECT_LT(std::abs(std::log(push.expected.log_young_std / young_std)), std::log(1.5));
    EXPECT_LT(std::abs(std::log(push.expected.poisson_std / poisson_std)), std::log(1.5));
  }
  ASSERT_GE(promised_e.size(), 10u);
  EXPECT_GT(rank_correlation(promised_e, delivered_e), 0.8);
  EXPECT_GT(rank_correlation(promised_nu, delivered_nu), 0.8);
}

TEST(NextPush, SecondPushDeliversWhatWasPromisedAfterTheFirst) {
  const auto candidates = block_candidates(6, 1);
  const SensorPlan sensors = block_sensors(block_object(1).surface.rest());
  const PushRanking first = ranked(candidates, untouched(), PushGoal::both);
  MadePushes made(3);
  made.make(first.pushes.back(), sensors);  // the worst leaves something to do
  const Identification before = made.fitted();
  const Knowledge known = after_fit(made.recording(), before);
  const PushRanking second = ranked(candidates, known, PushGoal::both);
  EXPECT_NEAR(second.so_far.log_young_std, std::sqrt(before.covariance(0, 0)), 1e-6);
  EXPECT_NEAR(second.so_far.poisson_std, std::sqrt(before.covariance(1, 1)), 1e-6);
  made.make(second.pushes.front(), sensors);
  const Identification after = made.fitted();
  const ExpectedSpread& promised = second.pushes.front().expected;
  std::printf("before %.4f %.4f, promised %.4f %.4f, delivered %.4f %.4f\n", second.so_far.log_young_std,
              second.so_far.poisson_std, promised.log_young_std, promised.poisson_std, std::sqrt(after.covariance(0, 0)),
              std::sqrt(after.covariance(1, 1)));
  EXPECT_LT(promised.log_young_std, second.so_far.log_young_std);
  EXPECT_LT(std::abs(std::log(promised.log_young_std / std::sqrt(after.covariance(0, 0)))), std::log(1.5));
  EXPECT_LT(std::abs(std::log(promised.poisson_std / std::sqrt(after.covariance(1, 1)))), std::log(1.5));
}

TEST(NextPush, HarderPushesPromiseMoreAndNothingLiesOutsideTheLimits) {
  const auto candidates = block_candidates(8, 2);
  const PushRanking ranking = ranked(candidates, untouched(), PushGoal::both);
  const PushLimits limits;
  std::map<std::pair<double, double>, std::vector<const RatedPush*>> at;
  for (const RatedPush& push : ranking.pushes) {
    EXPECT_LE(push.force_n, limits.force_n);
    EXPECT_LE(push.travel_m, limits.travel_m);
    EXPECT_LE(push.travel_m, limits.thickness_share * push.candidate.thickness_m * 1.02);
    EXPECT_LE(push.force_n, 1.0001 * limits.pressure_over_young * true_young_pa * EIGEN_PI * 0.012 * 0.012);
    EXPECT_GE(push.seen_share, 0.2);
    at[{push.candidate.contact_m.x() + 7 * push.candidate.contact_m.y() + 49 * push.candidate.contact_m.z(),
        push.candidate.direction.x() + 3 * push.candidate.direction.y()}]
        .push_back(&push);
  }
  for (auto& [place, pushes] : at) {
    ASSERT_EQ(pushes.size(), 3u);
    std::sort(pushes.begin(), pushes.end(), [](const auto* a, const auto* b) { return a->force_n < b->force_n; });
    for (std::size_t i = 1; i < pushes.size(); ++i) {
      EXPECT_LT(pushes[i]->expected.log_young_std, pushes[i - 1]->expected.log_young_std);
      EXPECT_LE(pushes[i]->expected.poisson_std, pushes[i - 1]->expected.poisson_std * (1 + 1e-9));
    }
  }
}

TEST(NextPush, LimitsOfTheRobotBind) {
  const SimulatedObject object = block_object(1);
  RankOptions options;
  options.limits.force_n = 0.3;
  const auto candidates = block_candidates(3, 0);
  const SensorPlan sensors = block_sensors(object.surface.rest());
  const PushRanking weak = rank_pushes(block_on_table(), object, "pad", candidates, sensors, untouched(), options);
  for (const RatedPush& push : weak.pushes) EXPECT_LE(push.force_n, 0.3 * (1 + 1e-12));
  options.limits = {};
  options.limits.travel_m = 0.001;
  const PushRanking shallow = rank_pushes(block_on_table(), object, "pad", candidates, sensors, untouched(), options);
  for (const RatedPush& push : shallow.pushes) EXPECT_LE(push.travel_m, 0.00101);
}

TEST(NextPush, WhatTheToolGivesWayIsTravelOfTheEncoderNotOfTheObject) {
  const SimulatedObject object = block_object(1);
  const auto candidates = block_candidates(3, 0);
  const SensorPlan sensors = block_sensors(object.surface.rest());
  Recording yielding = block_on_table();
  yielding.tools[0].compliance_m_per_n = 0.002;
  const auto hardest_of = [&](const Recording& scene, double travel_limit_m) {
    RankOptions options;
    options.limits.travel_m = travel_limit_m;
    const PushRanking ranking = rank_pushes(scene, object, "pad", candidates, sensors, untouched(), options);
    std::vector<RatedPush> hardest(candidates.size());
    for (std::size_t c = 0; c < candidates.size(); ++c)
      for (const RatedPush& push : ranking.pushes)
        if (push.candidate.contact_m == candidates[c].contact_m && push.steps > hardest[c].steps) hardest[c] = push;
    return hardest;
  };
  // Where the object is what bounds the push the force stays, and the encoder goes farther.
  const auto rigid = hardest_of(block_on_table(), 0.1), soft = hardest_of(yielding, 0.1), bound = hardest_of(yielding, 0.002);
  int seen = 0;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    if (rigid[c].steps == 0) continue;
    ++seen;
    EXPECT_NEAR(soft[c].force_n, rigid[c].force_n, 1e-9 * rigid[c].force_n);
    EXPECT_NEAR(soft[c].travel_m, rigid[c].travel_m + 0.002 * rigid[c].force_n, 1e-9);
    EXPECT_NEAR(bound[c].travel_m, 0.002, 2e-5);
    EXPECT_NEAR(bound[c].force_n, 0.002 / (rigid[c].travel_m / rigid[c].force_n + 0.002), 0.01 * bound[c].force_n);
  }
  EXPECT_GT(seen, 0);
}

TEST(NextPush, NothingIsSuggestedThroughTheTableOrWhereTheCameraSeesNothing) {
  std::map<std::string, int> refused;
  for (const auto& candidate : block_candidates(20, 4, &refused)) {
    EXPECT_LT(candidate.direction.z(), 0.35) << "from below";
    EXPECT_GT(candidate.contact_m.z(), 0.006);
    EXPECT_GT(candidate.thickness_m, 0.012);
    // The hand, 0.3 m behind the tip, stays above the table.
    EXPECT_GT((candidate.contact_m - 0.3 * candidate.direction).z(), 0.0);
  }
  EXPECT_GT(refused["held"] + refused["behind a plane"], 0) << "the bottom is part of the surface";
  EXPECT_GT(refused["uneven"], 0) << "so are the edges";
  // The camera stands at -x, -y: the faces at +x and +y are hidden from it.
  std::vector<PushCandidate> hidden(2);
  hidden[0].contact_m = Vec3(0.08, 0.04, 0.04);
  hidden[0].direction = -Vec3::UnitX();
  hidden[1].contact_m = Vec3(0.04, 0.08, 0.04);
  hidden[1].direction = -Vec3::UnitY();
  const PushRanking ranking = ranked(hidden, untouched(), PushGoal::both);
  EXPECT_TRUE(ranking.pushes.empty());
  EXPECT_EQ(ranking.out_of_view, 2);
}

TEST(NextPush, ASecondViewIsChosenWhereItSeesMore) {
  const SimulatedObject object = block_object(1);
  SensorPlan sensors = block_sensors(object.surface.rest());
  sensors.views.push_back({"behind", look(object.surface.rest(), Vec3(0.33, 0.43, 0.4))});
  std::vector<PushCandidate> hidden(1);
  hidden[0].contact_m = Vec3(0.08, 0.04, 0.04);
  hidden[0].direction = -Vec3::UnitX();
  hidden[0].thickness_m = 0.08;
  const PushRanking ranking = rank_pushes(block_on_table(), object, "pad", hidden, sensors, untouched(), {});
  ASSERT_FALSE(ranking.pushes.empty());
  for (const RatedPush& push : ranking.pushes) EXPECT_EQ(push.view, 1);
}

TEST(NextPush, ASequenceNeverGetsWorseAndForceScaleIsNotAveragedOut) {
  const PushRanking ranking = ranked(block_candidates(6, 1), untouched(), PushGoal::both);
  const auto order = plan_sequence(ranking, 30);
  ASSERT_EQ(order.size(), 30u);
  EXPECT_EQ(order[0], 0u);
  std::vector<const RatedPush*> made;
  double last = 1e300;
  ExpectedSpread after;
  for (const std::size_t i : order) {
    made.push_back(&ranking.pushes[i]);
    after = expected_after(ranking.knowledge, made);
    EXPECT_LE(after.score(PushGoal::both), last);
    last = after.score(PushGoal::both);
  }
  EXPECT_GT(after.log_young_std, 0.01);  // force_scale_std
  EXPECT_LT(after.log_young_std, 0.02);
}

// What a pad's radius, the same in every push, does to E is no noise: no number of pushes goes below what one of exact sensors leaves.
TEST(NextPush, WhatAllPushesShareIsNotAveragedOut) {
  const SimulatedObject object = block_object(1);
  const auto candidates = block_candidates(1, 0);
  SensorPlan sensors = block_sensors(object.surface.rest());
  sensors.views.clear();  // dents that are seen would tell the radius
  const auto after = [&](double radius_std_m, int pushes) {
    Recording scene = block_on_table();
    scene.tools[0].radius_std_m = radius_std_m;
    const PushRanking ranking = rank_pushes(scene, object, "pad", candidates, sensors, before_touch(scene, true_young_pa), {});
    EXPECT_EQ(ranking.knowledge.shared, radius_std_m > 0 ? 1 : 0);
    return expected_after(ranking.knowledge, std::vector<const RatedPush*>(static_cast<std::size_t>(pushes), &ranking.pushes.front())).log_young_std;
  };
  const auto of_radius = [&](int pushes) { return std::sqrt(std::pow(after(1e-3, pushes), 2) - std::pow(after(0, pushes), 2)); };
  EXPECT_GT(of_radius(1), 0.005);
  EXPECT_GT(of_radius(20), 0.7 * of_radius(1));
}

TEST(NextPush, WithTheRatioOfTwoHalvesKnownAPushSaysWhatItSaysOfOneMaterial) {
  Recording scene = block_on_table();
  Region left, right;
  left.name = "left", left.select = RegionSelection::box;
  left.box_min_m = Vec3(-1, -1, -1), left.box_max_m = Vec3(0.04, 1, 1);
  right.name = "right";
  scene.regions = {left, right};
  const SimulatedObject whole = block_object(1);
  SimulatedObject halves = whole;
  in_regions(halves, scene.regions);
  const auto candidates = block_candidates(6, 1);
  const SensorPlan sensors = block_sensors(whole.surface.rest());
  const Knowledge nothing = before_touch(scene, true_young_pa);
  ASSERT_EQ(nothing.regions.size(), 2u);
  const PushRanking apart = rank_pushes(scene, halves, "pad", candidates, sensors, nothing, {});
  const PushRanking alike = ranked(candidates, untouched(), PushGoal::both);
  ASSERT_EQ(apart.pushes.size(), alike.pushes.size());
  int pressed[2] = {0, 0};
  for (const RatedPush& push : apart.pushes) {
    ++pressed[push.region];
    EXPECT_EQ(push.region, push.candidate.contact_m.x() > 0.04 ? 1 : 0);
    // The half that is pressed is known better, the other hardly.
    EXPECT_LT(push.expected.region_log_young_std(push.region), push.expected.region_log_young_std(1 - push.region));
    const auto same = std::find_if(alike.pushes.begin(), alike.pushes.end(), [&](const RatedPush& other) {
      return other.candidate.contact_m == push.candidate.contact_m && other.candidate.direction == push.candidate.direction && other.steps == push.steps;
    });
    ASSERT_NE(same, alike.pushes.end());
    EXPECT_NEAR(push.force_n, same->force_n, 1e-6 * same->force_n);
    const std::vector<Index> known{0, 1, 3};
    const MatrixX information = push.information(known, known);
    EXPECT_LT((information - same->information).norm(), 1e-4 * same->information.norm());
  }
  EXPECT_GT(pressed[0], 0);
  EXPECT_GT(pressed[1], 0);

  // An answer that tells the parts apart otherwise cannot be built on, one that tells none apart can.
  Knowledge other = nothing;
  other.regions = {"top", "bottom"};
  EXPECT_THROW(rank_pushes(scene, halves, "pad", candidates, sensors, other, {}), Error);
  const PushRanking as_one = rank_pushes(scene, halves, "pad", candidates, sensors, untouched(), {});
  EXPECT_NEAR(as_one.pushes.front().expected.volume, alike.pushes.front().expected.volume, 1e-9 * alike.pushes.front().expected.volume);
}

TEST(NextPush, WhatIsKnownOfRegionsComesBackOutOfAnAnswer) {
  Recording scene = block_on_table();
  Identification answer;
  for (const char* region : {"head", "", "belly"}) {
    Parameter one{*region != 0 ? "young_modulus" : "poisson_ratio", region, ""};
    one.value = *region == 0 ? 0.3 : *region == 'h' ? 3e4 : 2e4;
    answer.parameters.push_back(one);
  }
  answer.covariance.resize(3, 3);
  answer.covariance << 0.04, -0.001, 0.01, -0.001, 0.0025, -0.002, 0.01, -0.002, 0.09;
  const Knowledge known = after_fit(scene, answer);
  EXPECT_EQ(known.regions, (std::vector<std::string>{"head", "belly"}));
  EXPECT_NEAR(known.young_modulus_of(1), 2e4, 1e-6);
  const ExpectedSpread spread = expected_after(known, {});
  EXPECT_NEAR(spread.region_log_young_std(0), 0.2, 1e-9);
  EXPECT_NEAR(spread.region_log_young_std(1), 0.3, 1e-9);
  EXPECT_NEAR(spread.log_young_std, 0.3, 1e-9);
  EXPECT_NEAR(spread.poisson_std, 0.05, 1e-9);
  EXPECT_NEAR(spread.volume, std::sqrt(answer.covariance.determinant()), 1e-9);
  // The force's scale is one for both: a push that tells of it alone narrows both, to what is left.
  RatedPush weighed;
  weighed.information = MatrixX::Zero(4, 4);
  weighed.information(3, 3) = 1e12;
  const ExpectedSpread scaled = expected_after(known, {&weighed});
  EXPECT_NEAR(std::pow(scaled.region_log_young_std(0), 2), 0.04 - 1e-4, 1e-7);
  EXPECT_NEAR(std::pow(scaled.region_log_young_std(1), 2), 0.09 - 1e-4, 1e-7);
}

/// An answer with this covariance of (log E of every region, nu).
Identification answer_of(const MatrixX& covariance) {
  Identification answer;
  const Index regions = covariance.rows() - 1;
  for (Index r = 0; r <= regions; ++r) {
    Parameter one{r < regions ? "young_modulus" : "poisson_ratio", r < regions && regions > 1 ? "part " + std::to_string(r) : "", ""};
    one.value = r < regions ? 2e4 : 0.3;
    answer.parameters.push_back(one);
  }
  answer.covariance = covariance;
  return answer;
}

BudgetEntry share_of(const VectorX& shift) {
  const Index regions = shift.size() - 1;
  BudgetEntry entry{"unseen side", 100 * std::abs(shift(0)), std::abs(shift(regions))};
  for (Index r = 0; regions > 1 && r < regions; ++r) entry.regions.push_back({"part " + std::to_string(r), 100 * std::abs(shift(r))});
  return entry;
}

/// That tells a combination of (log E of the first, nu, log ratios, force scale) almost exactly.
RatedPush push_that_tells(const VectorX& combination) {
  RatedPush push;
  push.information = 1e10 * combination * combination.transpose();
  return push;
}

// E within 1.3 %, 1 % of which is the force's scale, and an unseen side that moves E by 3 % and nu by 0.02 one way or the other.
TEST(NextPush, AnErrorOfEAndNuThatNoPushTakesAwayLeavesWhatIsKnown) {
  for (const double sign : {1.0, -1.0}) {
    const Vec2 shift(0.03, sign * 0.02);
    const MatrixX fitted = Vec2(0.013 * 0.013, 0.012 * 0.012).asDiagonal();
    Identification answer = answer_of(fitted + shift * shift.transpose());
    answer.budget = {share_of(shift)};
    const Knowledge known = after_fit(block_on_table(), answer);
    EXPECT_EQ(known.information.llt().info(), Eigen::Success);
    const ExpectedSpread so_far = expected_after(known, {});
    EXPECT_NEAR(so_far.log_young_std, std::sqrt(answer.covariance(0, 0)), 1e-9);
    EXPECT_NEAR(so_far.poisson_std, std::sqrt(answer.covariance(1, 1)), 1e-9);
    EXPECT_NEAR(so_far.volume, std::sqrt(answer.covariance.determinant()), 1e-9);
    // What E is but for the force's scale says nothing of nu, and leaves the scale and the unseen side.
    const RatedPush stiff = push_that_tells(Vec3(1, 0, -1));
    const ExpectedSpread after = expected_after(known, {&stiff});
    EXPECT_NEAR(after.log_young_std, std::hypot(0.01, 0.03), 5e-4);
    EXPECT_NEAR(after.poisson_std, so_far.poisson_std, 1e-4);
    const RatedPush wide = push_that_tells(Vec3(0, 1, 0));
    EXPECT_NEAR(expected_after(known, {&wide}).poisson_std, 0.02, 5e-4);
  }
}

// Whatever a fit finds, and whatever part of it no push takes away: what is known is a distribution, with the answer's intervals.
TEST(NextPush, WhatIsKnownIsADistributionWhateverTheBudget) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  for (int trial = 0; trial < 600; ++trial) {
    const Index regions = 1 + trial % 4;
    VectorX scale_of = VectorX::Ones(regions + 1);
    scale_of(regions) = 0;
    MatrixX root(regions + 1, regions + 1);
    for (Index i = 0; i < root.size(); ++i) root(i) = 0.02 * normal(random) * std::pow(10, -uniform(random));
    MatrixX covariance = root * root.transpose() + 1e-4 * scale_of * scale_of.transpose();
    std::vector<BudgetEntry> budget;
    for (const char* source : {"mesh", "unseen side", "foot"}) {
      VectorX shift(regions + 1);
      for (Index i = 0; i <= regions; ++i) shift(i) = 0.1 * uniform(random) * normal(random);
      covariance += shift * shift.transpose();
      budget.push_back(share_of(shift));
      budget.back().input = source;
    }
    // Rounded, stated by hand, or of a fit at a bound of nu: not always a covariance.
    if (trial % 3 == 2) covariance.row(0).tail(regions) = 1.1 * covariance.row(0).tail(regions), covariance.col(0) = covariance.row(0).transpose();
    Identification answer = answer_of(covariance);
    answer.budget = budget;
    const Knowledge known = after_fit(block_on_table(), answer);
    EXPECT_EQ(known.information.llt().info(), Eigen::Success) << "trial " << trial;
    const ExpectedSpread so_far = expected_after(known, {});
    for (Index r = 0; r < regions; ++r) EXPECT_NEAR(so_far.region_log_young_std(r), std::sqrt(covariance(r, r)), 1e-6) << "trial " << trial;
    EXPECT_NEAR(so_far.poisson_std, std::sqrt(covariance(regions, regions)), 1e-6) << "trial " << trial;
    VectorX told(regions + 2);
    for (Index i = 0; i < told.size(); ++i) told(i) = normal(random);
    const RatedPush push = push_that_tells(told);
    const ExpectedSpread after = expected_after(known, {&push});
    EXPECT_TRUE(after.volume > 0 && after.volume < so_far.volume) << "trial " << trial << ": " << after.volume << " of " << so_far.volume;
    for (Index r = 0; r < regions; ++r) EXPECT_LE(after.region_log_young_std(r), so_far.region_log_young_std(r) + 1e-9) << "trial " << trial;
  }
}

TEST(NextPush, BadPlansAreRefused) {
  EXPECT_THROW(push_goal("density"), Error);
  EXPECT_THROW(before_touch(block_on_table(), 0), Error);
  EXPECT_THROW(after_fit(block_on_table(), Identification{}), Error);
  Recording scene = block_on_table();
  scene.tools[0].shape = ToolShape::platen;
  EXPECT_THROW(PushSpace(block_object(1).surface.rest(), scene, Points(0, 3), scene.tools[0], {}), Error);
  EXPECT_THROW(rank_pushes(block_on_table(), block_object(1), "pad", block_candidates(1, 0), {}, untouched(), {}), Error);
}

}  // namespace
}  // namespace palpate::estimation::next_push_test
