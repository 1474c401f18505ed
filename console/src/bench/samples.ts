/** The clusters that come with the console: simulated, of hulls that no model was trained on. */

import { byId, make } from "../dom";
import type { Cluster } from "./clouds";
import { readNpy } from "./npy";

const FOLDER = "console/samples";

/** No sample is the chosen cluster any more. */
export function leaveSamples(): void {
  for (const button of byId("samples").children) button.removeAttribute("aria-current");
}

interface Sample {
  file: string;
  title: string;
  text: string;
  sensor_height_m: number;
}

/** A button for each; `choose` is given the cluster of the one that was pressed. */
export async function showSamples(choose: (cluster: Cluster) => void): Promise<void> {
  const samples: Sample[] = await (await fetch(`${FOLDER}/samples.json`)).json();
  for (const sample of samples) {
    const title = make("strong", {}, sample.title);
    const button = make("button", { type: "button" }, title, make("span", { className: "quiet" }, sample.text));
    button.addEventListener("click", async () => {
      const content = await (await fetch(`${FOLDER}/${sample.file}`)).arrayBuffer();
      const points = Float32Array.from(readNpy(content, sample.file).values);
      leaveSamples();
      button.setAttribute("aria-current", "true");
      choose({ name: sample.title, points, sensorHeight: sample.sensor_height_m });
    });
    byId("samples").append(button);
  }
}
