// SPDX-License-Identifier: Apache-2.0
#include "palpate/geometry/closest_search.hpp"

#include <bit>
#include <cmath>
#include <cstring>

#include "palpate/geometry/float_lanes.hpp"

namespace palpate::geometry {

struct Vec3x4 {
  lanes::Floats x, y, z;
};

namespace {

using lanes::Floats;

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float slack = 1 + 4e-6f;  // of limits, for the rounding of bounds to boxes

// What `bounds` may be wrong by, in grid units: half a unit an axis for a corner's rounding, and floats' own rounding, which
// grows with the distance. Triangles for which that does not hold are called thin.
constexpr float absolute_error = 1.25F, relative_error = 2.5e-4F;

float farther(float distance) { return distance * (1 + relative_error) + absolute_error; }

Vec3x4 operator-(const Vec3x4& a, const Vec3x4& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec3x4 operator*(Floats s, const Vec3x4& a) { return {s * a.x, s * a.y, s * a.z}; }
Floats dot(const Vec3x4& a, const Vec3x4& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec3x4 cross(const Vec3x4& a, const Vec3x4& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Squared distance from the segment that starts at `from_start` = 0. Corners are whole numbers: no length is below one.
[[gnu::always_inline]] inline Floats to_segment(const Vec3x4& edge, const Vec3x4& from_start) {
  using namespace lanes;
  const Floats t = smaller(larger(dot(edge, from_start) / larger(dot(edge, edge), all(1)), all(0)), all(1));
  const Vec3x4 apart = from_start - t * edge;
  return dot(apart, apart);
}

/// Squared distances of four triangles: the nearest edge, or the plane where the foot lies inside.
[[gnu::always_inline]] inline Floats to_triangles(const Vec3x4& a, const Vec3x4& b, const Vec3x4& c, const Vec3x4& p) {
  using namespace lanes;
  const Vec3x4 ab = b - a, ac = c - a, ap = p - a;
  const Floats edges = smaller(smaller(to_segment(ab, ap), to_segment(ac, ap)), to_segment(c - b, p - b));
  const Vec3x4 n = cross(ab, ac);
  const Floats n2 = dot(n, n), v = dot(cross(ap, ac), n), w = dot(cross(ab, ap), n), height = dot(n, ap);
  // One for lines and points, which have no inside.
  const Floats outside = larger(larger(larger(-v, -w), larger(v + w - n2, all(1) - n2)), all(0));
  return smaller(height * height / larger(n2, all(1)) + all(1e30F) * outside, edges);
}

Vec3x4 unpack(const std::array<std::array<std::uint16_t, 4>, 3>& axes) {
  return {lanes::unpack(axes[0].data()), lanes::unpack(axes[1].data()), lanes::unpack(axes[2].data())};
}

}  // namespace

/// Bounds so far, and what may still be nearest.
struct ClosestSearch::Query {
  std::array<float, 3> up, down;  ///< the point relative to the centre, rounded both ways
  Vec3x4 on_grid;
  Vec3 point;
  double unit;
  float limit = infinity;       ///< of squared distances to boxes, m^2
  float limit_grid = infinity;  ///< of what `to_triangles` says, grid units
  double best = std::numeric_limits<double>::infinity();
  Found found;
  Index slot = -1;
  int waiting = 0;
  struct Waiting {
    float grid;
    Index slot;
  };
  std::array<Waiting, 64> candidates;

  Query(const ClosestSearch& s, const Vec3& p) : point(p), unit(s.unit_m_) {
    const Vec3 r = p - s.centre_m_, g = (p - s.low_m_) / unit;
    const double error = 2.5e-7 * std::max(s.extent_m_, r.cwiseAbs().maxCoeff());  // of rounding, and of two subtractions
    for (int k = 0; k < 3; ++k) {
      up[k] = static_cast<float>(r[k] + error);
      down[k] = static_cast<float>(r[k] - error);
    }
    on_grid = {lanes::all(static_cast<float>(g.x())), lanes::all(static_cast<float>(g.y())),
               lanes::all(static_cast<float>(g.z()))};
  }
  /// The surface is known to be no farther than this.
  void bound(double squared_m2) {
    const float grid = farther(static_cast<float>(std::sqrt(squared_m2) / unit));
    limit = std::min(limit, static_cast<float>(squared_m2) * slack);
    limit_grid = std::min(limit_grid, grid * grid);
  }
  void ask(const ClosestSearch& s, Index candidate) {
    const Index triangle = s.triangle_[candidate];
    const Candidate c = closest_on(s.exact_[candidate], point);
    if (!(c.squared < found.at.squared || (c.squared == found.at.squared && triangle < found.triangle))) return;
    found.at = c;
    found.triangle = triangle;
    slot = candidate;
  }
  void ask_waiting(const ClosestSearch& s) {
    for (int i = 0; i < waiting; ++i)
      if (!(candidates[i].grid > limit_grid)) ask(s, candidates[i].slot);
    waiting = 0;
    bound(found.at.squared);
  }
};

namespace {

/// Visits blocks whose boxes are within query.limit, the nearest child of a node first, until one of them says to stop.
template <class Search, class Query, class AtBlock>
void walk(const Search& nodes, const auto& blocks, Query& query, const AtBlock& at_block) {
  struct Visit {
    float squared;
    std::int32_t child;
  };
  std::array<Visit, 8 * bvh_stack_size> stack;
  int top = 0;
  const auto soon = [&](std::int32_t child) {
    const bool is_block = child < 0;
    const void* const first = is_block ? static_cast<const void*>(blocks.data()) : nodes.data();
    const std::size_t size = is_block ? sizeof blocks[0] : sizeof nodes[0];
    lanes::fetch(static_cast<const char*>(first) + size * static_cast<std::size_t>(is_block ? ~child >> 6 : child));
  };
  for (std::int32_t at = 0;;) {
    if (at >= 0) {
      const auto& node = nodes[at];
      Floats first{}, last{};
      for (int k = 0; k < 3; ++k) {
        const float step = node.step[k], per_step = 1 / step;  // powers of two
        const float up = (query.up[k] - node.origin[k]) * per_step, down = (query.down[k] - node.origin[k]) * per_step;
        Floats low_first, low_last, high_first, high_last;
        lanes::unpack(node.low[k].data(), low_first, low_last);
        lanes::unpack(node.high[k].data(), high_first, high_last);
        const Floats x = lanes::larger(lanes::larger(low_first - up, down - high_first), lanes::all(0)) * step;
        const Floats y = lanes::larger(lanes::larger(low_last - up, down - high_last), lanes::all(0)) * step;
        first += x * x;
        last += y * y;
      }
      unsigned near = ~(lanes::above(first, query.limit) | lanes::above(last, query.limit) << 4) & node.valid;
      if (near != 0) {
        int nearest = lanes::where_smallest(first, last);
        if ((near >> nearest & 1U) == 0) nearest = std::countr_zero(near);
        at = node.child[nearest];
        soon(at);
        std::array<Floats, 2> squared{first, last};
        std::array<float, 8> each;
        std::memcpy(each.data(), squared.data(), sizeof each);
        for (near &= ~(1U << nearest); near != 0; near &= near - 1) {
          const int i = std::countr_zero(near);
          stack[top++] = {each[i], node.child[i]};
          soon(node.child[i]);
        }
        continue;
      }
    } else if (at_block(static_cast<std::uint32_t>(~at))) {
      return;
    }
    do {
      if (top == 0) return;
      at = stack[--top].child;
    } while (stack[top].squared > query.limit);
  }
}

}  // namespace

ClosestSearch::Found ClosestSearch::closest(const Vec3& point_m, Index hint) const {
  Query query(*this, point_m);
  if (hint >= 0 && hint < static_cast<Index>(slot_.size())) {
    query.ask(*this, slot_[hint]);
    query.bound(query.found.at.squared);
  }
  walk(nodes_, blocks_, query, [&](std::uint32_t reference) {
    const auto block = static_cast<Index>(reference >> 6);
    const auto& corner = blocks_[block].corner;
    const Floats grid = to_triangles(unpack(corner[0]), unpack(corner[1]), unpack(corner[2]), query.on_grid);
    unsigned open = ~lanes::above(grid, query.limit_grid) & ((2U << (reference & 3U)) - 1);
    const unsigned thin = reference >> 2 & 15U;
    if (thin == 0) {
      if (open == 0) return false;
      const float distance = farther(std::sqrt(lanes::smallest(grid)));
      query.limit_grid = std::min(query.limit_grid, farther(distance) * farther(distance));
      query.limit = std::min(query.limit, static_cast<float>(double(distance) * distance * unit_m_ * unit_m_) * slack);
    } else {
      for (int i = 0; i < block_size; ++i)
        if ((thin >> i & 1U) != 0) query.ask(*this, block_size * block + i);
      query.bound(query.found.at.squared);
      open &= ~thin;
    }
    if (query.waiting + block_size > static_cast<int>(query.candidates.size())) query.ask_waiting(*this);
    for (; open != 0; open &= open - 1) {
      const int i = std::countr_zero(open);
      if (grid[i] > query.limit_grid) continue;
      query.candidates[query.waiting++] = {grid[i], block_size * block + i};
      lanes::fetch(&exact_[block_size * block + i]);
    }
    return false;
  });
  query.ask_waiting(*this);
  Found& found = query.found;
  if (query.slot >= 0) {
    const Corner& t = exact_[query.slot];
    found.point_m = t.a + found.at.v * t.ab + found.at.w * t.ac;
  }
  return found;
}

bool ClosestSearch::within(const Vec3& point_m, double squared_distance_m2, Index hint) const {
  if (!(squared_distance_m2 >= 0)) return false;
  const auto is_within = [&](Index slot) { return closest_on(exact_[slot], point_m).squared <= squared_distance_m2; };
  if (hint >= 0 && hint < static_cast<Index>(slot_.size()) && is_within(slot_[hint])) return true;
  Query query(*this, point_m);
  query.bound(squared_distance_m2);
  const auto grid_distance = static_cast<float>(std::sqrt(squared_distance_m2) / unit_m_);
  const float sure = (grid_distance - absolute_error) / (1 + relative_error) - 1e-6F * grid_distance;
  const float surely_within = sure > 0 ? sure * sure : -1;
  bool yes = false;
  walk(nodes_, blocks_, query, [&](std::uint32_t reference) {
    const auto block = static_cast<Index>(reference >> 6);
    const auto& corner = blocks_[block].corner;
    const Floats grid = to_triangles(unpack(corner[0]), unpack(corner[1]), unpack(corner[2]), query.on_grid);
    const unsigned here = (2U << (reference & 3U)) - 1, thin = reference >> 2 & 15U;
    for (unsigned open = (~lanes::above(grid, query.limit_grid) | thin) & here; open != 0 && !yes; open &= open - 1) {
      const int i = std::countr_zero(open);
      yes = ((thin >> i & 1U) == 0 && grid[i] < surely_within) || is_within(block_size * block + i);
    }
    return yes;
  });
  return yes;
}

}  // namespace palpate::geometry
