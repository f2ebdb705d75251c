// SPDX-License-Identifier: Apache-2.0
// Balls that press: which of force and motion is taken as imposed.
#pragma once

#include "palpate/core/recording.hpp"

namespace palpate::estimation {

/// A ball touches the more the deeper it is pressed in (Hertz 1882: the root of radius times depth), and a measured force would be
/// spread over all of its radius: what the travel of a twentieth of the radius then asks for is an eighth of E. Where the travel was
/// read it says what touches: it is imposed, with what its encoder errs by, and the force along the push becomes what was observed,
/// with the standard deviation that the load stated of it. A push that lacks a travel keeps its force; so does an object that
/// nothing holds (its forces must balance), and a tool that slid.
/// @returns the recording with a line in `warnings` for every ball that is moved
Recording with_balls_moved(Recording recording);

}  // namespace palpate::estimation
