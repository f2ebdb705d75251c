// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate::estimation {

/// Cosine between a camera's ray and the surface's normal below which no ray has a say: 75 degrees. A sphere's ray there is a
/// thirtieth of the radius inside the outline; beyond, pixels that mix the object with what is behind it are left
/// (tests/lab/rim_bias_test.cpp).
constexpr double grazing_cosine = 0.26;

/// Pixels between a ray that has a say and the simulated surface's outline. Where the pixels on both sides of an edge mix object and
/// background, neither differs enough from the other to be told from noise: four hundred such rays of three hundred thousand moved nu
/// of the lab's bar by a quarter of its standard deviation, and those beside them by another fifteenth.
constexpr double outline_margin_px = 3;

}  // namespace palpate::estimation
