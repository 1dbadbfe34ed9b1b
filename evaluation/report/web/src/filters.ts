// What the reader wants to see: policies, floors, robots, realism. One state for all tables and charts.
import type { Group, Report } from "./data";
import { button, choice, element, tick } from "./dom";
import { onGround, onTheme } from "./theme";

const ALL = "";
const SET = "set ";
const FLOOR = "floor ";

export type Wanted = {
  policies: ReadonlySet<string>;
  robots: number | null;
  settings: string | null;
  floorSet: string | null;
  floor: string | null;
};

/** Whether a group has episodes that are wanted. */
export function shows(wanted: Wanted, group: Group): boolean {
  return (wanted.robots === null || group.robots === wanted.robots)
    && (wanted.settings === null || group.settings === wanted.settings)
    && (wanted.floorSet === null || group.floor_set === wanted.floorSet)
    && (wanted.floor === null || group.floors.includes(wanted.floor));
}

/** The bar of filters; `act` is called with what is wanted whenever that changes. */
export function filterBar(report: Report, act: (wanted: Wanted) => void): HTMLElement {
  const names = Object.keys(report.policies);
  const policies = new Set(names);
  const ticks = names.map((name) => {
    const swatch = element("span", { class: "swatch", "aria-hidden": "true" });
    const paint = (): void => { swatch.style.background = onGround(report.policies[name] ?? "#808080"); };
    paint();
    onTheme(paint);
    const label = element("span", { class: "named" }, swatch, element("code", {}, name));
    return tick(label, true, (isOn) => {
      if (isOn) policies.add(name); else policies.delete(name);
      changed();
    });
  });
  const robots = choice("Robots", listed("All", unique(report.groups.map((group) => String(group.robots)))), changed);
  const settings = choice("Realism", listed("All", unique(report.groups.map((group) => group.settings))), changed);
  const floors = choice("Floors", [{ value: ALL, label: "All" }], changed);
  fillFloors(floors.select, report.groups);
  const reset = button("Show all", () => {
    ticks.forEach(({ input }, k) => { input.checked = true; policies.add(names[k] ?? ""); });
    for (const { select } of [robots, settings, floors]) select.value = ALL;
    changed();
  }, { class: "quiet" });
  const status = element("p", { class: "status", role: "status" });

  function changed(): void {
    const [floor, many] = [floors.select.value, robots.select.value];
    const wanted: Wanted = {
      policies: new Set(policies),
      robots: many === ALL ? null : Number(many),
      settings: settings.select.value === ALL ? null : settings.select.value,
      floorSet: floor.startsWith(SET) ? floor.slice(SET.length) : null,
      floor: floor.startsWith(FLOOR) ? floor.slice(FLOOR.length) : null,
    };
    act(wanted);
    const groups = report.groups.filter((group) => shows(wanted, group)).length;
    status.textContent = `${wanted.policies.size} of ${names.length} policies, `
      + `${groups} of ${report.groups.length} groups of episodes`;
  }

  changed();
  return element("form", { class: "filters", "aria-label": "Filters" },
    element("fieldset", {}, element("legend", {}, "Policies"), ...ticks.map(({ field }) => field)),
    element("div", { class: "row" }, floors.field, robots.field, settings.field, reset), status);
}

function listed(all: string, names: string[]): { value: string; label: string }[] {
  return [{ value: ALL, label: all }, ...names.map((name) => ({ value: name, label: name }))];
}

/** Fills the list of floors: sets first, then each floor below its set. */
function fillFloors(select: HTMLSelectElement, groups: readonly Group[]): void {
  const sets = new Map<string, Set<string>>();
  for (const group of groups) {
    const floors = sets.get(group.floor_set) ?? new Set<string>();
    group.floors.forEach((floor) => floors.add(floor));
    sets.set(group.floor_set, floors);
  }
  for (const [name, floors] of sets) {
    const part = element("optgroup", { label: name });
    part.append(element("option", { value: SET + name }, `All of ${name}`));
    floors.forEach((floor) => part.append(element("option", { value: FLOOR + floor }, floor)));
    select.append(part);
  }
}

function unique(names: readonly string[]): string[] {
  return [...new Set(names)].sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
}
