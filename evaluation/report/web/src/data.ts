// What a page is given: the JSON that `page_content` of lidarium wrote, and the texts of replays.

export type Interval = { estimate: number | null; low: number | null; high: number | null };
export type TimeKey = string;

export type TimeFigure = {
  reached: number; size: number; cut: number;
  success: Interval; median: Interval; restricted_mean: Interval | null;
};
export type ValueFigure = { median: Interval; mean: Interval; interquartile_mean: Interval };
export type Comparison = {
  policy: string; key: string; pairs: number; difference: Interval | null; ratio: Interval | null; p_holm: number;
  is_beyond_chance: boolean;
};
export type Curve = {
  runs: number; times_s: number[];
  median_percent: (number | null)[]; low_percent: (number | null)[]; high_percent: (number | null)[];
};
export type Profiles = {
  within_factor: Record<TimeKey, { runs: number; factors: number[]; shares: Record<string, number[]> }>;
  coverage_at_least: { thresholds: number[]; share_low_high: Record<string, [number[], number[], number[]]> };
};
export type OfFloor = { runs: number; coverage_percent: number } & Record<
  string, number | { reached: number; median_s: number | null }>;

export type Group = {
  title: string; settings: string; robots: number; floor_set: string; floors: string[]; horizon_s: number;
  over_bound: Record<string, { ratio: Interval; gap: Interval | null } | null>;
  times: Record<TimeKey, Record<string, TimeFigure>>;
  values: Record<string, Record<string, ValueFigure>>;
  comparisons: Comparison[];
  coverage_over_time: Record<string, Curve>;
  profiles: Profiles;
  by_floor: Record<string, Record<string, OfFloor>>;
};

export type Episodes = {
  floors: string[]; group: number[]; policy: number[]; floor: number[]; seed: number[]; replay: number[];
} & Record<string, (number | null)[]>;

export type Listed = { title: string; lacks: string };

/** A column of tables; which values are better, and whether policies are told by their mean and on the leaderboard. */
export type ValueColumn = {
  title: string; unit: string; digits: number; direction: "higher" | "lower" | null; summary: string;
  by_mean: boolean; is_main: boolean;
};

export type Report = {
  kind: "report"; title: string; episodes_version: string; baseline: string; seed: number; records: number;
  warnings: string[]; policies: Record<string, string>; times: Record<TimeKey, string>;
  values: Record<string, ValueColumn>;
  groups: Group[]; episodes: Episodes; replays: Listed[];
};
export type ReplayPage = { kind: "replay"; title: string; replays: Listed[] };

/** Returns the content of the page. */
export function readPage(): Report | ReplayPage {
  return JSON.parse(textOf("page-data")) as Report | ReplayPage;
}

/** Returns the packed text of a replay. */
export function replayText(place: number): string {
  return textOf(`replay-${place}`);
}

function textOf(id: string): string {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no part ${id}; it is not whole`);
  return found.textContent ?? "";
}
