// SPDX-License-Identifier: Apache-2.0
// Markers move rigidly with the nearest patch of the surface: they may stand several millimetres off it, so the patch's
// rotation carries them as much as its translation does.
#include <Eigen/SVD>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

#include "palpate/core/error.hpp"
#include "palpate/estimation/terms/surface_terms.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::estimation {
namespace {

/// Surface vertices whose best rigid motion a marker follows.
struct Patch {
  std::vector<Index> vertices;
  Vec3 centre_m = Vec3::Zero();
};

Patch patch_under(const TriMesh& surface, const geometry::TriangleTree& tree, const Vec3& marker_m) {
  const auto foot = tree.closest(marker_m);
  const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(foot.triangle, k))); };
  const double edge_m = std::max({(corner(0) - corner(1)).norm(), (corner(1) - corner(2)).norm(), (corner(2) - corner(0)).norm()});
  // As wide as the marker stands off, so that a lever does not magnify the patch's own deformation; at least one ring.
  const double radius_m = std::max(std::sqrt(foot.squared_distance_m2), 1.01 * edge_m);
  Patch patch;
  for (Index v = 0; v < surface.vertices_m.rows(); ++v) {
    if ((surface.vertices_m.row(v).transpose() - foot.point_m).norm() <= radius_m) patch.vertices.push_back(v);
  }
  for (int k = 0; k < 3; ++k) {
    const Index v = surface.triangles(foot.triangle, k);
    if (std::find(patch.vertices.begin(), patch.vertices.end(), v) == patch.vertices.end()) patch.vertices.push_back(v);
  }
  for (Index v : patch.vertices) patch.centre_m += surface.vertices_m.row(v).transpose();
  patch.centre_m /= static_cast<double>(patch.vertices.size());
  return patch;
}

class MarkerTerm : public Term {
 public:
  MarkerTerm(const Markers& markers, const TriMesh& rest, std::vector<int> offsets)
      : markers_(markers), rest_(rest), offsets_(std::move(offsets)) {
    const geometry::TriangleTree tree(rest);
    for (Index m = 0; m < markers.rest_m.rows(); ++m) {
      const bool seen = markers.rest_m.row(m).allFinite() && markers.observed_m.row(m).allFinite();
      patches_.push_back(seen ? patch_under(rest, tree, markers.rest_m.row(m)) : Patch{});
    }
  }

