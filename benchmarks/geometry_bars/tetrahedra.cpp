// SPDX-License-Identifier: Apache-2.0
// Surfaces of files, damaged ones and made ones become tetrahedra: quality, fidelity and CPU seconds from the triangles to
// the embedded surface.
#include <fmt/core.h>

#include <cmath>
#include <cstdio>
#include <functional>

#include "bars.hpp"
#include "geometry/shapes.hpp"
#include "palpate/core/error.hpp"
#include "palpate/geometry/embedding.hpp"
#include "palpate/geometry/solid.hpp"
#include "palpate/geometry/surface_distance.hpp"
#include "palpate/geometry/tetrahedralise.hpp"
#include "palpate/io/mesh_file.hpp"

namespace bars {
namespace {

using geometry::Tetrahedralisation;

void head(const char* title) {
  fmt::print(
      "\n{}\n\n| mesh | asked | tetrahedra | dihedral angles | volume | rms | Hausdorff | CPU | holds |\n"
      "|---|---|---|---|---|---|---|---|---|\n",
      title);
}

/// One row. `truth`: what distances are measured against (the surface before it was damaged), or null for the input.
bool row(const std::string& name, const TriMesh& surface, const TriMesh* truth, Index count) {
  geometry::TetrahedraliseOptions o;
  o.tetrahedra = count;
  const Stopwatch watch;
  Tetrahedralisation r;
  SurfaceEmbedding embedding;
  try {
    r = geometry::tetrahedralise(surface, o);
    embedding = geometry::embed(surface.vertices_m, r.mesh);
  } catch (const Error& e) {
    fmt::print("| {} | {} | refused: {} | | | | | {:.2f} s | yes |\n", name, count, e.what(), watch.seconds());
    return true;
  }
  const double seconds = watch.seconds();
  double rms = r.surface_rms_m, hausdorff = r.hausdorff_m;
  std::optional<double> volume = r.volume_error;
  if (truth != nullptr) {
    const auto check = geometry::check_surface(*truth);
    const TriMesh boundary = geometry::boundary_surface(r.mesh).surface;
    const geometry::Solid solid(*truth);
    const auto seen = geometry::not_buried(*truth, solid);
    const auto d = check.watertight() ? geometry::surface_distance(*truth, boundary, 20000, seen)
                                      : geometry::one_sided_distance(*truth, boundary, 20000, seen);
    rms = d.rms_m, hausdorff = d.hausdorff_m;
    if (check.volume_m3) volume = r.check.volume_m3 / std::abs(*check.volume_m3) - 1;
  }
  // weights sum to one and carry affine fields
  const Points again = geometry::embedded_points(embedding, r.mesh, r.mesh.nodes_m);
  const double diagonal = r.surface.diagonal_m();
  const bool affine = (again - surface.vertices_m).cwiseAbs().maxCoeff() < 1e-9 * diagonal;
  const bool coarse = count < 6000;
  const bool sound = r.check.inverted + r.check.degenerate + r.check.non_manifold_boundary_edges == 0;
  const bool angles = r.check.min_dihedral_deg >= 15 && r.check.max_dihedral_deg <= 150;
  const bool fits = (!volume || std::abs(*volume) <= (coarse ? 0.02 : 0.01)) &&
                    rms <= (coarse ? 0.0025 : 0.0012) * diagonal && hausdorff <= (coarse ? 0.02 : 0.01) * diagonal;
  std::string missed;
  if (!sound) missed += " topology";
  if (!angles) missed += " angles";
  if (!fits) missed += " fidelity";
  if (!affine) missed += " embedding";
  if (seconds > (coarse ? 1 : 2)) missed += " time";
  fmt::print("| {} | {} | {} | {:.1f} to {:.1f}° | {} | {:.3f} % | {:.2f} % | {:.2f} s | {} |\n", name, count,
             r.check.tetrahedra, r.check.min_dihedral_deg, r.check.max_dihedral_deg,
             volume ? fmt::format("{:+.2f} %", 100 * *volume) : "open", 100 * rms / diagonal, 100 * hausdorff / diagonal,
             seconds, missed.empty() ? "yes" : "**no**:" + missed);
  std::fflush(stdout);
  return missed.empty();
}

/// A fifth of the triangles deleted, half of the rest flipped, a tenth doubled.
TriMesh spoiled(const TriMesh& whole) {
  std::mt19937 rng(4);
  std::vector<Eigen::Matrix<Index, 1, 3>> kept;
  for (Index i = 0; i < whole.triangles.rows(); ++i) {
    if (rng() % 5 == 0) continue;
    auto t = Eigen::Matrix<Index, 1, 3>(whole.triangles.row(i));
    if (rng() % 2 == 0) std::swap(t[0], t[1]);
    kept.push_back(t);
    if (rng() % 10 == 0) kept.push_back(t);
  }
  TriMesh out;
  out.vertices_m = whole.vertices_m;
  out.triangles.resize(static_cast<Index>(kept.size()), 3);
  for (Index i = 0; i < out.triangles.rows(); ++i) out.triangles.row(i) = kept[i];
  return out;
}

TriMesh star(int arms, double inner, double outer, double height) {
  std::vector<Vec3> v;
  std::vector<std::array<Index, 3>> t;
  const Index n = 2 * arms, m = n + 1;
  for (int z = 0; z < 2; ++z) {
    for (Index i = 0; i < n; ++i) {
      const double a = M_PI * i / arms, r = i % 2 ? inner : outer;
      v.emplace_back(r * std::cos(a), r * std::sin(a), z * height);
    }
    v.emplace_back(0, 0, z * height);
  }
  for (Index i = 0; i < n; ++i) {
    const Index j = (i + 1) % n;
    t.insert(t.end(), {{n, j, i}, {m + n, m + i, m + j}, {i, j, m + j}, {i, m + j, m + i}});
  }
  return shapes::make(v, t);
}

/// A ball with 40 spikes.
TriMesh hedgehog() {
  TriMesh m = shapes::sphere(0.05, 5);
  for (Index i = 0; i < m.vertices_m.rows(); ++i) {
    const Vec3 d = m.vertices_m.row(i).transpose().normalized();
    const double wave = std::abs(std::sin(5 * std::atan2(d.y(), d.x())) * std::sin(5 * std::acos(d.z())));
    m.vertices_m.row(i) *= 1 + 0.25 * wave * wave * wave;
  }
  return m;
}

/// A ball with six square pegs that pierce it: self-intersecting.
TriMesh jack() {
  TriMesh out = shapes::sphere(0.05, 3);
  for (int k = 0; k < 6; ++k) {
    Vec3 towards = Vec3::Zero(), size(0.006, 0.006, 0.006);
    towards[k / 2] = k % 2 ? 1 : -1;
    size[k / 2] = 0.08;
    out = shapes::join(out, shapes::box(size, 0.08 * towards - 0.5 * size));
  }
  return out;
}

TriMesh eight_balls() {
  TriMesh out = shapes::sphere(0.03, 3);
  for (int k = 1; k < 8; ++k) out = shapes::join(out, shapes::sphere(0.03, 3, 0.08 * Vec3(k & 1, (k >> 1) & 1, k >> 2)));
  return out;
}

TriMesh torus_of(double scale, double shift) {
  TriMesh m = shapes::torus(0.1, 0.03, 64, 32);
  m.vertices_m = (scale * m.vertices_m).rowwise() + shift * Eigen::RowVector3d(1, 2, 0);
  return m;
}

}  // namespace

bool tetrahedra(const std::filesystem::path& meshes) {
  head(
      "Meshes of the data folder; distances two-sided (open surfaces: from the surface to the mesh), buried triangles left "
      "out");
  bool holds = true;
  for (const Index count : {3000, 12000})
    for (const auto& file : mesh_files(meshes))
      holds = row(file.stem().string(), io::read_tri_mesh(file), nullptr, count) && holds;
  return holds;
}

bool damaged(const std::filesystem::path& meshes) {
  head(
      "A fifth of the triangles deleted, half flipped, a tenth doubled; distances and volume against the undamaged surface, "
      "its buried triangles left out");
  bool holds = true;
  for (const Index count : {3000, 12000})
    for (const auto& file : mesh_files(meshes)) {
      const TriMesh whole = io::read_tri_mesh(file);
      holds = row(file.stem().string(), spoiled(whole), &whole, count) && holds;
    }
  return holds;
}

bool unseen() {
  head("Made shapes");
  const std::vector<std::pair<const char*, TriMesh>> made{{"plate 20 : 20 : 1", shapes::box(Vec3(0.2, 0.2, 0.01))},
                                                          {"plate 50 : 50 : 1", shapes::box(Vec3(0.2, 0.2, 0.004))},
                                                          {"rod 1 : 1 : 33", shapes::box(Vec3(0.006, 0.006, 0.2))},
                                                          {"star, 5 arms", star(5, 0.04, 0.1, 0.03)},
                                                          {"star, 12 arms", star(12, 0.05, 0.1, 0.02)},
                                                          {"thin ring", shapes::torus(0.1, 0.01, 100, 24)},
                                                          {"8 balls", eight_balls()},
                                                          {"torus of 2.6 um", torus_of(1e-5, 0)},
                                                          {"torus of 260 km, far away", torus_of(1e6, 1e6)},
                                                          {"hedgehog", hedgehog()},
                                                          {"jack, self-intersecting", jack()}};
  bool holds = true;
  for (const Index count : {3000, 12000})
    for (const auto& [name, mesh] : made) holds = row(name, mesh, nullptr, count) && holds;
  return holds;
}

}  // namespace bars
