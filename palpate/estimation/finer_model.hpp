// SPDX-License-Identifier: Apache-2.0
// The same object on finer meshes: one that shows what the mesh does to the answer, and one that is fine enough for it.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "palpate/core/recording.hpp"
#include "palpate/estimation/answer_shift.hpp"
#include "palpate/estimation/forward_model.hpp"

namespace palpate::estimation {

/// The same object on a finer mesh; supports and tools name its nodes.
struct FinerModel {
  Recording recording;
  SimulatedObject object;
  double edge_share = 0.5;  ///< its edges, of those of the mesh that it is finer than
  double order = 2;         ///< of its edges: the error that is left falls with this power (docs/estimator.md)
  bool everywhere = true;   ///< false: under round tools only
  AnswerShift elsewhere;    ///< if not: what is known of the error that the mesh makes elsewhere
  /// Of the error that is taken out of an answer this share is left as one standard deviation. Halved edges have shown a quarter to
  /// twice of what was there (fem.discretisation); what fillings of a linear body say of it is off by 0.14 (docs/estimator.md).
  double unsure = 0.5;
  /// Of the coarser mesh's error, what this one has left.
  double left() const { return std::pow(edge_share, order); }
};

/// The object's volume filled anew from its surface, and its supports with the tolerance that this mesh's nodes need.
struct Filled {
  TetMesh volume;
  std::vector<Support> supports;
};
/// @param edge_share  wished edges, of those of the recording's volume
using FillAnew = std::function<Filled(const Recording&, double edge_share)>;

/// Halves every edge where the mesh has up to 5000 tetrahedra and supports and tools are found by their place; else those
/// under round tools (within the radius, growing away from it), where most of the error is made.
/// @param recording  with rest.volume as the fit uses it: linear tetrahedra, of which `object` has the quadratic ones
/// @param fill_anew  where the mesh's outline is not that of the object: both then are seen to err. Edges are halved as long as
///                   that takes no more than some 24 000 tetrahedra
/// @returns nothing where the volume is not linear, or there is neither
std::optional<FinerModel> finer_model(const Recording& recording, const SimulatedObject& object, const FillAnew& fill_anew = {});

/// The second alone: halves every edge under round tools.
/// @returns nothing where the volume is not linear, or no tool is round
std::optional<FinerModel> finer_under_tools(const Recording& recording, const SimulatedObject& object);

/// A mesh for a fit whose own error in E was too large: under every round tool as fine as fem::discretise asks for at this
/// tolerance. Where all of them were fine enough already, the error is made elsewhere: then every edge is halved, as
/// finer_model does, or the object is filled anew with two thirds of their length.
/// @returns nothing where no finer mesh can be had within 4000 corners
std::optional<FinerModel> refined_within(const Recording& recording, const SimulatedObject& object, double tolerance,
                                         const FillAnew& fill_anew = {});

}  // namespace palpate::estimation
