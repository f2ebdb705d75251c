// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/front_tree.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "palpate/fem/linear_solver/at.hpp"
#include "palpate/fem/linear_solver/elimination_order.hpp"

namespace palpate::fem {
namespace {

using Indices = std::vector<Index>;

// Nodes. Minimum degree costs a third of nested dissection; its factor is within 20 % on cubes below the first limit, always
// worse above the second, and in between both are tried.
constexpr Index kMinimumDegreeBelow = 400, kTryBothBelow = 2000;

/// Elimination tree of the graph under an order; both arrays are in positions (Liu 1986, path compression).
Indices elimination_tree(const QuotientGraph& graph, const Indices& order, const Indices& position) {
  const Index groups = graph.group_count();
  Indices parent(at(groups), -1), ancestor(at(groups), -1);
  for (Index i = 0; i < groups; ++i) {
    const Index group = order[at(i)];
    for (Index e = graph.begin[at(group)]; e < graph.begin[at(group + 1)]; ++e) {
      Index j = position[at(graph.neighbour[at(e)])];
      while (j != -1 && j < i) {
        const Index next = ancestor[at(j)];
        ancestor[at(j)] = i;
        if (next == -1) parent[at(j)] = i;
        j = next;
      }
    }
  }
  return parent;
}

/// Visits children before parents; roots and siblings in ascending order of `rank`.
Indices postorder(const Indices& parent, const std::vector<double>& rank) {
  const Index count = static_cast<Index>(parent.size());
  Indices by_rank(parent.size());
  std::iota(by_rank.begin(), by_rank.end(), 0);
  if (!rank.empty()) {
    std::stable_sort(by_rank.begin(), by_rank.end(), [&](Index a, Index b) { return rank[at(a)] < rank[at(b)]; });
  }
  Indices head(at(count) + 1, -1), next(at(count), -1);  // head[count]: the roots
  for (auto it = by_rank.rbegin(); it != by_rank.rend(); ++it) {
    const Index p = parent[at(*it)] < 0 ? count : parent[at(*it)];
    next[at(*it)] = head[at(p)];
    head[at(p)] = *it;
  }
  Indices order, stack;
  order.reserve(at(count));
  for (Index root = head[at(count)]; root != -1; root = next[at(root)]) {
    stack.push_back(root);
    while (!stack.empty()) {
      const Index node = stack.back();
      const Index child = head[at(node)];
      if (child != -1) {
        head[at(node)] = next[at(child)];
        stack.push_back(child);
      } else {
        order.push_back(node);
        stack.pop_back();
      }
    }
  }
  return order;
}

double elimination_flops(double k, double m) { return k * (m * m - m * k + k * k / 3.0); }

/// Nanoseconds of a front, as measured on AVX-512: a start-up, moving its update into the parent, its panel, its flops. Only
/// the proportions matter; they decide which fronts are merged.
double front_cost(double k, double m) {
  const double below = m - k;
  return 250.0 + 0.5 * below * below + 0.5 * m * k + elimination_flops(k, m) / 40.0;
}

/// An order with its tree and, for every group, the number of unknowns in its column of L.
struct Elimination {
  Indices order, position, parent;
  std::vector<double> height;
  double flops = 0;
};

Elimination eliminate(const QuotientGraph& graph, Indices order) {
  const Index groups = graph.group_count();
  Elimination result;
  result.position.resize(at(groups));
  for (Index i = 0; i < groups; ++i) result.position[at(order[at(i)])] = i;
  const Indices tree = elimination_tree(graph, order, result.position);
  const Indices visit = postorder(tree, {});
  Indices rank(at(groups));
  for (Index i = 0; i < groups; ++i) rank[at(visit[at(i)])] = i;
  result.order.resize(at(groups));
  result.parent.assign(at(groups), -1);
  for (Index i = 0; i < groups; ++i) {
    result.order[at(i)] = order[at(visit[at(i)])];
    const Index p = tree[at(visit[at(i)])];
    if (p >= 0) result.parent[at(i)] = rank[at(p)];
  }
  for (Index i = 0; i < groups; ++i) result.position[at(result.order[at(i)])] = i;

  // Row i of L is the part of the tree below i that its neighbours reach: every column met there gains row i.
  const auto weight = [&](Index i) {
    const Index group = result.order[at(i)];
    return static_cast<double>(graph.first_unknown[at(group + 1)] - graph.first_unknown[at(group)]);
  };
  result.height.resize(at(groups));
  Indices seen(at(groups), -1);
  for (Index i = 0; i < groups; ++i) {
    result.height[at(i)] = weight(i);
    seen[at(i)] = i;
    const Index group = result.order[at(i)];
    for (Index e = graph.begin[at(group)]; e < graph.begin[at(group + 1)]; ++e) {
      for (Index j = result.position[at(graph.neighbour[at(e)])]; j < i && seen[at(j)] != i; j = result.parent[at(j)]) {
        seen[at(j)] = i;
        result.height[at(j)] += weight(i);
      }
    }
  }
  for (Index i = 0; i < groups; ++i) result.flops += elimination_flops(weight(i), result.height[at(i)]);
  return result;
}

Elimination best_elimination(const QuotientGraph& graph) {
  if (graph.group_count() < kMinimumDegreeBelow) return eliminate(graph, minimum_degree_order(graph));
  Elimination dissected = eliminate(graph, nested_dissection_order(graph));
  if (graph.group_count() >= kTryBothBelow) return dissected;
  Elimination minimum_degree = eliminate(graph, minimum_degree_order(graph));
  return minimum_degree.flops < dissected.flops ? minimum_degree : dissected;
}

/// Fronts as sets of groups: `owner` of a position is the front it is eliminated in.
struct Merged {
  Indices owner, parent;
  std::vector<double> pivots, height;
};

Merged merge_fronts(const QuotientGraph& graph, const Elimination& elimination) {
  const Index groups = graph.group_count();
  Merged merged;
  merged.owner.resize(at(groups));
  Indices top;  // last position of a front
  for (Index i = 0; i < groups; ++i) {
    const Index group = elimination.order[at(i)];
    const double weight = graph.first_unknown[at(group + 1)] - graph.first_unknown[at(group)];
    const bool continues = i > 0 && elimination.parent[at(i - 1)] == i && [&] {
      const Index before = elimination.order[at(i - 1)];
      const double lost = graph.first_unknown[at(before + 1)] - graph.first_unknown[at(before)];
      return elimination.height[at(i - 1)] - lost == elimination.height[at(i)];
    }();
    if (continues) {
      merged.pivots.back() += weight;
      top.back() = i;
    } else {
      merged.pivots.push_back(weight);
      merged.height.push_back(elimination.height[at(i)]);
      top.push_back(i);
    }
    merged.owner[at(i)] = static_cast<Index>(top.size()) - 1;
  }
  const Index count = static_cast<Index>(top.size());
  merged.parent.assign(at(count), -1);
  std::vector<Indices> children(at(count));
  for (Index front = 0; front < count; ++front) {
    const Index p = elimination.parent[at(top[at(front)])];
    if (p < 0) continue;
    merged.parent[at(front)] = merged.owner[at(p)];
    children[at(merged.parent[at(front)])].push_back(front);
  }

  // Bottom-up: a child goes into its parent when the larger front is cheaper than the two. Rows of the child below its
  // pivots are rows of the parent, so the merged front has the parent's rows and the child's pivots.
  Indices into(at(count));
  std::iota(into.begin(), into.end(), 0);
  for (Index front = 0; front < count; ++front) {
    const auto gain = [&](Index child) {
      const double kc = merged.pivots[at(child)], mc = merged.height[at(child)];
      const double kp = merged.pivots[at(front)], mp = merged.height[at(front)];
      return front_cost(kc, mc) + front_cost(kp, mp) - front_cost(kc + kp, kc + mp);
    };
    Indices candidates = std::move(children[at(front)]), kept;
    std::stable_sort(candidates.begin(), candidates.end(), [&](Index a, Index b) { return gain(a) > gain(b); });
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const Index child = candidates[i];
      if (gain(child) <= 0) {
        kept.push_back(child);
        continue;
      }
      into[at(child)] = front;
      merged.pivots[at(front)] += merged.pivots[at(child)];
      merged.height[at(front)] += merged.pivots[at(child)];
      candidates.insert(candidates.end(), children[at(child)].begin(), children[at(child)].end());
    }
    children[at(front)] = std::move(kept);
  }
  const auto find = [&](Index front) {
    while (into[at(front)] != front) front = into[at(front)];
    return front;
  };
  Indices number(at(count), -1);
  Index kept = 0;
  for (Index front = 0; front < count; ++front) {
    if (into[at(front)] == front) number[at(front)] = kept++;
  }
  Merged result;
  result.owner.resize(at(groups));
  for (Index i = 0; i < groups; ++i) result.owner[at(i)] = number[at(find(merged.owner[at(i)]))];
  for (Index front = 0; front < count; ++front) {
    if (number[at(front)] < 0) continue;
    const Index p = merged.parent[at(front)];
    result.parent.push_back(p < 0 ? -1 : number[at(find(p))]);
    result.pivots.push_back(merged.pivots[at(front)]);
    result.height.push_back(merged.height[at(front)]);
  }
  return result;
}

/// Liu's rule for the order of siblings: the one whose working memory exceeds what it leaves behind the most goes first.
std::vector<double> sibling_rank(const Merged& merged) {
  const Index count = static_cast<Index>(merged.parent.size());
  std::vector<Indices> children(at(count));
  std::vector<double> rank(at(count)), peak(at(count));
  for (Index front = 0; front < count; ++front) {  // parents have larger numbers
    const auto left = [&](Index f) { return std::pow(merged.height[at(f)] - merged.pivots[at(f)], 2); };
    std::sort(children[at(front)].begin(), children[at(front)].end(),
              [&](Index a, Index b) { return rank[at(a)] != rank[at(b)] ? rank[at(a)] < rank[at(b)] : a < b; });
    double held = 0;
    for (const Index child : children[at(front)]) {
      peak[at(front)] = std::max(peak[at(front)], held + peak[at(child)]);
      held += left(child);
    }
    peak[at(front)] = std::max(peak[at(front)], held + left(front));
    rank[at(front)] = left(front) - peak[at(front)];
    if (merged.parent[at(front)] >= 0) children[at(merged.parent[at(front)])].push_back(front);
  }
  return rank;
}

/// Final numbering of groups and unknowns, and the fronts' rows.
void lay_out_fronts(const QuotientGraph& graph, const Elimination& elimination, const Merged& merged, FrontTree& tree) {
  const Index groups = graph.group_count(), count = static_cast<Index>(merged.parent.size());
  const Indices visit = postorder(merged.parent, sibling_rank(merged));
  Indices number(at(count));
  for (Index i = 0; i < count; ++i) number[at(visit[at(i)])] = i;

  Indices begin(at(count) + 1, 0);
  for (Index i = 0; i < groups; ++i) ++begin[at(number[at(merged.owner[at(i)])] + 1)];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  Indices fill(begin.begin(), begin.end() - 1), order(at(groups)), position(at(groups));  // of groups, final
  for (Index i = 0; i < groups; ++i) order[at(fill[at(number[at(merged.owner[at(i)])])]++)] = elimination.order[at(i)];
  for (Index i = 0; i < groups; ++i) position[at(order[at(i)])] = i;

  Indices first_of_group(at(groups) + 1, 0);  // first unknown of a group in final order
  tree.position.resize(at(tree.size));
  for (Index i = 0; i < groups; ++i) {
    const Index from = graph.first_unknown[at(order[at(i)])], to = graph.first_unknown[at(order[at(i)] + 1)];
    first_of_group[at(i + 1)] = first_of_group[at(i)] + to - from;
    for (Index u = from; u < to; ++u) tree.position[at(u)] = first_of_group[at(i)] + u - from;
  }

  tree.fronts.resize(at(count));
  std::vector<Indices> below(at(count));  // groups, freed once the parent has seen them
  Indices seen(at(groups), -1);
  for (Index f = 0; f < count; ++f) {
    FrontTree::Front& front = tree.fronts[at(f)];
    const Index old_parent = merged.parent[at(visit[at(f)])];
    front.parent = old_parent < 0 ? -1 : number[at(old_parent)];
    Indices& mine = below[at(f)];
    const Index last = begin[at(f + 1)];
    const auto add = [&](Index i) {
      if (i < last || seen[at(i)] == f) return;
      seen[at(i)] = f;
      mine.push_back(i);
    };
    for (Index i = begin[at(f)]; i < last; ++i) {
      const Index group = order[at(i)];
      for (Index e = graph.begin[at(group)]; e < graph.begin[at(group + 1)]; ++e) add(position[at(graph.neighbour[at(e)])]);
    }
    for (Index child = front.last_child; child >= 0; child = tree.fronts[at(child)].previous_sibling) {
      for (const Index i : below[at(child)]) add(i);
      Indices().swap(below[at(child)]);
    }
    std::sort(mine.begin(), mine.end());
    front.first = first_of_group[at(begin[at(f)])];
    front.pivots = first_of_group[at(last)] - front.first;
    front.rows = tree.rows.size();
    for (const Index i : mine) {
      for (Index u = first_of_group[at(i)]; u < first_of_group[at(i + 1)]; ++u) tree.rows.push_back(u);
    }
    front.height = front.pivots + static_cast<Index>(tree.rows.size() - front.rows);
    front.panel = tree.panel_values;
    tree.panel_values += at(front.height) * at(front.pivots);
    const double own = elimination_flops(front.pivots, front.height);
    front.subtree_flops += own;
    tree.flops += own;
    if (front.parent >= 0) {
      FrontTree::Front& parent = tree.fronts[at(front.parent)];
      parent.subtree_flops += front.subtree_flops;
      front.previous_sibling = parent.last_child;
      parent.last_child = f;
    }
  }
  for (Index f = count - 1; f >= 0; --f) {
    if (tree.fronts[at(f)].parent >= 0) tree.fronts[at(f)].depth = tree.fronts[at(tree.fronts[at(f)].parent)].depth + 1;
  }
}

void map_entries_and_updates(const Eigen::SparseMatrix<double>& lower, FrontTree& tree) {
  Indices front_of(at(tree.size));
  for (std::size_t f = 0; f < tree.fronts.size(); ++f) {
    const FrontTree::Front& front = tree.fronts[f];
    std::fill_n(front_of.begin() + front.first, front.pivots, static_cast<Index>(f));
  }
  const Index* const begin = lower.outerIndexPtr();
  const Index* const row = lower.innerIndexPtr();
  struct Place {
    Index row, column;
  };
  const auto place = [&](Index entry, Index column) {
    const Index a = tree.position[at(row[entry])], b = tree.position[at(column)];
    return a > b ? Place{a, b} : Place{b, a};
  };
  std::vector<std::size_t> next(tree.fronts.size() + 1, 0);
  for (Index column = 0; column < tree.size; ++column) {
    for (Index e = begin[column]; e < begin[column + 1]; ++e) ++next[at(front_of[at(place(e, column).column)]) + 1];
  }
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (std::size_t f = 0; f < tree.fronts.size(); ++f) {
    tree.fronts[f].first_entry = next[f];
    tree.fronts[f].last_entry = next[f + 1];
  }
  std::vector<Place> places(static_cast<std::size_t>(lower.nonZeros()));
  tree.entries.resize(places.size());
  for (Index column = 0; column < tree.size; ++column) {
    for (Index e = begin[column]; e < begin[column + 1]; ++e) {
      const Place p = place(e, column);
      const std::size_t slot = next[at(front_of[at(p.column)])]++;
      places[slot] = p;
      tree.entries[slot].source = e;
    }
  }
  Indices local(at(tree.size));  // row of the current front
  for (std::size_t f = 0; f < tree.fronts.size(); ++f) {
    FrontTree::Front& front = tree.fronts[f];
    const Index* const below = tree.rows.data() + front.rows;
    for (Index i = 0; i < front.pivots; ++i) local[at(front.first + i)] = i;
    for (Index i = 0; i < front.below(); ++i) local[at(below[i])] = front.pivots + i;
    for (std::size_t e = front.first_entry; e < front.last_entry; ++e) {
      const std::size_t offset = at(places[e].column - front.first) * at(front.height) + at(local[at(places[e].row)]);
      tree.entries[e].target = static_cast<std::uint32_t>(offset);
    }
    for (Index child = front.last_child; child >= 0; child = tree.fronts[at(child)].previous_sibling) {
      FrontTree::Front& from = tree.fronts[at(child)];
      const Index* const rows = tree.rows.data() + from.rows;
      from.first_run = tree.runs.size();
      for (Index i = 0; i < from.below(); ++i) {
        const Index to = local[at(rows[i])];
        const bool continues =
            tree.runs.size() > from.first_run && to != front.pivots && tree.runs.back().to + tree.runs.back().length == to;
        if (continues) {
          ++tree.runs.back().length;
        } else {
          tree.runs.push_back({i, to, 1});
        }
      }
      from.last_run = tree.runs.size();
    }
  }
}

}  // namespace

FrontTree build_front_tree(const Eigen::SparseMatrix<double>& lower, int largest_group) {
  FrontTree tree;
  tree.size = static_cast<Index>(lower.cols());
  tree.entries_of_matrix = lower.nonZeros();
  const QuotientGraph graph = quotient_graph(lower, largest_group);
  const Elimination elimination = best_elimination(graph);
  lay_out_fronts(graph, elimination, merge_fronts(graph, elimination), tree);
  map_entries_and_updates(lower, tree);
  return tree;
}

}  // namespace palpate::fem
