// SPDX-License-Identifier: Apache-2.0
// Included by dense_kernels.cpp once for every instruction set, inside a namespace of its own. No include guard on purpose.
// PALPATE_TARGET: function attribute that switches the instruction set on; kVectorBytes: width of its vectors;
// kStripVectors<T>, kPanelRows: the register tile. Every function carries the attribute: a vector that crosses into a
// function without it would be split into narrow ones.

template <class T>
struct Simd {
  typedef T Vector __attribute__((vector_size(kVectorBytes)));
  typedef T Unaligned __attribute__((vector_size(kVectorBytes), aligned(alignof(T)), may_alias));
  static constexpr int lanes = kVectorBytes / static_cast<int>(sizeof(T));
  static constexpr int strip = kStripVectors * lanes;
  static constexpr int width = 2 * lanes;  // right-hand sides together
  static_assert(strip % kPanelRows == 0);
};

/// acc -= X(:, 0:count) * panel(0:count, :)', the heart of everything.
template <class T>
PALPATE_TARGET inline __attribute__((always_inline)) void subtract_product(
    const T* __restrict x, const T* __restrict panel, int count,
    typename Simd<T>::Vector (&acc)[kPanelRows][kStripVectors]) {
  using Vector = typename Simd<T>::Vector;
  for (int l = 0; l < count; ++l) {
    Vector rows[kStripVectors];
#pragma GCC unroll 8
    for (int v = 0; v < kStripVectors; ++v) rows[v] = *reinterpret_cast<const Vector*>(x + v * Simd<T>::lanes);
#pragma GCC unroll 16
    for (int c = 0; c < kPanelRows; ++c) {
#pragma GCC unroll 8
      for (int v = 0; v < kStripVectors; ++v) acc[c][v] -= rows[v] * panel[c];
    }
    x += Simd<T>::strip;
    panel += kPanelRows;
  }
}

/// Copies `rows` rows of `count` columns into a strip; padding becomes zero.
template <class T>
PALPATE_TARGET inline void load_strip(const T* a, std::ptrdiff_t stride, int rows, int count, int depth, T* strip) {
  for (int l = 0; l < count; ++l) {
    const T* const from = a + l * stride;
    T* const to = strip + l * Simd<T>::strip;
    if (rows == Simd<T>::strip) {
      for (int r = 0; r < Simd<T>::strip; ++r) to[r] = from[r];
    } else {
      for (int r = 0; r < rows; ++r) to[r] = from[r];
      for (int r = rows; r < Simd<T>::strip; ++r) to[r] = 0;
    }
  }
  for (int i = count * Simd<T>::strip; i < depth * Simd<T>::strip; ++i) strip[i] = 0;
}

/// strip := strip * inv(L11)' for its first `count` columns.
template <class T>
PALPATE_TARGET inline void solve_columns(T* strip, const T* diagonal_panels, int count, int depth) {
  using Vector = typename Simd<T>::Vector;
  constexpr int lanes = Simd<T>::lanes;
  for (int j = 0; j < count; j += kPanelRows) {
    const T* const panel = diagonal_panels + static_cast<std::ptrdiff_t>(j) * depth;
    T* const x = strip + static_cast<std::ptrdiff_t>(j) * Simd<T>::strip;
    Vector acc[kPanelRows][kStripVectors];
#pragma GCC unroll 16
    for (int c = 0; c < kPanelRows; ++c) {
#pragma GCC unroll 8
      for (int v = 0; v < kStripVectors; ++v)
        acc[c][v] = *reinterpret_cast<const Vector*>(x + c * Simd<T>::strip + v * lanes);
    }
    subtract_product<T>(strip, panel, j, acc);
    const T* const triangle = panel + j * kPanelRows;
#pragma GCC unroll 16
    for (int c = 0; c < kPanelRows; ++c) {
#pragma GCC unroll 16
      for (int d = c + 1; d < kPanelRows; ++d) {
#pragma GCC unroll 8
        for (int v = 0; v < kStripVectors; ++v) acc[d][v] -= acc[c][v] * triangle[c * kPanelRows + d];
      }
    }
#pragma GCC unroll 16
    for (int c = 0; c < kPanelRows; ++c) {
#pragma GCC unroll 8
      for (int v = 0; v < kStripVectors; ++v) *reinterpret_cast<Vector*>(x + c * Simd<T>::strip + v * lanes) = acc[c][v];
    }
  }
}

