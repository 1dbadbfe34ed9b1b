"""What a page says is text, whatever a floor is called."""

from dataclasses import replace

import lidarium
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.viewing.words import events_text, status_text

EVIL = "<img src=x onerror=alert(1)>"


def test_names_are_shown_as_text():
    floor = replace(load_floor("apartment"), name=EVIL)
    env = WatchedExploration(floor, make_settings(robots=1, horizon_s=2.0, resolution=0.05))
    policy = lidarium.policy("nearest_frontier")
    run_episode(policy, env, 0)
    text = status_text(env, EVIL, policy.report(), 7)
    assert "<img" not in text
    assert text.count("&lt;img") == 2
    assert "<td>Decisions</td>" in text
    assert ">7</td>" in text


def test_what_a_station_did_is_listed_last_things_first():
    settings = make_settings(
        robots=2, horizon_s=60.0, resolution=0.05, known_starts=False, localization="slam"
    )
    policy, env = lidarium.policy("supervised"), WatchedExploration("apartment", settings)
    run_episode(policy, env, 0)
    report = policy.report()
    used = [join for join in report.supervision.joins if join.is_used]
    assert used
    assert f">{len(used)}</td>" in status_text(env, "supervised", report, 30)
    text = events_text(env, report)
    times = [float(part.split(" s<")[0].rsplit(">", 1)[1]) for part in text.split("<tr>")[1:]]
    assert 1 <= len(times) <= 6
    assert times == sorted(times, reverse=True)
