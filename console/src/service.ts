/** Calls to the service that this page came from, and its problem documents as errors. */

import { askForToken } from "./token";

const PATIENCE_MS = 5000; // of calls that only look; a recognition has its own deadline

/** The service answered, with a refusal; its message is the problem document's sentence. */
export class Problem extends Error {
  /**
   * @param kind As in the document: overloaded, unprocessable, ...
   * @param requestId Under which the service's log knows it.
   * @param retryMs When to come back, where the service says it.
   */
  constructor(
    message: string,
    readonly status: number,
    readonly kind: string,
    readonly requestId: string,
    readonly retryMs: number | null,
  ) {
    super(message);
  }
}

/** The service did not answer at all. */
export class Unreachable extends Error {}

let token = ""; // in memory alone: no storage, no cookie

/** Whether the user gave a token. */
export function holdsToken(): boolean {
  return token !== "";
}

/**
 * Calls a path of the service; asks the user for a token when the service does.
 * @throws Problem The service refused.
 * @throws Unreachable It did not answer within `patienceMs`.
 */
export async function call(path: string, init: RequestInit = {}, patienceMs = PATIENCE_MS): Promise<Response> {
  for (;;) {
    const used = token;
    const response = await send(path, init, patienceMs);
    if (response.ok) return response;
    const problem = await problemOf(response);
    if (problem.status !== 401) throw problem;
    if (used === token) token = await askForToken(used ? problem.message : "", problem);
  }
}

/** JSON of a path; raises as `call`. */
export async function json<T>(path: string): Promise<T> {
  return (await call(path)).json();
}

/** Text of a path; raises as `call`. */
export async function text(path: string): Promise<string> {
  return (await call(path)).text();
}

async function send(path: string, init: RequestInit, patienceMs: number): Promise<Response> {
  const headers = new Headers(init.headers);
  if (token) headers.set("Authorization", `Bearer ${token}`);
  try {
    return await fetch(path, { ...init, headers, cache: "no-store", signal: AbortSignal.timeout(patienceMs) });
  } catch (error) {
    throw new Unreachable("expected an answer from the service, got none", { cause: error });
  }
}

async function problemOf(response: Response): Promise<Problem> {
  const body = await response.json().catch(() => ({}));
  const retry = response.headers.get("Shipshape-Retry-After-Ms");
  return new Problem(
    body.detail ?? `expected an answer, got ${response.status} ${response.statusText}`,
    response.status,
    body.error ?? "unknown",
    body.request_id ?? "",
    retry === null ? null : Number(retry),
  );
}
