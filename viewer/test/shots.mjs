// SPDX-License-Identifier: Apache-2.0
// usage: node shots.mjs REPORT.html FOLDER     pictures of the page: light, dark, phone
import { mkdirSync } from "node:fs";
import { join, resolve } from "node:path";
import { withPage } from "./browser.mjs";

const [file, folder] = process.argv.slice(2);
mkdirSync(folder, { recursive: true });
const shots = [
  ["light", { viewport: { width: 1200, height: 900 } }],
  ["dark", { viewport: { width: 1200, height: 900 }, colorScheme: "dark" }],
  ["phone", { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2 }],
];
for (const [name, context] of shots) {
  await withPage(resolve(file), context, async (page) => {
    await page.waitForTimeout(500);
    await page.screenshot({ path: join(folder, `${name}.png`), fullPage: true });
  });
}
