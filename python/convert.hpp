// SPDX-License-Identifier: Apache-2.0
// Between the nouns of `core` and Python's objects. A noun's fields stand in one table (nouns_recording.hpp, nouns_answer.hpp); the
// Python class, its documentation and both ways of this page come from it. What Python holds is its own: lists are lists, nothing
// refers to memory of the library, and a call takes what it is given as it is at that moment.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/core/math.hpp"

namespace palpate::python {

namespace py = pybind11;

/// Where a value stands in what the user gave: "recording.pushes[0].steps[2].time_s". Put into words only when something is wrong.
class Place {
 public:
  explicit Place(std::string_view name, const Place* in = nullptr) : in_(in), name_(name) {}
  Place(std::size_t index, const Place* in) : in_(in), index_(static_cast<long>(index)) {}

  std::string words() const {
    const std::string before = in_ != nullptr ? in_->words() : "";
    if (index_ >= 0) return before + "[" + std::to_string(index_) + "]";
    return before.empty() ? std::string(name_) : before + "." + std::string(name_);
  }
  [[noreturn]] void refuse(const std::string& what) const { throw Error(what, words()); }
  [[noreturn]] void refuse(const std::string& wanted, py::handle given) const {
    refuse("must be " + wanted + ", not " + std::string(py::str(py::type::of(given).attr("__name__"))));
  }

 private:
  const Place* in_;
  std::string_view name_;
  long index_ = -1;
};

/// A struct of `core` with a class of its own in Python. A specialisation holds
///   static constexpr const char* name, *about;
///   static void fields(auto&& field) { field("radius_m", &Tool::radius_m, "of the pressed patch"); ... }
template <typename T>
struct Noun {};

template <typename T>
concept IsNoun = requires { Noun<T>::name; };

/// The words of an enumeration: `static constexpr auto& names`, a list of (word, value).
template <typename T>
struct Words {};

template <typename T>
concept HasWords = requires { Words<T>::names; };

/// The Python class of a noun; set once when the module is loaded.
template <typename T>
inline PyObject* class_of = nullptr;

/// Both ways of one type, and how it is called in documentation:
///   static std::string type();
///   static py::object to(const T& value);
///   static T from(py::handle given, const Place& place);   @throws Error naming the place
template <typename T>
struct Convert;

template <typename T>
py::object to_python(const T& value) {
  return Convert<T>::to(value);
}
template <typename T>
T from_python(py::handle given, const Place& place) {
  return Convert<T>::from(given, place);
}

template <>
struct Convert<double> {
  static std::string type() { return "float"; }
  static py::object to(double value) { return py::float_(value); }
  static double from(py::handle given, const Place& place) {
    if (py::isinstance<py::str>(given) || PyBool_Check(given.ptr())) place.refuse("a number", given);
    const double value = PyFloat_AsDouble(given.ptr());
    if (PyErr_Occurred() != nullptr) {
      PyErr_Clear();
      place.refuse("a number", given);
    }
    return value;
  }
};

template <typename T>
struct ConvertWhole {
  static std::string type() { return "int"; }
  static py::object to(T value) { return py::int_(value); }
  static T from(py::handle given, const Place& place) {
    const py::object whole = py::reinterpret_steal<py::object>(PyBool_Check(given.ptr()) ? nullptr : PyNumber_Index(given.ptr()));
    if (!whole) {
      PyErr_Clear();
      place.refuse("a whole number", given);
    }
    const long long value = PyLong_AsLongLong(whole.ptr());
    if (PyErr_Occurred() != nullptr || (std::is_unsigned_v<T> && value < 0) || static_cast<long long>(static_cast<T>(value)) != value) {
      PyErr_Clear();
      place.refuse("is out of range");
    }
    return static_cast<T>(value);
  }
};
template <>
struct Convert<int> : ConvertWhole<int> {};
template <>
struct Convert<std::size_t> : ConvertWhole<std::size_t> {};

template <>
struct Convert<bool> {
  static std::string type() { return "bool"; }
  static py::object to(bool value) { return py::bool_(value); }
  static bool from(py::handle given, const Place& place) {
    const std::string name = py::str(py::type::of(given).attr("__name__"));
    if (!PyBool_Check(given.ptr()) && name != "bool_" && name != "bool") place.refuse("True or False", given);
    return PyObject_IsTrue(given.ptr()) == 1;
  }
};

template <>
struct Convert<std::string> {
  static std::string type() { return "str"; }
  static py::object to(const std::string& value) { return py::reinterpret_steal<py::object>(PyUnicode_DecodeUTF8(value.data(), static_cast<Py_ssize_t>(value.size()), "replace")); }
  static std::string from(py::handle given, const Place& place) {
    if (!py::isinstance<py::str>(given)) place.refuse("a text", given);
    Py_ssize_t size = 0;
    const char* text = PyUnicode_AsUTF8AndSize(given.ptr(), &size);
    if (text == nullptr) {
      PyErr_Clear();
      place.refuse("holds what is no text (a surrogate: bytes of a file's name that are not UTF-8)");
    }
    return {text, static_cast<std::size_t>(size)};
  }
};

template <HasWords T>
struct Convert<T> {
  static std::string listed() {
    std::string list;
    for (const auto& [word, value] : Words<T>::names) list += (list.empty() ? "'" : ", '") + std::string(word) + "'";
    return list;
  }
  static std::string type() { return "str"; }
  static py::object to(T value) {
    for (const auto& [word, one] : Words<T>::names)
      if (one == value) return py::str(word);
    return py::none();
  }
  static T from(py::handle given, const Place& place) {
    if (!py::isinstance<py::str>(given)) place.refuse("one of " + listed(), given);
    const std::string text = from_python<std::string>(given, place);
    for (const auto& [word, one] : Words<T>::names)
      if (text == word) return one;
    place.refuse("must be one of " + listed() + ", not '" + text + "'");
  }
};

/// Arrays are copied, row-major, into numpy's.
template <typename Scalar, int Rows, int Cols, int Order, int MostRows, int MostCols>
struct Convert<Eigen::Matrix<Scalar, Rows, Cols, Order, MostRows, MostCols>> {
  using T = Eigen::Matrix<Scalar, Rows, Cols, Order, MostRows, MostCols>;
  using ByRow = Eigen::Map<Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  using ByRowRead = Eigen::Map<const Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
  static constexpr bool is_vector = Cols == 1;

