import { css } from "lit";

/** Styles of the activity log. */
export const historyPanelStyles = css`
  .ways {
    display: grid;
  }
  .entries {
    display: grid;
    gap: 1px;
    margin: 0 -6px;
    padding: 0;
    list-style: none;
  }
  .item {
    display: grid;
    grid-template-columns: auto 1fr auto;
    gap: 10px;
    align-items: center;
    height: auto;
    min-height: 40px;
    padding: 6px 8px;
    text-align: left;
    white-space: normal;
    line-height: 1.3;
  }
  .mark {
    display: grid;
    place-items: center;
    width: 26px;
    height: 26px;
    border-radius: 50%;
    background: color-mix(in oklab, var(--who) 22%, transparent);
    box-shadow: inset 0 0 0 1.5px var(--who);
  }
  .item .mark .icon {
    width: 14px;
    height: 14px;
    color: var(--esk-text);
  }
  .what {
    font-size: 0.8125rem;
    font-weight: 450;
    overflow-wrap: anywhere;
  }
  .what b {
    font-weight: 620;
  }
  .when {
    max-width: 84px;
    color: var(--esk-quiet);
    font-size: 0.6875rem;
    text-align: right;
  }
  .item[aria-pressed="true"] {
    background: color-mix(in oklab, var(--esk-accent) 18%, transparent);
  }
  .later {
    opacity: 0.5;
  }
  .end {
    text-align: center;
  }
`;
