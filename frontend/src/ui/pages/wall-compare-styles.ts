import { css } from "lit";

/** Two pictures as large as they can be, with their names on them; what one chooses above, what it means below. */
export const compareStyles = css`
  :host {
    position: fixed;
    inset: 0;
    z-index: 10;
    display: grid;
    grid-template-rows: auto minmax(0, 1fr) auto;
    background: var(--esk-bg);
    color: var(--esk-text);
  }
  header,
  footer {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 8px 14px;
    padding: 10px clamp(10px, 1.6vw, 24px);
  }
  footer {
    min-height: 44px;
    color: var(--esk-quiet);
    font-size: clamp(0.875rem, 1.1vw, 1.05rem);
  }
  footer p {
    margin: 0;
    text-wrap: balance;
  }
  .grow {
    flex: 1;
  }
  .pair {
    display: grid;
    grid-template-columns: minmax(0, 1fr) minmax(0, 1fr);
    gap: 3px;
    min-height: 0;
    cursor: grab;
  }
  .pair:active {
    cursor: grabbing;
  }
  .pair:focus-visible {
    outline: 2px solid var(--esk-accent);
    outline-offset: -2px;
  }
  figure {
    position: relative;
    min-width: 0;
    min-height: 0;
    margin: 0;
    overflow: hidden;
    background: #0e1216;
  }
  .picture,
  canvas {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
  }
  .picture {
    touch-action: none;
    user-select: none;
  }
  figcaption {
    position: absolute;
    left: 14px;
    top: 12px;
    max-width: calc(100% - 28px);
    padding: 6px 14px;
    border-radius: 99px;
    background: rgb(14 18 22 / 82%);
    color: #eef1f3;
    font-size: clamp(1.05rem, 1.8vw, 1.8rem);
    font-weight: 640;
    overflow-wrap: anywhere;
    pointer-events: none;
  }
  .spot {
    display: inline-block;
    width: 0.9em;
    height: 0.9em;
    margin: 0 0.25em 0 0.5em;
    border-radius: 3px;
    vertical-align: -0.1em;
  }
  .spot:first-child {
    margin-left: 0;
  }
  .high {
    background: #d23f36;
  }
  .low {
    background: #2f6fc9;
  }
  @media (max-aspect-ratio: 1/1) {
    .pair {
      grid-template-columns: minmax(0, 1fr);
      grid-template-rows: minmax(0, 1fr) minmax(0, 1fr);
    }
  }
`;
