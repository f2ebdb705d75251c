// SPDX-License-Identifier: Apache-2.0
// PyBullet. The first Piola-Kirchhoff stress of its Neo-Hookean law is, at small strains, that of mu' = 3/4 mu and lambda' =
// lambda - 5/8 mu (mu, lambda as given), so that mu = 4/3 mu' and lambda = lambda' + 5/6 mu' are given for the learned pair.
#include <fmt/format.h>

#include "palpate/io/export_formats.hpp"

namespace palpate::io {

ExportFiles export_bullet(const ExportModel& model) {
  const LameConstants lame = lame_constants(model.young_modulus_pa, model.poisson_ratio);
  double volume = 0;
  for (Eigen::Index t = 0; t < model.mesh.tetrahedra.rows(); ++t) {
    const auto corner = [&](Eigen::Index k) { return Vec3(model.mesh.nodes_m.row(model.mesh.tetrahedra(t, k))); };
    volume += (corner(1) - corner(0)).cross(corner(2) - corner(0)).dot(corner(3) - corner(0)) / 6;
  }
  std::string text = fmt::format(
      "# E = {:.15g} Pa, nu = {:.15g}; the constants below make Bullet's law agree with them at small strains.\n"
      "import pybullet as p\n\n\ndef load_object(file=\"object.vtk\"):\n"
      "    \"\"\"After p.resetSimulation(p.RESET_USE_DEFORMABLE_WORLD); returns the body.\"\"\"\n"
      "    body = p.loadSoftBody(\n        file,\n        simFileName=file,\n        mass={:.15g},\n        "
      "useNeoHookean=1,\n"
      "        NeoHookeanMu={:.15g},\n        NeoHookeanLambda={:.15g},\n        NeoHookeanDamping=0.01,\n        "
      "collisionMargin=0.001,\n    )\n",
      model.young_modulus_pa, model.poisson_ratio, model.density_kg_m3 * volume, lame.mu_pa * 4 / 3,
      lame.lambda_pa + 5 * lame.mu_pa / 6);
  const Vec3& g = model.gravity_m_s2;
  text += fmt::format("    p.setGravity({:.15g}, {:.15g}, {:.15g})\n", g.x(), g.y(), g.z());
  text += "    for node in [" + joined_indices(model.fixed, ", ", 0) +
          "]:\n        p.createSoftBodyAnchor(body, node, -1, -1)\n    return body\n";
  return {{"object.py", text}, {"object.vtk", ascii_vtk(model)}};
}

}  // namespace palpate::io
