/** The lesson as a page knows it: lines that are kept, and whose view mine follows (SPEC L26, L27). */

import { signal } from "@preact/signals-core";
import { describe, expect, test } from "vitest";
import { Drafts } from "../../src/app/lesson/drafts.ts";
import { LessonView, NOBODY_LEADS } from "../../src/app/lesson/lesson-view.ts";
import { apply } from "../../src/doc/apply.ts";
import { fromDocument, fullStroke } from "../../src/doc/document.ts";
import { SyncDoc } from "../../src/doc/sync.ts";
import type { ClientMessage, Document, Member, Op, Stroke } from "../../src/generated/contract.ts";
import { PROTOCOL_VERSION } from "../../src/generated/contract.ts";
import { SETTINGS } from "../settings.ts";

const EMPTY: Document = {
  id: "t",
  clock: 0,
  settings: SETTINGS,
  strokes: [],
  deleted: [],
  layers: [],
  deleted_layers: [],
};
const LINE: Stroke = fullStroke({
  id: "s",
  kind: "profile",
  first: [0, 0, 0],
  last: [100, 0, 0],
  curve: Array.from({ length: 1500 }, (_, i) => [i / 1499, i % 7]),
});
function store() {
  const values = new Map<string, string>();
  return {
    getItem: (key: string) => values.get(key) ?? null,
    setItem: (key: string, value: string) => void values.set(key, value),
    removeItem: (key: string) => void values.delete(key),
  };
}

function page() {
  const doc = new SyncDoc("me", () => 0);
  doc.welcome({
    type: "welcome",
    protocol: PROTOCOL_VERSION,
    server: "",
    client: "me",
    token: "",
    ticket: "",
    role: "edit",
    colour: "#123456",
    levels: 1,
    finest: 1,
    clock: 0,
    document: EMPTY,
    ops: null,
    members: [],
    device: "",
    lesson: null,
  });
  const sent: ClientMessage[] = [];
  const members = signal<readonly Member[]>([]);
  const memory = store();
  let lifted = 0;
  const host = {
    id: "t",
    client: "me",
    store: memory,
    doc,
    members,
    connection: { send: (message: ClientMessage) => sent.push(message) },
    submit: (op: Op, gesture?: string) => doc.submit(op, gesture) === null,
  };
  const lesson = new LessonView(host, () => {
    lifted += 1;
  });
  return { doc, sent, members, memory, lesson, lifted: () => lifted };
}

describe("lines that are kept (SPEC L26)", () => {
  test("a line that the server did not take comes back as it was drawn", () => {
    const { doc, lesson, memory, lifted } = page();
    doc.submit({ type: "stroke.begin", stroke: { ...LINE, curve: LINE.curve.slice(0, 9) } });
    const [begin] = doc.outgoing();
    doc.submit({ type: "stroke.set", stroke: "s", fields: { curve: LINE.curve.slice(0, 700) } });
    lesson.receive({ ...NOBODY_LEADS, hands_off: true, draws: false });
    expect(lifted()).toBe(1);
    expect(lesson.drafts.list.value.map((s) => s.curve.length)).toEqual([700]);
    expect(new Drafts(memory, "t").list.value).toEqual(lesson.drafts.list.value);
    for (const { id } of [begin!, ...doc.outgoing()])
      doc.reject({ type: "reject", id, code: "hands_off", message: "Hands off." });
    expect(doc.doc.value!.strokes.size).toBe(0);
    lesson.receive(NOBODY_LEADS);
    expect(lesson.drafts.list.value).toHaveLength(1);
    lesson.putBack();
    const [back] = [...doc.doc.value!.strokes.values()];
    expect(back!.curve).toEqual(LINE.curve.slice(0, 700));
    expect(back!.id).not.toBe("s");
    expect(lesson.drafts.list.value).toEqual([]);
    doc.undo();
    expect(doc.doc.value!.strokes.size).toBe(0);
  });

  test("a line of which the server has the beginning goes on as it was", () => {
    const { memory } = page();
    const drafts = new Drafts(memory, "t");
    drafts.keep([LINE]);
    let doc = fromDocument({ ...EMPTY, strokes: [{ ...LINE, curve: LINE.curve.slice(0, 40), last: [9, 9, 9] }] });
    for (const ops of drafts.take(doc, "me", 5)) for (const op of ops) doc = apply(doc, op);
    expect(doc.strokes.get("s")!.curve).toEqual(LINE.curve);
    expect(doc.strokes.get("s")!.last).toEqual(LINE.last);
  });

  test("what the document has is not offered, and what cannot be read is nothing", () => {
    const { memory } = page();
    const drafts = new Drafts(memory, "t");
    drafts.keep([LINE]);
    drafts.settle(fromDocument({ ...EMPTY, strokes: [LINE] }));
    expect(drafts.list.value).toEqual([]);
    memory.setItem("esker.drafts.t", '{"no": [');
    expect(new Drafts(memory, "t").list.value).toEqual([]);
    memory.setItem("esker.drafts.t", '[{"id": 3}, null]');
    expect(new Drafts(memory, "t").list.value).toEqual([]);
  });
});

describe("whose view mine follows (SPEC L27)", () => {
  test("who shows, unless I look away where I may", () => {
    const { lesson, members } = page();
    members.value = [
      { client: "t", name: "Ms Ray", colour: "#000000", role: "owner", person: "p", conducts: true, pen: false },
    ];
    lesson.receive({ ...NOBODY_LEADS, look: "t" });
    expect([lesson.leader.value, lesson.shower.value]).toEqual(["t", "Ms Ray"]);
    lesson.lookAway(true);
    expect([lesson.leader.value, lesson.shower.value]).toEqual([null, "Ms Ray"]);
    lesson.receive({ ...NOBODY_LEADS, look: "t", held: true });
    expect(lesson.leader.value).toBe("t");
    lesson.lookAway(true);
    expect(lesson.leader.value).toBe("t");
    lesson.receive({ ...NOBODY_LEADS, look: "u" });
    expect(lesson.leader.value).toBe("u");
    lesson.receive({ ...NOBODY_LEADS, look: "me" });
    expect([lesson.leader.value, lesson.shower.value]).toEqual([null, null]);
  });

  test("a switch leaves the others as they are, and the ticket is kept", () => {
    const { lesson, sent, memory } = page();
    lesson.conduct({ hands_off: true });
    expect(sent).toEqual([
      { type: "conduct", hands_off: true, protect: null, hide: null, animals: null, look: null, held: null },
    ]);
    lesson.keepTicket("");
    expect(lesson.ticket).toBeNull();
    lesson.keepTicket("a");
    expect(memory.getItem("esker.ticket.t")).toBe("a");
  });
});
