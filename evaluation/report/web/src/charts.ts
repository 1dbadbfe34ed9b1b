// Coverage over time and performance profiles, drawn by uPlot from figures that lidarium computed.
import uPlot from "uplot";
import type { Curve, Group, Report } from "./data";
import { choice, count, drawn, element, number, section, setOptions } from "./dom";
import { shows, type Wanted } from "./filters";
import { capital, type Shown } from "./tables";
import { colour, onGround, onTheme } from "./theme";

const DASHES: number[][] = [[], [8, 4], [8, 3, 2, 3], [2, 3], [8, 3, 2, 3, 2, 3], [12, 4], [5, 3, 2, 3, 2, 3]];
const MOST_BANDS = 5;
const HEIGHT = 300;

type Line = { policy: string; y: (number | null)[]; low?: (number | null)[]; high?: (number | null)[] };
type Plot = { title: string; x: number[]; lines: Line[]; xLabel: string; yLabel: string; xEnds: [number, number];
  factors?: boolean; step?: 1 | -1 };

/** Coverage over time and profiles of one group, which is chosen among those that the filters leave. */
export function charts(report: Report): Shown {
  const which = choice("Episodes", [], () => render());
  const place = element("div", { class: "charts" });
  const legend = element("ul", { class: "legend", "aria-label": "Lines of the charts" });
  let wanted: Wanted | null = null;
  let plots: uPlot[] = [];
  let [isNear, isDrawn] = [false, false];

  function render(): void {
    isDrawn = wanted !== null && isNear;
    if (!isDrawn) return;
    const group = report.groups[Number(which.select.value)];
    plots.forEach((plot) => plot.destroy());
    plots = [];
    place.replaceChildren();
    legend.replaceChildren();
    if (group === undefined || which.select.value === "") {
      place.append(element("p", {}, "Nothing is left by these filters."));
      return;
    }
    const order = Object.keys(report.policies);
    const policies = Object.keys(group.values).filter((policy) => wanted?.policies.has(policy) === true);
    legend.append(...policies.map((policy) => element("li", {}, sample(report, order, policy), element("code", {}, policy))));
    for (const shown of plotsOf(report, group, policies)) {
      const box = element("figure", {}, element("figcaption", {}, shown.title));
      const canvas = element("div", { class: "chart", role: "img", "aria-label": described(shown) });
      box.append(canvas, numbersOf(shown));
      place.append(box);
      plots.push(drawnPlot(report, order, shown, canvas));
    }
  }

  const root = section("charts", "Coverage over time, profiles", element("div", { class: "row" }, which.field), legend, place);
  // Charts that are far from what is seen wait until the reader comes near.
  new IntersectionObserver((entries) => {
    isNear = entries.at(-1)?.isIntersecting === true;
    if (isNear && !isDrawn) render();
  }, { rootMargin: "300px" }).observe(root);
  new ResizeObserver(() => plots.forEach((plot) => {
    const width = plot.root.parentElement?.clientWidth ?? 0;
    if (width > 0 && width !== plot.width) plot.setSize({ width, height: HEIGHT });
  })).observe(place);
  onTheme(render);
  return {
    root,
    update: (next) => {
      wanted = next;
      setOptions(which.select, report.groups.flatMap((group, k) =>
        (shows(next, group) ? [{ value: String(k), label: `${group.title}, ${group.settings}` }] : [])));
      render();
    },
  };
}

function plotsOf(report: Report, group: Group, policies: readonly string[]): Plot[] {
  const found: Plot[] = [];
  const curves = policies.flatMap((policy) => {
    const curve = group.coverage_over_time[policy];
    return curve === undefined ? [] : [{ policy, curve }];
  });
  const first = curves[0];
  if (first !== undefined) {
    found.push({
      title: "Coverage over time: median of the runs, 95 % interval shaded", x: first.curve.times_s,
      lines: curves.map(({ policy, curve }) => ({
        policy, y: curve.median_percent, low: curve.low_percent, high: curve.high_percent,
      })),
      xLabel: "simulated time [s]", yLabel: "coverage [%]",
      xEnds: [0, settled(curves.map(({ curve }) => curve), group.horizon_s)],
    });
  }
  for (const [key, profile] of Object.entries(group.profiles.within_factor)) {
    found.push({
      title: `${capital(report.times[key] ?? key)}: share of ${count(profile.runs, "paired run")} within a factor of the fastest`,
      x: profile.factors, xLabel: "factor of the fastest policy's time", yLabel: "share of runs [%]",
      lines: policies.map((policy) => ({ policy, y: (profile.shares[policy] ?? []).map((share) => 100 * share) })),
      xEnds: [1, profile.factors.at(-1) ?? 4], factors: true, step: 1,
    });
  }
  const { thresholds, share_low_high: shares } = group.profiles.coverage_at_least;
  const isBanded = policies.length <= MOST_BANDS;
  found.push({
    title: `Share of runs that end with at least so much coverage${isBanded ? ", 95 % interval shaded" : ""}`,
    x: thresholds.map((threshold) => 100 * threshold), xLabel: "coverage at the end [%]", yLabel: "share of runs [%]",
    lines: policies.map((policy) => {
      const [share, low, high] = (shares[policy] ?? [[], [], []]).map((line) => line.map((value) => 100 * value));
      return { policy, y: share ?? [], ...(isBanded ? { low: low ?? [], high: high ?? [] } : {}) };
    }),
    xEnds: [100 * (thresholds[0] ?? 0), 100], step: -1,
  });
  return found;
}

