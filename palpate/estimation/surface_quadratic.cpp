// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/surface_quadratic.hpp"

#include <algorithm>
#include <limits>
#include <map>

namespace palpate::estimation {

SurfacePattern::SurfacePattern(const TriMesh& surface)
    : triangles(surface.triangles), vertices(static_cast<Index>(surface.vertices_m.rows())) {
  std::map<std::array<Index, 2>, std::size_t> number;
  edges_of.resize(static_cast<std::size_t>(triangles.rows()));
  for (Index t = 0; t < triangles.rows(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const Index a = triangles(t, k), b = triangles(t, (k + 1) % 3);
      const auto [at, fresh] = number.try_emplace({std::min(a, b), std::max(a, b)}, edges.size());
      if (fresh) edges.push_back(at->first);
      edges_of[static_cast<std::size_t>(t)][static_cast<std::size_t>(k)] = at->second;
    }
  }
}

struct SurfaceQuadratic::Seen {
  const SurfacePattern& pattern;
  const TermRows& rows;
  const VectorX& weight;
  Index own_first, own_count;       ///< columns of the jacobian
  std::vector<Index> vertex, edge;  ///< the pattern's among those seen

  Index triangle_of(Index row) const {
    const auto i = static_cast<std::size_t>(row);
    if (!rows.facets) return rows.surface[i].triangle;
    const Index facet = rows.facets->facet[i];
    return facet < 0 ? facet : rows.facets->triangle[static_cast<std::size_t>(facet)];
  }
  bool counts(Index row) const { return weight(row) != 0 && triangle_of(row) >= 0; }

