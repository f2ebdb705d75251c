// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/conjugate_gradients.hpp"

#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace palpate::fem {
namespace {

constexpr int kStepsToNextLook = 50;

struct Vectors {
  explicit Vectors(Eigen::Index size, Index aggregates)
      : r(VectorX::Zero(size)),
        z(VectorX::Zero(size)),
        p(VectorX::Zero(size)),
        q(VectorX::Zero(size)),
        partial(aggregates) {}
  VectorX r, z, p, q, partial;
};

/// One member's run through the iteration; every member takes the same decisions from the same sums.
class Member {
 public:
  Member(const BlockMatrix& matrix, const Aggregates& aggregates, Preconditioner& preconditioner, const VectorX& b,
         VectorX& x, Vectors& v, const ThreadTeam& team)
      : matrix_(matrix),
        aggregates_(aggregates),
        preconditioner_(preconditioner),
        b_(b),
        x_(x),
        v_(v),
        team_(team),
        share_(share_of(team, aggregates.count())) {}

  ConjugateGradientsResult run(double tolerance, const Patience& patience) {
    ConjugateGradientsResult result;
    const double norm_b = std::sqrt(sum([&](Index a) { return rows(b_, a).squaredNorm(); }));
    if (norm_b == 0 || !std::isfinite(norm_b)) {
      for_share([&](Index a) { rows(x_, a).setZero(); });
      result.converged = norm_b == 0;
      return result;
    }
    double best = std::numeric_limits<double>::infinity();
    norms_.clear();
    while (true) {
      const double residual = true_residual() / norm_b;
      if (norms_.empty()) norms_.push_back(residual * norm_b);
      result.residual = residual;
      if (residual <= tolerance) {
        result.converged = true;
        return result;
      }
      // A restart that does not at least halve the true residual has met the limit of the arithmetic.
      if (!(residual < 0.5 * best) || result.iterations >= patience.max_iterations) return result;
      if (result.negative_curvature || impatient_) return result;
      best = residual;
      iterate(tolerance * norm_b, patience, result);
    }
  }

 private:
  Eigen::VectorBlock<const VectorX> rows(const VectorX& v, Index a) const {
    const Index first = aggregates_.begin[static_cast<std::size_t>(a)],
                last = aggregates_.begin[static_cast<std::size_t>(a) + 1];
    return v.segment(3 * first, 3 * (last - first));
  }
  Eigen::VectorBlock<VectorX> rows(VectorX& v, Index a) const {
    const Index first = aggregates_.begin[static_cast<std::size_t>(a)],
                last = aggregates_.begin[static_cast<std::size_t>(a) + 1];
    return v.segment(3 * first, 3 * (last - first));
  }
  template <class Do>
  void for_share(const Do& act) const {
    for (Index a = share_.first; a < share_.last; ++a) act(a);
  }
  /// Sum over all aggregates, the same on every member.
  template <class Term>
  double sum(const Term& term) {
    for_share([&](Index a) { v_.partial[a] = term(a); });
    team_.meet();
    const double total = std::accumulate(v_.partial.data(), v_.partial.data() + v_.partial.size(), 0.0);
    team_.meet();  // nobody writes the next terms before all have read these
    return total;
  }
  void multiply(const VectorX& x, VectorX& y, Index a) const {
    matrix_.multiply(x.data(), y.data(), aggregates_.begin[static_cast<std::size_t>(a)],
                     aggregates_.begin[static_cast<std::size_t>(a) + 1]);
  }

  double true_residual() {
    team_.meet();  // x is complete
    return std::sqrt(sum([&](Index a) {
      multiply(x_, v_.r, a);
      rows(v_.r, a) = rows(b_, a) - rows(v_.r, a);
      return rows(v_.r, a).squaredNorm();
    }));
  }

  /// Steps that are left when the residual goes on falling as it has over the last half of all steps: the first ones often
  /// fall hardly at all, and then the fall is steady. Infinity: it does not fall.
  double steps_left(double target) const {
    const std::size_t steps = norms_.size() - 1, from = steps / 2;
    const double fall = std::log(norms_[from] / norms_[steps]) / static_cast<double>(steps - from);
    return fall > 0 ? std::log(norms_[steps] / target) / fall : std::numeric_limits<double>::infinity();
  }

  void iterate(double target, const Patience& patience, ConjugateGradientsResult& result) {
    preconditioner_.apply(v_.r.data(), v_.z.data(), team_);
    double r_z = sum([&](Index a) {
      rows(v_.p, a) = rows(v_.z, a);
      return rows(v_.r, a).dot(rows(v_.z, a));
    });
    while (result.iterations < patience.max_iterations) {
      ++result.iterations;
      const double p_q = sum([&](Index a) {
        multiply(v_.p, v_.q, a);
        return rows(v_.p, a).dot(rows(v_.q, a));
      });
      if (!(p_q > 0) || !(r_z > 0)) {
        result.negative_curvature = p_q < 0 || r_z < 0;
        return;
      }
      const double step = r_z / p_q;
      const double r_r = sum([&](Index a) {
        rows(x_, a) += step * rows(v_.p, a);
        rows(v_.r, a) -= step * rows(v_.q, a);
        return rows(v_.r, a).squaredNorm();
      });
      norms_.push_back(std::sqrt(r_r));
      if (!(norms_.back() > target)) return;
      if (result.iterations >= patience.first_look && (result.iterations - patience.first_look) % kStepsToNextLook == 0) {
        const double left = steps_left(target);
        impatient_ = left > patience.worth;
        if (impatient_) {
          result.steps_left = left;
          return;
        }
      }
      preconditioner_.apply(v_.r.data(), v_.z.data(), team_);
      const double next = sum([&](Index a) { return rows(v_.r, a).dot(rows(v_.z, a)); });
      const double beta = next / r_z;
      r_z = next;
      for_share([&](Index a) { rows(v_.p, a) = rows(v_.z, a) + beta * rows(v_.p, a); });
      team_.meet();
    }
  }

  const BlockMatrix& matrix_;
  const Aggregates& aggregates_;
  Preconditioner& preconditioner_;
  const VectorX& b_;
  VectorX& x_;
  Vectors& v_;
  const ThreadTeam& team_;
  Share share_;
  std::vector<double> norms_;  // of the residual: at the start, after every step
  bool impatient_ = false;
};

}  // namespace

ConjugateGradientsResult conjugate_gradients(const BlockMatrix& matrix, const Aggregates& aggregates,
                                             Preconditioner& preconditioner, const VectorX& b, VectorX& x, double tolerance,
                                             const Patience& patience, int threads) {
  Vectors vectors(matrix.padded_size(), aggregates.count());
  ConjugateGradientsResult result;
  run_team(threads, [&](const ThreadTeam& team) {
    const ConjugateGradientsResult mine =
        Member(matrix, aggregates, preconditioner, b, x, vectors, team).run(tolerance, patience);
    if (team.id == 0) result = mine;
  });
  return result;
}

}  // namespace palpate::fem
