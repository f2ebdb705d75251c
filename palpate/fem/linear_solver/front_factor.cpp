// SPDX-License-Identifier: Apache-2.0
#include "palpate/fem/linear_solver/front_factor.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "palpate/fem/linear_solver/at.hpp"

namespace palpate::fem {
namespace {

constexpr int kBlock = 128;       // pivots eliminated between two updates of the rest of a front
constexpr int kColumnChunk = 64;  // columns that a member of the team takes at a time
// Below this work two threads cost more than they save.
constexpr double kFlopsWorthThreads = 2e7;

int round_up(int value, int to) { return (value + to - 1) / to * to; }

/// Columns of blocks of nearly equal size.
int block_size(int pivots) {
  const int blocks = std::max(1, (pivots + kBlock - 1) / kBlock);
  return (pivots + blocks - 1) / blocks;
}

}  // namespace

template <class T>
struct FrontFactor<T>::Workspace {
  LargeArray<T> stack[2];
  LargeArray<T> strips, panels, diagonal_panels, diagonal_strip;
};

template <class T>
FrontFactor<T>::FrontFactor(std::shared_ptr<const FrontTree> tree, int threads, const DenseKernels<T>& kernels)
    : tree_(std::move(tree)), kernels_(kernels), threads_(tree_->flops < kFlopsWorthThreads ? 1 : std::max(1, threads)) {
  plan(threads_);
  values_ = LargeArray<T>(tree_->panel_values);
  inverse_pivots_ = LargeArray<T>(at(tree_->size));
  floor_ = LargeArray<T>(at(tree_->size));
  kept_ = LargeArray<T>(kept_size_);
  for (int thread = 0; thread < threads_; ++thread) {
    auto workspace = std::make_unique<Workspace>();
    const bool also_top = thread == 0;
    for (const int s : {0, 1}) {
      workspace->stack[s] = LargeArray<T>(std::max(task_stack_[s], also_top ? top_stack_[s] : 0));
    }
    workspace->strips = LargeArray<T>(std::max(strip_size_[0], also_top ? strip_size_[1] : 0));
    workspace->panels = LargeArray<T>(std::max(panel_size_[0], also_top ? panel_size_[1] : 0));
    const int block = round_up(kBlock, kernels_.strip_rows);
    workspace->diagonal_panels = LargeArray<T>(at(block) * at(block));
    workspace->diagonal_strip = LargeArray<T>(at(block) * at(kernels_.strip_rows));
    workspaces_.push_back(std::move(workspace));
  }
}

template <class T>
FrontFactor<T>::~FrontFactor() = default;

/// Cuts the tree into subtrees for single threads and a top that all work on together, and gives every update its place. Two
/// stacks, for fronts of even and of odd depth, let a parent's update be written while its children's are still there.
template <class T>
void FrontFactor<T>::plan(int threads) {
  const auto& fronts = tree_->fronts;
  const Index count = static_cast<Index>(fronts.size());
  std::vector<Index> first_of_subtree(at(count));
  for (Index f = 0; f < count; ++f) {
    first_of_subtree[at(f)] = f;
    Index child = fronts[at(f)].last_child;
    while (child >= 0 && fronts[at(child)].previous_sibling >= 0) child = fronts[at(child)].previous_sibling;
    if (child >= 0) first_of_subtree[at(f)] = first_of_subtree[at(child)];
  }
  std::vector<char> in_task(at(count), 0);
  if (threads > 1) {
    const double largest = tree_->flops / (6.0 * threads);
    for (Index f = count - 1; f >= 0;) {
      if (fronts[at(f)].subtree_flops > largest) {
        --f;
        continue;
      }
      tasks_.push_back({first_of_subtree[at(f)], f});
      std::fill(in_task.begin() + first_of_subtree[at(f)], in_task.begin() + f + 1, 1);
      f = first_of_subtree[at(f)] - 1;
    }
    std::stable_sort(tasks_.begin(), tasks_.end(), [&](const Task& a, const Task& b) {
      return fronts[at(a.root)].subtree_flops > fronts[at(b.root)].subtree_flops;
    });
  }
  for (Index f = 0; f < count; ++f) {
    if (!in_task[at(f)]) top_.push_back(f);
  }

  updates_.resize(at(count));
  const auto square = [&](Index f) { return at(fronts[at(f)].below()) * at(fronts[at(f)].below()); };
  const auto push = [&](Index f, std::size_t(&used)[2], std::size_t(&peak)[2]) {
    const int stack = fronts[at(f)].depth % 2;
    updates_[at(f)] = {used[stack], stack};
    used[stack] += square(f);
    peak[stack] = std::max(peak[stack], used[stack]);
  };
  const auto pop_children = [&](Index f, std::size_t(&used)[2]) {
    for (Index c = fronts[at(f)].last_child; c >= 0; c = fronts[at(c)].previous_sibling) {
      if (updates_[at(c)].stack < 2) used[updates_[at(c)].stack] -= square(c);
    }
  };
  for (const Task& task : tasks_) {
    std::size_t used[2] = {0, 0};
    for (Index f = task.first; f < task.root; ++f) {
      push(f, used, task_stack_);
      pop_children(f, used);
    }
    updates_[at(task.root)] = {kept_size_, 2};
    kept_size_ += square(task.root);
  }
  std::size_t used[2] = {0, 0};
  for (const Index f : top_) {
    push(f, used, top_stack_);
    pop_children(f, used);
  }
  for (Index f = 0; f < count; ++f) {
    const int block = block_size(fronts[at(f)].pivots), depth = round_up(block, kernels_.panel_rows);
    // The rows of a front are packed in two parts, pivots and the rest, each with its own padding.
    const std::size_t rows = at(fronts[at(f)].height) + 2 * at(kernels_.strip_rows);
    const int where = in_task[at(f)] ? 0 : 1;
    strip_size_[where] = std::max(strip_size_[where], rows * at(depth));
    panel_size_[where] = std::max(panel_size_[where], rows * at(depth));
  }
}

template <class T>
T* FrontFactor<T>::update_of(Index front, const Workspace& workspace) const {
  const Update& update = updates_[at(front)];
  return (update.stack == 2 ? kept_.data() : workspace.stack[update.stack].data()) + update.offset;
}

template <class T>
bool FrontFactor<T>::process(Index f, const double* values, bool definite, Workspace& workspace, const ThreadTeam& team,
                             int& pivots_done) {
  const FrontTree::Front& front = tree_->fronts[at(f)];
  const int k = front.pivots, m = front.height, below = front.below();
  T* const panel = values_.data() + front.panel;
  T* const update = update_of(f, workspace);
  T* const inverse_pivots = inverse_pivots_.data() + front.first;
  T* const floor = floor_.data() + front.first;
  const auto mine = [&](int column) { return team.count == 1 || column / kColumnChunk % team.count == team.id; };

  // Adds the children's updates to the pivots' columns, or to the columns below.
  const auto add_children = [&](bool to_pivots) {
    for (Index child = front.last_child; child >= 0; child = tree_->fronts[at(child)].previous_sibling) {
      const FrontTree::Front& from = tree_->fronts[at(child)];
      const T* const source = update_of(child, workspace);
      const std::ptrdiff_t source_stride = from.below();
      const FrontTree::Run* const runs = tree_->runs.data();
      for (std::size_t r = from.first_run; r < from.last_run; ++r) {
        if ((runs[r].to < k) != to_pivots) continue;
        for (int i = 0; i < runs[r].length; ++i) {
          const int column = runs[r].to + i;
          if (!mine(column)) continue;
          const T* const read = source + (runs[r].from + i) * source_stride;
          T* const write = to_pivots ? panel + static_cast<std::ptrdiff_t>(column) * m
                                     : update + static_cast<std::ptrdiff_t>(column - k) * below - k;
          for (int row = i; row < runs[r].length; ++row) write[runs[r].to + row] += read[runs[r].from + row];
          for (std::size_t s = r + 1; s < from.last_run; ++s) {
            const FrontTree::Run run = runs[s];
            for (int row = 0; row < run.length; ++row) write[run.to + row] += read[run.from + row];
          }
        }
      }
    }
  };

  for (int column = 0; column < k; ++column) {
    if (mine(column)) std::fill_n(panel + static_cast<std::ptrdiff_t>(column) * m, m, T(0));
  }
  team.meet();
  if (team.id == 0) {
    for (std::size_t e = front.first_entry; e < front.last_entry; ++e) {
      panel[tree_->entries[e].target] += static_cast<T>(values[tree_->entries[e].source]);
    }
    // A pivot below this has no digit left: the matrix is singular to working precision.
    constexpr T digits = 8 * std::numeric_limits<T>::epsilon();
    for (int i = 0; i < k; ++i) floor[i] = std::abs(panel[i + static_cast<std::ptrdiff_t>(i) * m]) * digits;
  }
  team.meet();
  add_children(true);
  team.meet();

  const int strip_rows = kernels_.strip_rows, panel_rows = kernels_.panel_rows;
  const int block = block_size(k);
  for (int j0 = 0; j0 < k; j0 += block) {
    const int count = std::min(block, k - j0), depth = round_up(count, panel_rows);
    T* const corner = panel + j0 + static_cast<std::ptrdiff_t>(j0) * m;
    if (team.id == 0) {
      pivots_done = kernels_.factor_diagonal(corner, m, count, depth, definite, floor + j0, inverse_pivots + j0,
                                             workspace.diagonal_panels.data(), workspace.diagonal_strip.data());
    }
    team.meet();
    if (pivots_done < count) return false;

    // Rows below the block: pivots still to come, then the rows of the update; each part starts a strip of its own.
    const int pivots_left = k - j0 - count;
    const int pivot_strips = (pivots_left + strip_rows - 1) / strip_rows, low_strips = (below + strip_rows - 1) / strip_rows;
    T* const strips = workspace.strips.data();
    T* const panels = workspace.panels.data();
    const std::ptrdiff_t low = static_cast<std::ptrdiff_t>(pivot_strips) * strip_rows * depth;
    for (int s = team.id; s < pivot_strips + low_strips; s += team.count) {
      const bool is_low = s >= pivot_strips;
      const int row = (is_low ? s - pivot_strips : s) * strip_rows;
      const int rows = std::min(strip_rows, (is_low ? below : pivots_left) - row);
      const std::ptrdiff_t packed = static_cast<std::ptrdiff_t>(s) * strip_rows * depth;
      kernels_.solve_strip(corner + count + (is_low ? pivots_left : 0) + row, m, rows, count, depth, inverse_pivots + j0,
                           workspace.diagonal_panels.data(), strips + packed, panels + packed);
    }
    team.meet();

    // A block of strips stays in the second cache level while panels pass by.
    const int strips_at_once = std::max(1, 40000 / (strip_rows * depth));
    const int chunk = kColumnChunk / panel_rows;
    const auto update_part = [&](const T* rows_packed, const T* columns_packed, int rows, int columns, T* target,
                                 std::ptrdiff_t stride, bool overwrite, bool lower) {
      const int strip_count = (rows + strip_rows - 1) / strip_rows, panel_count = (columns + panel_rows - 1) / panel_rows;
      for (int s = 0; s < strip_count; s += strips_at_once) {
        const int last = std::min(strip_count, s + strips_at_once);
        for (int p = team.id * chunk; p < panel_count; p += team.count * chunk) {
          if (lower && p * panel_rows >= last * strip_rows) break;
          const int last_panel =
              std::min({panel_count, p + chunk, lower ? (last * strip_rows + panel_rows - 1) / panel_rows : panel_count});
          kernels_.update(rows_packed, columns_packed, depth, s, last, p, last_panel, target, stride, rows, columns,
                          overwrite, lower);
        }
      }
    };
    T* const next = corner + count + count * static_cast<std::ptrdiff_t>(m);
    if (pivots_left > 0) {
      update_part(strips, panels, pivots_left, pivots_left, next, m, false, true);
      if (below > 0) update_part(strips + low, panels, below, pivots_left, next + pivots_left, m, false, false);
    }
    if (below > 0) update_part(strips + low, panels + low, below, below, update, below, j0 == 0, true);
    team.meet();
  }
  add_children(false);
  team.meet();
  return true;
}

template <class T>
bool FrontFactor<T>::factorise(const double* values, bool definite) {
  std::atomic<std::size_t> next_task{0};
  std::atomic<bool> refused{false};
  int pivots_of_top = 0;
  run_team(threads_, [&](const ThreadTeam& team) {
    int pivots_of_task = 0;
    Workspace& workspace = *workspaces_[static_cast<std::size_t>(team.id)];
    while (!refused) {
      const std::size_t task = next_task++;
      if (task >= tasks_.size()) break;
      for (Index f = tasks_[task].first; f <= tasks_[task].root && !refused; ++f) {
        if (!process(f, values, definite, workspace, ThreadTeam{}, pivots_of_task)) refused = true;
      }
    }
    team.meet();
    if (refused) return;
    for (const Index f : top_) {
      if (!process(f, values, definite, *workspaces_[0], team, pivots_of_top)) {
        refused = true;  // every member sees the same pivot refused
        return;
      }
    }
  });
  if (refused) return false;
  negative_ = static_cast<int>(
      std::count_if(inverse_pivots_.data(), inverse_pivots_.data() + tree_->size, [](T pivot) { return pivot < 0; }));
  return true;
}

template <class T>
void FrontFactor<T>::sweep(double* columns, Eigen::Index stride, int used, int width, T* x, T* work) const {
  const auto& fronts = tree_->fronts;
  const auto forward = width == 1 ? kernels_.forward_one : kernels_.forward_many;
  const auto backward = width == 1 ? kernels_.backward_one : kernels_.backward_many;
  const std::size_t row_size = at(width);
  for (Index i = 0; i < tree_->size; ++i) {
    T* const row = x + at(tree_->position[at(i)]) * row_size;
    for (int c = 0; c < used; ++c) row[c] = static_cast<T>(columns[c * stride + i]);
    for (int c = used; c < width; ++c) row[c] = 0;
  }
  for (const auto& front : fronts) {
    T* const own = x + at(front.first) * row_size;
    const std::size_t k = at(front.pivots) * row_size;
    const Index* const rows = tree_->rows.data() + front.rows;
    std::copy_n(own, k, work);
    std::fill_n(work + k, at(front.below()) * row_size, T(0));
    forward(values_.data() + front.panel, front.pivots, front.height, work);
    std::copy_n(work, k, own);
    for (Index i = 0; i < front.below(); ++i) {
      T* const to = x + at(rows[i]) * row_size;
      const T* const from = work + k + at(i) * row_size;
      for (int c = 0; c < width; ++c) to[c] += from[c];
    }
  }
  for (auto front = fronts.rbegin(); front != fronts.rend(); ++front) {
    T* const own = x + at(front->first) * row_size;
    const std::size_t k = at(front->pivots) * row_size;
    const Index* const rows = tree_->rows.data() + front->rows;
    std::copy_n(own, k, work);
    for (Index i = 0; i < front->below(); ++i)
      std::copy_n(x + at(rows[i]) * row_size, row_size, work + k + at(i) * row_size);
    backward(values_.data() + front->panel, front->pivots, front->height, inverse_pivots_.data() + front->first, work);
    std::copy_n(work, k, own);
  }
  for (Index i = 0; i < tree_->size; ++i) {
    const T* const row = x + at(tree_->position[at(i)]) * row_size;
    for (int c = 0; c < used; ++c) columns[c * stride + i] = static_cast<double>(row[c]);
  }
}

template <class T>
void FrontFactor<T>::solve(double* columns, Eigen::Index count, Eigen::Index stride) const {
  // Two alone are cheaper than a bundle: a bundle takes about three times as long as one.
  const Eigen::Index width = count > 2 ? kernels_.solve_width : 1;
  const Eigen::Index bundles = (count + width - 1) / width;
  const double flops = 4.0 * static_cast<double>(tree_->panel_values) * static_cast<double>(count);
  const int threads = flops < kFlopsWorthThreads ? 1 : static_cast<int>(std::min<Eigen::Index>(threads_, bundles));
  Index tallest = 0;
  for (const auto& front : tree_->fronts) tallest = std::max(tallest, front.height);
  run_team(threads, [&](const ThreadTeam& team) {
    const LargeArray<T> x(at(tree_->size) * static_cast<std::size_t>(width)),
        work(at(tallest) * static_cast<std::size_t>(width));
    for (Eigen::Index bundle = team.id; bundle < bundles; bundle += team.count) {
      const Eigen::Index first = bundle * width;
      sweep(columns + first * stride, stride, static_cast<int>(std::min(width, count - first)), static_cast<int>(width),
            x.data(), work.data());
    }
  });
}

template <class T>
std::size_t FrontFactor<T>::bytes() const {
  std::size_t values = tree_->panel_values + 2 * at(tree_->size) + kept_size_;
  for (int thread = 0; thread < threads_; ++thread) {
    for (const int s : {0, 1}) values += std::max(task_stack_[s], thread == 0 ? top_stack_[s] : 0);
    values += std::max(strip_size_[0] + panel_size_[0], thread == 0 ? strip_size_[1] + panel_size_[1] : 0);
  }
  return values * sizeof(T);
}

template class FrontFactor<double>;
template class FrontFactor<float>;

}  // namespace palpate::fem
