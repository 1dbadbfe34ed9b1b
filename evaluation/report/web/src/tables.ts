// The tables of a report: policies, floors, episodes.
import type { Comparison, Group, Interval, OfFloor, Report, ValueColumn } from "./data";
import { button, type Child, element, number, section } from "./dom";
import { shows, type Wanted } from "./filters";
import { type Column, SortedTable } from "./table";
import { onGround, onTheme } from "./theme";

type Standing = { group: Group; policy: string; floor: string | null };
type FloorLine = { group: Group; policy: string; floor: string; found: OfFloor };

export type Shown = { root: HTMLElement; update: (wanted: Wanted) => void };

/** Returns a policy's name with its colour. */
export function named(report: Report, policy: string): HTMLElement {
  const swatch = element("span", { class: "swatch", "aria-hidden": "true" });
  swatch.style.background = onGround(report.policies[policy] ?? "#808080");
  return element("span", { class: "named" }, swatch, element("code", {}, policy));
}

/** The leaderboard: a line for each policy in each group; of one floor where one is chosen. */
export function leaderboard(report: Report): Shown {
  const timeKeys = Object.keys(report.times);
  const columns: Column<Standing>[] = [
    { title: "Policy", value: (line) => line.policy, show: (line) => named(report, line.policy) },
    { title: "Robots", value: (line) => line.group.robots, show: (line) => String(line.group.robots), isNumber: true },
    ...timeKeys.map((key): Column<Standing> => ({
      title: `${capital(report.times[key] ?? key)} [s]`, isNumber: true,
      value: (line) => medianOf(line, key).estimate,
      show: (line) => timeCell(medianOf(line, key), line.group.horizon_s),
    })),
    ...(isBounded(report) ? [{
      title: "Over the bound", isNumber: true,
      value: multipleOf, show: (line: Standing): string => number(multipleOf(line), 2),
    }] : []),
    {
      title: "Against the baseline [s]", isNumber: true,
      value: (line) => comparisonOf(line, timeKeys)?.difference?.estimate ?? null,
      show: (line) => differenceCell(comparisonOf(line, timeKeys), line.policy === report.baseline),
    },
    ...timeKeys.slice(-1).map((key): Column<Standing> => ({
      title: `Reached ${shareOf(report, key)}`, isNumber: true,
      value: (line) => successOf(line, key)?.estimate ?? null,
      show: (line) => percent(successOf(line, key)),
    })),
    { title: "Runs", value: (line) => runsOf(line, timeKeys), show: (line) => String(runsOf(line, timeKeys)), isNumber: true },
    ...Object.entries(report.values).filter(([, column]) => column.is_main).map(([key, column]): Column<Standing> => ({
      title: headed(column), hint: hinted(column), isNumber: true,
      value: (line) => valueOf(line, key, column), show: (line) => number(valueOf(line, key, column), column.digits),
    })),
    { title: "Floors", value: floorsOf, show: floorsOf },
    { title: "Realism", value: (line) => line.group.settings, show: (line) => line.group.settings },
  ];
  const table = new SortedTable("Leaderboard", columns, 1 + timeKeys.length, false, "line");
  const update = (wanted: Wanted): void => table.show(
    report.groups.filter((group) => shows(wanted, group)).flatMap((group) => Object.keys(group.times[timeKeys[0] ?? ""] ?? {})
      .filter((policy) => wanted.policies.has(policy))
      .filter((policy) => wanted.floor === null || group.by_floor[wanted.floor]?.[policy] !== undefined)
      .map((policy) => ({ group, policy, floor: wanted.floor }))));
  return {
    root: section("leaderboard", "Leaderboard", element("p", { class: "note" },
      "Times are medians with 95 % confidence intervals. Coverage is a mean, other columns are medians. "
      + "The difference to the baseline is that of the restricted mean of the last time, in bold if it is significant "
      + "at 5 % (Holm) and its interval excludes zero; † if ranks differ but the mean may not. "
      + "A single floor and fewer than six runs have no intervals."
      + (isBounded(report) ? " \"Over the bound\" is the last time relative to a team that has the floor plan (median)." : "")),
      table.root),
    update: repainted(update),
  };
}

