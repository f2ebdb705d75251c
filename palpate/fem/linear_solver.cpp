// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "palpate/core/error.hpp"
#include "palpate/fem/linear_solver/conjugate_gradients.hpp"
#include "palpate/fem/linear_solver/front_factor.hpp"
#include "palpate/fem/linear_solver/large_array.hpp"

namespace palpate::fem {
namespace {

// Nominal costs in seconds, measured on one 3.6 GHz AVX2/AVX-512 core. Only their proportions matter, and only for choosing.
constexpr double kDoubleFlops = 40e9, kFloatFlops = 76e9;  // of a factorisation
constexpr double kSweepBytes = 15e9;                       // of L, both directions of a solve read it
constexpr double kIterationPerBlock = 4e-9;                // one step of conjugate gradients, per 3 x 3 block
constexpr double kSetUpPerBlock = 7e-8;                    // values, diagonal inverses and coarse matrix
constexpr double kAnalysisPerEntry = 6e-8;                 // ordering and symbolic analysis, an entry of the matrix
constexpr double kFirstLookAtMost = 100;                   // steps; residuals may fall hardly at all before
constexpr int kMixedIterations = 4;                        // single precision factor, up to Poisson ratios of 0.49
constexpr double kUsualTolerance = 1e-10;                  // that iterations are guessed for
constexpr int kFirstLookWithAnother = 6;                   // steps, to see how the residual falls
constexpr double kGuessedFall = 1.5;                       // of log residual a step, with the factor of a matrix nearby
constexpr Eigen::Index kAnalyseAtOnceBelow = 3000;         // unknowns: the exact flops are worth the ordering

// Volume meshes of 900 to 600 000 unknowns under nested dissection; thin bodies need less. Quadratic tetrahedra have twice the
// entries a row of linear ones (78 and 38), and separators that are as much heavier.
double guessed_flops(double n, double entries_a_row) { return 0.18 * entries_a_row * n * n; }
double guessed_panel_values(double n, double entries_a_row) { return 0.19 * entries_a_row * std::pow(n, 1.36); }
double guessed_iterations(double n, double entries_a_row, bool rigid_motions) {
  return rigid_motions ? 1.6 * entries_a_row : 5.5 * std::cbrt(n);
}

}  // namespace

const char* name_of(LinearMethod method) {
  switch (method) {
    case LinearMethod::automatic:
      return "automatic";
    case LinearMethod::direct:
      return "direct";
    case LinearMethod::mixed:
      return "mixed";
    case LinearMethod::iterative:
      return "iterative";
  }
  return "unknown";
}

struct LinearSolver::Impl {
  Options options;
  Eigen::SparseMatrix<double> lower;  // the present matrix
  UnknownPlacement placement;
  bool has_values = false;

  // Of the pattern, made when first needed.
  std::shared_ptr<const FrontTree> tree;
  std::unique_ptr<QuotientGraph> graph;
  Aggregates aggregates;
  std::unique_ptr<BlockMatrix> blocks;
  std::unique_ptr<RigidMotionPreconditioner> rigid;
  std::unique_ptr<FrontFactor<double>> factor;
  std::unique_ptr<FrontFactor<float>> small_factor;

  // Of the present matrix.
  enum class State { stale, ready, refused };
  State factor_state = State::stale, small_state = State::stale, rigid_state = State::stale;
  bool blocks_current = false;
  enum class Another { none, single_precision, double_precision };
  Another another = Another::none;  // factor of a matrix before

  double tolerance = 0;         // of the present solve
  double known_iterations = 0;  // of the last iterative solve, as if to the usual tolerance; 0: none yet
  int factorisations = 0;
  double steps_left = 0;        // when conjugate gradients last stopped before the end
  double fall_with_another = kGuessedFall;  // of log residual a step, when a factor of another matrix last served
  double matrices = 0;          // that have been set
  double served = 0;            // right-hand sides solved with the present matrix

