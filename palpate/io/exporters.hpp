// SPDX-License-Identifier: Apache-2.0
// The learned object for other simulators. An exporter is one file export_NAME.cpp and one line in the table of
// exporters.cpp; the contract test and the command line loop over the table.
#pragma once

#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "palpate/core/mesh.hpp"

namespace palpate::io {

/// A part of the object with moduli of its own.
struct ExportRegion {
  std::string name;
  double young_modulus_pa = 0, poisson_ratio = 0;
};

/// What a simulator needs of an object. E and nu are those of small strains.
struct ExportModel {
  std::string name = "object";
  std::string law = "linear";  ///< that it was learned with; what a writer is given: that it is to write (written_law)
  VectorX law_parameters;      ///< the law's further ones (alpha of foam)
  TetMesh mesh;  ///< linear or quadratic
  double young_modulus_pa = 0, poisson_ratio = 0;  ///< in regions: the first one's
  std::vector<ExportRegion> regions;               ///< empty: one
  std::vector<int> region;                         ///< an element: its region; empty: one
  double density_kg_m3 = 0;  ///< 0 = unknown
  std::vector<Index> fixed;  ///< nodes that supports hold
  Vec3 gravity_m_s2 = Vec3::Zero();
  std::vector<std::pair<Index, Vec3>> forces_n;  ///< at nodes: a load to try the model with; static solvers take it
};

using ExportFiles =
    std::map<std::string, std::string>;  ///< file name -> bytes; the first to open stands in Exporter::main_file

struct Exporter {
  std::string name;            ///< "calculix"
  std::string main_file;       ///< what to open, e.g. "object.inp"
  std::string about;           ///< what is written, and what was done so that E and nu mean there what they mean here
  /// Laws of palpate's that its file holds as they are; an object that was learned with another gets the first. Empty: the
  /// file names none, and whoever reads it chooses.
  std::vector<std::string> laws = {};
  bool quadratic = false;      ///< takes ten-node tetrahedra; others get the corners
  bool needs_density = false;  ///< simulates motion
  bool by_region = false;      ///< takes regions of different moduli
  ExportFiles (*write)(const ExportModel& model) = nullptr;
};

std::span<const Exporter> exporters();
/// @throws Error that lists the table's names.
const Exporter& exporter_named(const std::string& name);

/// The law that the simulator is given of an object that was learned with `learned`; empty: the reader's choice.
std::string written_law(const Exporter& exporter, const std::string& learned);

/// Checks the model, gives the exporter what it takes and returns its files.
/// @throws Error for E <= 0, nu outside [0, 0.5), a missing density where one is needed, no tetrahedra, indices out of
/// range, regions that do not fit the elements or that the simulator does not take (naming those that do).
ExportFiles export_files(const Exporter& exporter, const ExportModel& model);

/// Corners of quadratic tetrahedra alone, nodes renumbered; `fixed` and loads that name midpoints go to the edge's ends.
ExportModel with_linear_elements(const ExportModel& model);

}  // namespace palpate::io
