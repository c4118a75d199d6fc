/**
 * The camera: one pose (pivot, distance, heading, pitch) seen in three modes (DESIGN 12).
 *
 * orbit turns about the pivot, fly turns about the eye, map looks straight down with an orthographic projection of
 * the same scale. Pixels are device pixels of the canvas, origin at the top left corner; angles are radians inside
 * and degrees at the interface. The only mutable state is the pose; `state` is published after each change.
 */

import { type ReadonlySignal, signal } from "@preact/signals-core";
import { add, addScaled, clamp, DEG, distance, dot, normalize, sub, wrapAngle } from "../math.ts";
import type { CameraState, Ground, Ray, Vec3 } from "../types.ts";
import { type Flight, poseOn } from "./flight.ts";
import { lifted, MAX_PITCH, MIN_PITCH, standingRoom } from "./floor.ts";
import { framed, homeIn, type Insets, raisedLand } from "./home.ts";
import { lowered, loweredRay, MOST_EXAGGERATION, raised, raisedGround } from "./lens.ts";
import {
  cameraState,
  FLAT,
  HOME_HEADING,
  HOME_PITCH,
  homePose,
  type Land,
  type Pose,
  poseBasis,
  poseEye,
} from "./state.ts";
import { type Canvas, metresPerPixel, metresPerPixelAt, type Projection, projected, rayThrough } from "./view.ts";

export type CameraMode = CameraState["mode"];

/** A remembered view: plain data, safe to store. */
export interface SavedView {
  readonly mode: CameraMode;
  readonly eye: Vec3;
  readonly target: Vec3;
}

export type { Projection } from "./view.ts";

export interface FrameRect {
  readonly x0: number;
  readonly y0: number;
  readonly x1: number;
  readonly y1: number;
}

const FLY_PITCH = 85 * DEG;
const MAP_PITCH = -90 * DEG;
/** How near one may come to what is looked at; nearer on small models. */
const NEAREST_M = 2;
/** Heights that count as the same, metres. */
const LEVEL_M = 1e-4;
/** Slowest flight, metres a second. */
const SLOWEST_M = 20;
/** Time in which a smooth zoom covers 63 % of its way. */
const ZOOM_TAU_S = 0.07;

export class Camera {
  readonly #sizeM: number;
  readonly #state;
  readonly #views = signal<ReadonlyMap<string, SavedView>>(new Map());
  #pose: Pose;
  #beforeMap: { heading: number; pitch: number } | null = null;
  #flight: Flight | null = null;
  #zoomLeft = 0;
  #zoomAnchor: Vec3 | undefined;
  #clearance: number;
  /** The land that home looks at. */
  #land: Land = FLAT;
  #canvas: Canvas = { width: 1, height: 1 };
  /** How many times heights of the pose are the true ones. */
  #k = 1;
  /** Margins that the page covers of the picture, device pixels; null where nobody has said. */
  #insets: Insets | null = null;
  /** Views change at once instead of flying: for people who asked for less motion. */
  calm = false;
  /** How the land lies now, asked where home is asked for; null: as was said last. */
  landNow: () => Land | null = () => null;

  /** Starts in orbit mode at the home view of a terrain of `sizeM` metres. */
  constructor(sizeM: number) {
    this.#sizeM = sizeM;
    this.#clearance = sizeM / 4;
    this.#pose = this.#homePose("orbit");
    this.#state = signal<CameraState>(this.#snapshot());
  }

  /** The camera as everybody reads it. */
  get state(): ReadonlySignal<CameraState> {
    return this.#state;
  }

  /** Remembered views by slot. */
  get views(): ReadonlySignal<ReadonlyMap<string, SavedView>> {
    return this.#views;
  }

  /** True when an animation is under way, so that `update` must be called again. */
  get moving(): boolean {
    return this.#flight !== null || this.#zoomLeft !== 0;
  }