/// Writes L = X / D of columns [0, count) back to A and into panels.
template <class T>
PALPATE_TARGET inline void store_rows(const T* strip, const T* inverse_pivots, int rows, int count, int depth, T* a,
                                      std::ptrdiff_t stride, T* panels) {
  for (int l = 0; l < count; ++l) {
    const T inverse = inverse_pivots[l];
    const T* const x = strip + l * Simd<T>::strip;
    T* const to = a + l * stride;
    alignas(64) T row[Simd<T>::strip];
    for (int r = 0; r < Simd<T>::strip; ++r) row[r] = x[r] * inverse;
    if (rows == Simd<T>::strip) {
      for (int r = 0; r < Simd<T>::strip; ++r) to[r] = row[r];
    } else {
      for (int r = 0; r < rows; ++r) to[r] = row[r];
    }
    for (int p = 0; p < Simd<T>::strip; p += kPanelRows) {
      T* const panel = panels + static_cast<std::ptrdiff_t>(p) * depth + l * kPanelRows;
      for (int r = 0; r < kPanelRows; ++r) panel[r] = row[p + r];
    }
  }
}

template <class T>
PALPATE_TARGET int factor_diagonal(T* a, std::ptrdiff_t stride, int count, int depth, bool definite, const T* floor,
                                   T* inverse_pivots, T* panels, T* strip) {
  using Vector = typename Simd<T>::Vector;
  constexpr int lanes = Simd<T>::lanes, strip_rows = Simd<T>::strip;
  const int padded = (count + strip_rows - 1) / strip_rows * strip_rows;
  for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(padded) * depth; ++i) panels[i] = 0;
  for (int r0 = 0; r0 < count; r0 += strip_rows) {
    const int rows = count - r0 < strip_rows ? count - r0 : strip_rows;
    T* const mine = panels + static_cast<std::ptrdiff_t>(r0) * depth;
    load_strip<T>(a + r0, stride, rows, r0 + rows, depth, strip);
    solve_columns<T>(strip, panels, r0, depth);
    store_rows<T>(strip, inverse_pivots, rows, r0, depth, a + r0, stride, mine);
    T* const tile = strip + static_cast<std::ptrdiff_t>(r0) * strip_rows;
    for (int p = 0; p < rows; p += kPanelRows) {
      Vector acc[kPanelRows][kStripVectors];
      T* const x = tile + p * strip_rows;
#pragma GCC unroll 16
      for (int c = 0; c < kPanelRows; ++c) {
#pragma GCC unroll 8
        for (int v = 0; v < kStripVectors; ++v) acc[c][v] = *reinterpret_cast<const Vector*>(x + c * strip_rows + v * lanes);
      }
      subtract_product<T>(strip, mine + static_cast<std::ptrdiff_t>(p) * depth, r0, acc);
#pragma GCC unroll 16
      for (int c = 0; c < kPanelRows; ++c) {
#pragma GCC unroll 8
        for (int v = 0; v < kStripVectors; ++v) *reinterpret_cast<Vector*>(x + c * strip_rows + v * lanes) = acc[c][v];
      }
    }
    for (int c = 0; c < rows; ++c) {
      const T* const column = tile + c * strip_rows;
      const T pivot = column[c];
      const bool good = definite ? pivot > floor[r0 + c] : pivot != 0;
      if (!good || !(pivot - pivot == 0)) return r0 + c;
      const T inverse = 1 / pivot;
      inverse_pivots[r0 + c] = inverse;
      for (int d = c + 1; d < rows; ++d) {
        const T factor = column[d] * inverse;
        mine[static_cast<std::ptrdiff_t>(d / kPanelRows * kPanelRows) * depth + (r0 + c) * kPanelRows + d % kPanelRows] =
            factor;
        a[r0 + d + (r0 + c) * stride] = factor;
        T* const other = tile + d * strip_rows;
#pragma GCC unroll 8
        for (int v = 0; v < kStripVectors; ++v) {
          *reinterpret_cast<Vector*>(other + v * lanes) -= *reinterpret_cast<const Vector*>(column + v * lanes) * factor;
        }
      }
      a[r0 + c + (r0 + c) * stride] = pivot;
    }
  }
  return count;
}