/** A line for each policy on each floor. */
export function floorTable(report: Report): Shown {
  const columns: Column<FloorLine>[] = [
    { title: "Floor", value: (line) => line.floor, show: (line) => line.floor },
    { title: "Policy", value: (line) => line.policy, show: (line) => named(report, line.policy) },
    { title: "Robots", value: (line) => line.group.robots, show: (line) => String(line.group.robots), isNumber: true },
    { title: "Realism", value: (line) => line.group.settings, show: (line) => line.group.settings },
    ...Object.keys(report.times).flatMap((key): Column<FloorLine>[] => [
      {
        title: `${capital(report.times[key] ?? key)} [s]`, isNumber: true,
        value: (line) => timeOn(line.found, key).median_s,
        show: (line) => later(timeOn(line.found, key).median_s, line.group.horizon_s),
      },
      {
        title: "Got there", isNumber: true,
        value: (line) => timeOn(line.found, key).reached / line.found.runs,
        show: (line) => `${timeOn(line.found, key).reached} of ${line.found.runs}`,
      },
    ]),
    {
      title: "Coverage [%]", isNumber: true, value: (line) => line.found.coverage_percent,
      show: (line) => number(line.found.coverage_percent),
    },
  ];
  const table = new SortedTable("Floors", columns, 0, false, "line");
  const update = (wanted: Wanted): void => table.show(
    report.groups.filter((group) => shows(wanted, group)).flatMap((group) => Object.entries(group.by_floor)
      .filter(([floor]) => wanted.floor === null || floor === wanted.floor)
      .flatMap(([floor, found]) => Object.entries(found)
        .filter(([policy]) => wanted.policies.has(policy))
        .map(([policy, figures]) => ({ group, policy, floor, found: figures })))));
  return { root: section("floors", "By floor", table.root), update: repainted(update) };
}

/** A line for each episode; those with a replay have a button. */
export function episodeTable(report: Report, replay: (place: number) => void): Shown {
  const episodes = report.episodes;
  const policies = Object.keys(report.policies);
  const groupOf = (k: number): Group => report.groups[episodes.group[k] ?? 0] as Group;
  const figure = (key: string, title: string, digits: number, more: { hint?: string } = {}): Column<number> => ({
    title, ...more, isNumber: true, value: (k) => episodes[key]?.[k] ?? null, show: (k) => number(episodes[key]?.[k], digits),
  });
  const columns: Column<number>[] = [
    { title: "Floor", value: (k) => episodes.floors[episodes.floor[k] ?? 0] ?? "", show: (k) => episodes.floors[episodes.floor[k] ?? 0] ?? "" },
    { title: "Policy", value: (k) => policies[episodes.policy[k] ?? 0] ?? "", show: (k) => named(report, policies[episodes.policy[k] ?? 0] ?? "") },
    { title: "Robots", value: (k) => groupOf(k).robots, show: (k) => String(groupOf(k).robots), isNumber: true },
    { title: "Realism", value: (k) => groupOf(k).settings, show: (k) => groupOf(k).settings },
    { title: "Seed", value: (k) => episodes.seed[k] ?? 0, show: (k) => String(episodes.seed[k]), isNumber: true },
    ...Object.keys(report.times).map((key) => figure(key, `${capital(report.times[key] ?? key)} [s]`, 1)),
    ...Object.entries(report.values).map(([key, column]) => figure(
      key, headed(column), isWhole(episodes[key]) ? 0 : column.digits, { hint: hinted(column) })),
    {
      title: "Replay", value: (k) => ((episodes.replay[k] ?? -1) < 0 ? 1 : 0),
      show: (k) => {
        const place = episodes.replay[k] ?? -1;
        const title = report.replays[place]?.title;
        return title === undefined ? "–" : button("Replay", () => replay(place), { "aria-label": `Replay ${title}` });
      },
    },
  ];
  const table = new SortedTable("Episodes", columns, columns.length - 1, false, "episode");
  const update = (wanted: Wanted): void => {
    const isShown = report.groups.map((group) => shows(wanted, group));
    const isPolicy = policies.map((policy) => wanted.policies.has(policy));
    const floor = wanted.floor === null ? -1 : episodes.floors.indexOf(wanted.floor);
    table.show(episodes.group.map((_, k) => k).filter((k) => isShown[episodes.group[k] ?? 0] === true
      && isPolicy[episodes.policy[k] ?? 0] === true && (floor < 0 || episodes.floor[k] === floor)));
  };
  return { root: section("episodes", "Episodes", table.root), update: repainted(update) };
}

