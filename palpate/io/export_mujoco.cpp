// SPDX-License-Identifier: Apache-2.0
// MuJoCo flex (3.13 or later). Its St. Venant-Kirchhoff energy holds lambda where ours holds lambda / 2, so that E and nu
// given as they are make the object too stiff. The pair (E', nu') with mu' = mu and 2 lambda' = lambda is
//   nu' = nu / (2 (1 - nu)),  E' = E (1 + nu') / (1 + nu).
// The mesh is Gmsh 4.1 ASCII with one block of nodes and one of tetrahedra, tags from 1: what its reader takes.
#include <fmt/format.h>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {
namespace {

std::string one_block_msh(const ExportModel& model) {
  const auto& mesh = model.mesh;
  const Eigen::Index nodes = mesh.nodes_m.rows(), cells = mesh.tetrahedra.rows();
  std::string text = fmt::format("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {0} 1 {0}\n3 1 0 {0}\n", nodes);
  for (Eigen::Index i = 0; i < nodes; ++i) text += fmt::format("{}\n", i + 1);
  for (Eigen::Index i = 0; i < nodes; ++i)
    text += fmt::format("{:.15g} {:.15g} {:.15g}\n", mesh.nodes_m(i, 0), mesh.nodes_m(i, 1), mesh.nodes_m(i, 2));
  text += fmt::format("$EndNodes\n$Elements\n1 {0} 1 {0}\n3 1 4 {0}\n", cells);
  for (Eigen::Index t = 0; t < cells; ++t) {
    const auto tet = mesh.tetrahedra.row(t);
    text += fmt::format("{} {} {} {} {}\n", t + 1, tet(0) + 1, tet(1) + 1, tet(2) + 1, tet(3) + 1);
  }
  return text + "$EndElements\n";
}

double volume_m3(const TetMesh& mesh) {
  double volume = 0;
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    const auto corner = [&](Eigen::Index k) { return Vec3(mesh.nodes_m.row(mesh.tetrahedra(t, k))); };
    volume += (corner(1) - corner(0)).cross(corner(2) - corner(0)).dot(corner(3) - corner(0)) / 6;
  }
  return volume;
}

}  // namespace

ExportFiles export_mujoco(const ExportModel& model) {
  const double nu = model.poisson_ratio / (2 * (1 - model.poisson_ratio));
  const double young = model.young_modulus_pa * (1 + nu) / (1 + model.poisson_ratio);
  const Vec3& g = model.gravity_m_s2;
  std::string text = fmt::format(
      "<mujoco model=\"{}\">\n  <!-- E' and nu' below stand for E = {:.15g} Pa, nu = {:.15g} -->\n"
      "  <option gravity=\"{:.15g} {:.15g} {:.15g}\" timestep=\"0.001\" solver=\"CG\" tolerance=\"1e-10\" "
      "integrator=\"discrete\"/>\n"
      "  <size memory=\"200M\"/>\n  <worldbody>\n    <flexcomp name=\"object\" type=\"gmsh\" dim=\"3\" file=\"object.msh\" "
      "mass=\"{:.15g}\" radius=\"0.0005\">\n"
      "      <elasticity young=\"{:.15g}\" poisson=\"{:.15g}\" damping=\"0.002\"/>\n      <contact selfcollide=\"none\" "
      "internal=\"false\"/>\n",
      model.name, model.young_modulus_pa, model.poisson_ratio, g.x(), g.y(), g.z(),
      model.density_kg_m3 * volume_m3(model.mesh), young, nu);
  if (!model.fixed.empty()) text += "      <pin id=\"" + joined_indices(model.fixed, " ", 0) + "\"/>\n";
  return {{"object.xml", text + "    </flexcomp>\n  </worldbody>\n</mujoco>\n"}, {"object.msh", one_block_msh(model)}};
}

}  // namespace palpate::io
