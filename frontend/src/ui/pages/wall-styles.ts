import { css } from "lit";

/** The wall: readable from the last row, quiet between the pictures. */
export const wallStyles = css`
  :host {
    display: grid;
    grid-template-rows: auto auto 1fr auto;
    min-height: 100vh;
    background: var(--esk-bg);
    color: var(--esk-text);
  }
  header {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 8px 28px;
    padding: 16px clamp(14px, 2.4vw, 40px) 12px;
  }
  .title {
    flex: 1 1 16em;
    min-width: 0;
  }
  .title h1 {
    margin: 0;
    font-size: clamp(1.5rem, 2.6vw, 2.6rem);
    font-weight: 680;
    letter-spacing: -0.025em;
    line-height: 1.12;
    overflow-wrap: anywhere;
  }
  .title p {
    margin-top: 2px;
    font-size: clamp(0.9rem, 1.1vw, 1.1rem);
  }
  .door {
    display: flex;
    align-items: center;
    gap: 18px;
    padding: 8px 10px 8px 20px;
    border: 1px solid var(--esk-line);
    border-radius: 18px;
    background: var(--esk-panel-solid);
  }
  .door .letters {
    font: 700 clamp(1.8rem, 3.4vw, 3.4rem) / 1 ui-monospace, "SF Mono", Menlo, Consolas, monospace;
    letter-spacing: 0.06em;
    font-variant-ligatures: none;
  }
  .door small {
    display: block;
    margin-bottom: 4px;
    color: var(--esk-quiet);
    font-size: 0.875rem;
  }
  .qr {
    padding: 8px;
    border-radius: 12px;
    background: #fff;
    line-height: 0;
  }
  .tools {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 8px;
    padding: 0 clamp(14px, 2.4vw, 40px) 14px;
  }
  .tools .grow {
    flex: 1 1 0;
  }
  .tools esk-segmented {
    min-width: min(320px, 100%);
  }
  .tools input {
    width: 13em;
  }
  .notice {
    margin: 0 clamp(14px, 2.4vw, 40px) 14px;
    padding: 10px 16px;
    border-radius: 12px;
    background: var(--esk-accent-soft);
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 8px 14px;
  }
  ul {
    display: grid;
    grid-template-columns: repeat(auto-fill, minmax(var(--card, 220px), 1fr));
    align-content: start;
    gap: clamp(12px, 1.3vw, 24px);
    margin: 0;
    padding: 2px clamp(14px, 2.4vw, 40px) 32px;
    list-style: none;
  }
  .copy {
    position: relative;
    display: grid;
    width: 100%;
    padding: 0;
    border: 0;
    border-radius: 16px;
    background: var(--esk-panel-solid);
    box-shadow: 0 0 0 1px var(--esk-line), 0 8px 24px -16px rgb(15 21 27 / 45%);
    overflow: hidden;
    text-align: left;
    cursor: pointer;
    transition: box-shadow 140ms ease, transform 140ms ease;
  }
  .copy:hover {
    transform: translateY(-2px);
    box-shadow: 0 0 0 1px var(--esk-line-strong), 0 18px 34px -18px rgb(15 21 27 / 55%);
  }
  .copy[aria-pressed="true"] {
    box-shadow: 0 0 0 3px var(--esk-accent), 0 14px 30px -18px rgb(15 21 27 / 55%);
  }
  .picture {
    position: relative;
    aspect-ratio: 1;
    background: linear-gradient(160deg, #dfe3cf, #cfd6c4);
  }
  .picture canvas {
    display: block;
    width: 100%;
    height: 100%;
    opacity: 0;
    transition: opacity 300ms ease;
  }
  .picture canvas.drawn {
    opacity: 1;
  }
  .badges {
    position: absolute;
    inset: 10px 10px auto auto;
    display: flex;
    gap: 6px;
  }
  .badge {
    display: inline-flex;
    align-items: center;
    gap: 5px;
    padding: 4px 9px;
    border-radius: 99px;
    background: rgb(252 252 251 / 90%);
    color: #19222b;
    font: 600 0.8125rem / 1.2 var(--wa-font-family-body);
  }
  .badge.shown {
    background: var(--esk-accent);
    color: #fff;
  }
  /* The score: a ring that closes with it. */
  .points {
    position: absolute;
    right: 12px;
    bottom: 12px;
    display: grid;
    place-items: center;
    width: 44px;
    aspect-ratio: 1;
    border-radius: 50%;
    background:
      radial-gradient(closest-side, var(--esk-panel-solid) 78%, transparent 80%),
      conic-gradient(var(--esk-accent) var(--done), var(--esk-line-strong) 0);
    font: 680 0.9375rem / 1 var(--wa-font-family-body);
    font-variant-numeric: tabular-nums;
  }
  .copy:has(.points) .words {
    padding-right: 62px;
  }
  .words {
    display: grid;
    gap: 1px;
    padding: 10px 14px 13px;
  }
  .name {
    display: flex;
    align-items: center;
    gap: 9px;
    min-width: 0;
    font-size: clamp(1.02rem, 1.25vw, 1.4rem);
    font-weight: 640;
    letter-spacing: -0.01em;
  }
  .name span {
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .dot {
    flex: none;
    width: 11px;
    height: 11px;
    border-radius: 50%;
    background: var(--esk-line-strong);
  }
  .dot.here {
    background: #2fa563;
    box-shadow: 0 0 0 4px rgb(47 165 99 / 18%);
  }
  .facts {
    color: var(--esk-quiet);
    font-size: clamp(0.8125rem, 0.95vw, 1rem);
  }
  .empty {
    display: grid;
    place-content: center;
    justify-items: center;
    gap: 10px;
    padding: 6vh 20px 10vh;
    text-align: center;
    font-size: 1.125rem;
  }
  .alone {
    grid-row: 1 / -1;
  }
  .empty .letters {
    font: 700 clamp(3.4rem, 12vw, 11rem) / 1 ui-monospace, "SF Mono", Menlo, Consolas, monospace;
    letter-spacing: 0.05em;
    font-variant-ligatures: none;
  }
  .empty .where {
    font-size: clamp(1.1rem, 2.4vw, 2.2rem);
  }
  .empty .qr {
    margin: 10px 0 6px;
  }
  footer {
    position: sticky;
    bottom: 0;
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 8px;
    padding: 10px clamp(14px, 2.4vw, 40px);
    border-top: 1px solid var(--esk-line);
    background: var(--esk-panel);
    backdrop-filter: blur(10px);
  }
  footer .count {
    font-weight: 600;
    margin-right: 6px;
  }
  .problem {
    color: var(--esk-bad);
    font-weight: 550;
  }
  .problem:empty {
    display: none;
  }
  @media (max-width: 760px) {
    header {
      gap: 10px;
    }
    .door {
      flex: 1 1 100%;
      justify-content: space-between;
    }
    ul {
      grid-template-columns: repeat(auto-fill, minmax(150px, 1fr));
    }
    .tools esk-segmented {
      flex: 1 1 100%;
    }
    .tools input {
      flex: 1 1 9em;
    }
  }
  @media (prefers-reduced-motion: reduce) {
    .copy,
    .picture canvas {
      transition: none;
    }
  }
`;

