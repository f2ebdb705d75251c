// SPDX-License-Identifier: Apache-2.0
// A learned object as the files of a simulator, with all that its user must be told: for the program and for Python.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/export_checks.hpp"

namespace palpate::cli {

struct ExportChoice {
  double density_kg_m3 = 0;         ///< 0: the recording's
  std::optional<Vec3> gravity_m_s2;  ///< nothing: the recording's, where the object was measured without its weight
  io::LinearElements elements = io::LinearElements::split;
};

struct ExportedObject {
  io::ExportModel model;    ///< as it was learned
  io::ExportModel written;  ///< with the elements and the law that were written
  io::ExportFiles files;
  std::string law;  ///< that is written; empty: the reader's choice
  std::optional<LawComparison> laws;
  std::optional<double> stiffer;  ///< the written elements, against those that were fitted (0.05: 5 %)
  bool holds = false;             ///< the files themselves hold the held nodes
  std::vector<std::string> notes, warnings;
};

/// @throws Error where io::export_files does
ExportedObject exported_object(const LearnedObject& learned, const io::Exporter& exporter, const ExportChoice& choice, int threads);

}  // namespace palpate::cli