  static std::string size_words(int size) { return size == Eigen::Dynamic ? "N" : std::to_string(size); }
  static std::string shape_words() { return is_vector ? size_words(Rows) : size_words(Rows) + " x " + (Cols == Eigen::Dynamic ? "M" : std::to_string(Cols)); }
  static std::string type() { return "numpy.ndarray, " + shape_words(); }
  static py::object to(const T& value) {
    std::vector<py::ssize_t> shape{value.rows()};
    if (!is_vector) shape.push_back(value.cols());
    py::array_t<Scalar> array(shape);
    ByRow(array.mutable_data(), value.rows(), value.cols()) = value;
    return array;
  }
  static T from(py::handle given, const Place& place) {
    const py::array any = py::array::ensure(given);
    if (!any || std::string_view("biuf").find(any.dtype().kind()) == std::string_view::npos) {
      PyErr_Clear();
      place.refuse("an array of numbers (" + shape_words() + ")", given);
    }
    if (std::is_integral_v<Scalar> && any.dtype().kind() == 'f' && any.size() > 0) place.refuse("must hold whole numbers");
    const auto array = py::array_t<Scalar, py::array::c_style | py::array::forcecast>::ensure(any);
    const bool empty = any.size() == 0 && any.ndim() == 1 && Rows == Eigen::Dynamic;  // []
    const bool fits = any.ndim() == (is_vector ? 1 : 2) && (Rows == Eigen::Dynamic || any.shape(0) == Rows) &&
                      (is_vector || Cols == Eigen::Dynamic || any.shape(1) == Cols);
    if (!array || !(fits || empty)) {
      PyErr_Clear();
      std::string shape;
      for (py::ssize_t d = 0; d < any.ndim(); ++d) shape += (d == 0 ? "" : " x ") + std::to_string(any.shape(d));
      place.refuse("must be an array of " + shape_words() + " numbers, is " + (shape.empty() ? std::string("a single one") : shape));
    }
    T value;
    if (empty) {
      value.resize(0, Cols == Eigen::Dynamic ? 0 : Cols);
      return value;
    }
    const Eigen::Index cols = is_vector ? 1 : any.shape(1);
    value = ByRowRead(array.data(), any.shape(0), cols);
    return value;
  }
};

/// The nearest one, as files have it: who writes few digits means it. @throws Error naming the place, and by how much it is off (poses.cpp)
Pose rigid_pose(const Eigen::Matrix4d& matrix, const Place& place);

template <>
struct Convert<Pose> {
  static std::string type() { return "numpy.ndarray, 4 x 4"; }
  static py::object to(const Pose& value) { return Convert<Eigen::Matrix4d>::to(value.matrix()); }
  static Pose from(py::handle given, const Place& place) {
    return rigid_pose(Convert<Eigen::Matrix4d>::from(given, place), place);
  }
};

template <typename T>
struct Convert<std::optional<T>> {
  static std::string type() { return "Optional[" + Convert<T>::type() + "]"; }
  static py::object to(const std::optional<T>& value) { return value ? to_python(*value) : py::none(); }
  static std::optional<T> from(py::handle given, const Place& place) {
    if (given.is_none()) return std::nullopt;
    return from_python<T>(given, place);
  }
};

template <typename T>
struct Convert<std::vector<T>> {
  static std::string type() { return "list[" + Convert<T>::type() + "]"; }
  static py::object to(const std::vector<T>& value) {
    py::list list;
    for (const T& one : value) list.append(to_python(one));
    return list;
  }
  static std::vector<T> from(py::handle given, const Place& place) {
    if (py::isinstance<py::str>(given) || py::isinstance<py::dict>(given) || PySequence_Check(given.ptr()) == 0)
      place.refuse("a list of " + Convert<T>::type(), given);
    std::vector<T> value;
    std::size_t i = 0;
    for (const py::handle one : py::reinterpret_borrow<py::sequence>(given)) value.push_back(from_python<T>(one, Place(i++, &place)));
    return value;
  }
};

template <typename T>
struct Convert<std::map<std::string, T>> {
  static std::string type() { return "dict[str, " + Convert<T>::type() + "]"; }
  static py::object to(const std::map<std::string, T>& value) {
    py::dict dict;
    for (const auto& [key, one] : value) dict[to_python(key)] = to_python(one);
    return dict;
  }
  static std::map<std::string, T> from(py::handle given, const Place& place) {
    if (!py::isinstance<py::dict>(given)) place.refuse("a dict", given);
    std::map<std::string, T> value;
    for (const auto& [key, one] : py::reinterpret_borrow<py::dict>(given)) {
      const std::string name = from_python<std::string>(key, place);
      value[name] = from_python<T>(one, Place(name, &place));
    }
    return value;
  }
};

/// One of several nouns.
template <typename... T>
struct Convert<std::variant<T...>> {
  static std::string type() {
    std::string list;
    ((list += (list.empty() ? "" : " | ") + Convert<T>::type()), ...);
    return list;
  }
  static py::object to(const std::variant<T...>& value) {
    return std::visit([](const auto& one) { return to_python(one); }, value);
  }
  static std::variant<T...> from(py::handle given, const Place& place) {
    std::optional<std::variant<T...>> value;
    const auto take = [&]<typename One>(const One*) {
      if (!value && PyObject_IsInstance(given.ptr(), class_of<One>) == 1) value = from_python<One>(given, place);
    };
    (take(static_cast<const T*>(nullptr)), ...);
    if (!value) place.refuse(type(), given);
    return std::move(*value);
  }
};

template <IsNoun T>
struct Convert<T> {
  static std::string type() { return Noun<T>::name; }
  static py::object to(const T& value) {
    py::dict given;
    Noun<T>::fields([&](const char* name, auto member, const char*) { given[name] = to_python(value.*member); });
    return py::reinterpret_borrow<py::object>(class_of<T>)(**given);
  }
  static T from(py::handle given, const Place& place) {
    if (PyObject_IsInstance(given.ptr(), class_of<T>) != 1) place.refuse("a palpate." + type(), given);
    T value;
    Noun<T>::fields([&](const char* name, auto member, const char*) {
      using Field = std::remove_reference_t<decltype(value.*member)>;
      value.*member = from_python<Field>(given.attr(name), Place(name, &place));
    });
    return value;
  }
};

}  // namespace palpate::python
