// SPDX-License-Identifier: Apache-2.0
// Numbers with units, as palpate/report/words.cpp prints them, and small builders of elements. Text from the recording only
// ever becomes a text node.
import type { Num } from "./data";

export interface Scaled {
  factor: number;
  unit: string;
}

export function prefix(magnitude: number, unit: string): Scaled {
  if (unit === "Pa") {
    if (magnitude >= 1e9) return { factor: 1e-9, unit: "GPa" };
    if (magnitude >= 1e6) return { factor: 1e-6, unit: "MPa" };
    if (magnitude >= 1e3) return { factor: 1e-3, unit: "kPa" };
    return { factor: 1, unit: "Pa" };
  }
  if (unit === "m") {
    if (magnitude >= 1 || magnitude === 0) return { factor: 1, unit: "m" };
    if (magnitude >= 1e-4) return { factor: 1e3, unit: "mm" };
    return { factor: 1e6, unit: "\u00b5m" };
  }
  if (unit === "rad") return { factor: 180 / Math.PI, unit: "\u00b0" };
  if (unit === "1" || unit === "-") return { factor: 1, unit: "" };
  return { factor: 1, unit };
}

export function known(value: Num | undefined): value is number {
  return typeof value === "number" && Number.isFinite(value);
}

/** Three significant digits without an exponent. */
export function digits(value: number, significant = 3): string {
  if (value === 0) return "0";
  const decimals = Math.max(0, significant - 1 - Math.floor(Math.log10(Math.abs(value))));
  return value.toFixed(Math.min(decimals, 8));
}

export function quantity(value: Num | undefined, unit: string, significant = 3): string {
  if (!known(value)) return "unknown";
  const scaled = prefix(Math.abs(value), unit);
  const text = digits(value * scaled.factor, significant);
  return scaled.unit ? `${text}\u202f${scaled.unit}` : text;
}

export function count(value: number): string {
  return value.toLocaleString("en-US").replaceAll(",", "\u202f");
}

/** "12 s", "3 min 20 s", as cli/session.cpp says it. */
export function duration(seconds: number): string {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  const two = (v: number): string => String(v).padStart(2, "0");
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${two(whole % 60)} s`;
  return `${Math.floor(whole / 3600)} h ${two(Math.floor((whole % 3600) / 60))} min`;
}

export function plural(value: number, word: string): string {
  return `${count(value)} ${word}${value === 1 ? "" : word.endsWith("sh") ? "es" : "s"}`;
}

type Child = Node | string | null;

export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, string> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  for (const child of children) if (child !== null) element.append(child);
  return element;
}

/** A number that a program can read back in full: <data value="20012.3">20.0 kPa</data>. */
export function datum(value: Num, text: string, key: string): HTMLElement {
  return el("data", { value: known(value) ? String(value) : "", "data-key": key }, text);
}
