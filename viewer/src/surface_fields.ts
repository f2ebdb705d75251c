// SPDX-License-Identifier: Apache-2.0
// Fields on the drawn surface that follow from what the page carries: displacement, stretch, residuals painted on vertices.
import type { Report, Step } from "./data";

export type Mode = "displacement" | "residual" | "mean_residual" | "strain" | "stress";

export interface Field {
  values: Float32Array; // per vertex, NaN = not seen
  scale: number; // colours reach from 0 (or -scale) to scale
  signed: boolean;
  unit: string;
  title: string;
}

export function displacement(report: Report, step: Step): Float32Array {
  const out = new Float32Array(report.rest.length / 3);
  if (!step.surface) return out;
  for (let i = 0; i < out.length; ++i) {
    const k = 3 * i;
    out[i] = Math.hypot(
      step.surface[k] - report.rest[k],
      step.surface[k + 1] - report.rest[k + 1],
      step.surface[k + 2] - report.rest[k + 2],
    );
  }
  return out;
}

/** Largest principal in-plane Green-Lagrange strain (by size) of the triangles around each vertex, area-weighted. */
export function strain(report: Report, step: Step): Float32Array {
  const n = report.rest.length / 3;
  const sum = new Float64Array(n);
  const weight = new Float64Array(n);
  if (!step.surface) return new Float32Array(n);
  const edge = (p: Float32Array, a: number, b: number): number[] => [0, 1, 2].map((k) => p[3 * b + k] - p[3 * a + k]);
  const dot = (a: number[], b: number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  for (let t = 0; t < report.triangles.length; t += 3) {
    const [a, b, c] = [report.triangles[t], report.triangles[t + 1], report.triangles[t + 2]];
    const [E1, E2] = [edge(report.rest, a, b), edge(report.rest, a, c)];
    const [e1, e2] = [edge(step.surface, a, b), edge(step.surface, a, c)];
    // Metric of rest G and of the deformed triangle g; the strains are half the eigenvalues of inv(G) g - 1.
    const [G11, G12, G22] = [dot(E1, E1), dot(E1, E2), dot(E2, E2)];
    const det = G11 * G22 - G12 * G12;
    if (!(det > 0)) continue;
    const [g11, g12, g22] = [dot(e1, e1), dot(e1, e2), dot(e2, e2)];
    const trace = (G22 * g11 - 2 * G12 * g12 + G11 * g22) / det;
    const determinant = (g11 * g22 - g12 * g12) / det;
    const root = Math.sqrt(Math.max((trace * trace) / 4 - determinant, 0));
    const [high, low] = [(trace / 2 + root - 1) / 2, (trace / 2 - root - 1) / 2];
    const value = Math.abs(high) > Math.abs(low) ? high : low;
    const area = Math.sqrt(det) / 2;
    for (const v of [a, b, c]) {
      sum[v] += value * area;
      weight[v] += area;
    }
  }
  return Float32Array.from(sum, (s, i) => (weight[i] > 0 ? s / weight[i] : 0));
}

/** Mean residual of the points nearest to each vertex, spread to unseen neighbours once; NaN where nothing was seen. */
export function residualOnSurface(report: Report, steps: Step[]): Float32Array {
  const n = report.rest.length / 3;
  const sum = new Float64Array(n);
  const count = new Float64Array(n);
  for (const step of steps) {
    if (!step.surface || !step.points || !step.residual) continue;
    const nearest = nearestVertex(step.surface);
    for (let p = 0; p < step.residual.length; ++p) {
      const r = step.residual[p];
      if (Number.isNaN(r)) continue;
      const v = nearest(step.points[3 * p], step.points[3 * p + 1], step.points[3 * p + 2]);
      if (v < 0) continue;
      sum[v] += r;
      count[v] += 1;
    }
  }
  const wideSum = Float64Array.from(sum);
  const wideCount = Float64Array.from(count);
  for (let t = 0; t < report.triangles.length; t += 3) {
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [report.triangles[t + k], report.triangles[t + ((k + 1) % 3)]];
      wideSum[a] += sum[b];
      wideCount[a] += count[b];
      wideSum[b] += sum[a];
      wideCount[b] += count[a];
    }
  }
  return Float32Array.from(wideSum, (s, i) => (wideCount[i] > 0 ? s / wideCount[i] : NaN));
}

