import { css } from "lit";

/** The projector's page: letters as large as the window allows, dark on light or light on dark with nothing between. */
export const roomStyles = css`
  :host {
    display: block;
    background: var(--esk-bg);
    color: var(--esk-text);
  }
  .running {
    display: grid;
    grid-template: auto 1fr auto / minmax(0, 1fr);
    box-sizing: border-box;
    min-height: 100vh;
    min-height: 100dvh;
    padding: 2.4vh 3vw;
    gap: 1.5vh;
  }
  header {
    display: flex;
    align-items: center;
    gap: 2vw;
  }
  header h1 {
    flex: 1 1 auto;
    min-width: 0;
    margin: 0;
    overflow: hidden;
    font-size: clamp(1.25rem, 4.4vh, 3.5rem);
    font-weight: 680;
    letter-spacing: -0.025em;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .way {
    display: grid;
    grid-template-columns: minmax(0, 1fr) auto;
    align-items: center;
    gap: 3vw;
    /* What the words have beside the picture, and the picture. */
    --picture: min(34vw, 62vh);
    --room: calc(91vw - var(--picture));
  }
  .words {
    display: grid;
    gap: 0.8vh;
    min-width: 0;
  }
  .words p {
    margin: 0;
    font-size: clamp(1.1rem, 3.6vh, 2.75rem);
    color: var(--esk-quiet);
  }
  .words .address,
  .words .code {
    color: var(--esk-text);
    font-family: ui-monospace, "SF Mono", Menlo, Consolas, "DejaVu Sans Mono", monospace;
    font-variant-ligatures: none;
    font-weight: 700;
    line-height: 1.15;
    white-space: nowrap;
  }
  .words .address {
    margin-bottom: 2.4vh;
    font-size: min(7vh, var(--room) / (0.62 * var(--letters)));
  }
  .words .code {
    font-size: min(30vh, var(--room) / (0.61 * var(--letters)));
    word-spacing: -0.25em;
  }
  figure {
    display: grid;
    justify-items: center;
    gap: 0.8vh;
    margin: 0;
    color: var(--esk-quiet);
    font-size: clamp(1.1rem, 3.6vh, 2.75rem);
  }
  figure wa-qr-code {
    box-sizing: border-box;
    width: var(--picture);
    /* Readers want four modules of white around it. */
    padding: calc(0.1 * var(--picture));
    border-radius: 1.6vh;
    background: #fff;
    color: #000;
    line-height: 0;
  }
  /* The component gives its canvas a size in pixels. */
  figure wa-qr-code::part(qr-code) {
    width: 100% !important;
    min-width: 0 !important;
    max-width: 100% !important;
    height: auto !important;
    min-height: 0 !important;
    max-height: none !important;
  }
  footer {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    justify-content: space-between;
    gap: 1vh 4vw;
    padding-top: 1.6vh;
    border-top: 1px solid var(--esk-line-strong);
  }
  footer p {
    margin: 0;
  }
  .here {
    font-size: clamp(1.5rem, min(6.4vh, 6.4vw), 5rem);
    line-height: 1.1;
  }
  .here strong {
    font-weight: 720;
    font-variant-numeric: tabular-nums;
  }
  .warned {
    flex: 0 1 58%;
    font-size: clamp(1rem, 2.6vh, 1.75rem);
    line-height: 1.35;
  }
  a {
    color: var(--esk-accent-text);
    font-weight: 550;
  }
  .problem {
    color: var(--esk-bad);
  }
  .still {
    display: grid;
    gap: 14px;
    max-width: 60ch;
    margin: 0 auto;
    padding: clamp(28px, 12vh, 140px) 20px;
    font-size: 1.125rem;
    line-height: 1.5;
  }
  .still h1,
  .still p {
    margin: 0;
  }
  .still .problem:empty {
    display: none;
  }
  .still form {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    gap: 10px;
  }
  .still input {
    width: 9em;
    margin-left: 6px;
    font: 650 1.25rem ui-monospace, "SF Mono", Menlo, Consolas, monospace;
    text-transform: uppercase;
  }
  .still ul {
    display: flex;
    flex-wrap: wrap;
    gap: 8px;
    margin: 0;
    padding: 0;
    list-style: none;
  }
  .brand {
    display: inline-flex;
    align-items: center;
    gap: 8px;
    text-decoration: none;
  }
  :host(:fullscreen) .fill {
    display: none;
  }
  @media (display-mode: fullscreen) {
    .fill {
      display: none;
    }
  }
  @media (max-width: 720px) {
    .way {
      grid-template-columns: minmax(0, 1fr);
      justify-items: start;
      --picture: min(70vw, 40vh);
      --room: 90vw;
    }
  }
`;
