// A recorded episode: maps, poses, scans and events at any time.
import { columns, Numbers, scanRanges, unpack } from "./unpacking";

export const UNKNOWN = 0;
export const FREE = 1;
export const OCCUPIED = 2;

export type Grid = { rows: number; columns: number; x: number; y: number; cell: number };
export type Happening = {
  time_s: number; kind: string; agent: string | null;
  x?: number | null; y?: number | null; other?: string; reason?: string; state?: string; order?: string;
  error_m?: number; size_m?: number;
};
export type Header = {
  title: string; floor: string; policy: string; seed: number | null; robots: number; version: string;
  interrupted: boolean; lacks: string; duration_s: number; radius_m: number; known_starts: boolean;
  colours: string[]; events: Happening[]; grid: Grid; layers: string[]; has_truth: boolean;
  beam_angles: number[]; scan_unit_m: number; has_beliefs: boolean; people_radius_m: number[];
  /** Squares of so many cells of the grid along a side, and steps of a probability; null where nothing is predicted. */
  prediction: { rows: number; columns: number; cells: number; steps: number } | null;
  /** Ends x, y, x, y of the openings; leaves slide away to the first. */
  doors: [number, number, number, number][];
};
export type Pose = { x: number; y: number; theta: number };
export type Scan = { pose: Pose; ranges: Float32Array };

/** Samples between whole maps that are kept: to jump to a time, so many changes are applied at most. */
const KEPT_EVERY = 24;

/** A map over time. */
class Layer {
  private readonly changes: Uint32Array[] = [];
  private readonly kept: Uint8Array[] = [];
  private levels: Uint8Array;
  private sample = -1;

  constructor(bytes: Uint8Array, cells: number) {
    this.levels = new Uint8Array(cells);
    const numbers = new Numbers(bytes);
    while (!numbers.isAtEnd) {
      const runs = numbers.next();
      const change = new Uint32Array(3 * runs);
      for (let run = 0, place = 0; run < runs; run++) {
        place += numbers.next();
        change[3 * run] = place;
        change[3 * run + 1] = place += numbers.next();
        change[3 * run + 2] = numbers.next();
      }
      this.changes.push(change);
      this.apply(this.changes.length - 1);
      if ((this.changes.length - 1) % KEPT_EVERY === 0) this.kept.push(this.levels.slice());
    }
  }

  /** Returns the map as of a sample; valid until the next call. */
  at(sample: number): Uint8Array {
    const from = Math.floor(sample / KEPT_EVERY);
    if (sample < this.sample || from * KEPT_EVERY > this.sample) {
      this.levels.set(this.kept[from] ?? this.levels);
      this.sample = from * KEPT_EVERY;
    }
    while (this.sample < sample) this.apply(this.sample + 1);
    return this.levels;
  }

  private apply(sample: number): void {
    const change = this.changes[sample];
    if (change === undefined) return;
    for (let k = 0; k < change.length; k += 3) this.levels.fill(change[k + 2]!, change[k], change[k + 1]);
    this.sample = sample;
  }
}

export class Episode {
  private readonly layers = new Map<string, Layer>();
  readonly truth: Uint8Array | null;
  private readonly prediction: Layer | null;
  readonly agents: string[];

  private constructor(
    readonly header: Header,
    private readonly mapTimes: Float64Array,
    readonly poseTimes: Float64Array,
    private readonly poses: Float64Array,
    private readonly coverageTimes: Float64Array,
    private readonly shares: Float64Array,
    private readonly scanTimes: Float64Array,
    private readonly ranges: Float32Array,
    private readonly beliefs: Float64Array | null,
    private readonly crowdTimes: Float64Array,
    private readonly people: Float64Array,
    private readonly opened: Float64Array,
    streams: ReadonlyMap<string, Uint8Array>,
  ) {
    const cells = header.grid.rows * header.grid.columns;
    for (const name of header.layers) this.layers.set(name, new Layer(stream(streams, `map_${name}`), cells));
    this.truth = header.has_truth ? new Layer(stream(streams, "truth"), cells).at(0) : null;
    this.prediction = header.prediction === null ? null
      : new Layer(stream(streams, "prediction"), header.prediction.rows * header.prediction.columns);
    this.agents = header.colours.map((_, robot) => `robot_${robot}`);
  }

  /** Reads an episode from a packed text. */
  static async read(text: string): Promise<Episode> {
    const { header, streams } = await unpack<Header>(text);
    const of = (name: string, width: number, unit: number): Float64Array =>
      columns(streams.get(name) ?? new Uint8Array(), width, unit);
    return new Episode(
      header, of("map_times", 1, 1e-3), of("pose_times", 1, 1e-3), of("poses", 3 * header.robots, 1e-3),
      of("coverage_times", 1, 1e-3), of("coverage", 1, 1e-6), of("scan_times", 1, 1e-3),
      scanRanges(streams.get("scans") ?? new Uint8Array(), header.beam_angles.length, header.scan_unit_m),
      header.has_beliefs ? of("believed", 3 * header.robots, 1e-3) : null,
      of("crowd_times", 1, 1e-3), of("people", 2 * header.people_radius_m.length, 1e-3),
      of("opened", header.doors.length, 1e-2), streams,
    );
  }

  /** Returns which sample of the maps is shown at a time. */
  sampleAt(time: number): number {
    return before(this.mapTimes, time);
  }

  /** Returns a map as of a sample; valid until the next call. */
  map(name: string, sample: number): Uint8Array {
    const layer = this.layers.get(name) ?? this.layers.get("team");
    if (layer === undefined) throw new Error("a replay of the page has no map; make the page again");
    return layer.at(sample);
  }

