/** Sending a large file with real progress: `fetch` does not tell how much has left. */

import { msg } from "@lit/localize";
import { ApiError, readRefusal } from "./api.ts";

export interface Upload {
  readonly path: string;
  readonly secret?: string;
  /** By which a lesson knows who brings the file in. */
  readonly ticket?: string | null;
  readonly file: Blob;
  /** Share of the bytes that have left, 0..1. */
  readonly onShare: (share: number) => void;
  readonly signal: AbortSignal;
}

/** The JSON answer. Throws ApiError; of code "cancelled" after an abort. */
export function upload<T>({ path, secret, ticket, file, onShare, signal }: Upload): Promise<T> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    const cancelled = (): void => {
      request.abort();
      reject(new ApiError("cancelled", msg("The upload was cancelled.")));
    };
    if (signal.aborted) {
      cancelled();
      return;
    }
    signal.addEventListener("abort", cancelled, { once: true });
    const settle = (run: () => void): void => {
      signal.removeEventListener("abort", cancelled);
      run();
    };
    request.upload.addEventListener("progress", (e) => {
      if (e.lengthComputable && e.total > 0) onShare(e.loaded / e.total);
    });
    request.addEventListener("load", () =>
      settle(() => {
        if (request.status >= 200 && request.status < 300) {
          try {
            resolve(JSON.parse(request.responseText) as T);
          } catch {
            reject(readRefusal(request.status, request.responseText));
          }
        } else reject(readRefusal(request.status, request.responseText));
      }),
    );
    request.addEventListener("error", () =>
      settle(() =>
        reject(
          new ApiError("unreachable", msg("The upload was cut off. Check the connection and drop the file again.")),
        ),
      ),
    );
    request.open("POST", path);
    if (secret) request.setRequestHeader("Authorization", `Bearer ${secret}`);
    if (ticket) request.setRequestHeader("Esker-Ticket", ticket);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.send(file);
  });
}
