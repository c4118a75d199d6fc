import { signal } from "@preact/signals-core";
import { css, html, type TemplateResult } from "lit";
import { icon } from "./icons.ts";
import { SignalElement } from "./signal-element.ts";
import { shared } from "./styles/shared.ts";

export interface Toast {
  readonly id: number;
  readonly text: string;
  readonly tone: "info" | "warn";
  /** How often the same sentence came while it stood. */
  readonly times: number;
}

const SHOW_MS = 6000;
const MOST = 3;

/** Short sentences that need no answer. The same sentence again counts up instead of piling up. */
export class ToastList {
  readonly list = signal<readonly Toast[]>([]);
  readonly #timers = new Map<number, ReturnType<typeof setTimeout>>();
  #next = 1;

  show(text: string, tone: Toast["tone"] = "info"): void {
    const same = this.list.value.find((t) => t.text === text);
    const toast: Toast = same ? { ...same, times: same.times + 1 } : { id: this.#next++, text, tone, times: 1 };
    const others = this.list.value.filter((t) => t.id !== toast.id);
    const next = [...others, toast];
    for (const old of next.slice(0, -MOST)) this.#stopTimer(old.id);
    this.list.value = next.slice(-MOST);
    this.#stopTimer(toast.id);
    this.#timers.set(
      toast.id,
      setTimeout(() => this.dismiss(toast.id), SHOW_MS + 40 * text.length),
    );
  }

  dismiss(id: number): void {
    this.#stopTimer(id);
    this.list.value = this.list.value.filter((t) => t.id !== id);
  }

  dispose(): void {
    for (const timer of this.#timers.values()) clearTimeout(timer);
    this.#timers.clear();
  }

  #stopTimer(id: number): void {
    const timer = this.#timers.get(id);
    if (timer !== undefined) clearTimeout(timer);
    this.#timers.delete(id);
  }
}

/** Shows a toast list; announced politely to screen readers. */
export class EskToasts extends SignalElement {
  static override properties = { toasts: { attribute: false } };
  static override styles = [
    shared,
    css`
      :host {
        display: grid;
        justify-items: center;
        gap: 8px;
        pointer-events: none;
      }
      .toast {
        display: flex;
        align-items: center;
        gap: 10px;
        max-width: min(460px, 100%);
        padding: 8px 6px 8px 14px;
        border-radius: 12px;
        pointer-events: auto;
        animation: rise 160ms ease-out;
      }
      .toast.warn .mark {
        color: var(--esk-warn);
      }
      .mark {
        color: var(--esk-accent-text);
      }
      .times {
        padding: 0 6px;
        border-radius: 8px;
        background: var(--esk-hover);
        font-size: 0.75rem;
      }
      @keyframes rise {
        from {
          opacity: 0;
          transform: translateY(8px);
        }
      }
    `,
  ];

  declare toasts: ToastList;

  protected override render(): TemplateResult {
    return html`<div role="status" aria-live="polite" style="display: contents">
      ${this.toasts.list.value.map(
        (t) => html`
          <div class="toast panel ${t.tone}">
            <span class="mark">${icon(t.tone === "warn" ? "warning" : "info")}</span>
            <span>${t.text}</span>
            ${t.times > 1 ? html`<span class="times" aria-label=${`${t.times} times`}>×${t.times}</span>` : null}
            <button class="icon-btn small" aria-label="Dismiss" @click=${() => this.toasts.dismiss(t.id)}>
              ${icon("xmark")}
            </button>
          </div>
        `,
      )}
    </div>`;
  }
}

customElements.define("esk-toasts", EskToasts);
