import { css } from "lit";

/** The list of elevation layers. */
export const layersPanelStyles = css`
  .add {
    width: 100%;
  }
  .layers {
    display: grid;
    gap: 2px;
    margin: 0 -6px;
    padding: 0;
    list-style: none;
  }
  .layer {
    border-radius: 12px;
    border-top: 2px solid transparent;
  }
  .layer.open {
    padding: 0 8px 8px;
    background: var(--esk-hover);
  }
  .layer.open .head {
    margin: 0 -8px;
  }
  .layer.target {
    border-top-color: var(--esk-accent);
  }
  .layer[data-dragged] {
    opacity: 0.5;
  }
  .head {
    display: flex;
    align-items: center;
  }
  .head .item {
    flex: 1;
    min-width: 0;
  }
  .hidden-layer .label {
    color: var(--esk-quiet);
  }
  .layer .swatch {
    border-radius: 3px;
    border: 1px solid rgb(0 0 0 / 25%);
  }
  .order {
    flex: none;
    display: grid;
    place-items: center;
    width: 24px;
    height: 36px;
    padding: 0;
    border: 0;
    border-radius: 8px;
    background: transparent;
    color: var(--esk-quiet);
    cursor: grab;
    touch-action: none;
  }
  .order:active {
    cursor: grabbing;
  }
  .note .icon {
    flex: none;
    width: 16px;
    height: 16px;
  }
  @media (pointer: coarse) {
    .order {
      width: 44px;
      height: 44px;
    }
    .head .icon-btn {
      width: 44px;
      height: 44px;
    }
    .item {
      min-height: 44px;
    }
  }
`;
