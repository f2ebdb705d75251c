// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/acquisition/push_protocol.hpp"

namespace palpate::acquisition {

/// How far the tip moves between two looks at the force: an increment, or less where the object is seen to be so stiff that an
/// increment would pass a force step or the limit. Of a soft object every motion is an increment.
class MotionLengths {
 public:
  /// What a reading tells: force along the push and travel since contact.
  struct Seen {
    double force_n = 0, travel_m = 0;
  };

  explicit MotionLengths(const PushOptions& options);
  /// Standard deviations of one reading; of soft objects they must not make stiff ones.
  void state_noise(double force_std_n, double travel_sigma_m);

  /// More at the first touch, and the object is too stiff for increments.
  bool is_hard_touch(double force_n, double motion_m) const;
  /// To touch it again: even a surface that was met at the very end of the motion then gives a quarter of a step.
  double after_hard_touch_m(double force_n, double motion_m) const;

  /// Contact was noticed at `at_m` after a motion of this length.
  void touched(double at_m, double motion_m);
  /// The tip went deeper, and the force rose.
  void moved(double length_m, double risen_n);
  double next_m(const Seen& seen, double at_m) const;
  /// On the way back, where this much force lies between two steps.
  double back_m(const Seen& seen, double between_n) const;

  /// Nothing announced it: a softer layer ended, or the tip met an edge. The last motion is then to be taken back.
  bool is_far_beyond(double force_n, double at_m) const;
  /// Says how long that was; those that follow are shorter.
  double take_back_m(double force_n);

  /// Newtons a metre, as seen since contact, or in the last motion where that shows beyond doubt that it has become stiffer.
  double stiffness_n_m(const Seen& seen) const;
  double finest_m() const { return finest_m_; }

 private:
  double step_n() const;
  double shortest_m() const;
  bool feels_its_way() const;
  double sure_stiffness_n_m(const Seen& seen) const;
  double for_steps_m(const Seen& seen, double between_n) const;

  const PushOptions& options_;
  double force_std_n_ = 0, travel_sigma_m_ = 0;
  double touched_at_m_ = 0, last_m_ = 0, finest_m_ = 0;
  double first_m_ = 0, longest_m_ = 0;         // most of the first motion since contact, and of any
  double risen_n_m_ = 0, sure_risen_n_m_ = 0;  // in the last motion, and without what noise may have done
};

}  // namespace palpate::acquisition