  /// Rows that count, those of a triangle one after another.
  std::vector<Index> rows_by_triangle() const {
    std::vector<std::size_t> first(static_cast<std::size_t>(pattern.triangles.rows()) + 1, 0);
    for (Index i = 0; i < weight.size(); ++i)
      if (counts(i)) ++first[static_cast<std::size_t>(triangle_of(i)) + 1];
    for (std::size_t t = 1; t < first.size(); ++t) first[t] += first[t - 1];
    std::vector<Index> order(first.back());
    for (Index i = 0; i < weight.size(); ++i)
      if (counts(i)) order[first[static_cast<std::size_t>(triangle_of(i))]++] = i;
    return order;
  }
};

SurfaceQuadratic::SurfaceQuadratic(const SurfacePattern& pattern, const TermRows& rows, const Loss& loss,
                                   const StepPrediction& there, const VectorX& unknowns)
    : robust_(rows.robust) {
  const WeighedRows weighed = weigh(rows, loss);
  cost_ = weighed.cost;
  bend_ = weighed.bend;
  const Index first = static_cast<Index>(there.columns.size());
  own_.assign(rows.unknowns.begin() + first, rows.unknowns.end());
  const Index count = static_cast<Index>(own_.size());
  span_ = there.in_span;
  if (span_) span_->d_at.resize(0, 0);
  radius_m_ = 0.5 * (there.surface_m.colwise().maxCoeff() - there.surface_m.colwise().minCoeff()).norm();

  constexpr Index unseen = -1;
  Seen seen{pattern, rows, weighed.weight, first, count, {}, {}};
  seen.vertex.assign(static_cast<std::size_t>(pattern.vertices), unseen);
  seen.edge.assign(pattern.edges.size(), unseen);
  const auto note = [&](Index triangle) {
    for (int k = 0; k < 3; ++k) {
      seen.vertex[static_cast<std::size_t>(pattern.triangles(triangle, k))] = 0;
      seen.edge[pattern.edges_of[static_cast<std::size_t>(triangle)][static_cast<std::size_t>(k)]] = 0;
    }
  };
  std::vector<FacetSum> sums;
  if (rows.facets) {
    sums = summed_by_facet(rows, weighed.weight);
    for (std::size_t f = 0; f < sums.size(); ++f)
      if (sums[f].any) note(rows.facets->triangle[f]);
  } else {
    for (Index i = 0; i < weighed.weight.size(); ++i)
      if (seen.counts(i)) note(seen.triangle_of(i));
  }
  for (std::size_t v = 0; v < seen.vertex.size(); ++v) {
    if (seen.vertex[v] == unseen) continue;
    seen.vertex[v] = static_cast<Index>(seen_.size());
    seen_.push_back(static_cast<Index>(v));
  }
  for (std::size_t e = 0; e < seen.edge.size(); ++e) {
    if (seen.edge[e] == unseen) continue;
    seen.edge[e] = static_cast<Index>(edges_.size());
    const auto [low, high] = pattern.edges[e];
    edges_.push_back({seen.vertex[static_cast<std::size_t>(low)], seen.vertex[static_cast<std::size_t>(high)]});
  }
  const Index size = static_cast<Index>(seen_.size());
  seen_m_ = there.markers_m()(seen_, Eigen::all);
  seen_there_m_ = there.surface_m(seen_, Eigen::all);
  vertex_blocks_.assign(seen_.size(), Mat3::Zero());
  edge_blocks_.assign(edges_.size(), Mat3::Zero());
  cross_ = RowMajor::Zero(3 * size, count);
  own_block_ = MatrixX::Zero(count, count);
  surface_slope_ = VectorX::Zero(3 * size);
  own_slope_ = VectorX::Zero(count);
  constexpr int narrow = 16, wide = 24;  // whole vector registers: three corners, own unknowns, residual
  if (rows.facets) {
    gather_facets(seen, sums);
  } else if (10 + count <= narrow) {
    gather<narrow>(seen);
  } else if (10 + count <= wide) {
    gather<wide>(seen);
  } else {
    gather<Eigen::Dynamic>(seen);
  }
  if (rows.shared_noise) gather_noise(seen, weighed.each);
  if (rows.facets && there.field != nullptr) append_modes(there);
  own_at_ = unknowns(own_);
}

std::vector<SurfaceQuadratic::FacetSum> SurfaceQuadratic::summed_by_facet(const TermRows& rows, const VectorX& weight) {
  constexpr Index shares = FacetSlopes::shares;
  std::vector<FacetSum> sums(rows.facets->triangle.size());
  for (Index i = 0; i < weight.size(); ++i) {
    const Index facet = rows.facets->facet[static_cast<std::size_t>(i)];
    if (facet < 0 || weight(i) == 0) continue;
    FacetSum& sum = sums[static_cast<std::size_t>(facet)];
    const Eigen::Matrix<double, shares, 1> share = rows.facets->share.row(i), weighed = weight(i) * share;
    sum.block.noalias() += weighed * share.transpose();
    sum.slope += rows.residual(i) * weighed;
    sum.any = true;
  }
  return sums;
}

void SurfaceQuadratic::gather_facets(const Seen& seen, const std::vector<FacetSum>& sums) {
  const FacetSlopes& facets = *seen.rows.facets;
  constexpr Index shares = FacetSlopes::shares;
  // The compiler writes out products of sizes that it knows, which take half the time.
  const auto gather = [&]<int width>() {
    using Rows = Eigen::Matrix<double, shares, width, Eigen::RowMajor>;
    using Corner = Eigen::Matrix<double, 3, width, Eigen::RowMajor>;
    const Index count = seen.own_count;
    Rows bent(shares, count);
    Eigen::Matrix<double, width, width> own_block = Eigen::Matrix<double, width, width>::Zero(count, count);
    Eigen::Matrix<double, width, 1> own_slope = Eigen::Matrix<double, width, 1>::Zero(count);
    for (std::size_t facet = 0; facet < sums.size(); ++facet) {
      const FacetSum& sum = sums[facet];
      if (!sum.any) continue;
      const Index triangle = facets.triangle[facet];
      const Vec3 normal = facets.normal.row(static_cast<Index>(facet));
      const Mat3 outer = normal * normal.transpose();
      const Eigen::Map<const Rows> own(facets.own.data() + static_cast<Index>(facet) * shares * count, shares, count);
      bent = sum.block.lazyProduct(own);
      for (Index k = 0; k < 3; ++k) {
        const Index at = seen.vertex[static_cast<std::size_t>(seen.pattern.triangles(triangle, k))];
        const std::size_t edge = seen.pattern.edges_of[static_cast<std::size_t>(triangle)][static_cast<std::size_t>(k)];
        vertex_blocks_[static_cast<std::size_t>(at)] += sum.block(k, k) * outer;
        edge_blocks_[static_cast<std::size_t>(seen.edge[edge])] += sum.block(k, (k + 1) % 3) * outer;
        Eigen::Map<Corner> cross(cross_.data() + 3 * at * count, 3, count);
        cross -= normal.lazyProduct(bent.row(k));
        surface_slope_.segment<3>(3 * at) -= sum.slope(k) * normal;
      }
      own_block += own.transpose().lazyProduct(bent);
      own_slope += own.transpose().lazyProduct(sum.slope);
    }
    own_block_ += own_block;
    own_slope_ += own_slope;
  };
  constexpr int frame = 6;  // a pose; the camera's is another
  if (seen.own_count == frame) {
    gather.template operator()<frame>();
  } else if (seen.own_count == 2 * frame) {
    gather.template operator()<2 * frame>();
  } else {
    gather.template operator()<Eigen::Dynamic>();
  }
}

/// What is integrated out takes from the form what its modes and the rows have in common.
void SurfaceQuadratic::gather_noise(const Seen& seen, double each) {
  noise_ = seen.rows.shared_noise;
  noise_weight_ = each;
  const SharedNoise::Modes& modes = noise_->modes();
  const Index places = static_cast<Index>(modes.cols());
  MatrixX of_own = MatrixX::Zero(places, seen.own_count);
  VectorX of_residual = VectorX::Zero(places), own_row(seen.own_count);
  std::vector<Eigen::Triplet<double>> entries;
  // Rows of one triangle have most places in common: one entry for all of them.
  std::vector<int> touched;
  std::vector<Mat3> sums(static_cast<std::size_t>(places), Mat3::Zero());
  std::vector<char> met(static_cast<std::size_t>(places), 0);
  const std::vector<Index> order = seen.rows_by_triangle();
  for (std::size_t from = 0; from < order.size();) {
    const Index triangle = seen.triangle_of(order[from]);
    for (; from < order.size() && seen.triangle_of(order[from]) == triangle; ++from) {
      const Index i = order[from];
      Mat3 per_corner;
      if (seen.rows.facets) {
        const FacetSlopes& facets = *seen.rows.facets;
        const Index facet = facets.facet[static_cast<std::size_t>(i)];
        per_corner = -facets.normal.row(facet).transpose() * facets.share.row(i).head<3>();
        own_row = facets.own.middleRows<FacetSlopes::shares>(FacetSlopes::shares * facet).transpose() * facets.share.row(i).transpose();
      } else {
        per_corner = seen.rows.surface[static_cast<std::size_t>(i)].per_corner;
        own_row = seen.rows.jacobian.row(i).segment(seen.own_first, seen.own_count).transpose();
      }
      for (SharedNoise::Modes::InnerIterator mode(modes, i); mode; ++mode) {
        const auto place = static_cast<std::size_t>(mode.col());
        const double share = seen.weight(i) * mode.value();
        if (!met[place]) met[place] = 1, touched.push_back(static_cast<int>(place));
        sums[place] += share * per_corner;
        of_own.row(mode.col()) += share * own_row.transpose();
        of_residual(mode.col()) += share * seen.rows.residual(i);
      }
    }
    for (const int place : touched) {
      for (int k = 0; k < 3; ++k) {
        const int at = static_cast<int>(3 * seen.vertex[static_cast<std::size_t>(seen.pattern.triangles(triangle, k))]);
        for (int axis = 0; axis < 3; ++axis) entries.emplace_back(place, at + axis, sums[static_cast<std::size_t>(place)](axis, k));
      }
      sums[static_cast<std::size_t>(place)].setZero();
      met[static_cast<std::size_t>(place)] = 0;
    }
    touched.clear();
  }
  noise_surface_.resize(places, 3 * static_cast<Index>(seen_.size()));
  noise_surface_.setFromTriplets(entries.begin(), entries.end());

  const MatrixX own = shrunk(of_own);
  const VectorX residual = shrunk(of_residual);
  cost_ -= 0.5 * of_residual.dot(residual);
  own_slope_ -= of_own.transpose() * residual;
  own_block_ -= of_own.transpose() * own;
  surface_slope_ -= noise_surface_.transpose() * residual;
  cross_ -= noise_surface_.transpose() * own;
}

/// The rest surface's error moves every vertex along its normal: what the form says of vertices it says of the error's modes.
void SurfaceQuadratic::append_modes(const StepPrediction& there) {
  const MatrixX basis = there.field->basis()(seen_, Eigen::all);
  const Points normals = there.field_directions(seen_, Eigen::all);
  const Index size = static_cast<Index>(seen_.size()), modes = static_cast<Index>(basis.cols()), own = static_cast<Index>(own_.size());
  const auto along = [&](const RowMajor& of_vertices) {
    MatrixX out(size, of_vertices.cols());
    for (Index v = 0; v < size; ++v) out.row(v) = normals.row(v) * of_vertices.middleRows<3>(3 * v);
    return out;
  };
  RowMajor moves(3 * size, modes);
  for (Index v = 0; v < size; ++v) moves.middleRows<3>(3 * v) = normals.row(v).transpose() * basis.row(v);
  const RowMajor turned = times_blocks(moves);
  MatrixX block(own + modes, own + modes);
  block.topLeftCorner(own, own) = own_block_;
  block.topRightCorner(own, modes) = along(cross_).transpose() * basis;
  block.bottomLeftCorner(modes, own) = block.topRightCorner(own, modes).transpose();
  block.bottomRightCorner(modes, modes) = basis.transpose() * along(turned);
  own_block_ = std::move(block);
  VectorX slope(own + modes);
  slope << own_slope_, basis.transpose() * along(surface_slope_);
  own_slope_ = std::move(slope);
  RowMajor cross(3 * size, own + modes);
  cross << cross_, turned;
  cross_ = std::move(cross);
  for (Index k = 0; k < modes; ++k) own_.push_back(there.field_unknown + static_cast<int>(k));
}

template <int width>
void SurfaceQuadratic::gather(const Seen& seen) {
  using Square = Eigen::Matrix<double, width, width>;
  using Row = Eigen::Matrix<double, width, 1>;
  const Index count = seen.own_count, size = width == Eigen::Dynamic ? 10 + count : width;
  Square gram(size, size);
  Row row = Row::Zero(size);
  const std::vector<Index> order = seen.rows_by_triangle();
  for (std::size_t from = 0; from < order.size();) {
    const Index triangle = seen.triangle_of(order[from]);
    gram.setZero();
    std::size_t to = from;
    for (; to < order.size(); ++to) {
      const Index i = order[to];
      const SurfaceSlope& slope = seen.rows.surface[static_cast<std::size_t>(i)];
      if (slope.triangle != triangle) break;
      for (int k = 0; k < 3; ++k) row.template segment<3>(3 * k) = slope.per_corner.col(k);
      row.segment(9, count) = seen.rows.jacobian.row(i).segment(seen.own_first, count).transpose();
      row(9 + count) = seen.rows.residual(i);
      gram.noalias() += (seen.weight(i) * row) * row.transpose();
    }
    from = to;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      const Index v = seen.pattern.triangles(triangle, k);
      const Index at = seen.vertex[static_cast<std::size_t>(v)];
      const bool upwards = v < seen.pattern.triangles(triangle, next);
      const std::size_t edge = seen.pattern.edges_of[static_cast<std::size_t>(triangle)][static_cast<std::size_t>(k)];
      vertex_blocks_[static_cast<std::size_t>(at)] += gram.template block<3, 3>(3 * k, 3 * k);
      edge_blocks_[static_cast<std::size_t>(seen.edge[edge])] += gram.template block<3, 3>(3 * (upwards ? k : next), 3 * (upwards ? next : k));
      cross_.template middleRows<3>(3 * at) += gram.block(3 * k, 9, 3, count);
      surface_slope_.template segment<3>(3 * at) += gram.template block<3, 1>(3 * k, 9 + count);
    }
    own_block_ += gram.block(9, 9, count, count);
    own_slope_ += gram.col(9 + count).segment(9, count);
  }
}

