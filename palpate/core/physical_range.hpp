// SPDX-License-Identifier: Apache-2.0
// What a measured quantity can be at all. The ranges are wide: what lies outside is a wrong unit or a slip of the pen, and an
// answer from it would be a number without a meaning.
#pragma once

namespace palpate {

struct PhysicalRange {
  double least, most;
  const char* unit;
  const char* slip;  ///< the likely mistake, and the cure
};

namespace ranges {

inline constexpr const char* millimetres = "is it in millimetres? It must be in metres";
inline constexpr const char* newtons = "is it in millinewtons or grams? It must be in newtons";

inline constexpr PhysicalRange tool_radius{1e-5, 1, "m", millimetres};
inline constexpr PhysicalRange tool_length{1e-5, 10, "m", millimetres};
inline constexpr PhysicalRange strip_half_width{0, 1, "m", millimetres};
inline constexpr PhysicalRange compliance{0, 0.1, "m/N", "is it in mm/N? It must be in metres per newton"};
inline constexpr PhysicalRange friction{1e-6, 10, "", "it is tangential over normal force, 0.3 to 1 for most pairs"};
inline constexpr PhysicalRange length_sigma{1e-9, 1, "m", millimetres};
inline constexpr PhysicalRange length_std{0, 1, "m", millimetres};
inline constexpr PhysicalRange length_scale{1e-5, 10, "m", millimetres};
inline constexpr PhysicalRange angle_std{0, 1, "rad", "is it in degrees? It must be in radians"};
inline constexpr PhysicalRange share_std{0, 1, "", "is it in percent? 0.01 is 1 %"};
inline constexpr PhysicalRange force_sigma{1e-9, 1e5, "N", newtons};
inline constexpr PhysicalRange force_std{0, 1e5, "N", newtons};
inline constexpr PhysicalRange torque_sigma{1e-12, 1e5, "Nm", "is it in Nmm? It must be in newton metres"};
inline constexpr PhysicalRange torque_std{0, 1e5, "Nm", "is it in Nmm? It must be in newton metres"};
inline constexpr PhysicalRange clock_std{0, 10, "s", "is it in milliseconds? It must be in seconds"};
inline constexpr PhysicalRange time{-1e11, 1e11, "s", "is it in milliseconds or nanoseconds? It must be in seconds"};
inline constexpr PhysicalRange image_unit{1e-9, 1e3, "m", "0.001 is right for most 16-bit images, 1 for float metres"};
inline constexpr PhysicalRange tool_mass{0, 1000, "kg", "is it in grams? It must be in kilograms"};
/// Over the image's width: a lens that sees half of all directions to one that sees half a degree.
inline constexpr PhysicalRange focal_over_width{0.02, 200, "", "is it in millimetres? It must be in pixels of the depth image"};
/// From the image's middle, over its width.
inline constexpr PhysicalRange centre_over_width{-10, 10, "", "it must be in pixels of the depth image"};

}  // namespace ranges

}  // namespace palpate
