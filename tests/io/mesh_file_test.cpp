// label: contract
// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/mesh_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>

#include "io/broken_bytes.hpp"
#include "palpate/io/file.hpp"

namespace palpate::io {

void PrintTo(const MeshFormat& format, std::ostream* out) { *out << format.name; }

namespace mesh_file_test {
namespace {

using namespace palpate::io::test;

const std::vector<std::array<Index, 2>> edges = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};

/// Two tetrahedra on a common face, with coordinates that no decimal of a few digits can spell; single precision holds them.
MeshData two_tets(int nodes_each) {
  MeshData mesh;
  std::vector<Vec3> points = {{0, 0, 0}, {1.0 / 3, 0, 0}, {0, 1.0 / 7, 0}, {0, 0, 0.1}, {1.0 / 3, 1.0 / 7, 0.1}};
  for (Vec3& point : points) point = point.cast<float>().cast<double>();
  const std::vector<std::array<Index, 4>> corners = {{0, 1, 2, 3}, {1, 4, 2, 3}};
  mesh.tetrahedra.resize(2, nodes_each);
  for (std::size_t t = 0; t < 2; ++t) {
    for (std::size_t k = 0; k < 4; ++k)
      mesh.tetrahedra(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(k)) = corners[t][k];
    for (std::size_t e = 0; nodes_each == 10 && e < 6; ++e) {
      const Vec3 middle = 0.5 * (points[static_cast<std::size_t>(corners[t][static_cast<std::size_t>(edges[e][0])])] +
                                 points[static_cast<std::size_t>(corners[t][static_cast<std::size_t>(edges[e][1])])]);
      mesh.tetrahedra(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(4 + e)) = static_cast<Index>(points.size());
      points.push_back(middle);
    }
  }
  mesh.points_m.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) mesh.points_m.row(static_cast<Eigen::Index>(i)) = points[i];
  return mesh;
}

MeshData surface_of_two_tets() {
  MeshData mesh = two_tets(4);
  mesh.tetrahedra.resize(0, 4);
  mesh.triangles.resize(6, 3);
  mesh.triangles << 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 4, 1, 4, 3, 4, 2, 3;
  return mesh;
}

std::string file_name(const MeshFormat& format) { return "file.name" + format.extensions.front(); }

class EveryFormat : public testing::TestWithParam<MeshFormat> {
 protected:
  const MeshFormat& format = GetParam();
  Reader reader = [this](std::string_view bytes, const std::string&) { parse_mesh(bytes, file_name(format)); };

