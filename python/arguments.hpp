// SPDX-License-Identifier: Apache-2.0
// What functions are given: options by name, paths, a recording.
#pragma once

#include <filesystem>
#include <set>
#include <string>

#include "cli/mistyped.hpp"
#include "palpate/suggest.hpp"
#include "python/nouns_answer.hpp"

namespace palpate::python {

/// Options by name, as the Python function lists them; None is the library's own default.
class Options {
 public:
  explicit Options(const py::dict& given) : given_(given) {}
  template <typename T>
  void take(const char* name, T& value) {
    if (const auto one = taken<T>(name)) value = *one;
  }
  template <typename T>
  void take(const char* name, std::optional<T>& value) {
    if (const auto one = taken<T>(name)) value = *one;
  }
  /// @throws Error for an option that nobody took
  void all_taken() const {
    for (const auto& [key, value] : given_)
      if (const std::string name = key.cast<std::string>(); !taken_.contains(name)) throw Error("is no option" + meant(name), name);
  }

 private:
  std::string meant(const std::string& name) const {
    for (const std::string& known : taken_)
      if (known.starts_with(name)) return "; did you mean '" + known + "'?";  // its unit was left out
    const auto near = cli::did_you_mean(name, {taken_.begin(), taken_.end()});
    return near ? "; did you mean '" + *near + "'?" : "";
  }
  template <typename T>
  std::optional<T> taken(const char* name) {
    taken_.insert(name);
    if (!given_.contains(name) || given_[name].is_none()) return {};
    return from_python<T>(given_[name], Place(name));
  }

  py::dict given_;
  std::set<std::string> taken_;
};

std::filesystem::path path_of(const py::object& given);
/// @throws Error for less than 0; of 0 as many as the machine has
int threads_of(int asked);
/// With places of the user's object where messages would name a file. @throws Error
Recording recording_of(const py::object& given, const char* name = "recording");
IdentifyOptions identify_options(Options& from);
SuggestedPush suggested(const estimation::RatedPush& push, const PushScene& scene);

}  // namespace palpate::python
