import { css } from "lit";

/** A file on its way into the ground. */
export const importCardStyles = css`
  :host {
    display: block;
  }
  article {
    display: grid;
    gap: 8px;
    padding: 8px 10px 12px 12px;
    border: 1px solid var(--esk-line-strong);
    border-radius: 12px;
    background: var(--esk-field);
    font-size: 0.8125rem;
  }
  article.bad {
    border-color: color-mix(in oklab, var(--esk-bad) 55%, transparent);
  }
  article.ok {
    border-color: color-mix(in oklab, var(--esk-ok) 55%, transparent);
  }
  header {
    display: flex;
    align-items: center;
    gap: 6px;
    min-height: 32px;
  }
  header strong {
    flex: 1;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
    font-weight: 600;
  }
  .stage {
    margin-top: -6px;
    color: var(--esk-quiet);
    font-variant-numeric: tabular-nums;
  }
  .problem {
    color: var(--esk-bad);
  }
  .note {
    display: flex;
    gap: 7px;
    color: var(--esk-quiet);
  }
  .note .icon {
    width: 15px;
    height: 15px;
    margin-top: 2px;
  }
  form {
    display: grid;
    gap: 12px;
    padding-top: 10px;
    border-top: 1px solid var(--esk-line);
  }
  fieldset {
    display: grid;
    gap: 2px;
    margin: 0;
    padding: 0;
    border: 0;
  }
  legend {
    margin-bottom: 4px;
    padding: 0;
    font-weight: 550;
  }
  .choice {
    display: flex;
    align-items: center;
    gap: 8px;
    min-height: 28px;
  }
  .choice input {
    accent-color: var(--esk-accent);
  }
  .choice.other .field {
    flex: 1;
    height: 32px;
    font-size: 0.8125rem;
  }
  .two {
    display: grid;
    grid-template-columns: 1fr 1fr;
    gap: 8px 10px;
  }
  .typed {
    display: grid;
    gap: 4px;
    font-weight: 550;
  }
  /* Always at hand, however long the questions are. */
  .row {
    position: sticky;
    bottom: -18px;
    display: flex;
    gap: 8px;
    margin: 0 -10px -12px -12px;
    padding: 8px 10px 12px 12px;
    border-radius: 0 0 12px 12px;
    background: var(--esk-field);
  }
  .row .btn {
    flex: 1;
  }
  @media (pointer: coarse) {
    .choice,
    .row .btn {
      min-height: 44px;
    }
    .icon-btn.small {
      width: 44px;
      height: 44px;
    }
  }
`;