bool SurfaceQuadratic::renumber(const std::vector<int>& moved) {
  for (int& unknown : own_) unknown = moved[static_cast<std::size_t>(unknown)];
  return std::none_of(own_.begin(), own_.end(), [](int unknown) { return unknown < 0; });
}

/// How far the term's own unknowns have moved a point at most.
double SurfaceQuadratic::of_frame_m(const VectorX& unknowns, const Unknowns& list) const {
  double sum_m = 0;
  for (std::size_t k = 0; k < own_.size(); ++k) {
    const double change = std::abs(unknowns(own_[k]) - own_at_(static_cast<Index>(k)));
    const std::string& unit = list[own_[k]].unit;
    sum_m += unit == "m" ? change : unit == "rad" ? radius_m_ * change : 0;
  }
  return sum_m;
}

double SurfaceQuadratic::moved_m(const StepPrediction& there, const VectorX& unknowns, const Unknowns& list) const {
  double furthest2_m2 = 0;
  for (Index v = 0; v < seen_there_m_.rows(); ++v) {
    const Vec3 now_m = there.surface_m.row(seen_[static_cast<std::size_t>(v)]);
    furthest2_m2 = std::max(furthest2_m2, (now_m - seen_there_m_.row(v).transpose()).squaredNorm());
  }
  return std::sqrt(furthest2_m2) + of_frame_m(unknowns, list);
}

