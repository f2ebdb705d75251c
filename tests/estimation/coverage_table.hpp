// SPDX-License-Identifier: Apache-2.0
// The coverage table of docs/uncertainty.md: recordings of known truth are fitted, and what the answers are off by is held against
// their intervals and against the Cramer-Rao bound.
#pragma once

#include <gtest/gtest.h>
#include <time.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "estimation/coverage_outcomes.hpp"
#include "estimation/coverage_scene.hpp"
#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::coverage {

inline double cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

/// Bayesian Cramer-Rao bound of (log E, nu) at the truth, nuisances at their prior means: the inverse of the Fisher information of
/// all unknowns (correlated noise with its true covariance) plus the priors' precision.
inline Vec2 bound(Scene& scene, const Row& row, const Draw& draw) {
  using namespace estimation;
  Unknowns unknowns;
  FitMemory& memory = scene.memory();
  ForwardModel model(draw.recording, scene.object(), unknowns, statics_options(draw.recording, scene.object(), {}), memory.model);
  memory.model = model.solved();
  Objective objective(model, draw.inputs, unknowns);
  VectorX truth = unknowns.prior_mean();
  truth(log_young) = std::log(draw.young_pa);
  truth(poisson) = draw.poisson;
  Loss loss;
  loss.tukey = 1e6;
  MatrixX information = objective.evaluate(truth, loss).hessian;
  for (std::size_t s = 0; row.correlated_m > 0 && s < objective.last_rows().size(); ++s) {
    for (const TermRows& rows : objective.last_rows()[s]) {
      const Index count = static_cast<Index>(rows.residual.size());
      MatrixX slopes = rows.jacobian;
      for (Index i = 0; i < count; ++i)
        if (!std::isfinite(rows.residual(i))) slopes.row(i).setZero();  // a ray that passes by has none
      MatrixX noise = MatrixX::Identity(count, count);
      for (Index i = 0; i < count; ++i) {
        for (Index k = 0; k < count; ++k) {
          const double d2 = (rows.observed_m.row(i) - rows.observed_m.row(k)).squaredNorm();
          noise(i, k) += std::pow(row.correlated_m / Scene::sigma_m, 2) * std::exp(-0.5 * d2 / std::pow(row.correlated_length_m, 2));
        }
      }
      const MatrixX lost = slopes.transpose() * (noise.llt().solve(slopes) - slopes);
      for (std::size_t a = 0; a < rows.unknowns.size(); ++a)
        for (std::size_t b = 0; b < rows.unknowns.size(); ++b)
          information(rows.unknowns[a], rows.unknowns[b]) += lost(static_cast<Index>(a), static_cast<Index>(b));
    }
  }
  const MatrixX inverse = information.ldlt().solve(MatrixX::Identity(information.rows(), 2));
  return {std::sqrt(inverse(0, 0)), std::sqrt(inverse(1, 1))};
}

/// Middle 68 % of a marginal of the posterior: equal-tailed quantiles, as the 95 % intervals are.
/// @param density  at each place of `axis`, up to a factor
inline std::pair<double, double> middle_68(const VectorX& axis, const VectorX& density) {
  VectorX below = VectorX::Zero(axis.size());
  for (Index i = 1; i < axis.size(); ++i) below(i) = below(i - 1) + 0.5 * (density(i) + density(i - 1)) * (axis(i) - axis(i - 1));
  const auto quantile = [&](double share) {
    const double wanted = share * below(below.size() - 1);
    Index i = 1;
    while (i + 1 < below.size() && below(i) < wanted) ++i;
    return axis(i - 1) + (axis(i) - axis(i - 1)) * (wanted - below(i - 1)) / (below(i) - below(i - 1));
  };
  return {quantile(0.16), quantile(0.84)};
}

