// SPEC U1, U2, U3
import { describe, expect, it } from "vitest";
import { readJoinInput, terrainLink, terrainPath } from "../../src/app/server/links.ts";
import { route } from "../../src/app/server/router.ts";

const ORIGIN = "https://esker.example";
const at = (path: string) => route(new URL(path, ORIGIN));

describe("route", () => {
  it("knows the landing page and terrains, and nothing else", () => {
    expect(at("/")).toEqual({ page: "landing" });
    expect(at("/t/abc_-9#s3cret")).toEqual({ page: "terrain", id: "abc_-9", secret: "s3cret" });
    expect(at("/t/abc/#s")).toEqual({ page: "terrain", id: "abc", secret: "s" });
    expect(at("/t/abc")).toEqual({ page: "terrain", id: "abc", secret: "" });
    expect(at("/t/")).toEqual({ page: "missing", path: "/t/" });
    expect(at("/t/a%20b#s")).toEqual({ page: "missing", path: "/t/a%20b" });
    expect(at("/admin")).toEqual({ page: "missing", path: "/admin" });
  });

  it("takes the secret from the fragment, never from the query", () => {
    expect(at("/t/abc?secret=x")).toMatchObject({ secret: "" });
    expect(at("/t/abc?x=1#real")).toMatchObject({ secret: "real" });
  });

  it("survives a fragment that is not percent-encoded text", () => {
    expect(at("/t/abc#100%")).toMatchObject({ secret: "100%" });
  });
});

describe("links", () => {
  it("carries the token of the picture beside the secret, which stays in the fragment", () => {
    const url = new URL(terrainLink(ORIGIN, "abc", "s3cret", "t/k"));
    expect(url.searchParams.get("p")).toBe("t/k");
    expect(url.hash).toBe("#s3cret");
    expect(route(url)).toEqual({ page: "terrain", id: "abc", secret: "s3cret" });
    expect(terrainLink(ORIGIN, "abc", "s3cret")).not.toContain("?");
  });

  it.each(["plain", "with/slash", "ü #?&%", "a+b=c"])("puts the secret %j in the fragment only", (secret) => {
    const url = new URL(terrainLink(ORIGIN, "abc", secret));
    expect(url.search).toBe("");
    expect(url.pathname).toBe("/t/abc");
    expect(route(url)).toEqual({ page: "terrain", id: "abc", secret });
  });

  it("builds paths for this server", () => {
    expect(terrainPath("abc", "s")).toBe("/t/abc#s");
  });
});

describe("the Join field", () => {
  it("takes codes as people type them", () => {
    for (const text of ["K7M2QX", "k7m 2qx", " K7M-2QX "]) {
      expect(readJoinInput(text, ORIGIN)).toEqual({ kind: "code", code: "K7M2QX" });
    }
  });

  it("takes longer codes, where many live", () => {
    expect(readJoinInput("k7m2 qx9t", ORIGIN)).toEqual({ kind: "code", code: "K7M2QX9T" });
  });

  it("takes links of this server, whole or from the path on", () => {
    const link = { kind: "link", id: "abc", secret: "s" };
    expect(readJoinInput(`${ORIGIN}/t/abc#s`, ORIGIN)).toEqual(link);
    expect(readJoinInput(" /t/abc#s ", ORIGIN)).toEqual(link);
  });

  it.each([
    ["", /code.*link/],
    ["hello there", /neither a (join )?code/],
    ["K7M2Q", /neither a (join )?code/],
    [`${ORIGIN}/t/abc`, /after # is missing/],
    ["https://elsewhere.example/t/abc#s", /another server \(elsewhere\.example\)/],
    ["javascript:alert(1)", /neither a (join )?code/],
  ])("says what is wrong with %j", (text, sentence) => {
    const read = readJoinInput(text, ORIGIN);
    expect(read.kind).toBe("unreadable");
    if (read.kind === "unreadable") expect(read.message).toMatch(sentence);
  });
});
