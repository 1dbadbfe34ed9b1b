// Events of an episode in words, and the kinds in which a time line sorts them.
import type { Happening } from "./episode";

export type Kind = { name: string; kinds: readonly string[]; isMajor: boolean; mark: string };

/** Lanes of the time line from above; marks differ in shape so that colour is not needed. */
export const KINDS: readonly Kind[] = [
  { name: "Merges", kinds: ["merge"], isMajor: true, mark: "star" },
  { name: "Orders", kinds: ["order", "refused", "lost"], isMajor: true, mark: "square" },
  { name: "States", kinds: ["state", "ended"], isMajor: true, mark: "circle" },
  { name: "Contacts", kinds: ["contact"], isMajor: true, mark: "cross" },
  { name: "Given up", kinds: ["given_up"], isMajor: false, mark: "cross" },
  { name: "Decisions", kinds: ["decision"], isMajor: false, mark: "dot" },
];
const OTHERS: Kind = { name: "Others", kinds: [], isMajor: true, mark: "circle" };

/** Returns the kind of an event. */
export function kindOf(event: Happening): Kind {
  return KINDS.find(({ kinds }) => kinds.includes(event.kind)) ?? OTHERS;
}

/** Returns what happened, in words. */
export function inWords(event: Happening): string {
  const why = event.reason === undefined || event.reason === "" ? "" : `: ${event.reason}`;
  const order = (event.order ?? "").replaceAll("_", " ");
  switch (event.kind) {
    case "merge":
      return `joined with ${event.other ?? "another"}`
        + (event.error_m === undefined ? "" : `, ${event.error_m.toFixed(3)} m off the truth`);
    case "order": return `ordered to ${order}${place(event, order.endsWith("to") ? "" : " at")}${why}`;
    case "refused": return `did not take the order to ${order}${why}`;
    case "lost": return `was not reached by the order to ${order}${why}`;
    case "state": return `now ${event.state ?? ""}${why}`;
    case "ended": return `ended${why}`;
    case "contact": return "touches something";
    case "given_up": return `gives up a frontier${place(event, " at")}${why}`;
    case "decision": return typeof event.x === "number" ? `sent${place(event, " to")}` : "sent nowhere";
    default: return `${event.kind.replaceAll("_", " ")}${place(event, " at")}${why}`;
  }
}

function place(event: Happening, word: string): string {
  return typeof event.x === "number" && typeof event.y === "number"
    ? `${word} ${event.x.toFixed(1)}, ${event.y.toFixed(1)} m` : "";
}
