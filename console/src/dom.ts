/** The few things that every part does with the page. */

/** The element with this id, which the page has. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`expected an element with the id ${id}, got none`);
  return found as T;
}

/** A new element; texts become text, never markup. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Writes a text only when it differs: what did not change is not read out again. */
export function write(id: string, text: string): void {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}

/** A row of a table; the first cell is its heading, cells of numbers are right-aligned. */
export function row(heading: string, ...cells: (Node | string)[]): HTMLTableRowElement {
  const made = cells.map((cell) => make("td", { className: typeof cell === "string" ? "number" : "wide" }, cell));
  return make("tr", {}, make("th", { scope: "row" }, heading), ...made);
}

/** A bar with parts of these shares of its whole, 0 to 1; for the eye alone, the numbers stand beside it. */
export function bar(...parts: { share: number; className: string }[]): HTMLElement {
  const made = make("div", { className: "meter" });
  made.setAttribute("aria-hidden", "true");
  for (const { share, className } of parts) {
    const part = make("span", { className });
    part.style.width = `${Math.min(1, Math.max(0, share)) * 100}%`; // CSSOM: the policy allows no style attribute
    made.append(part);
  }
  return made;
}

/** A colour of the theme. */
export function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** A canvas of this size in CSS pixels, sharp on every screen; its context is scaled to CSS pixels. */
export function sharpen(canvas: HTMLCanvasElement, width: number, height: number): CanvasRenderingContext2D {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  if (!context) throw new Error("expected a canvas that can be drawn on, got none");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return context;
}
