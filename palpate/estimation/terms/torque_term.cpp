// SPDX-License-Identifier: Apache-2.0
// What a wrist sensor's torque says of a known force: where it really acts.
#include <array>
#include <utility>

#include "palpate/core/cross_matrix.hpp"
#include "palpate/core/error.hpp"
#include "palpate/estimation/load_columns.hpp"
#include "palpate/estimation/names_of_unknowns.hpp"
#include "palpate/estimation/terms/surface_terms.hpp"

namespace palpate::estimation {
namespace {

/// torque = (lever - tip_offset) x force + tare, on the two axes across the push: about its own axis a patch with friction may
/// carry a torque that no simulated load has.
class TorqueTerm : public Term {
 public:
  /// @param tip   first of two unknowns across the push, or -1  @param tare  first of three, or -1
  TorqueTerm(const Wrench& wrench, const TermContext& context, std::size_t load, const Vec3& direction, int tip, int tare)
      : model_(context.model), step_(context.step), load_(load), torque_nm_(wrench.torque_nm), sigma_nm_(wrench.torque_sigma_nm),
        across_(tangents(direction)), tip_(tip), tare_(tare) {}

  TermRows rows(const StepPrediction&, const VectorX& unknowns, const TermView&) const override {
    TermRows rows;
    const ActingForce acting = model_.acting_force(step_, load_, unknowns).value_or(ActingForce{});
    rows.unknowns = acting.unknowns;
    Vec3 lever_m = acting.lever_m, torque_nm = torque_nm_;
    if (tip_ >= 0) lever_m -= unknowns(tip_) * across_[0] + unknowns(tip_ + 1) * across_[1];
    if (tare_ >= 0) torque_nm -= unknowns.segment<3>(tare_);
    torque_nm -= lever_m.cross(acting.force_n);
    // 3 x unknowns, of the torque that is left.
    MatrixX slope(3, 0);
    if (!rows.unknowns.empty()) slope = cross_matrix(acting.force_n) * acting.d_lever - cross_matrix(lever_m) * acting.d_force;
    const auto add = [&](int unknown, const Vec3& d) {
      rows.unknowns.push_back(unknown);
      slope.conservativeResize(3, slope.cols() + 1);
      slope.rightCols<1>() = d;
    };
    for (int k = 0; tip_ >= 0 && k < 2; ++k) add(tip_ + k, across_[static_cast<std::size_t>(k)].cross(acting.force_n));
    for (int k = 0; tare_ >= 0 && k < 3; ++k) add(tare_ + k, -Vec3::Unit(k));
    rows.residual.resize(2);
    rows.jacobian.resize(2, slope.cols());
    for (Index k = 0; k < 2; ++k) {
      const Vec3& axis = across_[static_cast<std::size_t>(k)];
      rows.residual(k) = axis.dot(torque_nm) / sigma_nm_;
      rows.jacobian.row(k) = axis.transpose() * slope / sigma_nm_;
    }
    rows.sigma.setConstant(2, sigma_nm_);
    rows.unit = "N m";
    return rows;
  }
  bool looks_at_surface() const override { return false; }
  bool is_about_object() const override { return false; }
  double typical_sigma() const override { return sigma_nm_; }

 private:
  const ForwardModel& model_;
  std::size_t step_, load_;
  Vec3 torque_nm_;
  double sigma_nm_;
  std::array<Vec3, 2> across_;
  int tip_, tare_;
};

}  // namespace

std::unique_ptr<Term> make_torque_term(const Wrench& wrench, std::size_t load, const TermContext& context) {
  const ForwardModel& model = context.model;
  const Load& pressed = model.step(context.step).loads[load];
  // Of a contact that is exactly known a torque says nothing.
  if (!wrench.has_torque || !model.contact_shifts(context.step, load)) return nullptr;
  const Push& push = model.push(context.step);
  const bool presses = model.acting_force(context.step, load, context.unknowns.prior_mean()).has_value();
  if (!presses && !(push.torque_tare_std_nm > 0)) return nullptr;
  if (!(wrench.torque_sigma_nm > 0)) {
    throw Error("the torque needs its standard deviation (torque_sigma_nm > 0)", model.step(context.step).source + " wrench");
  }
  // Two tools of a push have two sensors, and where they press along different ways two pairs of axes across.
  const auto of_tool = [&](const std::string& what, const char* unit, double std, const std::vector<std::string>& axes) {
    const std::string name = what + of_push(push, pressed.tool);
    const auto [at, fresh] = context.shared.try_emplace(name, -1);
    if (fresh) at->second = context.unknowns.add_block(name, unit, std, axes);
    return at->second;
  };
  const int tip = of_tool("tip_offset", "m", push.tip_std_m, {"_1", "_2"});
  const int tare = of_tool("torque_tare", "N m", push.torque_tare_std_nm, {"_x", "_y", "_z"});
  return std::make_unique<TorqueTerm>(wrench, context, load, pressed.direction, tip, tare);
}

}  // namespace palpate::estimation