  void need_tree() {
    if (!tree) tree = std::make_shared<const FrontTree>(build_front_tree(lower, options.block));
  }
  void need_blocks() {
    if (!blocks) {
      graph = std::make_unique<QuotientGraph>(quotient_graph(lower, std::min(options.block, 3)));
      // Larger aggregates on larger meshes keep the coarse solve below the product with the matrix.
      aggregates = aggregate(*graph, placement, graph->group_count() < 40000 ? 64 : 128);
      blocks = std::make_unique<BlockMatrix>(lower, *graph, aggregates.order);
    }
    if (!blocks_current) blocks->set_values(lower.valuePtr());
    blocks_current = true;
  }
  bool need_rigid() {
    need_blocks();
    if (!rigid) rigid = std::make_unique<RigidMotionPreconditioner>(*blocks, aggregates, placement);
    if (rigid_state == State::stale) rigid_state = rigid->update() ? State::ready : State::refused;
    return rigid_state == State::ready;
  }
  bool need_factor() {
    need_tree();
    if (!factor) factor = std::make_unique<FrontFactor<double>>(tree, options.threads);
    if (factor_state == State::stale) {
      ++factorisations;
      factor_state = factor->factorise(lower.valuePtr(), !options.indefinite) ? State::ready : State::refused;
      another = Another::none;
      fall_with_another = kGuessedFall;
    }
    return factor_state == State::ready;
  }
  bool need_small_factor() {
    need_tree();
    need_blocks();
    if (!small_factor) small_factor = std::make_unique<FrontFactor<float>>(tree, options.threads);
    if (small_state == State::stale) {
      ++factorisations;
      small_state = small_factor->factorise(lower.valuePtr(), true) ? State::ready : State::refused;
      another = Another::none;
      fall_with_another = kGuessedFall;
    }
    return small_state == State::ready;
  }

  double unknowns() const { return static_cast<double>(lower.cols()); }
  double entries() const { return 2.0 * static_cast<double>(lower.nonZeros()); }  // both triangles
  double entries_a_row() const { return entries() / unknowns(); }
  double flops() const { return tree ? tree->flops : guessed_flops(unknowns(), entries_a_row()); }
  double panel_values() const {
    return tree ? static_cast<double>(tree->panel_values) : guessed_panel_values(unknowns(), entries_a_row());
  }
  double block_count() const {
    return blocks ? static_cast<double>(blocks->block_count()) : entries() / 9.0;
  }
  bool fits(double bytes_a_value) const { return 1.5 * panel_values() * bytes_a_value <= options.memory_limit_bytes; }

  // The analysis serves all matrices: each has to bear its share, as if as many were still to come as have been.
  double analysis_cost() const { return tree ? 0 : entries() * kAnalysisPerEntry / std::max(1.0, matrices); }
  double direct_cost(double count) const {
    if (factor_state == State::refused || !fits(8)) return std::numeric_limits<double>::infinity();
    const double sweeps = count <= 2 ? count : 3.0 * std::ceil(count / 16.0);
    const double factorisation = factor_state == State::ready ? 0 : flops() / kDoubleFlops + analysis_cost();
    return factorisation + sweeps * 16.0 * panel_values() / kSweepBytes;
  }
  double mixed_cost(double count) const {
    if (small_state == State::refused || !fits(4)) return std::numeric_limits<double>::infinity();
    const double factorisation = small_state == State::ready ? 0 : flops() / kFloatFlops + analysis_cost();
    return factorisation + count * kMixedIterations * step_cost(8.0);
  }
  /// Of conjugate gradients with a factor. @param sweep_bytes  of L, an entry, both ways
  double step_cost(double sweep_bytes) const { return sweep_bytes * panel_values() / kSweepBytes + kIterationPerBlock * block_count(); }
  double step_cost_with_another() const { return step_cost(another == Another::double_precision ? 16.0 : 8.0); }
  /// With the factor of a matrix before: Newton's matrices differ little from one to the next.
  double cost_with_another(double count) const {
    if (another == Another::none || options.indefinite) return std::numeric_limits<double>::infinity();
    return count * std::max(1.0, std::log(1 / tolerance) / fall_with_another) * step_cost_with_another();
  }
  /// Residuals fall steadily, so a step of Newton's method with a loose one says little of how many a derivative takes.
  double digits_wanted() const { return std::log(1 / tolerance) / std::log(1 / kUsualTolerance); }
  double expected_iterations() const {
    return digits_wanted() * (known_iterations > 0 ? known_iterations : guessed_iterations(unknowns(), entries_a_row(), !placement.empty()));
  }
  double iterative_cost(double count) const {
    if (rigid_state == State::refused) return std::numeric_limits<double>::infinity();
    return (rigid_state == State::ready ? 0 : kSetUpPerBlock * block_count()) +
           count * expected_iterations() * kIterationPerBlock * block_count();
  }

