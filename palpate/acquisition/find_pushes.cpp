// SPDX-License-Identifier: Apache-2.0
#include "palpate/acquisition/find_pushes.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "palpate/acquisition/force_begin.hpp"
#include "palpate/core/error.hpp"

namespace palpate::acquisition {
namespace {

constexpr std::size_t confirm_samples = 3;
constexpr double noise_factor = 5;
constexpr double guard_s = 0.1;  // before the contact is noticed, the force may have risen already

/// Mean and spread of the force over any stretch in one step.
class ForceSums {
 public:
  explicit ForceSums(const Track& track) : sum_(track.samples.size() + 1, Vec3::Zero()), square_(sum_) {
    for (std::size_t i = 0; i < track.samples.size(); ++i) {
      sum_[i + 1] = sum_[i] + track.samples[i].force_n;
      square_[i + 1] = square_[i] + track.samples[i].force_n.cwiseAbs2();
    }
  }
  Vec3 mean(std::size_t begin, std::size_t end) const { return (sum_[end] - sum_[begin]) / double(end - begin); }
  double std_of(std::size_t begin, std::size_t end) const {
    if (end - begin < 2) return 0;
    const Vec3 variance = (square_[end] - square_[begin]) / double(end - begin) - mean(begin, end).cwiseAbs2();
    return std::sqrt(std::max(0.0, variance.maxCoeff()) * double(end - begin) / double(end - begin - 1));
  }

 private:
  std::vector<Vec3> sum_, square_;
};

std::size_t first_after(const Track& track, double time_s) {
  return std::size_t(std::lower_bound(track.samples.begin(), track.samples.end(), time_s,
                                      [](const sensing::ContactSample& s, double t) { return s.time_s < t; }) -
                     track.samples.begin());
}

/// A contact begins while the tool comes nearer; a force that rises while it stands or goes back is something else (the
/// weight of a tool that turns, a sensor whose sign is the other way round).
bool approaches(const Track& track, std::size_t i) {
  constexpr double over_s = 0.2, least_m_s = 1e-4;
  const std::size_t before = first_after(track, track.samples[i].time_s - over_s);
  const double duration = track.samples[i].time_s - track.samples[before].time_s;
  const double moved = (track.samples[i].tip_m - track.samples[before].tip_m).dot(track.direction[i]);
  return before == i || moved > least_m_s * duration;
}

struct FreeAir {
  Vec3 tare_n = Vec3::Zero();
  double std_n = 0;
  std::size_t samples = 0;
  double time_s = 0;  // its middle
  Vec3 mean_n = Vec3::Zero();  // the tare, but where nothing is to be tared
  std::size_t end = 0;         // its last sample, excluded
};

/// A contact is noticed at the threshold, which a soft object reaches millimetres after it was touched: back to where the force left
/// the noise of the air.
std::size_t traced_back(const Track& track, const ForceSums& sums, const FreeAir& air, std::size_t noticed) {
  const double noise_n = 2 * air.std_n / std::sqrt(double(confirm_samples));
  std::size_t first = noticed;
  while (first > air.end + confirm_samples &&
         (sums.mean(first - confirm_samples, first) - air.tare_n).dot(track.direction[noticed]) > noise_n)
    --first;
  return first;
}

/// A force that leaves the free air while the tool comes nearer is perhaps the beginning of a contact. The air that follows is not
/// taken for free: mean and spread of a soft object's slow rise would go along with it, and the threshold would never be reached.
class Onset {
 public:
  explicit Onset(const Track& track) : track_(track) {}
  /// True while the air before the onset is to be kept.
  bool holds(std::size_t i, const ForceSums& sums, const FreeAir& air, double threshold_n) {
    if (air.samples == 0) return false;
    constexpr double recent_s = 0.3;
    const std::size_t recent = std::min(first_after(track_, track_.samples[i].time_s - recent_s),
                                        i >= confirm_samples ? i + 1 - confirm_samples : 0);
    const double count = double(i + 1 - recent);
    const double risen_n = (sums.mean(recent, i + 1) - air.mean_n).dot(track_.direction[i]);
    const double noise_n = significant * air.std_n * std::sqrt(1 / count + 1 / double(air.samples));
    // A sensor drifts as well, but not by that much within the time of the tare.
    const bool rises = risen_n > std::max(noise_n, least_share * threshold_n);
    if (!rises || (since_ && left(i))) since_.reset();
    if (rises && !since_ && approaches(track_, i)) since_ = i;
    return since_.has_value();
  }
  void forget() { since_.reset(); }