template <class T>
PALPATE_TARGET void solve_strip(T* a, std::ptrdiff_t stride, int rows, int count, int depth, const T* inverse_pivots,
                                const T* diagonal_panels, T* strip, T* panels) {
  load_strip<T>(a, stride, rows, count, depth, strip);
  solve_columns<T>(strip, diagonal_panels, count, depth);
  store_rows<T>(strip, inverse_pivots, rows, count, depth, a, stride, panels);
  for (int p = 0; p < Simd<T>::strip; p += kPanelRows) {
    T* const panel = panels + static_cast<std::ptrdiff_t>(p) * depth;
    for (int i = count * kPanelRows; i < depth * kPanelRows; ++i) panel[i] = 0;
  }
}

template <class T>
PALPATE_TARGET void update(const T* strips, const T* panels, int depth, int first_strip, int last_strip, int first_panel,
                           int last_panel, T* c, std::ptrdiff_t stride, int rows, int columns, bool overwrite, bool lower) {
  using Vector = typename Simd<T>::Vector;
  using Unaligned = typename Simd<T>::Unaligned;
  constexpr int lanes = Simd<T>::lanes, strip_rows = Simd<T>::strip;
  for (int p = first_panel; p < last_panel; ++p) {
    const int column = p * kPanelRows;
    const T* const panel = panels + static_cast<std::ptrdiff_t>(column) * depth;
    int s = first_strip;
    if (lower && column / strip_rows > s) s = column / strip_rows;
    for (; s < last_strip; ++s) {
      const int row = s * strip_rows;
      T* const tile = c + row + column * stride;
      const bool whole = row + strip_rows <= rows && column + kPanelRows <= columns;
      if (whole && !overwrite) {
#pragma GCC unroll 16
        for (int j = 0; j < kPanelRows; ++j) {
          for (int b = 0; b < kStripVectors * kVectorBytes; b += 64) {
            __builtin_prefetch(reinterpret_cast<const char*>(tile + j * stride) + b, 1);
          }
        }
      }
      Vector acc[kPanelRows][kStripVectors] = {};
      subtract_product<T>(strips + static_cast<std::ptrdiff_t>(row) * depth, panel, depth, acc);
      if (whole) {
#pragma GCC unroll 16
        for (int j = 0; j < kPanelRows; ++j) {
#pragma GCC unroll 8
          for (int v = 0; v < kStripVectors; ++v) {
            Unaligned* const to = reinterpret_cast<Unaligned*>(tile + j * stride + v * lanes);
            *to = overwrite ? acc[j][v] : *to + acc[j][v];
          }
        }
      } else {
        alignas(64) T corner[kPanelRows * Simd<T>::strip];
#pragma GCC unroll 16
        for (int j = 0; j < kPanelRows; ++j) {
#pragma GCC unroll 8
          for (int v = 0; v < kStripVectors; ++v)
            *reinterpret_cast<Vector*>(corner + j * strip_rows + v * lanes) = acc[j][v];
        }
        const int tall = rows - row < strip_rows ? rows - row : strip_rows;
        const int wide = columns - column < kPanelRows ? columns - column : kPanelRows;
        for (int j = 0; j < wide; ++j) {
          for (int i = 0; i < tall; ++i) {
            T& to = tile[i + j * stride];
            to = overwrite ? corner[j * strip_rows + i] : to + corner[j * strip_rows + i];
          }
        }
      }
    }
  }
}

