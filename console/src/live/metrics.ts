/** Prometheus text, and what two readings of it say of the time between them. */

type Labels = Record<string, string>;
interface Sample {
  labels: Labels;
  value: number;
}
/** Upper bounds in seconds with how many observations lie at or below each; the last bound is infinite. */
export type Histogram = [bound: number, count: number][];

const LINE = /^([a-zA-Z_:][\w:]*)(?:\{(.*)\})? (\S+)/;
const LABEL = /(\w+)="((?:[^"\\]|\\.)*)"/g;

/** One reading of /metrics. */
export class Scrape {
  private readonly samples = new Map<string, Sample[]>();

  /**
   * @param at Seconds on any steady clock.
   * @param content In the text format of Prometheus.
   * @param wanted Names of metrics to keep: minutes of all of them would take tens of megabytes.
   */
  constructor(
    readonly at: number,
    content: string,
    wanted: RegExp,
  ) {
    for (const line of content.split("\n")) {
      const [, name, labels, value] = LINE.exec(line) ?? [];
      if (name === undefined || !wanted.test(name)) continue;
      const held = this.samples.get(name) ?? [];
      held.push({ labels: labelsOf(labels ?? ""), value: numberOf(value ?? "") });
      this.samples.set(name, held);
    }
  }

  /** The sum of a metric over all label sets that `accept` takes; 0 where there is none. */
  sum(name: string, accept: (labels: Labels) => boolean = () => true): number {
    return this.of(name, accept).reduce((total, { value }) => total + value, 0);
  }

  /** All values that a label takes. */
  values(name: string, label: string): string[] {
    return [...new Set((this.samples.get(name) ?? []).map(({ labels }) => labels[label] ?? ""))];
  }

  /** A histogram, summed over all label sets that `accept` takes. */
  histogram(name: string, accept: (labels: Labels) => boolean = () => true): Histogram {
    const counts = new Map<number, number>();
    for (const { labels, value } of this.of(`${name}_bucket`, accept)) {
      const bound = numberOf(labels.le ?? "");
      counts.set(bound, (counts.get(bound) ?? 0) + value);
    }
    return [...counts].sort(([a], [b]) => a - b);
  }

  private of(name: string, accept: (labels: Labels) => boolean): Sample[] {
    return (this.samples.get(name) ?? []).filter(({ labels }) => accept(labels));
  }
}

/** What came between two readings of a histogram that only grows. */
export function difference(later: Histogram, earlier: Histogram): Histogram {
  const before = new Map(earlier);
  return later.map(([bound, count]) => [bound, count - (before.get(bound) ?? 0)]);
}

/**
 * A quantile as Prometheus has it: straight lines inside the buckets.
 * @returns Seconds; null when nothing was observed. What lies beyond the last finite bound counts as that bound.
 */
export function quantile(q: number, histogram: Histogram): number | null {
  const total = histogram.at(-1)?.[1] ?? 0;
  if (total <= 0) return null;
  const rank = q * total;
  let [below, lower] = [0, 0];
  for (const [bound, count] of histogram) {
    if (count >= rank) {
      if (!Number.isFinite(bound)) return lower;
      return count === below ? bound : lower + ((bound - lower) * (rank - below)) / (count - below);
    }
    [below, lower] = [count, bound];
  }
  return lower;
}

function labelsOf(text: string): Labels {
  return Object.fromEntries([...text.matchAll(LABEL)].map(([, name, value]) => [name, value]));
}

function numberOf(text: string): number {
  return text === "+Inf" ? Infinity : text === "-Inf" ? -Infinity : Number(text);
}