/** Returns a time after which no curve changes, so that no long part without change is shown. */
function settled(curves: readonly Curve[], horizon: number): number {
  const rests = curves.map(({ median_percent: median, times_s: times }) => {
    const last = median.at(-1) ?? 0;
    return times[median.findIndex((value) => (value ?? 0) >= last - 0.05)] ?? horizon;
  });
  const latest = Math.max(...rests);
  return latest > 0 ? Math.min(1.15 * latest, horizon) : horizon;
}

function drawnPlot(report: Report, order: readonly string[], plot: Plot, target: HTMLElement): uPlot {
  const series: uPlot.Series[] = [{}];
  const bands: uPlot.Band[] = [];
  const data: (number | null)[][] = [plot.x];
  for (const line of plot.lines) {
    const stroke = onGround(report.policies[line.policy] ?? "#808080");
    const paths = plot.step === undefined ? {} : { paths: uPlot.paths.stepped!({ align: plot.step }) };
    series.push({
      label: line.policy, stroke, width: 2, dash: DASHES[order.indexOf(line.policy) % DASHES.length] ?? [],
      points: { show: false }, ...paths,
    });
    data.push(line.y);
    if (line.low === undefined || line.high === undefined || line.low.includes(null) || line.high.includes(null)) continue;
    series.push({ stroke: `${stroke}80`, width: 0.7, points: { show: false }, ...paths },
      { stroke: `${stroke}80`, width: 0.7, points: { show: false }, ...paths });
    data.push(line.high, line.low);
    bands.push({ series: [data.length - 2, data.length - 1], fill: `${stroke}22` });
  }
  const axis = {
    stroke: colour("faint"), grid: { stroke: colour("line"), width: 1 }, ticks: { show: false },
    font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 20,
  };
  const factors: Partial<uPlot.Axis> = plot.factors === true ? {
    splits: () => [1, 1.25, 1.5, 2, 3, 4], values: (_, values) => values.map(String), filter: (_, values) => values,
  } : {};
  const options: uPlot.Options = {
    width: target.clientWidth || 320, height: HEIGHT, series, bands, legend: { show: false },
    scales: {
      x: { time: false, range: plot.xEnds, ...(plot.factors === true ? { distr: 3 } : {}) }, y: { range: [0, 102] },
    },
    axes: [{ ...axis, label: plot.xLabel, size: 30, ...factors }, { ...axis, label: plot.yLabel, size: 44 }],
    cursor: { show: false },
  };
  return new uPlot(options, data as uPlot.AlignedData, target);
}

/** Returns a short line as a chart draws a policy's. */
function sample(report: Report, order: readonly string[], policy: string): SVGSVGElement {
  return drawn("svg", { width: 34, height: 10, "aria-hidden": "true" }, drawn("line", {
    x1: 1, y1: 5, x2: 33, y2: 5, stroke: onGround(report.policies[policy] ?? "#808080"), "stroke-width": 2.5,
    "stroke-dasharray": (DASHES[order.indexOf(policy) % DASHES.length] ?? []).join(" "),
  }));
}

function described(plot: Plot): string {
  return `${plot.title}. Lines: ${plot.lines.map(({ policy }) => policy).join(", ")}. The numbers follow as a table.`;
}

/** Returns some of a chart's numbers as a table that opens below it. */
function numbersOf(plot: Plot): HTMLElement {
  const most = plot.x.findLastIndex((x) => x <= plot.xEnds[1] + 1e-9);
  const places = [...new Set(Array.from({ length: 9 }, (_, k) => Math.round((most * k) / 8)))];
  return element("details", {}, element("summary", {}, "Numbers"),
    element("div", { class: "scrolling", tabindex: 0, role: "region", "aria-label": `Numbers: ${plot.title}` },
      element("table", {},
        element("thead", {}, element("tr", {}, element("th", { scope: "col" }, plot.xLabel),
          ...plot.lines.map(({ policy }) => element("th", { scope: "col", class: "number" }, element("code", {}, policy))))),
        element("tbody", {}, ...places.map((k) => element("tr", {},
          element("th", { scope: "row" }, number(plot.x[k], plot.factors === true ? 2 : 0)),
          ...plot.lines.map(({ y }) => element("td", { class: "number" }, number(y[k])))))))));
}
