// label: statistics
// SPDX-License-Identifier: Apache-2.0
// How often the intervals hold the truth, how far off the answers are, and how near they come to the Cramer-Rao bound: the table
// of docs/uncertainty.md. A few recordings a row by default;
//   PALPATE_SEEDS=200 PALPATE_ROW=pose,rest PALPATE_SCENE=ball_top estimation_coverage_test
// for figures that mean something (PALPATE_FIRST_SEED to go on elsewhere, PALPATE_EACH=1 for a line a recording, PALPATE_NOISELESS=1
// for what meshes alone do, PALPATE_TRUE_TETRAHEDRA and PALPATE_FINE for the truth's mesh, PALPATE_TRUTH=calculix for truths by
// CalculiX).
#include <gtest/gtest.h>
#include <time.h>

#include <Eigen/Cholesky>
#include <cstdio>
#include <cstdlib>

#include "coverage_scene.hpp"
#include "palpate/estimation/objective.hpp"
#include "palpate/estimation/optimise.hpp"

namespace palpate::coverage {
namespace {

int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text ? std::max(1, std::atoi(text)) : otherwise;
}

bool wanted(const char* name, const std::string& what) {
  const char* text = std::getenv(name);
  return !text || ("," + std::string(text) + ",").find("," + what + ",") != std::string::npos;
}

double cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

/// Bayesian Cramer-Rao bound of (log E, nu) at the truth, nuisances at their prior means: the inverse of the Fisher information of
/// all unknowns (correlated noise with its true covariance) plus the priors' precision.
Vec2 bound(Scene& scene, const Row& row, const Draw& draw) {
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

/// Errors of one number over many recordings.
struct Tally {
  int count = 0, in_68 = 0, in_95 = 0;
  double error = 0, squares = 0, bounds2 = 0, stated = 0, pulls = 0, normed = 0;
  void add(double off, double std, double at_best, bool inside_68, bool inside_95) {
    ++count;
    in_68 += inside_68;
    in_95 += inside_95;
    error += off;
    squares += off * off;
    bounds2 += at_best * at_best;
    stated += std;
    pulls += off / std;
    normed += off * off / (at_best * at_best);
  }
  static bool fair(int hits, int count, double nominal) {
    return std::abs(hits - nominal * count) <= 4 * std::sqrt(count * nominal * (1 - nominal)) + 0.5;
  }
  void print(const std::string& scene, const std::string& row, const char* what, double unit) const {
    const double n = count;
    std::printf("| %-11s | %-10s | %-2s | %4d | %3.0f | %3.0f | %+6.2f | %+8.4f | %7.4f | %7.4f | %7.4f | %4.2f |\n", scene.c_str(),
                row.c_str(), what, count, 100 * in_68 / n, 100 * in_95 / n, pulls / n, unit * error / n, unit * std::sqrt(squares / n),
                unit * std::sqrt(bounds2 / n), unit * stated / n, std::sqrt(normed / n));
    std::fflush(stdout);
  }
};

TEST(Coverage, IntervalsHoldTheTruthAsOftenAsTheySay) {
  const int seeds = from_environment("PALPATE_SEEDS", 3), first = from_environment("PALPATE_FIRST_SEED", 1);
  const int fine = from_environment("PALPATE_FINE", 6);
  const bool each = std::getenv("PALPATE_EACH") != nullptr;
  const char* solver = std::getenv("PALPATE_TRUTH");
  const bool noiseless = std::getenv("PALPATE_NOISELESS") != nullptr;
  const bool by_calculix = solver != nullptr && std::string(solver) == "calculix";
  if (by_calculix && !fem::calculix_is_there()) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  estimation::FitOptions options;
  options.cross_checks = options.stresses = false;
  std::printf("| scene       | row        |    |    n | 68 %%| 95 %%| pull   | bias     | rms     | bound   | stated  | rms / bound |\n");
  for (const SceneSpec& spec : scenes()) {
    if (!wanted("PALPATE_SCENE", spec.name)) continue;
    Scene scene(spec, fine, from_environment("PALPATE_TRUE_TETRAHEDRA", spec.true_tetrahedra));
    scene.by_calculix = by_calculix;
    scene.noise = noiseless ? 0 : 1;
    if (each) {
      std::printf("%s: %d tetrahedra, the truth has %d, its own error over nu is %.1e\n", spec.name.c_str(),
                  int(scene.object().mesh.tetrahedra.rows()), int(scene.true_tetrahedra()), scene.solver_error());
    }
    for (const Row& row : rows()) {
      if (!wanted("PALPATE_ROW", row.name)) continue;
      Tally young, poisson;
      for (int seed = first; seed < first + seeds; ++seed) {
        const double started_s = cpu_s();
        const Draw draw = scene.draw(row, std::uint64_t(seed));
        const double drawn_s = cpu_s();
        const Identification answer = estimation::fit(draw.recording, scene.object(), draw.inputs, options, {}, scene.finer(draw.recording), &scene.memory());
        const double fitted_s = cpu_s();
        ASSERT_EQ(answer.termination, Termination::converged) << spec.name << " " << row.name << " seed " << seed << ": " << answer.message;
        const Vec2 best = bound(scene, row, draw);
        const Parameter &e = answer.parameters[0], &nu = answer.parameters[1];
        const auto in_95 = [](const Parameter& p, double truth) { return p.lower_95 <= truth && truth <= p.upper_95; };
        const double off_e = std::log(e.value / draw.young_pa), off_nu = nu.value - draw.poisson;
        young.add(off_e, e.std / e.value, best(0), std::abs(off_e) < e.std / e.value, in_95(e, draw.young_pa));
        poisson.add(off_nu, nu.std, best(1), std::abs(off_nu) < nu.std, in_95(nu, draw.poisson));
        if (each) {
          double mesh_e = 0, mesh_nu = 0;
          for (const auto& entry : answer.budget) {
            if (entry.input == "mesh") mesh_e = entry.young_modulus_percent, mesh_nu = entry.poisson_shift;
          }
          std::printf("%s %s seed %d: E %+.2f +- %.2f %% (bound %.2f)  nu %.4f %+.4f +- %.4f (bound %.4f)  mesh %.2f %% %.4f  chi2 %.3f  VIF %s %s  %d evaluations  %.1f + %.1f s",
                      spec.name.c_str(), row.name.c_str(), seed, 100 * off_e, 100 * e.std / e.value, 100 * best(0), draw.poisson, off_nu, nu.std,
                      best(1), mesh_e, mesh_nu, answer.fit.chi2_per_dof,
                      answer.provenance.at("variance inflation of correlated points").c_str(),
                      answer.provenance.at("posterior").c_str(), answer.fit.solves, drawn_s - started_s, fitted_s - drawn_s);
          if (const auto shared = answer.provenance.find("noise that neighbours share"); shared != answer.provenance.end())
            std::printf(" [%s]", shared->second.c_str());
          for (const auto& verdict : answer.verdicts) std::printf(" %s", verdict.code.c_str());
          std::printf("\n");
          std::fflush(stdout);
        }
      }
      young.print(spec.name, row.name, "E", 100);
      poisson.print(spec.name, row.name, "nu", 1);
      for (const Tally* tally : {&young, &poisson}) {
        EXPECT_TRUE(Tally::fair(tally->in_95, tally->count, 0.95)) << spec.name << " " << row.name << ": " << tally->in_95 << " of " << tally->count;
        EXPECT_TRUE(Tally::fair(tally->in_68, tally->count, 0.68)) << spec.name << " " << row.name << ": " << tally->in_68 << " of " << tally->count;
      }
    }
  }
}

}  // namespace
}  // namespace palpate::coverage
