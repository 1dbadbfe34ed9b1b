"""Which other programs there are to be compared with, and how to get them."""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from lidarium.benchmarks.speed.peers import f1tenth_scans, vmas_peer
from lidarium.extras import install_command


@dataclass(frozen=True, slots=True)
class Peer:
    """Another simulator.

    `name`: what it is called; `is_there`: whether it can take part; `how`: how to get it.
    """

    name: str
    is_there: Callable[[], bool]
    how: str


def _is_installed(module: str) -> bool:
    return importlib.util.find_spec(module) is not None


PEERS = (
    Peer("IR-SIM", partial(_is_installed, "irsim"), install_command("bench")),
    Peer("PyBullet", partial(_is_installed, "pybullet"), f"{install_command('bench')} (Python 3.11)"),
    Peer("scikit-learn", partial(_is_installed, "sklearn"), install_command("bench")),
    Peer("faiss", partial(_is_installed, "faiss"), install_command("bench")),
    Peer(
        "VMAS",
        vmas_peer.is_there,
        f"pip install vmas in an environment of its own, and name its interpreter in {vmas_peer.INTERPRETER}",
    ),
    Peer(
        "f1tenth's scan simulator",
        f1tenth_scans.is_there,
        f"fetch github.com/f1tenth/f1tenth_gym and name its file laser_models.py in {f1tenth_scans.SOURCE}",
    ),
)


def missing_peers() -> list[str]:
    """Say of each simulator that is not there how to get it."""
    return [f"{peer.name} is not installed and left out: {peer.how}" for peer in PEERS if not peer.is_there()]


def outside_versions() -> dict[str, str]:
    """Return the versions of the peers that run in interpreters of their own."""
    return {"vmas": vmas_peer.package_version()} if vmas_peer.is_there() else {}
