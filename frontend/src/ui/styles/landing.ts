import { css } from "lit";

/** The landing page: a morning over layered ridges, then plain cards. */
export const landingStyles = css`
  :host {
    display: flex;
    flex-direction: column;
    min-height: 100vh;
    min-height: 100dvh;
    --sky-top: #cfe0ea;
    --sky-low: #fbe6d3;
    --far: #b9c8d4;
    --near: #2f4a55;
    --disc: #fff4e2;
    --ink: #1a2a33;
  }
  :host-context(.wa-dark) {
    --sky-top: #0e1720;
    --sky-low: #4c3a41;
    --far: #43505f;
    --near: #0b1116;
    --disc: #f3d9bd;
    --ink: #f4efe8;
  }
  .hero {
    position: relative;
    isolation: isolate;
    overflow: hidden;
    display: flex;
    flex-direction: column;
    min-height: min(640px, 78vh);
    padding: 0 max(clamp(16px, 5vw, 72px), (100% - 1280px) / 2);
    color: var(--ink);
    background: linear-gradient(var(--sky-top), var(--sky-low) 72%);
  }
  .scene {
    position: absolute;
    z-index: -1;
    inset: 0;
    width: 100%;
    height: 100%;
  }
  .ridge {
    fill: color-mix(in oklab, var(--near) calc(var(--depth) * 100%), var(--far));
  }
  .disc {
    fill: var(--disc);
    opacity: 0.85;
  }
  .stroke {
    fill: none;
    stroke: #f26a3d;
    stroke-width: 6;
    stroke-linecap: round;
    stroke-dasharray: 100;
    animation: draw 2.2s 0.2s cubic-bezier(0.45, 0, 0.2, 1) both;
  }
  .knob {
    fill: #fff;
    stroke: #f26a3d;
    stroke-width: 4;
  }
  .knob.last {
    animation: appear 0.2s 2.2s both;
  }
  @keyframes appear {
    from {
      opacity: 0;
    }
  }
  @keyframes draw {
    from {
      stroke-dashoffset: 100;
    }
    to {
      stroke-dashoffset: 0;
    }
  }
  nav {
    display: flex;
    align-items: center;
    justify-content: space-between;
    height: 72px;
  }
  .brand {
    display: inline-flex;
    align-items: center;
    gap: 10px;
    font-weight: 650;
    font-size: 1.125rem;
    letter-spacing: -0.01em;
  }
  .pitch {
    width: min(560px, 100%);
    margin: clamp(16px, 7vh, 72px) 0 auto;
    padding: 0 0 120px;
  }
  h1 {
    font-weight: 680;
    font-size: clamp(2.1rem, 1.2rem + 3.6vw, 3.75rem);
    line-height: 1.04;
    letter-spacing: -0.032em;
    text-wrap: balance;
  }
  .pitch > p:first-of-type {
    margin: 16px 0 26px;
    max-width: 34em;
    font-size: clamp(1rem, 0.95rem + 0.4vw, 1.2rem);
    line-height: 1.45;
    text-wrap: pretty;
  }
  .start {
    display: flex;
    flex-wrap: wrap;
    gap: 12px;
  }
  .btn.big {
    min-height: 48px;
    padding: 0 1.3em;
    border-radius: 12px;
    font-size: 1rem;
    box-shadow: 0 6px 20px -8px rgb(160 50 10 / 70%);
  }
  .join {
    display: flex;
    flex: 1 1 250px;
    min-width: 0;
    max-width: 340px;
    padding: 4px;
    gap: 4px;
    border-radius: 12px;
    background: var(--esk-panel);
    color: var(--esk-text);
    box-shadow: var(--esk-shadow);
  }
  .join .field {
    flex: 1;
    height: 40px;
    border-color: transparent;
    background: transparent;
    font-size: 0.9375rem;
  }
  .join .btn {
    min-height: 40px;
  }
  .btn.solid {
    background: var(--esk-hover);
  }
  /* On a ground of its own: the picture behind it has every brightness. */
  .problem {
    width: fit-content;
    max-width: 100%;
    margin: 12px 0 8px;
    padding: 7px 12px;
    border-radius: 10px;
    background: var(--esk-panel-solid);
    color: var(--esk-bad);
    font-weight: 550;
  }
  .problem button {
    margin-left: 10px;
  }
  .problem:empty {
    margin: 6px 0;
    padding: 0;
  }
  .file {
    display: inline-flex;
    align-items: center;
    gap: 0.5em;
    padding: 6px 10px 6px 6px;
    margin-left: -6px;
    color: var(--ink);
    border-radius: 8px;
    font-weight: 500;
    cursor: pointer;
  }
  .kept {
    display: block;
    width: fit-content;
    margin-top: 6px;
    color: var(--ink);
    font-weight: 500;
  }
  .file:hover {
    background: var(--esk-hover);
  }
  .file:focus-within {
    outline: 2px solid var(--esk-focus);
  }
  main {
    flex: 1;
    width: 100%;
    padding: 20px max(clamp(16px, 5vw, 72px), (100% - 1280px) / 2) 48px;
  }
  section {
    margin-top: 32px;
  }
  h2 {
    margin-bottom: 14px;
    font-size: 1.0625rem;
    font-weight: 620;
    letter-spacing: -0.01em;
  }
  ul {
    list-style: none;
    margin: 0;
    padding: 0;
    display: grid;
    gap: 14px;
  }
  .cards {
    grid-template-columns: repeat(auto-fit, minmax(min(190px, 100%), 1fr));
  }
  .recents {
    grid-template-columns: repeat(auto-fill, minmax(min(280px, 100%), 1fr));
    gap: 10px;
  }
  .card {
    display: flex;
    flex-direction: column;
    gap: 3px;
    width: 100%;
    height: 100%;
    padding: 0 0 14px;
    overflow: hidden;
    text-align: left;
    line-height: 1.4;
    border: 1px solid var(--esk-line);
    border-radius: var(--esk-radius);
    background: var(--esk-panel-solid);
    cursor: pointer;
    transition: border-color 120ms, box-shadow 120ms, transform 120ms;
  }
  .card:hover:not(:disabled) {
    border-color: var(--esk-line-strong);
    box-shadow: var(--esk-shadow);
    transform: translateY(-1px);
  }
  .card:disabled {
    cursor: progress;
  }
  li:has(.plan) {
    display: grid;
    grid-template-rows: 1fr auto;
    gap: 6px;
  }
  .plan {
    display: grid;
    align-items: center;
    min-height: 40px;
    padding: 0 14px;
    color: var(--esk-accent-text);
    font-size: 0.8125rem;
    font-weight: 550;
  }
  .card.ghost {
    height: 232px;
    opacity: 0.5;
  }
  .card > :not(.picture) {
    padding: 0 14px;
  }
  .card strong {
    margin-top: 9px;
    font-weight: 600;
  }
  .card .quiet {
    font-size: 0.8125rem;
  }
  .picture,
  .thumb {
    position: relative;
    display: block;
    overflow: hidden;
    background: linear-gradient(var(--sky-top), var(--sky-low));
  }
  .picture {
    aspect-ratio: 16 / 10;
  }
  .picture > *,
  .thumb > * {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    object-fit: cover;
  }
  .recents li {
    display: flex;
    align-items: center;
    gap: 4px;
    padding-right: 8px;
    border: 1px solid var(--esk-line);
    border-radius: var(--esk-radius);
    background: var(--esk-panel-solid);
  }
  .recent {
    flex: 1;
    min-width: 0;
    display: flex;
    align-items: center;
    gap: 12px;
    padding: 8px;
    border-radius: inherit;
    text-decoration: none;
  }
  .recents li:hover {
    border-color: var(--esk-line-strong);
  }
  .thumb {
    flex: none;
    width: 64px;
    height: 44px;
    border-radius: 8px;
  }
  .words {
    min-width: 0;
    display: grid;
  }
  .words strong {
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
    font-weight: 600;
  }
  .words .quiet {
    font-size: 0.8125rem;
  }
  footer {
    display: flex;
    flex-wrap: wrap;
    justify-content: space-between;
    gap: 4px 24px;
    padding: 20px max(clamp(16px, 5vw, 72px), (100% - 1280px) / 2) 28px;
    color: var(--esk-quiet);
    font-size: 0.8125rem;
  }
  footer a {
    color: inherit;
  }
  @media (max-width: 640px) {
    .hero {
      min-height: 600px;
    }
    .pitch {
      margin: 8px 0 auto;
      padding-bottom: 190px;
    }
    .scene {
      inset: auto 0 0;
      height: 270px;
    }
    .start > * {
      flex: 1 1 100%;
      max-width: none;
    }
  }
`;
