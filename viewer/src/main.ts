// SPDX-License-Identifier: Apache-2.0
import "./style.css";
import { decode, type Report, type Step } from "./data";
import { budget, budgetIf, heldOut, laws, nuisances, perLoad, perPush, perSite, posterior, sparkline } from "./figures_answer";
import { convergence, forceTravel, histogram, rmsBySteps } from "./figures_fit";
import { watch } from "./live";
import { citation, provenance, recordingFacts } from "./provenance";
import { Viewer } from "./viewer3d";
import { count, datum, digits, el, known, plural, quantity } from "./words";

type Draw = (width: number) => SVGElement | null;

/** A figure that is drawn anew for every width. Returns null when there is nothing to draw. */
class Panel {
  readonly node: HTMLElement;
  private readonly holder = el("div", { class: "plot-holder" });
  private width = 0;

  static make(title: string, caption: string, draw: Draw, wide = false): Panel | null {
    return draw(400) ? new Panel(title, caption, draw, wide) : null;
  }
  private constructor(title: string, caption: string, private readonly draw: Draw, wide: boolean) {
    this.node = el("figure", { class: wide ? "panel wide" : "panel" }, el("h3", {}, title), this.holder, el("figcaption", {}, caption));
    new ResizeObserver(() => this.redraw()).observe(this.holder);
  }
  redraw(force = false): void {
    const width = Math.floor(this.holder.clientWidth);
    if (width < 50 || (width === this.width && !force)) return;
    this.width = width;
    const plot = this.draw(width);
    this.holder.replaceChildren(...(plot ? [plot] : []));
  }
}

function header(report: Report): HTMLElement {
  const theme = el("button", { type: "button", class: "quiet", "aria-label": "Switch between light and dark" }, "\u25d0");
  theme.addEventListener("click", () => {
    const root = document.documentElement;
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
  });
  const print = el("button", { type: "button", class: "quiet" }, "Print");
  print.addEventListener("click", () => window.print());
  return el("header", {}, el("div", { class: "brand" }, el("span", { class: "wordmark" }, "palpate"), el("span", { class: "title" }, report.title)), el("div", { class: "tools" }, theme, print));
}

function answer(report: Report): HTMLElement {
  const section = el("section", { id: "answer" }, el("p", { class: "lead" }, report.answer));
  const cards = el("div", { class: "cards" });
  for (const p of report.parameters) {
    const card = el(
      "div",
      { class: p.determined ? "card" : "card open", "data-name": p.name, "data-region": p.region },
      el("h2", {}, p.title),
      el("p", { class: "value" }, datum(p.value, p.text, "value"), p.determined ? null : el("span", { class: "flag" }, "not determined")),
      known(p.lower_95) && p.lower_95 === p.upper_95 ? el("p", { class: "interval" }, "given") : known(p.lower_95) ? el("p", { class: "interval" }, "95 %: ", datum(p.lower_95, p.interval_text, "interval")) : el("p", { class: "interval" }, report.running ? "no interval yet" : "no interval"),
    );
    const shape = sparkline(report, p);
    if (shape) card.append(shape);
    cards.append(card);
  }
  section.append(cards);
  const list = el("ul", { class: "verdicts", "aria-label": "Verdicts" });
  for (const verdict of report.verdicts) {
    list.append(el("li", {}, el("span", { class: "sign", "aria-hidden": "true" }, "!"), el("span", {}, verdict.message, " ", el("code", {}, verdict.code))));
  }
  if (!report.converged && !report.running) {
    list.prepend(el("li", { class: "bad" }, el("span", { class: "sign", "aria-hidden": "true" }, "\u00d7"), el("span", {}, `The fit ${report.termination}. ${report.message}`)));
  }
  if (list.children.length > 0) section.append(list);
  else section.append(el("p", { class: "fine" }, report.running ? "Verdicts come with the end of the work." : "No verdict speaks against this answer."));
  section.append(facts(report));
  return section;
}

function facts(report: Report): HTMLElement {
  const f = report.fit;
  const list = el("dl", { class: "facts" });
  const add = (name: string, ...text: (string | HTMLElement)[]): void => void list.append(el("div", {}, el("dt", {}, name), el("dd", {}, ...text)));
  if (known(f.rms_m) && (!report.running || f.rms_m)) add("residual", datum(f.rms_m, `${quantity(f.rms_m, "m")} rms`, "rms_m"));
  if (!report.running || f.points_used) add("\u03c7\u00b2 per degree of freedom", datum(f.chi2_per_dof, known(f.chi2_per_dof) ? digits(f.chi2_per_dof, 3) : "unknown", "chi2_per_dof"));
  if (!report.running || f.points_used) add("data", `${plural(f.points_used, "point")}, ${plural(f.steps, "step")}, ${plural(f.pushes, "push")}`);
  add("material law", report.material.replaceAll("_", " ") || "unknown");
  add("method", report.method === "paper" ? "the paper's (IROS 2010)" : report.method);
  add("fit", `${report.running ? "running" : report.termination}, ${plural(f.iterations, "iteration")}, ${count(f.solves)} solves`);
  const total = Object.values(report.timing_s).filter(known).reduce((a, b) => a + b, 0);
  if (total > 0) add("time", quantity(total, "s"));
  return list;
}

