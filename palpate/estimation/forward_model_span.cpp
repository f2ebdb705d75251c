// SPDX-License-Identifier: Apache-2.0
// A linear body's surface as a sum of few fields.
#include <cmath>

#include "palpate/estimation/forward_model_parts.hpp"

namespace palpate::estimation {

VectorX SpanPlace::moved_m() const {
  VectorX moved_m = VectorX::Zero(span->fields.rows());
  Index row = 0;
  for (Index load : loads) {
    const Index count = span->count_of(load);
    moved_m.noalias() += span->fields.middleCols(span->first[static_cast<std::size_t>(load)], count) * at.segment(row, count);
    row += count;
  }
  return moved_m;
}

double SpanPlace::at_most_from_m(const VectorX& other) const {
  double sum = 0;
  Index row = 0;
  for (Index load : loads) {
    const Index count = span->count_of(load);
    sum += (at - other).segment(row, count).cwiseAbs().dot(span->reach_m.segment(span->first[static_cast<std::size_t>(load)], count));
    row += count;
  }
  return sum;
}

/// Nothing where the surface is not such a sum: a clamp turns it, or it slides.
std::optional<SpanPlace> ForwardModel::place_in_span(std::size_t s, const Body& body, const Coefficients& c,
                                                     const VectorX& unknowns) const {
  if (moves_as_a_whole(s) || slide_[s] >= 0) return std::nullopt;
  SpanPlace out;
  out.span = body.response->span(unknowns(poisson));
  if (!out.span) return std::nullopt;
  const Index forces = static_cast<Index>(c.force.size()), motions = static_cast<Index>(c.motion.size());
  Index size = 0;
  const auto acts = [&](Index load) {
    if (load >= forces) return c.motion(load - forces) != 0 || !c.d_motion.row(load - forces).isZero(0);
    // The three directions of a force that unknowns turn come together: which of them are zero changes from place to place.
    return c.force(load) != 0 || !c.d_force.middleRows<3>(load - load % 3).isZero(0);
  };
  for (Index load = 0; load < forces + motions; ++load) {
    if (!acts(load)) continue;
    out.loads.push_back(load);
    size += out.span->count_of(load);
  }
  const fem::ResponseSpan::Terms terms = out.span->terms_at(unknowns(poisson));
  const double per_young = std::exp(-unknowns(log_young));
  out.at.resize(size);
  out.d_at.resize(size, 2 + static_cast<Index>(c.columns.size()));
  Index first = 0;
  for (Index load : out.loads) {
    const MatrixX& share = out.span->share[static_cast<std::size_t>(load)];
    const Index count = out.span->count_of(load);
    const VectorX here = share * terms.value;
    const bool pushes = load < forces;
    const Index row = pushes ? load : load - forces;
    const double size_of_load = pushes ? per_young * c.force(row) : c.motion(row);
    auto d = out.d_at.middleRows(first, count);
    out.at.segment(first, count) = size_of_load * here;
    d.col(0) = pushes ? VectorX(-size_of_load * here) : VectorX(VectorX::Zero(count));
    d.col(1) = size_of_load * (share * terms.d_poisson);
    d.rightCols(d.cols() - 2) = here * (pushes ? MatrixX(per_young * c.d_force.row(row)) : MatrixX(c.d_motion.row(row)));
    first += count;
  }
  return out;
}

}  // namespace palpate::estimation
