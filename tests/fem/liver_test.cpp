// label: data
// SPDX-License-Identifier: Apache-2.0
// The liver's true positions are the discrete solution on the given mesh: given E, nu and the forces, the solver must land
// on them to the rounding of the file (float32).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "fem_meshes.hpp"
#include "palpate/fem/statics.hpp"

namespace palpate::fem::liver_test {
namespace {

const std::filesystem::path kLiver = std::filesystem::path(PALPATE_SHARED_DIR) / "data" / "liver";

TetMesh read_gmsh2(const std::filesystem::path& path) {
  std::ifstream in(path);
  TetMesh mesh;
  std::string word;
  while (in >> word && word != "$Nodes") {
  }
  Index count = 0;
  in >> count;
  mesh.nodes_m.resize(count, 3);
  for (Index i = 0; i < count; ++i) {
    Index id = 0;
    in >> id >> mesh.nodes_m(i, 0) >> mesh.nodes_m(i, 1) >> mesh.nodes_m(i, 2);
  }
  while (in >> word && word != "$Elements") {
  }
  in >> count;
  std::vector<std::array<Index, 4>> tets;
  for (Index i = 0; i < count; ++i) {
    int id = 0, type = 0, tags = 0, tag = 0;
    in >> id >> type >> tags;
    for (int k = 0; k < tags; ++k) in >> tag;
    const int nodes = type == 4 ? 4 : type == 2 ? 3 : type == 1 ? 2 : 1;
    std::array<Index, 4> t{};
    for (int k = 0; k < nodes; ++k) in >> t[k];
    if (type == 4) tets.push_back(t);
  }
  mesh.tetrahedra.resize(tets.size(), 4);
  for (std::size_t i = 0; i < tets.size(); ++i)
    for (int k = 0; k < 4; ++k) mesh.tetrahedra(i, k) = tets[i][k] - 1;
  return mesh;
}

std::vector<std::vector<double>> read_csv(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(in, line);) {
    std::vector<double> row;
    std::stringstream cells(line);
    bool numeric = true;
    for (std::string cell; std::getline(cells, cell, ',');) {
      try {
        row.push_back(std::stod(cell));
      } catch (const std::exception&) {
        numeric = false;
      }
    }
    if (numeric && !row.empty()) rows.push_back(row);
  }
  return rows;
}

// One frame (n x 3) of a little-endian float32 C-order .npy file.
Points read_frame(const std::filesystem::path& path, Index frame, Index nodes) {
  std::ifstream in(path, std::ios::binary);
  char header[10];
  in.read(header, 10);
  const int length = static_cast<unsigned char>(header[8]) + 256 * static_cast<unsigned char>(header[9]);
  in.seekg(10 + length + static_cast<std::streamoff>(frame) * nodes * 12);
  std::vector<float> values(3 * nodes);
  in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * 4));
  Points points(nodes, 3);
  for (Index i = 0; i < 3 * nodes; ++i) points(i / 3, i % 3) = values[i];
  return points;
}

std::vector<Index> read_indices(const std::filesystem::path& path) {
  std::vector<Index> indices;
  for (const auto& row : read_csv(path))
    for (double v : row) indices.push_back(static_cast<Index>(v));
  return indices;
}

struct Case {
  const char* sequence;
  const char* material;
  double young, poisson;
};

class Liver : public testing::TestWithParam<Case> {};

