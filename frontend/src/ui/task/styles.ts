import { css } from "lit";

/** The panel of a task, for who draws and for who writes it. */
export const taskStyles = css`
  h2 {
    font-size: 1.0625rem;
    font-weight: 650;
    letter-spacing: -0.01em;
    text-wrap: balance;
  }
  .text {
    display: grid;
    gap: 8px;
    line-height: 1.5;
    overflow-wrap: anywhere;
  }
  .text p {
    margin: 0;
  }
  .goal {
    padding-left: 10px;
    border-left: 3px solid var(--esk-accent);
    font-size: 0.875rem;
  }
  .pictures {
    display: grid;
    gap: 8px;
  }
  .pictures img {
    width: 100%;
    border-radius: 8px;
  }
  .score {
    display: grid;
    grid-template-columns: auto 1fr;
    align-items: center;
    gap: 4px 12px;
  }
  .points {
    font-size: 1.75rem;
    font-weight: 680;
    font-variant-numeric: tabular-nums;
    line-height: 1;
  }
  .points small {
    color: var(--esk-quiet);
    font-size: 0.75rem;
    font-weight: 450;
  }
  .bar {
    height: 10px;
    overflow: hidden;
    border-radius: 5px;
    background: var(--esk-hover);
    box-shadow: inset 0 0 0 1px var(--esk-line);
  }
  .bar i {
    display: block;
    height: 100%;
    border-radius: 5px;
    background: var(--esk-accent);
    transition: width 300ms ease-out;
  }
  .why {
    grid-column: 1 / -1;
    color: var(--esk-quiet);
    font-size: 0.8125rem;
  }
  .switches {
    display: grid;
    gap: 2px;
  }
  .switches wa-switch {
    min-height: 40px;
    align-content: center;
  }
  .buttons {
    display: flex;
    flex-wrap: wrap;
    gap: 6px;
  }
  .contour-map {
    display: block;
    width: 100%;
    height: auto;
    border: 1px solid var(--esk-line-strong);
    border-radius: 6px;
    background: #fbf7ee;
  }
  .contour-map path {
    fill: none;
    stroke: #8a5a33;
    stroke-width: 0.7;
  }
  .contour-map .index {
    stroke-width: 1.5;
  }
  .contour-map text {
    fill: #6d4322;
    font: 600 8px var(--wa-font-family-body);
    text-anchor: middle;
    paint-order: stroke;
    stroke: #fbf7ee;
    stroke-width: 2.5px;
  }
  .field-label {
    display: grid;
    gap: 3px;
    color: var(--esk-quiet);
    font-size: 0.75rem;
  }
  input.field,
  select.field,
  textarea.field {
    width: 100%;
    padding: 6px 8px;
    border-radius: 8px;
    font: inherit;
    font-size: 0.875rem;
  }
  textarea.field {
    min-height: 120px;
    resize: vertical;
  }
  .two {
    display: grid;
    grid-template-columns: 1fr 1fr;
    gap: 8px;
  }
  .wrong {
    color: var(--esk-warn-text, var(--esk-warn));
    font-size: 0.8125rem;
  }
  .thumb {
    display: flex;
    align-items: center;
    gap: 8px;
  }
  .thumb img {
    width: 64px;
    border-radius: 6px;
  }
  @media (pointer: coarse) {
    .btn {
      min-height: 44px;
    }
    input.field,
    select.field {
      min-height: 44px;
      font-size: 1rem;
    }
  }
`;