  std::vector<MeshData> meshes() const {
    std::vector<MeshData> result;
    if (format.triangles) result.push_back(surface_of_two_tets());
    if (format.tetrahedra) result.insert(result.end(), {two_tets(4), two_tets(10)});
    if (format.triangles && format.tetrahedra) {
      MeshData both = two_tets(4);
      both.triangles = surface_of_two_tets().triangles;
      result.push_back(both);
    }
    return result;
  }
};

TEST_P(EveryFormat, GivesBackExactlyWhatWasWritten) {
  for (const MeshData& mesh : meshes()) {
    const MeshData back = parse_mesh(format.write(mesh), file_name(format));
    if (format.extensions.front() != ".stl") {
      EXPECT_EQ(mesh.points_m, back.points_m);
    }
    ASSERT_EQ(mesh.triangles.rows(), back.triangles.rows());
    for (Eigen::Index i = 0; i < mesh.triangles.rows(); ++i) {  // STL orders its points anew
      for (Eigen::Index k = 0; k < 3; ++k) {
        EXPECT_EQ(mesh.points_m.row(mesh.triangles(i, k)), back.points_m.row(back.triangles(i, k)));
      }
    }
    EXPECT_EQ(mesh.tetrahedra, back.tetrahedra);
  }
}

TEST_P(EveryFormat, FieldsDoNotDisturbTheMesh) {
  MeshData mesh = meshes().back();
  mesh.point_fields["displacement m \"quoted\" <&"] = MatrixX::Random(mesh.points_m.rows(), 3);
  mesh.point_fields["pressure_pa"] = MatrixX::Random(mesh.points_m.rows(), 1);
  const Eigen::Index cells = mesh.tetrahedra.rows() > 0 ? mesh.tetrahedra.rows() : mesh.triangles.rows();
  mesh.cell_fields["young_modulus_pa"] = MatrixX::Constant(cells, 1, 2e4);
  const MeshData back = parse_mesh(format.write(mesh), file_name(format));
  EXPECT_EQ(mesh.points_m.rows(), back.points_m.rows());
  EXPECT_EQ(mesh.tetrahedra, back.tetrahedra);
}

TEST_P(EveryFormat, RefusesCutOffFiles) {
  for (const MeshData& mesh : meshes()) {
    for (const std::string& bytes : truncated(format.write(mesh))) {
      if (format.extensions.front() == ".obj") {  // nothing in an OBJ file says where it ends: it may only not crash
        refuses(reader, bytes);
      } else {
        EXPECT_TRUE(refuses(reader, bytes)) << bytes.size() << " bytes";
      }
    }
  }
}

TEST_P(EveryFormat, RefusesGarbage) {
  for (const std::string& bytes : garbage()) EXPECT_TRUE(refuses(reader, bytes));
}

TEST_P(EveryFormat, SurvivesDamage) {
  for (const MeshData& mesh : meshes()) survives(reader, damaged(format.write(mesh)));
}

TEST_P(EveryFormat, ReadsWindowsLineEnds) {
  const std::string bytes = format.write(meshes().front());
  if (bytes.find('\0') != std::string::npos || format.name == "vtu") return;  // binary files have no line ends
  const MeshData back = parse_mesh(with_crlf(bytes), file_name(format));
  EXPECT_EQ(back.triangles.rows(), meshes().front().triangles.rows());
}

TEST_P(EveryFormat, RefusesPointsThatAreNotFinite) {
  MeshData mesh = meshes().front();
  mesh.points_m(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refuses(reader, format.write(mesh)));
  mesh.points_m(1, 1) = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(refuses(reader, format.write(mesh)));
}

TEST_P(EveryFormat, RefusesCellsOfPointsThatAreNotThere) {
  if (format.extensions.front() == ".stl") return;  // no indices
  MeshData mesh = meshes().front();
  const std::string whole = format.write(mesh);
  mesh.points_m.conservativeResize(mesh.points_m.rows() - 1, 3);
  EXPECT_TRUE(refuses(reader, format.write(mesh)));
}

std::vector<MeshFormat> readable_formats() {
  std::vector<MeshFormat> result;
  for (const MeshFormat& format : mesh_formats()) {
    if (format.read != nullptr) result.push_back(format);
  }
  return result;
}

INSTANTIATE_TEST_SUITE_P(Mesh, EveryFormat, testing::ValuesIn(readable_formats()),
                         [](const auto& one) { return one.param.name; });

TEST(MeshCounts, MoreThanTheFileCanHoldIsRefusedBeforeMemoryIsAskedFor) {
  const auto refused = [](const std::string& bytes, const char* name) {
    return refuses([&](std::string_view all, const std::string&) { parse_mesh(all, name); }, bytes);
  };
  EXPECT_TRUE(
      refused("ply\nformat ascii 1.0\nelement vertex 2000000000\nproperty float x\nproperty float y\nproperty float z\n"
              "end_header\n0 0 0\n",
              "file.name.ply"));
  EXPECT_TRUE(refused("# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 2000000000 float\n0 0 0\n",
                      "file.name.vtk"));
  EXPECT_TRUE(refused("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n2000000000\n1 0 0 0\n", "file.name.msh"));
  EXPECT_TRUE(
      refused("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 2000000000 1 2\n3 1 0 2000000000\n1\n", "file.name.msh"));
  EXPECT_TRUE(refused("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 99999999999999 1 2\n3 1 0 9\n1\n", "file.name.msh"));
  EXPECT_TRUE(refused(std::string(80, ' ') + "\xff\xff\xff\xff" + std::string(50, '\0'), "file.name.stl"));
}

/// The midpoints tell whether a quadratic tetrahedron's nodes were put in our order.
TEST(QuadraticTetrahedron, GmshOrderIsTurnedIntoOurs) {
  // Written down by hand from the figure in Gmsh's manual: nodes 5 to 10 lie on the edges 01 12 02 03 23 13.
  const std::string gmsh =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 .5 0 0\n6 .5 .5 0\n7 0 .5 0\n"
      "8 0 0 .5\n9 0 .5 .5\n10 .5 0 .5\n$EndNodes\n$Elements\n1\n1 11 2 1 1 1 2 3 4 5 6 7 8 9 10\n$EndElements\n";
  const MeshData mesh = parse_mesh(gmsh, "tet10.msh");
  ASSERT_EQ(mesh.tetrahedra.cols(), 10);
  for (std::size_t e = 0; e < 6; ++e) {
    const Vec3 middle = mesh.points_m.row(mesh.tetrahedra(0, static_cast<Eigen::Index>(4 + e)));
    const Vec3 expected = 0.5 * (mesh.points_m.row(edges[e][0]) + mesh.points_m.row(edges[e][1]));
    EXPECT_EQ(middle, expected) << "edge " << e;
  }
}

TEST(Vtk, VersionFiveOffsetsAreRead) {
  const std::string vtk =
      "# vtk DataFile Version 5.1\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 4\n"
      "OFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\nCELL_TYPES 1\n10\n";
  const MeshData mesh = parse_mesh(vtk, "five.vtk");
  ASSERT_EQ(mesh.tetrahedra.rows(), 1);
  EXPECT_EQ(mesh.tetrahedra(0, 3), 3);
}

/// Bytes made with Python's zlib and base64 modules, in the layout that meshio and ParaView write.
TEST(Vtu, ZlibCompressedArraysAreRead) {
  std::ifstream stream(std::string(PALPATE_SOURCE_DIR) + "/tests/io/files/compressed.vtu", std::ios::binary);
  ASSERT_TRUE(stream) << "tests/io/files/compressed.vtu is part of the repository";
  const MeshData mesh = read_mesh(std::string(PALPATE_SOURCE_DIR) + "/tests/io/files/compressed.vtu");
  ASSERT_EQ(mesh.points_m.rows(), 5);
  EXPECT_EQ(mesh.points_m(4, 0), 0.25);
  ASSERT_EQ(mesh.tetrahedra.rows(), 2);
  EXPECT_EQ(mesh.tetrahedra(1, 1), 4);
}

TEST(Vtu, AppendedRawArraysAreRead) {
  const MeshData mesh = read_mesh(std::string(PALPATE_SOURCE_DIR) + "/tests/io/files/appended_raw.vtu");
  ASSERT_EQ(mesh.points_m.rows(), 5);
  EXPECT_EQ(mesh.points_m(4, 0), 0.25);
  ASSERT_EQ(mesh.tetrahedra.rows(), 2);
  EXPECT_EQ(mesh.tetrahedra(1, 1), 4);
}

TEST(Obj, PolygonsNegativeAndSlashedIndices) {
  const MeshData mesh =
      parse_mesh("mtllib a.mtl\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\nvt 0 0\nf 1/1/1 2/1 3//4 -1\n", "quad.obj");
  Triangles expected(2, 3);
  expected << 0, 1, 2, 0, 2, 3;
  EXPECT_EQ(mesh.triangles, expected);
}

TEST(Obj, ABackslashGoesOnWithTheNextLine) {
  const MeshData mesh = parse_mesh("v 0 0 \\\n0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\r\n 3 \\\n 4\n", "long.obj");
  EXPECT_EQ(mesh.points_m.rows(), 4);
  Triangles expected(2, 3);
  expected << 0, 1, 2, 0, 2, 3;
  EXPECT_EQ(mesh.triangles, expected);
  EXPECT_THROW(parse_mesh("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\\", "cut.obj"), Error);
}

/// A letter C and a star, from every corner, either way round: the triangles cover what the outline encloses, once.
TEST(Obj, PolygonsThatBendInwardsAreCutIntoWhatTheyEnclose) {
  std::vector<std::vector<Eigen::Vector2d>> outlines(2);
  outlines[0] = {{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 2}, {3, 2}, {3, 3}, {0, 3}};
  for (int k = 0; k < 10; ++k) {
    const double r = k % 2 == 0 ? 1 : 0.4, angle = 0.2 * M_PI * k;
    outlines[1].emplace_back(r * std::cos(angle), r * std::sin(angle));
  }
  for (const auto& outline : outlines) {
    const std::size_t n = outline.size();
    double area = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto &a = outline[i], &b = outline[(i + 1) % n];
      area += 0.5 * (a.x() * b.y() - a.y() * b.x());
    }
    for (std::size_t start = 0; start < n; ++start) {
      for (const bool backwards : {false, true}) {
        std::string text, face = "f";
        for (const auto& p : outline) text += "v " + std::to_string(p.x()) + " " + std::to_string(0.5 * p.x()) + " " + std::to_string(p.y()) + "\n";
        for (std::size_t i = 0; i < n; ++i) face += " " + std::to_string((backwards ? start + n - i : start + i) % n + 1);
        const TriMesh mesh = tri_mesh_of(parse_mesh(text + face + "\n", "a.obj"), "a.obj");
        ASSERT_EQ(mesh.triangles.rows(), static_cast<Eigen::Index>(n) - 2);
        double sum = 0;
        for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
          const auto corner = [&](int k) { return Vec3(mesh.vertices_m.row(mesh.triangles(t, k))); };
          const Vec3 doubled = (corner(1) - corner(0)).cross(corner(2) - corner(0));
          EXPECT_EQ(doubled.y() > 0, backwards) << "all turn the same way";
          sum += 0.5 * doubled.norm();
        }
        EXPECT_NEAR(sum, area * std::sqrt(1.25), 1e-5);  // the plane is slanted; six digits were written
      }
    }
  }
}

