// SPDX-License-Identifier: Apache-2.0
// A true object of the lab: a soft cube bonded to a table, pressed from above by a round soft pad (uniform pressure).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/lab/pressed.hpp"

namespace palpate::lab {

struct PressedBlockOptions {
  double edge_m = 0.15;
  double pad_radius_m = 0.025;
  double site_m = 0.0;                       ///< of the pad's centre on the top face, along x from its middle
  Vec3 base_centre_m = Vec3(0.6, 0.0, 0.0);  ///< of the face on the table, base frame
  int cells_in_radius = 3;
  std::string material = "neo_hookean";
  double young_modulus_pa = 15e3, poisson_ratio = 0.3;
  std::vector<double> extra;  ///< further parameters of the material, in its table's order
};

/// Solved on half of the cube: the contact lies on its plane of symmetry, so the other half is a mirror image. Quadratic
/// elements on a mesh of the lab's own.
class PressedBlock : public Pressed {
 public:
  explicit PressedBlock(const PressedBlockOptions& options);
  ~PressedBlock() override;
  PressedBlock(PressedBlock&&) noexcept;
  PressedBlock& operator=(PressedBlock&&) noexcept;

  void press(double force_n) override;
  double force_n() const override;
  double travel_m() const override;
  TriMesh surface() const override;      ///< both halves
  const TetMesh& mesh() const override;  ///< of the half that is solved

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::lab
