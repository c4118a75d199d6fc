import { msg, str } from "@lit/localize";
import { css, html, type TemplateResult } from "lit";
import type { ToastList } from "../../app/toasts.ts";
import { shared } from "../styles/shared.ts";
import { icon } from "./icons.ts";
import { SignalElement } from "./signal-element.ts";

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
        animation: rise 160ms ease-out;
      }
      .toast.warn .mark {
        color: var(--esk-warn);
      }
      /* A line may begin under a sentence: only its cross takes the pointer. */
      .toast button {
        pointer-events: auto;
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
            ${t.times > 1 ? html`<span class="times" aria-label=${msg(str`${t.times} times`)}>×${t.times}</span>` : null}
            ${
              t.act
                ? html`<button
                    class="btn outline act"
                    @click=${() => {
                      this.toasts.dismiss(t.id);
                      t.act?.run();
                    }}
                  >
                    ${t.act.label}
                  </button>`
                : null
            }
            <button class="icon-btn small" aria-label=${msg("Dismiss")} @click=${() => this.toasts.dismiss(t.id)}>
              ${icon("xmark")}
            </button>
          </div>
        `,
      )}
    </div>`;
  }
}

customElements.define("esk-toasts", EskToasts);
