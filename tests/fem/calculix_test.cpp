// label: oracle
// SPDX-License-Identifier: Apache-2.0
// The same mesh, law and nodal forces in CalculiX (C3D4 and C3D10, linear and NLGEOM with its Neo-Hookean law), node by
// node.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "fem_meshes.hpp"
#include "palpate/fem/materials.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem {
namespace {

struct Case {
  int nodes;
  bool nonlinear;
  double poisson;
};

class CalculiX : public testing::TestWithParam<Case> {};

VectorX run(const TetMesh& mesh, const std::vector<Index>& held, const VectorX& load, const Case& c, double young) {
  const auto folder =
      std::filesystem::temp_directory_path() /
      ("palpate_ccx_" + std::to_string(c.nodes) + (c.nonlinear ? "n" : "l") + std::to_string(c.poisson) + "_" +
       std::to_string(::testing::UnitTest::GetInstance()->random_seed()) + std::to_string(std::rand()));
  std::filesystem::create_directories(folder);
  {
    std::ofstream out(folder / "job.inp");
    out.precision(15);
    out << "*NODE, NSET=ALL\n";
    for (Index i = 0; i < mesh.nodes_m.rows(); ++i)
      out << i + 1 << ", " << mesh.nodes_m(i, 0) << ", " << mesh.nodes_m(i, 1) << ", " << mesh.nodes_m(i, 2) << "\n";
    out << "*ELEMENT, TYPE=C3D" << c.nodes << ", ELSET=BODY\n";
    for (Index e = 0; e < mesh.tetrahedra.rows(); ++e) {
      out << e + 1;
      for (int a = 0; a < c.nodes; ++a) out << ", " << mesh.tetrahedra(e, a) + 1;
      out << "\n";
    }
    const Moduli m = moduli(young, c.poisson);
    out << "*MATERIAL, NAME=SOFT\n";
    if (c.nonlinear)
      out << "*HYPERELASTIC, NEO HOOKE\n" << m.mu / 2 << ", " << 2 / (m.lambda + 2.0 / 3 * m.mu) << "\n";
    else
      out << "*ELASTIC\n" << young << ", " << c.poisson << "\n";
    out << "*SOLID SECTION, ELSET=BODY, MATERIAL=SOFT\n*BOUNDARY\n";
    for (Index i : held) out << i + 1 << ", 1, 3, 0.\n";
    out << "*STEP" << (c.nonlinear ? ", NLGEOM, INC=200" : "") << "\n*STATIC\n" << (c.nonlinear ? "0.5, 1.\n" : "");
    if (c.nonlinear) out << "*CONTROLS, PARAMETERS=FIELD\n1.E-7, 1.E-7\n";
    out << "*CLOAD\n";
    for (Index d = 0; d < load.size(); ++d)
      if (load(d) != 0) out << d / 3 + 1 << ", " << d % 3 + 1 << ", " << load(d) << "\n";
    out << "*NODE PRINT, NSET=ALL, FREQUENCY=999999\nU\n*END STEP\n";
  }
  const std::string command = "cd '" + folder.string() + "' && OMP_NUM_THREADS=1 ccx job > log 2>&1";
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
  std::filesystem::remove_all(folder);
  return u;
}

TEST_P(CalculiX, AgreesNodeByNode) {
  if (std::system("command -v ccx > /dev/null 2>&1") != 0) GTEST_SKIP() << "CalculiX (ccx) is not installed";
  const Case c = GetParam();
  TetMesh mesh = distorted(block_mesh(4, 4, 4, {0.15, 0.15, 0.15}), 0.006, 21);
  if (c.nodes == 10) mesh = to_quadratic(mesh);
  const std::vector<Index> held = nodes_where(mesh, [](const Vec3& x) { return x.z() < 1e-9; });
  Boundary b;
  b.constraints = clamp(held);
  b.forces = spread_over_patch(mesh, {0.075, 0.075, 0.15}, 0.03);
  const Vec3 force(2, -1, -9);
  const double young = 20000;
  const VectorX theirs = run(mesh, held, b.forces * force, c, young);
  ASSERT_TRUE(theirs.allFinite()) << "ccx gave no result";
  const Equilibrium e =
      Statics(mesh, c.nonlinear ? "neo_hookean_isochoric" : "linear", b).solve(young, c.poisson, force, VectorX());
  ASSERT_TRUE(e.converged) << e.reason;
  const double largest = e.displacement_m.cwiseAbs().maxCoeff();
  EXPECT_GT(largest, 2e-3);
  EXPECT_LT((theirs - e.displacement_m).cwiseAbs().maxCoeff(), 2e-6 * largest);  // its file carries seven digits
}

INSTANTIATE_TEST_SUITE_P(Elements, CalculiX,
                         testing::Values(Case{4, false, 0.3}, Case{10, false, 0.3}, Case{4, false, 0.499},
                                         Case{10, false, 0.499}, Case{4, true, 0.3}, Case{10, true, 0.3},
                                         Case{10, true, 0.45}, Case{10, true, 0.499}),
                         [](const auto& each) {
                           return "C3D" + std::to_string(each.param.nodes) +
                                  (each.param.nonlinear ? "_neo_hooke_" : "_linear_") +
                                  std::to_string(static_cast<int>(1000 * each.param.poisson + 0.5));
                         });

}  // namespace
}  // namespace palpate::fem
