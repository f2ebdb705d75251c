// SPDX-License-Identifier: Apache-2.0
// Long work on behalf of Python: without its lock, and with a word now and then to who asked for it.
#pragma once

#include <algorithm>
#include <exception>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/core/progress.hpp"
#include "python/convert.hpp"

namespace palpate::python {

/// The library's progress for one call. Looks for Ctrl-C, tells a callable of Python's, and keeps what either raised.
class PythonProgress {
 public:
  explicit PythonProgress(py::object callable) : callable_(std::move(callable)) {}

  OnProgress callback() {
    return [this](std::string_view stage, double share) { return told(stage, share); };
  }
  bool go_on() { return told("push", 0); }  ///< asked between a robot's motions, whose share of the whole nobody knows
  void raise_what_was_raised() const {
    if (raised_) std::rethrow_exception(raised_);
  }

  /// Calls Python for the library, which knows faults only. Ctrl-C and sys.exit() that come out of it are none: go_on() is false from then on.
  template <typename Act>
  auto call(Act&& act) {
    const py::gil_scoped_acquire lock;
    try {
      return act();
    } catch (const py::error_already_set& raised) {
      if (!raised_ && !raised.matches(PyExc_Exception)) raised_ = std::current_exception();
      throw;
    }
  }

 private:
  bool told(std::string_view stage, double share) {
    if (raised_ || stopped_) return false;
    const py::gil_scoped_acquire lock;
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (callable_.is_none()) return true;
      const py::object answer = callable_(py::str(stage.data(), stage.size()), share);
      stopped_ = !answer.is_none() && !answer.cast<bool>();
      return !stopped_;
    } catch (const std::exception&) {
      raised_ = std::current_exception();
      return false;
    }
  }

  py::object callable_;
  std::exception_ptr raised_;
  bool stopped_ = false;  // by the callable, which said so once
};

/// What is odd and does not stand in `known`, where Python's caller called.
inline void warn_of(const std::vector<std::string>& odd, const std::vector<std::string>& known = {}) {
  const py::object warn = py::module_::import("warnings").attr("warn");
  for (const std::string& text : odd)
    if (std::find(known.begin(), known.end(), text) == known.end()) warn(to_python(text), py::arg("stacklevel") = 2);
}

/// @param work  touches nothing of Python's but by `told`
template <typename Work>
auto without_lock(const PythonProgress& told, Work&& work) {
  auto answer = [&] {
    try {
      const py::gil_scoped_release unlocked;
      return work();
    } catch (...) {  // work that was asked to stop may say so by an error of its own
      told.raise_what_was_raised();
      throw;
    }
  }();
  told.raise_what_was_raised();
  return answer;
}
/// @param work  takes an OnProgress and touches nothing of Python's
template <typename Work>
auto without_lock(const py::object& progress, Work&& work) {
  PythonProgress told(progress);
  return without_lock(told, [&] { return work(told.callback()); });
}

}  // namespace palpate::python