  double cost_of(LinearMethod method, double count) const {
    return method == LinearMethod::direct ? direct_cost(count) : method == LinearMethod::mixed ? mixed_cost(count) : iterative_cost(count);
  }
  LinearMethod choose(double count) {
    // As if as many were still to come as have been: a factor may pay that never does for one alone.
    count += std::max<double>(served, options.expected - served);
    if (options.indefinite) return LinearMethod::direct;
    if (options.method != LinearMethod::automatic) return options.method;
    if (lower.cols() < kAnalyseAtOnceBelow) need_tree();
    const double direct = direct_cost(count), mixed = mixed_cost(count), iterative = iterative_cost(count);
    if (direct <= std::min(mixed, iterative)) return LinearMethod::direct;
    return mixed < iterative ? LinearMethod::mixed : LinearMethod::iterative;
  }

  Outcome refuse(LinearMethod method) const {
    Outcome outcome;
    outcome.used = method;
    outcome.not_positive_definite = !options.indefinite;
    outcome.reason = options.indefinite ? "the matrix is singular: a pivot is zero" : "the matrix is not positive definite";
    return outcome;
  }

  Outcome solve_direct(Eigen::Ref<MatrixX> x) {
    Outcome outcome;
    outcome.used = LinearMethod::direct;
    if (!need_factor()) return refuse(LinearMethod::direct);
    if (!options.indefinite) {
      factor->solve(x.data(), x.cols(), x.outerStride());
      outcome.solved = true;
      return outcome;
    }
    // Without pivoting the factor may lose digits; refinement brings them back, and says when it cannot.
    const MatrixX b = x;
    factor->solve(x.data(), x.cols(), x.outerStride());
    for (int step = 0;; ++step) {
      MatrixX correction = b - lower.selfadjointView<Eigen::Lower>() * x;
      outcome.residual = 0;
      for (Eigen::Index c = 0; c < b.cols(); ++c) {
        const double norm = b.col(c).norm();
        if (norm > 0) outcome.residual = std::max(outcome.residual, correction.col(c).norm() / norm);
        if (!correction.col(c).allFinite()) outcome.residual = std::numeric_limits<double>::infinity();
      }
      if (outcome.residual <= tolerance || step == 3) break;
      factor->solve(correction.data(), correction.cols(), correction.outerStride());
      x += correction;
    }
    outcome.solved = outcome.residual <= tolerance;
    if (!outcome.solved) outcome.reason = "the matrix is nearly singular: the residual stays above the tolerance";
    return outcome;
  }

  /// Conjugate gradients on every column; stops at the first that fails.
  Outcome solve_by_steps(LinearMethod method, Preconditioner& preconditioner, Eigen::Ref<MatrixX> x, const MatrixX* start,
                         const Patience& patience, Eigen::Index& done) {
    Outcome outcome;
    outcome.used = method;
    const std::vector<Index>& padded = blocks->padded();
    VectorX b = VectorX::Zero(blocks->padded_size()), solution(blocks->padded_size());
    // With two threads 30 000 blocks take a fifth longer, 260 000 a tenth less.
    constexpr Index kBlocksForThreads = 100000;
    const int threads = blocks->block_count() > kBlocksForThreads ? options.threads : 1;
    for (; done < x.cols(); ++done) {
      solution.setZero();
      for (Eigen::Index u = 0; u < x.rows(); ++u) b[padded[static_cast<std::size_t>(u)]] = x(u, done);
      if (start != nullptr) {
        for (Eigen::Index u = 0; u < x.rows(); ++u) solution[padded[static_cast<std::size_t>(u)]] = (*start)(u, done);
      }
      const ConjugateGradientsResult result =
          conjugate_gradients(*blocks, aggregates, preconditioner, b, solution, tolerance, patience, threads);
      outcome.iterations = std::max(outcome.iterations, result.iterations);
      outcome.residual = std::max(outcome.residual, result.residual);
      steps_left = std::min<double>(result.steps_left, options.max_iterations);
      if (!result.converged) {
        outcome.not_positive_definite = result.negative_curvature;
        outcome.reason = result.negative_curvature ? "the matrix is not positive definite"
                                                   : "conjugate gradients did not reach the tolerance in " +
                                                         std::to_string(result.iterations) + " steps";
        return outcome;
      }
      for (Eigen::Index u = 0; u < x.rows(); ++u) x(u, done) = solution[padded[static_cast<std::size_t>(u)]];
    }
    outcome.solved = true;
    return outcome;
  }

