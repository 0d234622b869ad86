// Pointer and keyboard input of the 3D view: a click selects, a drag with Shift or after a long press moves a link.

import { Vector3 } from "three";
import { MARKS, type Mark, mountOf, SHOWN, toggled, type Viewer } from "../viewer";

/** The longest pointer path of a click [px], and the duration of a long press [ms]. */
const CLICK = 5;
const PRESS = 450;

export function gestures(canvas: HTMLCanvasElement, viewer: Viewer, measuring: () => boolean): void {
  let down: { x: number; y: number; id: number } | null = null;
  let drag: { link: number; grip: Vector3; at: Vector3; target: Vector3 | null } | null = null;
  let press = 0;

  const grab = (x: number, y: number): void => {
    const hit = viewer.hit(x, y);
    if (hit === null || viewer.options.explode > 0) return;
    const link = viewer.robot.occurrences[hit.occurrence].link;
    const reason = viewer.whyFixed(link);
    if (reason !== null) {
      viewer.showMessage(reason);
      return;
    }
    drag = { link, grip: viewer.inLink(link, hit.point), at: hit.point, target: null };
    viewer.stage.controls.enabled = false;
    canvas.style.cursor = "grabbing";
  };

  /** Runs once per frame, however many events arrive. */
  const pull = (): void => {
    if (drag?.target == null) return;
    viewer.pull(drag.link, drag.grip, drag.target);
    drag.target = null;
  };

  const release = (): void => {
    clearTimeout(press);
    pull();
    down = drag = null;
    viewer.stage.controls.enabled = true;
    canvas.style.cursor = "";
  };

  canvas.addEventListener("pointerdown", (event) => {
    clearTimeout(press);
    if (down !== null) { // a second finger: rotate and zoom
      release();
      return;
    }
    down = { x: event.clientX, y: event.clientY, id: event.pointerId };
    if (event.shiftKey && event.button === 0) {
      event.stopImmediatePropagation();
      canvas.setPointerCapture(event.pointerId);
      grab(event.clientX, event.clientY);
    } else if (event.pointerType === "touch") press = window.setTimeout(() => grab(event.clientX, event.clientY), PRESS);
  }, { capture: true });
  canvas.addEventListener("pointermove", (event) => {
    if (down === null || event.pointerId !== down.id) return;
    if (Math.hypot(event.clientX - down.x, event.clientY - down.y) > CLICK) clearTimeout(press);
    if (drag === null) return;
    const waiting = drag.target !== null;
    drag.target = viewer.stage.drawn(event.clientX, event.clientY, drag.at);
    if (!waiting) requestAnimationFrame(pull);
  });
  const up = (event: PointerEvent): void => {
    if (down === null || event.pointerId !== down.id) return;
    const still = Math.hypot(event.clientX - down.x, event.clientY - down.y) <= CLICK;
    release();
    if (still && event.type === "pointerup" && event.button === 0 && !event.shiftKey) click(event);
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);

  const click = (event: PointerEvent): void => {
    const hit = viewer.hit(event.clientX, event.clientY);
    if (hit === null) viewer.choose([]);
    else if (measuring()) nearest(viewer, hit.occurrence, hit.point);
    else if (event.ctrlKey || event.metaKey) viewer.choose(toggled(viewer.choice, [hit.occurrence]));
    else viewer.choose([hit.occurrence]);
  };
}

/** Selects the mount of an occurrence that is nearest to a point as an end of the measurement. */
function nearest(viewer: Viewer, occurrence: number, point: Vector3): void {
  const keys = viewer.robot.occurrences[occurrence].mounts.map((mount) => `${occurrence}:${mount.name}`);
  const away = (key: string): number => new Vector3().setFromMatrixPosition(viewer.mountDrawn(mountOf(key)!)).distanceTo(point);
  keys.sort((a, b) => away(a) - away(b));
  if (keys.length === 0) viewer.showMessage(`${viewer.robot.occurrences[occurrence].path} has no mounts`);
  else viewer.measure(viewer.measured[0] === "" || viewer.measured[1] !== "" ? 0 : 1, keys[0]);
}

