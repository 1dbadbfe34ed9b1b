// The time line of an episode: coverage as a curve, events as marks in lanes, and all of them as a list.
import { button, clock, drawn, element, tick } from "../dom";
import type { Episode, Happening } from "./episode";
import { inWords, type Kind, kindOf, KINDS } from "./events";
import { onGround, onTheme } from "../theme";

const WIDTH = 1000;
const LANE = 14;
const CURVE = 40;
const MOST_LISTED = 400;

export type Timeline = { strip: HTMLElement; list: HTMLElement; at: (time: number) => void };

/** Returns the time line; `seek` is called with a time that was chosen on it. */
export function timeline(episode: Episode, duration: () => number, seek: (time: number) => void): Timeline {
  const { events } = episode.header;
  const lanes = KINDS.filter((kind) => kind.isMajor && events.some((event) => kindOf(event) === kind));
  const height = CURVE + LANE * lanes.length + 4;
  const now = drawn("line", { y1: 0, y2: height, class: "now" });
  const picture = drawn("svg", {
    viewBox: `0 0 ${WIDTH} ${height}`, preserveAspectRatio: "none", height, "aria-hidden": "true", class: "strip",
  });
  const across = (time: number): number => (WIDTH * time) / Math.max(duration(), 1e-6);
  const paint = (): void => {
    const points: string[] = [];
    let last = CURVE;
    episode.coverage((time, share) => {
      points.push(`${across(time).toFixed(1)},${last.toFixed(1)}`);
      last = CURVE - (CURVE - 3) * share;
      points.push(`${across(time).toFixed(1)},${last.toFixed(1)}`);
    });
    points.push(`${across(episode.header.duration_s).toFixed(1)},${last.toFixed(1)}`);
    picture.replaceChildren(
      drawn("polyline", { points: points.join(" "), class: "curve", "vector-effect": "non-scaling-stroke" }),
      ...lanes.flatMap((kind, lane) => marks(episode, kind, CURVE + 2 + LANE * lane, across)), now);
  };
  paint();
  onTheme(paint);
  const strip = element("div", { class: "lanes" },
    element("div", { class: "lane-names", "aria-hidden": "true" },
      element("span", { style: `height:${CURVE + 2}px` }, "Coverage"),
      ...lanes.map(({ name }) => element("span", { style: `height:${LANE}px` }, name))),
    picture);
  picture.addEventListener("pointerdown", (press) => {
    const box = picture.getBoundingClientRect();
    seek((duration() * (press.clientX - box.left)) / box.width);
  });
  const list = eventList(events, episode, seek);
  return {
    strip, list: list.root,
    at: (time) => {
      now.setAttribute("x1", across(time).toFixed(2));
      now.setAttribute("x2", across(time).toFixed(2));
      list.at(time);
    },
  };
}

function marks(episode: Episode, kind: Kind, top: number, across: (time: number) => number): SVGElement[] {
  return episode.header.events.filter((event) => kindOf(event) === kind).map((event) => {
    const own = episode.header.colours[episode.agents.indexOf(event.agent ?? "")] ?? "#808080";
    return drawn("rect", {
      x: (across(event.time_s) - 2).toFixed(1), y: top, width: 4, height: LANE - 3, fill: onGround(own),
    }, drawn("title", {}, described(event)));
  });
}

function described(event: Happening): string {
  return `${clock(event.time_s)} ${event.agent ?? "team"} ${inWords(event)}`;
}

/** Returns the events as a list of buttons that lead to their times; kinds can be left out. */
function eventList(
  events: readonly Happening[], episode: Episode, seek: (time: number) => void,
): { root: HTMLElement; at: (time: number) => void } {
  const there = KINDS.filter((kind) => events.some((event) => kindOf(event) === kind));
  const chosen = new Set<Kind>(there.filter(({ isMajor }) => isMajor));
  const list = element("ol", { class: "events" });
  const note = element("p", { class: "note" });
  let lines: { time: number; line: HTMLLIElement }[] = [];
  let current: HTMLLIElement | null = null;
  const fill = (): void => {
    const wanted = events.filter((event) => !KINDS.includes(kindOf(event)) || chosen.has(kindOf(event)));
    lines = wanted.slice(0, MOST_LISTED).map((event) => ({ time: event.time_s, line: lineOf(event, episode, seek) }));
    current = null;
    list.replaceChildren(...lines.map(({ line }) => line));
    note.textContent = wanted.length === 0 ? "None of these kinds."
      : wanted.length > MOST_LISTED ? `The first ${MOST_LISTED} of ${wanted.length}.` : "";
  };
  fill();
  const ticks = there.map((kind) => tick(kind.name, chosen.has(kind), (isOn) => {
    if (isOn) chosen.add(kind); else chosen.delete(kind);
    fill();
  }).field);
  const root = element("details", { class: "event-list" }, element("summary", {}, `Events (${events.length})`),
    element("div", { class: "row" }, ...ticks), note, list);
  return {
    root,
    at: (time) => {
      const next = lines.findLast((each) => each.time <= time + 1e-9)?.line ?? null;
      if (next === current) return;
      current?.removeAttribute("aria-current");
      next?.setAttribute("aria-current", "time");
      current = next;
    },
  };
}

function lineOf(event: Happening, episode: Episode, seek: (time: number) => void): HTMLLIElement {
  const swatch = element("span", { class: "swatch", "aria-hidden": "true" });
  swatch.style.background = onGround(episode.header.colours[episode.agents.indexOf(event.agent ?? "")] ?? "#808080");
  const press = button("", () => seek(event.time_s), { class: "event" });
  press.append(element("span", { class: "time" }, clock(event.time_s)), " ", swatch, " ",
    `${event.agent ?? "team"} ${inWords(event)}`);
  return element("li", {}, press);
}
