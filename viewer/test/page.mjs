// SPDX-License-Identifier: Apache-2.0
// usage: node page.mjs CHECK REPORT.html     exit code 0: holds
//        node page.mjs live RESULT.json COMMAND...     starts the command, and looks at the address that it prints
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { resolve } from "node:path";
import { withPage } from "./browser.mjs";

const dataOf = (page) => page.evaluate(() => JSON.parse(document.getElementById("palpate-data").textContent));
const settled = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done()))));

// SwiftShader's own notices about reading pixels back are not the page's fault.
const real = (complaints) => complaints.filter((text) => !/GPU stall due to ReadPixels|software WebGL|SwiftShader|GL Driver Message/i.test(text));

async function numbersAgree(page) {
  const data = await dataOf(page);
  for (const p of data.parameters) {
    const card = page.locator(`.card[data-name="${p.name}"]`).first();
    assert.equal(Number(await card.locator('data[data-key="value"]').getAttribute("value")), p.value, p.name);
    const shown = await card.locator('data[data-key="value"]').textContent();
    assert.ok(data.answer.includes(shown.trim()), `card says ${shown}, the sentence says ${data.answer}`);
  }
  assert.equal(await page.locator(".lead").textContent(), data.answer);
  assert.equal(Number(await page.locator('data[data-key="rms_m"]').getAttribute("value")), data.fit.rms_m);
  assert.equal(await page.locator(".verdicts li").count(), data.verdicts.length + (data.converged ? 0 : 1));
}

const checks = {
  async whole(file) {
    await withPage(file, {}, async (page, complaints) => {
      await numbersAgree(page);
      const canvas = page.locator(".view canvas");
      const slider = page.getByRole("slider", { name: "Step" });
      await slider.fill(await slider.getAttribute("max"));
      await settled(page);
      const last = await canvas.screenshot();
      await slider.focus();
      for (let i = 0; i < 5; ++i) await page.keyboard.press("ArrowLeft");
      await settled(page);
      const earlier = await canvas.screenshot();
      assert.ok(!last.equals(earlier), "the slider does not change the picture");
      await page.locator('[data-mode="residual"]').click();
      await settled(page);
      assert.ok(!earlier.equals(await canvas.screenshot()), "colours do not change the picture");
      const data = await dataOf(page);
      const legend = Number(await page.locator('[data-key="legend-max"]').textContent());
      assert.ok(Math.abs(legend / 1000 / data.residual_scale_m - 1) < 0.01, `legend ends at ${legend}, data at ${data.residual_scale_m}`);
      await page.locator('[data-mode="stress"]').click();
      await settled(page);
      assert.equal(await page.locator(".legend-title").textContent(), "von Mises stress (kPa)");
      assert.ok(Math.abs(Number(await page.locator('[data-key="legend-max"]').textContent()) * 1000 / data.stress_scale_pa - 1) < 0.01);
      for (const shown of ["masked", "mesh", "push"]) {
        const before = await canvas.screenshot();
        await page.locator(`[data-show="${shown}"]`).click();
        await settled(page);
        assert.ok(!before.equals(await canvas.screenshot()), `switching ${shown} does not change the picture`);
      }
      assert.equal(Number(await slider.getAttribute("max")), data.steps.length - 1, "the slider does not reach over all pushes");
      await slider.fill("0");
      assert.equal(await page.getByRole("combobox", { name: "Push" }).inputValue(), "0");
      assert.ok((await page.locator(".plot .band").count()) > 0, "force against travel has no band");
      await page.locator('[data-mode="displacement"]').click();
      const deepest = Math.max(...data.steps.map((s) => s.travel_m));
      const reach = Number(await page.locator('[data-key="legend-max"]').textContent()) / 1000;
      assert.ok(reach >= 0.99 * deepest && reach < 1.3 * deepest, `displacement legend ends at ${reach}, travel is ${deepest}`);
      // A click on a measured point selects its step.
      await page.locator(".plot .point").nth(1).dispatchEvent("click"); // the marks of two pushes may overlap
      assert.match(await page.locator(".readout").textContent(), new RegExp(`^step ${data.steps[1].step} `));
      for (const name of ["Force against travel", "What the data say", "Residuals", "Error budget", "Nuisances", "Convergence", "Each push", "Each site"]) {
        assert.ok((await page.locator("figure h3", { hasText: name }).count()) > 0, `no figure ${name}`);
      }
      // Paper unfolds what the screen folds.
      await page.evaluate(() => window.dispatchEvent(new Event("beforeprint")));
      assert.equal(await page.locator("#provenance details").evaluate((node) => node.open), true);
      await page.emulateMedia({ media: "print" });
      assert.equal(await page.locator(".toggles").isVisible(), false);
      assert.equal(await page.evaluate(() => getComputedStyle(document.body).backgroundColor), "rgb(255, 255, 255)");
      await page.emulateMedia({ media: "screen" });
      await page.setViewportSize({ width: 360, height: 780 });
      await settled(page);
      const wide = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(wide <= 360, `the page is ${wide} pixels wide on a phone of 360`);
      assert.deepEqual(real(complaints), []);
    });
  },

  async without_webgl(file) {
    await withPage(file, { webgl: false }, async (page, complaints) => {
      await page.getByText("no WebGL").waitFor();
      await numbersAgree(page);
      assert.ok((await page.locator("figure svg").count()) >= 5, "figures are missing");
      for (const part of [".legend", ".choices", ".toggles"])
        assert.equal(await page.locator(`#object ${part}`).count(), 0, `${part} belongs to the picture that is missing`);
      const scripted = complaints.filter((text) => !/WebGL/i.test(text));
      assert.deepEqual(scripted, []);
    });
  },

  async hostile(file) {
    await withPage(file, {}, async (page, complaints) => {
      await numbersAgree(page);
      assert.equal(await page.evaluate(() => window.hacked), undefined);
      assert.equal(await page.locator("img").count(), 0);
      for (const width of [1200, 360]) {
        await page.setViewportSize({ width, height: 800 });
        await settled(page);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(wide <= width, `the page is ${wide} pixels wide on ${width}`);
      }
      assert.deepEqual(real(complaints), []);
    });
  },

  async speed(file) {
    await withPage(file, {}, async (page, complaints) => {
      assert.ok((await page.locator(".note", { hasText: "triangles" }).count()) > 0, "thinning is not said");
      const framesASecond = () => page.evaluate(async () => {
        const canvas = document.querySelector(".view canvas");
        const frame = () => new Promise((done) => requestAnimationFrame(done));
        const turn = async (milliseconds) => {
          const [start, first] = [performance.now(), Number(canvas.dataset.frames)];
          while (performance.now() - start < milliseconds) {
            canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
            await frame();
          }
          return ((Number(canvas.dataset.frames) - first) / (performance.now() - start)) * 1000;
        };
        await turn(1000); // lets the page find its pace
        return turn(2500);
      });
      // How fast is a benchmark's business (docs/benchmarks.md); here, that turning draws at all.
      const rate = await framesASecond();
      console.log(`${rate.toFixed(1)} frames a second`);
      assert.ok(rate > 0, "turning the object draws nothing");
      assert.deepEqual(real(complaints), []);
    });
  },
};

