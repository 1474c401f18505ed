/** The clusters that come with the console: simulated, of hulls that no model was trained on. */

import { byId, make } from "../dom";
import { call, json } from "../service";
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

/** A button for each; `choose` is given the cluster of the one that was pressed, `complain` why there is none. */
export async function showSamples(
  choose: (cluster: Cluster) => void,
  complain: (error: unknown) => void,
): Promise<void> {
  const buttons = (await json<Sample[]>(`${FOLDER}/samples.json`)).map((sample) => {
    const title = make("strong", {}, sample.title);
    const button = make("button", { type: "button" }, title, make("span", { className: "quiet" }, sample.text));
    button.addEventListener("click", async () => {
      try {
        choose(await read(sample));
        leaveSamples();
        button.setAttribute("aria-current", "true");
      } catch (error) {
        complain(error);
      }
    });
    return button;
  });
  byId("samples").replaceChildren(...buttons);
}

async function read({ file, title, sensor_height_m }: Sample): Promise<Cluster> {
  const content = await (await call(`${FOLDER}/${file}`)).arrayBuffer();
  return { name: title, points: Float32Array.from(readNpy(content, file).values), sensorHeight: sensor_height_m };
}
