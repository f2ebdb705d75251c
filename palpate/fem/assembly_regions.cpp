// SPDX-License-Identifier: Apache-2.0
// Regions of other moduli: what each weighs, and what it weighs where dilatations are averaged.
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/fem/assembly.hpp"

namespace palpate::fem {

void Assembly::set_region_stiffness(const VectorX& stiffness) {
  if (stiffness.size() != stiffness_.size() || !stiffness.allFinite() || (stiffness.size() > 0 && !(stiffness.minCoeff() > 0)))
    throw Error("needs one positive number for each of " + std::to_string(stiffness_.size()) + " regions",
                "StaticsOptions.region_stiffness");
  if (stiffness == stiffness_) return;
  stiffness_ = stiffness;
  const std::size_t points = weights_.size() / region_.size();
  for (std::size_t k = 0; k < weights_.size(); ++k) weights_[k] = stiffness_(region_[k / points]) * volumes_[k];
  weigh_dilatations();
}

void Assembly::weigh_dilatations() const {
  for (Patch& patch : patches_) patch.volume = 0;
  for (std::size_t e = 0; e < patch_of_.size(); ++e) patches_[patch_of_[e]].volume += bulk_weight(static_cast<Index>(e)) * weights_[e];
  if (pressures_ > 0) factorise_pressure_mass();
}

void Assembly::set_region_poisson(const VectorX& poisson) {
  const bool sizes_fit = poisson.size() == 0 || poisson.size() == stiffness_.size();
  if (!sizes_fit || (poisson.array() <= -1 || poisson.array() >= 0.5 || poisson.array().isInf()).any())
    throw Error("needs a Poisson ratio in (-1, 0.5), or NaN, for each of " + std::to_string(stiffness_.size()) + " regions",
                "StaticsOptions.region_poisson");
  const bool own = poisson.size() > 0 && !poisson.array().isNaN().all();
  region_poisson_ = own ? poisson : VectorX();
  if (own || bulk_share_.size() == 0) return;
  bulk_share_.resize(0);
  weigh_dilatations();
}

void Assembly::prepare_regions(const MaterialLaw& law, const Moduli& m) const {
  const Index regions = static_cast<Index>(region_poisson_.size());
  if (regions == 0) return;
  region_moduli_.assign(static_cast<std::size_t>(regions), m);
  for (Index r = 0; r < regions; ++r)
    if (!std::isnan(region_poisson_(r))) region_moduli_[static_cast<std::size_t>(r)] = moduli(m.young_pa, region_poisson_(r), m.extra);
  VolumetricPart part;
  if ((patches_.empty() && pressures_ == 0) || !law.volumetric_part(m, Mat3::Zero(), false, part)) return;
  VectorX bulk_pa(regions);
  for (Index r = 0; r < regions; ++r) {
    law.volumetric_part(region_moduli_[static_cast<std::size_t>(r)], Mat3::Zero(), false, part);
    bulk_pa(r) = part.modulus;
  }
  if (bulk_pa.minCoeff() < 0)
    throw Error("a region whose volume term is negative (nu below 0) does not go with regions of another nu where dilatations are averaged",
                "StaticsOptions.region_poisson");
  bulk_pa_ = bulk_pa.maxCoeff();
  // A region without a volume term weighs nothing; what little it is given keeps the projection regular.
  constexpr double least = 1e-9;
  const VectorX share = bulk_pa_ > 0 ? VectorX((bulk_pa / bulk_pa_).cwiseMax(least)) : VectorX::Ones(regions);
  if (bulk_share_.size() == share.size() && bulk_share_ == share) return;
  bulk_share_ = share;
  weigh_dilatations();
}

}  // namespace palpate::fem
