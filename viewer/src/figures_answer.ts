// SPDX-License-Identifier: Apache-2.0
// Figures of the answer and of what it rests on: posterior, single pushes, error budget, held-out prediction, nuisances.
import { category } from "./colours";
import type { BudgetEntry, Parameter, Report } from "./data";
import { Plot, range, svg } from "./plot";
import { along, marginal, outlines, threshold } from "./regions";
import { digits, known, prefix, quantity } from "./words";

const young = (report: Report): Parameter | undefined =>
  report.parameters.find((p) => p.name === "young_modulus" && p.region === "") ??
  report.parameters.find((p) => p.name === "young_modulus");
const poisson = (report: Report): Parameter | undefined => report.parameters.find((p) => p.name === "poisson_ratio");

/** Rows and columns that hold all but a sliver of the probability, so that the figure is not mostly empty. */
function crop(values: number[], floor: number): [number, number] {
  let first = values.findIndex((v) => v > floor);
  let last = values.length - 1;
  while (last > first && values[last] <= floor) --last;
  first = Math.max(0, first - 1);
  return [first, Math.min(values.length - 1, last + 1)];
}

export function posterior(report: Report, width: number): SVGElement | null {
  const grid = report.posterior;
  if (!grid || grid.density.length < 2 || grid.density[0].length < 2) return null;
  const [i0, i1] = crop(grid.density.map((row) => Math.max(...row)), 1e-3);
  const [j0, j1] = crop(grid.density[0].map((_, j) => Math.max(...grid.density.map((row) => row[j]))), 1e-3);
  const E = grid.young_modulus_pa.slice(i0, i1 + 1);
  const nu = grid.poisson_ratio.slice(j0, j1 + 1);
  const density = grid.density.slice(i0, i1 + 1).map((row) => row.slice(j0, j1 + 1));
  const logE = E.map(Math.log);
  const unit = prefix(E[E.length - 1], "Pa");
  const wide = E[E.length - 1] / E[0] > 4;
  const plot = new Plot(
    width,
    340,
    { label: `Young's modulus (${unit.unit})`, from: E[0] * unit.factor, to: E[E.length - 1] * unit.factor, log: wide },
    { label: "Poisson ratio", from: nu[0], to: nu[nu.length - 1] },
    "Posterior over Young's modulus and Poisson ratio",
  );
  for (const [share, name] of [[0.95, "wide-region"], [0.68, "narrow-region"]] as const) {
    const level = threshold(density, logE, nu, share);
    const d = outlines(density, level)
      .map((loop) => {
        const points = loop.map(([i, j]) => {
          const x = plot.x(Math.exp(along(logE, i)) * unit.factor);
          return `${x.toFixed(1)} ${plot.y(along(nu, j)).toFixed(1)}`;
        });
        return `M${points.join("L")}Z`;
      })
      .join("");
    plot.add("path", { d, class: name, "fill-rule": "evenodd" }, undefined, `${share * 100} % region`);
  }
  // Marginals along the edges.
  const height = 34;
  const ofE = marginal(density, nu, true);
  const ofNu = marginal(density, logE, false);
  const below = E.map((e, i) => `${plot.x(e * unit.factor).toFixed(1)} ${(plot.bottom - height * ofE[i]).toFixed(1)}`);
  plot.add("path", { d: `M${below.join("L")}`, class: "marginal" }, undefined, "Young's modulus alone");
  const beside = nu.map((v, j) => `${(plot.right - height * ofNu[j]).toFixed(1)} ${plot.y(v).toFixed(1)}`);
  plot.add("path", { d: `M${beside.join("L")}`, class: "marginal" }, undefined, "Poisson ratio alone");
  const [e, v] = [young(report)?.value, poisson(report)?.value];
  if (known(e) && known(v)) {
    const [x, y] = [plot.x(e * unit.factor), plot.y(v)];
    plot.add("path", { d: `M${x - 7} ${y}h14M${x} ${y - 7}v14`, class: "median" }, undefined, `medians: ${quantity(e, "Pa", 4)}, ${digits(v, 3)}`);
  }
  return plot.node;
}