  Outcome solve_mixed(Eigen::Ref<MatrixX> x, const MatrixX* start, Eigen::Index& done) {
    if (!need_small_factor()) return refuse(LinearMethod::mixed);
    FactorPreconditioner<float> preconditioner(*small_factor, blocks->padded());
    const Patience patience{.max_iterations = std::min(options.max_iterations, 100)};
    return solve_by_steps(LinearMethod::mixed, preconditioner, x, start, patience, done);
  }

  /// @param otherwise  what any other way would cost
  Outcome solve_with_another(Eigen::Ref<MatrixX> x, const MatrixX* start, double otherwise, Eigen::Index& done) {
    need_blocks();
    const double worth = otherwise / (static_cast<double>(x.cols()) * step_cost_with_another());
    const Patience patience{.max_iterations = std::max(kFirstLookWithAnother, static_cast<int>(2 * worth)),
                            .first_look = kFirstLookWithAnother,
                            .worth = worth};
    const auto by = [&](auto preconditioner) { return solve_by_steps(LinearMethod::mixed, preconditioner, x, start, patience, done); };
    const Outcome outcome = another == Another::double_precision ? by(FactorPreconditioner<double>(*factor, blocks->padded()))
                                                                 : by(FactorPreconditioner<float>(*small_factor, blocks->padded()));
    if (outcome.iterations > 0 && outcome.residual > 0)
      fall_with_another = std::max(1e-3, -std::log(outcome.residual) / outcome.iterations);
    return outcome;
  }

  Outcome solve_iterative(Eigen::Ref<MatrixX> x, const MatrixX* start, Eigen::Index& done) {
    if (!need_rigid()) return refuse(LinearMethod::iterative);
    // Automatic: where more steps are left than a right-hand side's share of the factor would take, the factor takes over.
    Patience patience{.max_iterations = options.max_iterations};
    if (options.method == LinearMethod::automatic && fits(4)) {
      const double count = served;
      patience.worth = mixed_cost(count) / (count * kIterationPerBlock * block_count());
      patience.first_look = static_cast<int>(std::min(kFirstLookAtMost, std::max(patience.worth, 1.5 * expected_iterations())));
    }
    const Outcome outcome = solve_by_steps(LinearMethod::iterative, *rigid, x, start, patience, done);
    known_iterations = (outcome.iterations + steps_left) / digits_wanted();
    return outcome;
  }