TEST_P(Liver, LandsOnTheTruePositions) {
  const Case c = GetParam();
  const auto folder = kLiver / c.sequence;
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no data in " << folder;
  const TetMesh mesh = read_gmsh2(kLiver / "rest_default.msh");
  Boundary boundary;
  std::vector<Index> fixed = read_indices(kLiver / "fixed_vertices_default.csv");
  // The Neo-Hookean truth leaves one listed vertex free: it moves by millimetres and carries no reaction (1e-5 N).
  if (std::string(c.material) == "neo_hookean") std::erase(fixed, 756);
  boundary.constraints = clamp(fixed);
  boundary.forces =
      spread_over_nodes(static_cast<Index>(mesh.nodes_m.rows()), read_indices(folder / "tool_vertices_default.csv"));
  const Statics statics(mesh, c.material, boundary);
  const auto forces = read_csv(folder / "forces_n.csv");
  VectorX start;
  for (int frame : {0, 7, 21, 35, 49}) {
    const Points truth = read_frame(folder / "true_positions_default_m.npy", frame, static_cast<Index>(mesh.nodes_m.rows()));
    const auto& row = forces[frame];
    const VectorX a = Eigen::Map<const Vec3>(row.data() + row.size() - 3);
    const Equilibrium e = statics.solve(c.young, c.poisson, a, VectorX(), start.size() ? &start : nullptr);
    ASSERT_TRUE(e.converged) << e.reason;
    start = e.displacement_m;
    const Eigen::Map<const Points> u(e.displacement_m.data(), mesh.nodes_m.rows(), 3);
    const double worst = (mesh.nodes_m + u - truth).rowwise().norm().maxCoeff();
    EXPECT_LT(worst, 1e-6) << "frame " << frame;
    RecordProperty("frame_" + std::to_string(frame), std::to_string(worst) + " m, " + std::to_string(e.newton_steps) +
                                                         " steps, " + std::to_string(e.factorisations));
  }
}

// The other side of that truth: it locks. Quadratic elements on the same tetrahedra with the same forces move by 36 % (linear_s2)
// to 42 % (linear_s1) more, which the data's makers' E of 20 kPa turns into 27.3 and 28.4 kPa.
TEST(LiverQuadratic, MovesByMoreThanAThirdMore) {
  if (!std::filesystem::exists(kLiver)) GTEST_SKIP() << "no data in " << kLiver;
  const TetMesh linear = read_gmsh2(kLiver / "rest_default.msh");
  const TetMesh mesh = to_quadratic(linear);
  const Index count = static_cast<Index>(mesh.nodes_m.rows());
  Support ligaments;
  ligaments.kind = SupportKind::vertices;
  ligaments.vertices = read_indices(kLiver / "fixed_vertices_default.csv");
  for (const char* sequence : {"linear_s1", "linear_s2"}) {
    const auto folder = kLiver / sequence;
    Boundary boundary;
    boundary.constraints = clamp(support_nodes(mesh, ligaments));
    boundary.forces = spread_over_nodes(count, read_indices(folder / "tool_vertices_default.csv"));
    const Statics statics(mesh, "linear", boundary);
    const auto forces = read_csv(folder / "forces_n.csv");
    double own = 0, shared = 0;
    for (int frame : {7, 21, 35, 49}) {
      const Points truth = read_frame(folder / "true_positions_default_m.npy", frame, static_cast<Index>(linear.nodes_m.rows()));
      const auto& row = forces[frame];
      const Equilibrium e = statics.solve(20000, 0.45, Eigen::Map<const Vec3>(row.data() + row.size() - 3), VectorX());
      ASSERT_TRUE(e.converged) << e.reason;
      const Eigen::Map<const Points> u(e.displacement_m.data(), count, 3);
      const Points moved = truth - linear.nodes_m;
      own += u.topRows(moved.rows()).squaredNorm();
      shared += u.topRows(moved.rows()).cwiseProduct(moved).sum();
    }
    EXPECT_GT(own / shared, 1.36) << sequence;
    EXPECT_LT(own / shared, 1.43) << sequence;
    RecordProperty(sequence, std::to_string(own / shared));
  }
}

INSTANTIATE_TEST_SUITE_P(Sequences, Liver,
                         testing::Values(Case{"linear_s1", "linear", 20000, 0.45}, Case{"linear_s2", "linear", 20000, 0.45},
                                         Case{"neohookean_s1", "neo_hookean", 4500, 0.49},
                                         Case{"neohookean_s3", "neo_hookean", 4500, 0.49}),
                         [](const auto& each) { return std::string(each.param.sequence); });

}  // namespace
}  // namespace palpate::fem::liver_test
