// Draws an episode at a time: map, robots, paths, scans, targets.
import { type Episode, FREE, OCCUPIED, UNKNOWN } from "./episode";
import { colour, isDark, mixed, onGround, rgb } from "../theme";

export type Layers = Record<
  "truth" | "frontiers" | "scans" | "paths" | "targets" | "events" | "believed" | "crowd" | "prediction", boolean>;
export type Look = { time: number; map: string; layers: Layers; follow: number | null };

/** Map of the page that shows who is joined with whom. */
export const JOINED = "joined";

const RECENT_S = 60;
const EVENT_S = 4;
/** Part of the floor around a robot that is followed [m]. */
const FOLLOWED_M = 9;

/** Share of the colour of the prediction where unknown space is surely free. */
const STRENGTH = 0.6;

type Palette = { unknown: string; free: string; wall: string; truth: string; frontier: string; predicted: string };

/** Draws one episode on a canvas. */
export class Picture {
  private readonly image: ImageData;
  private readonly cells = document.createElement("canvas");
  private drawnAs = "";

  constructor(private readonly episode: Episode, readonly canvas: HTMLCanvasElement) {
    const { rows, columns } = episode.header.grid;
    this.cells.width = columns;
    this.cells.height = rows;
    this.image = new ImageData(columns, rows);
  }

  draw(look: Look): void {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (width === 0 || height === 0) return;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const context = this.canvas.getContext("2d");
    if (context === null) return;
    const palette = paletteNow();
    this.paintCells(look, palette);
    const { grid } = this.episode.header;
    const whole = { x: grid.x, y: grid.y, width: grid.columns * grid.cell, height: grid.rows * grid.cell };
    const scale = look.follow === null
      ? Math.min(width / whole.width, height / whole.height) : Math.min(width, height) / FOLLOWED_M;
    const centre = look.follow === null
      ? { x: whole.x + whole.width / 2, y: whole.y + whole.height / 2 } : this.episode.poseAt(look.follow, look.time);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = palette.unknown;
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    context.imageSmoothingEnabled = scale * grid.cell * ratio < 1;
    // From here on in metres of the floor, y up.
    context.setTransform(ratio * scale, 0, 0, -ratio * scale,
      ratio * (width / 2 - scale * centre.x), ratio * (height / 2 + scale * centre.y));
    context.save();
    context.translate(whole.x, whole.y);
    context.drawImage(this.cells, 0, 0, whole.width, whole.height);
    context.restore();
    this.drawTeam(context, look, 1 / scale);
  }

  /** Paints the map, frontiers and what is true of the floor; only where something has changed. */
  private paintCells(look: Look, palette: Palette): void {
    const { episode } = this;
    const sample = episode.sampleAt(look.time);
    const groups = look.map === JOINED ? episode.groupsAt(look.time) : [];
    const { truth, frontiers, prediction } = look.layers;
    const as = [sample, look.map, groups.join(), truth, frontiers, prediction, isDark()].join("|");
    if (as === this.drawnAs) return;
    this.drawnAs = as;
    const pixels = new Uint32Array(this.image.data.buffer);
    const levels = look.map === JOINED
      ? this.paintJoined(pixels, sample, groups, palette) : this.paintLevels(pixels, episode.map(look.map, sample), palette);
    const { columns } = episode.header.grid;
    // The prediction is that of the map of all robots.
    if (prediction && (look.map === JOINED || look.map === "team")) this.paintPrediction(pixels, levels, sample, palette);
    if (truth && episode.truth !== null) {
      const wall = packedColour(palette.truth);
      for (let k = 0; k < pixels.length; k++) {
        if (episode.truth[k] === OCCUPIED && levels[k] === UNKNOWN) pixels[k] = wall;
      }
    }
    if (frontiers) {
      const mark = packedColour(palette.frontier);
      for (let k = columns; k < pixels.length - columns; k++) {
        if (levels[k] === FREE && (levels[k - 1] === UNKNOWN || levels[k + 1] === UNKNOWN
          || levels[k - columns] === UNKNOWN || levels[k + columns] === UNKNOWN)) pixels[k] = mark;
      }
    }
    this.cells.getContext("2d")?.putImageData(this.image, 0, 0);
  }