/** The shape of one parameter's marginal posterior for its card. */
export function sparkline(report: Report, parameter: Parameter): SVGElement | null {
  const grid = report.posterior;
  if (!grid || parameter.region !== "") return null;
  const isYoung = parameter.name === "young_modulus";
  if (!isYoung && parameter.name !== "poisson_ratio") return null;
  const axis = isYoung ? grid.young_modulus_pa : grid.poisson_ratio;
  const density = isYoung ? marginal(grid.density, grid.poisson_ratio, true) : marginal(grid.density, grid.young_modulus_pa.map(Math.log), false);
  const [first, last] = crop(density, 2e-3);
  const [from, to] = [axis[first], axis[last]];
  const [width, height] = [260, 46];
  const x = (v: number): number => ((v - from) / (to - from || 1)) * width;
  const inside: string[] = [];
  const all: string[] = [];
  const steps = 160;
  for (let k = 0; k <= steps; ++k) {
    const place = first + ((last - first) * k) / steps;
    const v = along(axis, place);
    const text = `${x(v).toFixed(1)} ${(height - 2 - (height - 6) * along(density, place)).toFixed(1)}`;
    all.push(text);
    if (v >= (parameter.lower_95 ?? -Infinity) && v <= (parameter.upper_95 ?? Infinity)) inside.push(text);
  }
  const node = svg("svg", { viewBox: `0 0 ${width} ${height}`, class: "sparkline", "aria-hidden": "true", preserveAspectRatio: "none" });
  if (inside.length > 1) {
    const a = inside[0].split(" ")[0];
    const b = inside[inside.length - 1].split(" ")[0];
    node.append(svg("path", { d: `M${a} ${height - 2}L${inside.join("L")}L${b} ${height - 2}Z`, class: "spark-fill" }));
  }
  node.append(svg("path", { d: `M${all.join("L")}`, class: "spark-line" }));
  return node;
}

interface Row {
  label: string;
  value: number;
  lower: number;
  upper: number;
  hover: string;
  colour: string;
}

/** Rows of values with intervals, one below the other. */
function rows(width: number, items: Row[], label: string, title: string, band: [number, number] | null, marks: number[] = []): SVGElement {
  const longest = Math.max(...items.map((r) => Math.min(r.label.length, 26)));
  const left = Math.min(Math.max(60, longest * 6.6 + 14), width * 0.42);
  const height = 48 + items.length * 22;
  const extent = range(items.flatMap((r) => [r.lower, r.upper, r.value]).concat(band ?? [], marks));
  const plot = new Plot(width, height, { label, ...extent }, null, title, left);
  if (band) {
    const [a, b] = [plot.x(band[0]), plot.x(band[1])];
    plot.add("rect", { x: a, width: Math.max(b - a, 1), y: plot.top, height: plot.bottom - plot.top, class: "joint" }, undefined, "95 % interval of all together");
  }
  for (const mark of marks) plot.add("line", { x1: plot.x(mark), x2: plot.x(mark), y1: plot.top, y2: plot.bottom, class: "mark" });
  items.forEach((row, i) => {
    const y = plot.top + 11 + i * 22;
    const short = row.label.length > 26 ? `${row.label.slice(0, 25)}\u2026` : row.label;
    plot.add("text", { x: left - 8, y: y + 4, class: "tick", "text-anchor": "end" }, short, row.label);
    plot.add("line", { x1: plot.x(row.lower), x2: plot.x(row.upper), y1: y, y2: y, stroke: row.colour, "stroke-width": 2.5, "stroke-opacity": 0.55 });
    plot.add("circle", { cx: plot.x(row.value), cy: y, r: 4.5, fill: row.colour }, undefined, row.hover);
  });
  return plot.node;
}

