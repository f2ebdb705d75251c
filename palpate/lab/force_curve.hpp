// SPDX-License-Identifier: Apache-2.0
// Inner header of the room.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/lab/pressed.hpp"

namespace palpate::lab {

// Equilibria at rising forces, solved when they are first needed; between two of them everything is interpolated. What moves in
// proportion to the force is solved for once, and everything is a multiple of that.
class ForceCurve {
 public:
  /// @param first_n  the first step of force; later ones follow the object's own stiffness, for about `step_m` of travel each
  /// @param proportional  small strains, held: what is true of one force is true of all
  ForceCurve(std::unique_ptr<Pressed> object, double first_n, double step_m, bool proportional = false)
      : object_(std::move(object)), step_n_(first_n), step_m_(step_m), proportional_(proportional) {
    forces_.push_back(0);
    travels_.push_back(0);
    surfaces_.push_back(object_->surface());
  }

  struct Place {
    std::size_t below = 0;
    double share = 0;  // above 1 only beyond what was solved for, where that is a multiple
  };
  Place at(double travel_m) {
    while (travels_.back() < travel_m && !(proportional_ && travels_.size() > 1)) {
      if (step_n_ < still * forces_.back()) {
        go_on_at_limit(travel_m);
        continue;
      }
      if (!press_on()) {
        step_n_ = 0;
        continue;
      }
      forces_.push_back(object_->force_n());
      travels_.push_back(object_->travel_m());
      surfaces_.push_back(object_->surface());
      const double gained_m = travels_.back() - travels_[travels_.size() - 2];
      if (!(gained_m > 0)) throw Error("the true object does not give way under the pad", "LabRobot");
      step_n_ *= std::clamp(step_m_ / gained_m, 0.25, 2.0);
    }
    if (travel_m <= 0) return {};
    std::size_t k = 1;
    while (k + 1 < travels_.size() && travels_[k] < travel_m) ++k;
    return {k - 1, (travel_m - travels_[k - 1]) / (travels_[k] - travels_[k - 1])};
  }
  double force_n(const Place& p) const {
    return p.share == 0 ? forces_[p.below] : (1 - p.share) * forces_[p.below] + p.share * forces_[p.below + 1];
  }
  TriMesh surface(const Place& p) const {
    TriMesh mesh = surfaces_[p.below];
    if (p.share > 0) mesh.vertices_m = (1 - p.share) * mesh.vertices_m + p.share * surfaces_[p.below + 1].vertices_m;
    return mesh;
  }

 private:
  // A foam bears no more than some force, and steps towards it get shorter without end. A little further it gives way under that
  // force as it did last.
  void go_on_at_limit(double travel_m) {
    constexpr double a_little = 1.05;
    const std::size_t last = travels_.size() - 1;
    if (limit_m_ == 0) limit_m_ = travels_[last];
    if (travel_m > a_little * limit_m_)
      throw Error("the true object bears no more than " + std::to_string(forces_[last]) + " N, " + std::to_string(1000 * limit_m_) +
                      " mm deep: press less deep",
                  "LabRobot");
    std::size_t before = last;
    while (before > 0 && travels_[last] - travels_[before] < 0.1 * step_m_) --before;
    const double share = (a_little * limit_m_ - travels_[last]) / (travels_[last] - travels_[before]);
    TriMesh further = surfaces_[last];
    further.vertices_m += share * (surfaces_[last].vertices_m - surfaces_[before].vertices_m);
    forces_.push_back(forces_[last]);
    travels_.push_back(a_little * limit_m_);
    surfaces_.push_back(std::move(further));
  }
  // Where a fold is near, a whole step may be beyond it: the object is followed in smaller ones, and looked for elsewhere last.
  // @return whether there is an equilibrium so short a step on
  bool press_on() {
    constexpr int most_halvings = 3;
    for (int halvings = 0; halvings < most_halvings; ++halvings, step_n_ *= 0.5)
      if (object_->follow(forces_.back() + step_n_)) return true;
    try {
      object_->press(forces_.back() + step_n_);
      return true;
    } catch (const Error&) {
      if (step_n_ > near_limit * forces_.back()) throw;
      return false;
    }
  }

  // Of the force. A fold is passed in steps of a thousandth and more.
  static constexpr double still = 1e-4, near_limit = 1e-3;
  std::unique_ptr<Pressed> object_;
  double step_n_, step_m_, limit_m_ = 0;
  bool proportional_;
  std::vector<double> forces_, travels_;
  std::vector<TriMesh> surfaces_;
};

}  // namespace palpate::lab
