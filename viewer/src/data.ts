// SPDX-License-Identifier: Apache-2.0
// What palpate/report/payload.cpp writes, decoded once. Numbers that were NaN arrive as null.

export type Num = number | null;

export interface Parameter {
  name: string;
  title: string;
  region: string;
  unit: string;
  value: Num;
  std: Num;
  lower_95: Num;
  upper_95: Num;
  determined: boolean;
  text: string;
  interval_text: string;
}

export interface Nuisance {
  name: string;
  unit: string;
  value: Num;
  std: Num;
  lower_95: Num;
  upper_95: Num;
  prior_std: Num;
  pull: Num;
}

interface RawStep {
  push: string;
  step: number;
  used: boolean;
  force_n: Num[];
  contact_m: Num[];
  tool_radius_m: Num;
  travel_m: Num;
  travel_predicted_m: Num;
  travel_predicted_std_m: Num;
  force_measured_n: Num;
  force_predicted_n: Num;
  force_predicted_std_n: Num;
  rms_m: Num;
  points_total: number;
  surface?: string;
  stress?: string;
  points?: string;
  residual?: string;
  masked?: string;
}

export interface Step extends Omit<RawStep, "surface" | "stress" | "points" | "residual" | "masked"> {
  index: number;
  surface: Float32Array | null; // x y z of every drawn vertex, metres
  stress: Float32Array | null; // Pa
  points: Float32Array | null;
  residual: Float32Array | null; // metres, NaN where not used
  masked: Float32Array | null; // what the masks of robot and table took away
}

export interface Posterior {
  young_modulus_pa: number[];
  poisson_ratio: number[];
  density: number[][];
}

interface Raw {
  format: string;
  version: string;
  title: string;
  answer: string;
  method: string;
  material: string;
  parameters: Parameter[];
  per_push: Parameter[];
  per_site: Parameter[];
  per_load: Parameter[]; // their regions say how far the loads deform the object
  laws: { law: string; usable: boolean; message: string; young_text: string; force_error: Num; held_out_chi2: Num }[];
  nuisances: Nuisance[];
  verdicts: { code: string; message: string }[];
  fit: {
    rms_m: Num;
    chi2_per_dof: Num;
    points_used: number;
    pushes: number;
    steps: number;
    iterations: number;
    solves: number;
  };
  termination: string;
  converged: boolean;
  running: boolean; // the work goes on: nothing is final
  message: string;
  prediction: {
    available: boolean;
    what: string;
    force_error: Num;
    surface_rms_m: Num;
    baseline_no_deformation_rms_m: Num;
    baseline_last_step_rms_m: Num;
    fitted_rms_m: Num;
    deformation_explained: Num;
  };
  budget: BudgetEntry[];
  budget_if: BudgetEntry[]; // what is stated as exact, were it off
  provenance: Record<string, string>;
  timing_s: Record<string, Num>;
  trace: { young_modulus_pa: Num; poisson_ratio: Num; cost: Num; round: number }[];
  posterior: Posterior | null;
  scene: {
    source: string;
    rest_state: string;
    gravity_m_s2: Num[];
    tools: string[];
    supports: string[];
    warnings: string[];
  } | null;
  input_hashes: Record<string, string>;
  steps: RawStep[];
  thinned: string[];
  histogram: { from_m: number; to_m: number; counts: number[]; beyond: number; total: number } | null;
  box: { origin_m: number[]; size_m: number };
  residual_scale_m: number;
  stress_scale_pa: number;
  mesh: { vertices: number; triangles: string; rest: string };
}

export interface BudgetEntry {
  input: string;
  young_modulus_percent: Num;
  poisson_shift: Num;
  regions: { region: string; young_modulus_percent: Num }[]; // empty: one
  off_by: string; // budget_if: how far, and the field that would state it
  field: string;
}

export interface Report extends Omit<Raw, "steps" | "mesh"> {
  steps: Step[];
  rest: Float32Array;
  triangles: Uint32Array;
  pushes: { name: string; steps: Step[] }[];
}

function bytes(text: string): Uint8Array {
  const binary = atob(text);
  const array = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) array[i] = binary.charCodeAt(i);
  return array;
}

export function decode(text: string): Report {
  const raw = JSON.parse(text) as Raw;
  if (raw.format !== "palpate-report-1") throw new Error("unknown format of the page's data");
  const { origin_m: origin, size_m: size } = raw.box;

  const positions = (encoded: string): Float32Array => {
    const view = bytes(encoded);
    const out = new Float32Array(view.length / 2);
    for (let i = 0; i < out.length; ++i) {
      out[i] = origin[i % 3] + (size * (view[2 * i] + 256 * view[2 * i + 1])) / 65535;
    }
    return out;
  };
  const signed = (encoded: string, scale: number): Float32Array =>
    Float32Array.from(new Int8Array(bytes(encoded).buffer), (q) => (q === -128 ? NaN : (q * scale) / 127));
  const unsigned = (encoded: string, scale: number): Float32Array =>
    Float32Array.from(bytes(encoded), (q) => (q * scale) / 255);

  const index = bytes(raw.mesh.triangles);
  const wide = raw.mesh.vertices > 65536;
  const triangles = wide ? new Uint32Array(index.buffer) : Uint32Array.from(new Uint16Array(index.buffer));

  const steps: Step[] = raw.steps.map((step, i) => ({
    ...step,
    index: i,
    surface: step.surface !== undefined ? positions(step.surface) : null,
    stress: step.stress !== undefined ? unsigned(step.stress, raw.stress_scale_pa) : null,
    points: step.points !== undefined ? positions(step.points) : null,
    residual: step.residual !== undefined ? signed(step.residual, raw.residual_scale_m) : null,
    masked: step.masked !== undefined ? positions(step.masked) : null,
  }));
  const pushes: Report["pushes"] = [];
  for (const step of steps) {
    let push = pushes.find((p) => p.name === step.push);
    if (!push) pushes.push((push = { name: step.push, steps: [] }));
    push.steps.push(step);
  }
  return { ...raw, steps, pushes, triangles, rest: positions(raw.mesh.rest) };
}
