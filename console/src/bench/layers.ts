/** What is drawn of a contact, in 3D and from above, and the switches for it, which are the legend too. */

import { byId, make } from "../dom";

/** Each name is also that of the layer's colour in the theme. */
const LAYERS = [
  ["raw", "Raw cluster"],
  ["measured", "Measured"],
  ["inferred", "Inferred"],
  ["keypoint", "Keypoints"],
  ["box", "Box and bow"],
  ["water", "Water"],
] as const;

export type Layer = (typeof LAYERS)[number][0];

const switches = new Map<Layer, HTMLInputElement>();

/** Makes the switches; `changed` is told whenever one is turned. */
export function startLayers(changed: () => void): void {
  for (const [name, label] of LAYERS) {
    const input = make("input", { type: "checkbox", checked: true, id: `layer-${name}` });
    input.addEventListener("change", changed);
    switches.set(name, input);
    const swatch = make("span", { className: "swatch" });
    swatch.style.setProperty("--tone", `var(--${name})`);
    const count = make("span", { id: `count-${name}`, className: "quiet" });
    byId("layers").append(make("label", {}, input, swatch, label, " ", count));
  }
}

/** Whether the user wants to see it. */
export function isShown(layer: Layer): boolean {
  return switches.get(layer)?.checked ?? true;
}

/** Writes how many there are of each; a layer that is not in this answer is greyed out. */
export function countLayers(counts: Partial<Record<Layer, number>>): void {
  for (const [name, input] of switches) {
    const count = counts[name];
    input.disabled = count === 0;
    byId(`count-${name}`).textContent = count ? String(count) : "";
  }
}
