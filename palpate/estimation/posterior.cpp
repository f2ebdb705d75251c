// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/posterior.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "palpate/estimation/held_poisson.hpp"
#include "palpate/estimation/own_poisson.hpp"
#include "palpate/estimation/young_bounds.hpp"

namespace palpate::estimation {
namespace {

constexpr int grid_size = 401;
constexpr double linear_reuse = 2;  // Objective::set_reuse for a linear body: what single points err by
constexpr double negligible = 8;  // of the cost above its least: e^-8 of the density, four standard deviations
constexpr double excluded = 3;    // the same: what lies beyond is less than a hundredth of a normal density

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

/// Mean, standard deviation of log E and log determinant, all given nu, from the Hessian; and the slope over nu of the least
/// cost that the others leave.
struct Conditional {
  bool young_told = true;  // false: what is said of log E is what its bounds say
  double log_determinant = 0, cost_slope = 0;
  VectorX log_young, std_dev, slope;  // a region; slope: d log E / d nu along the ridge
  MatrixX correlation;
};

/// An evaluation, and the optimum given nu that its quadratic leads to.
struct Place {
  const Evaluation& evaluation;
  const VectorX &at, &optimum;

  VectorX gradient_at_optimum() const { return evaluation.gradient + evaluation.curvature * (optimum - at); }
};

/// What follows where nu goes: every free unknown but nu itself, and but the regions' own that are held at a bound.
std::vector<int> following(const Unknowns& list, const Place& place) {
  std::vector<int> out = moving_unknowns(list, place.optimum, place.gradient_at_optimum());
  std::erase(out, static_cast<int>(poisson));
  return out;
}

/// What the bounds of the regions' own ratios leave of the integral over them, beside what the determinant says: without its share a
/// density over nu would have a step where one of them comes to its bound. Each by itself.
double log_left_by_bounds(const Unknowns& list, const Place& place, const MatrixX& information, const std::vector<int>& moving) {
  double out = 0;
  const VectorX gradient = list.own_poisson_count() > 0 ? place.gradient_at_optimum() : VectorX();
  for (int k = list.first_own_poisson(); k < list.parameter_count(); ++k) {
    if (list[k].fixed) continue;
    std::vector<int> let_go{k};
    for (const int other : moving)
      if (other != k) let_go.push_back(other);
    const VectorX unit = VectorX::Unit(static_cast<Index>(let_go.size()), 0);
    const auto variance = [&](const MatrixX& of) { return MatrixX(of(let_go, let_go)).ldlt().solve(unit)(0); };
    const double std_dev = std::sqrt(variance(information));
    const bool held = is_held(list, place.optimum, gradient, k);
    const double beyond = held ? std::abs(gradient(k)) * variance(place.evaluation.curvature) : 0;
    const double share = log_share_in_range(place.optimum(k), beyond, std_dev, list[k].lower, list[k].upper);
    if (std::isfinite(share)) out += share;
  }
  return out;
}

/// Order: every free unknown but nu. What of the regions' own ratios is held at a bound stays there when nu moves; in the others' spread
/// it counts as free.
Conditional condition_on_poisson(const Place& place, const Unknowns& list, double factor) {
  const Evaluation& evaluation = place.evaluation;
  const VectorX& unknowns = place.optimum;
  std::vector<int> others;
  for (int k : free_unknowns(list)) {
    if (k != poisson) others.push_back(k);
  }
  const std::vector<int> moving = following(list, place);
  VectorX gradient = evaluation.gradient;
  for (const int k : others)  // what is held was taken to its bound
    if (std::find(moving.begin(), moving.end(), k) == moving.end()) gradient += (unknowns(k) - place.at(k)) * evaluation.curvature.col(k);
  const MatrixX information = evaluation.information(factor);
  MatrixX given_poisson = information(others, others);
  Eigen::LDLT<MatrixX> factorised(given_poisson);
  Conditional out;
  out.young_told = tells_young(given_poisson, factorised, list);
  // The cost's slope leads to the estimate, the information says how sharp it is.
  const MatrixX& hessian = evaluation.curvature;
  const VectorX cross = information.col(poisson)(moving), hessian_cross = hessian.col(poisson)(moving);
  MatrixX bends = hessian(moving, moving), given_held = information(moving, moving);
  if (!out.young_told) {
    bends(0, 0) += information_of_bounds(list);
    given_poisson(0, 0) += information_of_bounds(list);
    given_held(0, 0) += information_of_bounds(list);
    factorised.compute(given_poisson);
  }
  const Eigen::LDLT<MatrixX> held(bends), ridge(given_held);
  const double slope = gradient(poisson) - hessian_cross.dot(held.solve(VectorX(gradient(moving))));
  const double sharpness = hessian(poisson, poisson) - hessian_cross.dot(held.solve(hessian_cross));
  // log E of the first region comes first, then the log ratios of the others: a region's log E is the sum of two.
  const Index regions = 1 + list.ratio_count();
  MatrixX sum = MatrixX::Zero(static_cast<Index>(others.size()), regions);
  // A slope that goes on beyond the bound where the search ended says where E is, too.
  const bool pushed = std::abs(evaluation.gradient(log_young)) * (list[log_young].upper - list[log_young].lower) > 1;
  out.log_young = VectorX::Constant(regions, out.young_told || pushed ? unknowns(log_young) : middle_of_bounds(list[log_young]));
  sum.row(0).setOnes();
  for (Index r = 1; r < regions; ++r) {
    const int ratio = first_ratio + static_cast<int>(r) - 1;
    out.log_young(r) += unknowns(ratio);
    const auto at = std::find(others.begin(), others.end(), ratio);
    if (at != others.end()) sum(static_cast<Index>(at - others.begin()), r) = 1;
  }
  const MatrixX covariance = sum.transpose() * factorised.solve(sum);
  std::vector<Index> places;  // of those that move, among the others
  for (const int k : moving) places.push_back(std::lower_bound(others.begin(), others.end(), k) - others.begin());
  out.std_dev = covariance.diagonal().cwiseMax(1e-30).cwiseSqrt();
  out.correlation = out.std_dev.cwiseInverse().asDiagonal() * covariance * out.std_dev.cwiseInverse().asDiagonal();
  out.log_determinant = factorised.vectorD().array().abs().max(1e-300).log().sum() - 2 * log_left_by_bounds(list, place, information, moving);
  const VectorX along = ridge.solve(cross);
  const double informed = information(poisson, poisson) - cross.dot(along);
  out.cost_slope = sharpness > 0 && informed > 0 ? slope * informed / sharpness : slope;
  out.slope = -MatrixX(sum(places, Eigen::all)).transpose() * along;
  return out;
}

/// Piecewise cubic through (x, y) that rises and falls only where the data do (Fritsch and Carlson 1980, slopes of Fritsch and
/// Butland 1984), evaluated at `at`. Towards nu = 0.5 stiffness has a pole, which a spline would answer with swings elsewhere.
VectorX interpolate(const VectorX& x, const VectorX& y, const VectorX& at) {
  const Index n = x.size();
  const VectorX h = x.tail(n - 1) - x.head(n - 1), rise = (y.tail(n - 1) - y.head(n - 1)).cwiseQuotient(h);
  VectorX slope(n);
  for (Index i = 1; i + 1 < n; ++i) {
    const double before = 2 * h(i) + h(i - 1), after = h(i) + 2 * h(i - 1);
    slope(i) = rise(i - 1) * rise(i) > 0 ? (before + after) / (before / rise(i - 1) + after / rise(i)) : 0;
  }
  slope(0) = rise(0);
  slope(n - 1) = rise(n - 2);
  VectorX out(at.size());
  for (Index k = 0; k < at.size(); ++k) {
    Index i = 0;
    while (i + 2 < n && at(k) > x(i + 1)) ++i;
    const double t = (at(k) - x(i)) / h(i), u = 1 - t;
    out(k) = u * u * (1 + 2 * t) * y(i) + t * t * (3 - 2 * t) * y(i + 1) + h(i) * t * u * (u * slope(i) - t * slope(i + 1));
  }
  return out;
}

/// Where the search over nu looks: those of the nested points of Clenshaw and Curtis (1960) over all of nu's range, dense
/// towards its ends, that lie between `from` and `to`, and the next ones outside. They stay where they are as data come in,
/// so that what was found there before is of use again.
VectorX nodes_between(double from, double to, double lower, double upper) {
  for (int cells = 8;; cells *= 2) {
    VectorX all = 0.5 * (lower + upper) - 0.5 * (upper - lower) * VectorX::LinSpaced(cells + 1, 0, EIGEN_PI).array().cos();
    all = all.cwiseMax(lower).cwiseMin(upper);
    Index first = 0, last = cells;
    while (first < cells && all(first + 1) <= from) ++first;
    while (last > 0 && all(last - 1) >= to) --last;
    if (last - first >= 6 || cells >= 1024) return all.segment(first, last - first + 1);
  }
}

/// Integral of y over x, zero at the first one.
VectorX integral(const VectorX& x, const VectorX& y) {
  VectorX out = VectorX::Zero(x.size());
  for (Index i = 1; i < x.size(); ++i) out(i) = out(i - 1) + 0.5 * (x(i) - x(i - 1)) * (y(i) + y(i - 1));
  return out;
}

/// Moments given nu: a grid node a row, a region a column.
void fill(Posterior& posterior, const MatrixX& mean, const MatrixX& std_dev) {
  posterior.log_young_mean = mean.col(0);
  posterior.log_young_std = std_dev.col(0);
  posterior.region_mean = mean.rightCols(mean.cols() - 1);
  posterior.region_std = std_dev.rightCols(std_dev.cols() - 1);
}

/// A search over nu asks a linear body's steps many times close around the optimum: their rows are made there once.
class FollowRows {
 public:
  FollowRows(Objective& objective, const Optimum& optimum, const Loss& loss) : objective_(objective), before_(objective.reuse()) {
    if (!objective.model().superposes()) return;
    objective.set_reuse(linear_reuse);
    objective.evaluate(optimum.unknowns, loss);
    objective.set_reuse(linear_reuse, false);
  }
  ~FollowRows() {
    if (objective_.model().superposes()) objective_.set_reuse(before_);
  }
  FollowRows(const FollowRows&) = delete;
  FollowRows& operator=(const FollowRows&) = delete;

