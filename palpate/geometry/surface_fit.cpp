// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/surface_fit.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace palpate::geometry {
namespace {

/// normal . (sum_k share_k d_corner_k) should equal `gap`.
struct Term {
  TetEditor::Tri corner;
  Vec3 share, normal;
  double gap = 0, weight = 0;
};

const std::array<Vec3, 4> places{Vec3(1, 1, 1) / 3, Vec3(2, 0.5, 0.5) / 3, Vec3(0.5, 2, 0.5) / 3, Vec3(0.5, 0.5, 2) / 3};

}  // namespace

void fit_to_surface(TetEditor& mesh, const Solid& solid, const SurfaceSamples& samples, double floor_quality) {
  const auto triangles = mesh.all_boundary_triangles();
  std::vector<Term> terms;
  terms.reserve(triangles.size() * places.size() + samples.point.size());
  TriMesh boundary;
  boundary.vertices_m.resize(static_cast<Eigen::Index>(mesh.x.size()), 3);
  for (std::size_t v = 0; v < mesh.x.size(); ++v) boundary.vertices_m.row(v) = mesh.x[v].transpose();
  boundary.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const auto& t = triangles[i];
    boundary.triangles.row(i) << t[0], t[1], t[2];
    const Vec3 a = mesh.x[t[0]], b = mesh.x[t[1]], c = mesh.x[t[2]];
    const Vec3 n = (b - a).cross(c - a);
    const double area = 0.5 * n.norm();
    if (!(area > 0)) continue;
    const double size = (mesh.size_m[t[0]] + mesh.size_m[t[1]] + mesh.size_m[t[2]]) / 3;
    Index hint = -1;
    for (const Vec3& share : places) {
      const Vec3 p = share[0] * a + share[1] * b + share[2] * c;
      const ClosestPoint q = solid.closest(p, hint);
      hint = q.triangle;
      const Vec3 normal = solid.normal(q.triangle), d = q.point_m - p;
      const double length = d.norm(), along = normal.dot(d);
      if (normal.dot(n) < 0.6 * area || length > size) continue;  // another sheet, or nothing near
      double weight = area / double(places.size());
      if (length > 0.2 * size) weight *= (along / length) * (along / length);  // over a hole the rim says little
      terms.push_back({t, share, normal, along, weight});
    }
  }
  const TriangleTree tree(boundary);
  for (std::size_t i = 0; i < samples.evenly; ++i) {
    const ClosestPoint q = tree.closest(samples.point[i]);
    const auto& t = triangles[q.triangle];
    const Vec3 n = (mesh.x[t[1]] - mesh.x[t[0]]).cross(mesh.x[t[2]] - mesh.x[t[0]]).normalized();
    const double size = (mesh.size_m[t[0]] + mesh.size_m[t[1]] + mesh.size_m[t[2]]) / 3;
    if (n.dot(samples.normal[i]) < -0.1 || q.squared_distance_m2 > 4 * size * size) continue;
    terms.push_back(
        {t, q.barycentric, samples.normal[i], samples.normal[i].dot(samples.point[i] - q.point_m), samples.area_each_m2});
  }

  std::vector<std::vector<Index>> terms_of(mesh.x.size());
  for (std::size_t i = 0; i < terms.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (terms[i].share[k] > 0.02) terms_of[terms[i].corner[k]].push_back(static_cast<Index>(i));
  std::vector<Vec3> step(mesh.x.size(), Vec3::Zero());
  for (int sweep = 0; sweep < 5; ++sweep)
    for (std::size_t v = 0; v < mesh.x.size(); ++v) {
      if (terms_of[v].empty()) continue;
      Mat3 a = Mat3::Zero();
      Vec3 b = Vec3::Zero();
      for (const Index i : terms_of[v]) {
        const Term& t = terms[i];
        double share = 0, rest = t.gap;
        for (int k = 0; k < 3; ++k) {
          if (t.corner[k] == static_cast<Index>(v))
            share = t.share[k];
          else
            rest -= t.share[k] * t.normal.dot(step[t.corner[k]]);
        }
        a += t.weight * share * share * t.normal * t.normal.transpose();
        b += t.weight * share * rest * t.normal;
      }
      a.diagonal().array() += 0.02 * a.trace() + 1e-300;
      step[v] = a.ldlt().solve(b);
      const double limit = 0.5 * mesh.size_m[v], length = step[v].norm();
      if (length > limit) step[v] *= limit / length;
    }
  for (std::size_t v = 0; v < mesh.x.size(); ++v) {
    if (!mesh.boundary[v] || mesh.star[v].empty() || step[v].isZero(0)) continue;
    const auto id = static_cast<Index>(v);
    const double least = std::min(mesh.star_quality(id), floor_quality) - 1e-12;
    for (const double share : {1.0, 0.5, 0.25, 0.12}) {
      const Vec3 to = mesh.x[v] + share * step[v];
      if (mesh.star_quality_at(id, to, least) > least) {
        mesh.move(id, to);
        break;
      }
    }
  }
}

}  // namespace palpate::geometry