/** Young's modulus of parts of the recording, each alone, against that of all together. */
function youngOfParts(report: Report, width: number, parts: [Parameter[], string][], title: string): SVGElement | null {
  const list = parts.flatMap(([some, colour]) => some.filter((p) => known(p.value)).map((p) => ({ p, colour })));
  if (list.length < 2) return null;
  const joint = young(report);
  const unit = prefix(Math.max(...list.map(({ p }) => p.value!)), "Pa");
  const row = ({ p, colour }: { p: Parameter; colour: string }): Row => ({
    label: p.region || p.title,
    value: p.value! * unit.factor,
    lower: (p.lower_95 ?? p.value!) * unit.factor,
    upper: (p.upper_95 ?? p.value!) * unit.factor,
    hover: `${p.region}: ${p.text} (95 %: ${p.interval_text})`,
    colour,
  });
  const band: [number, number] | null =
    joint && joint.region === "" && known(joint.lower_95) && known(joint.upper_95) ? [joint.lower_95 * unit.factor, joint.upper_95 * unit.factor] : null;
  return rows(width, list.map(row), `Young's modulus (${unit.unit})`, title, band);
}

export function perPush(report: Report, width: number): SVGElement | null {
  const pushes = report.per_push.filter((p) => known(p.lower_95) && known(p.upper_95)).slice(0, 60);
  const regions = report.parameters.filter((p) => p.name === "young_modulus" && p.region !== "");
  return youngOfParts(report, width, [[pushes, category(0)], [regions, category(2)]], "Young's modulus of each push alone");
}

export function perSite(report: Report, width: number): SVGElement | null {
  // Where every site was pushed once, the pushes have said it all.
  if (report.per_site.every((site) => report.per_push.some((push) => push.value === site.value))) return null;
  const sites = report.per_site.filter((p) => known(p.lower_95) && known(p.upper_95)).slice(0, 60);
  return youngOfParts(report, width, [[sites, category(3)]], "Young's modulus of each site alone");
}

export function perLoad(report: Report, width: number): SVGElement | null {
  const loads = report.per_load.filter((p) => known(p.lower_95) && known(p.upper_95));
  return youngOfParts(report, width, [[loads, category(4)]], "Young's modulus of some of the loads alone");
}

export function nuisances(report: Report, width: number): SVGElement | null {
  const list = report.nuisances
    .filter((n) => known(n.pull))
    .sort((a, b) => Math.abs(b.pull!) - Math.abs(a.pull!))
    .slice(0, 24);
  if (list.length === 0) return null;
  const items = list.map((n): Row => {
    const half = known(n.std) && known(n.prior_std) && n.prior_std > 0 ? (1.96 * n.std) / n.prior_std : 0;
    return {
      label: n.name,
      value: n.pull!,
      lower: n.pull! - half,
      upper: n.pull! + half,
      hover: `${n.name}: ${quantity(n.value, n.unit)} \u00b1 ${quantity(n.std, n.unit, 2)}, pull ${digits(n.pull!, 2)}`,
      colour: Math.abs(n.pull!) > 3 ? category(1) : category(0),
    };
  });
  return rows(width, items, "pull (prior standard deviations)", "Nuisances against their priors", [-2, 2], [-3, 3]);
}

