// @vitest-environment happy-dom
// Who deleted, who holds, and what the page says without a connection (SPEC U344, U347, U348).
import { describe, expect, it, vi } from "vitest";
import { GoneStrokes, strokeOf } from "../../src/app/history/gone.ts";
import { ToastList } from "../../src/app/toasts.ts";
import { holders } from "../../src/app/view/scene.ts";
import type { Member, MemberPresence, Op, OpsBroadcast } from "../../src/generated/contract.ts";
import type { EskToasts } from "../../src/ui/controls/toasts.ts";
import "../../src/ui/controls/toasts.ts";

const member = (client: string, name: string): Member => ({
  client,
  name,
  colour: "#2b8a3e",
  role: "edit",
  person: "p",
  conducts: false,
  pen: false,
});
const ordered = (author: string, op: Op): OpsBroadcast => ({
  type: "ordered",
  ops: [{ clock: 1, id: `${author}:1`, author, op }],
});

describe("a stroke that was deleted (SPEC U344)", () => {
  it("is told of by the name of who did it", () => {
    const gone = new GoneStrokes();
    const members = [member("a", "Ana")];
    gone.note(ordered("a", { type: "stroke.delete", stroke: "s1" }), members, "me");
    gone.note(ordered("x", { type: "group", ops: [{ type: "stroke.delete", stroke: "s2" }] } as Op), members, "me");
    gone.note(ordered("me", { type: "stroke.delete", stroke: "s3" }), members, "me");
    expect(gone.words("s1")).toBe("Ana deleted this stroke.");
    expect(gone.words("s2")).toBe("Somebody who has left deleted this stroke.");
    expect(gone.words("s3")).toBe("You deleted this stroke.");
    expect(gone.words("s4")).toBe("Somebody deleted this stroke.");
    expect(strokeOf({ type: "stroke.set", stroke: "s1", fields: {} } as Op)).toBe("s1");
    expect(strokeOf({ type: "terrain.set", fields: {} } as Op)).toBeNull();
  });

  it("has Restore beside the sentence, once", async () => {
    const toasts = new ToastList();
    const run = vi.fn();
    const element = Object.assign(document.createElement("esk-toasts"), { toasts }) as EskToasts;
    document.body.append(element);
    toasts.show("Ana deleted this stroke.", "warn", { label: "Restore", run });
    toasts.show("Ana deleted this stroke.", "warn", { label: "Restore", run });
    await element.updateComplete;
    await vi.waitFor(() => expect(element.renderRoot.querySelectorAll("button.act").length).toBe(1));
    element.renderRoot.querySelector<HTMLButtonElement>("button.act")!.click();
    expect(run).toHaveBeenCalledTimes(1);
    expect(toasts.list.value).toEqual([]);
    toasts.dispose();
    element.remove();
  });
});

describe("who holds a stroke (SPEC U347)", () => {
  it("is everybody else who draws or drags one", () => {
    const members = [member("a", "Ana"), member("b", "Bo"), member("me", "Me")];
    const presence = (client: string, stroke: string | null): [string, MemberPresence] => [
      client,
      { client, cursor: null, tool: "select", stroke, eye: null, target: null },
    ];
    const presences = new Map([presence("a", "s1"), presence("b", null), presence("me", "s2")]);
    const held = holders({ members, presences, me: "me", myColour: "#000000" });
    expect(held.map((h) => [h.member.name, h.stroke])).toEqual([["Ana", "s1"]]);
  });
});
