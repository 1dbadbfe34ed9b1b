"""ROS 2 over loopback: what serving costs and loses, and a policy driven through it beside the direct run.

Prints JSON. The served team is a process of its own on one core.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lidarium.envs.ros.graph import Graph
from lidarium.mapping.files.bags.messages import LASER_SCAN
from lidarium.mapping.files.bags.reading import seconds_of

PROGRAM = (sys.executable, "-m", "lidarium")
DOMAIN = 87
ON_LOOPBACK = ("--domain", str(DOMAIN), "--localhost")
FLOOR = "apartment"
POLICY = "nearest_frontier"


def _served(*options: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [*PROGRAM, "ros", "serve", "--floor", FLOOR, *ON_LOOPBACK, "--json", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        preexec_fn=lambda: os.sched_setaffinity(0, {0}),
    )


def _ended(server: "subprocess.Popen[str]") -> dict[str, Any]:
    """End a server and return its counts."""
    if server.poll() is None:
        server.send_signal(signal.SIGINT)
    out, _ = server.communicate(timeout=60)
    counts: dict[str, Any] = json.loads(out)
    return counts


def stream(robots: int, speed: float, seconds: float) -> dict[str, Any]:
    """Drive a served team in circles for a time; return what that costs the server, losses and latency of scans."""
    server = _served("--robots", str(robots), "--speed", str(speed), "--horizon-s", str(seconds * max(speed, 1.0)))
    graph = Graph("listener", DOMAIN, localhost=True)
    topics = [f"/robot_{robot}/scan" for robot in range(robots)]
    stamps: dict[str, list[float]] = {topic: [] for topic in topics}
    latencies = []
    for topic in topics:
        graph.subscribe(topic, LASER_SCAN)
    while server.poll() is None:
        graph.wait(0.1)
        for topic in topics:
            for message, _, sent_s in graph.take(topic):
                stamps[topic].append(seconds_of(message.header.stamp))
                latencies.append(time.time() - sent_s)
                graph.velocity(topic.replace("scan", "cmd_vel"), None, 0.0, (0.1, 0.5))
    counts = _ended(server)
    graph.close()
    lost = 0
    for found in stamps.values():
        steps = np.round(np.diff(found) / 0.1)
        lost += int((steps - 1).sum())
    return {
        "robots": robots,
        "speed_asked": speed or None,
        "speed": round(counts["simulated_s"] / counts["wall_s"], 2),
        "cpu_share": round(counts["cpu_s"] / counts["wall_s"], 3),
        "late_steps": counts["late_steps"],
        "scans_heard": sum(map(len, stamps.values())),
        "scans_lost": lost,
        "latency_ms": {f"p{p}": round(1e3 * float(np.percentile(latencies, p)), 2) for p in (50, 95, 99)},
    }


def driven(seed: int) -> tuple[float | None, str]:
    """Return the simulated time to 99 % of a policy that drives a served robot [s], and why it ended."""
    server = _served(
        *("--robots", "1", "--starts", "drawn", "--seed", str(seed), "--waits", "--speed", "0"),
        *("--stop-coverage", "0.99", "--horizon-s", "900"),
    )
    with TemporaryDirectory() as folder:
        asked = ("--policy", POLICY, "--seed", str(seed), "--out", folder)
        result = _run("ros", "drive", *ON_LOOPBACK, *asked, "--stale-s", "20", "--lost-s", "2", "--timeout-s", "60")
    return _ended(server)["time_to_99_s"], str(result["ended_because"])


def direct(seed: int) -> float | None:
    """Return the time of the same run without ROS [s]."""
    with TemporaryDirectory() as folder:
        asked = ("--policy", POLICY, "--seed", str(seed), "--out", folder, "--floor", FLOOR, "--starts", "drawn")
        own_frame = ("--unknown-starts", "--localization", "slam", "--map-resolution", "0.05")
        found: float | None = _run("run", "--robots", "1", *asked, *own_frame)["t99_s"]
    return found


def _run(*words: str) -> dict[str, Any]:
    """Run a command, and return its result."""
    ran = subprocess.run([*PROGRAM, *words, "--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)
    result: dict[str, Any] = json.loads(ran.stdout)
    return result


def compare(seeds: int) -> dict[str, Any]:
    """Return times to 99 % of some seeds, driven through ROS and directly."""
    pairs: list[dict[str, Any]] = []
    for seed in range(seeds):
        time_s, ended = driven(seed)
        pairs.append({"seed": seed, "driven_s": time_s, "direct_s": direct(seed), "driver_ended": ended})
    whole = [pair for pair in pairs if pair["driven_s"] is not None and pair["direct_s"] is not None]
    ratios = [pair["driven_s"] / pair["direct_s"] for pair in whole]
    return {
        "runs": pairs,
        "whole": len(whole),
        "mean_driven_s": statistics.mean(pair["driven_s"] for pair in whole),
        "mean_direct_s": statistics.mean(pair["direct_s"] for pair in whole),
        "median_ratio": round(statistics.median(ratios), 4),
    }


def main() -> None:
    """Measure all, and print or write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--parts", nargs="*", choices=("stream", "compare"), default=("stream", "compare"))
    options = parser.parse_args()
    found: dict[str, Any] = {"cores": os.cpu_count()}
    if "stream" in options.parts:
        found["real_time"] = stream(3, 1.0, options.seconds)
        found["fast"] = [stream(3, speed, 0.25 * options.seconds) for speed in (6.0, 20.0, 0.0)]
    if "compare" in options.parts:
        found["compare"] = compare(options.seeds)
    text = json.dumps(found, indent=2)
    print(text)
    if options.out is not None:
        options.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