double SurfaceQuadratic::moved_at_most_m(const StepPrediction& there, const VectorX& unknowns, const Unknowns& list) const {
  if (!shares_span(there) || there.field != nullptr) return std::numeric_limits<double>::infinity();
  return there.in_span->at_most_from_m(span_->at) + of_frame_m(unknowns, list);
}

template <int width>
void SurfaceQuadratic::multiply(const RowMajor& columns, Index from, RowMajor& out) const {
  using Strip = Eigen::Matrix<double, Eigen::Dynamic, width, Eigen::RowMajor>;
  const Index used = std::min<Index>(width, static_cast<Index>(columns.cols()) - from);
  Strip strip = Strip::Zero(columns.rows(), width), product(columns.rows(), width);
  strip.leftCols(used) = columns.middleCols(from, used);
  for (std::size_t v = 0; v < vertex_blocks_.size(); ++v) {
    const Index row = 3 * static_cast<Index>(v);
    product.template middleRows<3>(row).noalias() = vertex_blocks_[v] * strip.template middleRows<3>(row);
  }
  for (std::size_t e = 0; e < edge_blocks_.size(); ++e) {
    const auto [low, high] = edges_[e];
    product.template middleRows<3>(3 * low).noalias() += edge_blocks_[e] * strip.template middleRows<3>(3 * high);
    product.template middleRows<3>(3 * high).noalias() += edge_blocks_[e].transpose() * strip.template middleRows<3>(3 * low);
  }
  out.middleCols(from, used) = product.leftCols(used);
}

