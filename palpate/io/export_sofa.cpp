// SPDX-License-Identifier: Apache-2.0
// SOFA scene: TetrahedronFEMForceField with method "large" turns each element's frame with it, the model of Frank et al.
#include <fmt/format.h>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {
namespace {

/// One number for all elements, or one for each.
std::string by_element(const ExportModel& model, double whole, double ExportRegion::* of_region) {
  if (model.regions.empty()) return fmt::format("{:.15g}", whole);
  std::string numbers;
  for (const int r : model.region) numbers += fmt::format("{}{:.15g}", numbers.empty() ? "" : " ", model.regions[static_cast<std::size_t>(r)].*of_region);
  return numbers;
}

}  // namespace

ExportFiles export_sofa(const ExportModel& model) {
  const Vec3& g = model.gravity_m_s2;
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<Node name=\"root\" dt=\"0.01\" gravity=\"{:.15g} {:.15g} {:.15g}\">\n"
      "  <RequiredPlugin name=\"Sofa.Component\"/>\n  <DefaultAnimationLoop/>\n  <VisualStyle "
      "displayFlags=\"showForceFields\"/>\n"
      "  <Node name=\"object\">\n    <EulerImplicitSolver rayleighStiffness=\"0.01\" rayleighMass=\"0.1\"/>\n"
      "    <SparseLDLSolver template=\"CompressedRowSparseMatrixMat3x3d\"/>\n"
      "    <MeshVTKLoader name=\"loader\" filename=\"object.vtk\"/>\n"
      "    <TetrahedronSetTopologyContainer name=\"topology\" src=\"@loader\"/>\n"
      "    <TetrahedronSetGeometryAlgorithms template=\"Vec3d\"/>\n    <MechanicalObject name=\"nodes\" "
      "template=\"Vec3d\"/>\n"
      "    <MeshMatrixMass massDensity=\"{:.15g}\"/>\n"
      "    <TetrahedronFEMForceField template=\"Vec3d\" method=\"large\" youngModulus=\"{}\" "
      "poissonRatio=\"{}\"/>\n",
      g.x(), g.y(), g.z(), model.density_kg_m3, by_element(model, model.young_modulus_pa, &ExportRegion::young_modulus_pa),
      by_element(model, model.poisson_ratio, &ExportRegion::poisson_ratio));
  if (!model.fixed.empty())
    text += "    <FixedProjectiveConstraint indices=\"" + joined_indices(model.fixed, " ", 0) + "\"/>\n";
  if (!model.forces_n.empty()) {
    std::string nodes, forces;
    for (const auto& [node, force] : model.forces_n) {
      nodes += (nodes.empty() ? "" : " ") + std::to_string(node);
      forces += fmt::format("{}{:.15g} {:.15g} {:.15g}", forces.empty() ? "" : " ", force.x(), force.y(), force.z());
    }
    text += "    <ConstantForceField indices=\"" + nodes + "\" forces=\"" + forces + "\"/>\n";
  }
  return {{"object.scn", text + "  </Node>\n</Node>\n"}, {"object.vtk", ascii_vtk(model)}};
}

}  // namespace palpate::io
