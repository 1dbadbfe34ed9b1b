// Plays one episode, or two side by side in step.
import { type Listed, replayText } from "../data";
import { button, choice, clock, element, section, setOptions, tick } from "../dom";
import { JOINED, type Layers, type Look } from "./drawing";
import { Episode } from "./episode";
import { onTheme } from "../theme";
import { type View, viewOf } from "./view";

const SPEEDS = [1, 2, 5, 10, 20, 50];
const STEP_S = 1;
const LAYERS: readonly [keyof Layers, string][] = [
  ["truth", "True walls"], ["frontiers", "Frontiers"], ["scans", "Scans"], ["paths", "Paths"],
  ["targets", "Targets"], ["events", "Merges, orders"], ["believed", "Believed poses"],
  ["crowd", "People, doors"], ["prediction", "Prediction"],
];

export class Player {
  readonly root: HTMLElement;
  private views: View[] = [];
  private readonly look: Look;
  private speed = 10;
  private isPlaying = false;
  private frame = 0;
  private last = 0;
  private asked = 0;
  private readonly loaded = new Map<number, Promise<Episode>>();
  private readonly stage = element("div", { class: "stage" });
  private readonly status = element("p", { class: "hidden", role: "status" });
  private readonly problem = element("p", { class: "problem", role: "alert", hidden: true });
  private readonly slider = element("input", { type: "range", min: 0, max: 1, step: 0.1, value: 0, "aria-label": "Time" });
  private readonly time = element("output", { class: "time" });
  private readonly play = button("Play", () => this.toggle(), { class: "primary" });
  private readonly ticks: HTMLElement[];
  private readonly first: ReturnType<typeof choice>;
  private readonly second: ReturnType<typeof choice>;
  private readonly map = choice("Map", [], (value) => { this.look.map = value; this.rest(); });
  private readonly follow = choice("Follow", [], (value) => {
    this.look.follow = value === "" ? null : Number(value);
    this.rest();
  });

  constructor(replays: readonly Listed[], title: string) {
    const layers = Object.fromEntries(LAYERS.map(([name]) => [name, true])) as Layers;
    this.look = { time: 0, map: "team", layers, follow: null };
    const listed = replays.map((replay, k) => ({ value: String(k), label: replay.title }));
    this.first = choice("Episode", listed, () => void this.open());
    this.second = choice("Beside it", [{ value: "", label: "None" }, ...listed], () => void this.open());
    const speed = choice("Speed", SPEEDS.map((value) => ({ value: String(value), label: `${value} x` })),
      (value) => { this.speed = Number(value); });
    speed.select.value = String(this.speed);
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    this.ticks = LAYERS.map(([name, label]) => tick(label, true, (isOn) => {
      layers[name] = isOn;
      this.rest();
    }).field);
    const controls = element("div", { class: "controls" },
      this.play, element("div", { class: "scrub" }, this.slider, this.time), speed.field);
    this.root = section("replay", title,
      element("div", { class: "row" }, ...(replays.length > 1 ? [this.first.field, this.second.field] : []),
        this.map.field, this.follow.field),
      element("fieldset", { class: "layers" }, element("legend", {}, "Layers"), ...this.ticks),
      this.problem, this.stage, controls, element("p", { class: "note keys" },
        "Keys: space plays and pauses, left and right arrow go a second back and on, Home and End to the ends."),
      this.status);
    this.root.addEventListener("keydown", (press) => this.onKey(press));
    new ResizeObserver(() => this.draw()).observe(this.stage);
    onTheme(() => this.draw());
    if (replays.length > 0) void this.open();
  }

  /** Shows a replay and leads to it. */
  show(place: number): void {
    this.first.select.value = String(place);
    void this.open();
    this.root.scrollIntoView();
    this.play.focus({ preventScroll: true });
  }

  private get duration(): number {
    return Math.max(...this.views.map(({ episode }) => episode.header.duration_s), 0.1);
  }

  /** Reads the chosen episodes and shows them from their beginning. */
  private async open(): Promise<void> {
    const asked = ++this.asked;
    const places = [this.first.select.value, this.second.select.value].filter((value) => value !== "").map(Number);
    this.pause();
    this.stage.setAttribute("aria-busy", "true");
    try {
      const episodes = await Promise.all(places.map((place) => this.read(place)));
      if (asked !== this.asked) return;
      this.problem.hidden = true;
      this.views = [];
      this.look.time = 0;
      const longest = Math.max(...episodes.map(({ header }) => header.duration_s));
      this.views = episodes.map((episode) => viewOf(episode, () => longest, (time) => this.seek(time)));
      this.stage.replaceChildren(...this.views.map(({ root }) => root));
      this.stage.classList.toggle("two", this.views.length > 1);
      this.slider.max = String(longest);
      this.listMaps(episodes);
      this.listLayers(episodes);
      this.rest();
    } catch (error) {
      if (asked !== this.asked) return;
      this.problem.textContent = `This replay cannot be shown: ${error instanceof Error ? error.message : String(error)}`;
      this.problem.hidden = false;
    }
    this.stage.setAttribute("aria-busy", "false");
  }

