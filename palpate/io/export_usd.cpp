// SPDX-License-Identifier: Apache-2.0
// USD: a tetrahedral mesh with the volume deformable schemas of UsdPhysics and its material.
#include <fmt/format.h>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {

ExportFiles export_usd(const ExportModel& model) {
  const auto& mesh = model.mesh;
  std::string points, tets, faces;
  for (Eigen::Index i = 0; i < mesh.nodes_m.rows(); ++i)
    points += fmt::format("{}({:.9g}, {:.9g}, {:.9g})", i > 0 ? ", " : "", mesh.nodes_m(i, 0), mesh.nodes_m(i, 1),
                          mesh.nodes_m(i, 2));
  for (Eigen::Index t = 0; t < mesh.tetrahedra.rows(); ++t) {
    const auto tet = mesh.tetrahedra.row(t);
    tets += fmt::format("{}({}, {}, {}, {})", t > 0 ? ", " : "", tet(0), tet(1), tet(2), tet(3));
  }
  const Triangles surface = export_surface(model);
  for (Eigen::Index t = 0; t < surface.rows(); ++t)
    faces += fmt::format("{}({}, {}, {})", t > 0 ? ", " : "", surface(t, 0), surface(t, 1), surface(t, 2));
  const std::string text = fmt::format(
      "#usda 1.0\n(\n    defaultPrim = \"Object\"\n    metersPerUnit = 1\n    kilogramsPerUnit = 1\n    upAxis = "
      "\"Z\"\n)\n\n"
      "def Xform \"Object\"\n{{\n    def TetMesh \"Mesh\" (\n        prepend apiSchemas = "
      "[\"PhysicsVolumeDeformableSimAPI\", \"PhysicsDeformableBodyAPI\", \"PhysicsCollisionAPI\", \"MaterialBindingAPI\"]\n    )\n    {{\n"
      "        point3f[] points = [{}]\n        int4[] tetVertexIndices = [{}]\n        int3[] surfaceFaceVertexIndices = "
      "[{}]\n"
      "        rel material:binding:physics = </Object/Material>\n    }}\n\n"
      "    def Material \"Material\" (\n        prepend apiSchemas = [\"PhysicsVolumeDeformableMaterialAPI\"]\n    )\n    "
      "{{\n"
      "        float physics:youngsModulus = {:.9g}\n        float physics:poissonsRatio = {:.9g}\n        float "
      "physics:density = {:.9g}\n    }}\n}}\n",
      points, tets, faces, model.young_modulus_pa, model.poisson_ratio, model.density_kg_m3);
  ExportFiles files = {{"object.usda", text}};
  if (!model.fixed.empty()) files["held_nodes.txt"] = held_nodes_file(model);
  return files;
}

}  // namespace palpate::io
