// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"

namespace palpate::cli {

/// What `palpate estimate` left in OUT: the answer, and the object as it was simulated (mesh, supports, tools, gravity).
struct LearnedObject {
  Identification answer;
  Recording object;  ///< rest.volume is the simulated mesh; no pushes
};

/// @throws Error when OUT holds no result, or one without a model.
LearnedObject load_learned_object(const std::filesystem::path& out);

/// Nodes that supports hold altogether (bonded ones).
std::vector<Index> held_nodes(const Recording& object);

}  // namespace palpate::cli