  /** Returns the squares of the prediction as of a sample of the maps, null without any; valid until the next call. */
  predictionAt(sample: number): Uint8Array | null {
    return this.prediction === null ? null : this.prediction.at(sample);
  }

  get hasOwnMaps(): boolean {
    return this.layers.size > 1;
  }

  /** Returns where a robot is, between the recorded poses. */
  poseAt(robot: number, time: number): Pose {
    const at = between(this.poseTimes, this.poses, 3 * this.header.robots, time);
    return { x: at(3 * robot), y: at(3 * robot + 1), theta: at(3 * robot + 2) };
  }

  /** Returns where people are at a time. */
  peopleAt(time: number): { x: number; y: number; radius: number }[] {
    const { people_radius_m: radii } = this.header;
    const at = between(this.crowdTimes, this.people, 2 * radii.length, time);
    return radii.map((radius, person) => ({ x: at(2 * person), y: at(2 * person + 1), radius }));
  }

  /** Returns the ends of the leaves of doors that are not open at a time. */
  leavesAt(time: number): [number, number, number, number][] {
    const { doors } = this.header;
    const at = between(this.crowdTimes, this.opened, doors.length, time);
    return doors.flatMap(([x, y, toX, toY], door) => {
      const left = 1 - at(door);
      return left > 0 ? [[x, y, x + left * (toX - x), y + left * (toY - y)]] : [];
    });
  }

  /** Calls back with each recorded position of a robot from one time to another. */
  path(robot: number, from: number, to: number, visit: (x: number, y: number) => void): void {
    const last = before(this.poseTimes, to);
    for (let row = before(this.poseTimes, from); row <= last; row++) {
      const k = 3 * (row * this.header.robots + robot);
      visit(this.poses[k]!, this.poses[k + 1]!);
    }
  }

  /** Returns the last scan of a robot up to a time, with the pose at which it was taken. */
  scanAt(robot: number, time: number): Scan | null {
    const beams = this.header.beam_angles.length;
    if (beams === 0) return null;
    const sample = before(this.scanTimes, time);
    const place = (sample * this.header.robots + robot) * beams;
    return {
      pose: this.poseAt(robot, this.scanTimes[sample] ?? 0), ranges: this.ranges.subarray(place, place + beams),
    };
  }

  /** Returns where a robot believes to be, null where poses are true. */
  believedAt(robot: number, time: number): Pose | null {
    if (this.beliefs === null) return null;
    const k = 3 * (before(this.scanTimes, time) * this.header.robots + robot);
    return { x: this.beliefs[k]!, y: this.beliefs[k + 1]!, theta: this.beliefs[k + 2]! };
  }

  /** Returns the explored share at a time. */
  coverageAt(time: number): number {
    return this.coverageTimes.length === 0 || time < this.coverageTimes[0]! ? 0
      : this.shares[before(this.coverageTimes, time)] ?? 0;
  }

  /** Calls back with each change of the explored share. */
  coverage(visit: (time: number, share: number) => void): void {
    this.coverageTimes.forEach((time, k) => visit(time, this.shares[k]!));
  }

  /** Returns the last event of a robot up to a time that has a property. */
  lastOf(agent: string, time: number, isMeant: (event: Happening) => boolean): Happening | null {
    let found: Happening | null = null;
    for (const event of this.header.events) {
      if (event.time_s > time + 1e-9) break;
      if (event.agent === agent && isMeant(event)) found = event;
    }
    return found;
  }

  /** Returns where a robot is sent at a time, null where it rests. */
  targetAt(agent: string, time: number): { x: number; y: number } | null {
    const event = this.lastOf(agent, time, ({ kind }) => kind === "decision" || kind === "ended");
    return event?.kind === "decision" && typeof event.x === "number" && typeof event.y === "number"
      ? { x: event.x, y: event.y } : null;
  }

  /** Returns the robots in groups whose maps are joined by then: for each robot the first one of its group. */
  groupsAt(time: number): number[] {
    const groups = this.agents.map((_, robot) => robot);
    for (const event of this.header.events) {
      if (event.time_s > time + 1e-9) break;
      if (event.kind !== "merge") continue;
      const [a, b] = [groups[this.agents.indexOf(event.agent ?? "")], groups[this.agents.indexOf(event.other ?? "")]];
      if (a === undefined || b === undefined) continue;
      groups.forEach((group, robot) => { if (group === a || group === b) groups[robot] = Math.min(a, b); });
    }
    return groups;
  }
}

function stream(streams: ReadonlyMap<string, Uint8Array>, name: string): Uint8Array {
  const found = streams.get(name);
  if (found === undefined) throw new Error(`a replay of the page has no part ${name}; make the page again`);
  return found;
}

/** Returns the numbers of a row of values at a time, between the recorded rows. */
function between(times: Float64Array, values: Float64Array, width: number, time: number): (k: number) => number {
  const first = before(times, time);
  const next = Math.min(first + 1, times.length - 1);
  const [t0, t1] = [times[first]!, times[next]!];
  const share = t1 > t0 ? Math.min(Math.max((time - t0) / (t1 - t0), 0), 1) : 0;
  return (k) => values[first * width + k]! + share * (values[next * width + k]! - values[first * width + k]!);
}

/** Returns the place of the last of ascending times up to a time, at least 0. */
function before(times: Float64Array, time: number): number {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle]! <= time + 1e-9) low = middle + 1; else high = middle;
  }
  return Math.max(low - 1, 0);
}
