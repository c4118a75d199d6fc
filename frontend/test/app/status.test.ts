// SPEC U5
import fc from "fast-check";
import { describe, expect, it } from "vitest";
import { type ConnectionState, status } from "../../src/app/status.ts";

const input = (connection: ConnectionState, pending: number, canEdit = true, reason: string | null = null) => ({
  connection,
  pending,
  canEdit,
  reason,
});

describe("the saved state", () => {
  it("says Saved only while online with nothing pending", () => {
    fc.assert(
      fc.property(
        fc.constantFrom<ConnectionState>("connecting", "online", "reconnecting", "closed"),
        fc.nat(500),
        fc.boolean(),
        (connection, pending, canEdit) => {
          const said = status(input(connection, pending, canEdit));
          const true_ = connection === "online" && pending === 0 && canEdit;
          expect(said.text === "Saved").toBe(true_);
          expect(said.tone === "ok").toBe(connection === "online" && pending === 0);
        },
      ),
    );
  });

  it("counts what is on its way", () => {
    expect(status(input("online", 1)).text).toBe("Saving 1 change…");
    expect(status(input("online", 7)).text).toBe("Saving 7 changes…");
  });

  it("says that changes are kept while offline", () => {
    const said = status(input("reconnecting", 3));
    expect(said).toMatchObject({ tone: "warn", text: "Offline · 3 changes kept" });
    expect(said.detail).toMatch(/until the connection is back/);
    expect(status(input("reconnecting", 0)).text).toBe("Offline");
  });

  it("says why it was closed and what did not arrive", () => {
    const said = status(input("closed", 2, true, "This link has been revoked."));
    expect(said.tone).toBe("bad");
    expect(said.detail).toBe("This link has been revoked. 2 changes did not reach the server.");
    expect(status(input("closed", 0, true, "This link has been revoked.")).detail).toBe("This link has been revoked.");
  });

  it("does not promise saving to somebody who only looks", () => {
    expect(status(input("online", 0, false)).text).toBe("Watching");
  });
});
