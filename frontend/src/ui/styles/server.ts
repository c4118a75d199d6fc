import { css } from "lit";

export const serverStyles = css`
  :host {
    display: block;
    min-height: 100vh;
    background: var(--esk-bg);
    color: var(--esk-text);
  }
  main {
    display: grid;
    gap: 14px;
    max-width: 720px;
    margin: 0 auto;
    padding: 20px clamp(14px, 4vw, 32px) 48px;
  }
  .brand {
    display: inline-flex;
    align-items: center;
    gap: 10px;
    width: fit-content;
    color: inherit;
    font-weight: 650;
    text-decoration: none;
  }
  h1 {
    margin: 12px 0 0;
    font-size: clamp(1.4rem, 4vw, 2rem);
    letter-spacing: -0.02em;
  }
  p {
    margin: 0;
    max-width: 62ch;
  }
  .quiet {
    color: var(--esk-quiet);
  }
  .problem {
    color: var(--esk-bad);
    font-weight: 550;
  }
  .problem:empty {
    display: none;
  }
  ul {
    display: grid;
    gap: 8px;
    margin: 0;
    padding: 0;
    list-style: none;
  }
  li {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 8px 14px;
    padding: 12px 14px;
    border: 1px solid var(--esk-line);
    border-radius: 12px;
    background: var(--esk-panel-solid);
  }
  .words {
    flex: 1 1 12em;
    min-width: 0;
    display: grid;
    overflow-wrap: anywhere;
  }
  .words .quiet {
    font-size: 0.8125rem;
  }
`;
