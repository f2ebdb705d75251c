// SPDX-License-Identifier: Apache-2.0
// A true object of the lab that is no solid: a thin inflated skin, glued to the table at its foot and pressed at its top by a
// round soft pad. It has no Young's modulus that a solid model could find; what it has is its skin's.
#pragma once

#include <memory>

#include "palpate/core/mesh.hpp"
#include "palpate/lab/pressed.hpp"

namespace palpate::lab {

struct PressedBalloonOptions {
  double radius_m = 0.075;              ///< inflated
  double centre_height_m = 0.068;       ///< over the table: what lies below is glued to it
  double stretch = 2;                   ///< of the inflated skin, both ways alike
  double thickness_m = 0.0003;          ///< of the skin before it was inflated
  double young_modulus_pa = 1e6;        ///< of the skin: incompressible, Neo-Hookean
  double air_pa = 101325;               ///< around it; inside, pressure times volume stays what it was (slow pushes)
  double pad_radius_m = 0.018;
  Vec3 base_centre_m = Vec3(0.6, 0.0, 0.0);
  int elements = 240;                   ///< along the meridian
  int sides = 96;                       ///< of the surface's rings
};

/// Axially symmetric membrane (no bending stiffness), linear elements along the meridian, Newton on the energy of skin, air
/// and the pad's dead load. Where the skin is shorter around than it wants to be it wrinkles and bears nothing that way
/// (tension field: Pipkin 1986, IMA J. Appl. Math. 36, 85).
class PressedBalloon : public Pressed {
 public:
  /// @throws Error naming the option that is out of range.
  explicit PressedBalloon(const PressedBalloonOptions& options = {});
  ~PressedBalloon() override;
  void press(double force_n) override;
  double force_n() const override;
  double travel_m() const override;
  TriMesh surface() const override;
  Index nodes() const override;

  /// Of the air inside over that around it, now.
  double pressure_pa() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::lab
