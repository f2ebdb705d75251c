// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "palpate/core/identification.hpp"
#include "palpate/core/recording.hpp"
#include "palpate/identify.hpp"
#include "palpate/io/exporters.hpp"
#include "palpate/prediction/predict.hpp"

namespace palpate::cli {

/// What `palpate estimate` left in OUT: the answer, and the object as it was simulated (mesh, supports, tools, gravity).
struct LearnedObject {
  Identification answer;
  Recording object;  ///< rest.volume is the simulated mesh; no pushes
};

/// OUT/result.json, OUT/fit, OUT/model and OUT/report.html.
/// @param recording  that was identified
/// @throws Error where they cannot be written
void write_learned_object(const Identified& found, const Recording& recording, const std::filesystem::path& out);

/// @throws Error when OUT holds no result, or one without a model.
LearnedObject load_learned_object(const std::filesystem::path& out);

/// Of its parts too, with the region of every element of the simulated mesh.
/// @throws Error where the result tells other regions apart than the model
prediction::Elasticity elasticity_of(const LearnedObject& learned);

/// The axis (0, 1, 2) along which a frictionless support holds its nodes, which slide across it; nothing for other supports.
std::optional<int> slides_along(const Support& support);

/// As other simulators are to have it.
/// @param density_kg_m3  0: the recording's
/// @param gravity_m_s2   nothing: the recording's, where the object was measured without its weight
io::ExportModel export_model(const LearnedObject& learned, double density_kg_m3 = 0, const std::optional<Vec3>& gravity_m_s2 = {});

}  // namespace palpate::cli
