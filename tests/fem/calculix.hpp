// SPDX-License-Identifier: Apache-2.0
// One static analysis by CalculiX (ccx) of a mesh with held nodes and nodal forces, for tests to compare with.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "palpate/core/mesh.hpp"
#include "palpate/fem/materials.hpp"
#include "temporary_folder.hpp"

namespace palpate::fem {

inline bool calculix_is_there() { return std::system("command -v ccx > /dev/null 2>&1") == 0; }

/// Displacements (3n, node-major; seven digits) of C3D4 or C3D10 elements, by the mesh's columns. Linear, or NLGEOM with its
/// Neo-Hookean law (C10 = mu / 2, D1 = 2 / K). NaN where ccx gave no result.
/// @param other, other_young_pa, other_poisson  elements that are of another E, and nu where one is given
inline VectorX calculix_displacements(const TetMesh& mesh, const std::vector<Index>& held, const VectorX& load,
                                      bool nonlinear, double young_pa, double poisson, const std::vector<Index>& other = {},
                                      double other_young_pa = 0, std::optional<double> other_poisson = std::nullopt) {
  const auto nodes = mesh.tetrahedra.cols();
  const test::TemporaryFolder folder("ccx");
  {
    std::ofstream out(folder / "job.inp");
    out.precision(12);  // ccx reads 20 characters of a number
    out << "*NODE, NSET=ALL\n";
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
      out << i + 1 << ", " << mesh.nodes_m(i, 0) << ", " << mesh.nodes_m(i, 1) << ", " << mesh.nodes_m(i, 2) << "\n";
    out << "*ELEMENT, TYPE=C3D" << nodes << ", ELSET=BODY\n";
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
      out << e + 1;
      for (int a = 0; a < nodes; ++a) out << ", " << mesh.tetrahedra(e, a) + 1;
      out << "\n";
    }
    const auto material = [&](const char* name, const char* elements, double stiffness_pa, double nu) {
      const Moduli m = moduli(stiffness_pa, nu);
      out << "*MATERIAL, NAME=" << name << "\n";
      if (nonlinear)
        out << "*HYPERELASTIC, NEO HOOKE\n" << m.mu / 2 << ", " << 2 / (m.lambda + 2.0 / 3 * m.mu) << "\n";
      else
        out << "*ELASTIC\n" << stiffness_pa << ", " << nu << "\n";
      out << "*SOLID SECTION, ELSET=" << elements << ", MATERIAL=" << name << "\n";
    };
    if (other.empty()) {
      material("SOFT", "BODY", young_pa, poisson);
    } else {
      std::vector<char> is_other(static_cast<std::size_t>(mesh.tetrahedra.rows()), 0);
      for (Index e : other) is_other[static_cast<std::size_t>(e)] = 1;
      for (const char which : {0, 1}) {
        out << "*ELSET, ELSET=" << (which ? "THOSE" : "THESE") << "\n";
        for (std::size_t e = 0; e < is_other.size(); ++e)
          if (is_other[e] == which) out << e + 1 << ",\n";
      }
      material("SOFT", "THESE", young_pa, poisson);
      material("OTHER", "THOSE", other_young_pa, other_poisson.value_or(poisson));
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
