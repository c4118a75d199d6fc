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
    margin: 16px 0 14px;
    padding-top: 14px;
    border-top: 1px solid var(--esk-line);
    font-size: 0.8125rem;
  }
  .code .acts {
    display: flex;
    align-items: center;
    gap: 4px;
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