/** The whole page. Built once; `renew` takes later data while the work goes on, and the 3D view keeps its camera and choices. */
class Page {
  private readonly holder = document.getElementById("page")!;
  private readonly main = el("main");
  private viewer: Viewer | null = null;
  private linked: Panel[] = [];
  private selected: Step | null = null;

  renew(report: Report): void {
    document.title = `${report.title} \u2013 palpate`;
    const opened = this.main.querySelector<HTMLDetailsElement>("#provenance details")?.open ?? false;
    if (!this.main.isConnected) this.holder.append(header(report), this.main);
    // The viewer stays in the page: a canvas that is moved loses the reader's focus.
    if (!this.viewer?.renew(report)) {
      this.viewer?.dispose();
      this.viewer = new Viewer(report, (step) => {
        this.selected = step;
        for (const panel of this.linked) panel.redraw(true);
      });
      this.main.replaceChildren(this.viewer.node);
    }
    for (const node of [...this.main.children]) if (node !== this.viewer.node) node.remove();
    const panels = this.panels(report, (step) => this.viewer?.select(step));
    const figures = el("section", { class: "figures", "aria-label": "Figures" }, ...panels.map((p) => p.node));
    this.viewer.node.before(answer(report));
    this.viewer.node.after(figures, recordingFacts(report), provenance(report, opened), citation(report));
    for (const panel of panels) panel.redraw(true);
    document.documentElement.dataset.ready = "true";
  }

  private panels(report: Report, select: (step: Step) => void): Panel[] {
    const many = report.pushes.length > 1;
    const curve = Panel.make("Force against travel", `Marks: measured${many ? ", one colour and shape a push" : ""}. Line: the fitted model; band: its 95 % interval. Click a mark to see that step above.`, (w) => forceTravel(report, w, this.selected, select));
    const steps = Panel.make("Residual of every step", "A step that stands out is one to look at in 3D: click it.", (w) => rmsBySteps(report, w, this.selected, select));
    this.linked = [curve, steps].filter((x): x is Panel => x !== null);
    const p = report.prediction;
    return [
      curve,
      Panel.make("What the data say about E and \u03bd together", "Regions that hold 68 % (dark) and 95 % (light) of the posterior; cross: medians; thin lines: each parameter alone. A long ridge means that the two trade off against each other.", (w) => posterior(report, w)),
      Panel.make("Residuals", `Observed points against the simulated surface; positive: outside of it${report.histogram && report.histogram.beyond > 0 ? `; ${count(report.histogram.beyond)} beyond the axis` : ""}. Line: a normal distribution of the fit's rms.`, (w) => histogram(report, w)),
      steps,
      Panel.make("Each push on its own", "Young's modulus with 95 % interval from each push (or region) alone; shaded: all together. Intervals that do not overlap speak for an object that is not homogeneous.", (w) => perPush(report, w)),
      Panel.make("Each site on its own", "The same for all pushes at one place together.", (w) => perSite(report, w)),
      Panel.make("Low and high loads", "The same for the lower and the higher half of the loads. Where they disagree, the material does not obey the law, and each quarter of the loads is shown as well: of a linear law these are secants.", (w) => perLoad(report, w)),
      Panel.make("Other laws", `Each law fitted to the same data on one mesh, and once without the highest loads, which it then predicts: the shortest bar is the law that these surprise least.${report.laws.filter((l) => !l.usable).map((l) => ` ${l.law}: ${l.message}.`).join("")}`, (w) => laws(report, w)),
      Panel.make("Error budget", "How far one standard deviation of each input moves the answer. The longest bar is what to calibrate next.", (w) => budget(report, w)),
      Panel.make("Stated as exact", "In no interval, since the recording says that these inputs are exactly known: what each would do to the answer were it off by a typical size.", (w) => budgetIf(report, w)),
      Panel.make("Prediction of what was held out", `Fitted without ${p.what || "it"}, then predicted under load${known(p.deformation_explained) ? `: ${digits(100 * p.deformation_explained, 2)} % of the deformation that the fit of everything explains, noise left out` : ""}${known(p.force_error) ? `; force off by ${digits(100 * Math.abs(p.force_error), 2)} %` : ""}. Grey: the fit that has seen it (hardly more than noise), and trivial guesses.`, (w) => heldOut(report, w)),
      Panel.make("Nuisances against their priors", "Estimate with 95 % interval in prior standard deviations. Within the shaded band all is as expected; beyond \u00b13 the prior or the model is wrong.", (w) => nuisances(report, w)),
      Panel.make("Convergence", "Young's modulus over the accepted iterations; dashed: the cost on a logarithmic scale of its own. The fit goes in rounds that weigh outliers more and more strictly; each round's cost starts afresh.", (w) => convergence(report, w)),
    ].filter((x): x is Panel => x !== null);
  }
}

// Paper opens nothing: what is folded on the screen is unfolded for the printer.
window.addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll<HTMLDetailsElement>("details:not([open])")) {
    details.open = true;
    window.addEventListener("afterprint", () => (details.open = false), { once: true });
  }
});

const page = new Page();
const source = document.getElementById("palpate-data");
if (source?.textContent) page.renew(decode(source.textContent));
else if (document.querySelector('meta[name="palpate-live"]')) void watch(document.getElementById("page")!, (report) => page.renew(report));
else document.getElementById("page")!.append(el("p", { class: "note" }, "This is the empty template of a report; palpate writes the data into it."));
