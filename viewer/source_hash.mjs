// SPDX-License-Identifier: Apache-2.0
// One hash over everything that the template is made of.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));

/** The same as tests/report/template_test.cmake computes: SHA-256 over the concatenated SHA-256 of each file, in order of name. */
export function sourceHash() {
  const files = readdirSync(join(here, "src"))
    .filter((name) => /\.(ts|css|html)$/.test(name))
    .sort()
    .map((name) => join(here, "src", name));
  files.push(join(here, "finish.mjs"), join(here, "package-lock.json"), join(here, "vite.config.mjs"));
  const hashes = files.map((file) => createHash("sha256").update(readFileSync(file)).digest("hex"));
  return createHash("sha256").update(hashes.join("")).digest("hex");
}
