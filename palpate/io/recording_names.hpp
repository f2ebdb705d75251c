// SPDX-License-Identifier: Apache-2.0
// How the words of recording.yaml and the enumerations of `core` belong together, for reading and for writing.
#pragma once

#include <array>
#include <utility>

#include "palpate/core/recording.hpp"

namespace palpate::io {

template <typename Enum, std::size_t N>
using Names = std::array<std::pair<const char*, Enum>, N>;

inline constexpr Names<RestState, 3> rest_state_names = {{{"stress_free", RestState::stress_free},
                                                          {"under_gravity", RestState::under_gravity},
                                                          {"under_pressure", RestState::under_pressure}}};
inline constexpr Names<SupportKind, 6> support_names = {{{"vertices", SupportKind::vertices},
                                                         {"plane", SupportKind::plane},
                                                         {"box", SupportKind::box},
                                                         {"table", SupportKind::table},
                                                         {"wall", SupportKind::wall},
                                                         {"clamp", SupportKind::clamp}}};
inline constexpr Names<ContactLaw, 3> contact_names = {
    {{"bonded", ContactLaw::bonded}, {"frictionless", ContactLaw::frictionless}, {"friction", ContactLaw::friction}}};
inline constexpr Names<PoseVaries, 3> pose_varies_names = {
    {{"never", PoseVaries::never}, {"push", PoseVaries::push}, {"step", PoseVaries::step}}};
inline constexpr Names<RegionSelection, 4> region_names = {{{"box", RegionSelection::box},
                                                            {"points", RegionSelection::points},
                                                            {"elements", RegionSelection::elements},
                                                            {"rest", RegionSelection::rest}}};
inline constexpr Names<Pressure, 2> pressure_names = {{{"uniform", Pressure::uniform}, {"punch", Pressure::punch}}};
inline constexpr Names<ToolShape, 7> tool_names = {{{"vertices", ToolShape::vertices},
                                                    {"sphere", ToolShape::sphere},
                                                    {"disc", ToolShape::disc},
                                                    {"capsule", ToolShape::capsule},
                                                    {"edge", ToolShape::edge},
                                                    {"mesh", ToolShape::mesh},
                                                    {"platen", ToolShape::platen}}};
inline constexpr Names<DistortionModel, 4> distortion_names = {{{"none", DistortionModel::none},
                                                                {"plumb_bob", DistortionModel::plumb_bob},
                                                                {"rational", DistortionModel::rational},
                                                                {"fisheye", DistortionModel::fisheye}}};

template <typename Enum, std::size_t N>
const char* name_of(const Names<Enum, N>& names, Enum value) {
  for (const auto& [name, one] : names) {
    if (one == value) return name;
  }
  return "";
}

}  // namespace palpate::io