/** The page of a running estimate: looked at from its first estimate to its end. */
async function live(result, command) {
  let ended;
  // The browser takes seconds to start; the program begins when it is there.
  const start = () => new Promise((found, fail) => {
    const program = spawn(command[0], command.slice(1), { stdio: ["ignore", "inherit", "pipe"] });
    let said = "";
    program.stderr.on("data", (text) => {
      process.stderr.write(text);
      const address = /(http:\S+)\s/.exec((said += text));
      if (address) found(address[1]);
    });
    ended = new Promise((done) => program.on("close", done));
    ended.then((code) => fail(new Error(`the program ended with ${code} and named no address`)));
  });
  await withPage(start, {}, async (page, complaints) => {
    const lead = () => page.locator(".lead").textContent();
    assert.match(await lead(), /^So far: Young's modulus /);
    assert.ok(!existsSync(result), "the first estimate was shown after the end");
    assert.match(await page.locator("#live").textContent(), /^Running: .+ \d+ %/);
    const canvas = page.locator(".view canvas");
    await page.locator('[data-show="cloud"]').uncheck();
    await settled(page);
    const slider = page.getByRole("slider", { name: "Step" });
    const last = await canvas.screenshot();
    await slider.fill("0");
    await settled(page);
    assert.ok(!last.equals(await canvas.screenshot()), "the slider does not change the picture");
    await page.evaluate(() => (document.querySelector(".view canvas").dataset.mark = "mine"));

    await page.waitForSelector('#live[data-finished="true"]', { timeout: 240000 });
    const answer = JSON.parse(readFileSync(result, "utf8"));
    for (const p of answer.parameters) {
      const card = page.locator(`.card[data-name="${p.name}"]`).first();
      assert.equal(Number(await card.locator('data[data-key="value"]').getAttribute("value")), p.value, p.name);
      assert.equal(Number(await card.locator('data[data-key="interval"]').getAttribute("value")), p.lower_95, p.name);
    }
    assert.match(await lead(), /^Young's modulus is .+ \(95 % interval /);
    // What the reader has chosen outlives the updates.
    assert.equal(await page.locator(".view canvas").getAttribute("data-mark"), "mine");
    assert.equal(await slider.inputValue(), "0");
    assert.equal(await page.locator('[data-show="cloud"]').isChecked(), false);
    for (const name of ["What the data say", "Convergence", "Error budget"]) {
      assert.ok((await page.locator("figure h3", { hasText: name }).count()) > 0, `no figure ${name}`);
    }
    assert.deepEqual(real(complaints), []);
    assert.equal(await ended, 0); // by itself, once the page has everything
  });
}

const [name, file, ...command] = process.argv.slice(2);
await (name === "live" ? live(resolve(file), command) : checks[name](resolve(file)));
