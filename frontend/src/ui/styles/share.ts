import { css } from "lit";

export const shareStyles = css`
  wa-dialog {
    --width: 440px;
  }
  .says {
    margin: 14px 0 10px;
    color: var(--esk-quiet);
  }
  .make {
    width: 100%;
    min-height: 44px;
  }
  .link {
    display: flex;
    gap: 6px;
    align-items: center;
  }
  .link .field {
    flex: 1;
    font-size: 0.8125rem;
    text-overflow: ellipsis;
  }
  .qr {
    display: grid;
    place-items: center;
    margin: 16px auto 0;
    width: 200px;
    padding: 16px;
    border-radius: 14px;
    background: #fff;
    color: #14191f;
    border: 1px solid var(--esk-line);
  }
  wa-qr-code {
    color: #14191f;
    background: #fff;
  }
  wa-switch {
    margin-top: 14px;
  }
  .problem {
    margin-top: 8px;
    color: var(--esk-bad);
    font-weight: 550;
  }
  .problem:empty {
    display: none;
  }
  wa-dialog::part(body) {
    overflow-x: hidden;
  }
  .code {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    justify-content: space-between;
    gap: 12px;
    margin-top: 16px;
    padding-top: 14px;
    border-top: 1px solid var(--esk-line);
    font-size: 0.8125rem;
  }
  .code .acts {
    display: flex;
    align-items: center;
    gap: 4px;
  }
  wa-dialog.large {
    --width: min(96vw, 1500px);
  }
  .projected {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    justify-content: space-evenly;
    gap: 4vmin;
    min-height: 60vh;
    text-align: center;
  }
  .projected .words {
    font-size: clamp(1.25rem, 3.4vmin, 2.6rem);
  }
  .projected .letters {
    font-size: clamp(3rem, 11vw, 11rem);
    font-weight: 720;
    letter-spacing: 0.06em;
    line-height: 1.15;
    white-space: nowrap;
  }
  .projected .left {
    display: flex;
    flex-wrap: wrap;
    align-items: center;
    justify-content: center;
    gap: 0.6em;
    font-size: 1rem;
  }
  .projected strong {
    overflow-wrap: anywhere;
  }
  .projected .qr {
    width: auto;
    margin: 0;
  }
  .code strong {
    display: block;
    white-space: nowrap;
    font-size: 1.6rem;
    font-weight: 680;
    letter-spacing: 0.08em;
    line-height: 1.3;
  }
`;
