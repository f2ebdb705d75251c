// SPDX-License-Identifier: Apache-2.0
// A true object of the lab: a soft cube bonded to a table, pressed from above by a round soft pad (uniform pressure).
#pragma once

#include <memory>
#include <string>

#include "palpate/core/mesh.hpp"

namespace palpate::lab {

struct PressedBlockOptions {
  double edge_m = 0.15;
  double pad_radius_m = 0.025;
  double site_m = 0.0;                       ///< of the pad's centre on the top face, along x from its middle
  Vec3 base_centre_m = Vec3(0.6, 0.0, 0.0);  ///< of the face on the table, base frame
  int cells_in_radius = 3;
  std::string material = "neo_hookean";
  double young_modulus_pa = 15e3, poisson_ratio = 0.3;
};

/// Solved on half of the cube: the contact lies on its plane of symmetry, so the other half is a mirror image. Quadratic
/// elements on a mesh of the lab's own.
class PressedBlock {
 public:
  explicit PressedBlock(const PressedBlockOptions& options);
  ~PressedBlock();
  PressedBlock(PressedBlock&&) noexcept;
  PressedBlock& operator=(PressedBlock&&) noexcept;

  /// Deforms the cube by a force (newton, downwards). Starts from the last state, extrapolated.
  /// @throws Error when it finds no equilibrium (a Neo-Hookean solid under a dead pressure beyond about 0.4 E caves in).
  void press(double force_n);

  double force_n() const;
  /// Mean motion of the pad's face into the cube.
  double travel_m() const;
  /// Both halves, deformed, in the base frame; the same triangles in every state.
  TriMesh surface() const;
  /// Of the half that is solved.
  const TetMesh& mesh() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::lab
