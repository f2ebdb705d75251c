// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate::estimation {

/// Cosine between a camera's ray and the surface's normal below which no ray has a say: 75 degrees. A sphere's ray there is a
/// thirtieth of the radius inside the outline. Sensors may ask for more (sensing::trusted_incidence_rad).
constexpr double grazing_cosine = 0.26;

}  // namespace palpate::estimation
