// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/next_push.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/estimation/push_information.hpp"
#include "palpate/estimation/unknowns.hpp"

namespace palpate::estimation {
namespace {

constexpr double known_exactly = 1e12;      // information of what is fixed
constexpr double within_covariance = 0.99;  // of a variance, at most, that one of its parts may have

/// (log E of every region, nu) as rows of (log E of the first, nu, log ratios, force scale).
MatrixX every_young(Index unknowns) {
  const Index regions = unknowns - 2;
  MatrixX rows = MatrixX::Zero(regions + 1, unknowns);
  rows.col(0).head(regions).setOnes();
  for (Index r = 1; r < regions; ++r) rows(r, 1 + r) = 1;
  rows(regions, 1) = 1;
  return rows;
}

/// Parts that an answer tells apart; none where it has one Young's modulus.
std::vector<std::string> regions_of(const Identification& answer) {
  std::vector<std::string> names;
  for (const auto& one : answer.parameters)
    if (one.name == "young_modulus" && !one.region.empty()) names.push_back(one.region);
  return names;
}

Index parameter_row(const Identification& answer, const std::string& name, const std::string& region) {
  for (std::size_t i = 0; i < answer.parameters.size(); ++i)
    if (answer.parameters[i].name == name && answer.parameters[i].region == region) return static_cast<Index>(i);
  throw Error("holds no " + name + (region.empty() ? " of the whole object" : " of the region '" + region + "'"), "result: parameters");
}

double root_of_determinant(const MatrixX& covariance) {
  return covariance.llt().matrixLLT().diagonal().prod();
}

/// Correlations that cannot be all at once, made weaker alike until they can; what is a covariance stays as it is.
/// @param left  of the variance along the worst direction, at least; not above 0: singular is fine
MatrixX made_possible(const MatrixX& covariance, double left) {
  const VectorX std = covariance.diagonal().cwiseMax(1e-300).cwiseSqrt();
  MatrixX correlation = std.cwiseInverse().asDiagonal() * covariance * std.cwiseInverse().asDiagonal();
  correlation.diagonal().setZero();
  const double lowest = Eigen::SelfAdjointEigenSolver<MatrixX>(correlation, Eigen::EigenvaluesOnly).eigenvalues()(0);
  if (1 + lowest > left) return covariance;
  MatrixX out = -0.9 / lowest * covariance;
  out.diagonal() = covariance.diagonal();
  return out;
}

/// Standard deviations that errors which no push takes away have given to every log E and then nu.
VectorX shares_of(const Identification& answer, const std::vector<std::string>& regions, Index count) {
  VectorX squares = VectorX::Zero(count);
  for (const auto& entry : answer.budget) {
    if (entry.input != "mesh" && entry.input != "unseen side" && entry.input != "foot") continue;
    for (Index r = 0; r < count - 1; ++r) {
      double percent = entry.young_modulus_percent;
      for (const RegionShare& share : entry.regions)
        if (!regions.empty() && share.region == regions[static_cast<std::size_t>(r)]) percent = share.young_modulus_percent;
      squares(r) += std::pow(percent / 100, 2);
    }
    squares(count - 1) += entry.poisson_shift * entry.poisson_shift;
  }
  return squares.cwiseSqrt();
}

/// The part of a covariance that these errors made. Their products are in it too, with signs that the budget does not tell: as much of
/// them is taken as leaves the least correlation. Of one E and nu what is left is then a covariance for sure, as what was before them is.
MatrixX part_of(const VectorX& shares, const MatrixX& covariance) {
  const VectorX most = shares.cwiseMin((within_covariance * covariance.diagonal()).cwiseSqrt());
  MatrixX part(covariance.rows(), covariance.cols());
  for (Index i = 0; i < part.rows(); ++i)
    for (Index j = 0; j < part.cols(); ++j) {
      const double product = most(i) * most(j);
      part(i, j) = i == j ? product : std::clamp(covariance(i, j), -product, product);
    }
  return made_possible(part, -1e-9);
}

/// Without what all pushes share, each with its prior in the last rows: integrated out once, of all pushes together.
MatrixX without_shared(const MatrixX& information, Index shared) {
  if (shared == 0) return information;
  const Index kept = information.rows() - shared;
  const MatrixX cross = information.bottomLeftCorner(shared, kept);
  return information.topLeftCorner(kept, kept) - cross.transpose() * information.bottomRightCorner(shared, shared).ldlt().solve(cross);
}

/// @param touched  false: nothing of E is known but what pushes that are planned would tell
ExpectedSpread spread_of(const MatrixX& information, const MatrixX& uncured, bool touched) {
  const Index regions = information.rows() - 2;
  if (uncured.size() == 0) return spread_of(information, MatrixX::Zero(regions + 1, regions + 1), touched);
  ExpectedSpread spread;
  if (!touched && !(information(0, 0) > 0)) {  // that row has no inverse
    spread.log_young_std = spread.young_volume = spread.volume = std::numeric_limits<double>::infinity();
    spread.region_log_young_std = VectorX::Constant(regions, spread.log_young_std);
    spread.poisson_std = information(1, 1) > 0 ? std::sqrt(1 / information(1, 1) + uncured(regions, regions)) : spread.log_young_std;
    return spread;
  }
  const MatrixX rows = every_young(information.rows());
  MatrixX covariance = rows * information.ldlt().solve(rows.transpose());
  covariance += uncured;
  covariance.diagonal() = covariance.diagonal().cwiseMax(1e-24);
  spread.region_log_young_std = covariance.diagonal().head(regions).cwiseSqrt();
  spread.log_young_std = spread.region_log_young_std.maxCoeff();
  spread.poisson_std = std::sqrt(covariance(regions, regions));
  spread.young_volume = root_of_determinant(covariance.topLeftCorner(regions, regions));
  spread.volume = root_of_determinant(covariance);
  return spread;
}

}  // namespace

PushGoal push_goal(const std::string& name) {
  if (name == "young-modulus") return PushGoal::young_modulus;
  if (name == "poisson-ratio") return PushGoal::poisson_ratio;
  if (name == "both") return PushGoal::both;
  throw Error("pushes are planned for young-modulus, poisson-ratio or both", "goal " + name);
}

double ExpectedSpread::score(PushGoal goal) const {
  if (goal == PushGoal::young_modulus) return young_volume;
  return goal == PushGoal::poisson_ratio ? poisson_std : volume;
}

double Knowledge::young_modulus_of(int region) const {
  return region == 0 ? young_modulus_pa : young_modulus_pa * std::exp(log_ratio(region - 1));
}

Knowledge before_touch(const Recording& recording, double young_modulus_pa) {
  if (!(young_modulus_pa > 0)) throw Error("must be positive", "young_modulus_pa");
  Knowledge known;
  known.young_modulus_pa = young_modulus_pa;
  const ModelDefaults& model = recording.model;
  known.poisson_ratio = model.poisson_fixed.value_or(std::clamp(0.3, model.poisson_lower, model.poisson_upper));
  if (recording.regions.size() > 1)  // as in the simulation
    for (const Region& region : recording.regions) known.regions.push_back(region.name);
  const Index ratios = std::max<Index>(1, static_cast<Index>(known.regions.size())) - 1;
  known.log_ratio = VectorX::Zero(ratios);
  known.information = MatrixX::Zero(3 + ratios, 3 + ratios);
  const double range = model.poisson_upper - model.poisson_lower;
  known.information(1, 1) = model.poisson_fixed || !(range > 0) ? known_exactly : 12 / (range * range);
  known.information.diagonal().segment(2, ratios).setConstant(std::pow(Unknowns::ratio_prior_std, -2));
  known.information(2 + ratios, 2 + ratios) = recording.force_scale_std > 0 ? std::pow(recording.force_scale_std, -2) : known_exactly;
  return known;
}

Knowledge after_fit(const Recording& recording, const Identification& answer) {
  Knowledge known;
  known.touched = true;
  known.regions = regions_of(answer);
  // Where the answer's parameters hold every log E and then nu.
  std::vector<Index> rows;
  for (const auto& name : known.regions) rows.push_back(parameter_row(answer, "young_modulus", name));
  if (rows.empty()) rows.push_back(parameter_row(answer, "young_modulus", ""));
  const bool own = std::none_of(answer.parameters.begin(), answer.parameters.end(),
                                [](const Parameter& one) { return one.name == "poisson_ratio" && one.region.empty(); });
  rows.push_back(parameter_row(answer, "poisson_ratio", own && !known.regions.empty() ? known.regions.front() : ""));
  const Index regions = static_cast<Index>(rows.size()) - 1;
  if (answer.covariance.rows() <= *std::max_element(rows.begin(), rows.end()) || !answer.covariance.allFinite())
    throw Error("holds no covariance; estimate with the default method", "result: covariance");
  MatrixX covariance = answer.covariance(rows, rows);
  if (!(covariance.diagonal().head(regions).minCoeff() > 0))
    throw Error("holds no covariance; estimate with the default method", "result: covariance");
  const auto value = [&](Index r) { return answer.parameters[static_cast<std::size_t>(rows[static_cast<std::size_t>(r)])].value; };
  known.young_modulus_pa = value(0);
  known.poisson_ratio = std::clamp(value(regions), 0.0, 0.499);
  known.log_ratio.resize(regions - 1);
  for (Index r = 1; r < regions; ++r) known.log_ratio(r - 1) = std::log(value(r) / value(0));
  const bool fixed = recording.model.poisson_fixed || !(covariance(regions, regions) > 0);
  if (fixed) {
    covariance.row(regions).setZero();
    covariance.col(regions).setZero();
    covariance(regions, regions) = 1 / known_exactly;
  }

  covariance = made_possible(covariance, 1e-9);

  // E is proportional to the force: d log E / d scale = 1 exactly, of every region. The scale has no more than the covariance holds of a
  // common error of every E (Schur's complement): else the two together would be no covariance.
  double scale_std = recording.force_scale_std;
  for (const auto& nuisance : answer.nuisances)
    if (nuisance.name == "force_scale") scale_std = std::min(scale_std, nuisance.std);
  VectorX common = VectorX::Ones(regions + 1);
  common(regions) = 0;
  const double scale = std::min(scale_std * scale_std, within_covariance / common.dot(covariance.ldlt().solve(common)));
  const MatrixX of_scale = scale * common * common.transpose();

  // The mesh's error comes back with every push, and none shows the unseen side or the foot.
  VectorX shares = shares_of(answer, known.regions, regions + 1);
  if (fixed) shares(regions) = 0;
  known.uncured = part_of(shares, covariance - of_scale);
  MatrixX joint = MatrixX::Zero(regions + 2, regions + 2);
  joint.topLeftCorner(regions + 1, regions + 1) = made_possible(covariance - of_scale - known.uncured, 1e-9) + of_scale;
  joint(regions + 1, regions + 1) = scale > 0 ? scale : 1 / known_exactly;
  joint.col(regions + 1).head(regions).setConstant(scale);
  joint.row(regions + 1).head(regions).setConstant(scale);
  // From (every log E, nu, scale) to (log E of the first, nu, log ratios, scale).
  MatrixX to = MatrixX::Zero(regions + 2, regions + 2);
  to(0, 0) = to(1, regions) = to(regions + 1, regions + 1) = 1;
  for (Index r = 1; r < regions; ++r) to(1 + r, r) = 1, to(1 + r, 0) = -1;
  const MatrixX about = to * joint * to.transpose();
  known.information = about.fullPivLu().inverse();
  return known;
}

Knowledge with_shared(Knowledge known, const VectorX& information) {
  const Index count = static_cast<Index>(information.size()), size = static_cast<Index>(known.information.rows()) - known.shared + count;
  known.information.conservativeResizeLike(MatrixX::Zero(size, size));
  known.information.bottomRightCorner(count, count) = information.asDiagonal();
  known.shared = count;
  return known;
}

ExpectedSpread expected_after(const Knowledge& knowledge, const std::vector<const RatedPush*>& pushes) {
  MatrixX information = knowledge.information;
  for (const RatedPush* push : pushes) information += push->information;
  return spread_of(without_shared(information, knowledge.shared), knowledge.uncured, knowledge.touched);
}

PushRanking rank_pushes(const Recording& scene, const SimulatedObject& object, const std::string& tool,
                        const std::vector<PushCandidate>& candidates, const SensorPlan& sensors, const Knowledge& knowledge,
                        const RankOptions& options, const OnProgress& progress) {
  PushRanking ranking;
  ranking.knowledge = knowledge;
  ranking.goal = options.goal;
  ranking.so_far = expected_after(knowledge, {});
  if (candidates.empty()) return ranking;
  PushInformation information(scene, object, tool, candidates, sensors, knowledge, options);
  ranking.too_soft = information.left_out();
  for (std::size_t c = 0; c < information.count(); ++c) {
    if (progress && !progress("rate pushes", static_cast<double>(c) / static_cast<double>(information.count()))) break;
    std::vector<RatedPush> rated = information.rate(c);
    if (rated.empty()) ++ranking.out_of_view;
    for (RatedPush& push : rated) ranking.pushes.push_back(std::move(push));
  }
  // What all pushes share, every push beside it.
  ranking.knowledge = with_shared(knowledge, information.shared_information());
  const MatrixX nothing = MatrixX::Zero(ranking.knowledge.information.rows(), ranking.knowledge.information.cols());
  for (RatedPush& push : ranking.pushes) {
    push.information.conservativeResizeLike(nothing);
    push.expected = expected_after(ranking.knowledge, {&push});
  }
  std::stable_sort(ranking.pushes.begin(), ranking.pushes.end(), [&](const RatedPush& a, const RatedPush& b) {
    return a.expected.score(options.goal) < b.expected.score(options.goal);
  });
  return ranking;
}

std::vector<std::size_t> hardest_pushes(const PushRanking& ranking) {
  std::vector<std::size_t> hardest;
  for (std::size_t i = 0; i < ranking.pushes.size(); ++i) {
    const RatedPush& push = ranking.pushes[i];
    const auto same = std::find_if(hardest.begin(), hardest.end(), [&](std::size_t known) {
      const PushCandidate& at = ranking.pushes[known].candidate;
      return at.contact_m == push.candidate.contact_m && at.direction == push.candidate.direction;
    });
    if (same == hardest.end())
      hardest.push_back(i);
    else if (push.steps > ranking.pushes[*same].steps)
      *same = i;
  }
  return hardest;
}

std::vector<std::size_t> plan_sequence(const PushRanking& ranking, int count) {
  std::vector<std::size_t> order;
  std::vector<const RatedPush*> made;
  for (int n = 0; n < count && !ranking.pushes.empty(); ++n) {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < ranking.pushes.size(); ++i) {
      made.push_back(&ranking.pushes[i]);
      const double score = expected_after(ranking.knowledge, made).score(ranking.goal);
      made.pop_back();
      if (score < least) least = score, best = i;
    }
    order.push_back(best);
    made.push_back(&ranking.pushes[best]);
  }
  return order;
}

}  // namespace palpate::estimation