  TermRows rows(const StepPrediction& predicted, const VectorX& unknowns, const TermView&) const override {
    const Points& surface_m = predicted.markers_m();  // a marker's place is measured itself: the seen shape's error is not its
    std::vector<Index> seen;
    for (Index m = 0; m < markers_.rest_m.rows(); ++m) {
      if (!patches_[static_cast<std::size_t>(m)].vertices.empty()) seen.push_back(m);
    }
    const Index count = static_cast<Index>(predicted.columns.size());
    const Index extra = 3 * static_cast<Index>(offsets_.size());
    TermRows rows;
    rows.unknowns = predicted.columns;
    for (const int offset : offsets_)
      for (int axis = 0; axis < 3; ++axis) rows.unknowns.push_back(offset + axis);
    rows.jacobian = MatrixX::Zero(3 * static_cast<Index>(seen.size()), count + extra);
    rows.residual.resize(rows.jacobian.rows());
    rows.observed_m.resize(static_cast<Index>(seen.size()), 3);
    for (Index r = 0; r < static_cast<Index>(seen.size()); ++r) {
      const Index m = seen[static_cast<std::size_t>(r)];
      Vec3 rest_m = markers_.rest_m.row(m);
      if (extra > 0) rest_m += unknowns.segment<3>(offsets_[static_cast<std::size_t>(m)]);
      const Patch& patch = patches_[static_cast<std::size_t>(m)];

      // Best rotation of the patch (Kabsch) and its derivative: (tr(S) I - S) dw = sum b x dy, with b = R a.
      const double share = 1.0 / static_cast<double>(patch.vertices.size());
      Vec3 centre = Vec3::Zero();
      MatrixX d_centre = MatrixX::Zero(3, count);
      for (Index v : patch.vertices) {
        centre += share * surface_m.row(v).transpose();
        d_centre += share * predicted.d_markers().middleRows<3>(3 * v);
      }
      Mat3 correlation = Mat3::Zero();
      for (Index v : patch.vertices) {
        correlation += (surface_m.row(v).transpose() - centre) * (rest_.vertices_m.row(v) - patch.centre_m.transpose());
      }
      const Eigen::JacobiSVD<Mat3> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
      Mat3 sign = Mat3::Identity();
      sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
      const Mat3 rotation = svd.matrixU() * sign * svd.matrixV().transpose();
      const Mat3 stretch = correlation * rotation.transpose();
      const Mat3 symmetric = 0.5 * (stretch + stretch.transpose());
      MatrixX moment = MatrixX::Zero(3, count);
      for (Index v : patch.vertices) {
        const Vec3 arm = rotation * (rest_.vertices_m.row(v).transpose() - patch.centre_m);
        for (Index k = 0; k < count; ++k) {
          moment.col(k) += arm.cross(Vec3(predicted.d_markers().block<3, 1>(3 * v, k)));
        }
      }
      const MatrixX spin = (symmetric.trace() * Mat3::Identity() - symmetric).ldlt().solve(moment);

      const Vec3 lever = rotation * (rest_m - patch.centre_m);
      rows.residual.segment<3>(3 * r) = (markers_.observed_m.row(m).transpose() - centre - lever) / markers_.sigma_m;
      for (Index k = 0; k < count; ++k) {
        rows.jacobian.block<3, 1>(3 * r, k) = -(d_centre.col(k) + Vec3(spin.col(k)).cross(lever)) / markers_.sigma_m;
      }
      if (extra > 0) rows.jacobian.block<3, 3>(3 * r, count + 3 * m) = -rotation / markers_.sigma_m;
      rows.observed_m.row(r) = markers_.observed_m.row(m);
    }
    rows.sigma.setConstant(rows.residual.size(), markers_.sigma_m);
    rows.unit = "m";
    return rows;
  }
  double typical_sigma() const override { return markers_.sigma_m; }

 private:
  Markers markers_;
  TriMesh rest_;
  std::vector<int> offsets_;  // a marker: first of its three unknowns; empty: its place at rest is exactly known
  std::vector<Patch> patches_;
};

}  // namespace

std::unique_ptr<Term> make_marker_term(const Markers& markers, const TermContext& context) {
  if (!(markers.sigma_m > 0)) {
    throw Error("the markers need their standard deviation (sigma_m > 0)", context.model.step(context.step).source + " markers");
  }
  std::vector<int> offsets;
  if (markers.rest_std_m > 0) {
    for (Index m = 0; m < markers.rest_m.rows(); ++m) {
      // One marker in several steps errs alike in all of them: told by its name, or else by its place at rest.
      const auto number = static_cast<std::size_t>(m);
      const Vec3 rest_m = markers.rest_m.row(m);
      std::string key = "marker/";
      if (number < markers.names.size())
        key += markers.names[number];
      else
        for (int axis = 0; axis < 3; ++axis) key += std::to_string(std::bit_cast<std::uint64_t>(rest_m(axis))) + "/";
      const auto [at, fresh] = context.shared.try_emplace(key, context.unknowns.size());
      const std::string name = number < markers.names.size() ? markers.names[number] : std::to_string(m);
      for (const char* axis : {"_x", "_y", "_z"})
        if (fresh) context.unknowns.add({"marker_" + name + axis, "m", 0, markers.rest_std_m});
      offsets.push_back(at->second);
    }
  }
  return std::make_unique<MarkerTerm>(markers, context.model.object().surface.rest(), std::move(offsets));
}

}  // namespace palpate::estimation