const MARK_KEYS: Record<string, Mark> = { f: "frames", j: "joint axes", o: "mounts", c: "centres of mass", i: "inertia", n: "names", g: "floor" };

const VISIBILITY_KEYS = { h: "hide", s: "isolate", t: "toggleTransparent" } as const;

/** The keys and their functions, for the help dialog. */
export const KEYS: [string, string][] = [
  ["m / M", "Next or previous mode"], ["p / P", "Next or previous pose"], ["v", "Visual geometry, collision geometry or both"],
  ...MARKS.map((mark): [string, string] => [Object.keys(MARK_KEYS).find((key) => MARK_KEYS[key] === mark)!, `Show or hide ${mark}`]),
  ["h, s, t", "Hide, isolate, make transparent: the selected parts"], ["a", "Show all parts"], ["Space", "Play or pause the motion"],
  ["r", "Fit the view to the robot"], ["arrows, + and -", "Rotate and zoom, if the 3D view has the focus"], ["/", "Search parts"], ["Esc", "Clear the selection"],
  ["?", "Show this help"],
];

export function keys(viewer: Viewer, actions: { find: () => void; help: () => void }): void {
  document.addEventListener("keydown", (event) => {
    const field = event.target as HTMLElement;
    if (event.ctrlKey || event.metaKey || event.altKey || field.closest('input:not([type="range"], [type="checkbox"]), select, textarea, dialog')) return;
    const { options, robot, mode } = viewer;
    const cycled = (names: string[], here: string | undefined, by: number): string => names[(names.indexOf(here ?? "") + by + names.length) % names.length];
    const by = event.key === event.key.toLowerCase() ? 1 : -1;
    switch (event.key) {
      case "m": case "M":
        viewer.setMode(cycled(robot.modes.map((one) => one.name), mode.name, by));
        break;
      case "p": case "P":
        if (mode.poses.length > 0) viewer.setPose(cycled(mode.poses.map((one) => one.name), viewer.pose?.name, by));
        break;
      case "v":
        viewer.setOptions({ shown: SHOWN[(SHOWN.indexOf(options.shown) + 1) % SHOWN.length] });
        break;
      case "r":
        viewer.reset();
        break;
      case "h": case "s": case "t":
        if (viewer.choice.size === 0) viewer.showMessage("Select a part first");
        else viewer[VISIBILITY_KEYS[event.key]]();
        break;
      case "a":
        viewer.showAll();
        break;
      case " ":
        if (field.closest("button, input, tr") !== null) return;
        document.getElementById("play")?.click();
        break;
      case "/":
        actions.find();
        break;
      case "?":
        actions.help();
        break;
      case "Escape":
        viewer.choose([]);
        break;
      default:
        if (event.key in MARK_KEYS) viewer.toggle(MARK_KEYS[event.key]);
        else if (field.id === "canvas" && turned(viewer, event.key)) break;
        else return;
    }
    event.preventDefault();
  });
}

/** Rotates the camera about its target, or zooms. Returns false if the key has no such function. */
function turned(viewer: Viewer, key: string): boolean {
  const { camera, controls } = viewer.stage;
  const away = camera.position.clone().sub(controls.target);
  const side = new Vector3(0, 0, 1).cross(away).normalize();
  const steps: Record<string, () => void> = {
    ArrowLeft: () => away.applyAxisAngle(new Vector3(0, 0, 1), -0.1), ArrowRight: () => away.applyAxisAngle(new Vector3(0, 0, 1), 0.1),
    ArrowUp: () => away.applyAxisAngle(side, -0.08), ArrowDown: () => away.applyAxisAngle(side, 0.08),
    "+": () => away.multiplyScalar(0.88), "-": () => away.multiplyScalar(1.14),
  };
  if (!(key in steps)) return false;
  steps[key]();
  camera.position.copy(controls.target).add(away);
  controls.update();
  viewer.stage.ask();
  return true;
}
