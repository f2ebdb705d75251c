// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/error_budget.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

namespace palpate::estimation {
namespace {

/// "frame_rotation_x[push:3]" -> "frame_rotation": one input a sensor or part, however many numbers it has.
std::string group_of(const std::string& name) {
  std::string group = name.substr(0, name.find('['));
  if (group.rfind("marker_", 0) == 0) return "marker positions";
  if (group.size() > 2 && group[group.size() - 2] == '_' && group.back() >= 'x' && group.back() <= 'z') group.resize(group.size() - 2);
  return group;
}

struct Variances {
  double log_young = 0, poisson = 0;
};

Variances variances_without(const MatrixX& hessian, const std::vector<int>& moving, const std::vector<bool>& known) {
  std::vector<Index> keep;
  for (std::size_t k = 0; k < moving.size(); ++k) {
    if (!known[k]) keep.push_back(static_cast<Index>(k));
  }
  const MatrixX kept = hessian(keep, keep);
  const MatrixX covariance = kept.ldlt().solve(MatrixX::Identity(kept.rows(), kept.cols()));
  const bool has_poisson = moving.size() > 1 && moving[1] == poisson;
  return {covariance(0, 0), has_poisson ? covariance(1, 1) : 0};
}

}  // namespace

std::vector<BudgetEntry> error_budget(const Unknowns& unknowns, const MatrixX& hessian, const std::vector<int>& moving) {
  std::map<std::string, std::vector<bool>> groups;
  std::vector<bool> all(moving.size(), false);
  for (std::size_t k = 0; k < moving.size(); ++k) {
    if (moving[k] < unknowns.parameter_count()) continue;
    auto& members = groups[group_of(unknowns[moving[k]].name)];
    members.resize(moving.size(), false);
    members[k] = true;
    all[k] = true;
  }
  const Variances total = variances_without(hessian, moving, std::vector<bool>(moving.size(), false));
  const auto lost = [](double with, double without) { return std::sqrt(std::max(with - without, 0.0)); };
  std::vector<BudgetEntry> budget;
  for (const auto& [name, members] : groups) {
    const Variances known = variances_without(hessian, moving, members);
    budget.push_back({name, 100 * lost(total.log_young, known.log_young), lost(total.poisson, known.poisson)});
  }
  const Variances noise = variances_without(hessian, moving, all);
  budget.push_back({"sensor noise", 100 * std::sqrt(std::max(noise.log_young, 0.0)), std::sqrt(std::max(noise.poisson, 0.0))});
  std::stable_sort(budget.begin(), budget.end(),
                   [](const auto& a, const auto& b) { return a.young_modulus_percent > b.young_modulus_percent; });
  return budget;
}

}  // namespace palpate::estimation
