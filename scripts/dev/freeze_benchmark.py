"""Freeze a benchmark before its release: hashes of its tasks, and the rows of the reference policies.

    python scripts/dev/freeze_benchmark.py lidarium-1 hashes
    lidarium benchmark lidarium-1 --reference --out runs/lidarium-1
    python scripts/dev/freeze_benchmark.py lidarium-1 rows runs/lidarium-1

If only some policies changed, ``lidarium benchmark lidarium-1 --policies NAME`` runs these; other rows stay as they
are. A benchmark that was released never changes; another one has another name.
"""

import json
import sys
from dataclasses import asdict
from pathlib import Path

from lidarium.evaluation.analysis.episodes import read_episodes
from lidarium.evaluation.benchmark.results import packed, reference_rows, rows_file
from lidarium.evaluation.benchmark.tasks import DATA, benchmark
from lidarium.evaluation.suites.episodes_file import KEY


def main(name: str, what: str, folder: Path | None = None) -> None:
    """Write the hashes of a benchmark's tasks, or the rows that a run of it left in a folder."""
    tasks = benchmark(name).tasks.values()
    if what == "hashes":
        frozen = {task.name: asdict(task.measured_on(task.floors)) for task in tasks}
        (DATA / f"{name}.json").write_text(json.dumps(frozen, indent=1) + "\n")
    elif what == "rows" and folder is not None:
        found = [folder / task.name for task in tasks if (folder / task.name / "episodes.jsonl").is_file()]
        rows = {row[KEY]: row for shipped in reference_rows(name).values() for row in shipped}
        rows |= {row[KEY]: row for path in found for row in read_episodes(path).rows}
        content = packed(rows.values())
        (DATA / rows_file(name)).write_bytes(content)
        print(f"{len(content):,} bytes of {len(found)} tasks")
    else:
        raise SystemExit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]) if len(sys.argv) > 3 else None)
