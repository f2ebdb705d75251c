// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/shared_noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "palpate/estimation/objective.hpp"

namespace palpate::estimation {
namespace {

constexpr double place_spacing = 0.8;  // of places, in correlation lengths: a smooth field is known from its values there
constexpr double reach = 3;          // correlation lengths at which nothing is left to share
constexpr Index most_places = 600;   // of a frame: beyond, noise reaches so little far that all that counts is wide against it
constexpr Index most_entries = 30000000;  // of all frames' modes: 0.4 GB, and as much again in the forms made of them
constexpr double certain = 4;        // standard deviations from chance, the highest of some twenty lengths
constexpr double likely = 2;         // from where on it pays to look more closely
constexpr double few_products = 6e6, many_products = 1e8;
constexpr int bins = 48;
constexpr double nearby = 0.06, farthest = 0.3;  // of the frame's extent that two points lie apart
constexpr double step_of_length = 1.15;
constexpr double least_own = 0.25;  // of the stated variance

/// Points of one frame that are no outliers, by their place along x, and their residuals. Where the surface is, not where noise has
/// put them: of those that noise has brought close together, too many err alike.
struct Frame {
  Eigen::Matrix<float, Eigen::Dynamic, 3> at_m;
  Eigen::VectorXf residual;

  Index size() const { return static_cast<Index>(residual.size()); }
  Index first_beyond(float x_m) const { return static_cast<Index>(std::lower_bound(at_m.data(), at_m.data() + size(), x_m) - at_m.data()); }
};

Frame frame_of(const TermRows& rows, double cut) {
  std::vector<Index> inside;
  for (Index i = 0; i < rows.residual.size(); ++i)
    if (std::abs(rows.residual(i)) < cut) inside.push_back(i);
  std::sort(inside.begin(), inside.end(), [&](Index a, Index b) { return rows.met_m(a, 0) < rows.met_m(b, 0); });
  return {rows.met_m(inside, Eigen::all).cast<float>(), rows.residual(inside).cast<float>()};
}

bool holds_neighbours(const TermRows& rows) { return rows.robust && !rows.cell.empty() && rows.met_m.rows() == rows.residual.size(); }

/// Frames of one camera, one after the other in a push.
std::vector<std::array<Frame, 2>> pairs_of(const Objective& objective, double cut) {
  const auto& rows = objective.last_rows();
  std::vector<std::array<Frame, 2>> out;
  for (std::size_t s = 0; s + 1 < rows.size(); ++s) {
    if (objective.model().index(s).push != objective.model().index(s + 1).push || rows[s].size() != rows[s + 1].size()) continue;
    for (std::size_t t = 0; t < rows[s].size(); ++t)
      if (holds_neighbours(rows[s][t]) && holds_neighbours(rows[s + 1][t]))
        out.push_back({frame_of(rows[s][t], cut), frame_of(rows[s + 1][t], cut)});
  }
  return out;
}

/// Sums of products of residuals by the distance of their points, up to a longest one.
struct Products {
  double longest_m;
  std::array<double, bins> sum{}, count{};

  void add(const Frame& from, Index i, const Frame& to, bool itself) {
    const float x = from.at_m(i, 0), y = from.at_m(i, 1), z = from.at_m(i, 2), r = from.residual(i);
    const float reach_m = static_cast<float>(longest_m), per_m = static_cast<float>(bins / longest_m);
    for (Index j = to.first_beyond(x - reach_m); j < to.size() && to.at_m(j, 0) < x + reach_m; ++j) {
      const float dx = to.at_m(j, 0) - x, dy = to.at_m(j, 1) - y, dz = to.at_m(j, 2) - z;
      const float bin = per_m * std::sqrt(dx * dx + dy * dy + dz * dz);
      if (!(bin < bins) || (itself && j == i)) continue;
      sum[static_cast<std::size_t>(bin)] += static_cast<double>(r * to.residual(j));
      count[static_cast<std::size_t>(bin)] += 1;
    }
  }
};

/// The same within frames and between them.
struct Compared {
  Products within, across;

