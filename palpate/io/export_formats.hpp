// SPDX-License-Identifier: Apache-2.0
// The writers behind exporters(). Inner header of the room `io`.
#pragma once

#include "palpate/io/exporters.hpp"

namespace palpate::io {

ExportFiles export_calculix(const ExportModel& model);
ExportFiles export_abaqus(const ExportModel& model);
ExportFiles export_febio(const ExportModel& model);
ExportFiles export_sofa(const ExportModel& model);
ExportFiles export_mujoco(const ExportModel& model);
ExportFiles export_drake(const ExportModel& model);
ExportFiles export_bullet(const ExportModel& model);
ExportFiles export_usd(const ExportModel& model);

struct LameConstants {
  double mu_pa = 0, lambda_pa = 0;
};
LameConstants lame_constants(double young_modulus_pa, double poisson_ratio);

/// Numbers with a separator, 17 digits.
std::string joined_indices(const std::vector<Index>& indices, const char* separator, Index first);
/// The mesh as legacy VTK, ASCII.
std::string ascii_vtk(const ExportModel& model);
/// The held nodes, one a line, for simulators whose file cannot hold them.
std::string held_nodes_file(const ExportModel& model);
/// Of a region, ascending.
std::vector<Index> elements_of(const ExportModel& model, std::size_t region);
/// The boundary as outward triangles.
Triangles export_surface(const ExportModel& model);

}  // namespace palpate::io