TEST(MeshFile, EndingsAreJudged) {
  EXPECT_THROW(read_mesh("object.step"), Error);
  EXPECT_THROW(write_mesh("object.inp2", surface_of_two_tets()), Error);
  EXPECT_THROW(write_mesh("volume.stl", two_tets(4)), Error);
  try {
    read_mesh("object.step");
  } catch (const Error& error) {
    EXPECT_NE(error.message().find(".vtu"), std::string::npos) << error.what();
  }
}

TEST(Calculix, NodesAndElementsStandInTheDeck) {
  const std::string deck = mesh_format_named("inp").write(two_tets(10));
  EXPECT_NE(deck.find("TYPE=C3D10"), std::string::npos);
  EXPECT_NE(deck.find("\n1, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11\n"), std::string::npos) << deck;
}

TEST(SharedMeshes, EveryOneIsRead) {
  const std::filesystem::path folder = std::filesystem::path(PALPATE_SHARED_DIR) / "data";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "the optional data folder is not there";
  EXPECT_EQ(read_tet_mesh(folder / "liver/rest_default.msh").tetrahedra.rows(), 10703);
  EXPECT_EQ(read_tet_mesh(folder / "silicone_gravity_depth/h_m_c/rest.vtk").nodes_m.rows(), 534);
  EXPECT_GT(read_tri_mesh(folder / "beam_known_force/beam_mm.stl").triangles.rows(), 0);
  for (const auto& entry : std::filesystem::directory_iterator(folder / "meshes")) {
    if (entry.path().extension() != ".obj") continue;
    EXPECT_GT(read_tri_mesh(entry.path()).triangles.rows(), 0) << entry.path();
  }
}

TEST(Sha256, MatchesTheStandardsExamples) {
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_hex(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

}  // namespace
}  // namespace mesh_file_test
}  // namespace palpate::io
