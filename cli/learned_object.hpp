// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/prediction/predict.hpp"

namespace palpate::cli {

/// What `palpate estimate` left in OUT: the answer, and the object as it was simulated (mesh, supports, tools, gravity).
struct LearnedObject {
  Identification answer;
  Recording object;  ///< rest.volume is the simulated mesh; no pushes
};

/// @throws Error when OUT holds no result, or one without a model.
LearnedObject load_learned_object(const std::filesystem::path& out);

/// Of its parts too, with the region of every element of the simulated mesh.
/// @throws Error where the result tells other regions apart than the model
prediction::Elasticity elasticity_of(const LearnedObject& learned);

/// Nodes that supports hold altogether (bonded ones).
std::vector<Index> held_nodes(const Recording& object);

}  // namespace palpate::cli