SurfaceQuadratic::RowMajor SurfaceQuadratic::times_blocks(const RowMajor& columns) const {
  RowMajor out(columns.rows(), columns.cols());
  constexpr Index narrow = 4, wide = 8;  // vector registers
  for (Index from = 0; from < columns.cols();) {
    const bool few = columns.cols() - from <= narrow;
    few ? multiply<narrow>(columns, from, out) : multiply<wide>(columns, from, out);
    from += few ? narrow : wide;
  }
  if (noise_) out -= noise_surface_.transpose() * shrunk(noise_surface_ * columns);
  return out;
}

SurfaceQuadratic::InSpan SurfaceQuadratic::summed_up() const {
  const fem::ResponseSpan& span = *span_->span;
  RowMajor fields(3 * static_cast<Index>(seen_.size()), span_->at.size());
  Index column = 0;
  for (Index load : span_->loads) {
    for (Index field = span.first[static_cast<std::size_t>(load)]; field < span.first[static_cast<std::size_t>(load) + 1]; ++field, ++column)
      for (std::size_t i = 0; i < seen_.size(); ++i)
        fields.col(column).segment<3>(3 * static_cast<Index>(i)) = span.fields.col(field).segment<3>(3 * seen_[i]);
  }
  InSpan out;
  out.block.noalias() = fields.transpose() * times_blocks(fields);
  out.cross.noalias() = fields.transpose() * cross_;
  out.slope.noalias() = fields.transpose() * surface_slope_;
  return out;
}