export const joinStyles = css`
  :host {
    display: grid;
    place-content: center;
    min-height: 100vh;
    padding: 24px 16px;
    background: var(--esk-bg);
    color: var(--esk-text);
  }
  main {
    display: grid;
    gap: 18px;
    width: min(440px, 92vw);
    padding: 28px;
  }
  .brand {
    display: inline-flex;
    align-items: center;
    gap: 10px;
    font-weight: 650;
    text-decoration: none;
    color: inherit;
  }
  h1 {
    margin: 0;
    font-size: clamp(1.5rem, 5vw, 2rem);
    letter-spacing: -0.02em;
    line-height: 1.15;
    overflow-wrap: anywhere;
  }
  form,
  .choices {
    display: grid;
    gap: 12px;
  }
  label {
    display: grid;
    gap: 6px;
    font-weight: 550;
  }
  .field {
    min-height: 48px;
    font-size: 1.125rem;
  }
  .btn.big {
    min-height: 52px;
    font-size: 1.0625rem;
  }
  fieldset {
    display: grid;
    gap: 8px;
    margin: 0;
    padding: 0;
    border: 0;
  }
  fieldset label {
    display: flex;
    align-items: center;
    gap: 10px;
    min-height: 44px;
    padding: 6px 12px;
    border: 1px solid var(--esk-line);
    border-radius: 12px;
    font-weight: 500;
  }
  .problem {
    color: var(--esk-bad);
    font-weight: 550;
  }
  .problem:empty {
    display: none;
  }
`;
