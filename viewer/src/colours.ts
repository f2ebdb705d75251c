// SPDX-License-Identifier: Apache-2.0
// Colour maps that stay readable with colour-blind eyes and in grey: viridis (Smith, van der Walt) for sizes, and a blue to
// orange map with a light middle for signed values. Categories: Okabe and Ito.

export type Rgb = [number, number, number];

const viridis: Rgb[] = [
  [68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141],
  [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37],
];
const signed: Rgb[] = [
  [5, 58, 120], [33, 113, 181], [107, 174, 214], [198, 219, 239], [244, 244, 240],
  [253, 216, 176], [246, 148, 64], [204, 90, 12], [127, 39, 4],
];

function sample(map: Rgb[], share: number): Rgb {
  const at = Math.min(Math.max(share, 0), 1) * (map.length - 1);
  const i = Math.min(Math.floor(at), map.length - 2);
  const t = at - i;
  return [0, 1, 2].map((k) => map[i][k] * (1 - t) + map[i + 1][k] * t) as Rgb;
}

export const sizeColour = (share: number): Rgb => sample(viridis, share);
/** share in -1..1 */
export const signedColour = (share: number): Rgb => sample(signed, (share + 1) / 2);
export const unseen: Rgb = [150, 154, 160];

export function gradient(kind: "size" | "signed"): string {
  const map = kind === "size" ? viridis : signed;
  return `linear-gradient(to right, ${map.map((c) => `rgb(${c.join(",")})`).join(",")})`;
}

const okabeIto = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
export const category = (i: number): string => okabeIto[i % okabeIto.length];
