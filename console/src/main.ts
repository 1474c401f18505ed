/** The page: which view is shown, whether the service is there, and one beat a second. */

import { paintBench, recoverBench, startBench } from "./bench/bench";
import type { Model } from "./contract";
import { byId, make, write } from "./dom";
import { paintLive, readLive, showLive, showModel } from "./live/live";
import { json, Problem, Unreachable } from "./service";
import { followTheme } from "./theme";
import { clock } from "./units";

const BEAT_MS = 1000;
const MODEL_BEATS = 5; // from one look at which bundle runs to the next
const VIEWS = ["live", "bench"];

let model: Model | null = null;
let beats = 0;
let lostAt: Date | null = null;
let waiting: ReturnType<typeof setTimeout> | undefined;

function view(): string {
  const named = location.hash.slice(1);
  return VIEWS.includes(named) ? named : "live";
}

function showView(): void {
  for (const name of VIEWS) byId(`${name}-view`).hidden = name !== view();
  for (const link of document.querySelectorAll<HTMLAnchorElement>("nav a")) {
    if (link.dataset.view === view()) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  document.title = `${view() === "live" ? "Live" : "Bench"} – Shipshape console`;
  paintLive();
  paintBench();
}

/** Reads the service once, then again a beat later, for as long as somebody looks. */
async function beat(): Promise<void> {
  clearTimeout(waiting);
  try {
    await look();
    if (lostAt) recoverBench();
    lostAt = null;
    byId("lost").hidden = true;
  } catch (error) {
    if (error instanceof Unreachable) showLost();
    else if (error instanceof Problem) showRefusal(error);
    else throw error;
  } finally {
    if (!document.hidden && !tokenIsMissing()) waiting = setTimeout(beat, BEAT_MS);
  }
}

async function look(): Promise<void> {
  const state = await readState();
  showState(state.ready ? "good" : "warn", state.said);
  if (!state.ready && !model) return; // before the first model there is nothing to show
  if (!model || (state.ready && beats++ % MODEL_BEATS === 0)) await readModel();
  if (model && view() === "live") {
    await readLive();
    showLive(model);
  }
}

async function readState(): Promise<{ ready: boolean; said: string }> {
  try {
    await json("readyz");
    return { ready: true, said: "Ready" };
  } catch (error) {
    if (!(error instanceof Problem) || error.status !== 503) throw error;
    const state = /one that is (\w+)$/.exec(error.message)?.[1] ?? "not ready";
    return { ready: false, said: state.charAt(0).toUpperCase() + state.slice(1) };
  }
}

async function readModel(): Promise<void> {
  const read = await json<Model>("v1/model");
  if (read.bundle !== model?.bundle || read.version !== model.version) {
    showModel(read);
    write("bundle", `${read.bundle_name} · ${read.bundle.slice(0, 8)}`);
  }
  if (!model) startBench(read);
  model = read;
}

function showState(tone: string, said: string): void {
  byId("state").dataset.tone = tone;
  const text = byId("state").lastElementChild;
  if (text && text.textContent !== said) text.textContent = said;
}

function showLost(): void {
  lostAt ??= new Date();
  showState("bad", "No connection");
  const since = clock(lostAt);
  write(
    "lost",
    `No connection to the service since ${since}. What you see is from before; it is tried again every second.`,
  );
  byId("lost").hidden = false;
}

function tokenIsMissing(): boolean {
  return byId("lost").querySelector("button") !== null && !byId("lost").hidden;
}

function showRefusal(problem: Problem): void {
  byId("lost").hidden = false;
  if (problem.status !== 401) {
    write("lost", problem.message);
    return;
  }
  showState("warn", "Token needed");
  const again = make("button", { type: "button" }, "Give a token");
  again.addEventListener("click", () => {
    byId("lost").hidden = true;
    void beat();
  });
  byId("lost").replaceChildren("This service answers only those who have a token. ", again);
}

window.addEventListener("hashchange", () => {
  showView();
  void beat();
});
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) void beat();
});
byId("window").addEventListener("change", () => model && showLive(model));
followTheme(() => {
  paintLive();
  paintBench();
});
showView();
void beat();
