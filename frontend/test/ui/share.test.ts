// @vitest-environment happy-dom
// Links: replacing asks first and loses none; codes say how long they live (SPEC U340, U341, U342, U343).
import { signal } from "@preact/signals-core";
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { type AccessLink, ApiError, api } from "../../src/app/server/api.ts";
import { classApi } from "../../src/app/server/classes/class-api.ts";
import type { EskShare } from "../../src/ui/dialogs/share-dialog.ts";
import "../../src/ui/dialogs/share-dialog.ts";
import { newSecret, renewing } from "../../src/app/device/share-links.ts";
import { question } from "../../src/ui/dialogs/share-list.ts";
import { type EskServer, serverPage } from "../../src/ui/pages/server-page.ts";
import { contrast, parseColour } from "./contrast.ts";

vi.mock("@awesome.me/webawesome/dist/components/copy-button/copy-button.js", () => ({ default: class {} }));
vi.mock("@awesome.me/webawesome/dist/components/dialog/dialog.js", () => ({ default: class {} }));
vi.mock("@awesome.me/webawesome/dist/components/qr-code/qr-code.js", () => ({ default: class {} }));
vi.mock("@awesome.me/webawesome/dist/components/switch/switch.js", () => ({ default: class {} }));

const own: AccessLink = { id: "l1", role: "owner", name: "Owner", created: 0, revoked: null, own: true };
const drawing: AccessLink = { id: "l2", role: "edit", name: "Class", created: 1, revoked: null, own: false };

beforeEach(() => {
  localStorage.clear();
  vi.spyOn(api, "links").mockResolvedValue([own, drawing]);
  vi.spyOn(classApi, "list").mockResolvedValue([]);
  vi.spyOn(api, "preview").mockResolvedValue({ token: "p", shown: false, available: false });
});
afterEach(() => {
  document.body.replaceChildren();
  vi.restoreAllMocks();
  vi.useRealTimers();
});

async function dialog() {
  const adopt = vi.fn();
  const terrain = {
    id: "t",
    secret: "old",
    client: "me",
    store: localStorage,
    role: signal("owner"),
    toasts: { show: vi.fn() },
    adoptSecret: adopt,
  };
  const share = document.createElement("esk-share") as EskShare;
  Object.assign(share, { terrain, open: true });
  document.body.append(share);
  await vi.waitFor(() => expect(share.renderRoot.querySelector("esk-share-list")).not.toBeNull());
  await share.updateComplete;
  const list = share.renderRoot.querySelector("esk-share-list") as HTMLElement & { updateComplete: Promise<boolean> };
  await list.updateComplete;
  const press = async (label: string): Promise<void> => {
    const button = [...list.shadowRoot!.querySelectorAll("button")].find(
      (b) => b.getAttribute("aria-label") === label || b.textContent!.trim() === label,
    );
    expect(button, label).toBeDefined();
    button!.click();
    await list.updateComplete;
    await share.updateComplete;
  };
  return { share, list, press, adopt };
}

describe("replacing and revoking (SPEC U340)", () => {
  it("asks first, and does nothing when the answer is no", async () => {
    const revoke = vi.spyOn(api, "revokeLink").mockResolvedValue();
    const rotate = vi.spyOn(api, "rotateLink").mockImplementation(async (...[, , , made]) => ({ secret: made }));
    const { list, press } = await dialog();
    await press("Revoke Class");
    expect(revoke).not.toHaveBeenCalled();
    expect(list.shadowRoot!.textContent).toContain("Whoever came by it is sent away");
    await press("Keep it");
    await press("Replace Class by a new link");
    await press("Keep it");
    expect(rotate).not.toHaveBeenCalled();
    await press("Revoke Class");
    await press("Revoke it");
    expect(revoke).toHaveBeenCalledWith("t", "old", "l2");
    expect(list.shadowRoot!.textContent, "one's own link is never revoked").not.toContain("Revoke Owner");
  });

  it("says of the last owner link that it is the last", () => {
    expect(question(own, "replace", true)).toContain("It is the only one that owns this terrain.");
    expect(question(own, "replace", false)).not.toContain("only one");
    expect(question(own, "replace", true)).toContain("This page keeps the new one");
  });
});

describe("the last owner link (SPEC U341)", () => {
  it("is kept before it is asked for, so that a lost answer loses nothing", async () => {
    let sent = "";
    vi.spyOn(api, "rotateLink").mockImplementation(async (...[, , , made]) => {
      sent = made;
      expect(renewing(localStorage, "t")).toBe(made);
      throw new ApiError("unreachable", "The server does not answer.");
    });
    vi.spyOn(api, "about").mockImplementation(async (_, secret) => {
      if (secret === sent) return { id: "t", role: "owner" };
      throw new ApiError("bad_secret", "no");
    });
    const { press, adopt } = await dialog();
    await press("Replace Owner by a new link");
    await press("Replace it");
    await vi.waitFor(() => expect(adopt).toHaveBeenCalledWith(sent));
    expect(sent).toMatch(/^[A-Za-z0-9_-]{32}$/);
    expect(renewing(localStorage, "t"), "it is the page's secret now").toBeNull();
  });

  it("is not adopted when the server refused", async () => {
    vi.spyOn(api, "rotateLink").mockRejectedValue(new ApiError("not_owner", "Only an owner may do this."));
    vi.spyOn(api, "about").mockRejectedValue(new ApiError("bad_secret", "no"));
    const { share, press, adopt } = await dialog();
    await press("Replace Owner by a new link");
    await press("Replace it");
    await vi.waitFor(() => expect(share.problem).toContain("Only an owner"));
    expect(adopt).not.toHaveBeenCalled();
    expect(renewing(localStorage, "t")).toBeNull();
  });

  it("has secrets that nobody guesses", () => {
    const made = new Set(Array.from({ length: 100 }, newSecret));
    expect(made.size).toBe(100);
    for (const secret of made) expect(secret).toMatch(/^[A-Za-z0-9_-]{32}$/);
  });
});