 private:
  /// Back, or aside: it was no contact, or is one no longer.
  bool left(std::size_t i) const {
    constexpr double clear_m = 0.002;
    const Vec3 moved = track_.samples[i].tip_m - track_.samples[*since_].tip_m;
    const double along = moved.dot(track_.direction[*since_]);
    return along < -clear_m || (moved - along * track_.direction[*since_]).norm() > clear_m + std::abs(along);
  }
  static constexpr double significant = 3, least_share = 0.2;
  const Track& track_;
  std::optional<std::size_t> since_;
};

/// Where the force began, as the push protocol finds it (`force_began_before_m`): a force is noticed above its noise only, which
/// of a soft object is half a millimetre late. From the approach up to the end of the first stand; or, where the tool does not
/// stop early, as far as the force is small, since a line is not what a round tip presses.
Vec3 traced_contact(const Track& track, const StreamPlan& plan, const ContactSpan& span, std::size_t air_begin) {
  constexpr double farthest_m = 0.03, increment_m = 0.0005;  // PushOptions::search_distance_m, ::increment_m
  constexpr double small = 10;                               // thresholds
  constexpr std::ptrdiff_t enough_samples = 10;
  const auto& samples = track.samples;
  const auto before_m = [&](std::size_t i) { return span.direction.dot(span.contact_m - samples[i].tip_m); };
  std::size_t first = span.begin;
  while (first > air_begin && before_m(first - 1) < farthest_m) --first;
  const auto still = find_still_times(track, span, plan);
  const double stood_s = still.empty() ? samples[span.end - 1].time_s : still.front().time_s;
  std::vector<sensing::ContactSample> rise;
  std::ptrdiff_t touching = 0;
  for (std::size_t i = first; i < span.end && samples[i].time_s <= stood_s; ++i) {
    rise.push_back(samples[i]);
    rise.back().force_n -= span.tare_n;
    touching += i >= span.begin ? 1 : 0;
    if (touching > enough_samples && span.direction.dot(rise.back().force_n) > small * plan.contact_threshold_n) break;
  }
  return span.contact_m - force_began_before_m(rise, span.contact_m, span.direction, {farthest_m, increment_m, 0}) * span.direction;
}

/// From the free air before a push to that between it and the next one, which begins with sample `next`.
ForceDrift drift_after(const Track& track, const ForceSums& sums, const ContactSpan& span, double tared_at_s, std::size_t next,
                       double tare_s) {
  constexpr double clear_m = 0.002, turned_cos = 0.9994;  // two degrees
  const auto& samples = track.samples;
  const auto is_clear = [&](std::size_t i) {
    return (samples[i].tip_m - span.contact_m).dot(span.direction) < -clear_m &&
           track.direction[i].dot(span.direction) > turned_cos;
  };
  const double latest_s = next < samples.size() ? samples[next].time_s - guard_s : samples.back().time_s;
  std::size_t begin = span.end;
  while (begin < next && !is_clear(begin)) ++begin;
  if (begin == next) return {};
  begin = first_after(track, samples[begin].time_s + guard_s);
  std::size_t end = begin;
  while (end < next && samples[end].time_s <= std::min(latest_s, samples[begin].time_s + tare_s) && is_clear(end)) ++end;
  if (end < begin + 2 || samples[end - 1].time_s - samples[begin].time_s < 0.5 * tare_s) return {};
  const double after_s = 0.5 * (samples[begin].time_s + samples[end - 1].time_s);
  return {(sums.mean(begin, end) - span.tare_n) / (after_s - tared_at_s), tared_at_s};
}

}  // namespace

std::vector<ContactSpan> find_contacts(const Track& track, const StreamPlan& plan) {
  std::vector<ContactSpan> spans;
  std::vector<std::size_t> air_begins;  // of each span: the end of the contact before it
  const auto& samples = track.samples;
  if (samples.size() < 2 * confirm_samples) return spans;
  const ForceSums sums(track);
  FreeAir fixed;
  if (plan.tare == Tare::between) {
    const std::size_t a = first_after(track, plan.tare_from_s), b = first_after(track, plan.tare_to_s);
    if (b <= a)
      throw Error("no force was measured between from_s and to_s; the forces run from " +
                      std::to_string(samples.front().time_s) + " to " + std::to_string(samples.back().time_s) + " s",
                  plan.source + ": wrench.tare");
    fixed = {sums.mean(a, b), sums.std_of(a, b), b - a};
  }
  Onset onset(track);
  std::size_t free_since = 0, window_begin = 0, window_end = 0, run = 0;
  bool touching = false;
  FreeAir air = fixed;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!touching && plan.tare != Tare::between) {
      // Free air: the last `tare_s` before now, with a guard; at the very beginning, what there is.
      const double now = samples[i].time_s;
      while (window_end < i && samples[window_end].time_s < now - guard_s) ++window_end;
      while (window_begin < window_end && samples[window_begin].time_s < now - guard_s - plan.tare_s) ++window_begin;
      window_begin = std::max(window_begin, free_since);
      const bool enough =
          window_end > window_begin && samples[window_end - 1].time_s - samples[window_begin].time_s > 0.5 * plan.tare_s;
      if (run == 0 && enough && !onset.holds(i, sums, air, plan.contact_threshold_n)) {
        const Vec3 mean = sums.mean(window_begin, window_end);
        air = {plan.tare == Tare::none ? Vec3(Vec3::Zero()) : mean, sums.std_of(window_begin, window_end),
               window_end - window_begin, 0.5 * (samples[window_begin].time_s + samples[window_end - 1].time_s), mean, window_end};
      }
      if (air.samples == 0) {
        if (plan.tare == Tare::before_contact) continue;  // nothing to compare with yet
      }
    }
    const double threshold = std::max(plan.contact_threshold_n, noise_factor * air.std_n);
    const Vec3& along = touching ? spans.back().direction : track.direction[i];
    const double force = (samples[i].force_n - air.tare_n).dot(along);
    const bool counts = touching ? force < 0.5 * threshold : force > threshold && approaches(track, i);
    run = counts ? run + 1 : 0;
    if (run < confirm_samples) continue;
    run = 0;
    touching = !touching;
    const std::size_t noticed = i + 1 - confirm_samples;
    if (touching) {
      const std::size_t first = plan.tare == Tare::before_contact ? traced_back(track, sums, air, noticed) : noticed;
      ContactSpan span;
      span.begin = first;
      span.end = samples.size();
      span.tare_n = air.tare_n;
      span.free_air_std_n = air.std_n;
      span.free_air_samples = air.samples;
      span.drift.zero_at_s = air.time_s;
      span.contact_m = samples[first].tip_m;
      span.direction = track.direction[first];
      spans.push_back(span);
      air_begins.push_back(free_since);
    } else {
      spans.back().end = noticed;
      onset.forget();
      free_since = window_begin = window_end = i + 1;
      if (plan.tare == Tare::before_contact) air.samples = 0;  // drift: the next push has its own
    }
  }
  // A touch that is lost for a moment is the same push.
  std::vector<ContactSpan> joined;
  std::vector<std::size_t> air_before;
  for (std::size_t k = 0; k < spans.size(); ++k) {
    const ContactSpan& span = spans[k];
    const bool close = !joined.empty() && samples[span.begin].time_s - samples[joined.back().end - 1].time_s < plan.hold_s;
    if (close) {
      joined.back().end = span.end;
      continue;
    }
    joined.push_back(span);
    air_before.push_back(air_begins[k]);
  }
  for (std::size_t k = 0; k < joined.size(); ++k) joined[k].contact_m = traced_contact(track, plan, joined[k], air_before[k]);
  for (std::size_t k = 0; k < joined.size() && plan.tare == Tare::before_contact; ++k) {
    const std::size_t next = k + 1 < joined.size() ? joined[k + 1].begin : samples.size();
    joined[k].drift = drift_after(track, sums, joined[k], joined[k].drift.zero_at_s, next, plan.tare_s);
  }
  std::erase_if(joined, [&](const ContactSpan& span) {
    return samples[span.end - 1].time_s - samples[span.begin].time_s < plan.hold_s;
  });
  return joined;
}

