// SPDX-License-Identifier: Apache-2.0
// A body under a push that one number drives: the force on a patch, or the way of a tool that moves as a rigid body. Force and travel
// follow from it. Not for other rooms.
#pragma once

#include <string>

#include "palpate/fem/response.hpp"
#include "palpate/prediction/predict.hpp"

namespace palpate::prediction {

/// A number with its derivatives to the moduli, then to what drives the push.
struct Reading {
  double value = 0;
  VectorX d;
  VectorX by_moduli() const { return d.head(d.size() - 1); }
  double by_control() const { return d(d.size() - 1); }
};

struct PressedState {
  bool converged = false;
  std::string reason;
  int inverted_elements = 0;
  Reading force_n, travel_m;  ///< along the push; the travel since the state before it
  Vec3 pressed_n = Vec3::Zero();
  VectorX displacement_m;                              ///< 3n, from rest
  MatrixX d_displacement;                              ///< 3n x (moduli, control)
  Eigen::Matrix<double, 3, Eigen::Dynamic> d_pressed;  ///< the same
  double along_m = 0;                                  ///< the patch's mean motion along the push, from rest
  VectorX d_along;
  fem::ResponseSolutionPtr solution;  ///< nothing: rest
};

class PressedBody {
 public:
  /// @throws Error where boundary, background or covariance do not fit
  PressedBody(const TetMesh& mesh, const Elasticity& elasticity, fem::Boundary boundary, const NewPush& push,
              fem::StaticsOptions options, Surroundings around);

  bool touches() const { return !around_.contacts.empty(); }
  /// True where the push's force (else its travel) is the number that drives it.
  bool drives(bool force) const { return force ? !moves_tool_ : moves_tool_ && !around_.gives_way.moves(); }
  /// Under the background alone; nothing is solved where there is none and something touches.
  const PressedState& before() const { return before_; }
  /// @param warm  a state nearby, which saves work
  PressedState solve(double control, const PressedState& warm) const;
  /// Of the force (else the travel): what may drive the push to there.
  double first_guess(bool force, double value, const PressedState& before) const;
  const RigidWay& gives_way() const { return around_.gives_way; }

 private:
  fem::ResponseQuery query(double control, double share) const;
  PressedState read(const fem::ResponseState& at, double control, double share) const;
  PressedState at_rest() const;

  Surroundings around_;
  NewPush push_;
  Elasticity elasticity_;
  bool moves_tool_, path_ = false;
  Index nodes_, moduli_, columns_, motions_, moved_ = -1;  // moved_: the motion that is the tool's
  double half_space_n_m_;
  fem::Response response_;
  PressedState before_;
};

}  // namespace palpate::prediction
