// SPDX-License-Identifier: Apache-2.0
// A learned object with what holds it and what presses it, as the fit had them: for a push that nobody has made yet.
#pragma once

#include <string>

#include "cli/learned_object.hpp"
#include "palpate/fem/statics.hpp"
#include "palpate/prediction/predict.hpp"

namespace palpate::cli {

struct PressedScene {
  fem::Boundary boundary;
  VectorX background;  ///< coefficients of the weight; empty: none acts
  prediction::Surroundings around;
  MatrixX free_motions;  ///< 3n x f: rigid motions that nothing holds
};

/// True for a tool whose motion was imposed when the object was learned: it moves as a rigid body.
bool moves_rigidly(const Identification& answer, const Tool& tool);

/// @param rigid  the tool moves along the load's direction; else the load's force is spread over its patch
/// @throws Error where weight acts and nobody says how heavy the object is
PressedScene pressed_scene(const LearnedObject& learned, const Tool& tool, const Load& load, bool rigid);

/// @throws Error for a push along a motion that nothing holds, or a weight that acts so
/// @param where  the field that says the direction, for the message
void must_be_held(const PressedScene& scene, const TetMesh& mesh, const Load& load, const std::string& where);

/// How much of a force on the object where the load acts is along motions that nothing holds, N; 0: it is held.
double unheld_n(const PressedScene& scene, const TetMesh& mesh, const Load& load, const Vec3& force_n);

}  // namespace palpate::cli
