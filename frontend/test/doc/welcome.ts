/** The first message of a server, for the tests of everything that takes one. */

import { PROTOCOL_VERSION, type Welcome } from "../../src/generated/contract.ts";

/** A welcome with plain values, changed by `change`. */
export function welcomeOf(change: Partial<Welcome>): Welcome {
  return {
    type: "welcome",
    ticket: "",
    lesson: null,
    token: "",
    protocol: PROTOCOL_VERSION,
    server: "",
    client: "me",
    role: "edit",
    colour: "#000000",
    levels: 4,
    finest: 4,
    clock: 0,
    document: null,
    ops: null,
    members: [],
    device: "",
    ...change,
  };
}
