// SPDX-License-Identifier: Apache-2.0
#include "cli/driver_library.hpp"

#include <dlfcn.h>

#include "palpate/core/error.hpp"

namespace palpate::cli {

void DriverLibrary::Close::operator()(void* handle) const { dlclose(handle); }

DriverLibrary::DriverLibrary(const std::filesystem::path& library, const std::string& settings) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(library, code))
    throw Error("there is no such file; give the driver's shared library", "--driver " + library.string());
  // With a slash in it, so that the loader does not look for it among the system's libraries.
  handle_.reset(dlopen(std::filesystem::absolute(library).c_str(), RTLD_NOW | RTLD_LOCAL));
  if (!handle_) {
    const char* why = dlerror();
    throw Error(std::string("cannot be loaded: ") + (why != nullptr ? why : "no reason given") +
                    "; is it a shared library for this machine, and are the libraries that it needs installed?",
                "--driver " + library.string());
  }
  void* entry = dlsym(handle_.get(), PALPATE_ROBOT_ENTRY);
  if (entry == nullptr)
    throw Error("has no entry `" PALPATE_ROBOT_ENTRY "`; export it with C linkage, as palpate/acquisition/driver.h says",
                "--driver " + library.string());
  robot_ = std::make_unique<acquisition::DriverRobot>(reinterpret_cast<acquisition::MakeRobot>(entry), settings,
                                                      library.filename().string());
}

}  // namespace palpate::cli
