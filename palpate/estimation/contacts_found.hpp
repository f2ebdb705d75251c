// SPDX-License-Identifier: Apache-2.0
// Contacts that were found elsewhere than they were stated.
#pragma once

#include <optional>

#include "palpate/estimation/forward_model.hpp"

namespace palpate::estimation {

/// The recording with every Load::contact_found_m where these unknowns put the contact. Nothing where none is further off than a
/// tenth of its tool's size from where the model's columns were made (a dent is as wide as its tool, and moves with it: nearer
/// than that its load is linear in the shift), or where there is nothing of the object.
std::optional<Recording> with_contacts_found(const Recording& recording, const ForwardModel& model, const VectorX& unknowns);

}  // namespace palpate::estimation