describe("a join code (SPEC U342)", () => {
  it("says its address with the scheme and how long it lives, and is prolonged", async () => {
    vi.spyOn(api, "code").mockResolvedValue({ code: "K7M2QX", expires_s: 125 });
    const prolong = vi.spyOn(api, "prolong").mockResolvedValue({ code: "K7M2QX", expires_s: 900 });
    const { share } = await dialog();
    const press = async (words: string): Promise<void> => {
      const found = [...share.renderRoot.querySelectorAll("button")].find((b) => b.textContent!.includes(words));
      expect(found, words).toBeDefined();
      found!.click();
      await vi.waitFor(() => expect(share.busy).toBe(false));
      await share.updateComplete;
    };
    await press("Show a code");
    expect(share.renderRoot.textContent).toContain("Valid for 2 more minutes.");
    expect(share.renderRoot.textContent).toContain(`Type it at ${window.location.origin}.`);
    await press("Prolong");
    expect(prolong).toHaveBeenCalledWith("t", "old", "K7M2QX");
    expect(share.renderRoot.textContent).toMatch(/Valid for 1[45] more minutes/);
    const large = [...share.renderRoot.querySelectorAll("a")].find((a) => a.textContent!.includes("Show it large"))!;
    expect(large.getAttribute("href")).toBe("/room#K7M2QX");
    expect(large.target).toBe("_blank");
    expect(window.location.origin).toMatch(/^https?:\/\//);
  });

  it("goes when it has ended", async () => {
    vi.spyOn(api, "code").mockResolvedValue({ code: "K7M2QX", expires_s: 2 });
    const { share } = await dialog();
    vi.useFakeTimers();
    const show = [...share.renderRoot.querySelectorAll("button")].find((b) => b.textContent!.includes("Show a code"));
    show!.click();
    await vi.advanceTimersByTimeAsync(3000);
    expect(share.code).toBeNull();
    expect(share.problem).toContain("has ended");
  });
});

describe("the list of a server (SPEC U343)", () => {
  it("shows what is kept, opens any of it, and forgets a key that is none", async () => {
    const assign = vi.spyOn(window.location, "assign").mockImplementation(() => {});
    const first = { id: "a", title: "", changed: Date.now() / 1000, clock: 1, links: 2, here: 3 };
    const kept = vi.spyOn(api, "kept").mockImplementation(async (_key, skip) => ({
      total: 2,
      terrains: skip === 0 ? [first] : [{ ...first, id: "b", title: "Tor", here: 0 }],
    }));
    vi.spyOn(api, "openKept").mockResolvedValue({ id: "b", secret: "s", role: "owner" });
    const page = serverPage("key") as EskServer;
    document.body.append(page);
    await vi.waitFor(() => expect(page.renderRoot.querySelectorAll("li").length).toBe(1));
    expect(page.renderRoot.textContent).toContain("3 people here now");
    [...page.renderRoot.querySelectorAll("button")].at(-1)!.click();
    await vi.waitFor(() => expect(page.renderRoot.querySelectorAll("li").length).toBe(2));
    expect(localStorage.getItem("esker.server")).toBe("key");
    page.renderRoot.querySelector<HTMLButtonElement>('button[aria-label="Open Tor as its owner"]')!.click();
    await vi.waitFor(() => expect(assign).toHaveBeenCalledWith("/t/b#s"));
    kept.mockRejectedValue(new ApiError("not_keeper", "Only the owner of the server's computer may see this."));
    const again = serverPage("key") as EskServer;
    document.body.append(again);
    await vi.waitFor(() => expect(again.problem).toContain("Only the owner"));
    expect(localStorage.getItem("esker.server")).toBeNull();
  });
});

describe("errors on the start page (SPEC U36)", () => {
  it("stand on a ground of their own, with 4.5 : 1", async () => {
    const { landingStyles } = await import("../../src/ui/styles/landing.ts");
    const rule = /\.problem \{([^}]*)\}/.exec(landingStyles.cssText)![1]!;
    expect(rule).toContain("background: var(--esk-panel-solid)");
    expect(rule).toContain("color: var(--esk-bad);");
    expect(contrast(parseColour("#b3261e"), parseColour("#fcfcfb"))).toBeGreaterThan(4.5);
  });
});
