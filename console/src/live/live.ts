/** The live view: what the service does now, against its latency budget. */

import type { Capacity, Model } from "../contract";
import { bar, byId, make, row, write } from "../dom";
import { json, text } from "../service";
import { digits, metres, milliseconds, percent, rate, words } from "../units";
import { Chart } from "./charts";
import { History, READ, type Span, type StageSpan } from "./history";
import { Scrape } from "./metrics";

const CHART_S = 5; // each point of a line is over so many seconds

const history = new History();
const latency = new Chart("latency", " ms", [
  { label: "99th percentile", tone: "measured" },
  { label: "Median", tone: "inferred" },
  { label: "Budget", tone: "alarm", dash: [6, 5] },
]);
const traffic = new Chart("traffic", "", [
  { label: "Answered", tone: "inferred" },
  { label: "Of them degraded", tone: "measured" },
  { label: "Refused or failed", tone: "alarm", dash: [2, 4] },
]);

/** Reads the service once more; raises as `call`. */
export async function readLive(): Promise<void> {
  const points = byId<HTMLInputElement>("promise-points");
  const asked = new URLSearchParams({
    points: points.checkValidity() && points.value ? points.value : "300",
    lane: byId<HTMLSelectElement>("promise-lane").value,
  });
  const [metrics, capacity] = await Promise.all([text("metrics"), json<Capacity>(`v1/capacity?${asked}`)]);
  history.add(new Scrape(performance.now() / 1e3, metrics, READ));
  const recent = history.span(CHART_S);
  latency.add(Date.now() / 1e3, [recent?.p99 ?? null, recent?.p50 ?? null, capacity.budget.budget_ms]);
  traffic.add(Date.now() / 1e3, [recent?.answered ?? null, recent?.degraded ?? null, recent?.refused ?? null]);
  showBudget(capacity);
  showPromises(capacity);
}

/** Writes what was read into the page. */
export function showLive(model: Model): void {
  const seconds = Number(byId<HTMLSelectElement>("window").value);
  const span = history.span(seconds);
  if (span) showSpan(span, model.limits.budget_ms);
  showStages(history.stages(seconds, model.stages), model.limits.budget_ms);
}

/** Draws the charts in the colours of the theme. */
export function paintLive(): void {
  latency.paint();
  traffic.paint();
}

/** Which bundle runs, and what it knows. */
export function showModel(model: Model): void {
  const facts = byId("bundle-facts");
  facts.replaceChildren();
  for (const [name, value] of [
    ["Bundle", model.bundle_name],
    ["Digest", model.bundle],
    ["Version", model.version],
    ["Deadline, if none is given", milliseconds(model.limits.default_timeout_ms)],
    ["Most points of a contact", String(model.limits.max_points)],
  ] as const) {
    facts.append(make("dt", {}, name), make("dd", {}, value));
  }
  const vessels = model.catalogue.map(({ name, length, beam, height }) =>
    row(words(name), metres(length), metres(beam), metres(height)),
  );
  byId("catalogue").replaceChildren(...vessels);
}

function showSpan(span: Span, budgetMs: number): void {
  write("tile-p99", milliseconds(span.p99));
  write("tile-p50", span.p50 === null ? "nothing answered" : `median ${milliseconds(span.p50)}`);
  tone("tile-p99", span.p99 !== null && span.p99 > budgetMs ? "bad" : "");
  write("tile-rate", rate(span.answered));
  write(
    "tile-degraded",
    span.degraded > 0 ? `${rate(span.degraded)} on a lower rung` : "contacts, all on rung full",
  );
  write("tile-refused", rate(span.refused));
  const why = span.reasons.map(([kind, value]) => `${words(kind)} ${digits(value)}`);
  write("tile-why", why.join(", ") || "none");
  tone("tile-refused", span.refused > 0 ? "warn" : "");
}

function showBudget({ budget, queue_depth, running, workers }: Capacity): void {
  write("tile-queue", `${queue_depth}`);
  write("tile-workers", `${running} of ${workers} ${workers === 1 ? "worker" : "workers"} busy`);
  const said = { ok: "Held", warn: "One was late", error: "Not held" }[budget.level];
  write("tile-budget", said);
  tone("tile-budget", { ok: "good", warn: "warn", error: "bad" }[budget.level]);
  const asked = budget.good + budget.bad;
  const held = asked ? `${percent(budget.good / asked)} of ${asked} since the start` : "nothing asked yet";
  write("tile-held", `${milliseconds(budget.budget_ms)}; ${held}`);
  const burn = budget.burn["5m"] ?? 0;
  write("tile-burn", `${digits(burn)} ×`);
  tone("tile-burn", burn > 1 ? "bad" : "");
  write("tile-burn-hour", `1 h: ${digits(budget.burn["1h"] ?? 0)} ×; 1 is as fast as allowed`);
}

function showPromises({ promises, wait_ms, budget }: Capacity): void {
  const rows = promises.map(({ rung, milliseconds: promised }) => {
    const className = promised > budget.budget_ms ? "over" : "median";
    return row(words(rung), bar({ share: promised / budget.budget_ms, className }), milliseconds(promised));
  });
  byId("promise-rows").replaceChildren(...rows);
  write("promise-wait", `${milliseconds(wait_ms)} of that until a worker is free; the whole bar is the budget.`);
}

function showStages(spans: StageSpan[], budgetMs: number): void {
  const longest = Math.max(...spans.map(({ p99 }) => p99 ?? 0)) || 1;
  const rows = spans.map(({ stage, p50, p99, mean, rate: runs }) => {
    const median = (p50 ?? 0) / longest;
    const bars = bar(
      { share: median, className: "median" },
      { share: (p99 ?? 0) / longest - median, className: "tail" },
    );
    const share = p99 === null ? "–" : percent(p99 / budgetMs);
    return row(words(stage), bars, milliseconds(p50), milliseconds(p99), milliseconds(mean), share, rate(runs));
  });
  byId("stages-rows").replaceChildren(...rows);
  const means = spans.map(({ mean }) => mean ?? 0);
  const total = means.reduce((sum, mean) => sum + mean, 0);
  const whole = Math.max(budgetMs, total);
  byId("stages-bar").replaceChildren(
    ...bar(...means.map((mean) => ({ share: mean / whole, className: "part" }))).childNodes,
  );
  const said = `On average ${milliseconds(total)} of the budget of ${milliseconds(budgetMs)}; the bar is the budget.`;
  write("stages-sum", total ? said : "Nothing ran in this time.");
}

function tone(id: string, name: string): void {
  byId(id).dataset.tone = name;
}
