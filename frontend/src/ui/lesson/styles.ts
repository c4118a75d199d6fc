import { css } from "lit";

/** The panel by which a conductor leads a lesson. */
export const lessonPanelStyles = css`
  .switches {
    display: grid;
    gap: 2px;
  }
  .switches wa-switch {
    min-height: 40px;
    align-content: center;
  }
  .switches .inner {
    margin-left: 20px;
  }
  .quietly {
    color: var(--esk-quiet);
    font-size: 0.75rem;
  }
  .all {
    display: flex;
    flex-wrap: wrap;
    gap: 6px;
  }
  ul {
    display: grid;
    gap: 2px;
    margin: 0 -6px;
    padding: 0;
    list-style: none;
  }
  li {
    display: flex;
    align-items: center;
    gap: 8px;
    min-height: 44px;
    padding: 0 0 0 6px;
    border-radius: 10px;
  }
  li:hover {
    background: var(--esk-hover);
  }
  .spot {
    flex: none;
    width: 12px;
    height: 12px;
    border-radius: 50%;
  }
  .who {
    flex: 1;
    min-width: 0;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .who small {
    color: var(--esk-quiet);
  }
  li .icon-btn {
    flex: none;
    width: 40px;
    height: 40px;
  }
  /* A group's name opens who is in it. */
  .fold {
    appearance: none;
    min-height: 40px;
    padding: 0;
    border: 0;
    background: none;
    color: inherit;
    font: inherit;
    text-align: start;
    cursor: pointer;
  }
  li.inside {
    display: grid;
    gap: 2px;
    padding: 4px 6px 8px 18px;
  }
  li.inside:hover {
    background: none;
  }
  .inside .field {
    min-height: 40px;
    margin-bottom: 4px;
  }
  .inside label {
    display: flex;
    align-items: center;
    gap: 8px;
    min-height: 40px;
    cursor: pointer;
  }
  .inside input[type="checkbox"] {
    width: 18px;
    height: 18px;
    accent-color: var(--esk-accent);
  }
  .pen[aria-pressed="true"] {
    color: var(--esk-accent-text);
  }
`;