/** Nearest vertex within two cells of a grid, -1 when there is none: clouds lie near the surface or do not matter here. */
function nearestVertex(vertices: Float32Array): (x: number, y: number, z: number) => number {
  const n = vertices.length / 3;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < vertices.length; ++i) {
    low[i % 3] = Math.min(low[i % 3], vertices[i]);
    high[i % 3] = Math.max(high[i % 3], vertices[i]);
  }
  const size = Math.max(...high.map((h, k) => h - low[k])) / Math.max(4, Math.sqrt(n / 4)) || 1;
  const key = (i: number, j: number, k: number): number => (i * 4093 + j) * 4093 + k;
  const cell = (v: number, k: number): number => Math.floor((v - low[k]) / size) + 8;
  const grid = new Map<number, number[]>();
  for (let i = 0; i < n; ++i) {
    const place = key(cell(vertices[3 * i], 0), cell(vertices[3 * i + 1], 1), cell(vertices[3 * i + 2], 2));
    const list = grid.get(place);
    if (list) list.push(i);
    else grid.set(place, [i]);
  }
  return (x, y, z) => {
    let best = -1;
    let distance = Infinity;
    const [ci, cj, ck] = [cell(x, 0), cell(y, 1), cell(z, 2)];
    for (let i = ci - 1; i <= ci + 1; ++i) {
      for (let j = cj - 1; j <= cj + 1; ++j) {
        for (let k = ck - 1; k <= ck + 1; ++k) {
          for (const v of grid.get(key(i, j, k)) ?? []) {
            const d = (vertices[3 * v] - x) ** 2 + (vertices[3 * v + 1] - y) ** 2 + (vertices[3 * v + 2] - z) ** 2;
            if (d < distance) [best, distance] = [v, d];
          }
        }
      }
    }
    return best;
  };
}

/** One scale over all steps, so that colours mean the same while the slider moves. */
export class Fields {
  private readonly largestDisplacement: number;
  private largestStrain: number | null = null;
  private meanResidual: Float32Array | null = null;

  constructor(private readonly report: Report) {
    this.largestDisplacement = Math.max(1e-9, ...report.steps.map((s) => displacement(report, s).reduce((a, b) => Math.max(a, b), 0)));
  }

  field(mode: Mode, step: Step): Field {
    const report = this.report;
    switch (mode) {
      case "displacement":
        return { values: displacement(report, step), scale: this.largestDisplacement, signed: false, unit: "m", title: "displacement" };
      case "residual":
        return { values: residualOnSurface(report, [step]), scale: report.residual_scale_m, signed: true, unit: "m", title: "residual of this step" };
      case "mean_residual":
        this.meanResidual ??= residualOnSurface(report, report.steps);
        return { values: this.meanResidual, scale: report.residual_scale_m, signed: true, unit: "m", title: "mean residual of all steps" };
      case "strain":
        this.largestStrain ??= Math.max(1e-9, ...report.steps.map((s) => robustMaximum(strain(report, s))));
        return { values: strain(report, step), scale: this.largestStrain, signed: true, unit: "%", title: "largest surface strain" };
      case "stress":
        return { values: step.stress ?? new Float32Array(report.rest.length / 3), scale: report.stress_scale_pa, signed: false, unit: "Pa", title: "von Mises stress" };
    }
  }

  modes(): Mode[] {
    const report = this.report;
    const seen = report.residual_scale_m > 0;
    const stressed = report.stress_scale_pa > 0;
    return ["displacement", ...(seen ? (["residual", "mean_residual"] as Mode[]) : []), "strain", ...(stressed ? (["stress"] as Mode[]) : [])];
  }
}

function robustMaximum(values: Float32Array): number {
  const sizes = Float32Array.from(values, Math.abs).sort();
  return sizes.length ? sizes[Math.floor((sizes.length - 1) * 0.995)] : 0;
}
