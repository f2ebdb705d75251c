// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/recorded_part.hpp"

#include <algorithm>
#include <variant>

namespace palpate::acquisition {

RecordedPart recorded_part(const Push& push, const Vec3& direction) {
  RecordedPart out;
  out.force_tare_std_n = push.force_tare_std_n;
  out.travel_offset_std_m = push.travel_offset_std_m;
  for (const Step& step : push.steps) {
    ++out.steps;
    const bool loaded = !step.loads.empty() && step.loads[0].force_n && step.loads[0].force_n->norm() > 0;
    const double force_n = loaded ? step.loads[0].force_n->dot(direction) : 0;
    out.force_n = std::max(out.force_n, force_n);
    out.unloading = out.unloading || step.unloading;
    out.rest = out.rest || !loaded;
    out.again = out.again || (step.unloading && !loaded);
    if (loaded) out.contact_m = step.loads[0].contact_m;
    if (loaded && step.unloading) out.back_at_n = std::min(out.back_at_n, force_n);
    for (const Observation& seen : step.observations) {
      if (const auto* encoder = std::get_if<ToolTravel>(&seen)) out.travel_m = std::max(out.travel_m, encoder->travel_m);
      const auto* frame = std::get_if<DepthFrame>(&seen);
      if (frame && !loaded && !step.unloading) out.before = *frame;
    }
  }
  return out;
}

}  // namespace palpate::acquisition
