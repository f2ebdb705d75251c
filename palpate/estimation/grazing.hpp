// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate::estimation {

/// Cosine between a camera's ray and the surface's normal below which no ray has a say: 75 degrees. A sphere's ray there is a
/// thirtieth of the radius inside the outline; beyond, pixels that mix the object with what is behind it are left
/// (lab_rim_bias_test).
constexpr double grazing_cosine = 0.26;

}  // namespace palpate::estimation
