/** Dark or light: as the system says, unless the user chose. */

import { byId } from "./dom";

const KEY = "shipshape-theme";
const dark = window.matchMedia("(prefers-color-scheme: dark)");

/** Follows the choice and the system, and tells `changed` of every change. */
export function followTheme(changed: () => void): void {
  const choice = byId<HTMLSelectElement>("theme");
  choice.value = remembered();
  const apply = () => {
    const chosen = choice.value === "system" ? (dark.matches ? "dark" : "light") : choice.value;
    document.documentElement.dataset.theme = chosen;
    changed();
  };
  choice.addEventListener("change", () => {
    remember(choice.value);
    apply();
  });
  dark.addEventListener("change", apply);
  apply();
}

function remembered(): string {
  try {
    const stored = localStorage.getItem(KEY) ?? "";
    return ["dark", "light"].includes(stored) ? stored : "system";
  } catch {
    return "system"; // storage is switched off
  }
}

function remember(choice: string): void {
  try {
    localStorage.setItem(KEY, choice);
  } catch {
    // the choice holds until the page is closed
  }
}
