// SPDX-License-Identifier: Apache-2.0
// Answers on disk: result.json and the simulation-ready model.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "palpate/core/identification.hpp"
#include "palpate/core/mesh.hpp"

namespace palpate::io {

/// The object of result.json (format palpate-result/1). What was not measured (NaN) is null.
nlohmann::json result_json(const Identification& answer);

/// Writes FOLDER/result.json, whole or not at all; makes the folder. @throws Error when it cannot be written.
void write_result(const Identification& answer, const std::filesystem::path& folder);

/// Writes FOLDER/mesh.vtu, mesh.msh and material.json (small-strain E, nu, law): what a simulator needs.
void write_model(const Identification& answer, const TetMesh& volume, const std::filesystem::path& folder);

}  // namespace palpate::io
