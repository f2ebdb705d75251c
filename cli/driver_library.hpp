// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "palpate/acquisition/driver_robot.hpp"

namespace palpate::cli {

/// A shared library with the entry that palpate/acquisition/driver.h describes; stays loaded as long as its robot lives.
class DriverLibrary {
 public:
  /// @throws Error in plain words when it cannot be loaded or is no driver of this program's version.
  DriverLibrary(const std::filesystem::path& library, const std::string& settings);
  acquisition::DriverRobot& robot() { return *robot_; }
  const acquisition::DriverRobot& robot() const { return *robot_; }

 private:
  struct Close {
    void operator()(void* handle) const;
  };
  std::unique_ptr<void, Close> handle_;
  std::unique_ptr<acquisition::DriverRobot> robot_;
};

}  // namespace palpate::cli
