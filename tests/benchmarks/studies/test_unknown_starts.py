"""The study of explorers under a supervisor from unknown starts: its suite and tables."""

import json

from lidarium.benchmarks.studies import STUDIES, unknown_starts
from lidarium.benchmarks.studies.leaderboard import worlds
from lidarium.evaluation.suites.campaign import EPISODES_FILE


def episode(policy, floor, t99_s, accepted, wrong):
    merges = {"accepted": accepted, "wrong": wrong}
    key = f"default | {floor} | 3 | seed 0 | {policy}"
    return {"key": key, "policy": policy, "robots": 3, "t99_s": t99_s, "merges": merges}


def test_its_tasks_are_those_of_the_leaderboard():
    suite = unknown_starts.suites(None, 8)["unknown"]
    other = worlds.suites(None, 2)["test_unknown"]
    assert (suite.floors, suite.robots, suite.seeds) == (other.floors, other.robots, other.seeds)
    assert suite.variants == other.variants
    assert suite.policies == ("supervised", "supervised_tours", "supervised_predicted")


def test_its_page_has_ratios_of_pairs_and_wrong_joins(tmp_path):
    episodes = [episode("supervised", f"f{k}", 100.0, 2, 0) for k in range(6)]
    episodes += [episode("supervised_predicted", f"f{k}", 70.0 + k if k else None, 1, 2 * (k == 3)) for k in range(6)]
    (tmp_path / "unknown").mkdir()
    (tmp_path / "unknown" / EPISODES_FILE).write_text("".join(f"{json.dumps(each)}\n" for each in episodes))
    page = STUDIES["unknown_starts"].page(tmp_path)
    assert "| lab, unknown starts | `supervised_predicted` | `supervised` | 6 | - | - | 1.245 (" in page
    assert "| `supervised` | 6 | 6 | 12 | 0 | 0 |" in page
    assert "| `supervised_predicted` | 6 | 5 | 6 | 2 | 1 |" in page
