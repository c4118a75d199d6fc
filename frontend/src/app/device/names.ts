/** Friendly names for people who have not chosen one, so that two strangers on a terrain can be told apart. */
import type { Member } from "../../generated/contract.ts";

const ADJECTIVES = [
  "Amber",
  "Ashen",
  "Bold",
  "Brisk",
  "Calm",
  "Clever",
  "Copper",
  "Coral",
  "Dapper",
  "Early",
  "Gentle",
  "Golden",
  "Hazel",
  "Ivory",
  "Jade",
  "Keen",
  "Lively",
  "Lunar",
  "Merry",
  "Misty",
  "Nimble",
  "Noble",
  "Olive",
  "Patient",
  "Quiet",
  "Rustic",
  "Silver",
  "Snowy",
  "Sunny",
  "Swift",
  "Velvet",
  "Wandering",
] as const;

const ANIMALS = [
  "Badger",
  "Beaver",
  "Bison",
  "Chamois",
  "Crane",
  "Curlew",
  "Dormouse",
  "Eagle",
  "Ermine",
  "Falcon",
  "Finch",
  "Fox",
  "Goldcrest",
  "Hare",
  "Heron",
  "Ibex",
  "Jay",
  "Kestrel",
  "Lynx",
  "Marmot",
  "Marten",
  "Newt",
  "Osprey",
  "Otter",
  "Owl",
  "Pika",
  "Plover",
  "Raven",
  "Stoat",
  "Swan",
  "Vole",
  "Wolf",
] as const;

/** FNV-1a with a final mix: equal strings give equal numbers, close ones far numbers. */
function hash(text: string): number {
  let h = 0x811c9dc5;
  for (let i = 0; i < text.length; i++) h = Math.imul(h ^ text.charCodeAt(i), 0x01000193);
  h = Math.imul(h ^ (h >>> 16), 0x85ebca6b);
  h = Math.imul(h ^ (h >>> 13), 0xc2b2ae35);
  return (h ^ (h >>> 16)) >>> 0;
}

/** "Amber Lynx": always the same for one client id. */
export function friendlyName(client: string): string {
  const h = hash(client);
  return `${ADJECTIVES[h % ADJECTIVES.length]} ${ANIMALS[Math.floor(h / ADJECTIVES.length) % ANIMALS.length]}`;
}

/** The name to show for a member; one who gave none (a script, say) goes by a friendly name made from the client's id. */
export function memberName(member: Pick<Member, "client" | "name">): string {
  return member.name.trim() || friendlyName(member.client);
}
