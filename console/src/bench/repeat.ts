/** The same request from a command line, and the answer for programs. */

import type { Recognition } from "../contract";
import { byId, write } from "../dom";
import { holdsToken } from "../service";
import type { Cluster } from "./clouds";

/** A request as it was sent. */
export interface Sent {
  cluster: Cluster;
  query: URLSearchParams;
  timeoutMs: string;
}

let sent: Sent | null = null;
let answer = "";

/** Makes the buttons work. */
export function startRepeat(): void {
  byId("copy-curl").addEventListener("click", () => copy(byId("curl").textContent ?? "", "command"));
  byId("copy-json").addEventListener("click", () => copy(answer, "answer"));
  byId("download").addEventListener("click", () => {
    if (sent) download(sent.cluster);
  });
}

/** Shows a request and its answer. */
export function showRepeat(request: Sent, said: Recognition): void {
  sent = request;
  answer = JSON.stringify(said);
  write("curl", command(request));
  // Thousands of points and pictures in base64 would bury the rest; the copied answer has them.
  const short = { ...said, restored: said.restored && "…", images: said.images && "…" };
  write("json", JSON.stringify(short, null, 2));
  write("copied", "");
}

function command({ cluster, query, timeoutMs }: Sent): string {
  const lines = ["curl -sS -H 'Content-Type: application/octet-stream'"];
  if (timeoutMs) lines.push(`-H 'Shipshape-Timeout-Ms: ${timeoutMs}'`);
  if (holdsToken()) lines.push('-H "Authorization: Bearer $TOKEN"');
  lines.push(`--data-binary @${fileName(cluster)}`, `'${new URL(`v1/recognise?${query}`, document.baseURI)}'`);
  return lines.join(" \\\n  ");
}

function fileName({ name }: Cluster): string {
  return `${name.replace(/\.\w+$/, "").replace(/[^\w.-]+/g, "-")}.f32`;
}

function download(cluster: Cluster): void {
  const url = URL.createObjectURL(new Blob([cluster.points.slice()], { type: "application/octet-stream" }));
  const link = Object.assign(document.createElement("a"), { href: url, download: fileName(cluster) });
  link.click();
  URL.revokeObjectURL(url);
}

async function copy(text: string, what: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    write("copied", `Copied the ${what}.`);
  } catch {
    write("copied", "This browser does not let the page copy: mark the text and copy it.");
  }
}