/** Repeats the last update when the theme changes, for the colours in the lines. */
function repainted(update: (wanted: Wanted) => void): (wanted: Wanted) => void {
  let last: Wanted | null = null;
  onTheme(() => { if (last !== null) update(last); });
  return (wanted) => { last = wanted; update(wanted); };
}

export function capital(text: string): string {
  return text.slice(0, 1).toUpperCase() + text.slice(1);
}

const shareOf = (report: Report, key: string): string => (report.times[key] ?? key).replace("time to ", "");
const floorsOf = (line: Standing): string => line.floor ?? line.group.floor_set;
const NONE: Interval = { estimate: null, low: null, high: null };

function timeOn(found: OfFloor, key: string): { reached: number; median_s: number | null } {
  const time = found[key];
  return typeof time === "object" ? time : { reached: 0, median_s: null };
}

function onFloor(line: Standing): OfFloor | undefined {
  return line.floor === null ? undefined : line.group.by_floor[line.floor]?.[line.policy];
}

function runsOf(line: Standing, keys: readonly string[]): number {
  return onFloor(line)?.runs ?? line.group.times[keys[0] ?? ""]?.[line.policy]?.size ?? 0;
}

function successOf(line: Standing, key: string): Interval | null {
  const found = onFloor(line);
  if (found !== undefined) return { ...NONE, estimate: timeOn(found, key).reached / found.runs };
  return line.group.times[key]?.[line.policy]?.success ?? null;
}

function medianOf(line: Standing, key: string): Interval {
  const found = onFloor(line);
  return found !== undefined ? { ...NONE, estimate: timeOn(found, key).median_s }
    : line.group.times[key]?.[line.policy]?.median ?? NONE;
}

function valueOf(line: Standing, key: string, column: ValueColumn): number | null {
  if (line.floor !== null) {
    const found = onFloor(line)?.[key];
    return typeof found === "number" ? found : null;
  }
  const figure = line.group.values[line.policy]?.[key];
  return (column.by_mean ? figure?.mean.estimate : figure?.median.estimate) ?? null;
}

const headed = ({ title, unit }: ValueColumn): string => capital(title) + (unit === "" ? "" : ` [${unit}]`);

/** Returns what a column shows, and which values are better. */
const hinted = ({ summary, direction, by_mean: byMean }: ValueColumn): string =>
  `${capital(summary)}; ${byMean ? "mean" : "median"} of the runs${direction === null ? "" : `; ${direction} is better`}`;

const isWhole = (values: readonly (number | null)[] | undefined): boolean =>
  values?.every((value) => value === null || Number.isInteger(value)) === true;

function comparisonOf(line: Standing, keys: readonly string[]): Comparison | undefined {
  return line.floor !== null ? undefined
    : line.group.comparisons.find(({ policy, key }) => policy === line.policy && key === keys.at(-1));
}

const isBounded = (report: Report): boolean =>
  report.groups.some((group) => Object.values(group.over_bound).some((found) => found !== null));

function multipleOf(line: Standing): number | null {
  return line.floor !== null ? null : line.group.over_bound[line.policy]?.ratio.estimate ?? null;
}

function percent(found: Interval | null): string {
  return found?.estimate === null || found === null ? "–" : `${number(100 * found.estimate, 0)} %`;
}

function later(value: number | null, horizon: number): string {
  return value === null ? `> ${number(horizon, 0)}` : number(value);
}

/** Returns a time with its interval, in numbers and as a bar up to the horizon. */
function timeCell(found: Interval, horizon: number): Child {
  const text = later(found.estimate, horizon);
  if (found.low === null) return text;
  const range = `${number(found.low)} to ${found.high === null ? `> ${number(horizon, 0)}` : number(found.high)}`;
  return element("span", { class: "interval" }, text, element("small", {}, range));
}

function differenceCell(found: Comparison | undefined, isBaseline: boolean): Child {
  if (isBaseline) return element("span", { class: "faint" }, "baseline");
  if (found?.difference == null) return "–";
  const { estimate, low, high } = found.difference;
  const signed = (value: number | null): string => `${(value ?? 0) > 0 ? "+" : ""}${number(value)}`;
  const text = found.is_beyond_chance ? element("strong", {}, signed(estimate))
    : element("span", {}, signed(estimate) + (found.p_holm < 0.05 ? " †" : ""));
  return low === null || high === null ? text
    : element("span", { class: "interval" }, text, element("small", {}, `${signed(low)} to ${signed(high)}`));
}
