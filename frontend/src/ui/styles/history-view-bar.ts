import { css } from "lit";

/** The bar over a picture of the past. */
export const historyViewBarStyles = css`
  :host {
    position: absolute;
    left: 50%;
    top: 72px;
    width: min(560px, calc(100% - 16px));
    transform: translateX(-50%);
    z-index: 1;
  }
  :host([beside]) {
    left: calc(50% - 130px);
    width: min(560px, calc(100% - 424px));
  }
  .bar {
    display: grid;
    gap: 8px;
    padding: 10px 12px;
    border-color: var(--esk-accent);
    box-shadow:
      0 0 0 1px var(--esk-accent),
      0 8px 30px rgb(0 0 0 / 18%);
  }
  .row {
    display: flex;
    align-items: center;
    gap: 10px;
    min-width: 0;
  }
  .row > .icon {
    flex: none;
    color: var(--esk-accent-text);
  }
  .head {
    flex-wrap: wrap;
  }
  /* Where there is no room for all in one row, the buttons share a second one. */
  .says {
    flex: 100 1 170px;
    min-width: 0;
    display: grid;
    line-height: 1.25;
  }
  .says strong {
    font-weight: 650;
  }
  .says span {
    overflow: hidden;
    color: var(--esk-quiet);
    font-size: 0.8125rem;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .btn {
    flex: none;
  }
  .head .btn {
    flex: 1 0 auto;
  }
  input[type="range"] {
    flex: 1;
    min-width: 0;
    accent-color: var(--esk-accent);
  }
  .speed {
    min-width: 48px;
    font-variant-numeric: tabular-nums;
  }
  @media (max-width: 720px) {
    :host,
    :host([beside]) {
      left: 8px;
      right: 8px;
      top: 60px;
      width: auto;
      transform: none;
    }
  }
`;