  explicit Compared(double longest_m) : within{longest_m}, across{longest_m} {}
  /// @param every  of so many points one is asked for its neighbours
  void add(const std::array<Frame, 2>& pair, Index every) {
    for (const std::size_t k : {0, 1}) {
      for (Index i = every / 2; i < pair[k].size(); i += every) {
        within.add(pair[k], i, pair[k], true);
        across.add(pair[k], i, pair[1 - k], false);
      }
    }
  }
  /// What a shared part that falls over `length_m` explains of the points that lie further apart than `beyond_m`.
  struct Explained {
    double with = 0, alone = 0;
  };
  void explain(double length_m, double beyond_m, Explained& out) const {
    for (std::size_t b = 0; b < bins; ++b) {
      const double d_m = (static_cast<double>(b) + 0.5) * within.longest_m / bins;
      if (within.count[b] == 0 || across.count[b] == 0 || d_m < beyond_m) continue;
      const double falls = std::exp(-0.5 * d_m * d_m / (length_m * length_m));
      const double weight = 1 / (1 / within.count[b] + 1 / across.count[b]);
      out.with += weight * falls * (within.sum[b] / within.count[b] - across.sum[b] / across.count[b]);
      out.alone += weight * falls * falls;
    }
  }
};

/// Many points and what is near them, fewer points and all that may tell of a common error.
NoiseCorrelation best_correlation(const Compared& near, const Compared& far, double mean_square) {
  NoiseCorrelation best;
  const double longest_m = far.within.longest_m / 2;
  for (double length_m = near.within.longest_m / 12; length_m < longest_m; length_m *= step_of_length) {
    Compared::Explained sum;
    near.explain(length_m, 0, sum);
    far.explain(length_m, near.within.longest_m, sum);
    // A product may be in there from either of its ends.
    const double deviate = sum.alone > 0 ? sum.with / std::sqrt(2 * sum.alone) / mean_square : 0;
    if (deviate > best.deviate) best = {sum.with / sum.alone, length_m, 1, deviate};
  }
  return best;
}

/// Places that no two points of are nearer than a spacing, and that all points have one within it of.
class Centres {
 public:
  explicit Centres(double spacing_m) : spacing_m_(spacing_m) {}

  /// Calls visit(number, its place) for those within `reach_m`, of all that were taken.
  template <class Visit>
  void visit(const Vec3& at_m, double reach_m, const Visit& visit) const {
    const Cell low = cell_of(at_m.array() - reach_m), high = cell_of(at_m.array() + reach_m);
    Cell cell;
    for (cell[0] = low[0]; cell[0] <= high[0]; ++cell[0])
      for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1])
        for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2])
          if (const auto found = cells_.find(cell); found != cells_.end())
            for (const Index k : found->second) visit(k, taken_[static_cast<std::size_t>(k)]);
  }
  void take(const Vec3& at_m) {
    bool near = false;
    visit(at_m, spacing_m_, [&](Index, const Vec3& other_m) { near = near || (other_m - at_m).norm() < spacing_m_; });
    if (near) return;
    cells_[cell_of(at_m)].push_back(size());
    taken_.push_back(at_m);
  }
  Index size() const { return static_cast<Index>(taken_.size()); }
  const Vec3& operator[](Index k) const { return taken_[static_cast<std::size_t>(k)]; }

 private:
  using Cell = std::array<int, 3>;
  Cell cell_of(const Vec3& at_m) const {
    const Eigen::Array3i cell = (at_m.array() / spacing_m_).floor().cast<int>();
    return {cell(0), cell(1), cell(2)};
  }
  double spacing_m_;
  std::map<Cell, std::vector<Index>> cells_;
  std::vector<Vec3> taken_;
};

Centres centres_of(const TermRows& rows, const VectorX& weight, double length_m) {
  Centres out(place_spacing * length_m);
  for (Index i = 0; i < weight.size(); ++i)
    if (weight(i) > 0) out.take(rows.met_m.row(i));
  return out;
}

VectorX weight_of(const TermRows& rows, Loss loss) {
  loss.surface_weight = 1;
  return weigh(rows, loss).weight;
}

}  // namespace

std::optional<NoiseCorrelation> correlation_of_noise(const Objective& objective, const Loss& loss) {
  const std::vector<std::array<Frame, 2>> pairs = pairs_of(objective, loss.tukey);
  double extent_m = 0, squares = 0, points = 0, products = 0;
  for (const auto& pair : pairs) {
    for (const Frame& frame : pair) {
      if (frame.size() == 0) continue;
      extent_m = std::max(extent_m, static_cast<double>((frame.at_m.colwise().maxCoeff() - frame.at_m.colwise().minCoeff()).norm()));
      squares += static_cast<double>(frame.residual.squaredNorm());
      points += static_cast<double>(frame.size());
    }
    products += std::pow(static_cast<double>(pair[0].size() + pair[1].size()), 2);
  }
  if (!(extent_m > 0) || !(squares > 0)) return std::nullopt;

  const auto look = [&](double most) {
    Compared near(nearby * extent_m), far(farthest * extent_m);
    const auto every = [&](const Compared& compared) {
      const double seen = std::min(1.0, 2 * std::sqrt(2.0) * compared.within.longest_m / extent_m);
      return static_cast<Index>(std::ceil(std::max(1.0, 2 * seen * products / most)));
    };
    for (const auto& pair : pairs) {
      near.add(pair, every(near));
      far.add(pair, every(far));
    }
    return best_correlation(near, far, squares / points);
  };
  NoiseCorrelation found = look(few_products);
  if (found.deviate > likely) found = look(many_products);
  if (!(found.deviate > certain)) return std::nullopt;
  found.own = std::clamp(squares / points - found.share, least_own, 1.0);
  return found;
}

