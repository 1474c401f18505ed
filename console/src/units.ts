/** Numbers as people read them. */

const UNKNOWN = "–";

/** Milliseconds, three digits that count. */
export function milliseconds(value: number | null | undefined): string {
  if (value === null || value === undefined || Number.isNaN(value)) return UNKNOWN;
  if (value >= 1000) return `${digits(value / 1000)} s`;
  return `${digits(value)} ms`;
}

/** Times a second. */
export function rate(value: number): string {
  return `${value === 0 ? "0" : digits(value)} /s`;
}

/** A share from 0 to 1 as per cent. */
export function percent(share: number): string {
  const value = share * 100;
  return `${value !== 0 && value < 0.1 ? "<0.1" : value > 99.9 && value < 100 ? ">99.9" : digits(value)} %`;
}

/** Metres. */
export function metres(value: number): string {
  return `${value.toFixed(2)} m`;
}

/** Degrees of an angle in radians. */
export function degrees(radians: number): string {
  return `${((radians * 180) / Math.PI).toFixed(1)}°`;
}

/** A time of the day, of 24 hours as on every bridge. */
export function clock(moment: Date): string {
  return moment.toLocaleTimeString("en-GB");
}

/** Names of the contract as words: without_restoration. */
export function words(name: string): string {
  return name.replaceAll("_", " ");
}

/** Three digits that count, no exponent. */
export function digits(value: number): string {
  if (value === 0) return "0";
  const magnitude = Math.floor(Math.log10(Math.abs(value)));
  return value.toFixed(Math.min(2, Math.max(0, 2 - magnitude)));
}
