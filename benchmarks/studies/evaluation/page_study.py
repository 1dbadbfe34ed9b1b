"""The page of a report in a browser: how large it is, and how soon it answers."""

import json
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lidarium
from lidarium.benchmarks.speed.harness.report import about, heading
from lidarium.benchmarks.studies.evaluation import page_folder
from lidarium.benchmarks.studies.evaluation.browser import HEIGHT, WIDTH, headless_chromium, show_on_screen
from lidarium.benchmarks.studies.shared.kept import Progress, do_missing, kept_lines
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.evaluation.report import write_report
from lidarium.evaluation.report.page import replay_of, write_replay_page

FILE, ROUNDS = "pages.jsonl", 5
_AXE = Path(lidarium.__file__).parents[2] / "evaluation/report/web/node_modules/axe-core/axe.min.js"

_SHOWN = "return document.querySelectorAll('#replay canvas').length > 0"

_PRESSED = """
const done = arguments[arguments.length - 1];
const pressed = [...document.querySelectorAll(arguments[0])];
const times = [];
const next = () => {
  const target = pressed.shift();
  if (target === undefined) { done(times); return; }
  const began = performance.now();
  target.click();
  requestAnimationFrame(() => setTimeout(() => { times.push(performance.now() - began); next(); }));
};
next();
"""
"""Presses all that a selector finds, and returns how long each took until what it changed was painted."""

_SCRUBBED = """
const done = arguments[arguments.length - 1];
const slider = document.querySelector('#replay input[type=range]');
document.querySelector('#replay .view').scrollIntoView();
const frames = 240, end = Number(slider.max), work = [];
let frame = 0;
const began = performance.now();
const next = () => {
  if (frame === frames) {
    done({frames_per_s: 1000 * frames / (performance.now() - began), work_ms: work});
    return;
  }
  const before = performance.now();
  // To and fro, with leaps: what a hand does that looks for something.
  slider.value = end * (0.5 + 0.5 * Math.sin(frame / 12) * Math.cos(frame / 31));
  slider.dispatchEvent(new Event('input'));
  work.push(performance.now() - before);
  frame += 1;
  requestAnimationFrame(next);
};
requestAnimationFrame(next);
"""

_CHECKED = "axe.run(document, {resultTypes: ['violations']}).then(arguments[arguments.length - 1])"


@dataclass(frozen=True, slots=True)
class Page:
    """A page that is measured."""

    kind: str
    episodes: int
    replays: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.kind} | {self.episodes} episodes | {self.replays} replays"


