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

const shownSteps = (report: Report): Step[] => report.steps.filter((s) => s.surface || s.points);

const sameArrays = (a: ArrayLike<number>, b: ArrayLike<number>): boolean => {
  for (let i = 0; i < a.length; ++i) if (a[i] !== b[i]) return false;
  return a.length === b.length;
};

/** The section with the 3D view. Its camera and choices survive later data of the same object. */
export class Viewer {
  readonly node = el("section", { id: "object", "aria-label": "The object in 3D" }, el("h2", {}, "Seen and simulated"));
  private readonly holder = el("div", { class: "view" });
  private readonly legend = el("div", { class: "legend" });
  private readonly readout = el("output", { class: "readout", "aria-live": "polite" });
  private readonly slider = el("input", { type: "range", min: "0", step: "1", "aria-label": "Step" });
  private readonly pushSelect = el("select", { "aria-label": "Push" });
  private readonly play = el("button", { type: "button", class: "play", "aria-label": "Play the steps" }, "\u25b6");
  private readonly modes = el("div", { class: "choices", role: "group", "aria-label": "Colour" });
  private readonly toggles = el("div", { class: "toggles", role: "group", "aria-label": "Shown" });
  private readonly notes = el("div");
  private readonly visible: Visible = { surface: true, mesh: false, cloud: true, masked: false, rest: false, push: true };
  private view: View | null = null;
  private steps: Step[];
  private step: Step;
  private fields: Fields;
  private mode: Mode = "displacement";
  private timer = 0;

  constructor(private report: Report, private readonly changed: (step: Step) => void) {
    this.steps = shownSteps(report);
    // First what was pushed hardest: the last step may be one after the tool has left.
    const force = (s: Step): number => Math.hypot(...s.force_n.map((f) => f ?? 0));
    this.step = this.steps.reduce((a, b) => (force(b) >= force(a) ? b : a), this.steps[0]);
    this.fields = new Fields(report);
    if (this.empty()) {
      this.node.append(el("p", { class: "note" }, "This result carries no surfaces, so there is nothing to show in 3D."));
      return;
    }
    this.slider.addEventListener("input", () => this.select(this.steps[Number(this.slider.value)]));
    this.pushSelect.addEventListener("change", () => {
      const name = this.report.pushes[Number(this.pushSelect.value)].name;
      this.select(this.steps.filter((s) => s.push === name).pop());
    });
    this.play.addEventListener("click", () => (this.timer ? this.pause() : this.start()));
    const steps = el("div", { class: "steps" }, ...(report.pushes.length > 1 ? [this.pushSelect] : []), this.play, this.slider);
    this.node.append(
      el("div", { class: "stage" }, this.holder, this.legend),
      el("div", { class: "controls" }, steps, this.readout, this.modes, this.toggles),
      this.notes,
    );
    this.offer();
    // The holder needs its size before the view is made.
    queueMicrotask(() => {
      try {
        this.view = new View(this.holder, this.report);
      } catch {
        this.holder.classList.add("without");
        this.holder.append(el("p", {}, "This browser offers no WebGL, so the 3D view is missing. All figures below are complete."));
        for (const part of [this.legend, this.modes, this.toggles, this.notes]) part.remove();
      }
      this.update();
    });
  }

  private empty(): boolean {
    return this.steps.length === 0 || this.report.rest.length === 0;
  }

  /** Takes later data of the same object. False: this is another mesh, make another viewer. */
  renew(report: Report): boolean {
    const steps = shownSteps(report);
    const names = (r: Report): string => JSON.stringify(r.pushes.map((p) => p.name));
    if (this.empty() || steps.length === 0 || names(report) !== names(this.report) || !sameArrays(report.triangles, this.report.triangles)) return false;
    this.report = report;
    this.steps = steps;
    this.step = steps.find((s) => s.push === this.step.push && s.step === this.step.step) ?? steps[steps.length - 1];
    this.fields = new Fields(report);
    this.view?.use(report);
    this.offer();
    this.update();
    return true;
  }

  dispose(): void {
    this.pause();
    this.view?.dispose();
  }

  select(chosen: Step | undefined): void {
    if (!chosen || !this.steps.includes(chosen) || chosen === this.step) return;
    this.step = chosen;
    this.update();
  }

  private start(): void {
    this.play.textContent = "\u275a\u275a";
    this.play.setAttribute("aria-label", "Pause");
    if (this.step === this.steps[this.steps.length - 1]) this.select(this.steps[0]);
    this.timer = window.setInterval(() => {
      const next = this.steps.indexOf(this.step) + 1;
      if (next >= this.steps.length) return this.pause();
      this.select(this.steps[next]);
    }, 250);
  }

  private pause(): void {
    window.clearInterval(this.timer);
    this.timer = 0;
    this.play.textContent = "\u25b6";
    this.play.setAttribute("aria-label", "Play the steps");
  }

  /** The choices that these data allow. */
  private offer(): void {
    this.pushSelect.replaceChildren(...this.report.pushes.map((push, i) => el("option", { value: String(i) }, push.name || `push ${i + 1}`)));
    const modes = this.fields.modes();
    if (!modes.includes(this.mode)) this.mode = modes[0];
    this.modes.replaceChildren();
    for (const m of modes) {
      const button = el("button", { type: "button", "aria-pressed": String(m === this.mode), "data-mode": m }, modeNames[m]);
      button.addEventListener("click", () => {
        this.mode = m;
        for (const b of this.modes.children) b.setAttribute("aria-pressed", String(b === button));
        this.update();
      });
      this.modes.append(button);
    }
    const names: [keyof Visible, string][] = [
      ["surface", "simulated surface"], ["cloud", "observed points"], ["rest", "rest shape"], ["mesh", "triangles"], ["push", "push"],
    ];
    if (this.steps.some((s) => s.masked || s.residual?.some(Number.isNaN))) names.splice(2, 0, ["masked", "masked and unused points"]);
    this.toggles.replaceChildren();
    for (const [key, name] of names) {
      const box = el("input", { type: "checkbox", "data-show": key });
      box.checked = this.visible[key];
      box.addEventListener("change", () => {
        this.visible[key] = box.checked;
        this.update();
      });
      this.toggles.append(el("label", {}, box, name));
    }
    this.notes.replaceChildren(...this.report.thinned.map((words) => el("p", { class: "note" }, words)));
  }

  private update(): void {
    const { step, steps, report } = this;
    const field = this.fields.field(this.mode, step);
    this.view?.show(step, field, this.visible);
    showLegend(this.legend, field);
    this.slider.max = String(steps.length - 1);
    this.slider.value = String(steps.indexOf(step));
    this.pushSelect.value = String(report.pushes.findIndex((p) => p.name === step.push));
    const own = steps.filter((s) => s.push === step.push);
    const force = Math.hypot(...step.force_n.map((f) => f ?? 0));
    const parts = [`step ${step.step} (${own.indexOf(step) + 1} of ${own.length}${report.pushes.length > 1 ? " of this push" : ""})`, `${quantity(force, "N")} force`];
    if (known(step.travel_m)) parts.push(`${quantity(step.travel_m, "m")} travel`);
    if (known(step.rms_m)) parts.push(`${quantity(step.rms_m, "m")} rms over ${plural(step.points_total, "point")}`);
    if (!step.used) parts.push("not used in the fit");
    this.readout.textContent = parts.join(" \u00b7 ");
    this.slider.setAttribute("aria-valuetext", [step.push, ...parts].join(", "));
    this.changed(step);
  }
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
