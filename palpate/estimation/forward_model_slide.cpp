// SPDX-License-Identifier: Apache-2.0
// An object that its supports let slide: where it went is not in the statics, cameras see it.
#include <Eigen/Cholesky>
#include <algorithm>

#include "palpate/estimation/forward_model_parts.hpp"

namespace palpate::estimation {
namespace {

/// Of the object's diagonal: wide enough for what a smooth table lets happen, and it keeps what nobody sees from drifting off.
constexpr double slide_share = 0.02;

/// A third of the area of a vertex' triangles, for each of its coordinates: sums over them do not depend on how fine the mesh is.
VectorX areas(const TriMesh& surface) {
  VectorX area = VectorX::Zero(3 * surface.vertices_m.rows());
  for (Index t = 0; t < surface.triangles.rows(); ++t) {
    const auto corner = [&](int k) { return Vec3(surface.vertices_m.row(surface.triangles(t, k))); };
    const double third = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm() / 6;
    for (int k = 0; k < 3; ++k) area.segment<3>(3 * surface.triangles(t, k)).array() += third;
  }
  return area;
}

}  // namespace

void ForwardModel::prepare_slide(Body& body) const {
  if (body.free_motions.cols() == 0 || path_) return;
  body.slide = object_.surface.restrict(body.free_motions);
  body.slide_conjugate = body.forces.transpose() * body.free_motions;
  const MatrixX weighed = areas(object_.surface.rest()).asDiagonal() * body.slide;
  body.slide_mean = (body.slide.transpose() * weighed).ldlt().solve(weighed.transpose());
}

void ForwardModel::add_slide_unknowns(Unknowns& unknowns) {
  const Points& nodes_m = object_.mesh.nodes_m;
  const double diagonal_m = (nodes_m.colwise().maxCoeff() - nodes_m.colwise().minCoeff()).norm();
  for (std::size_t s = 0; s < steps_.size(); ++s) {
    std::vector<std::string> suffixes;
    for (Index k = 1; k <= body_of(push(s), worker_of(s)).slide.cols(); ++k) suffixes.push_back("_" + std::to_string(k));
    const std::string name = "slide[" + push(s).name + ":" + std::to_string(steps_[s].step) + "]";
    slide_.push_back(suffixes.empty() ? -1 : unknowns.add_block(name, "m", slide_share * diagonal_m, suffixes));
  }
}

/// The solution is pinned where nothing holds it. In place of that: no slide is no mean motion of the surface that way. To first
/// order in turns, which are small: what pinned nodes turn a body by at large strains is a hundredth.
void ForwardModel::slide(std::size_t s, const Body& body, const VectorX& unknowns, const std::vector<int>& columns, bool derivatives,
                         fem::ResponseState& at) const {
  if (slide_[s] < 0) return;
  const Index count = body.slide.cols();
  const VectorX way = unknowns.segment(slide_[s], count) - body.slide_mean * at.watched_m;
  at.watched_m += body.slide * way;
  at.conjugate_m += body.slide_conjugate * way;
  if (!derivatives) return;
  MatrixX d_way = -body.slide_mean * at.d_watched;
  for (Index k = 0; k < count; ++k) {
    const auto own = std::find(columns.begin(), columns.end(), slide_[s] + static_cast<int>(k));
    d_way(k, parameters_ + (own - columns.begin())) += 1;
  }
  at.d_watched += body.slide * d_way;
  at.d_conjugate += body.slide_conjugate * d_way;
}

}  // namespace palpate::estimation
