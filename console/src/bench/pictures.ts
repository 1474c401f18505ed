/** The images of an answer, each pixel a square: they are data, not photographs. */

import type { Recognition } from "../contract";
import { byId, make } from "../dom";

const CHANNELS = ["near", "middle", "far", "distance", "diameter"];
const ROWS = 16; // of one channel
const COLUMNS = 32;

/** The image before and after inpainting, and the SPD2 image of each keypoint. */
export async function showPictures(answer: Recognition): Promise<void> {
  const { images } = answer;
  const why = answer.rung_reason ? `: ${answer.rung_reason}` : "";
  const absent = make("p", { className: "quiet" }, `None on rung ${answer.rung.replaceAll("_", " ")}${why}`);
  byId("images").replaceChildren(absent);
  byId("descriptors").replaceChildren(absent.cloneNode(true));
  if (!images) return;
  const layers = answer.image_method?.endsWith("side") ? "starboard, middle, port" : "lower, middle, upper";
  const pair = make(
    "div",
    { className: "pair images" },
    await picture(images.before, "Before: measured alone"),
    await picture(images.after, "After: the whole vessel"),
  );
  const legend = `Blue, green and red hold the layers ${layers}; black is empty.`;
  byId("images").replaceChildren(pair, make("p", { className: "quiet" }, legend));
  await showDescriptors(answer.descriptors ?? []);
}

async function showDescriptors(descriptors: string[]): Promise<void> {
  const blocks = descriptors.map(async (encoded, index) => {
    const whole = await createImageBitmap(blobOf(encoded));
    const channels = CHANNELS.map((name, channel) => {
      const canvas = make("canvas", { width: COLUMNS, height: ROWS, className: "pixels" });
      label(canvas, `Keypoint ${index + 1}, ${name}`);
      canvas.getContext("2d")?.drawImage(whole, 0, channel * ROWS, COLUMNS, ROWS, 0, 0, COLUMNS, ROWS);
      return make("figure", {}, canvas, make("figcaption", {}, name));
    });
    return make(
      "div",
      { className: "descriptor" },
      make("h4", {}, `Keypoint ${index + 1}`),
      make("div", { className: "channels" }, ...channels),
    );
  });
  const legend =
    "The neighbourhood of each keypoint on a sphere: elevation down from the zenith, azimuth across, the bow in the " +
    "middle. Near, middle and far: what is occupied there. Distance: how near the nearest is. Diameter: how deep " +
    "what lies in that direction is.";
  byId("descriptors").replaceChildren(...(await Promise.all(blocks)), make("p", { className: "quiet" }, legend));
}

async function picture(encoded: string, caption: string): Promise<HTMLElement> {
  const image = await createImageBitmap(blobOf(encoded));
  const canvas = make("canvas", { width: image.width, height: image.height, className: "pixels" });
  label(canvas, caption);
  canvas.getContext("2d")?.drawImage(image, 0, 0);
  return make("figure", {}, canvas, make("figcaption", {}, `${caption}, ${image.width} × ${image.height} pixels`));
}

function label(canvas: HTMLCanvasElement, text: string): void {
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", text);
}

function blobOf(encoded: string): Blob {
  return new Blob([Uint8Array.from(atob(encoded), (char) => char.charCodeAt(0))], { type: "image/png" });
}
