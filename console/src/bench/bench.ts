/** The bench: one cluster, chosen by the user, through the running service. */

import type { Model, Recognition } from "../contract";
import { byId, make, write } from "../dom";
import { call, Problem } from "../service";
import { milliseconds } from "../units";
import { drawAbove } from "./above";
import { type Cluster, partsOf } from "./clouds";
import { type ClusterFile, readClusters } from "./files";
import { countLayers, isShown, startLayers } from "./layers";
import { showPictures } from "./pictures";
import { type Sent, showRepeat, startRepeat } from "./repeat";
import { leaveSamples, showSamples } from "./samples";
import type { Look, Scene3d } from "./scene";
import { sentence, showClasses, showTimes, showVerdict } from "./verdict";

const narrow = window.matchMedia("(max-width: 860px)"); // as in style.css
const SLACK_MS = 10_000; // after the deadline, for an answer that is on its way

let model: Model;
let scene: Scene3d | null = null;
let opened: ClusterFile | null = null;
let cluster: Cluster | null = null;
let answer: Recognition | null = null;
let shown: Cluster | null = null; // in 3D; another one moves the camera
let turn = 0; // an answer to an older request must not replace a newer one

/** Makes the bench work, once the service said what it runs. */
export function startBench(running: Model): void {
  model = running;
  byId<HTMLInputElement>("timeout").placeholder = String(running.limits.default_timeout_ms);
  startLayers(repaint);
  startRepeat();
  startChoosing();
  const preset = byId<HTMLSelectElement>("preset");
  preset.addEventListener("change", () => {
    byId<HTMLSelectElement>("image-method").disabled = preset.value !== "paper";
  });
  byId("ask").addEventListener("submit", (event) => {
    event.preventDefault();
    void recognise();
  });
  for (const button of document.querySelectorAll<HTMLButtonElement>("[data-look]")) {
    button.addEventListener("click", () => scene?.look(button.dataset.look as Look));
  }
  new ResizeObserver(repaint).observe(byId("above"));
}

/** Draws everything in the colours of the theme. */
export function paintBench(): void {
  if (cluster) scene?.show(cluster, answer);
  repaint();
}

/** The connection is back: what told of its loss goes, and what was missed comes. */
export function recoverBench(): void {
  clearProblem();
  if (!byId("samples").childElementCount) offerSamples();
}

function clearProblem(): void {
  byId("problem").hidden = true;
}

function offerSamples(): void {
  showSamples((sample) => choose(sample), showProblem).catch(showProblem);
}

function startChoosing(): void {
  const drop = byId("drop");
  const input = byId<HTMLInputElement>("file");
  input.addEventListener("change", () => {
    const [file] = input.files ?? [];
    if (file) void openFile(file);
    input.value = ""; // the same file may be chosen again
  });
  for (const kind of ["dragenter", "dragover"] as const) {
    drop.addEventListener(kind, (event) => {
      event.preventDefault();
      drop.classList.add("over");
    });
  }
  for (const kind of ["dragleave", "drop"] as const)
    drop.addEventListener(kind, () => drop.classList.remove("over"));
  // Beside the field, a dropped file would replace the page.
  window.addEventListener("dragover", (event) => event.preventDefault());
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    const file = event.dataTransfer?.files[0];
    if (file) void openFile(file);
  });
  byId<HTMLSelectElement>("cluster").addEventListener("change", (event) => {
    chooseOfFile(Number((event.target as HTMLSelectElement).value));
  });
  offerSamples();
}

async function openFile(file: File): Promise<void> {
  try {
    opened = await readClusters(file);
  } catch (error) {
    showProblem(error);
    return;
  }
  leaveSamples();
  const options = opened.clusters.map((points, index) =>
    make("option", { value: String(index) }, `${index + 1}: ${points.length / 3} points`),
  );
  byId("cluster").replaceChildren(...options);
  chooseOfFile(0);
  byId("which").hidden = opened.clusters.length === 1;
}

function chooseOfFile(index: number): void {
  const points = opened?.clusters[index];
  if (!opened || !points) return;
  const name = opened.clusters.length > 1 ? `${opened.name} ${index + 1}` : opened.name;
  choose({ name, points, sensorHeight: null }, false);
}

/** Takes a cluster, shows it as it is, and sends it. */
function choose(chosen: Cluster, fromSamples = true): void {
  if (fromSamples) byId("which").hidden = true;
  if (fromSamples) byId<HTMLInputElement>("height").value = String(chosen.sensorHeight ?? "");
  cluster = chosen;
  byId<HTMLButtonElement>("recognise").disabled = false;
  void recognise();
}

