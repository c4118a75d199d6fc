import { css } from "lit";

/** Sentences over the picture: hints, notices, what is on its way, the bar of the lesson, and what passes. */
export const sentenceStyles = css`
  .hint,
  .closed {
    position: absolute;
    left: 50%;
    bottom: 64px;
    transform: translateX(-50%);
    display: flex;
    align-items: center;
    gap: 10px;
    max-width: calc(100% - 2 * var(--edge));
    padding: 11px 18px 11px 14px;
    font-weight: 500;
    pointer-events: none;
  }
  .hint {
    width: max-content;
  }
  .hint .icon {
    color: var(--esk-accent-text);
  }
  .closed {
    bottom: auto;
    top: 74px;
    width: max-content;
  }
  .closed button {
    pointer-events: auto;
  }
  .closed .icon {
    color: var(--esk-bad);
  }
  .importing {
    position: absolute;
    left: 50%;
    top: 74px;
    transform: translateX(-50%);
    display: flex;
    align-items: center;
    gap: 10px;
    width: max-content;
    max-width: calc(100% - 2 * var(--edge));
    padding: 8px 16px 8px 12px;
    font-size: 0.8125rem;
    font-variant-numeric: tabular-nums;
    pointer-events: none;
  }
  esk-lesson-bar {
    position: absolute;
    left: 50%;
    top: 70px;
    width: max-content;
    max-width: calc(100% - 2 * var(--edge));
    transform: translateX(-50%);
  }
  /* Below sentences that stand in its place. */
  .closed ~ esk-lesson-bar,
  .importing ~ esk-lesson-bar {
    top: 128px;
  }
  .importing .icon {
    color: var(--esk-accent-text);
  }
  .notice .icon {
    color: var(--esk-accent-text);
  }
  /* Over a hint of two lines. */
  esk-toasts {
    position: absolute;
    left: 50%;
    bottom: 140px;
    width: max-content;
    max-width: calc(100% - 2 * var(--edge));
    transform: translateX(-50%);
  }
  /* Sentences stand between the tools and the inspector, on neither. */
  @media (min-width: 721px) {
    :host {
      --rail: 62px;
      --before: var(--rail);
      --beyond: var(--rail);
    }
    :host([drawer]) {
      --beyond: calc(var(--inspector) + var(--edge));
    }
    .hint,
    .closed,
    .importing,
    esk-lesson-bar,
    esk-toasts {
      left: calc((100% + var(--before) - var(--beyond)) / 2);
      max-width: calc(100% - var(--before) - var(--beyond) - 2 * var(--edge));
    }
  }
  /* Two columns of tools. */
  @media (max-height: 500px) and (min-width: 721px) {
    :host {
      --rail: 106px;
    }
  }
  /* A hint stands beside the legend. Where the inspector leaves too little beside it, the hint stands above, under the task. */
  @media (min-width: 721px) {
    :host {
      --legend: 246px;
    }
    .foot:has(esk-legend:not([hidden])) ~ .hint {
      --before: var(--legend);
    }
    :host(:not([drawer])) .foot:has(esk-legend:not([hidden])) ~ .hint {
      --beyond: 0px;
    }
  }
  @media (max-height: 700px) and (min-width: 721px) {
    :host {
      --legend: 306px;
    }
  }
  @media (min-width: 721px) and (max-width: 1040px) {
    :host([drawer]) .foot:has(esk-legend:not([hidden])) ~ .hint {
      --before: var(--rail);
      bottom: auto;
      top: 122px;
    }
    /* Sentences that matter more have that place. */
    :host([drawer]) .foot:has(esk-legend:not([hidden])) ~ .hint:has(~ .closed, ~ .importing, ~ esk-lesson-bar[speaks]) {
      top: 186px;
    }
  }
  @media (max-width: 720px) {
    .hint,
    esk-toasts {
      bottom: calc(132px + var(--drawer) + env(safe-area-inset-bottom));
      width: max-content;
    }
    :host(:not([drawer])) .foot:has(esk-legend:not([hidden])) ~ .hint {
      bottom: calc(236px + env(safe-area-inset-bottom));
    }
    /* Over the tools it would lie on the land, for which the drawer leaves little: above the land is mist and sky. */
    :host([drawer]) .hint {
      bottom: auto;
      top: 66px;
    }
    /* Sentences that matter more have that place. */
    :host([drawer]) .hint:has(~ .closed, ~ .importing, ~ esk-lesson-bar[speaks]) {
      bottom: calc(var(--drawer) + var(--edge) + 62px);
      top: auto;
    }
    .hint {
      font-size: 0.8125rem;
      padding: 9px 14px 9px 12px;
    }
    esk-toasts {
      bottom: calc(188px + var(--drawer) + env(safe-area-inset-bottom));
    }
    /* A small window on its side: beside the drawer. */
    @media (max-height: 440px) and (min-width: 480px) {
      :host([drawer]) .hint,
      :host([drawer]) .closed,
      :host([drawer]) .importing,
      :host([drawer]) esk-toasts {
        left: calc((100% - var(--beside)) / 2);
        max-width: calc(100% - var(--beside) - 2 * var(--edge));
      }
    }
  }
`;
