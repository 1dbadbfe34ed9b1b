"""Results pages: conclusion and notes that a rerun keeps, how the page was made, and long tables as CSV files.

A page is its title, a conclusion in words, a line that begins with "Made by", and sections; the last one may be
"Notes". Programs write the sections; people write the conclusion and the notes.
"""

import csv
import io
import os
import platform
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import lidarium
from lidarium.mapping.files.output import write_text

_PACKAGES = ("numpy", "numba", "scipy", "opencv-python-headless", "ir-sim", "pybullet")
_MADE, _NOTES = "\nMade by `", "\n## Notes\n"
_IN_FILE = "<!-- in a file -->\n"
_TABLE = re.compile(re.escape(_IN_FILE) + r"((?:\|[^\n]*\n?)+)")
_LINK = re.compile(r"\[([^\]]+\.csv)\]\(\1\)")
_OLD = "*Conclusion and notes were written for the figures of {}.*"


def in_file(table: str) -> str:
    """Mark a markdown table that is published as a CSV file beside its page."""
    return _IN_FILE + table


def machine() -> str:
    """Return the processor, its cores, and the number of processes that have wanted one lately."""
    model = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        names = re.findall(r"^model name\s*: (.*)$", information.read_text(), re.MULTILINE)
        model = names[0] if names else model
    load = f", load {os.getloadavg()[2]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} cores, {platform.system()}{load}"


def about(command: str, more_versions: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return how, when, where and with what something is made."""
    found = {"Python": platform.python_version(), "lidarium": lidarium.__version__}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    date = datetime.now(UTC).date().isoformat()
    return {"command": command, "date": date, "machine": machine(), "versions": found | dict(more_versions or {})}


def publish(path: Path, text: str, told: Mapping[str, Any], part: str = "") -> str:
    """Write a page and the CSV files of its long tables, and return remarks for its author.

    Parameters
    ----------
    path : Path
        The page. Its conclusion and notes stay as they are; if figures have changed, it says for which they
        were written.
    text : str
        Title and sections.
    told : mapping
        Result of `about`.
    part : str, optional
        Sentence on the part of the study that was run.
    """
    old = path.read_text(encoding="utf-8") if path.is_file() else ""
    conclusion, made, old_body, notes = _parts(old)
    title, _, body = text.strip().partition("\n")
    body, files = _with_files(path.stem, title, body.strip())
    linked = {name: path.parent / name for name in _LINK.findall(old_body) if name.startswith(f"{path.stem}_")}
    before = {name: file.read_text(encoding="utf-8") for name, file in linked.items() if file.is_file()}
    remark = "" if conclusion else "; its conclusion has to be written, above the line that begins with 'Made by'"
    if conclusion and (body, files) != (old_body, before):
        day = re.search(r"\d{4}-\d\d-\d\d", made)
        if _OLD.partition("{")[0] not in conclusion:
            conclusion += "\n\n" + _OLD.format(day[0] if day else "an earlier run")
        remark = "; figures have changed: read its conclusion and notes again, then delete the line that says so"
    listed = ", ".join(f"{name} {number}" for name, number in told["versions"].items())
    made = f"Made by `{told['command']}` on {told['date']}: {told['machine']}; {listed}." + (f" {part}" if part else "")
    for name, content in files.items():
        write_text(path.parent / name, content)
    parts = [title, conclusion, made, body, *([_NOTES.strip(), notes] if notes else [])]
    write_text(path, "\n\n".join(each for each in parts if each) + "\n")
    for name in set(linked) - set(files):
        linked[name].unlink(missing_ok=True)
    return f"{path} is written{remark}"


def _parts(page: str) -> tuple[str, str, str, str]:
    """Return conclusion, line on the making, sections and notes of a page."""
    head, _, rest = page.partition(_MADE)
    made, _, body = rest.partition("\n\n")
    body, _, notes = body.partition(_NOTES)
    return head.partition("\n")[2].strip(), made, body.strip(), notes.strip()


def _with_files(page: str, title: str, body: str) -> tuple[str, dict[str, str]]:
    """Replace marked tables by links to files; return the files by name."""
    files: dict[str, str] = {}

    def link(found: re.Match[str]) -> str:
        heading = re.findall(r"^#+ (.*?)(?: \(\d+\))?$", f"{title}\n{body[: found.start()]}", re.MULTILINE)[-1]
        slug = re.sub(r"[^a-z0-9]+", "_", heading.lower()).strip("_")[:40].strip("_")
        alike = sum(re.fullmatch(rf"{page}_{slug}(_\d+)?\.csv", name) is not None for name in files)
        name = f"{page}_{slug}_{alike + 1}.csv" if alike else f"{page}_{slug}.csv"
        rows = list(_cells(found[1]))
        file = io.StringIO()
        csv.writer(file, lineterminator="\n").writerows(rows)
        files[name] = file.getvalue()
        return f"Table ({len(rows) - 1} rows): [{name}]({name}).\n"

    return _TABLE.sub(link, body).strip(), files


def _cells(table: str) -> Iterator[list[str]]:
    """Yield the cells of a markdown table's rows without their marks."""
    header, _, *rows = table.strip().splitlines()
    for line in (header, *rows):
        cells = re.split(r"(?<!\\)\|", line.strip()[1:-1])
        yield [cell.strip().replace("`", "").replace("**", "").replace("\\|", "|") for cell in cells]
