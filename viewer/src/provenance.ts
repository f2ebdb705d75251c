// SPDX-License-Identifier: Apache-2.0
// Where the numbers come from, and how to cite them.
import type { Report } from "./data";
import { el, known, quantity } from "./words";

function table(rows: [string, string][]): HTMLElement {
  const body = el("tbody");
  for (const [name, value] of rows) body.append(el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, value)));
  return el("div", { class: "scroll" }, el("table", {}, body));
}

export function recordingFacts(report: Report): HTMLElement {
  const section = el("section", { id: "recording" });
  const scene = report.scene;
  if (!scene) return section;
  section.append(el("h2", {}, "Recording"));
  const gravity = scene.gravity_m_s2.map((g) => g ?? 0);
  const rows: [string, string][] = [
    ["source", scene.source],
    ["rest shape", scene.rest_state],
    ["gravity", Math.hypot(...gravity) > 0 ? `(${gravity.map((g) => g.toFixed(3)).join(", ")}) m/s\u00b2` : "none"],
    ["tools", scene.tools.join("; ") || "none"],
    ["supports", scene.supports.join("; ") || "none"],
  ];
  section.append(table(rows));
  for (const warning of scene.warnings) section.append(el("p", { class: "note" }, warning));
  return section;
}

export function provenance(report: Report, opened: boolean): HTMLElement {
  const rows: [string, string][] = [["palpate", report.version]];
  for (const [name, value] of Object.entries(report.provenance)) rows.push([name.replaceAll("_", " "), value]);
  for (const [stage, seconds] of Object.entries(report.timing_s)) if (known(seconds)) rows.push([`time: ${stage.replaceAll("_", " ")}`, quantity(seconds, "s")]);
  for (const [file, hash] of Object.entries(report.input_hashes)) rows.push([`SHA-256 of ${file}`, hash]);
  const details = el("details", {}, el("summary", {}, "Versions, options, seeds, hashes"), table(rows));
  details.open = opened;
  return el("section", { id: "provenance" }, el("h2", {}, "Provenance"), details);
}

export function citation(report: Report): HTMLElement {
  const bibtex = [
    "@software{palpate,",
    "  title   = {palpate: elasticity of deformable objects from a robot's pushes},",
    `  version = {${report.version}},`,
    "  license = {Apache-2.0}",
    "}",
    "@inproceedings{frank2010learning,",
    "  author    = {Frank, Barbara and Schmedding, R{\\\"u}diger and Stachniss, Cyrill and Teschner, Matthias and Burgard, Wolfram},",
    "  title     = {Learning the Elasticity Parameters of Deformable Objects with a Manipulation Robot},",
    "  booktitle = {IEEE/RSJ International Conference on Intelligent Robots and Systems (IROS)},",
    "  year      = {2010}",
    "}",
  ].join("\n");
  return el("section", { id: "cite" }, el("h2", {}, "How to cite"), el("pre", { tabindex: "0" }, bibtex));
}
