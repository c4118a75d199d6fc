/** The server's JSON interface (docs/protocol.md). Secrets travel in the Authorization header only. */

import { msg, str } from "@lit/localize";
import { language } from "../../core/language.ts";
import type { TemplateInfo } from "../../core/types.ts";
import type { ImportAnswers, ImportStatus, Role } from "../../generated/contract.ts";
import type { HistoryPage } from "../history/history.ts";
import { refusalWords } from "../words/refusals.ts";

/** A lesson of the gallery. */
export interface LessonInfo extends TemplateInfo {
  readonly minutes: number;
}

/** The page of a lesson for its teacher. */
export interface LessonPlan extends LessonInfo {
  readonly ages: string;
  readonly goal: string;
  /** What pupils read. */
  readonly task: string;
  readonly before: readonly string[];
  readonly steps: readonly { readonly minutes: number; readonly what: string }[];
  readonly ask: readonly { readonly question: string; readonly answer: string }[];
  /** What of the terrain is real, and what is not. */
  readonly truth: string;
}

/** A refusal or failure with a sentence for a person. */
export class ApiError extends Error {
  readonly code: string;
  /** Further facts of the answer: when a deleted terrain will be gone, for example. */
  readonly facts: Readonly<Record<string, unknown>>;

  constructor(code: string, message: string, facts: Readonly<Record<string, unknown>> = {}) {
    super(message);
    this.code = code;
    this.facts = facts;
  }
}

export interface OpenedTerrain {
  readonly id: string;
  readonly secret: string;
  readonly role: Role;
}

export interface AccessLink {
  readonly id: string;
  readonly role: Role;
  readonly name: string;
  readonly created: string | number;
  readonly revoked: string | number | boolean | null;
  /** Whether this is the link by which the list was asked for. */
  readonly own?: boolean;
}

/** One terrain of a server, as the machine's owner sees it. */
export interface KeptTerrain {
  readonly id: string;
  readonly title: string;
  /** Seconds since 1970. */
  readonly changed: number;
  readonly clock: number;
  readonly links: number;
  readonly here: number;
}

/** What somebody is told who typed the code of a class. */
export interface ClassDoor {
  readonly class: string;
  readonly title: string;
  readonly together: number;
  readonly groups: readonly { readonly number: number; readonly names: readonly string[] }[];
}

/** What the projector is told of a code. */
export interface RoomFacts {
  readonly kind: "class" | "terrain";
  /** The terrain that the code opens; null for a class, whose devices have copies. */
  readonly terrain: string | null;
  readonly role: Role;
  readonly title: string;
  /** How many people are in, without owners. */
  readonly here: number;
  readonly expires_s: number;
  /** Whether browsers warn of this server's certificate. */
  readonly warned: boolean;
}

export interface JoinCode {
  readonly code: string;
  readonly expires_s: number;
}

/** The picture that a link shows where it is pasted. */
export interface Preview {
  readonly token: string;
  readonly shown: boolean;
  /** False where the server cannot draw. */
  readonly available: boolean;
}

type Method = "GET" | "POST" | "DELETE";

export async function request(method: Method, path: string, secret?: string, body?: unknown): Promise<Response> {
  const headers: Record<string, string> = {};
  if (secret) headers.Authorization = `Bearer ${secret}`;
  const init: RequestInit = { method, headers };
  if (body instanceof Blob) {
    headers["Content-Type"] = "application/octet-stream";
    init.body = body;
  } else if (body !== undefined) {
    headers["Content-Type"] = "application/json";
    init.body = JSON.stringify(body);
  }
  let response: Response;
  try {
    response = await fetch(path, init);
  } catch {
    throw new ApiError("unreachable", msg("The server does not answer. Check the connection and try again."));
  }
  if (!response.ok) throw readRefusal(response.status, await response.text());
  return response;
}

/** Reads the error out of an answer by which the server refused. */
export function readRefusal(status: number, text: string): ApiError {
  try {
    const { code, message, ...facts } = JSON.parse(text) as { code?: unknown; message?: unknown };
    if (typeof message === "string")
      return new ApiError(String(code ?? status), refusalWords(String(code), message), facts);
  } catch {
    // The answer is no JSON: a proxy gave it. The status says enough.
  }
  return new ApiError(String(status), msg(str`The server refused (${status}). Try again in a moment.`));
}

export async function json<T>(method: Method, path: string, secret?: string, body?: unknown): Promise<T> {
  return (await (await request(method, path, secret, body)).json()) as T;
}

