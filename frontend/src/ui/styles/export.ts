import { css } from "lit";

export const exportStyles = css`
  wa-dialog {
    --width: 560px;
  }
  form,
  .state {
    display: grid;
    gap: 16px;
  }
  .state:focus {
    outline: none;
  }
  fieldset {
    display: grid;
    grid-template-columns: repeat(auto-fill, minmax(232px, 1fr));
    gap: 8px;
    min-width: 0;
    margin: 0;
    padding: 0;
    border: 0;
  }
  .card {
    position: relative;
    display: grid;
    align-content: start;
    gap: 3px;
    padding: 10px 12px;
    border: 1px solid var(--esk-line-strong);
    border-radius: 12px;
    background: var(--esk-field);
    cursor: pointer;
  }
  .card:hover {
    background: var(--esk-hover);
  }
  .card:has(:checked) {
    border-color: var(--esk-accent);
    background: var(--esk-accent-soft);
    box-shadow: inset 0 0 0 1px var(--esk-accent);
  }
  .card:has(:focus-visible) {
    outline: 2px solid var(--esk-focus);
    outline-offset: 2px;
  }
  .card input {
    position: absolute;
    opacity: 0;
    inset: 0;
    margin: 0;
    cursor: pointer;
  }
  .card strong {
    display: flex;
    justify-content: space-between;
    gap: 8px;
    font-size: 0.875rem;
    font-weight: 600;
  }
  .card strong span {
    color: var(--esk-quiet);
    font-weight: 450;
  }
  .card small,
  .note {
    font-size: 0.8125rem;
    line-height: 1.35;
    color: var(--esk-quiet);
  }
  .row {
    display: grid;
    gap: 6px;
    font-size: 0.8125rem;
    font-weight: 550;
  }
  .pair {
    display: grid;
    grid-template-columns: repeat(auto-fit, minmax(150px, 1fr));
    gap: 12px;
    align-items: end;
  }
  .pair .field {
    width: 100%;
  }
  select.field {
    width: 100%;
    padding-right: 0.5em;
    appearance: auto;
  }
  wa-switch {
    font-size: 0.875rem;
  }
  .end {
    display: flex;
    flex-wrap: wrap;
    justify-content: space-between;
    align-items: center;
    gap: 12px;
    padding-top: 14px;
    border-top: 1px solid var(--esk-line);
  }
  .end .quiet {
    flex: 1 1 180px;
    font-size: 0.8125rem;
  }
  .buttons {
    display: flex;
    gap: 8px;
    margin-left: auto;
  }
  progress {
    height: 6px;
    border-radius: 3px;
  }
  .says {
    font-variant-numeric: tabular-nums;
  }
  .came {
    display: flex;
    align-items: center;
    gap: 10px;
    overflow-wrap: anywhere;
  }
  .came .icon {
    width: 22px;
    height: 22px;
    color: var(--esk-ok);
  }
  ul {
    display: grid;
    gap: 5px;
    margin: 0;
    padding: 10px 12px;
    list-style: none;
    border: 1px solid var(--esk-line);
    border-radius: 12px;
    font-size: 0.8125rem;
    font-variant-numeric: tabular-nums;
    user-select: text;
  }
  /* On a phone the button stays in sight: only the chosen card says more. */
  @media (max-width: 520px) {
    .card {
      align-content: center;
      min-height: 44px;
    }
    .card:not(:has(:checked)) small {
      display: none;
    }
  }
  .problem {
    color: var(--esk-bad);
    font-weight: 550;
  }
`;