  /** Tints what is unknown: the more probably it is free, the more. */
  private paintPrediction(pixels: Uint32Array, levels: Uint8Array, sample: number, palette: Palette): void {
    const { grid, prediction } = this.episode.header;
    const squares = this.episode.predictionAt(sample);
    if (prediction === null || squares === null) return;
    const tints = Uint32Array.from({ length: prediction.steps + 1 },
      (_, step) => packedColour(mixed(palette.unknown, palette.predicted, (STRENGTH * step) / prediction.steps)));
    for (let row = 0, k = 0; row < grid.rows; row++) {
      const first = Math.floor(row / prediction.cells) * prediction.columns;
      for (let column = 0; column < grid.columns; column++, k++) {
        if (levels[k] === UNKNOWN) pixels[k] = tints[squares[first + Math.floor(column / prediction.cells)]!]!;
      }
    }
  }

  private paintLevels(pixels: Uint32Array, levels: Uint8Array, palette: Palette): Uint8Array {
    const colours = Uint32Array.of(...[palette.unknown, palette.free, palette.wall].map(packedColour));
    for (let k = 0; k < pixels.length; k++) pixels[k] = colours[levels[k]!]!;
    return levels;
  }

  /** Paints what a single group knows in its colour, what several know as free. */
  private paintJoined(pixels: Uint32Array, sample: number, groups: readonly number[], palette: Palette): Uint8Array {
    const { header, agents } = this.episode;
    const together = new Uint8Array(pixels.length);
    const owner = new Int8Array(pixels.length).fill(-1);
    const isOne = new Set(groups).size === 1;
    agents.forEach((agent, robot) => {
      const [levels, group] = [this.episode.map(agent, sample), groups[robot] ?? robot];
      for (let k = 0; k < levels.length; k++) {
        const level = levels[k]!;
        if (level === UNKNOWN) continue;
        if (level > together[k]!) together[k] = level;
        owner[k] = owner[k] === -1 || owner[k] === group ? group : -2;
      }
    });
    const tints = header.colours.map((own) => packedColour(isOne ? palette.free : mixed(palette.free, onGround(own), 0.35)));
    const [unknown, free, wall] = [palette.unknown, palette.free, palette.wall].map(packedColour) as [number, number, number];
    for (let k = 0; k < pixels.length; k++) {
      const level = together[k];
      pixels[k] = level === OCCUPIED ? wall : level === UNKNOWN ? unknown : owner[k]! < 0 ? free : tints[owner[k]!] ?? free;
    }
    return together;
  }

  /** Draws what moves; `pixel` is the side of a pixel of the page [m]. */
  private drawTeam(context: CanvasRenderingContext2D, look: Look, pixel: number): void {
    const { episode } = this;
    const colours = episode.header.colours.map(onGround);
    episode.agents.forEach((agent, robot) => {
      const own = colours[robot] ?? "#808080";
      if (look.layers.scans) this.drawScan(context, robot, look.time, own, pixel);
      if (look.layers.paths) this.drawPath(context, robot, look.time, own, pixel);
      const target = look.layers.targets ? episode.targetAt(agent, look.time) : null;
      if (target !== null) drawTarget(context, episode.poseAt(robot, look.time), target, own, pixel);
    });
    if (look.layers.events) this.drawEvents(context, look.time, colours, pixel);
    if (look.layers.crowd) this.drawCrowd(context, look.time, pixel);
    episode.agents.forEach((_, robot) => this.drawRobot(context, robot, look, colours[robot] ?? "#808080", pixel));
  }

  private drawScan(context: CanvasRenderingContext2D, robot: number, time: number, own: string, pixel: number): void {
    const scan = this.episode.scanAt(robot, time);
    if (scan === null) return;
    const { beam_angles: angles } = this.episode.header;
    const { pose, ranges } = scan;
    context.beginPath();
    context.moveTo(pose.x, pose.y);
    angles.forEach((angle, beam) => {
      const range = ranges[beam]!;
      if (range === 0) context.lineTo(pose.x, pose.y);
      else context.lineTo(pose.x + range * Math.cos(pose.theta + angle), pose.y + range * Math.sin(pose.theta + angle));
    });
    context.closePath();
    context.fillStyle = `${own}26`;
    context.fill();
    context.strokeStyle = `${own}66`;
    context.lineWidth = pixel;
    context.stroke();
  }

  private drawPath(context: CanvasRenderingContext2D, robot: number, time: number, own: string, pixel: number): void {
    const here = this.episode.poseAt(robot, time);
    for (const [from, shade, wide] of [[0, "59", 1.5], [Math.max(time - RECENT_S, 0), "e6", 2.5]] as const) {
      context.beginPath();
      let isFirst = true;
      this.episode.path(robot, from, time, (x, y) => {
        if (isFirst) context.moveTo(x, y); else context.lineTo(x, y);
        isFirst = false;
      });
      context.lineTo(here.x, here.y);
      context.strokeStyle = own + shade;
      context.lineWidth = wide * pixel;
      context.lineJoin = "round";
      context.stroke();
    }
  }

