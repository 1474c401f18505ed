/** Lines over the last five minutes. */

import uPlot from "uplot";
import { byId, colour, make } from "../dom";
import { clock } from "../units";

const KEPT = 300; // points, one a second
const SHORTEST = 60; // seconds
const GAP = 5; // seconds between two points that no line joins
const HEIGHT = 220;

/** One line; `tone` is a colour of the theme, `dash` tells it from others without colour. */
export interface Line {
  label: string;
  tone: string;
  dash?: number[];
}

/** A chart that scrolls; drawn anew in the colours of the theme. */
export class Chart {
  private plot: uPlot | null = null;
  private readonly times: number[] = [];
  private readonly rows: (number | null)[][];
  private readonly place: HTMLElement;

  /**
   * @param name Of the elements: NAME-chart and NAME-legend.
   * @param unit Behind the numbers of the axis.
   */
  constructor(
    name: string,
    private readonly unit: string,
    private readonly lines: Line[],
  ) {
    this.place = byId(`${name}-chart`);
    this.rows = lines.map(() => []);
    for (const { label, tone, dash } of lines) {
      const key = make("span", { className: dash ? "key dashed" : "key" });
      key.style.setProperty("--tone", `var(--${tone})`);
      byId(`${name}-legend`).append(make("li", {}, key, label));
    }
    new ResizeObserver(() => this.fit()).observe(this.place);
  }

  /** A point of each line at this moment, seconds since 1970; null leaves a gap. */
  add(time: number, values: (number | null)[]): void {
    const last = this.times.at(-1) ?? time;
    if (time - last > GAP) this.put(last + 1, []); // nobody looked: no line across it
    this.put(time, values);
    this.plot?.setData(this.data());
  }

  private put(time: number, values: (number | null)[]): void {
    this.times.push(time);
    this.rows.forEach((row, index) => row.push(values[index] ?? null));
    for (const column of [this.times, ...this.rows]) if (column.length > KEPT) column.shift();
  }

  /** Draws it with the colours of the theme as they are now. */
  paint(): void {
    this.plot?.destroy();
    this.plot = null;
    this.fit();
  }

  private fit(): void {
    const width = this.place.clientWidth;
    if (width === 0) return; // its view is hidden
    if (this.plot) this.plot.setSize({ width, height: HEIGHT });
    else this.plot = new uPlot(this.options(width), this.data(), this.place);
  }

  private data(): uPlot.AlignedData {
    return [this.times, ...this.rows];
  }

  private options(width: number): uPlot.Options {
    const axis = { stroke: colour("muted"), grid: { stroke: colour("edge"), width: 1 }, ticks: { show: false } };
    const now = () => this.times.at(-1) ?? Date.now() / 1e3;
    // A chart that has just begun shows its first minute, not five empty ones.
    const range = (): [number, number] => [
      Math.max(now() - KEPT, Math.min(this.times[0] ?? now(), now() - SHORTEST)),
      now(),
    ];
    const clocks = (_: uPlot, ticks: number[]) => ticks.map((tick) => clock(new Date(tick * 1e3)));
    const values = (_: uPlot, ticks: number[]) => ticks.map((tick) => `${+tick.toFixed(2)}${this.unit}`);
    return {
      width,
      height: HEIGHT,
      cursor: { show: false },
      legend: { show: false },
      padding: [8, 8, 0, 0],
      scales: { x: { range }, y: { range: (_, __, most) => [0, (most || 1) * 1.1] } },
      axes: [
        { ...axis, space: 80, values: clocks, size: 30 },
        { ...axis, values, size: 64, space: 40 },
      ],
      series: [
        {},
        ...this.lines.map(({ label, tone, dash }) => ({
          label,
          stroke: colour(tone),
          width: 2,
          points: { show: false },
          ...(dash ? { dash } : {}),
        })),
      ],
    };
  }
}
