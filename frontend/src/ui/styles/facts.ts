import { css } from "lit";

/** A list of facts, name and value, that unfolds from its summary. */
export const factsStyles = css`
  summary {
    width: max-content;
    cursor: pointer;
    color: var(--esk-quiet);
  }
  dl {
    display: grid;
    grid-template-columns: auto 1fr;
    gap: 3px 12px;
    margin: 6px 0 0;
  }
  dt {
    color: var(--esk-quiet);
  }
  dd {
    margin: 0;
    text-align: right;
    overflow-wrap: anywhere;
    font-variant-numeric: tabular-nums;
  }
`;
