/** The keyboard for the 3D view: what the mouse can do, keys can. */

import { type PerspectiveCamera, Spherical, Vector3 } from "three";
import type { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

const STEP_RAD = Math.PI / 24;
const NEARER = 0.88;
const ARROWS: Record<string, [right: number, up: number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

/** Arrow keys turn, with Shift they move; plus and minus come nearer and go away. */
export function listenToKeys(canvas: HTMLElement, camera: PerspectiveCamera, controls: OrbitControls): void {
  canvas.addEventListener("keydown", (event) => {
    const arrow = ARROWS[event.key];
    if (event.altKey || event.ctrlKey || event.metaKey) return; // the browser's own
    if (arrow && event.shiftKey) move(camera, controls, arrow);
    else if (arrow) turn(camera, controls, arrow);
    else if (event.key === "+" || event.key === "=") approach(camera, controls, NEARER);
    else if (event.key === "-") approach(camera, controls, 1 / NEARER);
    else return;
    event.preventDefault();
    controls.update();
  });
}

function turn(camera: PerspectiveCamera, controls: OrbitControls, [right, up]: [number, number]): void {
  const [x, y, z] = camera.position.clone().sub(controls.target).toArray();
  const around = new Spherical().setFromVector3(new Vector3(x, z, -y)); // Spherical has y up
  around.theta += right * STEP_RAD;
  around.phi = Math.min(Math.PI - 0.01, Math.max(0.01, around.phi - up * STEP_RAD));
  const turned = new Vector3().setFromSpherical(around);
  camera.position.set(turned.x, -turned.z, turned.y).add(controls.target);
}

function move(camera: PerspectiveCamera, controls: OrbitControls, [right, up]: [number, number]): void {
  const step = camera.position.distanceTo(controls.target) / 20;
  const shift = new Vector3(right, up, 0).multiplyScalar(step).applyQuaternion(camera.quaternion);
  camera.position.add(shift);
  controls.target.add(shift);
}

function approach(camera: PerspectiveCamera, controls: OrbitControls, factor: number): void {
  camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
}
