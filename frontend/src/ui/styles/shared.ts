import { css } from "lit";

/** Styles that every component of the page shares: reset, panels, buttons, text roles. */
export const shared = css`
  *,
  *::before,
  *::after {
    box-sizing: border-box;
  }
  :host([hidden]),
  [hidden] {
    display: none !important;
  }
  h1,
  h2,
  h3,
  p {
    margin: 0;
  }
  a {
    color: inherit;
  }
  :focus-visible {
    outline: 2px solid var(--esk-focus);
    outline-offset: 2px;
  }
  .icon {
    width: 1.25em;
    height: 1.25em;
    flex: none;
    display: block;
  }
  .panel {
    background: var(--esk-panel);
    border: 1px solid var(--esk-line);
    border-radius: var(--esk-radius);
    box-shadow: var(--esk-shadow);
    color: var(--esk-text);
  }
  .quiet {
    color: var(--esk-quiet);
  }
  .visually-hidden {
    position: absolute;
    width: 1px;
    height: 1px;
    overflow: hidden;
    clip-path: inset(50%);
    white-space: nowrap;
  }
  button {
    font: inherit;
    color: inherit;
  }
  .btn,
  .icon-btn {
    appearance: none;
    display: inline-flex;
    align-items: center;
    justify-content: center;
    gap: 0.5em;
    min-height: 36px;
    padding: 0 0.9em;
    border: 1px solid transparent;
    border-radius: 10px;
    background: transparent;
    color: inherit;
    font: 500 0.9375rem / 1 var(--wa-font-family-body);
    text-decoration: none;
    white-space: nowrap;
    cursor: pointer;
    user-select: none;
    touch-action: manipulation;
    transition: background-color 120ms ease, border-color 120ms ease, color 120ms ease;
  }
  .btn {
    font-size: 0.875rem;
  }
  .btn:hover,
  .icon-btn:hover {
    background: var(--esk-hover);
  }
  .btn:active,
  .icon-btn:active {
    background: var(--esk-press);
  }
  .btn:disabled,
  .icon-btn:disabled,
  .icon-btn[aria-disabled="true"] {
    opacity: 0.38;
    cursor: default;
    background: transparent;
  }
  .btn.primary {
    background: var(--esk-accent);
    color: #fff;
  }
  .btn.primary:hover:not(:disabled) {
    background: var(--esk-accent-hover);
  }
  .btn.danger {
    background: #b3261e;
    color: #fff;
  }
  .btn.danger:hover:not(:disabled) {
    background: #93201a;
  }
  .btn.outline {
    border-color: var(--esk-edge);
  }
  .icon-btn {
    flex: none;
    width: 40px;
    height: 40px;
    min-height: 0;
    padding: 0;
    font-size: 16px;
  }
  .icon-btn.small {
    width: 32px;
    height: 32px;
    border-radius: 8px;
    font-size: 15px;
  }
  .icon-btn[aria-pressed="true"],
  .icon-btn[aria-checked="true"] {
    background: var(--esk-accent-soft);
    color: var(--esk-accent-text);
  }
  .field {
    appearance: none;
    height: 36px;
    min-width: 0;
    padding: 0 0.75em;
    border: 1px solid var(--esk-edge);
    border-radius: 10px;
    background: var(--esk-field);
    color: var(--esk-text);
    font: 400 0.875rem / 1 var(--wa-font-family-body);
  }
  .field::placeholder {
    color: var(--esk-quiet);
  }
  /* A finger covers 40 pixels. */
  @media (pointer: coarse) {
    .btn,
    .field {
      min-height: 40px;
    }
    .icon-btn.small {
      width: 40px;
      height: 40px;
    }
  }
  @media (prefers-reduced-motion: reduce) {
    *,
    *::before,
    *::after {
      transition-duration: 0ms !important;
      animation-duration: 0ms !important;
      animation-iteration-count: 1 !important;
    }
  }
`;
