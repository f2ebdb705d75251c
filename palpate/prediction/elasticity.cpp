// SPDX-License-Identifier: Apache-2.0
// The moduli of an answer with the covariance that a prediction carries on.
#include <algorithm>
#include <limits>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/prediction/predict.hpp"

namespace palpate::prediction {

double Elasticity::young_modulus_of(Index of) const { return region_stiffness(of) * young_modulus_pa; }

double Elasticity::poisson_ratio_of(Index of) const {
  return of > 0 && region_poisson.size() > 0 ? region_poisson(of) : poisson_ratio;
}

double Elasticity::highest_young_modulus_pa() const {
  return young_modulus_pa * (region_stiffness.size() > 0 ? std::max(1.0, region_stiffness.maxCoeff()) : 1.0);
}

double Elasticity::highest_poisson_ratio() const {
  return region_poisson.size() > 1 ? std::max(poisson_ratio, region_poisson.tail(region_poisson.size() - 1).maxCoeff()) : poisson_ratio;
}

Elasticity elasticity_of(const Identification& answer) {
  Elasticity elasticity;
  elasticity.material = answer.material;
  std::vector<Index> young, poisson;  // places among the parameters
  std::vector<double> extra;
  const auto value = [&](Index at) { return answer.parameters[static_cast<std::size_t>(at)].value; };
  for (std::size_t i = 0; i < answer.parameters.size(); ++i) {
    const Parameter& one = answer.parameters[i];
    if (one.name == "young_modulus")
      young.push_back(static_cast<Index>(i));
    else if (one.name == "poisson_ratio")
      poisson.push_back(static_cast<Index>(i));
    else if (one.region.empty())
      extra.push_back(one.value);
  }
  if (young.empty() || poisson.empty() || (poisson.size() > 1 && poisson.size() != young.size()))
    throw Error("holds no Young's modulus and Poisson ratio of the whole object, or of all its regions", "result: parameters");
  const Index regions = static_cast<Index>(young.size());
  elasticity.young_modulus_pa = value(young[0]);
  elasticity.poisson_ratio = value(poisson[0]);
  if (regions > 1) {
    elasticity.region_stiffness.resize(regions);
    for (Index r = 0; r < regions; ++r) {
      const Index at = young[static_cast<std::size_t>(r)];
      elasticity.regions.push_back(answer.parameters[static_cast<std::size_t>(at)].region);
      elasticity.region_stiffness(r) = value(at) / elasticity.young_modulus_pa;
    }
  }
  if (poisson.size() > 1) {
    elasticity.region_poisson = VectorX::Constant(regions, std::numeric_limits<double>::quiet_NaN());
    for (Index r = 1; r < regions; ++r) elasticity.region_poisson(r) = value(poisson[static_cast<std::size_t>(r)]);
  }
  elasticity.extra = Eigen::Map<const VectorX>(extra.data(), Index(extra.size()));
  // Of log E of each region, as an answer has it, to ratios.
  std::vector<Index> places{young[0], poisson[0]};
  places.insert(places.end(), young.begin() + 1, young.end());
  places.insert(places.end(), poisson.begin() + 1, poisson.end());
  const Index size = static_cast<Index>(places.size());
  elasticity.covariance = MatrixX::Zero(size, size);
  if (*std::max_element(places.begin(), places.end()) >= answer.covariance.rows()) return elasticity;
  MatrixX over_first = MatrixX::Identity(size, size);
  over_first.block(2, 0, regions - 1, 1).setConstant(-1);
  elasticity.covariance = over_first * MatrixX(answer.covariance(places, places)) * over_first.transpose();
  if (!elasticity.covariance.allFinite()) elasticity.covariance.setZero();
  return elasticity;
}

}  // namespace palpate::prediction
