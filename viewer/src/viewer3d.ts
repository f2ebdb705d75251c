// SPDX-License-Identifier: Apache-2.0
// The 3D section: view, controls, legend. Without WebGL a word stands in its place.
import { gradient } from "./colours";
import type { Report, Step } from "./data";
import { View, type Visible } from "./scene";
import { type Field, Fields, type Mode } from "./surface_fields";
import { digits, el, known, plural, prefix, quantity } from "./words";

const modeNames: Record<Mode, string> = {
  displacement: "Displacement",
  residual: "Residual",
  mean_residual: "Mean residual",
  strain: "Surface strain",
  stress: "Stress",
};

export interface Viewer {
  node: HTMLElement;
  select: (step: Step) => void;
}

export function viewer3d(report: Report, changed: (step: Step) => void): Viewer {
  const steps = report.steps.filter((s) => s.surface || s.points);
  const holder = el("div", { class: "view" });
  const node = el("section", { id: "object", "aria-label": "The object in 3D" }, el("h2", {}, "Seen and simulated"));
  if (steps.length === 0 || report.rest.length === 0) {
    node.append(el("p", { class: "note" }, "This result carries no surfaces, so there is nothing to show in 3D."));
    return { node, select: () => undefined };
  }

  const fields = new Fields(report);
  let view: View | null = null;
  let step = steps[steps.length - 1];
  let mode: Mode = "displacement";
  const visible: Visible = { surface: true, mesh: false, cloud: true, masked: false, rest: false, push: true };

  const readout = el("output", { class: "readout", "aria-live": "polite" });
  const legend = el("div", { class: "legend" });
  const slider = el("input", { type: "range", min: "0", step: "1", "aria-label": "Step" });
  const pushes = report.pushes.filter((p) => p.steps.some((s) => steps.includes(s)));
  const pushSelect = el("select", { "aria-label": "Push" });
  pushes.forEach((push, i) => pushSelect.append(el("option", { value: String(i) }, push.name || `push ${i + 1}`)));
  const stepsOf = (name: string): Step[] => steps.filter((s) => s.push === name);

  const update = (): void => {
    const field = fields.field(mode, step);
    view?.show(step, field, visible);
    showLegend(legend, field);
    const list = stepsOf(step.push);
    slider.max = String(list.length - 1);
    slider.value = String(list.indexOf(step));
    pushSelect.value = String(pushes.findIndex((p) => p.name === step.push));
    const force = Math.hypot(...step.force_n.map((f) => f ?? 0));
    const parts = [`step ${step.step} (${list.indexOf(step) + 1} of ${list.length})`, `${quantity(force, "N")} force`];
    if (known(step.travel_m)) parts.push(`${quantity(step.travel_m, "m")} travel`);
    if (known(step.rms_m)) parts.push(`${quantity(step.rms_m, "m")} rms over ${plural(step.points_total, "point")}`);
    if (!step.used) parts.push("not used in the fit");
    readout.textContent = parts.join(" \u00b7 ");
    slider.setAttribute("aria-valuetext", parts.join(", "));
    changed(step);
  };
  const select = (chosen: Step): void => {
    if (!steps.includes(chosen) || chosen === step) return;
    step = chosen;
    update();
  };
  slider.addEventListener("input", () => select(stepsOf(step.push)[Number(slider.value)]));
  pushSelect.addEventListener("change", () => {
    const list = stepsOf(pushes[Number(pushSelect.value)].name);
    select(list[list.length - 1]);
  });

  const play = el("button", { type: "button", class: "play", "aria-label": "Play the steps" }, "\u25b6");
  let timer = 0;
  const stop = (): void => {
    window.clearInterval(timer);
    timer = 0;
    play.textContent = "\u25b6";
    play.setAttribute("aria-label", "Play the steps");
  };
  play.addEventListener("click", () => {
    if (timer) return stop();
    play.textContent = "\u275a\u275a";
    play.setAttribute("aria-label", "Pause");
    const list = stepsOf(step.push);
    if (step === list[list.length - 1]) select(list[0]);
    timer = window.setInterval(() => {
      const now = stepsOf(step.push);
      const next = now.indexOf(step) + 1;
      if (next >= now.length) return stop();
      select(now[next]);
    }, 250);
  });

  const modes = el("div", { class: "choices", role: "group", "aria-label": "Colour" });
  for (const m of fields.modes()) {
    const button = el("button", { type: "button", "aria-pressed": String(m === mode), "data-mode": m }, modeNames[m]);
    button.addEventListener("click", () => {
      mode = m;
      for (const b of modes.children) b.setAttribute("aria-pressed", String(b === button));
      update();
    });
    modes.append(button);
  }
  const toggles = el("div", { class: "toggles", role: "group", "aria-label": "Shown" });
  const maskedPoints = steps.some((s) => s.residual?.some(Number.isNaN));
  const names: [keyof Visible, string][] = [
    ["surface", "simulated surface"], ["cloud", "observed points"], ["rest", "rest shape"], ["mesh", "triangles"], ["push", "push"],
  ];
  if (maskedPoints) names.splice(2, 0, ["masked", "points not used"]);
  for (const [key, name] of names) {
    const box = el("input", { type: "checkbox", "data-show": key });
    box.checked = visible[key];
    box.addEventListener("change", () => {
      visible[key] = box.checked;
      update();
    });
    toggles.append(el("label", {}, box, name));
  }

  node.append(
    el("div", { class: "stage" }, holder, legend),
    el("div", { class: "controls" },
      el("div", { class: "steps" }, ...(pushes.length > 1 ? [pushSelect] : []), play, slider),
      readout, modes, toggles),
  );
  for (const words of report.thinned) node.append(el("p", { class: "note" }, words));

  // The holder needs its size before the view is made.
  queueMicrotask(() => {
    try {
      view = new View(holder, report);
    } catch {
      holder.classList.add("without");
      holder.append(el("p", {}, "This browser offers no WebGL, so the 3D view is missing. All figures below are complete."));
    }
    update();
  });
  return { node, select };
}

function showLegend(legend: HTMLElement, field: Field): void {
  const percent = field.unit === "%";
  const scaled = percent ? { factor: 100, unit: "%" } : prefix(field.scale, field.unit);
  const low = field.signed ? -field.scale : 0;
  const text = (v: number): string => (v === 0 ? "0" : digits(v * scaled.factor, 3));
  const bar = el("div", { class: "ramp" });
  bar.style.background = gradient(field.signed ? "signed" : "size");
  legend.replaceChildren(
    el("span", { class: "legend-title" }, `${field.title} (${scaled.unit})`),
    bar,
    el("div", { class: "legend-ticks" }, el("span", {}, text(low)), el("span", {}, text((low + field.scale) / 2)), el("span", { "data-key": "legend-max" }, text(field.scale))),
  );
}
