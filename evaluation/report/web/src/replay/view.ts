// One episode on the page: its picture, its time line, and its robots in words.
import { clock, element, number } from "../dom";
import { type Look, Picture } from "./drawing";
import type { Episode } from "./episode";
import { timeline } from "./timeline";
import { onGround, onTheme } from "../theme";

export type View = {
  root: HTMLElement; episode: Episode;
  draw: (look: Look) => void;
  /** Says in words what is to be seen; for readers of the page without eyes, when it is at rest. */
  describe: (look: Look) => string;
};

/** Returns the view of an episode; `duration` is that of the slider, `seek` jumps to a time. */
export function viewOf(episode: Episode, duration: () => number, seek: (time: number) => void): View {
  const { header } = episode;
  const canvas = element("canvas", { role: "img", "aria-label": header.title });
  const { grid } = header;
  canvas.style.aspectRatio = String(Math.min(Math.max(grid.columns / grid.rows, 1), 1.9));
  const picture = new Picture(episode, canvas);
  const line = timeline(episode, duration, seek);
  const explored = element("span", { class: "explored" });
  const cells = episode.agents.map(() => [element("td", { class: "number" }), element("td", { class: "number" }), element("td")] as const);
  const swatches = episode.agents.map(() => element("span", { class: "swatch", "aria-hidden": "true" }));
  const paint = (): void => swatches.forEach((swatch, robot) => {
    swatch.style.background = onGround(header.colours[robot] ?? "#808080");
  });
  paint();
  onTheme(paint);
  const table = element("table", { class: "robots" },
    element("caption", { class: "hidden" }, `Robots of ${header.title}`),
    element("thead", {}, element("tr", {}, ...["Robot", "Position [m]", "Target [m]", "State"].map((title, k) =>
      element("th", { scope: "col", class: k === 1 || k === 2 ? "number" : "" }, title)))),
    element("tbody", {}, ...episode.agents.map((agent, robot) => element("tr", {},
      element("th", { scope: "row" }, element("span", { class: "named" }, swatches[robot]!, agent)), ...cells[robot]!))));
  const lacks = header.lacks === "" ? [] : [element("p", { class: "note" },
    `Scans, true walls and own maps are not shown: ${header.lacks}`)];
  const root = element("article", { class: "view" },
    element("div", { class: "view-title" }, element("h3", {}, header.title), explored), canvas, line.strip, ...lacks,
    element("div", { class: "scrolling", tabindex: 0, role: "region", "aria-label": `Robots of ${header.title}` }, table),
    line.list);
  const facts = (time: number): [string, string, string][] => episode.agents.map((agent, robot) => {
    const pose = episode.poseAt(robot, time);
    const target = episode.targetAt(agent, time);
    return [`${number(pose.x)}, ${number(pose.y)}`,
      target === null ? "–" : `${number(target.x)}, ${number(target.y)}`, stateOf(episode, agent, time)];
  });
  const look = (at: Look): Look => ({ ...at, time: Math.min(at.time, header.duration_s) });
  return {
    root, episode,
    draw: (at) => {
      const shown = look(at);
      picture.draw(shown);
      line.at(shown.time);
      setText(explored, `${(100 * episode.coverageAt(shown.time)).toFixed(1)} % explored`);
      facts(shown.time).forEach((texts, robot) => texts.forEach((text, k) => setText(cells[robot]![k]!, text)));
    },
    describe: (at) => {
      const { time } = look(at);
      const robots = facts(time).map(([here, target, state], robot) =>
        `${episode.agents[robot]} at ${here}${target === "–" ? "" : `, on its way to ${target}`}, ${state}`);
      const words = `${header.title} at ${clock(time)}: ${(100 * episode.coverageAt(time)).toFixed(1)} % explored. `
        + `${robots.join("; ")}.`;
      canvas.setAttribute("aria-label", words);
      return words;
    },
  };
}

function stateOf(episode: Episode, agent: string, time: number): string {
  const event = episode.lastOf(agent, time, ({ kind }) => kind === "state" || kind === "ended");
  if (event === null) return "exploring";
  return event.kind === "ended" ? `ended: ${event.reason ?? ""}` : event.state ?? "";
}

function setText(target: HTMLElement, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}