/** Horizontal bars with the number written at the end. */
function bars(width: number, items: { label: string; value: number; text: string; colour: string }[], label: string, title: string): SVGElement {
  const longest = Math.max(...items.map((r) => Math.min(r.label.length, 30)));
  const left = Math.min(Math.max(60, longest * 6.6 + 14), width * 0.45);
  // So long an axis that what stands behind a bar has room.
  const room = width - left - 20;
  const end = (r: { value: number; text: string }) => (r.value * room) / Math.max(room - 12 - r.text.length * 6.3, 0.1 * room);
  const plot = new Plot(width, 48 + items.length * 26, { label, from: 0, to: Math.max(...items.map(end)) || 1 }, null, title, left);
  items.forEach((row, i) => {
    const y = plot.top + 3 + i * 26;
    const short = row.label.length > 30 ? `${row.label.slice(0, 29)}\u2026` : row.label;
    plot.add("text", { x: left - 8, y: y + 14, class: "tick", "text-anchor": "end" }, short, row.label);
    plot.add("rect", { x: left, y, height: 19, width: Math.max(plot.x(row.value) - left, 1), fill: row.colour, rx: 2 }, undefined, `${row.label}: ${row.text}`);
    plot.add("text", { x: plot.x(row.value) + 6, y: y + 14, class: "value" }, row.text);
  });
  return plot.node;
}

/** A bar an input, and where there are several regions one for each of them. */
function shares(list: BudgetEntry[], width: number, colour: string, label: string, title: string): SVGElement | null {
  const items = list
    .flatMap((b) => {
      const young = b.regions.length > 0 ? b.regions : [{ region: "", young_modulus_percent: b.young_modulus_percent }];
      const nu = known(b.poisson_shift) && b.poisson_shift !== 0 ? `, \u03bd ${digits(Math.abs(b.poisson_shift), 2)}` : "";
      const off = b.off_by ? `; off by ${b.off_by}` : "";
      return young
        .filter((one) => known(one.young_modulus_percent))
        .map((one) => {
          const value = Math.abs(one.young_modulus_percent!);
          return { label: one.region ? `${b.input}, ${one.region}` : b.input, value, text: `${digits(value, 2)} %${nu}${off}`, colour };
        });
    })
    .sort((a, b) => b.value - a.value);
  return items.length > 0 ? bars(width, items, label, title) : null;
}

export const budget = (report: Report, width: number): SVGElement | null =>
  shares(report.budget, width, category(0), "share of Young's modulus (%)", "What each input's uncertainty does to the answer");

export const budgetIf = (report: Report, width: number): SVGElement | null =>
  shares(report.budget_if, width, category(4), "change of Young's modulus (%)", "What inputs that are stated as exact would do were they off");

/** How much of a surprise the highest loads are to each law that has seen the lower ones. */
export function laws(report: Report, width: number): SVGElement | null {
  const list = report.laws.filter((l) => l.usable && known(l.held_out_chi2));
  if (list.length === 0) return null;
  const items = list.map((l) => ({
    label: l.law.replaceAll("_", " "),
    value: Math.max(0, l.held_out_chi2!),
    text: `E ${l.young_text}${known(l.force_error) ? `, force off by ${digits(100 * l.force_error, 2)} %` : ""}`,
    colour: l.law === report.material ? category(2) : "var(--faint)",
  }));
  return bars(width, items, "\u03c7\u00b2 of the highest loads", "Laws of elasticity compared by prediction");
}

export function heldOut(report: Report, width: number): SVGElement | null {
  const p = report.prediction;
  if (!p.available || !known(p.surface_rms_m)) return null;
  const list = [
    { label: "fit that has seen it", m: p.fitted_rms_m, colour: "var(--faint)" },
    { label: "palpate's prediction", m: p.surface_rms_m, colour: category(2) },
    { label: "as at the last step", m: p.baseline_last_step_rms_m, colour: "var(--faint)" },
    { label: "no deformation", m: p.baseline_no_deformation_rms_m, colour: "var(--faint)" },
  ].filter((b): b is { label: string; m: number; colour: string } => known(b.m));
  const unit = prefix(Math.max(...list.map((b) => b.m)), "m");
  return bars(
    width,
    list.map((b) => ({ label: b.label, value: b.m * unit.factor, text: quantity(b.m, "m"), colour: b.colour })),
    `distance to the surface that was seen (rms, ${unit.unit})`,
    "Prediction of what was held out",
  );
}