  /** Canvas size in device pixels. A camera that is still at home goes along: home depends on the shape of the picture. */
  resize(width: number, height: number): void {
    const there = this.#atHome();
    this.#canvas = { width: Math.max(1, Math.round(width)), height: Math.max(1, Math.round(height)) };
    if (there) this.#set(this.#homePose(this.#pose.mode));
    else this.#publish();
  }

  /**
   * Says what covers the picture's edges, device pixels: home shows the land in the part that is left. With `follow` a camera
   * that is still at home goes along.
   */
  inset(insets: Insets, follow: boolean, durationMs = 0): void {
    const there = follow && this.#atHome();
    this.#insets = insets;
    if (there && !this.#atHome()) this.#flyTo(this.#homePose(this.#pose.mode), durationMs);
  }

  /** Turns about the pivot (about the eye in fly mode; the map turns about its centre). */
  orbit(dxPx: number, dyPx: number): void {
    if (this.#pose.mode === "fly") {
      this.look(-dxPx, -dyPx);
      return;
    }
    const k = Math.PI / this.#canvas.height;
    const { heading, pitch, mode } = this.#pose;
    if (mode === "map") this.#set({ heading: wrapAngle(heading + dxPx * k) });
    else this.#set({ heading: wrapAngle(heading + dxPx * k), pitch: clamp(pitch - dyPx * k, MIN_PITCH, MAX_PITCH) });
  }

  /** Turns by an angle (degrees, clockwise seen from above) about the pivot: the two-finger twist. */
  twist(angleDeg: number): void {
    this.#set({ heading: wrapAngle(this.#pose.heading + angleDeg * DEG) });
  }

  /** Drags the ground with the pointer; the pivot follows the height of the ground. */
  pan(dxPx: number, dyPx: number, ground: Ground): void {
    const { forward, right, up } = poseBasis(this.#pose);
    const perPixel = metresPerPixel(this.#pose, this.#canvas);
    const pivot = this.#pose.pivot;
    if (this.#pose.mode === "fly") {
      this.#set({ pivot: addScaled(addScaled(pivot, right, -dxPx * perPixel), up, dyPx * perPixel) });
      return;
    }
    const north: Vec3 = [Math.sin(this.#pose.heading), Math.cos(this.#pose.heading), 0];
    // Near the horizon a pixel covers much ground: the divisor is bounded so that the ground never runs away.
    const foreshortening = Math.max(0.25, -forward[2]);
    const moved = addScaled(addScaled(pivot, right, -dxPx * perPixel), north, (dyPx * perPixel) / foreshortening);
    const lift = ground.heightAt(moved[0], moved[1]) - ground.heightAt(pivot[0], pivot[1]);
    this.#set({ pivot: this.#leash([moved[0], moved[1], moved[2] + this.#k * lift]) });
  }

  /** Moves the camera over the map by metres, height and direction unchanged. */
  translate(dx: number, dy: number): void {
    const [x, y, z] = this.#pose.pivot;
    this.#set({ pivot: this.#leash([x + dx, y + dy, z]) });
  }

  /**
   * Magnifies by `factor` (> 1 comes nearer). The anchor, a point in the world, stays where it is on the screen:
   * eye and pivot move on the lines toward it (a homothety). With `smooth` the way is covered by `update`.
   */
  zoom(factor: number, anchor?: Vec3, smooth = false): void {
    if (!(factor > 0) || !Number.isFinite(factor)) return;
    if (smooth && !this.calm) {
      this.#flight = null;
      this.#zoomLeft += Math.log(factor);
      this.#zoomAnchor = anchor;
      this.#publish(); // whoever draws frames learns that there is something to animate
      return;
    }
    const { pivot, distanceM } = this.#pose;
    const next = clamp(distanceM / factor, this.#nearest, this.#farthest);
    const k = next / distanceM;
    if (k === 1) {
      this.#zoomLeft = 0;
      return;
    }
    const centre = anchor ? raised(anchor, this.#k) : pivot;
    this.#set({ distanceM: next, pivot: this.#leash(addScaled(centre, sub(pivot, centre), k)) });
  }

  /** Switches the mode. The place stays: the map shows what was around the pivot at the same scale. */
  setMode(mode: CameraMode): void {
    const from = this.#pose.mode;
    if (mode === from) return;
    const there = mode !== "fly" && this.#atHome();
    this.#flight = null;
    this.#zoomLeft = 0;
    if (mode === "map") {
      this.#beforeMap = { heading: this.#pose.heading, pitch: this.#pose.pitch };
      // The first map shows the whole land beside what covers the picture, as home does.
      this.#set(there ? this.#homePose(mode) : { mode, heading: 0, pitch: MAP_PITCH });
      return;
    }
    if (there) {
      this.#set(this.#homePose(mode));
      return;
    }
    const back = from === "map" ? (this.#beforeMap ?? { heading: HOME_HEADING, pitch: HOME_PITCH }) : {};
    this.#set({ mode, ...back });
  }

  /** Moves the eye in fly mode; arguments in -1..1, speed follows the height above the ground. */
  fly(forward: number, right: number, up: number, dtS: number): void {
    const basis = poseBasis(this.#pose);
    const step = clamp(this.#clearance * 0.9, Math.min(this.#sizeM / 200, SLOWEST_M), this.#sizeM) * dtS;
    let pivot = addScaled(this.#pose.pivot, basis.forward, forward * step);
    pivot = addScaled(pivot, basis.right, right * step);
    pivot = add(pivot, [0, 0, up * step]);
    const eye = poseEye(this.#pose);
    const shift = sub(pivot, this.#pose.pivot);
    const allowed = sub(this.#leash(add(eye, shift)), eye);
    this.#set({ pivot: add(this.#pose.pivot, allowed) });
  }

  /** Turns the view about the eye. */
  look(dxPx: number, dyPx: number): void {
    const k = (this.#pose.fovDeg * DEG) / this.#canvas.height;
    this.#keepEye(
      wrapAngle(this.#pose.heading + dxPx * k),
      clamp(this.#pose.pitch - dyPx * k, -FLY_PITCH, FLY_PITCH),
      this.#pose.distanceM,
    );
  }

  /** Stays where it is: whatever moved the view ends. */
  halt(): void {
    if (!this.moving) return;
    this.#zoomLeft = 0;
    this.#set({});
  }

  /** Where the view is going, or is when nothing moves it. */
  destination(): { readonly eye: Vec3; readonly target: Vec3 } {
    const pose = this.#flight?.to ?? this.#pose;
    return { eye: lowered(poseEye(pose), this.#k), target: lowered(pose.pivot, this.#k) };
  }

  /** Moves the pivot along the view to the depth of `point`, so that orbiting turns about what is looked at. */
  pivotAt(point: Vec3): void {
    if (this.#pose.mode === "map") return;
    const eye = poseEye(this.#pose);
    const depth = dot(sub(raised(point, this.#k), eye), poseBasis(this.#pose).forward);
    this.#keepEye(this.#pose.heading, this.#pose.pitch, clamp(depth, this.#nearest, this.#farthest));
  }

  /** Flies to where the rectangle (at ground level) or all points are in view. */
  frame(what: FrameRect | readonly Vec3[], durationMs = 450): void {
    const corners: readonly Vec3[] = "x0" in what ? [[what.x0, what.y0, 0], [what.x1, what.y1, 0]] : what; // biome-ignore format: one line
    if (corners.length === 0) return;
    const points = corners.map((p) => raised(p, this.#k));
    const found = framed(this.#pose, points, this.#canvas, this.#insets);
    const distanceM = clamp(Math.max(found.distanceM, this.#sizeM / 40), this.#nearest, this.#farthest);
    this.#flyTo({ ...found, distanceM }, durationMs);
  }

  /** Flies to a pose given by its eye and target. In map mode only place and scale are taken. */
  goTo(trueEye: Vec3, trueTarget: Vec3, durationMs = 600): void {
    const [eye, target] = [raised(trueEye, this.#k), raised(trueTarget, this.#k)];
    const d = sub(target, eye);
    const distanceM = clamp(distance(eye, target), this.#nearest, this.#farthest);
    const dir = normalize(d);
    const flat = Math.hypot(dir[0], dir[1]);
    const heading = flat > 1e-6 ? Math.atan2(dir[0], dir[1]) : this.#pose.heading;
    const angles =
      this.#pose.mode === "map" ? {} : { heading, pitch: clamp(Math.atan2(dir[2], flat), MIN_PITCH, FLY_PITCH) };
    this.#flyTo({ ...this.#pose, ...angles, pivot: target, distanceM }, durationMs);
  }

  /** Turns the view until north is up; the place stays. */
  north(durationMs = 350): void {
    this.#flyTo({ ...this.#pose, heading: 0 }, durationMs);
  }

  /** How many times heights are seen larger than they are; what is looked at stays in the middle. */
  exaggerate(times: number): void {
    const k = clamp(Number.isFinite(times) ? times : 1, 1, MOST_EXAGGERATION);
    if (k === this.#k) return;
    const there = this.#atHome();
    const pivot = raised(lowered(this.#pose.pivot, this.#k), k);
    this.#k = k;
    this.#set(there ? this.#homePose(this.#pose.mode) : { pivot });
  }

  /** Flies back to the view of the whole terrain, as it lies now. */
  home(durationMs = 600): void {
    this.#land = this.landNow() ?? this.#land;
    this.#flyTo(this.#homePose(this.#pose.mode), durationMs);
  }

  /** Says how high the land lies. A camera that is still at home goes along. */
  stand(land: Land): void {
    const there = this.#atHome();
    this.#land = land;
    if (there && !this.#atHome()) this.#set(this.#homePose(this.#pose.mode));
  }

  /**
   * One step of time: animates and keeps the eye above the ground (walk height in fly mode).
   * Returns true while anything moves, so that the caller draws another frame.
   */
  update(dtS: number, ground: Ground): boolean {
    const before = this.#pose;
    this.#stepFlight(dtS);
    this.#stepZoom(dtS);
    this.#keepAbove(raisedGround(ground, this.#k));
    return this.moving || this.#pose !== before;
  }

  /** The ray through a device pixel. */
  ray(xPx: number, yPx: number): Ray {
    return this.held()(xPx, yPx);
  }

  /** The rays of the picture as it is now, for whoever must not notice that the view moves on. */
  held(): (xPx: number, yPx: number) => Ray {
    const [pose, canvas, k] = [this.#pose, this.#canvas, this.#k];
    return (xPx, yPx) => loweredRay(rayThrough(pose, canvas, xPx, yPx, 2 * k * this.#sizeM), k);
  }

  /** Where a world point is on the canvas. */
  project(p: Vec3): Projection {
    return projected(this.#pose, this.#canvas, raised(p, this.#k));
  }

  /** Metres that one device pixel covers at a world point. */
  metresPerPixelAt(p: Vec3): number {
    return metresPerPixelAt(this.#pose, this.#canvas, raised(p, this.#k));
  }

  /** Remembers the present view under a name. */
  saveView(slot: string): SavedView {
    const { eye, target } = this.#state.value;
    const view: SavedView = { mode: this.#pose.mode, eye, target };
    this.#views.value = new Map(this.#views.value).set(slot, view);
    return view;
  }

  /** Takes over remembered views, as read from storage. */
  loadViews(views: Iterable<readonly [string, SavedView]>): void {
    this.#views.value = new Map(views);
  }

  /** Flies to a remembered view; false when the slot is empty. */
  restoreView(slot: string, durationMs = 600): boolean {
    const view = this.#views.value.get(slot);
    if (view === undefined) return false;
    this.setMode(view.mode);
    this.goTo(view.eye, view.target, durationMs);
    return true;
  }

  get #aspect(): number {
    return this.#canvas.width / this.#canvas.height;
  }

  get #nearest(): number {
    return Math.min(NEAREST_M, this.#sizeM / 500);
  }

  get #farthest(): number {
    return this.#sizeM * 8;
  }

  /** Says whether nobody has moved the view since it was home or was sent home. */
  #atHome(): boolean {
    const home = this.#homePose(this.#pose.mode);
    const { pivot, distanceM, heading, pitch } = this.#flight?.to ?? this.#pose;
    const near = 1e-6 * this.#sizeM;
    const turned = Math.abs(wrapAngle(heading - home.heading)) + Math.abs(pitch - home.pitch);
    const there = distance(pivot, home.pivot) + Math.abs(distanceM - home.distanceM) < near && turned < 1e-6;
    return there && this.#zoomLeft === 0;
  }

  #homePose(mode: CameraMode): Pose {
    const { width, height } = this.#canvas;
    const land = raisedLand(this.#land, this.#k);
    const pose =
      this.#insets === null
        ? homePose(mode, this.#sizeM, this.#aspect, land)
        : homeIn(mode, this.#sizeM, width, height, this.#insets, land);
    return { ...pose, distanceM: Math.min(pose.distanceM, this.#farthest) };
  }

  #leash(p: Vec3): Vec3 {
    const m = this.#sizeM * 0.75;
    const s = this.#sizeM;
    return [clamp(p[0], -m, s + m), clamp(p[1], -m, s + m), clamp(p[2], -4 * s, 4 * s)];
  }

  #keepEye(heading: number, pitch: number, distanceM: number): void {
    const eye = poseEye(this.#pose);
    const turned: Pose = { ...this.#pose, heading, pitch, distanceM };
    this.#set({ heading, pitch, distanceM, pivot: addScaled(eye, poseBasis(turned).forward, distanceM) });
  }

  #set(change: Partial<Pose>): void {
    this.#flight = null;
    this.#pose = { ...this.#pose, ...change };
    this.#publish();
  }

  #flyTo(to: Pose, durationMs: number): void {
    this.#zoomLeft = 0;
    if (durationMs <= 0 || this.calm) {
      this.#set(to);
      return;
    }
    this.#flight = { from: this.#pose, to, durationS: durationMs / 1000, elapsedS: 0 };
    this.#publish();
  }

  #stepFlight(dtS: number): void {
    if (this.#flight === null) return;
    const flight = { ...this.#flight, elapsedS: this.#flight.elapsedS + dtS };
    this.#pose = poseOn(flight);
    this.#flight = this.#pose === flight.to ? null : flight;
    this.#publish();
  }

  #stepZoom(dtS: number): void {
    if (this.#zoomLeft === 0) return;
    const part = Math.abs(this.#zoomLeft) < 1e-3 ? this.#zoomLeft : this.#zoomLeft * (1 - Math.exp(-dtS / ZOOM_TAU_S));
    this.#zoomLeft -= part;
    this.zoom(Math.exp(part), this.#zoomAnchor);
  }

  #keepAbove(ground: Ground): void {
    const eye = poseEye(this.#pose);
    const { floor, lowest } = standingRoom(ground, eye, this.#sizeM);
    this.#clearance = Math.max(lowest, eye[2]) - floor;
    // An eye that was lifted is off by rounding: that is no reason for another frame.
    if (this.#pose.mode === "map" || eye[2] >= lowest - LEVEL_M) return;
    this.#pose = lifted(this.#pose, [eye[0], eye[1], lowest], this.#nearest);
    this.#publish();
  }

  #snapshot(): CameraState {
    return cameraState(this.#pose, this.#canvas.width, this.#canvas.height, this.#sizeM, this.#k);
  }

  #publish(): void {
    this.#state.value = this.#snapshot();
  }
}