struct TableOptions {
  int seeds = 3, first_seed = 1;
  std::vector<std::string> scenes, rows;  ///< empty: all
  int fine = 6;                           ///< see Scene
  int true_tetrahedra = 0;                ///< 0: the scene's own
  int calculix_each = 0;                  ///< the truth of every so manieth recording is CalculiX's; 0: of none
  bool each = false;                      ///< a line a recording
  bool noiseless = false;
  bool bound_of_correlated = true;        ///< factors of all points of a step, seconds a recording; false: rms is not held to it there
  std::string outcomes;                   ///< see Outcomes
};

/// The scene is made when a recording is wanted that is not known yet: its factorisations take minutes.
class Table {
 public:
  explicit Table(TableOptions options) : options_(std::move(options)), outcomes_(options_.outcomes) {
    fit_options_.cross_checks = fit_options_.stresses = false;
  }

  void run() {
    std::printf("| scene       | row        |    |    n |  68 %% |  95 %% | pull   | bias     | rms     | bound   | stated  | rms / bound |\n");
    for (const SceneSpec& spec : scenes()) {
      if (!wanted(options_.scenes, spec.name)) continue;
      std::unique_ptr<Scene> scene;
      for (const Row& row : rows()) {
        if (!wanted(options_.rows, row.name)) continue;
        run(spec, row, scene);
        if (testing::Test::HasFatalFailure()) return;
      }
      if (scene && options_.calculix_each > 0)
        std::printf("%s: between the Poisson ratios that it is solved at, the truth is wrong by %.1e\n", spec.name.c_str(), scene->solver_error());
    }
    for (const Row& row : rows()) {
      const auto found = together_.find(row.name);
      if (found == together_.end()) continue;
      print("together", row, found->second);
      if (const auto solved = by_calculix_.find(row.name); solved != by_calculix_.end()) print("by CalculiX", row, solved->second);
      const bool all_at_once = row.depth_m > 0.03;
      judge(row, "E", found->second[0], all_at_once ? 0.05 : 0);
      judge(row, "nu", found->second[1], all_at_once ? 0.05 : 0);
    }
  }

 private:
  using Both = std::array<Tally, 2>;  // of E, of nu

  static bool wanted(const std::vector<std::string>& names, const std::string& name) {
    return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
  }
  static void print(const std::string& scene, const Row& row, const Both& both) {
    both[0].print(scene, row.name, "E", 100);
    both[1].print(scene, row.name, "nu", 1);
  }

  void run(const SceneSpec& spec, const Row& row, std::unique_ptr<Scene>& scene) {
    Both sums;
    for (int seed = options_.first_seed; seed < options_.first_seed + options_.seeds; ++seed) {
      const Outcome* known = outcomes_.find(spec.name, row.name, seed);
      Outcome outcome;
      if (known) {
        outcome = *known;
      } else {
        if (!scene) make(spec, scene);
        outcome.by_calculix = options_.calculix_each > 0 && seed % options_.calculix_each == 0;
        fit_one(*scene, row, seed, outcome);
        if (testing::Test::HasFatalFailure()) return;
        outcomes_.keep(spec.name, row.name, seed, outcome);
      }
      add(outcome, sums);
      add(outcome, together_[row.name]);
      if (outcome.by_calculix) add(outcome, by_calculix_[row.name]);
    }
    print(spec.name, row, sums);
    for (const Tally& tally : sums) {
      EXPECT_TRUE(fair(tally.in_95, tally.count, 0.95, 4)) << spec.name << " " << row.name << ": " << tally.in_95 << " of " << tally.count;
      EXPECT_TRUE(fair(tally.in_68, tally.count, 0.68, 4)) << spec.name << " " << row.name << ": " << tally.in_68 << " of " << tally.count;
    }
  }

  static void add(const Outcome& outcome, Both& sums) {
    sums[0].add(outcome.young);
    sums[1].add(outcome.poisson);
  }

