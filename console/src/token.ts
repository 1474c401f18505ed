/** Asks the user for a token, once for all calls that wait for it. */

import { byId, write } from "./dom";

let asking: Promise<string> | null = null;

/**
 * Opens the dialog; the token that was typed.
 * @param why What was wrong with the token before; empty when there was none.
 * @throws refusal The user closed the dialog without one.
 */
export function askForToken(why: string, refusal: Error): Promise<string> {
  asking ??= typed(why, refusal).finally(() => {
    asking = null;
  });
  return asking;
}

function typed(why: string, refusal: Error): Promise<string> {
  const dialog = byId<HTMLDialogElement>("token-dialog");
  const field = byId<HTMLInputElement>("token");
  write("token-why", why);
  field.value = "";
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((resolve, reject) => {
    dialog.addEventListener(
      "close",
      () => {
        const given = field.value.trim();
        field.value = "";
        if (dialog.returnValue === "use" && given) resolve(given);
        else reject(refusal);
      },
      { once: true },
    );
  });
}
