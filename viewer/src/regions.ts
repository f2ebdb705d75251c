// SPDX-License-Identifier: Apache-2.0
// Highest-density regions of a density on a grid, as closed outlines.

/** Width of each grid point's cell on an axis (half way to its neighbours). */
function cellWidths(axis: number[]): number[] {
  return axis.map((v, i) => ((axis[i + 1] ?? v) - (axis[i - 1] ?? v)) / 2);
}

/** The density above which the given share of the probability lies. `u` and `v` are the axes that it is a density over. */
export function threshold(density: number[][], u: number[], v: number[], share: number): number {
  const du = cellWidths(u);
  const dv = cellWidths(v);
  const cells = density.flatMap((row, i) => row.map((d, j) => ({ d, mass: d * Math.abs(du[i] * dv[j]) })));
  cells.sort((a, b) => b.d - a.d);
  const total = cells.reduce((sum, cell) => sum + cell.mass, 0);
  let sum = 0;
  for (const cell of cells) {
    sum += cell.mass;
    if (sum >= share * total) return cell.d;
  }
  return 0;
}

/** Marginal density over `u`, largest value one. */
export function marginal(density: number[][], v: number[], overRows: boolean): number[] {
  const dv = cellWidths(v);
  const sums = overRows
    ? density.map((row) => row.reduce((sum, d, j) => sum + d * Math.abs(dv[j]), 0))
    : density[0].map((_, j) => density.reduce((sum, row, i) => sum + row[j] * Math.abs(dv[i]), 0));
  const peak = Math.max(...sums);
  return sums.map((s) => s / peak);
}

type Point = [number, number];

/**
 * Outlines of {density > level} (marching squares, linear between grid points). The grid gets a frame of zeros, so that every
 * outline closes and can be filled. Points come in grid coordinates (row, column) and are clamped to the grid.
 */
export function outlines(density: number[][], level: number): Point[][] {
  const rows = density.length;
  const columns = density[0].length;
  const at = (i: number, j: number): number => density[i]?.[j] ?? 0;
  const next = new Map<string, { key: string; from: Point }>();

  const crossing = (i0: number, j0: number, i1: number, j1: number): Point => {
    const [a, b] = [at(i0, j0), at(i1, j1)];
    const t = (level - a) / (b - a);
    return [i0 + t * (i1 - i0), j0 + t * (j1 - j0)];
  };
  const edgeKey = (i0: number, j0: number, i1: number, j1: number): string =>
    i0 < i1 || j0 < j1 ? `${i0},${j0},${i1},${j1}` : `${i1},${j1},${i0},${j0}`;

  for (let i = -1; i < rows; ++i) {
    for (let j = -1; j < columns; ++j) {
      // Corners in order around the cell; going round, a crossing either enters or leaves the region.
      const corners: Point[] = [[i, j], [i, j + 1], [i + 1, j + 1], [i + 1, j]];
      const entering: { key: string; point: Point }[] = [];
      const leaving: { key: string; point: Point }[] = [];
      let leavingFirst = false;
      for (let k = 0; k < 4; ++k) {
        const [a, b] = [corners[k], corners[(k + 1) % 4]];
        const [inA, inB] = [at(...a) > level, at(...b) > level];
        if (inA === inB) continue;
        const crossed = { key: edgeKey(...a, ...b), point: crossing(...a, ...b) };
        if (entering.length === 0 && !inB) leavingFirst = true;
        (inB ? entering : leaving).push(crossed);
      }
      // Each entrance goes to the exit that follows it: at a saddle (two of each) this keeps the corners apart.
      const shift = leavingFirst ? 1 : 0;
      entering.forEach((start, n) => next.set(start.key, { key: leaving[(n + shift) % leaving.length].key, from: start.point }));
    }
  }
  const loops: Point[][] = [];
  while (next.size > 0) {
    let key = next.keys().next().value as string;
    const loop: Point[] = [];
    for (let link = next.get(key); link; link = next.get(key)) {
      loop.push([
        Math.min(Math.max(link.from[0], 0), rows - 1),
        Math.min(Math.max(link.from[1], 0), columns - 1),
      ]);
      next.delete(key);
      key = link.key;
    }
    if (loop.length > 2) loops.push(loop);
  }
  return loops;
}

/** Value at a fractional place of an axis. */
export function along(axis: number[], place: number): number {
  const i = Math.min(Math.floor(place), axis.length - 2);
  return i < 0 ? axis[0] : axis[i] + (axis[i + 1] - axis[i]) * (place - i);
}
