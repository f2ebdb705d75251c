// SPDX-License-Identifier: Apache-2.0
// Figures of the measurements against the fitted model.
import { category } from "./colours";
import type { Num, Report, Step } from "./data";
import { Plot, range, svg } from "./plot";
import { known, prefix, quantity } from "./words";

export type Select = (step: Step) => void;

/** Force against travel: measured points, the prediction as a line with its 95 % band. Null when no step has both. */
export function forceTravel(report: Report, width: number, selected: Step | null, select: Select): SVGElement | null {
  // Where the motion was not measured, the simulated motion stands in, and the axis says so.
  const travelled = report.steps.some((s) => known(s.travel_m));
  const xOf = (s: Step): number | null => (travelled ? s.travel_m : s.travel_predicted_m);
  const complete = report.steps.filter((s) => known(xOf(s)) && (known(s.force_measured_n) || known(s.force_predicted_n)));
  if (complete.length < 2) return null;
  const forces = complete.flatMap((s) => {
    const spread = 1.96 * (s.force_predicted_std_n ?? 0);
    return [s.force_measured_n, s.force_predicted_n, (s.force_predicted_n ?? 0) + spread].filter(known);
  });
  const unit = prefix(Math.max(...complete.map((s) => Math.abs(xOf(s)!))), "m");
  const reach = (s: Step): Num => (known(s.travel_predicted_m) ? s.travel_predicted_m + 1.96 * (s.travel_predicted_std_m ?? 0) : null);
  const x = range(complete.flatMap((s) => [xOf(s), s.travel_predicted_m, reach(s)]).filter(known).map((v) => v * unit.factor), true);
  const plot = new Plot(
    width,
    300,
    { label: `${travelled ? "travel of the tool" : "simulated travel of the tool"} (${unit.unit})`, ...x },
    { label: "force (N)", ...range(forces, true) },
    "Force against travel, measured and predicted",
  );
  report.pushes.forEach((push, p) => {
    const steps = push.steps.filter((s) => complete.includes(s));
    const colour = category(p);
    const sorted = [...steps].sort((a, b) => xOf(a)! - xOf(b)!);
    const banded = sorted.filter((s) => known(s.force_predicted_n) && known(s.force_predicted_std_n));
    plot.band(
      banded.map((s) => {
        const [f, sd] = [s.force_predicted_n!, 1.96 * s.force_predicted_std_n!];
        return [xOf(s)! * unit.factor, f - sd, f + sd];
      }),
      { fill: colour, "fill-opacity": 0.18, class: "band" },
    );
    // When the force was imposed, the model answers with a travel; otherwise with a force.
    const imposed = sorted.every((s) => !known(s.force_predicted_n) || s.force_predicted_n === s.force_measured_n);
    const model: [number, number][] = imposed
      ? sorted
          .filter((s) => known(s.travel_predicted_m) && known(s.force_measured_n))
          .map((s) => [s.travel_predicted_m! * unit.factor, s.force_measured_n!])
      : sorted.filter((s) => known(s.force_predicted_n)).map((s) => [xOf(s)! * unit.factor, s.force_predicted_n!]);
    if (imposed) {
      const sideways = sorted.filter((s) => known(s.travel_predicted_m) && known(s.force_measured_n) && known(s.travel_predicted_std_m));
      const edge = (s: Step, side: number): [number, number] => [(s.travel_predicted_m! + side * 1.96 * s.travel_predicted_std_m!) * unit.factor, s.force_measured_n!];
      plot.area([...sideways.map((s) => edge(s, 1)), ...sideways.map((s) => edge(s, -1)).reverse()], { fill: colour, "fill-opacity": 0.18, class: "band" });
    }
    plot.line(model, { stroke: colour, "stroke-width": 2 });
    for (const step of steps) {
      if (!known(step.force_measured_n)) continue;
      const chosen = step === selected;
      const hover = `${push.name}, step ${step.step}: ${quantity(step.force_measured_n, "N")} at ${quantity(xOf(step), "m")}`;
      const mark = plot.marker(
        xOf(step)! * unit.factor,
        step.force_measured_n,
        p,
        { fill: step.used ? colour : "none", stroke: colour, class: chosen ? "point chosen" : "point" },
        step.used ? hover : `${hover} (not used)`,
      );
      mark.addEventListener("click", () => select(step));
    }
  });
  return plot.node;
}

