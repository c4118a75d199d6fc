/** Elevation files of one terrain over HTTP (docs/protocol.md). */

import type { ImportStatus } from "../../generated/contract.ts";
import type { ImportTransport } from "../layers/imports.ts";
import { api } from "./api.ts";
import { upload } from "./upload.ts";

/** `terrain` is read at each call: its secret may change while the page is open. The layer is added in `client`'s name. */
export function gridTransport(terrain: {
  readonly id: string;
  readonly secret: string;
  readonly client: string;
  readonly lesson: { readonly ticket: string | null };
}): ImportTransport {
  return {
    upload: (file, onShare, signal) =>
      upload<ImportStatus>({
        path: `/api/terrains/${terrain.id}/imports?name=${encodeURIComponent(file.name)}&client=${terrain.client}`,
        secret: terrain.secret,
        ticket: terrain.lesson.ticket,
        file,
        onShare,
        signal,
      }),
    status: (id) => api.importStatus(terrain.id, terrain.secret, id),
    answer: (id, answers) => api.answerImport(terrain.id, terrain.secret, id, answers),
    cancel: (id) => api.cancelImport(terrain.id, terrain.secret, id),
  };
}
