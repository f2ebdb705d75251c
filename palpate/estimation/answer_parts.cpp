// SPDX-License-Identifier: Apache-2.0
#include "palpate/estimation/answer_parts.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/estimation/mesh_error.hpp"

namespace palpate::estimation {
namespace {

constexpr double z_95 = 1.959963984540054;

/// The rest surface's slow error as one number: its rms over the surface.
Nuisance rest_surface_from(const StepPrediction& predicted, const Optimum& optimum, const MatrixX& covariance,
                           const std::vector<int>& moving) {
  const SurfaceField& field = *predicted.field;
  const Index first = static_cast<Index>(std::find(moving.begin(), moving.end(), predicted.field_unknown) - moving.begin());
  const MatrixX& basis = field.basis();
  const double vertices = static_cast<double>(basis.rows());
  Nuisance nuisance;
  nuisance.name = "rest_surface";
  nuisance.unit = "m";
  nuisance.value = (basis * optimum.unknowns.segment(predicted.field_unknown, field.modes())).norm() / std::sqrt(vertices);
  const MatrixX block = covariance.block(first, first, field.modes(), field.modes());
  nuisance.std = std::sqrt(std::max(0.0, (basis * block).cwiseProduct(basis).sum() / vertices));
  nuisance.lower_95 = std::max(0.0, nuisance.value - z_95 * nuisance.std);
  nuisance.upper_95 = nuisance.value + z_95 * nuisance.std;
  nuisance.prior_std = field.std_m();
  nuisance.pull = nuisance.value / nuisance.prior_std;
  return nuisance;
}

}  // namespace

Parameter young_from(const Posterior& posterior, const std::string& region) {
  Parameter young{"young_modulus", region, "Pa"};
  young.value = std::exp(posterior.log_young_quantile(0.5));
  young.std = young.value * posterior.log_young_std_total();
  young.lower_95 = std::exp(posterior.log_young_quantile(0.025));
  young.upper_95 = std::exp(posterior.log_young_quantile(0.975));
  young.determined = posterior.log_young_std_total() < 0.5;
  return young;
}

std::vector<Parameter> parameters_from(const std::vector<Posterior>& regions, const OwnPoisson& own, const Unknowns& unknowns,
                                       const std::vector<std::string>& names) {
  const auto name = [&](std::size_t r) { return names.empty() ? std::string() : names[r]; };
  std::vector<Parameter> out{young_from(regions.front(), name(0)),
                             ratio_from(regions.front(), unknowns[poisson], own.mean.size() > 0 ? name(0) : std::string())};
  for (std::size_t r = 1; r < regions.size(); ++r) out.push_back(young_from(regions[r], name(r)));
  for (Parameter& one : own.parameters(unknowns, names)) out.push_back(std::move(one));
  return out;
}

Parameter ratio_from(const Posterior& posterior, const Unknown& nu, const std::string& region) {
  Parameter ratio{"poisson_ratio", region, "1"};
  ratio.value = posterior.poisson_quantile(0.5);
  ratio.std = posterior.poisson_std();
  ratio.lower_95 = posterior.poisson_quantile(0.025);
  ratio.upper_95 = posterior.poisson_quantile(0.975);
  // A uniform prior has the standard deviation range / sqrt(12); data that leave 60 % of it say little.
  ratio.determined = nu.fixed || ratio.std < 0.6 * (nu.upper - nu.lower) / std::sqrt(12.0);
  return ratio;
}

MatrixX covariance_of(const std::vector<Posterior>& regions) {
  const Index count = static_cast<Index>(regions.size());
  MatrixX out = MatrixX::Zero(1 + count, 1 + count);
  const auto place = [](Index region) { return region == 0 ? 0 : region + 1; };
  const Posterior& first = regions.front();
  const auto about_mean = [&](const VectorX& values) { return VectorX(values.array() - first.weight.dot(values)); };
  out(1, 1) = first.covariance(1, 1);
  for (Index a = 0; a < count; ++a) {
    const Posterior& one = regions[static_cast<std::size_t>(a)];
    out(place(a), 1) = out(1, place(a)) = one.covariance(0, 1);
    for (Index b = 0; b < count; ++b) {
      const Posterior& other = regions[static_cast<std::size_t>(b)];
      const VectorX given_poisson = first.correlation(a, b) * one.log_young_std.cwiseProduct(other.log_young_std);
      out(place(a), place(b)) =
          first.weight.dot(about_mean(one.log_young_mean).cwiseProduct(about_mean(other.log_young_mean)) + given_poisson);
    }
  }
  return out;
}

void widen_together(std::vector<Posterior>& regions, const AnswerShift& shift, double poisson_lower, double poisson_upper) {
  // Of two regions what they share given nu, and so do widened ones: all of it less what goes along their ridges over nu.
  struct Before {
    VectorX std;
    double variance, slope;
  };
  std::vector<Before> before;
  for (const Posterior& one : regions) {
    const double variance = one.covariance(1, 1);
    before.push_back({one.log_young_std, variance, variance > 0 ? one.covariance(0, 1) / variance : 0});
  }
  const VectorX weight = regions.front().weight;
  for (std::size_t r = 0; r < regions.size(); ++r) widen(regions[r], shift.of_region(static_cast<Index>(r)), poisson_lower, poisson_upper);
  Posterior& first = regions.front();
  const bool nu_is_known = first.poisson.size() < 2;
  const double variance = before.front().variance, wider = variance + shift.poisson * shift.poisson;
  for (std::size_t a = 0; a < regions.size(); ++a) {
    for (std::size_t b = a + 1; b < regions.size(); ++b) {
      const Index at_a = static_cast<Index>(a), at_b = static_cast<Index>(b);
      const double young_a = shift.of_region(at_a).log_young, young_b = shift.of_region(at_b).log_young;
      double more = young_a * young_b;
      if (!nu_is_known && wider > 0) {
        const double along = before[a].slope * before[b].slope * variance;
        more += along - (before[a].slope * variance + young_a * shift.poisson) * (before[b].slope * variance + young_b * shift.poisson) / wider;
      }
      const double shared = first.correlation(at_a, at_b) * weight.dot(before[a].std.cwiseProduct(before[b].std)) + more;
      const double most = first.weight.dot(regions[a].log_young_std.cwiseProduct(regions[b].log_young_std));
      first.correlation(at_a, at_b) = first.correlation(at_b, at_a) = std::clamp(most > 0 ? shared / most : 0, -1.0, 1.0);
    }
  }
}

MatrixX with_shared(MatrixX covariance, Index others, const std::vector<AnswerShift>& errors) {
  const Index count = static_cast<Index>(covariance.rows()), own = count - others;
  MatrixX products = MatrixX::Zero(count, count);
  for (const AnswerShift& error : errors) {
    if (own == 0 || error.region_poisson.size() != own) continue;
    VectorX all(count);
    all << error.log_young, error.poisson, error.region_log_young, error.region_poisson;
    products += all * all.transpose();
  }
  if (products.isZero(0)) return covariance;
  // The correlations are those from before these errors.
  constexpr double left = 0.01;
  const VectorX total = covariance.diagonal().cwiseMax(1e-300);
  const VectorX share = ((total - products.diagonal()).cwiseMax(left * total).cwiseQuotient(total)).cwiseSqrt();
  const VectorX diagonal = covariance.diagonal();
  const MatrixX corrected = share.asDiagonal() * covariance * share.asDiagonal() + products;
  const MatrixX known = covariance.topLeftCorner(others, others);
  covariance = corrected;
  covariance.topLeftCorner(others, others) = known;
  covariance.diagonal() = diagonal;
  return covariance;
}

std::vector<Nuisance> nuisances_from(const Objective& objective, const Optimum& optimum, const MatrixX& covariance,
                                     const std::vector<int>& moving) {
  const Unknowns& list = objective.unknowns();
  std::vector<Nuisance> out;
  for (std::size_t k = 0; k < moving.size(); ++k) {
    if (moving[k] < list.parameter_count() || list[moving[k]].name.rfind("rest_surface[", 0) == 0) continue;
    const Unknown& unknown = list[moving[k]];
    Nuisance nuisance;
    nuisance.name = unknown.name;
    nuisance.unit = unknown.unit;
    nuisance.value = optimum.unknowns(moving[k]);
    nuisance.std = std::sqrt(std::max(covariance(static_cast<Index>(k), static_cast<Index>(k)), 0.0));
    nuisance.lower_95 = nuisance.value - z_95 * nuisance.std;
    nuisance.upper_95 = nuisance.value + z_95 * nuisance.std;
    nuisance.prior_std = unknown.prior_std;
    nuisance.pull = (nuisance.value - unknown.prior_mean) / unknown.prior_std;
    out.push_back(nuisance);
  }
  for (const auto& predicted : objective.last_predictions()) {
    if (predicted.field == nullptr) continue;
    out.push_back(rest_surface_from(predicted, optimum, covariance, moving));
    break;
  }
  return out;
}

FitSummary summary_of(const Unknowns& unknowns, const Optimum& optimum, const ResidualSummary& residuals) {
  double pulls = 0;
  std::size_t flat = 0;
  for (int k : free_unknowns(unknowns)) {
    if (!std::isfinite(unknowns[k].prior_std)) {
      ++flat;
    } else {
      pulls += std::pow((optimum.unknowns(k) - unknowns[k].prior_mean) / unknowns[k].prior_std, 2);
    }
  }
  FitSummary out;
  out.points_used = residuals.rows + residuals.missed - residuals.outliers;
  out.rms_m = residuals.lengths > 0 ? std::sqrt(residuals.sum_squared_m2 / static_cast<double>(residuals.lengths)) : HeldOut::unknown;
  const double tested = static_cast<double>(residuals.rows + residuals.missed) - static_cast<double>(residuals.outliers + flat);
  out.chi2_per_dof = (residuals.chi2 + pulls) / std::max(1.0, tested);
  return out;
}

}  // namespace palpate::estimation
