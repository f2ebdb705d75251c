// SPDX-License-Identifier: Apache-2.0
#include "palpate/lab/pressed_memory.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::lab {

struct PressedMemory::States {
  struct State {
    double force_n = 0, travel_m = 0;  // of an object of `one_pa`
    Points vertices_m;
  };
  TriMesh rest;
  Index nodes = 0;
  std::vector<State> pressed;  // one after the other, each from the one before
  // Forces (of an object of `one_pa`) that after so many states are not a short way on; less than 0: not found from rest either.
  std::set<std::pair<std::size_t, double>> too_far;
  int solved = 0;
  std::string name;

  void load(const Store& store) {
    if (!store.load) return;
    const std::optional<MatrixX> kept = store.load(name);
    if (!kept || kept->rows() < 1 || row({0, 0, rest.vertices_m}) != kept->row(0)) return;
    for (Eigen::Index k = 1; k < kept->rows(); ++k) {
      const Eigen::RowVectorXd of = kept->row(k);
      if (std::isnan(of(1)))
        too_far.emplace(std::size_t(of(2)), of(0));
      else
        pressed.push_back({of(0), of(1), Eigen::Map<const Points>(of.data() + 2, rest.vertices_m.rows(), 3)});
    }
  }
  void keep(const Store& store) const {
    if (!store.keep) return;
    MatrixX kept = MatrixX::Zero(Eigen::Index(1 + pressed.size() + too_far.size()), 2 + rest.vertices_m.size());
    Eigen::Index k = 0;
    kept.row(k++) = row({0, 0, rest.vertices_m});
    for (const State& state : pressed) kept.row(k++) = row(state);
    for (const auto& [states, force_n] : too_far)
      kept.row(k++).head(3) << force_n, std::numeric_limits<double>::quiet_NaN(), double(states);
    store.keep(name, kept);
  }

 private:
  static Eigen::RowVectorXd row(const State& state) {
    Eigen::RowVectorXd out(2 + state.vertices_m.size());
    out << state.force_n, state.travel_m, Eigen::Map<const Eigen::RowVectorXd>(state.vertices_m.data(), state.vertices_m.size());
    return out;
  }
};

namespace {

constexpr double one_pa = 1e4;

// Forces over E are the same for all but for rounding: nine digits of them are meant.
double rounded(double value) {
  int exponent = 0;
  const double digits = std::frexp(value, &exponent);
  constexpr int bits = 30;
  return std::ldexp(std::round(std::ldexp(digits, bits)), exponent - bits);
}

class Remembered : public Pressed {
 public:
  Remembered(std::shared_ptr<PressedMemory::States> states, PressedMemory::Store store, double young_modulus_pa, const PushSite& at,
             PressedMemory::Make make)
      : states_(std::move(states)), store_(std::move(store)), young_modulus_pa_(young_modulus_pa), at_(at), make_(std::move(make)) {
    if (states_->rest.vertices_m.rows() > 0) return;
    object_ = make_(one_pa, at_);
    states_->rest = object_->surface();
    states_->nodes = object_->nodes();
    states_->load(store_);
  }

  void press(double force_n) override { reach(force_n, false); }
  bool follow(double force_n) override { return reach(force_n, true); }
  double force_n() const override { return force_n_; }
  double travel_m() const override { return now_.travel_m; }
  TriMesh surface() const override {
    TriMesh out = states_->rest;
    if (next_ > 0) out.vertices_m = now_.vertices_m;
    return out;
  }
  Index nodes() const override { return states_->nodes; }

 private:
  bool reach(double force_n, bool by_following) {
    const double one_n = rounded(force_n / young_modulus_pa_ * one_pa);
    auto& known = states_->pressed;
    if (by_following && states_->too_far.contains({next_, one_n})) return false;
    if (!by_following && states_->too_far.contains({next_, -one_n}))
      throw Error("the true object was found to have no equilibrium under " + std::to_string(force_n) + " N: press less deep", states_->name);
    if (next_ < known.size() && known[next_].force_n == one_n) {
      now_ = known[next_];
    } else {
      const bool there = solve(one_n, by_following);
      if (there) {
        known.resize(next_);  // what was pressed otherwise
        std::erase_if(states_->too_far, [this](const auto& one) { return one.first > next_; });
        known.push_back(now_);
      } else {
        states_->too_far.emplace(next_, one_n);
      }
      states_->keep(store_);
      if (!there) return false;
    }
    ++next_;
    force_n_ = force_n;
    return true;
  }

  // On from the state before, to which an object that was not needed so far is brought first.
  bool solve(double one_n, bool by_following) {
    if (!object_) object_ = make_(one_pa, at_);
    for (; stands_ < next_; ++stands_, ++states_->solved) object_->press(states_->pressed[stands_].force_n);
    if (by_following && !object_->follow(one_n)) return false;
    if (!by_following) press_or_remember(one_n);
    ++states_->solved;
    stands_ = next_ + 1;
    now_ = {one_n, object_->travel_m(), object_->surface().vertices_m};
    return true;
  }

  void press_or_remember(double one_n) {
    try {
      object_->press(one_n);
    } catch (const Error&) {
      object_.reset();  // it may stand anywhere
      stands_ = 0;
      states_->too_far.emplace(next_, -one_n);
      states_->keep(store_);
      throw;
    }
  }

  std::shared_ptr<PressedMemory::States> states_;
  PressedMemory::Store store_;
  double young_modulus_pa_;
  PushSite at_;
  PressedMemory::Make make_;
  std::unique_ptr<Pressed> object_;  // empty until something has to be solved for
  std::size_t stands_ = 0;           // states that it has been through
  std::size_t next_ = 0;             // states that have been asked for
  PressedMemory::States::State now_;
  double force_n_ = 0;
};

}  // namespace

std::unique_ptr<Pressed> PressedMemory::at(const std::string& what, double young_modulus_pa, const PushSite& at, Make make) {
  const auto& [c, d] = std::pair(at.contact_m, at.direction);
  const std::string name =
      fmt::format("{} at {:.9f} {:.9f} {:.9f} along {:.9f} {:.9f} {:.9f}", what, c.x(), c.y(), c.z(), d.x(), d.y(), d.z());
  auto& states = known_[name];
  if (!states) {
    states = std::make_shared<States>();
    states->name = name;
  }
  return std::make_unique<Remembered>(states, store_, young_modulus_pa, at, std::move(make));
}

int PressedMemory::solved() const {
  int count = 0;
  for (const auto& [what, states] : known_) count += states->solved;
  return count;
}

}  // namespace palpate::lab
