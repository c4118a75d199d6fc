/**
 * The stage's renderer: the 3D view, the map where there is no WebGPU, and another 3D view when the graphics device is
 * lost (driver update, sleep, too little memory, a crash of the browser's graphics process). Camera, strokes and tiles
 * live outside of it, so a new one goes on where the last one ended.
 */

import { msg, str } from "@lit/localize";
import { type ReadonlySignal, signal } from "@preact/signals-core";
import type { CameraState, SceneRenderer } from "../../core/types.ts";
import { createMapRenderer, createRenderer, NoWebGpu } from "../../gpu/index.ts";

export interface RendererInfo {
  readonly kind: SceneRenderer["kind"];
  readonly description: string;
  /** Pictures are drawn by a processor: what costs much is off unless somebody asks for it. */
  readonly software: boolean;
}

/** Notices of the page about the graphics device. */
export interface GraphicsNotice {
  readonly text: string;
  /** The map stands in for the 3D view, which may be tried again. */
  readonly retry: boolean;
}

export interface GraphicsOptions {
  readonly viewport: HTMLElement;
  readonly camera: {
    readonly state: ReadonlySignal<Pick<CameraState, "mode" | "width" | "height">>;
    setMode(mode: CameraState["mode"]): void;
  };
  /** Something short to tell. */
  readonly say: (text: string) => void;
  /** Called when there is another renderer. */
  readonly onOpened: () => void;
  /** Milliseconds of a clock that only rises. */
  readonly now?: () => number;
}

/** A device that is lost more often than this within `LOSS_WINDOW_MS` counts as unusable: the map is shown. */
export const MOST_LOSSES = 3;
const LOSS_WINDOW_MS = 60_000;
/** Waits before each try to open another device: after a crash the browser needs a moment until it has one. */
export const RETRY_MS = [0, 500, 2000] as const;
const NOTICE_MS = 8000;

export class Graphics {
  readonly info = signal<RendererInfo | null>(null);
  /** Why there is no 3D view, as a sentence; null while there is one. */
  readonly reason = signal<string | null>(null);
  readonly notice = signal<GraphicsNotice | null>(null);
  readonly #options: GraphicsOptions;
  readonly #now: () => number;
  #renderer: SceneRenderer | null = null;
  #losses: number[] = [];
  /** Camera mode to return to from the map that stands in for the 3D view. */
  #modeBefore: CameraState["mode"] | null = null;
  #opening = false;
  #disposed = false;
  #fading: ReturnType<typeof setTimeout> | undefined;

  constructor(options: GraphicsOptions) {
    this.#options = options;
    this.#now = options.now ?? (() => performance.now());
  }

  /** The renderer that draws now; null while none is open. */
  get renderer(): SceneRenderer | null {
    return this.#renderer;
  }

  /** Opens the 3D view, or the map where there is no WebGPU. */
  async open(): Promise<void> {
    const reason = await this.#openView(console.error);
    if (reason === null || this.#disposed) return;
    this.#options.say(msg(str`${reason} You can draw on the map too.`));
    this.#openMap(reason);
  }

  /** Tries the 3D view once more, from the map. */
  async retry(): Promise<void> {
    if (this.#opening || this.#renderer?.kind !== "map") return;
    this.#losses = [];
    this.#tell(msg("Opening the 3D view …"));
    this.#close();
    if (await this.#reopen()) this.#tell(msg("The 3D view is open again."), NOTICE_MS);
  }

  dismiss(): void {
    clearTimeout(this.#fading);
    this.notice.value = null;
  }

  dispose(): void {
    this.#disposed = true;
    clearTimeout(this.#fading);
    this.#close();
  }

  #close(): void {
    const old = this.#renderer;
    this.#renderer = null;
    old?.destroy();
  }

  #tell(text: string, passesMs?: number, retry = false): void {
    clearTimeout(this.#fading);
    const notice = { text, retry };
    this.notice.value = notice;
    if (passesMs === undefined) return;
    this.#fading = setTimeout(() => {
      if (this.notice.value === notice) this.notice.value = null;
    }, passesMs);
  }

  /** Null when the 3D view is open, else why not. */
  async #openView(report: (error: unknown) => void): Promise<string | null> {
    this.#opening = true;
    try {
      this.#use(await createRenderer(this.#newCanvas()));
      this.reason.value = null;
      return null;
    } catch (error) {
      if (error instanceof NoWebGpu) return error.message;
      report(error);
      return msg("The 3D view could not start.");
    } finally {
      this.#opening = false;
    }
  }

  #openMap(reason: string): void {
    const { mode } = this.#options.camera.state.peek();
    if (mode !== "map") this.#modeBefore = mode;
    this.reason.value = reason;
    this.#options.camera.setMode("map");
    this.#use(createMapRenderer(this.#newCanvas()));
  }

  /** A canvas that was asked for one kind of context cannot give another. */
  #newCanvas(): HTMLCanvasElement {
    const { viewport, camera } = this.#options;
    const canvas = document.createElement("canvas");
    const { width, height } = camera.state.peek();
    Object.assign(canvas, { width, height });
    canvas.setAttribute("aria-hidden", "true");
    viewport.querySelector("canvas")?.remove();
    viewport.prepend(canvas);
    return canvas;
  }

  #use(renderer: SceneRenderer): void {
    if (this.#disposed) {
      renderer.destroy();
      return;
    }
    this.#renderer = renderer;
    const { kind, software } = renderer;
    // What a device calls itself is the same in all languages.
    const description = kind === "map" ? msg("2D map") : renderer.description;
    this.info.value = { kind, description, software };
    void renderer.lost.then((reason) => this.#lost(renderer, reason));
    this.#options.onOpened();
  }

  async #lost(renderer: SceneRenderer, reason: string): Promise<void> {
    if (this.#disposed || this.#renderer !== renderer) return;
    console.warn(`The graphics device was lost: ${reason}`);
    this.#close();
    const now = this.#now();
    this.#losses = [...this.#losses.filter((at) => now - at < LOSS_WINDOW_MS), now];
    if (this.#losses.length > MOST_LOSSES) {
      this.#standIn(msg("The graphics device was lost again and again."));
      return;
    }
    this.#tell(msg("The graphics device was lost. Opening the 3D view again …"));
    if (await this.#reopen()) this.#tell(msg("The graphics device was lost; the 3D view is open again."), NOTICE_MS);
  }

  /** Opens another 3D view where one was before; the map when there is none to be had. */
  async #reopen(): Promise<boolean> {
    let reason: string | null = null;
    for (const wait of RETRY_MS) {
      if (wait > 0) await new Promise((done) => setTimeout(done, wait));
      if (this.#disposed) return false;
      // A device that is lost while it opens is no news here.
      reason = await this.#openView(console.warn);
      if (this.#disposed) return false;
      if (reason !== null) continue;
      if (this.#modeBefore !== null && this.#options.camera.state.peek().mode === "map")
        this.#options.camera.setMode(this.#modeBefore);
      this.#modeBefore = null;
      return true;
    }
    this.#standIn(reason ?? msg("The 3D view could not start."));
    return false;
  }

  #standIn(reason: string): void {
    this.#openMap(reason);
    this.#tell(msg(str`${reason} The map is shown instead; you can draw on it too.`), undefined, true);
  }
}
