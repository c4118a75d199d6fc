import type { ExportEstimate, ExportStatus } from "../../generated/contract.ts";
import type { ExportTransport } from "../layers/exports.ts";
import { json, request } from "./api.ts";

/** Exports over HTTP (docs/protocol.md). `secret`: asked for at each request, as an owner may replace it. */
export function exportTransport(id: string, secret: () => string, client: string): ExportTransport {
  const path = `/api/terrains/${id}/exports`;
  return {
    estimate: (request): Promise<ExportEstimate> => json("POST", `${path}/estimate`, secret(), request),
    begin: (request): Promise<ExportStatus> => json("POST", `${path}?client=${client}`, secret(), request),
    status: (job): Promise<ExportStatus> => json("GET", `${path}/${job}`, secret()),
    file: async (job): Promise<Blob> => (await request("GET", `${path}/${job}/file`, secret())).blob(),
    cancel: async (job): Promise<void> => {
      await request("DELETE", `${path}/${job}`, secret());
    },
  };
}
