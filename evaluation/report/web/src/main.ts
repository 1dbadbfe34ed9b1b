// The page of a report, or of a single replay.
import { charts } from "./charts";
import { readPage, type Report } from "./data";
import { count, element, section } from "./dom";
import { filterBar } from "./filters";
import { Player } from "./replay/player";
import { episodeTable, floorTable, leaderboard } from "./tables";
import { themeButton } from "./theme";

const NAMES: readonly [string, string][] = [
  ["leaderboard", "Leaderboard"], ["charts", "Charts"], ["floors", "Floors"], ["episodes", "Episodes"], ["replay", "Replay"],
];

function start(): void {
  const place = document.getElementById("page");
  if (place === null) return;
  try {
    const page = readPage();
    if (page.kind === "report") showReport(place, page);
    else place.append(header(page.title, [], []), element("main", {}, new Player(page.replays, "Replay").root));
  } catch (error) {
    place.append(element("p", { class: "problem", role: "alert" },
      `This page cannot be shown: ${error instanceof Error ? error.message : String(error)}`));
  }
}

function showReport(place: HTMLElement, report: Report): void {
  const player = new Player(report.replays, "Replay");
  const parts = [leaderboard(report), charts(report), floorTable(report), episodeTable(report, (k) => player.show(k))];
  const bar = filterBar(report, (wanted) => parts.forEach((part) => part.update(wanted)));
  const facts = [
    count(report.episodes.group.length, "episode"), count(Object.keys(report.policies).length, "policy").replace("policys", "policies"),
    count(report.episodes.floors.length, "floor"), count(report.replays.length, "replay"),
    `baseline ${report.baseline}`, `lidarium ${report.episodes_version}`,
  ];
  const replay = report.replays.length > 0 ? player.root : section("replay", "Replay", element("p", {},
    "No episode has a replay here: none has a record, or the report was made with --replays 0."));
  place.append(header(report.title, facts, NAMES), element("main", {}, warnings(report), bar,
    ...parts.map(({ root }) => root), replay));
}

function header(title: string, facts: readonly string[], names: typeof NAMES): HTMLElement {
  const links = names.map(([id, label]) => element("a", { href: `#${id}` }, label));
  return element("header", {},
    element("div", { class: "bar" }, element("h1", {}, title), themeButton()),
    ...(facts.length > 0 ? [element("p", { class: "facts" }, facts.join(" · "))] : []),
    ...(links.length > 0 ? [element("nav", { "aria-label": "Parts of the page" }, ...links)] : []));
}

function warnings(report: Report): HTMLElement {
  return report.warnings.length === 0 ? element("div", { hidden: true }) : element("details", { class: "card careful" },
    element("summary", {}, `Be careful: ${count(report.warnings.length, "remark")}`),
    element("ul", {}, ...report.warnings.map((warning) => element("li", {}, warning))));
}

start();
