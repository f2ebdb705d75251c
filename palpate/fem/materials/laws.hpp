// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/fem/materials.hpp"

namespace palpate::fem {

const MaterialLaw& linear_law();
const MaterialLaw& corotational_law();
const MaterialLaw& neo_hookean_law();

}  // namespace palpate::fem
