// SPDX-License-Identifier: Apache-2.0
// One static analysis by CalculiX (ccx) of a mesh with held nodes and nodal forces, for tests to compare with.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/fem/materials.hpp"
#include "temporary_folder.hpp"

namespace palpate::fem {

inline bool calculix_is_there() { return std::system("command -v ccx > /dev/null 2>&1") == 0; }

/// Elements that are of another stuff than the rest.
struct CalculixPart {
  std::vector<Index> elements;
  double young_pa = 0, poisson = 0;
};

/// Displacements (3n, node-major; seven digits) of C3D4 or C3D10 elements, by the mesh's columns. Linear, or NLGEOM with its
/// Neo-Hookean law (C10 = mu / 2, D1 = 2 / K). NaN where ccx gave no result.
/// @param parts  of the body that are not of young_pa and poisson
inline VectorX calculix_displacements(const TetMesh& mesh, const std::vector<Index>& held, const VectorX& load,
                                      bool nonlinear, double young_pa, double poisson, const std::vector<CalculixPart>& parts = {}) {
  const auto nodes = mesh.tetrahedra.cols();
  const test::TemporaryFolder folder("ccx");
  {
    std::ofstream out(folder / "job.inp");
    out.precision(12);  // ccx reads 20 characters of a number
    out << "*NODE, NSET=ALL\n";
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
      out << i + 1 << ", " << mesh.nodes_m(i, 0) << ", " << mesh.nodes_m(i, 1) << ", " << mesh.nodes_m(i, 2) << "\n";
    out << "*ELEMENT, TYPE=C3D" << nodes << "\n";
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
      out << e + 1;
      for (int a = 0; a < nodes; ++a) out << ", " << mesh.tetrahedra(e, a) + 1;
      out << "\n";
    }
    std::vector<std::size_t> part_of(static_cast<std::size_t>(mesh.tetrahedra.rows()), 0);
    for (std::size_t p = 0; p < parts.size(); ++p)
      for (Index e : parts[p].elements) part_of[static_cast<std::size_t>(e)] = p + 1;
    for (std::size_t p = 0; p <= parts.size(); ++p) {
      out << "*ELSET, ELSET=PART" << p << "\n";
      for (std::size_t e = 0; e < part_of.size(); ++e)
        if (part_of[e] == p) out << e + 1 << ",\n";
      const double stiffness_pa = p ? parts[p - 1].young_pa : young_pa, nu = p ? parts[p - 1].poisson : poisson;
      const Moduli m = moduli(stiffness_pa, nu);
      out << "*MATERIAL, NAME=STUFF" << p << "\n";
      if (nonlinear)
        out << "*HYPERELASTIC, NEO HOOKE\n" << m.mu / 2 << ", " << 2 / (m.lambda + 2.0 / 3 * m.mu) << "\n";
      else
        out << "*ELASTIC\n" << stiffness_pa << ", " << nu << "\n";
      out << "*SOLID SECTION, ELSET=PART" << p << ", MATERIAL=STUFF" << p << "\n";
    }
    out << "*BOUNDARY\n";
    for (Index i : held) out << i + 1 << ", 1, 3, 0.\n";
    out << "*STEP" << (nonlinear ? ", NLGEOM, INC=200" : "") << "\n*STATIC\n" << (nonlinear ? "0.5, 1.\n" : "");
    if (nonlinear) out << "*CONTROLS, PARAMETERS=FIELD\n1.E-7, 1.E-7\n";
    out << "*CLOAD\n";
    for (Index d = 0; d < load.size(); ++d)
      if (load(d) != 0) out << d / 3 + 1 << ", " << d % 3 + 1 << ", " << load(d) << "\n";
    out << "*NODE PRINT, NSET=ALL, FREQUENCY=999999\nU\n*END STEP\n";
  }
  const std::string command = "cd '" + folder.path().string() + "' && OMP_NUM_THREADS=1 ccx job > log 2>&1";
  VectorX u = VectorX::Constant(3 * mesh.nodes_m.rows(), std::nan(""));
  if (std::system(command.c_str()) == 0) {
    std::ifstream in(folder / "job.dat");
    for (std::string line; std::getline(in, line);) {
      std::istringstream words(line);
      Index node = 0;
      Vec3 value;
      if (words >> node >> value.x() >> value.y() >> value.z()) u.segment<3>(3 * (node - 1)) = value;
    }
  }
  return u;
}

}  // namespace palpate::fem
