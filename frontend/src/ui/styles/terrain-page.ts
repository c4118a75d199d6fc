import { css } from "lit";

export const terrainPageStyles = css`
  :host {
    position: fixed;
    inset: 0;
    overflow: hidden;
    background: var(--esk-bg);
    --edge: 12px;
    --inspector: 328px;
  }
  /* Four tabs and a cross that fingers hit. */
  @media (pointer: coarse) {
    :host {
      --inspector: 352px;
    }
  }
  /* Six tabs and the cross. */
  :host([leads]) {
    --inspector: 364px;
  }
  /* German words are longer. */
  :host([leads]:lang(de)) {
    --inspector: 400px;
  }
  .viewport {
    position: absolute;
    inset: 0;
    outline-offset: -3px;
    touch-action: none;
    user-select: none;
    -webkit-user-select: none;
  }
  .viewport canvas {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    display: block;
  }
  esk-top-bar {
    position: absolute;
    inset: var(--edge) var(--edge) auto;
  }
  esk-tools {
    position: absolute;
    left: var(--edge);
    top: 50%;
    transform: translateY(-50%);
  }
  .foot {
    position: absolute;
    inset: auto var(--edge) var(--edge);
    display: flex;
    align-items: flex-end;
    justify-content: space-between;
    gap: var(--esk-gap);
    pointer-events: none;
  }
  .foot > * {
    pointer-events: auto;
  }
  .side {
    position: absolute;
    top: calc(var(--edge) + 60px);
    right: var(--edge);
    width: var(--inspector);
    max-height: calc(100% - 2 * var(--edge) - 60px - 54px);
    display: flex;
    flex-direction: column;
    overflow: hidden;
    animation: arrive 160ms ease-out;
  }
  @keyframes arrive {
    from {
      opacity: 0;
      transform: translateX(10px);
    }
  }
  .side header {
    display: flex;
    align-items: center;
    gap: 8px;
    padding: 10px 10px 8px 14px;
  }
  .side header esk-segmented {
    flex: 1;
    min-width: 0;
  }
  .side.leads header esk-segmented {
    --segment-pad: 2px;
    --segment-gap: 0;
  }
  @media (min-width: 721px) {
    .side.leads header esk-segmented:lang(de) {
      --segment-basis: auto;
    }
  }
  .scroll {
    overflow-y: auto;
    padding: 6px 16px 18px;
    scrollbar-width: thin;
  }
  :is(esk-measure, esk-water) {
    position: absolute;
    left: calc(var(--edge) + 62px);
    right: var(--edge);
    bottom: calc(var(--edge) + 54px);
    max-width: 940px;
    max-height: min(46%, 420px);
    overflow: hidden;
    animation: rise 160ms ease-out;
  }
  @keyframes rise {
    from {
      opacity: 0;
      transform: translateY(10px);
    }
  }
  /* The panel stands where the legend does. */
  .foot:has(~ :is(esk-measure, esk-water)) esk-legend {
    display: none;
  }
  :is(esk-measure, esk-water)[beside] {
    right: calc(2 * var(--edge) + var(--inspector));
  }
  /* Above the tools, where no hint comes. */
  esk-task-chip {
    position: absolute;
    left: var(--edge);
    top: 66px;
  }
  @media (max-width: 720px) {
    esk-task-chip {
      top: 122px;
    }
  }
  .notes {
    min-width: 0;
    display: grid;
    justify-items: start;
    gap: var(--esk-gap);
    pointer-events: none;
  }
  .notes > * {
    pointer-events: auto;
  }
  /* The legend stands beside the tools where there is no room below them. */
  @media (max-height: 700px) and (min-width: 721px) {
    .notes esk-legend {
      margin-left: 60px;
    }
  }
  .veil {
    position: absolute;
    inset: 0;
    display: grid;
    place-content: center;
    justify-items: center;
    gap: 12px;
    padding: 24px;
    text-align: center;
  }
  .veil h1 {
    font-size: 1.375rem;
    font-weight: 650;
    letter-spacing: -0.015em;
  }
  .veil p {
    max-width: 40ch;
    color: var(--esk-quiet);
  }
  .breathing {
    animation: breathe 1.4s ease-in-out infinite alternate;
  }
  @keyframes breathe {
    from {
      opacity: 0.45;
    }
  }
  .facts {
    display: grid;
    grid-template-columns: auto 1fr;
    gap: 8px 20px;
    margin: 0 0 12px;
  }
  .facts dt {
    color: var(--esk-quiet);
  }
  .facts dd {
    margin: 0;
    text-align: right;
    overflow-wrap: anywhere;
  }
  @media (max-width: 720px) {
    :host {
      --edge: 8px;
      --drawer: 0px;
    }
    /* The drawer stands below the picture, not on it: what one changes must be seen. One height for all its tabs. */
    :host([drawer]) {
      --drawer: min(46%, 400px);
    }
    :host([drawer]) .viewport {
      bottom: calc(var(--drawer) - var(--esk-radius));
    }
    :host([drawer]) .foot {
      display: none;
    }
    :host([drawer]) esk-tools {
      bottom: calc(var(--drawer) + var(--edge));
    }
    esk-tools {
      left: 50%;
      top: auto;
      bottom: calc(var(--edge) + env(safe-area-inset-bottom));
      transform: translateX(-50%);
    }
    .notes {
      flex: 1 0 auto;
    }
    esk-view-bar {
      flex: none;
    }
    .foot {
      flex-wrap: wrap;
      justify-content: flex-end;
      gap: 6px;
      bottom: calc(var(--edge) + 62px + env(safe-area-inset-bottom));
    }
    .side {
      top: auto;
      left: 0;
      right: 0;
      bottom: 0;
      width: auto;
      height: var(--drawer);
      max-height: none;
      z-index: 2;
      border-radius: var(--esk-radius) var(--esk-radius) 0 0;
      background: var(--esk-panel-solid);
      padding-bottom: env(safe-area-inset-bottom);
    }
    @keyframes arrive {
      from {
        transform: translateY(24px);
      }
    }
    /* A small window on its side, or a page at 200 %: the drawer stands beside the picture. */
    @media (max-height: 440px) and (min-width: 480px) {
      :host([drawer]) {
        --drawer: 0px;
        --beside: min(46vw, 300px);
      }
      :host([drawer]) .viewport {
        right: calc(var(--beside) - var(--esk-radius));
        bottom: 0;
      }
      :host([drawer]) esk-tools {
        left: calc((100% - var(--beside)) / 2);
        max-width: calc(100% - var(--beside) - 2 * var(--edge));
      }
      /* Nine tools beside each other in what is left. Where they would be too narrow to hit, the row scrolls. */
      :host([drawer]) esk-tools {
        --tool-width: clamp(32px, (100vw - var(--beside) - 2 * var(--edge) - 38px) / 9, 44px);
        gap: 2px;
        overflow-x: auto;
        scrollbar-width: thin;
        justify-content: safe center;
      }
      .side header {
        padding: 8px 6px 6px 10px;
        gap: 4px;
      }
      .side header esk-segmented {
        --segment-pad: 3px;
      }
      .side.leads header {
        padding-left: 4px;
        gap: 0;
      }
      .side.leads header esk-segmented {
        --segment-pad: 1px;
        --segment-gap: 0;
        --segment-size: 0.75rem;
      }
      .side {
        top: calc(var(--edge) + 52px);
        left: auto;
        width: var(--beside);
        height: auto;
        border-radius: var(--esk-radius) 0 0 0;
      }
    }
    /* Four tabs and a cross do not stand side by side here: two and two do. */
    @media (max-height: 440px) and (min-width: 480px) and (max-width: 620px) {
      .side header esk-segmented {
        --segments-wrap: wrap;
        --segment-basis: 40%;
      }
    }
    :is(esk-measure, esk-water),
    :is(esk-measure, esk-water)[beside] {
      left: 0;
      right: 0;
      bottom: calc(var(--drawer) + 72px + env(safe-area-inset-bottom));
      margin: 0 var(--edge);
      background: var(--esk-panel-solid);
    }
    :host([drawer]) :is(esk-measure, esk-water) {
      display: none;
    }
    .foot:has(~ :is(esk-measure, esk-water)) {
      display: none;
    }
    /* Little height is left for the land: the tools come back when one stops measuring. */
    @media (max-height: 440px) {
      :is(esk-measure, esk-water),
      :is(esk-measure, esk-water)[beside] {
        bottom: var(--edge);
        max-height: 52%;
      }
      esk-tools:has(~ :is(esk-measure, esk-water)) {
        display: none;
      }
    }
  }
`;
