import { css } from "lit";

export const measurePanelStyles = css`
  :host {
    display: grid;
    grid-template-columns: minmax(0, 1fr);
    gap: 8px;
    padding: 10px 12px 12px;
    font-size: 0.8125rem;
    min-height: 0;
  }
  header {
    display: flex;
    align-items: center;
    gap: 4px;
  }
  header .space {
    flex: 1;
  }
  .body {
    display: grid;
    grid-template-columns: minmax(0, 1fr) minmax(208px, auto);
    gap: 4px 18px;
    min-height: 0;
    overflow: auto;
    scrollbar-width: thin;
  }
  .body.plain {
    grid-template-columns: minmax(0, 1fr);
  }
  .empty,
  .problem {
    padding: 8px 4px;
    color: var(--esk-quiet);
    text-wrap: balance;
  }
  .problem {
    color: var(--esk-accent-text);
  }
  svg.chart {
    display: block;
    width: 100%;
    touch-action: none;
    overflow: visible;
  }
  .chart text {
    fill: var(--esk-quiet);
    font-size: 0.6875rem;
    font-variant-numeric: tabular-nums;
  }
  .grid {
    stroke: var(--esk-line);
  }
  .axis {
    fill: none;
    stroke: var(--esk-line-strong);
  }
  .ground {
    fill: color-mix(in oklab, #b07a45 34%, transparent);
  }
  .crest {
    fill: none;
    stroke: #a9652f;
    stroke-width: 2;
    stroke-linejoin: round;
  }
  .high {
    fill: #d23f36;
    fill-opacity: 0.72;
  }
  .low {
    fill: #2f6fc9;
    fill-opacity: 0.72;
  }
  .asked {
    fill: none;
    stroke: var(--esk-text);
    stroke-width: 1.6;
    stroke-dasharray: 7 4;
  }
  .before {
    fill: none;
    stroke: var(--esk-quiet);
    stroke-width: 1.4;
    stroke-dasharray: 5 4;
  }
  .corner {
    stroke: #e0a92a;
    stroke-dasharray: 2 3;
  }
  .mark {
    stroke: var(--esk-accent);
  }
  .dot {
    fill: var(--esk-accent);
    stroke: #fff;
    stroke-width: 1.5;
  }
  .chart text.here {
    fill: var(--esk-text);
    font-weight: 600;
  }
  dl {
    display: grid;
    grid-template-columns: auto 1fr;
    align-content: start;
    gap: 3px 12px;
    margin: 0;
    font-variant-numeric: tabular-nums;
  }
  dl.wide {
    grid-template-columns: repeat(2, auto 1fr);
    gap: 4px 14px;
  }
  dt {
    color: var(--esk-quiet);
  }
  dd {
    margin: 0;
    text-align: right;
    white-space: nowrap;
  }
  dd.rise {
    color: var(--esk-accent-text);
  }
  .foot {
    grid-column: 1 / -1;
    display: flex;
    flex-wrap: wrap;
    align-items: end;
    gap: 8px 14px;
  }
  .foot label {
    display: flex;
    align-items: center;
    gap: 6px;
    color: var(--esk-quiet);
  }
  .foot select {
    height: 30px;
    padding: 0 6px;
    border-radius: 8px;
  }
  .foot esk-number {
    width: 132px;
  }
  .small-text {
    color: var(--esk-quiet);
    font-size: 0.75rem;
  }
  details {
    grid-column: 1 / -1;
  }
  summary {
    width: max-content;
    cursor: pointer;
    color: var(--esk-quiet);
  }
  .points {
    display: grid;
    grid-template-columns: auto repeat(2, minmax(84px, 120px)) auto;
    align-items: end;
    gap: 6px 8px;
    padding-top: 6px;
  }
  .points > span {
    padding-bottom: 7px;
    color: var(--esk-quiet);
  }
  @media (pointer: coarse) {
    .foot select {
      height: 44px;
    }
  }
  @media (max-width: 720px) {
    .body {
      grid-template-columns: minmax(0, 1fr);
    }
    dl,
    dl.wide {
      grid-template-columns: repeat(2, auto 1fr);
    }
  }
  @media (max-width: 520px) {
    dl,
    dl.wide {
      gap: 3px 8px;
      font-size: 0.75rem;
    }
    dl.wide {
      grid-template-columns: auto 1fr;
    }
    header .btn {
      padding: 0 6px;
    }
    header .btn .icon {
      display: none;
    }
  }
`;
