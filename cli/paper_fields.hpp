// SPDX-License-Identifier: Apache-2.0
// The answers of `palpate paper` as JSON, there and back without a loss: every struct names its fields once, for both ways. A field that
// earlier files of the same format have not is named with `Since::later`, and then left as it is.
#pragma once

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "cli/paper_studies.hpp"
#include "cli/paper_trial.hpp"

namespace palpate::cli {

enum class Since { first, later };

template <class Each>
void fields(Each each, FitIteration& a) {
  each("young_modulus_pa", a.young_modulus_pa), each("poisson_ratio", a.poisson_ratio), each("cost", a.cost), each("round", a.round);
}

template <class Each>
void fields(Each each, MethodAnswer& a) {
  each("young_modulus_pa", a.young_modulus_pa), each("lower_95_pa", a.lower_95_pa), each("upper_95_pa", a.upper_95_pa);
  each("poisson_ratio", a.poisson_ratio), each("poisson_lower_95", a.poisson_lower_95), each("poisson_upper_95", a.poisson_upper_95);
  each("solves", a.solves), each("load_cases", a.load_cases), each("iterations", a.iterations), each("seconds", a.seconds);
  each("converged", a.converged), each("verdicts", a.verdicts), each("failed", a.failed), each("path", a.path);
}

template <class Each>
void fields(Each each, SampleAnswer& a) {
  each("push", a.push), each("force_n", a.force_n), each("travel_m", a.travel_m), each("paper", a.paper), each("palpate", a.palpate);
}

template <class Each>
void fields(Each each, SiteAnswer& a) {
  each("site", a.site), each("true_young_modulus_pa", a.young_modulus_pa), each("paper", a.paper), each("palpate", a.palpate);
}

template <class Each>
void fields(Each each, Expectation& a) {
  each("force_n", a.force_n), each("surface_rms_m", a.surface_m), each("dent_rms_m", a.dent_m);
}

template <class Each>
void fields(Each each, UnusedStep& a) {
  each("force_n", a.force_n), each("travel_m", a.travel_m), each("surface_still_rms_m", a.surface_still_m);
  each("dent_still_rms_m", a.dent_still_m);
  each("paper", a.paper), each("palpate", a.palpate), each("other_law", a.other);
}

template <class Each>
void fields(Each each, ForceReading& a) {
  each("push", a.push), each("force_n", a.force_n), each("travel_m", a.travel_m);
}

template <class Each>
void fields(Each each, RegistrationPicture& a) {
  each("young_modulus_pa", a.young_modulus_pa), each("rms_m", a.rms_m), each("simulated_m", a.simulated_m);
  each("registered_m", a.registered_m);
}

template <class Each>
void fields(Each each, PaperView& a) {
  each("what", a.what), each("width", a.width), each("height", a.height), each("png", a.png);
}

template <class Each>
void fields(Each each, ErrorSurface& a) {
  each("young_modulus_pa", a.young_modulus_pa), each("poisson_ratio", a.poisson_ratio), each("error_m2", a.error_m2);
  each("at_found_m2", a.at_found_m2);
}

template <class Each>
void fields(Each each, StartAnswer& a) {
  each("young_modulus_pa", a.young_modulus_pa), each("poisson_ratio", a.poisson_ratio), each("paper", a.paper), each("palpate", a.palpate);
}

template <class Each>
void fields(Each each, TrialAnswer& a) {
  each("seed", a.seed), each("failed", a.failed);
  each("true_young_modulus_pa", a.young_modulus_pa), each("true_poisson_ratio", a.poisson_ratio), each("tetrahedra", a.tetrahedra);
  each("truth_s", a.truth_s), each("model_s", a.model_s), each("total_s", a.total_s);
  each("paper", a.paper), each("palpate", a.palpate), each("paper_linear_tetrahedra", a.paper_coarse);
  each("samples_left_out", a.left_out), each("other_law", a.other_law), each("palpate_other_law", a.other), each("readings", a.readings), each("sites", a.sites);
  each("verdicts_without_regions", a.as_one_verdicts), each("unused_place", a.unused), each("registrations", a.pictures);
  each("views", a.views), each("samples", a.samples), each("error_surface", a.surface);
  each("unused_stop", a.unused_stop, Since::later), each("other_starts", a.starts, Since::later);
}

template <class Each>
void fields(Each each, StudyRow& a) {
  each("what", a.what), each("true_young_modulus_pa", a.young_modulus_pa), each("true_poisson_ratio", a.poisson_ratio);
  each("paper", a.paper), each("palpate", a.palpate), each("views", a.views, Since::later);
}

template <class T>
struct is_list : std::false_type {};
template <class T>
struct is_list<std::vector<T>> : std::true_type {};
template <class T>
inline constexpr bool is_matrix = std::is_base_of_v<Eigen::PlainObjectBase<T>, T>;

/// JSON knows no infinity, and NaN becomes null when it is written.
template <class T>
nlohmann::json written(const T& value) {
  if constexpr (std::is_floating_point_v<T>) {
    if (std::isinf(value)) return value > 0 ? "infinity" : "-infinity";
    return value;
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    return value;
  } else if constexpr (is_list<T>::value) {
    nlohmann::json out = nlohmann::json::array();
    for (const auto& one : value) out.push_back(written(one));
    return out;
  } else if constexpr (is_matrix<T>) {
    nlohmann::json values = nlohmann::json::array();
    for (Eigen::Index i = 0; i < value.rows(); ++i)
      for (Eigen::Index k = 0; k < value.cols(); ++k) values.push_back(written(static_cast<double>(value(i, k))));
    return {{"columns", value.cols()}, {"values", values}};
  } else {
    nlohmann::json out = nlohmann::json::object();
    fields([&](const char* name, auto& field, Since = Since::first) { out[name] = written(field); }, const_cast<T&>(value));
    return out;
  }
}

/// @throws nlohmann::json::exception when a field that was there from the first is missing, or one is of another kind
template <class T>
void read_into(T& value, const nlohmann::json& from) {
  if constexpr (std::is_floating_point_v<T>) {
    if (from.is_null()) {
      value = std::numeric_limits<T>::quiet_NaN();
    } else if (from.is_string()) {
      value = from.get<std::string>() == "infinity" ? std::numeric_limits<T>::infinity() : -std::numeric_limits<T>::infinity();
    } else {
      value = from.get<T>();
    }
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    value = from.get<T>();
  } else if constexpr (is_list<T>::value) {
    value.clear();
    for (const auto& one : from) {
      value.emplace_back();
      read_into(value.back(), one);
    }
  } else if constexpr (is_matrix<T>) {
    const auto& values = from.at("values");
    const auto columns = from.at("columns").get<Eigen::Index>();
    value.resize(columns > 0 ? static_cast<Eigen::Index>(values.size()) / columns : 0, columns);
    for (Eigen::Index i = 0; i < value.size(); ++i) {
      double read = 0;
      read_into(read, values.at(static_cast<std::size_t>(i)));
      value(i / columns, i % columns) = read;
    }
  } else {
    const auto take = [&](const char* name, auto& field, Since since = Since::first) {
      if (since == Since::first || from.contains(name)) read_into(field, from.at(name));
    };
    fields(take, value);
  }
}

}  // namespace palpate::cli
