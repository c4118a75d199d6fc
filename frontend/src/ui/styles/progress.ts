import { css } from "lit";

/** A bar that says how far something is. */
export const progressStyles = css`
  progress {
    appearance: none;
    width: 100%;
    height: 4px;
    border: 0;
    border-radius: 2px;
    overflow: hidden;
    background: var(--esk-line-strong);
  }
  progress::-webkit-progress-bar {
    background: transparent;
  }
  progress::-webkit-progress-value {
    background: var(--esk-accent);
    transition: width 160ms linear;
  }
  progress::-moz-progress-bar {
    background: var(--esk-accent);
  }
`;
