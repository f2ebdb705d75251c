// SPDX-License-Identifier: Apache-2.0
// Equilibria of true objects, kept for the next object of the same shape, law and Poisson ratio: E does no more to them than scale
// their forces. Pressing an object through the folds of 9 cm takes minutes.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "palpate/lab/object.hpp"
#include "palpate/lab/pressed.hpp"

namespace palpate::lab {

class PressedMemory {
 public:
  struct States;
  /// What presses the object as it is made with the given E.
  using Make = std::function<std::unique_ptr<Pressed>(double young_modulus_pa, const PushSite& at)>;

  /// An object at rest that takes from here what is here, and leaves here what it solves for. Its states are those of one E for
  /// all, to the last digit, whoever has solved for them.
  /// @param what  all that makes the object but E: those of the same name share their states
  std::unique_ptr<Pressed> at(const std::string& what, double young_modulus_pa, const PushSite& at, Make make);
  /// Searches for equilibrium so far.
  int solved() const;

 private:
  std::map<std::string, std::shared_ptr<States>> known_;
};

}  // namespace palpate::lab