void SurfaceQuadratic::add_to(const StepPrediction& there, const VectorX& unknowns, const std::vector<int>& places, Evaluation& out) {
  const Index columns = static_cast<Index>(there.columns.size());
  if (shares_span(there) && (in_span_ || there.d_surface.rows() == 0)) {
    if (!in_span_) in_span_ = summed_up();
    RowMajor follow(there.in_span->at.size(), columns + 1);
    follow << there.in_span->d_at, there.in_span->at - span_->at;
    add_form(follow, in_span_->block * follow, in_span_->cross, in_span_->slope, unknowns, places, out);
    return;
  }
  const Index size = static_cast<Index>(seen_.size());
  RowMajor follow(3 * size, columns + 1);
  for (Index i = 0; i < size; ++i) {
    const Index v = seen_[static_cast<std::size_t>(i)];
    follow.block(3 * i, 0, 3, columns) = there.d_surface.middleRows<3>(3 * v);
    follow.block<3, 1>(3 * i, columns) = (there.markers_m().row(v) - seen_m_.row(i)).transpose();
  }
  add_form(follow, times_blocks(follow), cross_, surface_slope_, unknowns, places, out);
}

void SurfaceQuadratic::add_form(const RowMajor& follow, const RowMajor& bent, const RowMajor& cross, const VectorX& slope_there,
                                const VectorX& unknowns, const std::vector<int>& places, Evaluation& out) const {
  const Index columns = static_cast<Index>(follow.cols()) - 1, count = static_cast<Index>(own_.size());
  const VectorX own_moved = unknowns(own_) - own_at_;
  const VectorX moved = follow.col(columns);
  const VectorX turn = bent.col(columns) + cross * own_moved, own_turn = cross.transpose() * moved + own_block_ * own_moved;

  const double gain = slope_there.dot(moved) + own_slope_.dot(own_moved) + 0.5 * bend_ * (moved.dot(turn) + own_moved.dot(own_turn));
  (robust_ ? out.robust_cost : out.cost) += cost_ + gain;
  const auto followed = follow.leftCols(columns).transpose();
  VectorX slope(columns + count);
  slope << followed * (slope_there + bend_ * turn), own_slope_ + bend_ * own_turn;
  MatrixX block(slope.size(), slope.size());
  block.topLeftCorner(columns, columns) = followed * bent.leftCols(columns);
  block.topRightCorner(columns, count) = followed * cross;
  block.bottomLeftCorner(count, columns) = block.topRightCorner(columns, count).transpose();
  block.bottomRightCorner(count, count) = own_block_;
  for (std::size_t a = 0; a < places.size(); ++a) {
    out.gradient(places[a]) += slope(static_cast<Index>(a));
    for (std::size_t b = 0; b < places.size(); ++b) {
      const double entry = block(static_cast<Index>(a), static_cast<Index>(b));
      out.hessian(places[a], places[b]) += entry;
      out.curvature(places[a], places[b]) += bend_ * entry;
      if (robust_) out.robust_hessian(places[a], places[b]) += entry;
    }
  }
}

}  // namespace palpate::estimation
