// SPDX-License-Identifier: Apache-2.0
// A bar pressed between smooth platens: the state is homogeneous, so any mesh is exact, and forces have closed forms.
#pragma once

#include <cmath>

#include "palpate/estimation/fit.hpp"
#include "scenes.hpp"

namespace palpate::estimation {

inline const Vec3 bar_m(0.03, 0.02, 0.05);

/// Force on a bar that is shortened by `travel_m` and free to bulge.
inline double linear_force_n(double young_pa, double, double travel_m) {
  return young_pa * bar_m.x() * bar_m.y() * travel_m / bar_m.z();
}

/// W = mu/2 (I1 - 3) - mu ln J + lambda/2 ln(J)^2: P = mu (F - F^-T) + lambda ln(J) F^-T with stretches (s, s, l); s from
/// P_xx = 0.
inline double neo_hookean_force_n(double young_pa, double nu, double travel_m) {
  const double mu = young_pa / (2 * (1 + nu)), lambda = young_pa * nu / ((1 + nu) * (1 - 2 * nu));
  const double l = 1 - travel_m / bar_m.z();
  double low = 0.5, high = 3;
  for (int i = 0; i < 200; ++i) {
    const double s = 0.5 * (low + high);
    (mu * (s - 1 / s) + lambda * std::log(s * s * l) / s < 0 ? low : high) = s;
  }
  const double p_zz = mu * (l - 1 / l) + lambda * std::log(low * low * l) / l;
  return -p_zz * bar_m.x() * bar_m.y();
}

/// W of one term (Ogden 1972, Hill 1978) with exponent 4: free flanks ask for s = l^-nu, and P = 2 mu / (4 l) (l^4 - l^(-4 nu)).
inline double foam_force_n(double young_pa, double nu, double travel_m) {
  const double l = 1 - travel_m / bar_m.z();
  return young_pa / (4 * (1 + nu) * l) * (std::pow(l, -4 * nu) - std::pow(l, 4)) * bar_m.x() * bar_m.y();
}

inline Recording pressed_bar(double (*force_n)(double, double, double), double young_pa, double nu) {
  Recording recording;
  recording.supports = {sliding("table", Vec3::Zero(), Vec3::UnitZ())};
  Tool plate;
  plate.name = "plate";
  plate.shape = ToolShape::platen;
  plate.plane = {Vec3(0, 0, bar_m.z()), -Vec3::UnitZ()};
  plate.contact = ContactLaw::frictionless;
  recording.tools = {plate};
  Push push;
  push.name = "press";
  for (double travel_m : {0.0, 0.003, 0.006, 0.009, 0.012, 0.015}) {
    Step step;
    Load load;
    load.tool = "plate";
    load.travel_m = travel_m;
    step.loads = {load};
    Wrench wrench;
    wrench.force_n = Vec3(0, 0, -force_n(young_pa, nu, travel_m));
    wrench.force_sigma_n = 0.02;
    step.observations = {wrench};
    push.steps.push_back(step);
  }
  recording.pushes = {push};
  return recording;
}

inline Inputs wrenches_of(const Recording& recording) {
  Inputs inputs;
  for (const auto& step : recording.pushes[0].steps) inputs.push_back({std::get<Wrench>(step.observations[0])});
  return inputs;
}

}  // namespace palpate::estimation
