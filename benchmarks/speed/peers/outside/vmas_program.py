"""The program that times VMAS, in an interpreter of its own.

It needs vmas and torch, not lidarium.

VMAS is under the GPL: this file is run as a separate process and nothing of lidarium imports it. It reads one
line of JSON (boxes, poses, rays, reach, field_of_view, threads, batches) and answers with its version and the
batch size that was fastest; after that each line it reads is a number of seconds to run, and each line it
writes the seconds that one agent's step took.
"""

import json
import sys
import time
from importlib.metadata import version
from typing import Any

import torch
from vmas import make_env
from vmas.simulator.core import Agent, Box, Landmark, Sphere, World
from vmas.simulator.dynamics.diff_drive import DiffDrive
from vmas.simulator.scenario import BaseScenario
from vmas.simulator.sensors import Lidar


class Rooms(BaseScenario):
    """Differential-drive agents with lidars among boxes."""

    def make_world(self, batch_dim: int, device: torch.device, floor: dict[str, Any], **kwargs: object) -> World:
        """Put agents and boxes into the world."""
        world = World(batch_dim, device, dt=0.1, substeps=1)
        self.floor = floor
        for k in range(len(floor["poses"])):
            half = floor["field_of_view"] / 2
            lidar = Lidar(world, -half, half, n_rays=floor["rays"], max_range=floor["reach"], render=False)
            drive = DiffDrive(world, integration="euler")
            world.add_agent(
                Agent(
                    f"agent_{k}", shape=Sphere(0.18), collide=True, u_range=[0.5, 1.0], dynamics=drive, sensors=[lidar]
                )
            )
        for k, (x_low, y_low, x_high, y_high) in enumerate(floor["boxes"]):
            shape = Box(length=x_high - x_low, width=y_high - y_low)
            world.add_landmark(Landmark(f"box_{k}", collide=True, movable=False, shape=shape))
        return world

    def reset_world_at(self, env_index: int | None = None) -> None:
        """Put everything in its place."""
        for agent, (x, y, theta) in zip(self.world.agents, self.floor["poses"], strict=True):
            agent.set_pos(torch.tensor([x, y], dtype=torch.float32), batch_index=env_index)
            agent.set_rot(torch.tensor([theta], dtype=torch.float32), batch_index=env_index)
        for landmark, (x_low, y_low, x_high, y_high) in zip(self.world.landmarks, self.floor["boxes"], strict=True):
            landmark.set_pos(
                torch.tensor([(x_low + x_high) / 2, (y_low + y_high) / 2], dtype=torch.float32), batch_index=env_index
            )

    def reward(self, agent: Agent) -> torch.Tensor:
        """Reward nothing."""
        return torch.zeros(self.world.batch_dim)

    def observation(self, agent: Agent) -> torch.Tensor:
        """Take the scan."""
        return agent.sensors[0].measure()


class Batch:
    """Environments of one batch size, stepped by drawn actions."""

    def __init__(self, floor: dict[str, Any], size: int) -> None:
        self.agents = len(floor["poses"])
        self.env = make_env(Rooms(), num_envs=size, device="cpu", continuous_actions=True, seed=0, floor=floor)
        self.actions = [torch.rand(size, 2) - 0.5 for _ in range(self.agents)]
        self.size = size

    def run(self, seconds: float) -> float:
        """Step for about so long and return the seconds per agent and step."""
        steps, elapsed = 0, 0.0
        began = time.perf_counter()
        with torch.no_grad():
            while steps == 0 or elapsed < seconds:
                self.env.step(self.actions)
                steps += 1
                elapsed = time.perf_counter() - began
        return elapsed / (steps * self.agents * self.size)


def main() -> None:
    """Answer line by line."""
    floor = json.loads(sys.stdin.readline())
    torch.set_num_threads(floor["threads"])
    trials = []
    for size in floor["batches"]:
        batch = Batch(floor, size)
        batch.run(0.0)
        trials.append((min(batch.run(0.3) for _ in range(3)), size, batch))
    _, size, best = min(trials, key=lambda trial: trial[0])
    print(json.dumps({"vmas": version("vmas"), "torch": version("torch"), "batch": size}), flush=True)
    for line in sys.stdin:
        print(best.run(float(line)), flush=True)


if __name__ == "__main__":
    main()
