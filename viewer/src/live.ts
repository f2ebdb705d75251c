// SPDX-License-Identifier: Apache-2.0
// The page while the work goes on: asks the program that serves it how far it is, and for data whenever there are new ones.
import { decode, type Report } from "./data";
import { duration, el } from "./words";

interface State {
  title: string;
  stage: string;
  share: number;
  time_left_s: number | null;
  version: number;
  finished: boolean;
  message: string;
}

const pause_ms = 700;
const misses_before_a_word = 3;

/** Keeps the page up to date until the program says that it has finished, or is gone. */
export async function watch(page: HTMLElement, show: (report: Report) => void): Promise<void> {
  const bar = el("progress", { max: "1", "aria-label": "Share done" });
  const words = el("span", { class: "live-words" }, "Waiting for the program \u2026");
  const banner = el("div", { id: "live", role: "status" }, words, bar);
  page.append(banner);
  let version = 0;
  let misses = 0;
  for (;;) {
    try {
      const state = (await (await ask("state")).json()) as State;
      misses = 0;
      if (state.version !== version) {
        const report = decode(await (await ask("data")).text());
        version = state.version;
        show(report);
      }
      banner.dataset.finished = String(state.finished);
      banner.classList.remove("lost");
      bar.value = state.finished ? 1 : state.share;
      words.textContent = say(state);
      if (version === 0) document.title = `${state.title} \u2013 palpate`;
      if (state.finished) return void bar.remove();
    } catch {
      if (++misses === misses_before_a_word) {
        banner.classList.add("lost");
        words.textContent = "The program that serves this page cannot be reached any more. What stands below is the last that it said.";
        bar.removeAttribute("value");
      }
    }
    await new Promise((done) => setTimeout(done, misses < misses_before_a_word ? pause_ms : 5 * pause_ms));
  }
}

async function ask(what: string): Promise<Response> {
  const answer = await fetch(what, { cache: "no-store" });
  if (!answer.ok) throw new Error(`${what}: ${answer.status}`);
  return answer;
}

function say(state: State): string {
  if (state.finished) return state.message;
  const left = state.time_left_s === null ? "" : `, about ${duration(state.time_left_s)} left`;
  return `Running: ${state.stage}, ${Math.round(100 * state.share)} %${left}`;
}