template <class T>
PALPATE_TARGET void forward_one(const T* panel, int pivots, int height, T* work) {
  const std::ptrdiff_t m = height;
  int j = 0;
  for (; j + 4 <= pivots; j += 4) {
    const T *const a = panel + j * m, *const b = a + m, *const c = b + m, *const d = c + m;
    const T y0 = work[j];
    const T y1 = work[j + 1] -= a[j + 1] * y0;
    const T y2 = work[j + 2] -= a[j + 2] * y0 + b[j + 2] * y1;
    const T y3 = work[j + 3] -= a[j + 3] * y0 + b[j + 3] * y1 + c[j + 3] * y2;
    for (int i = j + 4; i < height; ++i) work[i] -= a[i] * y0 + b[i] * y1 + c[i] * y2 + d[i] * y3;
  }
  for (; j < pivots; ++j) {
    const T* const a = panel + j * m;
    const T y = work[j];
    for (int i = j + 1; i < height; ++i) work[i] -= a[i] * y;
  }
}

template <class T>
PALPATE_TARGET void backward_one(const T* panel, int pivots, int height, const T* inverse_pivots, T* work) {
  using Vector = typename Simd<T>::Vector;
  using Unaligned = typename Simd<T>::Unaligned;
  constexpr int lanes = Simd<T>::lanes;
  const std::ptrdiff_t m = height;
  for (int j = 0; j < pivots; ++j) work[j] *= inverse_pivots[j];
  int j = pivots;
  for (; j >= 4; j -= 4) {
    const T* const column[4] = {panel + (j - 4) * m, panel + (j - 3) * m, panel + (j - 2) * m, panel + (j - 1) * m};
    Vector sums[4] = {};
    int i = j;
    for (; i + lanes <= height; i += lanes) {
      const Vector x = *reinterpret_cast<const Unaligned*>(work + i);
#pragma GCC unroll 4
      for (int c = 0; c < 4; ++c) sums[c] += *reinterpret_cast<const Unaligned*>(column[c] + i) * x;
    }
    T sum[4] = {};
    for (int c = 0; c < 4; ++c) {
      for (int l = 0; l < lanes; ++l) sum[c] += sums[c][l];
      for (int r = i; r < height; ++r) sum[c] += column[c][r] * work[r];
    }
    const T x3 = work[j - 1] -= sum[3];
    const T x2 = work[j - 2] -= sum[2] + column[2][j - 1] * x3;
    const T x1 = work[j - 3] -= sum[1] + column[1][j - 1] * x3 + column[1][j - 2] * x2;
    work[j - 4] -= sum[0] + column[0][j - 1] * x3 + column[0][j - 2] * x2 + column[0][j - 3] * x1;
  }
  for (--j; j >= 0; --j) {
    const T* const a = panel + j * m;
    T sum = 0;
    for (int i = j + 1; i < height; ++i) sum += a[i] * work[i];
    work[j] -= sum;
  }
}

constexpr int kSolveBlock = 32;  // pivots whose triangle is solved before the rows below see them
constexpr int kSolveRows = 4;    // rows of the register tile

