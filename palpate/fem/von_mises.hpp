// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/core/mesh.hpp"

namespace palpate::fem {

/// Von Mises stress at the nodes, Pa: Cauchy stress at the elements' quadrature points, averaged by volume.
/// @param extra           the material's further parameters; empty: their initial values
/// @param displacement_m  3n, node-major
/// @param stiffness       an element: its E over the one given (regions of other stiffness); empty: 1
/// @param poisson         an element: its nu; empty: the one given
VectorX von_mises(const TetMesh& mesh, const std::string& material, double young_modulus_pa, double poisson_ratio,
                  const VectorX& extra, const VectorX& displacement_m, const VectorX& stiffness = {}, const VectorX& poisson = {});

}  // namespace palpate::fem
