// SPDX-License-Identifier: Apache-2.0
// True states of the lab as files, OUT/truths: a search through folds takes minutes, and a run that was stopped goes on from them.
#pragma once

#include <filesystem>

#include "palpate/lab/pressed_memory.hpp"

namespace palpate::cli {

/// An .npy file an object. What is damaged is solved for again and written over.
lab::PressedMemory::Store truths_in(const std::filesystem::path& folder);

}  // namespace palpate::cli
