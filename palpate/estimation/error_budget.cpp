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
  if (group.rfind("frame", 0) == 0) group.erase(5, std::min(group.find('_'), group.size()) - 5);  // "frame2_x": a step's second one
  if (group.size() > 2 && group[group.size() - 2] == '_' && group.back() >= 'x' && group.back() <= 'z') group.resize(group.size() - 2);
  return group;
}

struct Variances {
  VectorX log_young;  // a region
  double poisson = 0;
};

/// @param young  log_young_of_regions
Variances variances_without(const MatrixX& hessian, const MatrixX& young, const std::vector<int>& moving, const std::vector<bool>& known) {
  std::vector<Index> keep;
  for (std::size_t k = 0; k < moving.size(); ++k) {
    if (!known[k]) keep.push_back(static_cast<Index>(k));
  }
  const MatrixX kept = hessian(keep, keep), of_young = young(Eigen::all, keep);
  const MatrixX covariance = kept.ldlt().solve(MatrixX::Identity(kept.rows(), kept.cols()));
  const bool has_poisson = moving.size() > 1 && moving[1] == poisson;
  return {(of_young * covariance * of_young.transpose()).diagonal(), has_poisson ? covariance(1, 1) : 0};
}

double largest_share(const BudgetEntry& entry) {
  double largest = entry.young_modulus_percent;
  for (const RegionShare& share : entry.regions) largest = std::max(largest, share.young_modulus_percent);
  return largest;
}

}  // namespace

MatrixX with_bounded_poisson(MatrixX information, const std::vector<int>& moving, double poisson_std) {
  const auto nu = std::find(moving.begin(), moving.end(), static_cast<int>(poisson));
  if (nu == moving.end() || !(poisson_std > 0)) return information;
  const Index at = static_cast<Index>(nu - moving.begin());
  const double unbounded = information.ldlt().solve(VectorX::Unit(information.rows(), at))(at), bounded = poisson_std * poisson_std;
  if (bounded < unbounded) information(at, at) += 1 / bounded - 1 / unbounded;
  return information;
}

void sort_by_share(std::vector<BudgetEntry>& budget) {
  std::stable_sort(budget.begin(), budget.end(), [](const auto& a, const auto& b) { return largest_share(a) > largest_share(b); });
}

void set_young(BudgetEntry& entry, const VectorX& percent, const std::vector<std::string>& regions) {
  entry.young_modulus_percent = percent(0);
  entry.regions.clear();
  for (Index r = 0; percent.size() > 1 && r < percent.size(); ++r) entry.regions.push_back({regions.at(static_cast<std::size_t>(r)), percent(r)});
}

MatrixX log_young_of_regions(const Unknowns& unknowns, const std::vector<int>& moving) {
  MatrixX out = MatrixX::Zero(1 + unknowns.ratio_count(), static_cast<Index>(moving.size()));
  out.col(0).setOnes();
  for (std::size_t k = 0; k < moving.size(); ++k) {
    if (moving[k] >= first_ratio && moving[k] < unknowns.first_own_poisson()) out(1 + moving[k] - first_ratio, static_cast<Index>(k)) = 1;
  }
  return out;
}

std::vector<BudgetEntry> error_budget(const Unknowns& unknowns, const MatrixX& hessian, const std::vector<int>& moving,
                                      const std::vector<std::string>& regions) {
  std::map<std::string, std::vector<bool>> groups;
  std::vector<bool> all(moving.size(), false);
  for (std::size_t k = 0; k < moving.size(); ++k) {
    if (moving[k] < unknowns.parameter_count()) continue;
    auto& members = groups[group_of(unknowns[moving[k]].name)];
    members.resize(moving.size(), false);
    members[k] = true;
    all[k] = true;
  }
  const MatrixX young = log_young_of_regions(unknowns, moving);
  const Variances total = variances_without(hessian, young, moving, std::vector<bool>(moving.size(), false));
  std::vector<BudgetEntry> budget;
  for (const auto& [name, members] : groups) {
    const Variances known = variances_without(hessian, young, moving, members);
    BudgetEntry entry{name, 0, std::sqrt(std::max(total.poisson - known.poisson, 0.0))};
    set_young(entry, 100 * (total.log_young - known.log_young).cwiseMax(0).cwiseSqrt(), regions);
    budget.push_back(entry);
  }
  const Variances noise = variances_without(hessian, young, moving, all);
  BudgetEntry of_noise{"sensor noise", 0, std::sqrt(std::max(noise.poisson, 0.0))};
  set_young(of_noise, 100 * noise.log_young.cwiseMax(0).cwiseSqrt(), regions);
  budget.push_back(of_noise);
  sort_by_share(budget);
  return budget;
}

}  // namespace palpate::estimation