 private:
  Objective& objective_;
  double before_;
};

void finish(Posterior& posterior, const VectorX& log_density) {
  posterior.weight = (log_density.array() - log_density.maxCoeff()).exp();
  posterior.weight /= posterior.weight.sum();
  update_covariance(posterior);
}

}  // namespace

void update_covariance(Posterior& posterior) {
  const double nu = posterior.weight.dot(posterior.poisson);
  const double log_e = posterior.weight.dot(posterior.log_young_mean);
  const VectorX off_nu = posterior.poisson.array() - nu, off_e = posterior.log_young_mean.array() - log_e;
  posterior.covariance.resize(2, 2);
  posterior.covariance(1, 1) = posterior.weight.dot(off_nu.cwiseAbs2());
  posterior.covariance(0, 0) = posterior.weight.dot(off_e.cwiseAbs2() + posterior.log_young_std.cwiseAbs2());
  posterior.covariance(0, 1) = posterior.covariance(1, 0) = posterior.weight.dot(off_e.cwiseProduct(off_nu));
}

Posterior Posterior::of_region(Index region) const {
  if (region == 0) return *this;
  Posterior out = *this;
  out.log_young_mean = region_mean.col(region - 1);
  out.log_young_std = region_std.col(region - 1);
  update_covariance(out);
  return out;
}

double Posterior::poisson_quantile(double probability) const {
  if (poisson.size() == 1) return poisson(0);
  // Weights are masses of cells about the nodes; inside a cell the density is flat.
  double below = 0;
  const double cell = (poisson(poisson.size() - 1) - poisson(0)) / static_cast<double>(poisson.size() - 1);
  for (Index i = 0; i < poisson.size(); ++i) {
    if (below + weight(i) >= probability) {
      const double at = poisson(i) + cell * ((probability - below) / weight(i) - 0.5);
      return std::clamp(at, poisson(0), poisson(poisson.size() - 1));
    }
    below += weight(i);
  }
  return poisson(poisson.size() - 1);
}

double Posterior::log_young_quantile(double probability) const {
  double low = (log_young_mean - 9 * log_young_std).minCoeff(), high = (log_young_mean + 9 * log_young_std).maxCoeff();
  const double close_enough = 1e-13 * (1 + high - low);
  double at = 0.5 * (low + high);
  while (high - low > close_enough) {  // Newton's method, and halves where it leaves the bracket
    double below = 0, density = 0;
    for (Index k = 0; k < weight.size(); ++k) {
      if (weight(k) < 1e-16) continue;
      const double z = (at - log_young_mean(k)) / log_young_std(k);
      below += weight(k) * normal_cdf(z);
      density += weight(k) * std::exp(-0.5 * z * z) / (std::sqrt(2 * EIGEN_PI) * log_young_std(k));
    }
    (below < probability ? low : high) = at;
    const double next = density > 0 ? at - (below - probability) / density : at;
    if (std::abs(next - at) < close_enough) break;
    at = next > low && next < high ? next : 0.5 * (low + high);
  }
  return std::clamp(at, log_young_lower, log_young_upper);
}

double Posterior::poisson_std() const { return std::sqrt(std::max(covariance(1, 1), 0.0)); }
double Posterior::log_young_std_total() const { return std::sqrt(std::max(covariance(0, 0), 0.0)); }

Posterior explore_posterior(Objective& objective, const Optimum& optimum, const Loss& loss, double information_factor,
                            const OnProgress& progress) {
  const Unknowns& list = objective.unknowns();
  const Conditional at = condition_on_poisson({optimum.evaluation, optimum.unknowns, optimum.unknowns}, list, information_factor);
  const double nu = optimum.unknowns(poisson);
  const double lower = list[poisson].lower, upper = list[poisson].upper;
  Posterior posterior;
  posterior.correlation = at.correlation;
  posterior.log_young_lower = list[log_young].lower;
  posterior.log_young_upper = list[log_young].upper;
  if (list[poisson].fixed) {
    posterior.poisson = VectorX::Constant(1, nu);
    fill(posterior, at.log_young.transpose(), at.std_dev.transpose());
    finish(posterior, VectorX::Zero(1));
    return posterior;
  }

  // Standard deviation of nu with everything else free.
  const std::vector<int> moving = free_unknowns(list);
  MatrixX hessian = optimum.evaluation.information(information_factor)(moving, moving);
  if (!at.young_told) hessian(0, 0) += information_of_bounds(list);
  VectorX unit = VectorX::Zero(hessian.rows());
  unit(1) = 1;
  const double variance = hessian.ldlt().solve(unit)(1);
  const double std_nu = variance > 0 && std::isfinite(variance) ? std::sqrt(variance) : upper - lower;
  const auto normal = [&](double from, double to) {
    posterior.poisson = VectorX::LinSpaced(grid_size, from, to);
    const VectorX off = posterior.poisson.array() - nu;
    fill(posterior, (off * at.slope.transpose()).rowwise() + at.log_young.transpose(), at.std_dev.transpose().replicate(grid_size, 1));
    finish(posterior, -0.5 * (off / std_nu).cwiseAbs2());
  };
  const bool inside = nu - 5 * std_nu > lower && nu + 5 * std_nu < upper;
  if (inside && std_nu < 0.03) {
    normal(nu - 5 * std_nu, nu + 5 * std_nu);
    return posterior;
  }

  const FollowRows follow(objective, optimum, loss);
  // Conditional optima outwards from the best one, each started from its neighbour.
  posterior.quadrature = true;
  const double from = std::max(lower, nu - 6 * std_nu), to = std::min(upper, nu + 6 * std_nu);
  VectorX node = nodes_between(from, to, lower, upper);
  const Index nodes = node.size();
  VectorX cost_slope(nodes), log_determinant(nodes);
  MatrixX mean(nodes, at.log_young.size()), std_dev(nodes, at.log_young.size());  // a region a column
  Index nearest = 0;
  (node.array() - nu).abs().minCoeff(&nearest);
  if (nu > from && nu < to) nearest = std::clamp<Index>(nearest, 1, nodes - 2);
  node(nearest) = nu;  // is known already
  // Given nu the others are nearly linear: from the neighbour's ridge, one evaluation and the Newton step from there say where
  // the optimum is and how low.
  OptimiseOptions few;
  few.max_iterations = 6;
  few.step_tolerance = 0.02;
  few.enough_gain = 0.05;
  std::vector<int> others = moving;
  std::erase(others, static_cast<int>(poisson));
  int done = 0;
  const OnProgress keep_going = [&](std::string_view, double) {
    return !progress || progress("posterior", static_cast<double>(done) / static_cast<double>(nodes));
  };
  const auto note = [&](Index i, const Conditional& c) {
    cost_slope(i) = c.cost_slope;
    log_determinant(i) = c.log_determinant;
    mean.row(i) = c.log_young.transpose();
    std_dev.row(i) = c.std_dev.transpose();
  };
  // False: cancelled, or no equilibrium at this nu.
  const auto visit = [&](Index i, Optimum& walk, VectorX& evaluated_at) {
    ++done;
    VectorX begin = walk.unknowns;
    const std::vector<int> follow_nu = following(list, {walk.evaluation, evaluated_at, walk.unknowns});
    const VectorX along = MatrixX(walk.evaluation.curvature(follow_nu, follow_nu))
                              .ldlt()
                              .solve(-VectorX(walk.evaluation.curvature.col(poisson)(follow_nu)));
    for (std::size_t k = 0; k < follow_nu.size(); ++k) {
      begin(follow_nu[k]) += (node(i) - walk.unknowns(poisson)) * along(static_cast<Index>(k));
    }
    if (!at.young_told) begin(log_young) = walk.unknowns(log_young);  // its share of the ridge is rounding
    begin(poisson) = node(i);
    objective.hold_poisson(true);
    Optimum conditional = optimise(objective, begin, loss, few, keep_going);
    objective.hold_poisson(false);
    posterior.cancelled = conditional.termination == Termination::cancelled;
    if (posterior.cancelled || !conditional.evaluation.usable) return false;
    evaluated_at = conditional.unknowns;
    const Evaluation& there = conditional.evaluation;
    const NewtonStep step = step_in_range(list, evaluated_at, there.curvature, there.gradient, others);
    for (std::size_t k = 0; k < others.size(); ++k) conditional.unknowns(others[k]) += step.move(static_cast<Index>(k));
    note(i, condition_on_poisson({there, evaluated_at, conditional.unknowns}, list, information_factor));
    walk = std::move(conditional);
    return true;
  };
  note(nearest, at);
  Index first = nearest, last = nearest;  // that have an equilibrium
  // Outwards until so little of the posterior is left that no quantile asks for it.
  const auto outwards = [&](Index& edge, Index by, std::optional<double>& unsolved) {
    Optimum walk = optimum;
    VectorX evaluated_at = optimum.unknowns;
    double rise = 0;
    while (rise < negligible && edge + by >= 0 && edge + by < nodes) {
      const Index next = edge + by;
      if (!visit(next, walk, evaluated_at)) {
        if (rise < excluded && !posterior.cancelled) unsolved = node(next);
        return;
      }
      rise += 0.5 * (cost_slope(edge) + cost_slope(next)) * (node(next) - node(edge)) +
              0.5 * (log_determinant(next) - log_determinant(edge));
      edge = next;
    }
  };
  outwards(last, 1, posterior.unsolved_above);
  if (!posterior.cancelled) outwards(first, -1, posterior.unsolved_below);
  if (posterior.cancelled) return posterior;
  const Index count = last - first + 1;
  if (count < 2) {  // no neighbour could be solved: what the optimum alone says
    posterior.quadrature = false;
    normal(from, to);
    return posterior;
  }
  node = node.segment(first, count).eval();
  cost_slope = cost_slope.segment(first, count).eval();
  log_determinant = log_determinant.segment(first, count).eval();
  mean = mean.middleRows(first, count).eval();
  std_dev = std_dev.middleRows(first, count).eval();

  posterior.poisson = VectorX::LinSpaced(grid_size, node(0), node(count - 1));
  MatrixX fine_mean(grid_size, mean.cols()), fine_std(grid_size, mean.cols());
  for (Index r = 0; r < mean.cols(); ++r) {
    fine_mean.col(r) = interpolate(node, mean.col(r), posterior.poisson);
    fine_std.col(r) = interpolate(node, std_dev.col(r), posterior.poisson).cwiseMax(1e-3 * std_dev.col(r).minCoeff());
  }
  fill(posterior, fine_mean, fine_std);
  const VectorX cost = integral(posterior.poisson, interpolate(node, cost_slope, posterior.poisson));
  finish(posterior, -cost - 0.5 * interpolate(node, log_determinant, posterior.poisson));
  return posterior;
}

PosteriorGrid posterior_grid(const Posterior& posterior) {
  PosteriorGrid grid;
  if (posterior.poisson.size() < 2) return grid;
  constexpr int size = 61;
  const double span = 4 * posterior.log_young_std_total();
  const double middle = posterior.log_young_quantile(0.5);
  grid.young_modulus_pa =
      VectorX::LinSpaced(size, std::max(middle - span, posterior.log_young_lower), std::min(middle + span, posterior.log_young_upper))
          .array()
          .exp();
  const double nu_low = posterior.poisson_quantile(1e-4), nu_high = posterior.poisson_quantile(1 - 1e-4);
  grid.poisson_ratio = VectorX::LinSpaced(size, nu_low, nu_high);
  grid.density.resize(size, size);
  const double step = (posterior.poisson(posterior.poisson.size() - 1) - posterior.poisson(0)) /
                      static_cast<double>(posterior.poisson.size() - 1);
  for (int j = 0; j < size; ++j) {
    const Index at = std::clamp<Index>(static_cast<Index>(std::lround((grid.poisson_ratio(j) - posterior.poisson(0)) / step)), 0,
                                       static_cast<Index>(posterior.poisson.size()) - 1);
    for (int i = 0; i < size; ++i) {
      const double z = (std::log(grid.young_modulus_pa(i)) - posterior.log_young_mean(at)) / posterior.log_young_std(at);
      grid.density(i, j) = posterior.weight(at) / step * std::exp(-0.5 * z * z) /
                           (std::sqrt(2 * EIGEN_PI) * posterior.log_young_std(at));
    }
  }
  return grid;
}

}  // namespace palpate::estimation