def work(folder: Path, _data: Path | None, every: int, _workers: int) -> Progress:
    """Measure the page of one replay, and that of one N-th of 10,000 episodes."""
    pages = [
        Page("replay", 1, 1),
        Page("report", page_folder.EPISODES // every, max(page_folder.REPLAYS // every, 1)),
    ]
    yield from do_missing(folder / FILE, "pages", pages, _measured, 1)


def _measured(page: Page) -> dict[str, Any]:
    driver = headless_chromium()
    try:
        with tempfile.TemporaryDirectory() as folder:
            return (_replay if page.kind == "replay" else _report)(Path(folder), page, driver)
    finally:
        driver.quit()


def _replay(folder: Path, _page: Page, driver: Any) -> dict[str, Any]:  # noqa: ANN401
    record, _ = page_folder.real_episode(page_folder.POLICIES[0])
    began = time.perf_counter()
    replay = replay_of(record)
    made_s = time.perf_counter() - began
    write_replay_page(folder / "episode.html", replay)
    found = {
        "made_s": round(made_s, 2),
        "replay_bytes": len(replay.text),
        "page_bytes": (folder / "episode.html").stat().st_size,
        "duration_s": float(record.display.times[-1]),
        "opens_s": _median(lambda: _opened(driver, folder / "episode.html")),
    }
    runs = [driver.execute_async_script(_SCRUBBED) for _ in range(ROUNDS)]
    return found | {
        "frames_per_s": round(statistics.median(run["frames_per_s"] for run in runs), 1),
        "frame_p95_ms": round(max(statistics.quantiles(run["work_ms"], n=20)[-1] for run in runs), 2),
        "findings": _findings(driver),
    }


def _report(folder: Path, page: Page, driver: Any) -> dict[str, Any]:  # noqa: ANN401
    page_folder.write_folder(folder, page.episodes, page.replays)
    began = time.perf_counter()
    write_report(folder, folder / "report", replays=page.replays)
    made_s = time.perf_counter() - began
    path = folder / "report" / "report.html"
    opens = _median(lambda: _opened(driver, path))
    sorts = [driver.execute_async_script(_PRESSED, "th .sort") for _ in range(ROUNDS)]
    filters = [driver.execute_async_script(_PRESSED, ".filters input") for _ in range(ROUNDS)]
    return {
        "made_s": round(made_s, 1),
        "page_bytes": path.stat().st_size,
        "opens_s": opens,
        "sort_ms": round(max(max(times) for times in sorts), 1),
        "sort_median_ms": round(statistics.median(time for times in sorts for time in times), 1),
        "filter_ms": round(max(max(times) for times in filters), 1),
        "filter_median_ms": round(statistics.median(time for times in filters for time in times), 1),
        "findings": _findings(driver),
    }


def _median(measure: Callable[[], float]) -> float:
    return round(statistics.median(measure() for _ in range(ROUNDS)), 3)


def _opened(driver: Any, path: Path) -> float:  # noqa: ANN401
    """Return how long a page takes until its tables and the first replay are there [s]."""
    show_on_screen(driver, "light")
    driver.get("about:blank")
    began = time.perf_counter()
    driver.get(path.as_uri())
    while not driver.execute_script(_SHOWN):
        time.sleep(0.005)
    return time.perf_counter() - began


def _findings(driver: Any) -> int | None:  # noqa: ANN401
    """Return the number of serious and critical findings of axe-core; None where it is not installed."""
    if not _AXE.is_file():
        return None
    driver.execute_script(_AXE.read_text(encoding="utf-8"))
    found = json.loads(json.dumps(driver.execute_async_script(_CHECKED)))
    return sum(
        len(each["nodes"]) for each in found["violations"] if each["impact"] in ("serious", "critical")
    )


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    replay, report = kept_lines(folder / FILE)
    megabyte = 1e6
    episodes, replays = (int(part.split()[0]) for part in report["key"].split(" | ")[1:])
    checks = [
        ("page, size [MB]", report["page_bytes"] / megabyte, "<=", 20.0),
        ("page opens in [s]", report["opens_s"], "<", 2.0),
        ("sorting by a column, slowest [ms]", report["sort_ms"], "<", 100.0),
        ("a filter, slowest [ms]", report["filter_ms"], "<", 100.0),
        ("replay, size [MB]", replay["replay_bytes"] / megabyte, "<=", 1.0),
        ("replay, frames per second while scrubbing", replay["frames_per_s"], ">=", 30.0),
    ]
    for name, line in (("page", report), ("replay", replay)):
        if line["findings"] is not None:
            checks.append((f"{name}, serious findings of axe-core", float(line["findings"]), "<=", 0.0))
    seconds, team = f"{replay['duration_s']:.0f}", page_folder.TEAM
    sort, sieve = (f"{report[f'{name}_median_ms']:.0f} ms" for name in ("sort", "filter"))
    lines = [
        *heading("Page", about(command)),
        "",
        f"The page of {episodes:,} episodes with {replays} replays, and a replay of {seconds} s with {team} "
        f"robots and noise on `{page_folder.FLOOR}`.",
        f"Headless Chromium at {WIDTH} x {HEIGHT} without a GPU.",
        "",
        "| what | measured | to reach | |",
        "|---|---:|---:|---|",
        *(_line(*check) for check in checks),
        "",
        f"Medians of {ROUNDS} rounds where nothing else is said.",
        "*Opens*: from the call to all tables and the first replay, drawn.",
        f"*Sorting* (median {sort}) and *filters* (median {sieve}): from the press to the next painted",
        "frame, each column of each table, each policy.",
        "*Scrubbing*: 240 frames to and fro, with leaps, at the screen's 60 frames per second at most.",
        f"The work for 95 % of the frames takes up to {replay['frame_p95_ms']:.1f} ms.",
        "",
        f"The page is made in {report['made_s']:.0f} s, statistics, pictures and replays included.",
        f"The one replay is made in {replay['made_s']:.1f} s.",
        "Lines of episodes without a replay are draws around real ones: it is the page that is measured.",
        "",
    ]
    return "\n".join(lines)


def _line(what: str, measured: float, relation: str, wanted: float) -> str:
    is_reached = {"<": measured < wanted, "<=": measured <= wanted, ">=": measured >= wanted}[relation]
    shown = f"{measured:.2f}" if measured < 10.0 else f"{measured:.1f}"
    return f"| {what} | {shown} | {relation} {wanted:g} | {'reached' if is_reached else '**not reached**'} |"


STUDY = Study(page, work=work)
