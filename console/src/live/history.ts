/** The readings of the last minutes, and what they say. */

import { difference, quantile, type Scrape } from "./metrics";

const KEPT_S = 305; // a little over the longest window
const REQUESTS = "shipshape_request_seconds";
const CONTACTS = "shipshape_contacts_total";
const STAGES = "shipshape_stage_seconds";
const QUEUES = "shipshape_queue_seconds";
/** All that is read here, without the moments of creation. */
export const READ = new RegExp(`^(${REQUESTS}|${CONTACTS}|${STAGES}|${QUEUES}|process_start_time)(?!.*_created)`);
const RECOGNISING = new Set(["recognise", "recognise_scan", "recognise_stream", "infer"]);
const ANSWERED = new Set(["ok", "degraded"]);

/** What happened in a span of time; rates a second, times in milliseconds, null where nothing was observed. */
export interface Span {
  p50: number | null;
  p99: number | null;
  answered: number;
  degraded: number;
  refused: number;
  reasons: [kind: string, rate: number][];
}

/** One stage in a span of time. */
export interface StageSpan {
  stage: string;
  p50: number | null;
  p99: number | null;
  mean: number | null;
  rate: number;
}

/** Readings in the order of time; begins anew when the service did. */
export class History {
  private readings: Scrape[] = [];

  /** Keeps a reading. */
  add(reading: Scrape): void {
    const last = this.readings.at(-1);
    const started = (one: Scrape) => one.sum("process_start_time_seconds");
    if (last && started(last) !== started(reading)) this.readings = [];
    this.readings.push(reading);
    this.readings = this.readings.filter(({ at }) => reading.at - at <= KEPT_S);
  }

  /** The newest reading. */
  get latest(): Scrape | undefined {
    return this.readings.at(-1);
  }

  /** What happened in the last seconds; null before there are two readings. */
  span(seconds: number): Span | null {
    const pair = this.pair(seconds);
    if (!pair) return null;
    const [earlier, later, elapsed] = pair;
    const good = (labels: Record<string, string>) =>
      RECOGNISING.has(labels.method ?? "") && ANSWERED.has(labels.outcome ?? "");
    const times = difference(later.histogram(REQUESTS, good), earlier.histogram(REQUESTS, good));
    const reasons = later.values(CONTACTS, "outcome").map((kind): [string, number] => {
      const ofKind = (labels: Record<string, string>) => labels.outcome === kind;
      return [kind, (later.sum(CONTACTS, ofKind) - earlier.sum(CONTACTS, ofKind)) / elapsed];
    });
    const rates = new Map(reasons);
    const bad = reasons.filter(([kind, value]) => !ANSWERED.has(kind) && value > 0);
    return {
      p50: inMs(quantile(0.5, times)),
      p99: inMs(quantile(0.99, times)),
      answered: (rates.get("ok") ?? 0) + (rates.get("degraded") ?? 0),
      degraded: rates.get("degraded") ?? 0,
      refused: bad.reduce((total, [, value]) => total + value, 0),
      reasons: bad.sort(([, a], [, b]) => b - a),
    };
  }

  /** Each stage in the last seconds, after the wait for a worker. */
  stages(seconds: number, order: string[]): StageSpan[] {
    const pair = this.pair(seconds);
    if (!pair) return [];
    const of = (name: string, stage: string, accept: (labels: Record<string, string>) => boolean): StageSpan => {
      const [earlier, later, elapsed] = pair;
      const times = difference(later.histogram(name, accept), earlier.histogram(name, accept));
      const runs = later.sum(`${name}_count`, accept) - earlier.sum(`${name}_count`, accept);
      const spent = later.sum(`${name}_sum`, accept) - earlier.sum(`${name}_sum`, accept);
      return {
        stage,
        p50: inMs(quantile(0.5, times)),
        p99: inMs(quantile(0.99, times)),
        mean: runs > 0 ? (spent / runs) * 1e3 : null,
        rate: runs / elapsed,
      };
    };
    const stages = order.map((stage) => of(STAGES, stage, (labels) => labels.stage === stage));
    return [of(QUEUES, "wait for a worker", () => true), ...stages];
  }

  private pair(seconds: number): [earlier: Scrape, later: Scrape, elapsed: number] | null {
    const later = this.latest;
    if (!later) return null;
    const earlier = this.readings.find(({ at }) => later.at - at <= seconds + 0.5);
    return earlier && earlier !== later ? [earlier, later, later.at - earlier.at] : null;
  }
}

function inMs(seconds: number | null): number | null {
  return seconds === null ? null : seconds * 1e3;
}
