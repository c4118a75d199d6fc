/** The pages that addresses mean (DESIGN 13: `/t/{id}#{secret}`, the secret only ever in the fragment). */
export type Route =
  | { readonly page: "landing" }
  | { readonly page: "terrain"; readonly id: string; readonly secret: string }
  | { readonly page: "server"; readonly key: string }
  | { readonly page: "privacy" }
  | { readonly page: "lesson"; readonly id: string }
  | { readonly page: "room"; readonly code: string }
  | { readonly page: "help"; readonly topic: "warning" | "devices" }
  | { readonly page: "join"; readonly code: string }
  | { readonly page: "wall"; readonly id: string; readonly lesson: string; readonly secret: string }
  | { readonly page: "missing"; readonly path: string };

const TERRAIN = /^\/t\/([A-Za-z0-9_-]{1,40})\/?$/;
const LESSON = /^\/lessons\/([A-Za-z0-9_-]{1,40})\/?$/;
const WALL = /^\/wall\/([A-Za-z0-9_-]{1,40})\/([A-Za-z0-9_-]{1,40})\/?$/;

/** Reads an address. A terrain without a secret is still a terrain: the page then asks for the whole link. */
export function route(url: URL): Route {
  if (url.pathname === "/" || url.pathname === "/index.html") return { page: "landing" };
  const match = TERRAIN.exec(url.pathname);
  if (match?.[1]) return { page: "terrain", id: match[1], secret: decode(url.hash.slice(1)) };
  if (/^\/server\/?$/.test(url.pathname)) return { page: "server", key: decode(url.hash.slice(1)) };
  if (/^\/privacy\/?$/.test(url.pathname)) return { page: "privacy" };
  if (/^\/room\/?$/.test(url.pathname)) return { page: "room", code: decode(url.hash.slice(1)) };
  if (/^\/help\/warning\/?$/.test(url.pathname)) return { page: "help", topic: "warning" };
  if (/^\/help\/devices\/?$/.test(url.pathname)) return { page: "help", topic: "devices" };
  const lesson = LESSON.exec(url.pathname);
  if (lesson?.[1]) return { page: "lesson", id: lesson[1] };
  if (/^\/join\/?$/.test(url.pathname)) return { page: "join", code: decode(url.hash.slice(1)) };
  const wall = WALL.exec(url.pathname);
  if (wall?.[1] && wall[2]) return { page: "wall", id: wall[1], lesson: wall[2], secret: decode(url.hash.slice(1)) };
  return { page: "missing", path: url.pathname };
}

function decode(fragment: string): string {
  try {
    return decodeURIComponent(fragment);
  } catch {
    return fragment;
  }
}
