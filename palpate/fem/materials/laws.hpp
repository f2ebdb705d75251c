// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/fem/materials.hpp"

namespace palpate::fem {

const MaterialLaw& linear_law();
const MaterialLaw& corotational_law();
const MaterialLaw& st_venant_kirchhoff_law();
const MaterialLaw& neo_hookean_law();
const MaterialLaw& neo_hookean_stable_law();
const MaterialLaw& neo_hookean_isochoric_law();
const MaterialLaw& foam_law();

}  // namespace palpate::fem
