import { css } from "lit";

export const shareListStyles = css`
  details {
    margin-top: 14px;
    padding-top: 12px;
    border-top: 1px solid var(--esk-line);
  }
  summary {
    cursor: pointer;
    font-weight: 550;
    font-size: 0.8125rem;
  }
  ul {
    margin: 6px 0 0;
    padding: 0;
    list-style: none;
  }
  li {
    display: flex;
    align-items: center;
    gap: 8px;
    min-height: 36px;
    font-size: 0.8125rem;
  }
  li .name {
    flex: 1;
    min-width: 0;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  li.asks {
    flex-wrap: wrap;
    padding: 8px 10px;
    border-radius: 10px;
    background: var(--esk-hover);
  }
  li.asks p {
    flex: 1 1 100%;
    margin: 0;
  }
`;
