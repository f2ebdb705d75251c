// SPDX-License-Identifier: Apache-2.0
// Equilibria of true objects, kept for the next object of the same shape, law and Poisson ratio: E does no more to them than scale
// their forces. Pressing an object through the folds of 9 cm takes minutes.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "palpate/core/math.hpp"
#include "palpate/lab/object.hpp"
#include "palpate/lab/pressed.hpp"

namespace palpate::lab {

class PressedMemory {
 public:
  struct States;
  /// What presses the object as it is made with the given E.
  using Make = std::function<std::unique_ptr<Pressed>(double young_modulus_pa, const PushSite& at)>;
  /// Where states outlive the program. A row a state, the first one at rest: newton of an object of 10 kPa, m of travel, then x, y, z
  /// of every vertex of the surface, m. At the end, rows whose travel is NaN: forces that were too far to follow, and in the third
  /// column after how many pressed states (finding that out takes as long as all of them); negative ones have no equilibrium at all.
  struct Store {
    std::function<std::optional<MatrixX>(const std::string& name)> load;
    std::function<void(const std::string& name, const MatrixX& states)> keep;  ///< after every search for equilibrium
  };

  PressedMemory() = default;
  /// @param store  what it has for an object with another surface at rest is not used, and written over
  explicit PressedMemory(Store store) : store_(std::move(store)) {}

  /// An object at rest that takes from here what is here, and leaves here what it solves for. Its states are those of one E for
  /// all, to the last digit, whoever has solved for them.
  /// @param what  all that makes the object but E: those of the same name share their states
  std::unique_ptr<Pressed> at(const std::string& what, double young_modulus_pa, const PushSite& at, Make make);
  /// Searches for equilibrium so far.
  int solved() const;

 private:
  Store store_;
  std::map<std::string, std::shared_ptr<States>> known_;
};

}  // namespace palpate::lab