  Outcome solve(Eigen::Ref<MatrixX> x, const MatrixX* start) {
    const LinearMethod method = choose(static_cast<double>(x.cols()));
    served += static_cast<double>(x.cols());
    const bool automatic = options.method == LinearMethod::automatic;
    Eigen::Index done = 0;
    Outcome outcome;
    const double otherwise = automatic ? cost_of(method, served) : 0;
    if (cost_with_another(served) < otherwise) {
      outcome = solve_with_another(x, start, otherwise, done);
      if (outcome.solved || outcome.not_positive_definite) return outcome;
    }
    if (method == LinearMethod::iterative) {
      outcome = solve_iterative(x, start, done);
      if (outcome.solved || outcome.not_positive_definite || !automatic) return outcome;
    }
    if (method == LinearMethod::mixed || (method == LinearMethod::iterative && fits(4))) {
      const int iterations = outcome.iterations;
      outcome = solve_mixed(x, start, done);
      outcome.iterations += iterations;
      if (outcome.solved || !automatic) return outcome;
    }
    // Single precision may refuse a matrix that is definite in double precision.
    if (method == LinearMethod::direct || fits(8)) outcome = solve_direct(x.rightCols(x.cols() - done));
    return outcome;
  }
};

LinearSolver::LinearSolver() : LinearSolver(Options{}) {}
LinearSolver::LinearSolver(Options options) : impl_(std::make_unique<Impl>()) {
  if (options.block < 1) throw Error("must be at least 1", "LinearSolver::Options::block");
  if (options.threads < 1) throw Error("must be at least 1", "LinearSolver::Options::threads");
  if (!(options.tolerance > 0)) throw Error("must be positive", "LinearSolver::Options::tolerance");
  impl_->options = options;
}
LinearSolver::~LinearSolver() = default;
LinearSolver::LinearSolver(LinearSolver&&) noexcept = default;
LinearSolver& LinearSolver::operator=(LinearSolver&&) noexcept = default;

void LinearSolver::analyse(const Eigen::SparseMatrix<double>& lower, UnknownPlacement placement) {
  if (lower.rows() != lower.cols() || !lower.isCompressed()) {
    throw Error("the matrix must be square and compressed", "LinearSolver::analyse");
  }
  if (!placement.empty() && (placement.point_m.rows() != lower.cols() || placement.direction.rows() != lower.cols())) {
    throw Error("needs one point and one direction for each of the " + std::to_string(lower.cols()) + " unknowns",
                "LinearSolver::analyse placement");
  }
  const Options options = impl_->options;
  impl_ = std::make_unique<Impl>();
  impl_->options = options;
  // Copied by hand, so that the copy lies in large pages.
  Eigen::SparseMatrix<double>& own = impl_->lower;
  own.resize(lower.rows(), lower.cols());
  own.resizeNonZeros(lower.nonZeros());
  const auto entries = static_cast<std::size_t>(lower.nonZeros());
  ask_for_large_pages(own.valuePtr(), entries * sizeof(double));
  ask_for_large_pages(own.innerIndexPtr(), entries * sizeof(Index));
  std::copy_n(lower.outerIndexPtr(), lower.cols() + 1, own.outerIndexPtr());
  std::copy_n(lower.innerIndexPtr(), lower.nonZeros(), own.innerIndexPtr());
  impl_->placement = std::move(placement);
}

void LinearSolver::set_matrix(const Eigen::SparseMatrix<double>& lower) {
  Impl& impl = *impl_;
  if (lower.cols() == 0 || lower.cols() != impl.lower.cols() || lower.nonZeros() != impl.lower.nonZeros()) {
    throw Error("call analyse() with this matrix's pattern first", "LinearSolver::set_matrix");
  }
  std::copy_n(lower.valuePtr(), lower.nonZeros(), impl.lower.valuePtr());
  impl.has_values = true;
  impl.matrices += 1;
  impl.served = 0;
  impl.blocks_current = false;
  if (impl.factor_state == Impl::State::ready) impl.another = Impl::Another::double_precision;
  if (impl.small_state == Impl::State::ready) impl.another = Impl::Another::single_precision;  // half as much to read
  impl.factor_state = impl.small_state = impl.rigid_state = Impl::State::stale;
}

LinearSolver::Outcome LinearSolver::solve_in_place(Eigen::Ref<MatrixX> right_hand_sides, const MatrixX* start,
                                                   double tolerance) {
  Impl& impl = *impl_;
  impl.tolerance = tolerance > 0 ? tolerance : impl.options.tolerance;
  if (!impl.has_values) throw Error("call set_matrix() first", "LinearSolver::solve_in_place");
  if (right_hand_sides.rows() != impl.lower.cols()) {
    throw Error("right-hand sides have " + std::to_string(right_hand_sides.rows()) + " rows, the matrix has " +
                    std::to_string(impl.lower.cols()),
                "LinearSolver::solve_in_place");
  }
  if (start != nullptr && (start->rows() != right_hand_sides.rows() || start->cols() != right_hand_sides.cols())) {
    throw Error("starting points must have the shape of the right-hand sides", "LinearSolver::solve_in_place start");
  }
  const int before = impl.factorisations;
  Outcome outcome = impl.solve(right_hand_sides, start);
  outcome.factorisations = impl.factorisations - before;
  return outcome;
}

int LinearSolver::negative_pivots() const {
  return impl_->factor_state == Impl::State::ready ? impl_->factor->negative_pivots() : 0;
}

}  // namespace palpate::fem
