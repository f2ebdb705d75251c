// SPDX-License-Identifier: Apache-2.0
// Derivatives of contact states along a path of load increments: in each of them the implicit function theorem on body and
// tools together, with what points remember (anchors) carried on from the increment before.
//
//   R(u, z; a, theta) = 0,   friction limits mu p(u, z) inside R     =>   (S + B) d(u, z) = -dR/dtheta - dR/da da/dtheta
//
// S is the symmetric tangent at fixed limits, B what the limits of sliding points add, which is not symmetric: B is brought
// in by GMRES, preconditioned with the factor of S (Saad & Schultz 1986). The factor of a state nearby will do as well.
#pragma once

#include "palpate/fem/contact/contact_problem.hpp"

namespace palpate::fem {

/// Friction limits of sliding points that follow the pressures, as an operator (B above).
class SlidingLimits {
 public:
  SlidingLimits(const ContactSystem& system, const ContactProblem& p, const std::vector<TouchMemory>& memory,
                const ContactState& s);
  bool empty() const { return points_.empty(); }
  /// Adds B (du, twists) to forces on nodes (3n x q) and to the tools' gradients (6 x q, one a contact).
  void add(const MatrixX& du, const std::vector<MatrixX>& twist, MatrixX& forces, std::vector<MatrixX>& gradients) const;
  /// Solves (S + B) x = r along free axes; with the factor that is there (of this state or one nearby) where that takes few
  /// steps, else with a new one. @param tolerance  of what is left, relative
  /// @param factorisations  counted up @returns false where S has no factor
  bool solve(ContactSystem& system, const ContactTangent& t, const MatrixX& ru, const MatrixX& rz, MatrixX& du, MatrixX& dz,
             double tolerance, int* factorisations = nullptr) const;

 private:
  bool solve_by_krylov(ContactSystem& system, const ContactTangent& t, const MatrixX& ru, const MatrixX& rz, MatrixX& du,
                       MatrixX& dz, double tolerance, bool fresh, int most) const;
  struct Point {
    std::size_t contact;
    Index face;
    int point;
    Vec3 arm, along, slope;  // base axes: force = along (slope . (dx - dtip - turn x arm))
  };
  const ContactSystem& system_;
  std::vector<Point> points_;
};

/// Takes derivatives of a state on to the end of the next increment.
/// @param before  end of the increment before; @param from, to  derivatives of the loads at the two ends
void advance(ContactSystem& system, const ContactEquilibrium& at, const ContactIncrement& before,
             const ContactIncrement& after, const ContactLoadsAlong& from, const ContactLoadsAlong& to,
             ContactPathSensitivity& d);

/// All increments of a load step (ContactStatics::sensitivity_along).
ContactPathSensitivity path_sensitivity(ContactSystem& system, const ContactEquilibrium& at,
                                        const std::vector<ContactIncrement>& path, const ContactLoadsAlong& along,
                                        const ContactPathSensitivity& from);

/// ContactStatics::layer_travel_m.
VectorX layer_travel_of(ContactSystem& system, const ContactStatics& statics, const ContactEquilibrium& at);

/// ContactStatics::sensitivity.
ContactSensitivity sensitivity_of(ContactSystem& system, const ContactStatics& statics, const ContactEquilibrium& at);

}  // namespace palpate::fem
