/** What the service says of a contact, in words, bars and milliseconds. */

import type { Recognition } from "../contract";
import { bar, byId, make, row, write } from "../dom";
import { degrees, metres, milliseconds, percent, words } from "../units";

const REASONS: Record<string, string> = {
  few_points: "few points: doubt the name",
  end_on: "seen end-on: doubt the length",
  occluded: "partly hidden",
  bow_uncertain: "bow uncertain: it may point the other way",
  out_of_catalogue: "like nothing in the catalogue",
};

/** The answer in one sentence, for those who listen. */
export function sentence(answer: Recognition): string {
  const name = answer.unknown ? `Unknown vessel, nearest ${words(answer.vessel)}` : words(answer.vessel);
  return `${name}, ${percent(answer.probability)}, heading ${degrees(answer.heading)}, rung ${words(answer.rung)}.`;
}

/** Name, reasons, pose and box. */
export function showVerdict(answer: Recognition): void {
  const name = answer.unknown ? "Unknown vessel" : words(answer.vessel);
  const sure = percent(answer.unknown ? (answer.probabilities.unknown ?? 0) : answer.probability);
  const nearest = answer.unknown ? `${sure}, nearest in the catalogue: ${words(answer.vessel)}` : sure;
  const reasons = answer.reasons.map((code) =>
    make("li", { className: "chip", title: code }, REASONS[code] ?? words(code)),
  );
  const trusted = make("li", { className: "chip" }, "nothing speaks against it");
  trusted.dataset.tone = "good";
  for (const chip of reasons) chip.dataset.tone = "warn";
  const rung = answer.rung === "full" ? "full" : `${words(answer.rung)}: ${answer.rung_reason}`;
  const facts: [string, string][] = [
    ["Heading", `${degrees(answer.heading)} ± ${degrees(answer.heading_std)}`],
    ["Bow points there", percent(answer.bow_probability)],
    ["Aspect", `${answer.aspect_deg.toFixed(1)}°`],
    ...(answer.true_heading_deg === null
      ? []
      : [["True heading", `${answer.true_heading_deg.toFixed(1)}°`] as [string, string]]),
    ["Range", metres(Math.hypot(answer.box.center[0], answer.box.center[1]))],
    [
      "Length × beam × height",
      `${answer.box.length.toFixed(1)} × ${answer.box.beam.toFixed(1)} × ${answer.box.height.toFixed(1)} m`,
    ],
    ["Points", `${answer.measured_points} measured, ${answer.inferred_points} inferred`],
    ["Rung", rung],
  ];
  const list = make("dl", { className: "facts wide" });
  for (const [key, value] of facts) list.append(make("div", {}, make("dt", {}, key), make("dd", {}, value)));
  byId("verdict").replaceChildren(
    make("h3", { id: "verdict-title" }, name, " ", make("small", {}, nearest)),
    make("ul", { className: "chips" }, ...(reasons.length ? reasons : [trusted])),
    list,
  );
  byId("verdict").hidden = false;
}

/** A bar for each vessel and for unknown, the most probable first. */
export function showClasses({ probabilities, unknown, vessel }: Recognition): void {
  const chosen = unknown ? "unknown" : vessel;
  const sorted = Object.entries(probabilities).sort(([, a], [, b]) => b - a);
  const rows = sorted.map(([name, probability]) => {
    const made = row(
      words(name),
      bar({ share: probability, className: name === chosen ? "median" : "tail" }),
      percent(probability),
    );
    if (name === chosen) made.className = "chosen";
    return made;
  });
  const caption = make("caption", { className: "hidden" }, "Probability of each vessel");
  byId("classes").replaceChildren(make("table", {}, caption, make("tbody", {}, ...rows)));
}

/** Milliseconds of each stage, and of all against the budget. */
export function showTimes(answer: Recognition, budgetMs: number, roundTripMs: number): void {
  const stages = Object.entries(answer.stage_ms);
  const total = stages.reduce((sum, [, value]) => sum + value, 0);
  const longest = Math.max(...stages.map(([, value]) => value)) || 1;
  const rows = stages.map(([name, value]) =>
    row(
      words(name),
      bar({ share: value / longest, className: "median" }),
      milliseconds(value),
      percent(value / budgetMs),
    ),
  );
  const heads = ["Stage", "", "Time", "Of the budget"].map((text) =>
    make("th", { scope: "col", className: text.startsWith("S") ? "" : "number" }, text),
  );
  heads[1]?.replaceChildren(make("span", { className: "hidden" }, "Bar"));
  byId("times").replaceChildren(
    make("table", {}, make("thead", {}, make("tr", {}, ...heads)), make("tbody", {}, ...rows)),
  );
  const whole = Math.max(budgetMs, total);
  const parts = stages.map(([, value]) => ({ share: value / whole, className: "part" }));
  byId("times-bar").replaceChildren(...bar(...parts).childNodes);
  const spent = `${milliseconds(total)} of the budget of ${milliseconds(budgetMs)}`;
  write("times-sum", `${spent}; ${milliseconds(roundTripMs)} there and back. The bar is the budget.`);
}