template <class T>
PALPATE_TARGET void forward_many(const T* panel, int pivots, int height, T* work) {
  using Vector = typename Simd<T>::Vector;
  const std::ptrdiff_t m = height;
  Vector* const w = reinterpret_cast<Vector*>(work);  // two vectors a row
  for (int j0 = 0; j0 < pivots; j0 += kSolveBlock) {
    const int j1 = j0 + kSolveBlock < pivots ? j0 + kSolveBlock : pivots;
    for (int j = j0; j < j1; ++j) {
      const T* const a = panel + j * m;
      const Vector y0 = w[2 * j], y1 = w[2 * j + 1];
      for (int i = j + 1; i < j1; ++i) {
        w[2 * i] -= a[i] * y0;
        w[2 * i + 1] -= a[i] * y1;
      }
    }
    int i = j1;
    for (; i + kSolveRows <= height; i += kSolveRows) {
      Vector acc[kSolveRows][2];
#pragma GCC unroll 8
      for (int r = 0; r < kSolveRows; ++r) acc[r][0] = w[2 * (i + r)], acc[r][1] = w[2 * (i + r) + 1];
      for (int j = j0; j < j1; ++j) {
        const T* const a = panel + i + j * m;
        const Vector y0 = w[2 * j], y1 = w[2 * j + 1];
#pragma GCC unroll 8
        for (int r = 0; r < kSolveRows; ++r) acc[r][0] -= a[r] * y0, acc[r][1] -= a[r] * y1;
      }
#pragma GCC unroll 8
      for (int r = 0; r < kSolveRows; ++r) w[2 * (i + r)] = acc[r][0], w[2 * (i + r) + 1] = acc[r][1];
    }
    for (; i < height; ++i) {
      Vector s0 = w[2 * i], s1 = w[2 * i + 1];
      for (int j = j0; j < j1; ++j) {
        const T a = panel[i + j * m];
        s0 -= a * w[2 * j];
        s1 -= a * w[2 * j + 1];
      }
      w[2 * i] = s0;
      w[2 * i + 1] = s1;
    }
  }
}

template <class T>
PALPATE_TARGET void backward_many(const T* panel, int pivots, int height, const T* inverse_pivots, T* work) {
  using Vector = typename Simd<T>::Vector;
  const std::ptrdiff_t m = height;
  Vector* const w = reinterpret_cast<Vector*>(work);
  for (int j = 0; j < pivots; ++j) {
    w[2 * j] *= inverse_pivots[j];
    w[2 * j + 1] *= inverse_pivots[j];
  }
  int j = pivots;
  for (; j >= 4; j -= 4) {
    const T* const column[4] = {panel + (j - 4) * m, panel + (j - 3) * m, panel + (j - 2) * m, panel + (j - 1) * m};
    Vector acc[4][2];
#pragma GCC unroll 4
    for (int c = 0; c < 4; ++c) acc[c][0] = w[2 * (j - 4 + c)], acc[c][1] = w[2 * (j - 4 + c) + 1];
    for (int i = j; i < height; ++i) {
      const Vector x0 = w[2 * i], x1 = w[2 * i + 1];
#pragma GCC unroll 4
      for (int c = 0; c < 4; ++c) acc[c][0] -= column[c][i] * x0, acc[c][1] -= column[c][i] * x1;
    }
#pragma GCC unroll 4
    for (int c = 3; c >= 0; --c) {
#pragma GCC unroll 4
      for (int d = 3; d > c; --d) {
        acc[c][0] -= column[c][j - 4 + d] * acc[d][0];
        acc[c][1] -= column[c][j - 4 + d] * acc[d][1];
      }
      w[2 * (j - 4 + c)] = acc[c][0];
      w[2 * (j - 4 + c) + 1] = acc[c][1];
    }
  }
  for (--j; j >= 0; --j) {
    const T* const a = panel + j * m;
    Vector s0 = w[2 * j], s1 = w[2 * j + 1];
    for (int i = j + 1; i < height; ++i) {
      s0 -= a[i] * w[2 * i];
      s1 -= a[i] * w[2 * i + 1];
    }
    w[2 * j] = s0;
    w[2 * j + 1] = s1;
  }
}

template <class T>
const DenseKernels<T>& kernels() {
  static const DenseKernels<T> table = {
      kName,      Simd<T>::strip,  kPanelRows,       Simd<T>::width,   &factor_diagonal<T>, &solve_strip<T>,
      &update<T>, &forward_one<T>, &backward_one<T>, &forward_many<T>, &backward_many<T>};
  return table;
}
