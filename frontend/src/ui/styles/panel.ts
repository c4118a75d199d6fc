import { css } from "lit";

/** The contents of the panel at the right: the inspector and the terrain's settings. */
export const panelStyles = css`
  :host {
    display: grid;
    gap: 14px;
    align-content: start;
  }
  .title {
    display: flex;
    align-items: center;
    gap: 8px;
  }
  .name {
    flex: 1;
    font-weight: 600;
    border-color: transparent;
    background: transparent;
  }
  .name:hover:not(:disabled),
  .name:focus {
    border-color: var(--esk-line-strong);
    background: var(--esk-field);
  }
  .swatch {
    flex: none;
    width: 10px;
    height: 10px;
    border-radius: 50%;
    background: var(--esk-mountain);
  }
  .swatch.crevice {
    background: color-mix(in oklab, var(--esk-mountain), #13b5b1 60%);
  }
  .swatch.plateau {
    background: var(--esk-plateau);
  }
  .swatch.paint {
    border: 1px solid rgb(0 0 0 / 25%);
    border-radius: 3px;
  }
  .row {
    display: flex;
    justify-content: space-between;
    gap: 2px;
  }
  .lead {
    color: var(--esk-quiet);
    font-size: 0.8125rem;
  }
  .note {
    display: flex;
    align-items: center;
    gap: 8px;
    padding: 8px 10px;
    border-radius: 8px;
    background: var(--esk-hover);
    font-size: 0.8125rem;
  }
  .small {
    font-size: 0.75rem;
  }
  .empty {
    display: grid;
    justify-items: center;
    gap: 10px;
    padding: 28px 12px;
    text-align: center;
    color: var(--esk-quiet);
  }
  .empty .icon {
    width: 32px;
    height: 32px;
  }
  .strokes {
    display: grid;
    gap: 1px;
    margin: 0 -6px;
    padding: 0;
    list-style: none;
  }
  .item {
    width: 100%;
    justify-content: flex-start;
    font-weight: 450;
  }
  .item .label {
    flex: 1;
    overflow: hidden;
    text-align: left;
    text-overflow: ellipsis;
  }
  .item .icon {
    color: var(--esk-quiet);
  }
  .group {
    display: grid;
    gap: 10px;
    padding-top: 12px;
    border-top: 1px solid var(--esk-line);
  }
  .group:first-child {
    padding-top: 0;
    border-top: 0;
  }
  h3 {
    font-size: 0.8125rem;
    font-weight: 620;
  }
  wa-switch {
    font-size: 0.8125rem;
  }
  @media (pointer: coarse) {
    wa-switch::part(base) {
      min-height: 40px;
    }
  }
`;
