// SPDX-License-Identifier: Apache-2.0
// Dense kernels of the multifrontal factorisation A = L D L' (unit lower L), written once for vectors of any width and
// compiled for AVX-512, AVX2 and the plain target; the widest that the processor has is chosen when the program runs.
//
// Packed operands (the layout of Goto & van de Geijn, "Anatomy of high-performance matrix multiplication", ACM TOMS 34,
// 2008): a strip holds `strip_rows` rows of X = L D, a panel `panel_rows` rows of L, both column after column, so that the
// inner kernel reads them in sequence. `depth` is the number of eliminated columns rounded up to panel_rows; padding is
// zero.
#pragma once

#include <cstddef>
#include <vector>

#include "palpate/core/math.hpp"

namespace palpate::fem {

template <class T>
struct DenseKernels {
  const char* name;
  int strip_rows;
  int panel_rows;   ///< divides strip_rows
  int solve_width;  ///< right-hand sides that solve together

  /// Factors the leading count x count block of `a` (column-major, stride `stride`): L below the diagonal, D on it. Fills
  /// `inverse_pivots` and the panels of L. With `definite` a pivot must exceed `floor` of its column.
  /// @return the number of pivots done (count: all; less: the next one was refused)
  int (*factor_diagonal)(T* a, std::ptrdiff_t stride, int count, int depth, bool definite, const T* floor, T* inverse_pivots,
                         T* panels, T* strip);

  /// Turns `rows` (at most strip_rows) rows of A into rows of L below a factored diagonal block and packs them.
  void (*solve_strip)(T* a, std::ptrdiff_t stride, int rows, int count, int depth, const T* inverse_pivots,
                      const T* diagonal_panels, T* strip, T* panels);

  /// C -= X L' (C = -X L' with `overwrite`) for strips [first_strip, last_strip) and panels [first_panel, last_panel); rows
  /// and columns of C beyond `rows` and `columns` are left alone. With `lower` tiles above the diagonal are skipped.
  void (*update)(const T* strips, const T* panels, int depth, int first_strip, int last_strip, int first_panel,
                 int last_panel, T* c, std::ptrdiff_t stride, int rows, int columns, bool overwrite, bool lower);

  /// One front's part of L y = b and of L' x = D^-1 y. `work` holds height x width numbers, row-major: the pivots' rows and
  /// then, forward, zeros that receive the update of the rows below (to be added to b); backward, x of the rows below.
  void (*forward_one)(const T* panel, int pivots, int height, T* work);
  void (*backward_one)(const T* panel, int pivots, int height, const T* inverse_pivots, T* work);
  void (*forward_many)(const T* panel, int pivots, int height, T* work);
  void (*backward_many)(const T* panel, int pivots, int height, const T* inverse_pivots, T* work);
};

/// The kernels for this processor. T is float or double.
template <class T>
const DenseKernels<T>& dense_kernels();

/// Every variant that this processor can run, for tests: the widest first.
template <class T>
std::vector<const DenseKernels<T>*> runnable_dense_kernels();

}  // namespace palpate::fem
