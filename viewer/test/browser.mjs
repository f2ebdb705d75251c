// SPDX-License-Identifier: Apache-2.0
// Chromium without a window, with WebGL drawn by software.
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

const quiet = [
  "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync",
];
const software = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];

/** Opens a page file (or the address that `file()` gives once the browser runs), hands it and what it complained about to `use`, and cleans up. */
export async function withPage(file, { webgl = true, ...context } = {}, use) {
  const live = typeof file === "function";
  const profile = mkdtempSync(join(tmpdir(), "palpate-browser-"));
  const browser = await chromium.launchPersistentContext(profile, {
    executablePath: process.env.PALPATE_CHROMIUM ?? "/usr/bin/chromium",
    headless: true,
    args: [...quiet, ...(webgl ? software : ["--disable-3d-apis"])],
    offline: !live,
    viewport: { width: 1200, height: 900 },
    ...context,
  });
  const complaints = [];
  try {
    const page = await browser.newPage();
    const address = live ? await file() : `file://${file}`;
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(message.text()));
    page.on("pageerror", (error) => complaints.push(String(error)));
    page.on("request", (request) => {
      const own = live ? request.url().startsWith(address) : /^file:/.test(request.url());
      if (!own && !/^(data|blob):/.test(request.url())) complaints.push(`asked for ${request.url()}`);
    });
    await page.goto(address);
    await page.waitForSelector("html[data-ready=true]", { timeout: 120000 });
    return await use(page, complaints);
  } finally {
    await browser.close();
    rmSync(profile, { recursive: true, force: true });
  }
}