SharedNoise::SharedNoise(const TermRows& rows, const Loss& loss, const NoiseCorrelation& correlation) : own_(correlation.own), weight_(weight_of(rows, loss) / own_) {
  const Centres centres = centres_of(rows, weight_, correlation.length_m);
  const auto shared = [&](const Vec3& one_m, const Vec3& other_m) {
    return correlation.share * std::exp(-0.5 * (one_m - other_m).squaredNorm() / (correlation.length_m * correlation.length_m));
  };
  prior_.resize(centres.size(), centres.size());
  for (Index k = 0; k < centres.size(); ++k) {
    for (Index l = 0; l < centres.size(); ++l) prior_(k, l) = shared(centres[k], centres[l]);
    prior_(k, k) += 1e-6 * correlation.share;  // places that nearly agree
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (Index i = 0; i < weight_.size(); ++i) {
    if (!(weight_(i) > 0)) continue;
    const Vec3 at_m = rows.met_m.row(i);
    centres.visit(at_m, reach * correlation.length_m, [&](Index k, const Vec3& centre_m) {
      if ((centre_m - at_m).norm() < reach * correlation.length_m)
        entries.emplace_back(static_cast<int>(i), static_cast<int>(k), shared(at_m, centre_m));
    });
  }
  modes_.resize(weight_.size(), centres.size());
  modes_.setFromTriplets(entries.begin(), entries.end());
  MatrixX information = prior_;
  for (Index i = 0; i < modes_.rows(); ++i)
    for (Modes::InnerIterator a(modes_, i); a; ++a)
      for (Modes::InnerIterator b(modes_, i); b && b.col() <= a.col(); ++b) information(a.col(), b.col()) += weight_(i) * a.value() * b.value();
  factor_.compute(information);
}

void SharedNoise::add_cells(const TermRows& rows, double& sum, double& count) const {
  std::map<int, std::pair<VectorX, double>> cells;
  for (Index i = 0; i < weight_.size(); ++i) {
    if (!(weight_(i) > 0)) continue;
    auto& [together, points] = cells.try_emplace(rows.cell[static_cast<std::size_t>(i)], VectorX::Zero(modes_.cols()), 0).first->second;
    for (Modes::InnerIterator a(modes_, i); a; ++a) together(a.col()) += a.value();
    points += 1;
  }
  const Eigen::LLT<MatrixX> prior(prior_);
  for (const auto& [cell, of_cell] : cells) {
    sum += own_ + of_cell.first.dot(prior.solve(of_cell.first)) / of_cell.second;
    count += 1;
  }
}

namespace {

/// The variance of a mean that is wide against the correlation's length, over that of points that err by themselves.
double inflation_of_wide(const Objective& objective, const Loss& loss, const NoiseCorrelation& correlation) {
  constexpr Index some = 300;  // points of a frame that are asked for their neighbours
  double sum = 0, count = 0;
  for (const auto& step : objective.last_rows()) {
    for (const TermRows& rows : step) {
      if (!holds_neighbours(rows)) continue;
      const Frame frame = frame_of(rows, loss.tukey);
      const float reach_m = static_cast<float>(reach * correlation.length_m);
      const Index every = std::max<Index>(1, frame.size() / some);
      for (Index i = every / 2; i < frame.size(); i += every) {
        const float x = frame.at_m(i, 0);
        for (Index j = frame.first_beyond(x - reach_m); j < frame.size() && frame.at_m(j, 0) < x + reach_m; ++j) {
          const double d2 = static_cast<double>((frame.at_m.row(j) - frame.at_m.row(i)).squaredNorm());
          sum += correlation.share * std::exp(-0.5 * d2 / (correlation.length_m * correlation.length_m));
        }
        sum += correlation.own;
        count += 1;
      }
    }
  }
  return count > 0 ? std::max(1.0, sum / count / (correlation.own + correlation.share)) : 1;
}

}  // namespace

std::shared_ptr<const SharedNoises> shared_noise(const Objective& objective, const Loss& loss) {
  const auto correlation = correlation_of_noise(objective, loss);
  if (!correlation) return nullptr;
  auto out = std::make_shared<SharedNoises>();
  out->correlation = *correlation;
  out->of_wide = inflation_of_wide(objective, loss, *correlation);
  double sum = 0, count = 0;
  Index entries = 0;
  for (const auto& step : objective.last_rows()) {
    auto& terms = out->terms.emplace_back();
    for (const TermRows& rows : step) {
      terms.emplace_back();
      if (!holds_neighbours(rows)) continue;
      std::shared_ptr<const SharedNoise> noise;
      if (centres_of(rows, weight_of(rows, loss), correlation->length_m).size() <= most_places)
        noise = std::make_shared<const SharedNoise>(rows, loss, *correlation);
      if (noise) entries += static_cast<Index>(noise->modes().nonZeros());
      if (!noise || entries > most_entries) {
        out->terms.clear();
        return out;
      }
      noise->add_cells(rows, sum, count);
      terms.back() = std::move(noise);
    }
  }
  if (count > 0) out->of_cells = std::max(1.0, sum / count / (correlation->own + correlation->share));
  return out;
}

}  // namespace palpate::estimation
