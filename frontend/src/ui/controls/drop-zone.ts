import { css, html, LitElement, nothing, type TemplateResult } from "lit";
import { shared } from "../styles/shared.ts";
import { icon } from "./icons.ts";

/** Takes files that are dragged anywhere over the window. Fires `files` with them; shows where they would go meanwhile. */
export class EskDropZone extends LitElement {
  static override properties = { lead: { type: String }, detail: { type: String }, over: { state: true } };
  static override styles = [
    shared,
    css`
      :host {
        position: fixed;
        inset: 0;
        z-index: 5;
        pointer-events: none;
      }
      .veil {
        position: absolute;
        inset: 14px;
        display: grid;
        place-content: center;
        justify-items: center;
        gap: 8px;
        padding: 24px;
        border: 2px dashed var(--esk-accent);
        border-radius: 20px;
        background: color-mix(in oklab, var(--esk-panel-solid) 78%, transparent);
        color: var(--esk-text);
        text-align: center;
      }
      .veil > .icon {
        width: 44px;
        height: 44px;
        color: var(--esk-accent-text);
      }
      strong {
        font-size: 1.125rem;
      }
      p {
        max-width: 46ch;
        color: var(--esk-quiet);
      }
    `,
  ];

  declare lead: string;
  declare detail: string;
  declare over: boolean;
  #abort = new AbortController();

  constructor() {
    super();
    this.lead = "";
    this.detail = "";
    this.over = false;
  }

  override connectedCallback(): void {
    super.connectedCallback();
    this.#abort = new AbortController();
    const { signal } = this.#abort;
    const on = (type: "dragenter" | "dragover" | "dragleave" | "drop", run: (e: DragEvent) => void): void =>
      window.addEventListener(type, run, { signal });
    on("dragenter", (e) => this.#moved(e));
    on("dragover", (e) => this.#moved(e));
    on("dragleave", (e) => {
      // The pointer went out of the window, not from one element to the next.
      if (e.relatedTarget === null) this.over = false;
    });
    on("drop", (e) => this.#dropped(e));
  }

  override disconnectedCallback(): void {
    super.disconnectedCallback();
    this.#abort.abort();
  }

  #moved(event: DragEvent): void {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = "copy";
    this.over = true;
  }

  #dropped(event: DragEvent): void {
    this.over = false;
    const files = [...(event.dataTransfer?.files ?? [])];
    if (files.length === 0) return;
    event.preventDefault();
    this.dispatchEvent(new CustomEvent<File[]>("files", { detail: files }));
  }

  protected override render(): TemplateResult | typeof nothing {
    if (!this.over) return nothing;
    return html`<div class="veil">
      ${icon("landscape")}<strong>${this.lead}</strong>
      <p>${this.detail}</p>
    </div>`;
  }
}

customElements.define("esk-drop-zone", EskDropZone);
