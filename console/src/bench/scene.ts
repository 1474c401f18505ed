/** The contact in 3D. Level frame moved to its middle, metres, z up; drawn only when something changed. */

import {
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  Color,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  type Object3D,
  PerspectiveCamera,
  Points,
  PointsMaterial,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Recognition, Triple } from "../contract";
import { colour } from "../dom";
import { bounds, type Cluster, outline, partsOf } from "./clouds";
import { listenToKeys } from "./keys";
import type { Layer } from "./layers";

const AXES = [0, 1, 2] as const;
const FOV_DEG = 36;
const GRID_M = 5;

export type Look = "oblique" | "above" | "abeam" | "sensor";

/** Draws into `place`; raises when the browser has no WebGL. */
export class Scene3d {
  private readonly renderer = new WebGLRenderer({ antialias: true });
  private readonly camera = new PerspectiveCamera(FOV_DEG, 1, 0.1, 5000);
  private readonly controls: OrbitControls;
  private readonly scene = new Scene();
  private readonly layers = new Map<Layer, Object3D>();
  private readonly dot = dotTexture();
  private middle: Triple = [0, 0, 0];
  private radius = 10;
  private heading = 0;
  private due = false;

  constructor(
    place: HTMLElement,
    private readonly isShown: (layer: Layer) => boolean,
  ) {
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.draw());
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute(
      "aria-label",
      "Contact in 3D: arrow keys turn, plus and minus come nearer, Shift and arrow keys move",
    );
    listenToKeys(canvas, this.camera, this.controls);
    place.replaceChildren(canvas);
    new ResizeObserver(() => this.fit(place)).observe(place);
    this.fit(place);
  }

  /** Shows a cluster, and what was made of it. */
  show(cluster: Cluster, answer: Recognition | null): void {
    const parts = answer ? partsOf(answer, cluster) : null;
    const frame = Float32Array.from(answer ? ends(answer) : []);
    const { least, most } = bounds(joined(cluster.points, parts?.inferred ?? new Float32Array(), frame));
    this.middle = AXES.map((axis) => (least[axis] + most[axis]) / 2) as Triple;
    this.radius = Math.max(2, Math.hypot(...AXES.map((axis) => most[axis] - least[axis])) / 2);
    this.heading = answer?.heading ?? Math.atan2(this.middle[1], this.middle[0]) + Math.PI / 2;
    const water = answer ? answer.box.center[2] - answer.box.height / 2 : least[2];
    this.put("raw", this.cloud(cluster.points, "raw", 3.5));
    this.put("measured", this.cloud(parts?.measured ?? new Float32Array(), "measured", 4));
    this.put("inferred", this.cloud(parts?.inferred ?? new Float32Array(), "inferred", 3));
    this.put("keypoint", this.cloud(Float32Array.from((answer?.keypoints ?? []).flat()), "keypoint", 13));
    this.put("box", answer ? this.box(answer, water) : new Group());
    this.put("water", this.water(water));
    this.layer();
  }

  /** Turns the layers on and off. */
  layer(): void {
    for (const [name, object] of this.layers) object.visible = this.isShown(name);
    this.draw();
  }

  /** Moves the camera. */
  look(from: Look): void {
    const sight = Math.atan2(this.middle[1], this.middle[0]);
    const directions: Record<Look, Vector3> = {
      oblique: new Vector3(-Math.cos(sight + 0.6), -Math.sin(sight + 0.6), 0.55),
      above: new Vector3(-1e-3, 0, 1), // x ahead is up
      abeam: new Vector3(-Math.sin(this.heading), Math.cos(this.heading), 0.06),
      sensor: new Vector3(-this.middle[0], -this.middle[1], -this.middle[2]),
    };
    const narrow = Math.min(1, this.camera.aspect);
    const distance = (this.radius * 0.95) / Math.sin((FOV_DEG * Math.PI) / 360) / narrow;
    this.controls.target.set(0, 0, 0);
    this.camera.position.copy(directions[from].normalize().multiplyScalar(distance));
    this.controls.update();
    this.draw();
  }

  private put(name: Layer, object: Object3D): void {
    const old = this.layers.get(name);
    old?.traverse((part) => {
      if (!(part instanceof Points || part instanceof Mesh || part instanceof LineSegments)) return;
      part.geometry.dispose();
      part.material.dispose();
    });
    if (old) this.scene.remove(old);
    this.layers.set(name, object);
    this.scene.add(object);
  }

  private cloud(points: Float32Array, tone: Layer, size: number): Points {
    const moved = points.map((value, index) => value - this.middle[(index % 3) as 0]);
    const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(moved, 3));
    const ratio = this.renderer.getPixelRatio();
    const color = new Color(colour(tone));
    const onTop = tone === "keypoint";
    const order: Partial<Record<Layer, number>> = { raw: -1, keypoint: 1 }; // measured points cover the raw ones
    const cloud = new Points(
      geometry,
      new PointsMaterial({
        color,
        size: size * ratio,
        sizeAttenuation: false,
        map: this.dot,
        alphaTest: 0.5,
        depthTest: !onTop,
      }),
    );
    cloud.renderOrder = order[tone] ?? 0;
    return cloud;
  }

  private box(answer: Recognition, water: number): Group {
    const { corners, bow, wings } = outline(answer);
    const [low, high] = [water - this.middle[2], water - this.middle[2] + answer.box.height];
    const at = ([x, y]: [number, number], z: number) => [x - this.middle[0], y - this.middle[1], z];
    const lines = corners.flatMap((corner, index) => {
      const next = corners[(index + 1) % 4] ?? corner;
      return [
        ...at(corner, low),
        ...at(next, low),
        ...at(corner, high),
        ...at(next, high),
        ...at(corner, low),
        ...at(corner, high),
      ];
    });
    const arrow = new BufferGeometry().setAttribute(
      "position",
      new BufferAttribute(Float32Array.from([...at(wings[0], low), ...at(bow, low), ...at(wings[1], low)]), 3),
    );
    const tip = new Mesh(
      arrow,
      new MeshBasicMaterial({ color: colour("bow"), side: 2, transparent: true, opacity: 0.7 }),
    );
    return new Group().add(segments(lines, "box", 1), tip);
  }

  private water(level: number): LineSegments {
    const reach = Math.ceil((this.radius * 1.6) / GRID_M) * GRID_M;
    const z = level - this.middle[2];
    const lines: number[] = [];
    for (let at = -reach; at <= reach; at += GRID_M)
      lines.push(at, -reach, z, at, reach, z, -reach, at, z, reach, at, z);
    return segments(lines, "water", 0.55);
  }

  private fit(place: HTMLElement): void {
    const { clientWidth: width, clientHeight: height } = place;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private draw(): void {
    if (this.due) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      this.scene.background = new Color(colour("deep"));
      this.renderer.render(this.scene, this.camera);
    });
  }
}

/** Two corners of the box and the tip at its bow, packed x y z: what must fit into the picture. */
function ends(answer: Recognition): number[] {
  const { corners, bow } = outline(answer);
  const { center, height } = answer.box;
  return [...corners, bow].flatMap(([x, y]) => [x, y, center[2] - height / 2, x, y, center[2] + height / 2]);
}

function segments(lines: number[], tone: Layer, opacity: number): LineSegments {
  const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(Float32Array.from(lines), 3));
  return new LineSegments(
    geometry,
    new LineBasicMaterial({ color: colour(tone), transparent: opacity < 1, opacity }),
  );
}

function joined(...parts: Float32Array[]): Float32Array {
  const all = new Float32Array(parts.reduce((total, { length }) => total + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

/** Points are squares unless something rounds them. */
function dotTexture(): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 32;
  const context = canvas.getContext("2d");
  if (context) {
    context.fillStyle = "white";
    context.arc(16, 16, 15, 0, 2 * Math.PI);
    context.fill();
  }
  return new CanvasTexture(canvas);
}
