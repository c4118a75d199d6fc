import { css } from "lit";

/** What the water panel has beside the measuring panel's styles. */
export const waterStyles = css`
  .chart .before {
    stroke: #2f7fd0;
    stroke-width: 2;
    stroke-dasharray: none;
  }
  .chart .wet {
    fill: color-mix(in oklab, #2f7fd0 26%, transparent);
  }
  .chart .flow {
    fill: none;
    stroke: #2f7fd0;
    stroke-width: 2;
    stroke-linejoin: round;
  }
  .chart .rain {
    fill: color-mix(in oklab, #2f7fd0 14%, transparent);
  }
  .body.pair {
    grid-template-columns: minmax(0, 1fr) minmax(0, 1fr);
    gap: 8px 22px;
    align-items: start;
  }
  .controls {
    display: grid;
    gap: 10px;
  }
  .row {
    display: flex;
    flex-wrap: wrap;
    align-items: end;
    gap: 8px 12px;
  }
  .row esk-number {
    width: 128px;
  }
  h4 {
    margin: 0 0 2px;
    font-size: 0.75rem;
    font-weight: 600;
    color: var(--esk-quiet);
  }
  .large {
    font-size: 1.25rem;
    font-weight: 600;
    font-variant-numeric: tabular-nums;
  }
  .switch {
    display: flex;
    align-items: center;
    gap: 8px;
    min-height: 30px;
    color: var(--esk-text);
  }
  @media (max-width: 720px) {
    .body.pair {
      grid-template-columns: minmax(0, 1fr);
    }
  }
`;