export function histogram(report: Report, width: number): SVGElement | null {
  const h = report.histogram;
  if (!h || h.total === 0) return null;
  const unit = prefix(h.to_m, "m");
  const n = h.counts.length;
  const bin = (h.to_m - h.from_m) / n;
  const peak = Math.max(...h.counts);
  const rms = report.fit.rms_m;
  const normal = (r: number): number => (h.total * bin * Math.exp((-r * r) / (2 * rms! * rms!))) / (rms! * Math.sqrt(2 * Math.PI));
  const top = known(rms) && rms > 0 ? Math.max(peak, normal(0)) : peak;
  const plot = new Plot(
    width,
    260,
    { label: `residual (${unit.unit})`, from: h.from_m * unit.factor, to: h.to_m * unit.factor },
    { label: "points", from: 0, to: top * 1.08 },
    "Histogram of residuals",
    58,
  );
  h.counts.forEach((count, i) => {
    const x0 = plot.x((h.from_m + i * bin) * unit.factor);
    const x1 = plot.x((h.from_m + (i + 1) * bin) * unit.factor);
    const y = plot.y(count);
    plot.add(
      "rect",
      { x: x0 + 0.5, y, width: Math.max(x1 - x0 - 1, 0.5), height: plot.bottom - y, class: "bar" },
      undefined,
      `${count} points near ${quantity(h.from_m + (i + 0.5) * bin, "m")}`,
    );
  });
  if (known(rms) && rms > 0) {
    const curve: [number, number][] = [];
    for (let i = 0; i <= 120; ++i) {
      const r = h.from_m + ((h.to_m - h.from_m) * i) / 120;
      curve.push([r * unit.factor, normal(r)]);
    }
    plot.line(curve, { class: "normal" });
  }
  return plot.node;
}

export function rmsBySteps(report: Report, width: number, selected: Step | null, select: Select): SVGElement | null {
  const steps = report.steps.filter((s) => known(s.rms_m));
  if (steps.length < 2) return null;
  const largest = Math.max(...steps.map((s) => s.rms_m!));
  const unit = prefix(largest, "m");
  const plot = new Plot(
    width,
    220,
    { label: report.pushes.length > 1 ? "step, push after push" : "step", from: -0.6, to: report.steps.length - 0.4, format: (v) => String(Math.round(v)) },
    { label: `rms residual (${unit.unit})`, from: 0, to: largest * unit.factor * 1.1 },
    "Root mean square residual of every step",
  );
  for (const step of steps) {
    const p = report.pushes.findIndex((push) => push.name === step.push);
    const [x, y] = [plot.x(step.index), plot.y(step.rms_m! * unit.factor)];
    plot.add("line", { x1: x, x2: x, y1: plot.bottom, y2: y, stroke: category(p), "stroke-opacity": 0.4 });
    const mark = plot.marker(
      step.index,
      step.rms_m! * unit.factor,
      p,
      { fill: step.used ? category(p) : "none", stroke: category(p), class: step === selected ? "point chosen" : "point" },
      `${step.push}, step ${step.step}: ${quantity(step.rms_m, "m")} rms over ${step.points_total} points`,
    );
    mark.addEventListener("click", () => select(step));
  }
  return plot.node;
}

export function convergence(report: Report, width: number): SVGElement | null {
  const trace = report.trace.filter((t) => known(t.cost) && known(t.young_modulus_pa));
  if (trace.length < 2) return null;
  const unit = prefix(Math.max(...trace.map((t) => t.young_modulus_pa!)), "Pa");
  const values = trace.map((t) => t.young_modulus_pa! * unit.factor);
  const costs = trace.map((t) => t.cost!);
  const [low, high] = [Math.min(...costs), Math.max(...costs)];
  const plot = new Plot(
    width,
    240,
    { label: "iteration", from: 0, to: trace.length - 1, ticks: trace.length <= 12 ? trace.map((_, i) => i) : undefined },
    { label: `Young's modulus (${unit.unit})`, ...range(values) },
    "Convergence of the fit",
  );
  plot.line(values.map((v, i) => [i, v]), { stroke: category(0), "stroke-width": 2 });
  values.forEach((v, i) => {
    plot.marker(i, v, 0, { fill: category(0) }, `iteration ${i}: E ${quantity(trace[i].young_modulus_pa, "Pa", 4)}, cost ${costs[i].toPrecision(5)}`);
  });
  if (low > 0 && high > low) {
    // The cost on its own logarithmic scale, drawn over the same height. A round weighs outliers anew: its cost starts afresh.
    const y = (c: number): number => plot.bottom - (plot.bottom - plot.top) * (0.04 + 0.92 * (Math.log(c / low) / Math.log(high / low)));
    const d = costs.map((c, i) => `${i && trace[i].round === trace[i - 1].round ? "L" : "M"}${plot.x(i)} ${y(c)}`).join("");
    plot.node.append(svg("path", { d, fill: "none", class: "cost" }));
  }
  return plot.node;
}
