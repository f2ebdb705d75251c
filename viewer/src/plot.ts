// SPDX-License-Identifier: Apache-2.0
// A small plot library: SVG with axes that adapt to the width at hand. Colours come from the style sheet, so that dark mode
// and print need no redraw.

const svgNamespace = "http://www.w3.org/2000/svg";

export function svg(tag: string, attributes: Record<string, string | number> = {}, text?: string): SVGElement {
  const element = document.createElementNS(svgNamespace, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  if (text !== undefined) element.textContent = text;
  return element;
}

export interface Axis {
  label: string;
  from: number;
  to: number;
  log?: boolean;
  ticks?: number[];
  format?: (value: number) => string;
}

export function niceTicks(from: number, to: number, wanted: number): number[] {
  const span = to - from;
  if (!(span > 0)) return [from];
  const raw = span / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999) ?? power * 10;
  const ticks = [];
  for (let t = Math.ceil(from / step - 1e-9); t * step <= to + span * 1e-9; ++t) ticks.push(t * step);
  return ticks;
}

function logTicks(from: number, to: number): number[] {
  const ticks = [];
  for (let p = Math.floor(Math.log10(from)); p <= Math.ceil(Math.log10(to)); ++p) {
    for (const m of to / from > 200 ? [1] : [1, 2, 5]) {
      const t = m * 10 ** p;
      if (t >= from * 0.999 && t <= to * 1.001) ticks.push(t);
    }
  }
  return ticks.length >= 2 ? ticks : niceTicks(from, to, 4);
}

export function tickText(value: number, step: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-5) return value.toExponential(0).replace("e+", "e");
  return value.toFixed(Math.max(0, Math.min(8, Math.ceil(-Math.log10(step) - 1e-9))));
}

export class Plot {
  readonly node: SVGElement;
  readonly left: number;
  readonly right: number;
  readonly top = 10;
  readonly bottom: number;

  constructor(
    readonly width: number,
    readonly height: number,
    readonly xAxis: Axis,
    readonly yAxis: Axis | null,
    title: string,
    left = 52,
  ) {
    this.left = left;
    this.right = width - 14;
    this.bottom = height - 40;
    this.node = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": title, class: "plot" });
    this.drawAxes();
  }

  private share(axis: Axis, value: number): number {
    return axis.log
      ? Math.log(value / axis.from) / Math.log(axis.to / axis.from)
      : (value - axis.from) / (axis.to - axis.from || 1);
  }
  x(value: number): number {
    return this.left + (this.right - this.left) * this.share(this.xAxis, value);
  }
  y(value: number): number {
    return this.yAxis ? this.bottom - (this.bottom - this.top) * this.share(this.yAxis, value) : value;
  }

  private ticksOf(axis: Axis, wanted: number): [number, string][] {
    const ticks = axis.ticks ?? (axis.log ? logTicks(axis.from, axis.to) : niceTicks(axis.from, axis.to, wanted));
    const step = axis.log ? 0 : Math.abs((ticks[1] ?? ticks[0] + 1) - ticks[0]);
    return ticks.map((t) => [t, axis.format ? axis.format(t) : tickText(t, axis.log ? Math.min(1, t) : step)]);
  }

  private drawAxes(): void {
    const { left, right, top, bottom } = this;
    for (const [value, text] of this.ticksOf(this.xAxis, (right - left) / 75)) {
      const x = this.x(value);
      this.add("line", { x1: x, x2: x, y1: top, y2: bottom, class: "grid" });
      this.add("text", { x, y: bottom + 15, class: "tick", "text-anchor": "middle" }, text);
    }
    this.add("text", { x: (left + right) / 2, y: this.height - 6, class: "axis", "text-anchor": "middle" }, this.xAxis.label);
    if (this.yAxis) {
      for (const [value, text] of this.ticksOf(this.yAxis, (bottom - top) / 42)) {
        const y = this.y(value);
        this.add("line", { x1: left, x2: right, y1: y, y2: y, class: "grid" });
        this.add("text", { x: left - 6, y: y + 4, class: "tick", "text-anchor": "end" }, text);
      }
      const middle = (top + bottom) / 2;
      this.add(
        "text",
        { x: 12, y: middle, class: "axis", "text-anchor": "middle", transform: `rotate(-90 12 ${middle})` },
        this.yAxis.label,
      );
    }
    this.add("line", { x1: left, x2: right, y1: bottom, y2: bottom, class: "frame" });
  }

  add(tag: string, attributes: Record<string, string | number>, text?: string, hover?: string): SVGElement {
    const element = svg(tag, attributes, text);
    if (hover !== undefined) element.append(svg("title", {}, hover));
    this.node.append(element);
    return element;
  }

  line(points: [number, number][], attributes: Record<string, string | number>): void {
    const path = points.map(([x, y], i) => `${i ? "L" : "M"}${this.x(x).toFixed(1)} ${this.y(y).toFixed(1)}`).join("");
    this.add("path", { d: path, fill: "none", ...attributes });
  }

  band(points: [number, number, number][], attributes: Record<string, string | number>): void {
    if (points.length < 2) return;
    const upper = points.map(([x, , y]) => `${this.x(x).toFixed(1)} ${this.y(y).toFixed(1)}`);
    const lower = points.map(([x, y]) => `${this.x(x).toFixed(1)} ${this.y(y).toFixed(1)}`).reverse();
    this.add("path", { d: `M${[...upper, ...lower].join("L")}Z`, stroke: "none", ...attributes });
  }

  /** A closed outline, filled. */
  area(points: [number, number][], attributes: Record<string, string | number>): void {
    if (points.length < 3) return;
    const path = points.map(([x, y]) => `${this.x(x).toFixed(1)} ${this.y(y).toFixed(1)}`).join("L");
    this.add("path", { d: `M${path}Z`, stroke: "none", ...attributes });
  }

  /** Shapes differ as well as colours, so that categories survive a grey print. */
  marker(x: number, y: number, shape: number, attributes: Record<string, string | number>, hover: string): SVGElement {
    const [px, py] = [this.x(x), this.y(y)];
    const r = 4;
    const shapes = [
      `M${px - r} ${py}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`,
      `M${px - r} ${py - r}h${2 * r}v${2 * r}h${-2 * r}Z`,
      `M${px} ${py - r * 1.25}L${px + r * 1.2} ${py + r}H${px - r * 1.2}Z`,
      `M${px} ${py - r * 1.35}L${px + r * 1.35} ${py}L${px} ${py + r * 1.35}L${px - r * 1.35} ${py}Z`,
    ];
    return this.add("path", { d: shapes[shape % shapes.length], ...attributes }, undefined, hover);
  }
}

/** from and to with a margin, never empty; zero is included when `zero` is set. */
export function range(values: number[], zero = false, margin = 0.06): { from: number; to: number } {
  const finite = values.filter(Number.isFinite);
  if (finite.length === 0) return { from: 0, to: 1 };
  let from = Math.min(...finite, zero ? 0 : Infinity);
  let to = Math.max(...finite, zero ? 0 : -Infinity);
  if (from === to) {
    const half = Math.abs(from) * 0.1 || 1;
    return { from: from - (zero ? 0 : half), to: to + half };
  }
  const extra = (to - from) * margin;
  if (!(zero && from === 0)) from -= extra;
  if (!(zero && to === 0)) to += extra;
  return { from, to };
}