async function recognise(): Promise<void> {
  if (!cluster) return;
  const mine = ++turn;
  const sent = request(cluster);
  clearProblem();
  age(true);
  write("chosen", `${described(cluster)}: asking the service`);
  await show(cluster, null);
  try {
    const started = performance.now();
    const said = await ask(sent);
    if (mine !== turn) return;
    await showAnswer(sent, said, performance.now() - started);
  } catch (error) {
    if (mine === turn) showProblem(error);
    for (const id of ["results", "verdict"]) byId(id).hidden ||= mine === turn; // of another cluster, or another way
  } finally {
    if (mine === turn) write("chosen", described(cluster));
  }
}

function described({ name, points }: Cluster): string {
  return `${name}, ${points.length / 3} points`;
}

/** Fades what was said of the cluster before. */
function age(old: boolean): void {
  for (const id of ["results", "verdict"]) byId(id).classList.toggle("old", old);
}

function request(chosen: Cluster): Sent {
  const value = (id: string) => byId<HTMLInputElement | HTMLSelectElement>(id).value;
  const query = new URLSearchParams({
    preset: value("preset"),
    lane: value("lane"),
    lowest_rung: value("lowest-rung"),
  });
  if (value("preset") === "paper") query.set("image_method", value("image-method"));
  if (value("height")) query.set("sensor_height_m", value("height"));
  if (value("own-heading")) query.set("own_true_heading_deg", value("own-heading"));
  query.set("include_restored", "true");
  query.set("include_images", "true");
  return { cluster: chosen, query, timeoutMs: value("timeout") };
}

async function ask({ cluster: { points }, query, timeoutMs }: Sent): Promise<Recognition> {
  const headers: Record<string, string> = { "Content-Type": "application/octet-stream" };
  if (timeoutMs) headers["Shipshape-Timeout-Ms"] = timeoutMs;
  const patience = Number(timeoutMs || model.limits.default_timeout_ms) + SLACK_MS;
  const init = { method: "POST", headers, body: points.slice() };
  return (await call(`v1/recognise?${query}`, init, patience)).json();
}

async function showAnswer(sent: Sent, said: Recognition, roundTripMs: number): Promise<void> {
  byId("results").hidden = false;
  age(false);
  showVerdict(said);
  reveal("verdict");
  showClasses(said);
  showTimes(said, model.limits.budget_ms, roundTripMs);
  showRepeat(sent, said);
  await Promise.all([showPictures(said), show(sent.cluster, said)]);
  write("said", sentence(said));
}

async function show(chosen: Cluster, said: Recognition | null): Promise<void> {
  const moved = chosen !== shown;
  shown = chosen;
  answer = said;
  const parts = said && partsOf(said, chosen);
  countLayers({
    raw: chosen.points.length / 3,
    measured: (parts?.measured.length ?? 0) / 3,
    inferred: (parts?.inferred.length ?? 0) / 3,
    keypoint: said?.keypoints.length ?? 0,
    ...(said ? {} : { box: 0 }),
  });
  await openScene();
  scene?.show(chosen, said);
  if (moved || said) scene?.look("oblique");
  repaint();
}

async function openScene(): Promise<void> {
  if (scene) return;
  if (document.createElement("canvas").getContext("webgl2")) {
    const { Scene3d: Made } = await import("./scene");
    scene ??= new Made(byId("scene"), isShown);
  } else {
    const text = "This browser draws no 3D: expected WebGL, got none. Everything else works without it.";
    byId("scene").replaceChildren(make("p", { className: "empty" }, text));
  }
}

function repaint(): void {
  scene?.layer();
  if (cluster && answer) drawAbove(cluster, answer);
}

/** On a narrow screen the answer lies below what was asked: moves there. */
function reveal(id: string): void {
  if (narrow.matches) byId(id).scrollIntoView({ block: "start" });
}

function showProblem(error: unknown): void {
  const place = byId("problem");
  const lines = [make("strong", {}, error instanceof Error ? error.message : String(error))];
  if (error instanceof Problem) {
    const retry = error.retryMs === null ? "" : ` Come back in ${milliseconds(error.retryMs)}.`;
    const where = error.requestId ? ` Request ${error.requestId} in the service’s log.` : "";
    lines.push(make("span", { className: "quiet" }, ` ${error.kind.replaceAll("_", " ")}.${retry}${where}`));
  }
  place.replaceChildren(...lines);
  place.hidden = false;
  reveal("problem");
}
