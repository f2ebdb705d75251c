// SPDX-License-Identifier: Apache-2.0
// A true object of the lab: a soft block bonded to a table, pressed on its top or a side by a round soft pad (uniform pressure).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/lab/pressed.hpp"

namespace palpate::lab {

struct PressedBlockOptions {
  Vec3 size_m = Vec3::Constant(0.15);
  double pad_radius_m = 0.025;
  bool at_side = false;                      ///< pressed on the face that looks along -x; else on top
  double site_m = 0.0;                       ///< of the pad's centre: on top along x from its middle, at the side its height
  Vec3 direction = -Vec3::UnitZ();           ///< of the push, in the plane y = 0; at the side it must be given
  Vec3 base_centre_m = Vec3(0.6, 0.0, 0.0);  ///< of the face on the table, base frame
  int cells_in_radius = 3;
  double cell_share = 1;  ///< of the usual cells away from the pad: smaller is finer
  std::string material = "neo_hookean";
  double young_modulus_pa = 15e3, poisson_ratio = 0.3;
  std::vector<double> extra;  ///< further parameters of the material, in its table's order
};

/// Solved on half of the block: the contact lies on its plane of symmetry, so the other half is a mirror image. Quadratic
/// elements on a mesh of the lab's own.
class PressedBlock : public Pressed {
 public:
  /// @throws Error when the pad does not lie on the face with its whole radius, or would not press into it.
  explicit PressedBlock(const PressedBlockOptions& options);
  ~PressedBlock() override;
  PressedBlock(PressedBlock&&) noexcept;
  PressedBlock& operator=(PressedBlock&&) noexcept;

  void press(double force_n) override;
  bool follow(double force_n) override;
  double force_n() const override;
  double travel_m() const override;
  TriMesh surface() const override;      ///< both halves
  Index nodes() const override;
  const TetMesh& mesh() const;  ///< of the half that is solved

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::lab
