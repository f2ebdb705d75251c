// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/mesh.hpp"

namespace palpate::lab {

/// A true object under a pad: what the lab's robot presses.
class Pressed {
 public:
  virtual ~Pressed() = default;
  /// Deforms the object by a force (newton, along the pad's direction). Starts from the last state, extrapolated.
  /// @throws Error when it finds no equilibrium (a Neo-Hookean solid under a dead pressure beyond about 0.4 E caves in).
  virtual void press(double force_n) = 0;
  /// The same where it is a short way from the last state; false: it is not, and the object is as it was. Of an object whose states
  /// are far apart (folds) a smaller step may be one.
  virtual bool follow(double force_n) {
    press(force_n);
    return true;
  }
  virtual double force_n() const = 0;
  /// Mean motion of the patch under the pad along the pad's direction (work-conjugate to the force).
  virtual double travel_m() const = 0;
  /// Deformed, base frame; the same triangles in every state.
  virtual TriMesh surface() const = 0;
  /// Of what is solved.
  virtual Index nodes() const = 0;
};

}  // namespace palpate::lab
