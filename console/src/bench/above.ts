/** The contact from above: restored cloud, box, bow, keypoints, line of sight; x ahead is up, y to port is left. */

import type { Recognition } from "../contract";
import { byId, colour, sharpen } from "../dom";
import { type Cluster, outline, partsOf } from "./clouds";
import { isShown, type Layer } from "./layers";

const HEIGHT = 320;
const MARGIN = 26;
const FULL_TURN = 2 * Math.PI;

/** Draws it as large as its card allows. */
export function drawAbove(cluster: Cluster, answer: Recognition): void {
  const canvas = byId<HTMLCanvasElement>("above");
  const width = canvas.parentElement ? canvas.clientWidth : 0;
  if (!width) return;
  const context = sharpen(canvas, width, HEIGHT);
  const { corners, bow, wings } = outline(answer);
  const corner = [...corners, bow];
  const [xs, ys] = [corner.map(([x]) => x), corner.map(([, y]) => y)];
  const span = [Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys)] as const;
  const scale = Math.min((HEIGHT - 2 * MARGIN) / span[0], (width - 2 * MARGIN) / span[1]);
  const [x0, y0] = [(Math.max(...xs) + Math.min(...xs)) / 2, (Math.max(...ys) + Math.min(...ys)) / 2];
  const at = (x: number, y: number): [number, number] => [
    width / 2 - (y - y0) * scale,
    HEIGHT / 2 - (x - x0) * scale,
  ];
  drawSight(context, at, answer);
  const parts = partsOf(answer, cluster);
  drawCloud(context, at, cluster.points, "raw", 1.4);
  drawCloud(context, at, parts.inferred, "inferred", 1.3);
  drawCloud(context, at, parts.measured, "measured", 1.8);
  if (isShown("box")) drawBox(context, at, corners, [wings[0], bow, wings[1]]);
  drawKeypoints(context, at, answer);
  drawScale(context, scale);
}

type Project = (x: number, y: number) => [number, number];

function drawCloud(
  context: CanvasRenderingContext2D,
  at: Project,
  points: Float32Array,
  layer: Layer,
  radius: number,
): void {
  if (!isShown(layer)) return;
  context.fillStyle = colour(layer);
  for (let index = 0; index < points.length; index += 3) {
    const [px, py] = at(points[index] ?? 0, points[index + 1] ?? 0);
    context.fillRect(px - radius, py - radius, 2 * radius, 2 * radius);
  }
}

function drawBox(
  context: CanvasRenderingContext2D,
  at: Project,
  corners: [number, number][],
  arrow: [number, number][],
): void {
  context.strokeStyle = colour("box");
  context.lineWidth = 1.5;
  context.beginPath();
  for (const [x, y] of corners) context.lineTo(...at(x, y));
  context.closePath();
  context.stroke();
  context.fillStyle = colour("bow");
  context.beginPath();
  for (const [x, y] of arrow) context.lineTo(...at(x, y));
  context.fill();
}

function drawKeypoints(context: CanvasRenderingContext2D, at: Project, { keypoints }: Recognition): void {
  if (!isShown("keypoint")) return;
  context.strokeStyle = colour("keypoint");
  context.fillStyle = colour("keypoint");
  context.lineWidth = 2;
  context.font = "600 12px system-ui, sans-serif";
  keypoints.forEach(([x, y], index) => {
    const [px, py] = at(x, y);
    context.beginPath();
    context.arc(px, py, 6, 0, FULL_TURN);
    context.stroke();
    context.fillText(String(index + 1), px + 9, py - 6);
  });
}

/** A dashed line from the box towards the LiDAR. */
function drawSight(context: CanvasRenderingContext2D, at: Project, { box }: Recognition): void {
  const [x, y] = box.center;
  const range = Math.hypot(x, y) || 1;
  const reach = (box.length + 8) / range;
  context.strokeStyle = colour("muted");
  context.lineWidth = 1;
  context.setLineDash([5, 5]);
  context.beginPath();
  context.moveTo(...at(x, y));
  context.lineTo(...at(x * (1 - reach), y * (1 - reach)));
  context.stroke();
  context.setLineDash([]);
}

function drawScale(context: CanvasRenderingContext2D, scale: number): void {
  const length = [50, 20, 10, 5, 2, 1].find((metres) => metres * scale <= 120) ?? 1;
  context.strokeStyle = context.fillStyle = colour("muted");
  context.lineWidth = 2;
  context.font = "12px system-ui, sans-serif";
  context.beginPath();
  context.moveTo(12, HEIGHT - 12);
  context.lineTo(12 + length * scale, HEIGHT - 12);
  context.stroke();
  context.fillText(`${length} m`, 12, HEIGHT - 18);
}
