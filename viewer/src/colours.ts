// SPDX-License-Identifier: Apache-2.0
// Colour maps that stay readable with colour-blind eyes and in grey: pale to dark blue for sizes (lightness falls all the way),
// blue to orange with a light middle for signed values. Categories: Okabe and Ito.

export type Rgb = [number, number, number];

const sizes: Rgb[] = [
  [238, 241, 242], [196, 226, 216], [142, 205, 196], [84, 176, 188], [45, 139, 176], [30, 98, 154], [29, 58, 120], [27, 27, 78],
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

export const sizeColour = (share: number): Rgb => sample(sizes, share);
/** share in -1..1 */
export const signedColour = (share: number): Rgb => sample(signed, (share + 1) / 2);
/** Observed points where colour does not carry their residual: apart from every shade of the size map. */
export const observed: Rgb = [217, 84, 0];
export const unseen: Rgb = [150, 154, 160];

export function gradient(kind: "size" | "signed"): string {
  const map = kind === "size" ? sizes : signed;
  return `linear-gradient(to right, ${map.map((c) => `rgb(${c.join(",")})`).join(",")})`;
}

const okabeIto = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
export const category = (i: number): string => okabeIto[i % okabeIto.length];
