// SPDX-License-Identifier: Apache-2.0
// Turns vite's single file into the template: script at the end of the body, a policy that lets only this very script run,
// licences of what is inside, and the hash of the sources by which a test sees that the template is not stale.
import { createHash } from "node:crypto";
import { readFileSync, writeFileSync } from "node:fs";
import { sourceHash } from "./source_hash.mjs";

const [input, output] = process.argv.slice(2);
let page = readFileSync(input, "utf8");

const opening = '<script type="module" crossorigin>';
const begin = page.indexOf(opening);
const end = page.indexOf("</script>", begin);
if (begin < 0 || end < 0) throw new Error("vite's output has no inline module script");
const script = page.slice(begin + opening.length, end);
page = page.slice(0, begin) + page.slice(end + "</script>".length);

const scriptHash = createHash("sha256").update(script).digest("base64");
const licences = ["three"].map((name) => {
  const version = JSON.parse(readFileSync(`node_modules/${name}/package.json`, "utf8")).version;
  return `${name} ${version}\n${readFileSync(`node_modules/${name}/LICENSE`, "utf8").trim()}`;
});
const place = (mark, text) => {
  if (!page.includes(mark)) throw new Error(`index.html has no ${mark}`);
  page = page.replace(mark, () => text);
};
place(
  "<!--palpate:policy-->",
  `<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'sha256-${scriptHash}'; ` +
    `style-src 'unsafe-inline'; img-src data: blob:">` +
    `<meta name="palpate-viewer-source" content="${sourceHash()}">`,
);
place("<!--palpate:licences-->", `<!--\nThis page contains:\n${licences.join("\n\n").replaceAll("--", "- -")}\n-->`);
place("</body>", `<script type="module">${script}</script></body>`);
if (!page.includes("<!--palpate:data-->")) throw new Error("index.html has no place for data");
writeFileSync(output, page);
console.log(`${output}: ${(page.length / 1024).toFixed(0)} kB`);
