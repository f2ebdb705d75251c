// SPDX-License-Identifier: Apache-2.0
// What the tool itself measures: its travel and, where the motion is imposed, its force. The torque of a known force is a term
// of its own.
#include <cmath>

#include "palpate/core/error.hpp"
#include "palpate/estimation/names_of_unknowns.hpp"
#include "palpate/estimation/slips.hpp"
#include "palpate/estimation/terms/surface_terms.hpp"

namespace palpate::estimation {
namespace {

class TravelTerm : public Term {
 public:
  /// @param pressed_n  read along the push: the encoder goes on by this times what the compliance is more than stated
  TravelTerm(double travel_m, double sigma_m, Index load, int offset, int compliance, double pressed_n)
      : travel_m_(travel_m), sigma_m_(sigma_m), pressed_n_(pressed_n), load_(load), offset_(offset), compliance_(compliance) {}

  TermRows rows(const StepPrediction& predicted, const VectorX& unknowns, const TermView&) const override {
    TermRows rows;
    rows.unknowns = predicted.columns;
    rows.jacobian = -predicted.d_travel.row(load_) / sigma_m_;
    rows.residual.setConstant(1, (travel_m_ - predicted.travel_m(load_)) / sigma_m_);
    // The encoder's zero is not where contact began, and what is behind it yields: reading = true travel + offset + compliance * force.
    const auto add = [&](int unknown, double share) {
      if (unknown < 0) return;
      rows.residual(0) -= share * unknowns(unknown) / sigma_m_;
      rows.unknowns.push_back(unknown);
      rows.jacobian.conservativeResize(1, rows.jacobian.cols() + 1);
      rows.jacobian(0, rows.jacobian.cols() - 1) = -share / sigma_m_;
    };
    add(offset_, 1);
    add(compliance_, pressed_n_);
    rows.sigma.setConstant(1, sigma_m_);
    rows.unit = "m";
    return rows;
  }
  bool looks_at_surface() const override { return false; }
  double typical_sigma() const override { return sigma_m_; }

 private:
  double travel_m_, sigma_m_, pressed_n_;
  Index load_;
  int offset_, compliance_;
};

class WrenchTerm : public Term {
 public:
  WrenchTerm(const Wrench& wrench, std::size_t load) : wrench_(wrench), load_(load) {
    if (wrench.along.norm() > 0) {
      axes_ = {wrench.along.normalized()};
    } else {
      axes_ = {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()};
    }
  }

  TermRows rows(const StepPrediction& predicted, const VectorX&, const TermView&) const override {
    TermRows rows;
    const Index count = static_cast<Index>(axes_.size());
    rows.unknowns = predicted.columns;
    rows.jacobian.resize(count, predicted.d_force[load_].cols());
    rows.residual.resize(count);
    for (Index k = 0; k < count; ++k) {
      const Vec3& axis = axes_[static_cast<std::size_t>(k)];
      rows.residual(k) = axis.dot(wrench_.force_n - predicted.force_n[load_]) / wrench_.force_sigma_n;
      rows.jacobian.row(k) = -axis.transpose() * predicted.d_force[load_] / wrench_.force_sigma_n;
    }
    rows.sigma.setConstant(count, wrench_.force_sigma_n);
    rows.unit = "N";
    return rows;
  }
  bool looks_at_surface() const override { return false; }
  double typical_sigma() const override { return wrench_.force_sigma_n; }

 private:
  Wrench wrench_;
  std::size_t load_;
  std::vector<Vec3> axes_;
};

}  // namespace

std::unique_ptr<Term> make_travel_term(const ToolTravel& travel, const TermContext& context) {
  const std::size_t load = load_of(context, travel.tool, "travel");
  if (context.model.step(context.step).loads[load].travel_m) return nullptr;  // imposed, not observed
  if (!(travel.sigma_m > 0)) {
    throw Error("the travel needs its standard deviation (sigma_m > 0)", context.model.step(context.step).source + " travel");
  }
  const Push& push = context.model.push(context.step);
  const std::size_t step = context.model.index(context.step).step;
  const Load& loaded = context.model.step(context.step).loads[load];
  const double slip_m = after_slip(push, step) ? slip_std_m(context.model.tool(loaded.tool)) : 0;
  const double offset_std_m = std::hypot(push.travel_offset_std_m, slip_m);
  int offset = -1;
  if (offset_std_m > 0) {
    const std::string name = "travel_zero" + of_stretch(push, step, loaded.tool);
    if (context.shared.count(name) == 0) context.shared[name] = context.unknowns.add({name, "m", 0, offset_std_m});
    offset = context.shared[name];
  }
  // The encoder reads the tip's motion plus what stick and arm give way.
  const double pressed_n = loaded.force_n.value_or(Vec3::Zero()).dot(loaded.direction.normalized());
  const double yielded_m = context.model.tool(loaded.tool).compliance_m_per_n * pressed_n;
  return std::make_unique<TravelTerm>(travel.travel_m - yielded_m, travel.sigma_m, static_cast<Index>(load), offset,
                                      context.model.compliance_unknown(loaded.tool), pressed_n);
}

std::unique_ptr<Term> make_wrench_term(const Wrench& wrench, const TermContext& context) {
  const auto& loads = context.model.step(context.step).loads;
  if (loads.empty()) return nullptr;
  const std::size_t load = load_of(context, wrench.tool, "wrench");
  // An imposed force's reading is the load itself; its torque says where it acts.
  if (!loads[load].travel_m) return make_torque_term(wrench, load, context);
  if (!(wrench.force_sigma_n > 0)) {
    throw Error("the wrench needs its standard deviation (force_sigma_n > 0)",
                context.model.step(context.step).source + " wrench");
  }
  return std::make_unique<WrenchTerm>(wrench, load);
}

}  // namespace palpate::estimation
