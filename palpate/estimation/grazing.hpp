// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate::estimation {

/// Cosine between a camera's ray and the surface's normal below which the ray has no say: 70 degrees. Which pixels of a steeper
/// surface survive the removal of depth edges depends on their own noise: beyond 75 degrees those that do are 0.1 (D435) to 0.5
/// (Kinect) standard deviations too near on average, and the rim is where a bulge is seen (tests/lab/rim_bias_test.cpp). A
/// sphere's ray there is a seventeenth of the radius inside the outline.
constexpr double grazing_cosine = 0.342;

}  // namespace palpate::estimation
