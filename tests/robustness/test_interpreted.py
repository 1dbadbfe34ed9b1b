"""Where numba compiles nothing, Python runs the kernels, and every number is the same to the bit.

``LIDARIUM_ROBUSTNESS=all`` tries all short episodes in place of some.
"""

import json
import os
import subprocess
import sys

from episode_ledger import Ledger
from robustness.fuzz import TESTS
from robustness.interpreted import CASES

SOME = ("velocity", "frontier", "slam", "run")


def test_python_runs_kernels_as_compiled_ones_do():
    names = list(CASES) if os.environ.get("LIDARIUM_ROBUSTNESS") == "all" else SOME
    result = subprocess.run(
        [sys.executable, "-m", "robustness.interpreted", *names],
        cwd=TESTS,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr[-2000:]
    told = {row["case"]: row["parts"] for row in map(json.loads, result.stdout.splitlines())}
    assert list(told) == list(names)
    for name in names:
        ledger = Ledger(1, None)
        CASES[name].run(ledger)
        assert told[name] == ledger.summary()["parts"], name


def test_a_division_by_zero_and_small_integers_are_as_in_compiled_kernels(tmp_path):
    script = tmp_path / "small_numbers.py"
    script.write_text(
        "import numpy as np\n"
        "from lidarium.mapping.kernels.compilation import kernel\n"
        "@kernel\n"
        "def numbers(cells, ratio):\n"
        "    return cells[0] + cells[1], 1.0 / ratio, ratio / ratio\n"
        "print(*numbers(np.array([127, 127], np.int8), 0.0))\n"
    )
    for disabled in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled, "NUMBA_CACHE_DIR": str(tmp_path)}
        result = subprocess.run(
            [sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True
        )
        assert result.stdout.split() == ["254", "inf", "nan"]
