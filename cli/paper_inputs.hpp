// SPDX-License-Identifier: Apache-2.0
// What both methods of `palpate paper` are given: the same object, points and steps.
#pragma once

#include <functional>

#include "palpate/core/progress.hpp"
#include "palpate/estimation/fit.hpp"
#include "palpate/geometry/triangle_tree.hpp"

namespace palpate::cli {

/// A recording with its object built and its points ready.
struct Prepared {
  Recording recording;
  estimation::SimulatedObject object;
  estimation::Inputs inputs;
};

/// Every n-th pixel of what lies near the object: about as many points a sample as the paper's time-of-flight camera has.
RayCloud thinned(const RayCloud& all, const geometry::TriangleTree& rest);

Prepared prepare(Recording recording, const OnProgress& progress);

/// Some steps of it: keep(push, step) says which.
Prepared part_of(const Prepared& all, const std::function<bool(std::size_t push, std::size_t step)>& keep);

/// The same taken for one material, whatever regions it has: the paper's method knows none.
Prepared as_one(Prepared given);

bool loaded(const Step& step);

}  // namespace palpate::cli