  private drawRobot(context: CanvasRenderingContext2D, robot: number, look: Look, own: string, pixel: number): void {
    const { episode } = this;
    const radius = Math.max(episode.header.radius_m, 5 * pixel);
    const pose = episode.poseAt(robot, look.time);
    const hasEnded = episode.lastOf(episode.agents[robot] ?? "", look.time, ({ kind }) => kind === "ended") !== null;
    disc(context, pose.x, pose.y, radius);
    context.fillStyle = hasEnded ? mixed(own, colour("ground"), 0.55) : own;
    context.fill();
    context.strokeStyle = colour("ground");
    context.lineWidth = 1.5 * pixel;
    context.stroke();
    context.beginPath();
    context.moveTo(pose.x, pose.y);
    context.lineTo(pose.x + radius * Math.cos(pose.theta), pose.y + radius * Math.sin(pose.theta));
    context.lineWidth = 2 * pixel;
    context.stroke();
    const believed = look.layers.believed ? episode.believedAt(robot, look.time) : null;
    if (believed === null) return;
    disc(context, believed.x, believed.y, radius * 1.25);
    context.strokeStyle = own;
    context.setLineDash([3 * pixel, 3 * pixel]);
    context.stroke();
    context.setLineDash([]);
  }

  /** Draws people, and the leaves of doors that are not open. */
  private drawCrowd(context: CanvasRenderingContext2D, time: number, pixel: number): void {
    context.strokeStyle = colour("map-door");
    context.lineWidth = Math.max(0.07, 2 * pixel);
    for (const [x, y, toX, toY] of this.episode.leavesAt(time)) {
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(toX, toY);
      context.stroke();
    }
    context.fillStyle = colour("map-person");
    context.strokeStyle = colour("ground");
    context.lineWidth = 1.5 * pixel;
    for (const { x, y, radius } of this.episode.peopleAt(time)) {
      disc(context, x, y, radius);
      context.fill();
      context.stroke();
    }
  }

  /** Draws merges and orders of the last seconds where they happened. */
  private drawEvents(context: CanvasRenderingContext2D, time: number, colours: readonly string[], pixel: number): void {
    for (const event of this.episode.header.events) {
      if (event.time_s > time + 1e-9) break;
      const isShown = event.kind === "merge" || event.kind === "order" || event.kind === "contact";
      if (!isShown || event.time_s < time - EVENT_S) continue;
      const robot = this.episode.agents.indexOf(event.agent ?? "");
      const here = robot < 0 ? null : this.episode.poseAt(robot, event.time_s);
      const place = typeof event.x === "number" && typeof event.y === "number" ? { x: event.x, y: event.y } : here;
      if (place === null) continue;
      disc(context, place.x, place.y, 9 * pixel);
      context.lineWidth = 3 * pixel;
      context.strokeStyle = event.kind === "merge" ? colour("good") : colours[robot] ?? colour("ink");
      context.stroke();
      if (event.kind !== "order" || here === null) continue;
      context.beginPath();
      context.moveTo(here.x, here.y);
      context.lineTo(place.x, place.y);
      context.setLineDash([6 * pixel, 4 * pixel]);
      context.stroke();
      context.setLineDash([]);
    }
  }
}

function drawTarget(
  context: CanvasRenderingContext2D, from: { x: number; y: number }, to: { x: number; y: number }, own: string, pixel: number,
): void {
  context.beginPath();
  context.moveTo(from.x, from.y);
  context.lineTo(to.x, to.y);
  context.strokeStyle = own;
  context.lineWidth = pixel;
  context.stroke();
  disc(context, to.x, to.y, 5 * pixel);
  context.fillStyle = colour("ground");
  context.fill();
  context.lineWidth = 2 * pixel;
  context.stroke();
}

function disc(context: CanvasRenderingContext2D, x: number, y: number, radius: number): void {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
}

function paletteNow(): Palette {
  return {
    unknown: colour("map-unknown"), free: colour("map-free"), wall: colour("map-wall"),
    truth: colour("map-truth"), frontier: colour("map-frontier"), predicted: colour("map-predicted"),
  };
}

function packedColour(hex: string): number {
  const [red, green, blue] = rgb(hex);
  return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}
