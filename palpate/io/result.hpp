// SPDX-License-Identifier: Apache-2.0
// What an identification leaves behind: result.json for programs, model/ for simulators, fit/ for figures.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "palpate/core/identification.hpp"

namespace palpate::io {

/// The object of result.json (docs/result-format.md). Numbers that are not known are NaN here and null in the file.
nlohmann::json result_json(const Identification& answer);

/// Writes FOLDER/result.json and FOLDER/fit/ (the rest surface as PLY; of each step the deformed surface, observed points,
/// residuals and stress as .npy), so that `read_result` gives everything back. Of an earlier result there all stays as it was until
/// everything is written; then its result.json goes first and the new one comes last, so that none stands beside what belongs to
/// another. Throws Error when that cannot be written.
/// @param model  a folder on the same disk whose files are moved into FOLDER/model, where there is one; result.json keeps the
///               SHA-256 of what they say of the object, for `check_model`
void write_result(const Identification& answer, const std::filesystem::path& folder, const std::filesystem::path& model = {});

/// Reads what write_result wrote; `folder` may also be the result.json itself. Surfaces and points come back in single
/// precision, and empty when fit/ is not there. Throws Error naming file and key.
Identification read_result(const std::filesystem::path& folder);

/// Results of versions that kept no SHA-256 pass. recording.yaml may be changed by hand (a density), and so may what is for other
/// programs. @throws Error naming both files where FOLDER/model is not the one that FOLDER/result.json was written with
void check_model(const std::filesystem::path& folder);

/// A simulation-ready model: FOLDER/object.vtu and object.msh (mesh; E and nu as cell data), surface.obj, and material.json
/// (law, small-strain E and nu with intervals, Lame parameters, bulk modulus, density if the answer knows it).
/// @param region  an element: which of the answer's Young's moduli, in their order; empty: the object has one
void write_model(const Identification& answer, const TetMesh& volume, const std::filesystem::path& folder,
                 const std::vector<int>& region = {});

}  // namespace palpate::io