export const api = {
  templates: (): Promise<TemplateInfo[]> => json("GET", "/api/templates"),

  lessons: (): Promise<LessonInfo[]> => json("GET", "/api/lessons"),

  lesson: (id: string): Promise<LessonPlan> => json("GET", `/api/lessons/${id}?language=${language()}`),

  create: (template?: string): Promise<OpenedTerrain> =>
    json("POST", "/api/terrains", undefined, template ? { template, language: language() } : {}),

  open: (file: Blob): Promise<OpenedTerrain> => json("POST", "/api/terrains/import", undefined, file),

  /** A terrain; or the class whose code it is, which asks for a name first. */
  join: (code: string): Promise<OpenedTerrain | ClassDoor> => json("POST", "/api/join", undefined, { code }),

  /** The code stands in the body, so that no log has it. */
  room: (code: string): Promise<RoomFacts> => json("POST", "/api/room", undefined, { code }),

  /** Answers only to a living secret. */
  about: (id: string, secret: string): Promise<{ readonly id: string; readonly role: Role }> =>
    json("GET", `/api/terrains/${id}`, secret),

  /** For everybody; `until`: when it will be gone for good, seconds since 1970. */
  deleteTerrain: (id: string, secret: string): Promise<{ readonly until: number }> =>
    json("DELETE", `/api/terrains/${id}`, secret),

  restoreTerrain: async (id: string, secret: string): Promise<void> => {
    await request("POST", `/api/terrains/${id}/restore`, secret);
  },

  archive: async (id: string, secret: string): Promise<Blob> =>
    (await request("GET", `/api/terrains/${id}/archive`, secret)).blob(),

  links: (id: string, secret: string): Promise<AccessLink[]> => json("GET", `/api/terrains/${id}/links`, secret),

  addLink: (id: string, secret: string, role: Role, name: string): Promise<AccessLink & { secret: string }> =>
    json("POST", `/api/terrains/${id}/links`, secret, { role, name }),

  /** `made`: the new secret, which the page keeps before it asks; `client`: who asks, for the other owners. */
  rotateLink: (id: string, secret: string, link: string, made: string, client: string): Promise<{ secret: string }> =>
    json("POST", `/api/terrains/${id}/links/${link}/rotate`, secret, { secret: made, client }),

  revokeLink: async (id: string, secret: string, link: string): Promise<void> => {
    await request("DELETE", `/api/terrains/${id}/links/${link}`, secret);
  },

  preview: (id: string, secret: string): Promise<Preview> => json("GET", `/api/terrains/${id}/preview`, secret),

  showPreview: (id: string, secret: string, shown: boolean): Promise<Preview> =>
    json("POST", `/api/terrains/${id}/preview`, secret, { shown, renew: !shown }),

  importStatus: (id: string, secret: string, job: string): Promise<ImportStatus> =>
    json("GET", `/api/terrains/${id}/imports/${job}`, secret),

  answerImport: (id: string, secret: string, job: string, answers: ImportAnswers): Promise<ImportStatus> =>
    json("POST", `/api/terrains/${id}/imports/${job}/answers`, secret, answers),

  cancelImport: async (id: string, secret: string, job: string): Promise<void> => {
    await request("DELETE", `/api/terrains/${id}/imports/${job}`, secret);
  },

  /** Returns what people did, newest first. `before`: only what had ended before this clock. */
  history: (id: string, secret: string, before: number | null): Promise<HistoryPage> =>
    json("GET", `/api/terrains/${id}/history${before === null ? "" : `?before=${before}`}`, secret),

  /** A new terrain as this one was at a clock. */
  fork: (id: string, secret: string, at: number): Promise<OpenedTerrain> =>
    json("POST", `/api/terrains/${id}/fork`, secret, { at }),

  code: (id: string, secret: string, role: Role): Promise<JoinCode> =>
    json("POST", `/api/terrains/${id}/codes`, secret, { role }),

  prolong: (id: string, secret: string, code: string): Promise<JoinCode> =>
    json("POST", `/api/terrains/${id}/codes/prolong`, secret, { code }),

  /** Returns the terrains that this server keeps; `key` is that of the machine's owner. */
  kept: (key: string, skip: number): Promise<{ readonly total: number; readonly terrains: readonly KeptTerrain[] }> =>
    json("GET", `/api/server/terrains?skip=${skip}`, key),

  openKept: (key: string, id: string): Promise<OpenedTerrain> =>
    json("POST", `/api/server/terrains/${id}/links`, key, { role: "owner" }),
};
