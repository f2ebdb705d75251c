// SPDX-License-Identifier: Apache-2.0
// Fisher information of pushes that nobody has made: steps are made up, and the fit's forward model and terms do the rest.
// Inner header of next_push.
#pragma once

#include <memory>

#include "palpate/estimation/next_push.hpp"

namespace palpate::estimation {

class PushInformation {
 public:
  /// Two factorisations: one says how far each candidate gives way and so how hard it may be pushed, the other (the forward
  /// model's) has every candidate's loads as right-hand sides.
  PushInformation(const Recording& scene, const SimulatedObject& object, const std::string& tool,
                  const std::vector<PushCandidate>& candidates, const SensorPlan& sensors, const Knowledge& knowledge,
                  const RankOptions& options);
  ~PushInformation();

  std::size_t count() const;  ///< candidates that the supports carry
  int left_out() const;       ///< the others
  /// Of errors that all pushes share, by themselves, in the order in which pushes rated so far hold them (the last of their information;
  /// those of earlier pushes hold fewer).
  VectorX shared_information() const;
  /// One entry a view and force level; empty where no view shows the place. `expected` is left open.
  std::vector<RatedPush> rate(std::size_t candidate);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::estimation