  private read(place: number): Promise<Episode> {
    const found = this.loaded.get(place) ?? Episode.read(replayText(place));
    this.loaded.delete(place);
    this.loaded.set(place, found);
    // Maps of an episode take some megabytes: the last ones are kept.
    for (const old of [...this.loaded.keys()].slice(0, -4)) this.loaded.delete(old);
    return found;
  }

  private listMaps(episodes: readonly Episode[]): void {
    const robots = Math.max(...episodes.map(({ header }) => header.robots));
    const names = Array.from({ length: robots }, (_, robot) => `robot_${robot}`);
    const hasOwn = episodes.some((episode) => episode.hasOwnMaps);
    const isJoined = hasOwn && episodes.some(({ header }) => !header.known_starts);
    setOptions(this.map.select, [
      { value: "team", label: "All maps, summed" },
      ...(hasOwn ? [{ value: JOINED, label: isJoined ? "Joined maps" : "Who mapped what" },
        ...names.map((name) => ({ value: name, label: `Own map of ${name}` }))] : []),
    ]);
    if (isJoined && this.look.map === "team") this.map.select.value = JOINED;
    this.look.map = this.map.select.value;
    setOptions(this.follow.select, [{ value: "", label: "The whole floor" },
      ...names.map((name, robot) => ({ value: String(robot), label: name }))]);
    this.look.follow = this.follow.select.value === "" ? null : Number(this.follow.select.value);
  }

  /** Offers the layers that one of the episodes has. */
  private listLayers(episodes: readonly Episode[]): void {
    const has: Partial<Record<keyof Layers, boolean>> = {
      truth: episodes.some(({ header }) => header.has_truth),
      scans: episodes.some(({ header }) => header.beam_angles.length > 0),
      believed: episodes.some(({ header }) => header.has_beliefs),
      prediction: episodes.some(({ header }) => header.prediction !== null),
      crowd: episodes.some(({ header }) => header.people_radius_m.length + header.doors.length > 0),
    };
    LAYERS.forEach(([name], k) => { this.ticks[k]!.hidden = has[name] === false; });
  }

  private toggle(): void {
    if (this.isPlaying) {
      this.pause();
      return;
    }
    if (this.look.time >= this.duration - 1e-6) this.look.time = 0;
    this.isPlaying = true;
    this.play.textContent = "Pause";
    this.last = performance.now();
    const next = (now: number): void => {
      if (!this.isPlaying) return;
      this.look.time = Math.min(this.look.time + (this.speed * Math.max(now - this.last, 0)) / 1000, this.duration);
      this.last = now;
      this.draw();
      if (this.look.time >= this.duration) this.pause(); else this.frame = requestAnimationFrame(next);
    };
    this.frame = requestAnimationFrame(next);
  }

  private pause(): void {
    cancelAnimationFrame(this.frame);
    this.isPlaying = false;
    this.play.textContent = "Play";
    this.rest();
  }

  private seek(time: number): void {
    this.look.time = Math.min(Math.max(time, 0), this.duration);
    this.rest();
  }

  /** Draws, and where nothing plays says what is to be seen. */
  private rest(): void {
    this.draw();
    if (!this.isPlaying) this.status.textContent = this.views.map((view) => view.describe(this.look)).join(" ");
  }

  private draw(): void {
    if (this.views.length === 0) return;
    this.views.forEach((view) => view.draw({
      ...this.look,
      follow: this.look.follow !== null && this.look.follow < view.episode.header.robots ? this.look.follow : null,
    }));
    const [now, end] = [clock(this.look.time), clock(this.duration)];
    this.slider.value = String(this.look.time);
    this.slider.setAttribute("aria-valuetext", `${now} of ${end}`);
    this.time.textContent = `${now} / ${end}`;
  }

  private onKey(press: KeyboardEvent): void {
    const target = press.target;
    if (press.altKey || press.ctrlKey || press.metaKey) return;
    // Lists, boxes and buttons have these keys for themselves.
    const isOwn = target instanceof HTMLSelectElement || target instanceof HTMLButtonElement
      || (target instanceof HTMLElement && target.tagName === "SUMMARY")
      || (target instanceof HTMLInputElement && target.type === "checkbox");
    if (press.key === " " && !isOwn) this.toggle();
    else if (press.key === "ArrowLeft" && !isOwn) this.seek(this.look.time - STEP_S);
    else if (press.key === "ArrowRight" && !isOwn) this.seek(this.look.time + STEP_S);
    else if (press.key === "Home" && !isOwn) this.seek(0);
    else if (press.key === "End" && !isOwn) this.seek(this.duration);
    else return;
    press.preventDefault();
  }
}