  void make(const SceneSpec& spec, std::unique_ptr<Scene>& scene) const {
    scene = std::make_unique<Scene>(spec, options_.fine, options_.true_tetrahedra > 0 ? options_.true_tetrahedra : spec.true_tetrahedra);
    scene->noise = options_.noiseless ? 0 : 1;
    if (!options_.each) return;
    std::printf("%s: %d tetrahedra, the truth has %d, its own error over nu is %.1e\n", spec.name.c_str(),
                int(scene->object().mesh.tetrahedra.rows()), int(scene->true_tetrahedra()), scene->solver_error());
  }

  void fit_one(Scene& scene, const Row& row, int seed, Outcome& outcome) const {
    const double started_s = cpu_s();
    scene.by_calculix = outcome.by_calculix;
    const Draw draw = scene.draw(row, std::uint64_t(seed));
    const double drawn_s = cpu_s();
    const Identification answer = estimation::fit(draw.recording, scene.object(), draw.inputs, fit_options_, {}, scene.finer(draw.recording), &scene.memory());
    const double fitted_s = cpu_s();
    const std::string& name = scene.spec().name;
    ASSERT_EQ(answer.termination, Termination::converged) << name << " " << row.name << " seed " << seed << ": " << answer.message;
    const bool has_bound = options_.bound_of_correlated || row.correlated_m == 0;
    const Vec2 best = has_bound ? bound(scene, row, draw) : Vec2(NAN, NAN);
    const Parameter &e = answer.parameters[0], &nu = answer.parameters[1];
    const auto inside = [](std::pair<double, double> range, double truth) { return range.first <= truth && truth <= range.second; };
    const PosteriorGrid& grid = answer.posterior;  // a density over (log E, nu)
    const auto middle_e = middle_68(grid.young_modulus_pa.array().log(), grid.density.rowwise().sum());
    const auto middle_nu = middle_68(grid.poisson_ratio, grid.density.colwise().sum());
    const double off_e = std::log(e.value / draw.young_pa), off_nu = nu.value - draw.poisson;
    const bool foreseen = best(1) < 0.06;
    outcome.young = Tally::of(off_e, e.std / e.value, best(0), inside(middle_e, std::log(draw.young_pa)),
                              inside({e.lower_95, e.upper_95}, draw.young_pa), foreseen);
    outcome.poisson = Tally::of(off_nu, nu.std, best(1), inside(middle_nu, draw.poisson), inside({nu.lower_95, nu.upper_95}, draw.poisson), foreseen);
    if (!options_.each) return;
    double mesh_e = 0, mesh_nu = 0;
    for (const auto& entry : answer.budget) {
      if (entry.input == "mesh") mesh_e = entry.young_modulus_percent, mesh_nu = entry.poisson_shift;
    }
    std::printf("%s %s seed %d%s: E %+.2f +- %.2f %% (bound %.2f)  nu %.4f %+.4f +- %.4f (bound %.4f)  mesh %.2f %% %.4f  chi2 %.3f  VIF %s %s  %d evaluations  %.1f + %.1f s",
                name.c_str(), row.name.c_str(), seed, outcome.by_calculix ? " (CalculiX)" : "", 100 * off_e, 100 * e.std / e.value,
                100 * best(0), draw.poisson, off_nu, nu.std, best(1), mesh_e, mesh_nu, answer.fit.chi2_per_dof,
                answer.provenance.at("variance inflation of correlated points").c_str(), answer.provenance.at("posterior").c_str(),
                answer.fit.solves, drawn_s - started_s, fitted_s - drawn_s);
    if (const auto shared = answer.provenance.find("noise that neighbours share"); shared != answer.provenance.end())
      std::printf(" [%s]", shared->second.c_str());
    for (const auto& verdict : answer.verdicts) std::printf(" %s", verdict.code.c_str());
    std::printf("\n");
    std::fflush(stdout);
  }

  TableOptions options_;
  Outcomes outcomes_;
  estimation::FitOptions fit_options_;
  std::map<std::string, Both> together_, by_calculix_;  // a row
};

}  // namespace palpate::coverage
