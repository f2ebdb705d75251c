// SPDX-License-Identifier: Apache-2.0
// A true object of the lab of any shape: held by its supports, pressed at one site along one direction by a round soft pad.
// Solved on the lab's own mesh: quadratic, curved to the surface, fine under the pad; no estimator is given it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/lab/pressed.hpp"

namespace palpate::lab {

/// A part of other stiffness.
struct TrueRegion {
  Region region;
  double young_modulus_pa = 0;
};

struct PressedObjectOptions {
  TriMesh surface;                ///< base frame, closed
  /// Bonded planes and boxes; tables and walls that only push, smooth or with friction. Their tolerances are the lab's own
  /// business. What lies on a table or a wall at rest just touches it there.
  std::vector<Support> supports;
  Vec3 contact_m = Vec3::Zero();  ///< on the surface
  Vec3 direction = -Vec3::UnitZ();
  bool punch = false;         ///< a stiff flat face presses in place of a soft pad: contact is solved for
  double pad_radius_m = 0.02;
  std::string material = "neo_hookean";
  double young_modulus_pa = 15e3, poisson_ratio = 0.3;
  std::vector<double> extra;                         ///< further parameters of the material, in its table's order
  std::vector<TrueRegion> regions;                   ///< empty = young_modulus_pa everywhere
  /// A second pad that stands still at this place of the surface and presses back: nothing else holds the object then, and
  /// travel is by how much the pads come nearer. Supports must be empty.
  std::optional<Vec3> opposed_m;
  Index tetrahedra = 5000;                           ///< before refinement under the pad
  int cells_in_radius = 4;                           ///< edges across the pad's radius
};

/// With friction, what was pressed before counts: forces should rise from state to state, as on a robot's way in.
class PressedObject : public Pressed {
 public:
  /// @throws Error when the surface cannot be filled, or nothing holds it, or more than the opposed pad.
  explicit PressedObject(const PressedObjectOptions& options);
  ~PressedObject() override;
  void press(double force_n) override;
  double force_n() const override;
  double travel_m() const override;
  TriMesh surface() const override;
  Index nodes() const override;
  const TetMesh& mesh() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::lab
