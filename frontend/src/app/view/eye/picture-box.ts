/** Where the picture lies in the window: how large it is, what covers its edges, and where a place of the world is on it. */

import type { Camera } from "../../../core/camera/camera.ts";
import type { Vec3 } from "../../../core/types.ts";
import { coveredEdges } from "./covered.ts";

/** How long a view at home takes to go along when the inspector opens. */
const COVER_MS = 260;

/** Finds what floats on the picture by its selector. */
export type Find = (selector: string) => Element | null;

export interface PictureBoxOptions {
  readonly viewport: HTMLElement;
  readonly camera: Camera;
  /** Whether a frame has been drawn: before, a view does not fly. */
  readonly isDrawn: () => boolean;
  readonly redraw: () => void;
}

export class PictureBox {
  readonly #o: PictureBoxOptions;
  #find: Find | null = null;

  constructor(options: PictureBoxOptions) {
    this.#o = options;
  }

  /** Where a world point is in the window: CSS pixels. */
  toWindow(point: Vec3): { x: number; y: number; visible: boolean } {
    const { viewport, camera } = this.#o;
    const p = camera.project(point);
    const box = viewport.getBoundingClientRect();
    const ratio = camera.state.peek().width / Math.max(1, box.width);
    return { x: box.left + p.x / ratio, y: box.top + p.y / ratio, visible: p.visible };
  }

  /** Says what floats on the picture. `follow`: a view that is still at home goes along. */
  cover(find: Find, follow: boolean): void {
    const { viewport, camera, isDrawn, redraw } = this.#o;
    this.#find = find;
    const box = (selector: string): DOMRect | null => find(selector)?.getBoundingClientRect() ?? null;
    const picture = viewport.getBoundingClientRect();
    if (picture.width === 0) return;
    const chrome = {
      top: box("esk-top-bar"),
      tools: box("esk-tools"),
      foot: box("esk-measure") ?? box("esk-water") ?? box("esk-view-bar"),
      side: box("aside.side"),
    };
    const edges = coveredEdges(picture, chrome);
    const ratio = camera.state.peek().width / picture.width;
    const scaled = Object.fromEntries(Object.entries(edges).map(([edge, px]) => [edge, px * ratio]));
    camera.inset({ ...edges, ...scaled }, follow, isDrawn() ? COVER_MS : 0);
    redraw();
  }

  /** Keeps canvas and camera as large as the element that they fill, until what it returns is called. */
  watch(): () => void {
    const observer = new ResizeObserver(() => this.#resize());
    observer.observe(this.#o.viewport);
    this.#resize();
    return () => observer.disconnect();
  }

  #resize(): void {
    const { viewport, camera, redraw } = this.#o;
    const canvas = viewport.querySelector("canvas");
    const ratio = Math.min(window.devicePixelRatio, 2);
    const width = Math.max(1, Math.round(viewport.clientWidth * ratio));
    const height = Math.max(1, Math.round(viewport.clientHeight * ratio));
    if (canvas && (canvas.width !== width || canvas.height !== height)) Object.assign(canvas, { width, height });
    camera.resize(width, height);
    if (this.#find !== null) this.cover(this.#find, true);
    redraw();
  }
}
