// SPDX-License-Identifier: Apache-2.0
// Thrown inside the room to leave a push from wherever it is. Inner header of the room.
#pragma once

#include <string>

#include "palpate/acquisition/push_protocol.hpp"

namespace palpate::acquisition {

struct Stopped {
  StopReason reason;
  std::string message;
};

}  // namespace palpate::acquisition