std::vector<StillTime> find_still_times(const Track& track, const ContactSpan& span, const StreamPlan& plan) {
  constexpr double speed_window_s = 0.2;
  std::vector<StillTime> found;
  const auto& samples = track.samples;
  const auto close = [&](std::size_t begin, std::size_t end) {
    if (end <= begin || samples[end - 1].time_s - samples[begin].time_s < plan.hold_s) return;
    std::vector<sensing::ContactSample> stretch(samples.begin() + std::ptrdiff_t(begin),
                                                samples.begin() + std::ptrdiff_t(end));
    for (sensing::ContactSample& one : stretch) one.force_n -= span.tare_n;
    sensing::SettlingOptions options;
    options.window_s = plan.hold_s;
    const sensing::Settling state = sensing::settling(stretch, span.direction, options);
    // Nobody can wait any more: only a force that crept beyond doubt is worth a word.
    const double limit_n_s = std::max(options.rate_n_s, options.relative_rate_s * std::abs(state.force_n));
    found.push_back({stretch.back().time_s, std::abs(state.rate_n_s) - 2 * state.rate_std_n_s < limit_n_s});
  };
  std::size_t left = span.begin, right = span.begin, begin = span.begin;
  bool still = false;
  for (std::size_t i = span.begin; i < span.end; ++i) {
    while (left < i && samples[left].time_s < samples[i].time_s - 0.5 * speed_window_s) ++left;
    while (right + 1 < span.end && samples[right].time_s < samples[i].time_s + 0.5 * speed_window_s) ++right;
    const double duration = samples[right].time_s - samples[left].time_s;
    const bool now = duration > 0 && (samples[right].tip_m - samples[left].tip_m).norm() / duration < plan.still_m_s;
    if (now && !still) begin = i;
    if (!now && still) close(begin, i);
    still = now;
  }
  if (still) close(begin, span.end);
  return found;
}

}  // namespace palpate::acquisition
