"""The program that ``cached_start`` runs in fresh processes.

It imports lidarium, resets an environment and takes some steps.

It prints one line of JSON: the seconds of import and reset, how many kernels were compiled and how many
loaded, and the folder of the compiled code.
"""

import gc
import json
import time


def main() -> None:
    """Start, and tell how it went."""
    began = time.perf_counter()
    import lidarium

    env = lidarium.parallel_env()
    env.reset(seed=0)
    seconds = time.perf_counter() - began
    for _ in range(3):
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})

    from numba.core.dispatcher import Dispatcher

    from lidarium.mapping.kernels import compilation

    compiled, loaded = 0, 0
    for each in gc.get_objects():
        if isinstance(each, Dispatcher) and each.py_func.__module__.startswith("lidarium."):
            hits = sum(each.stats.cache_hits.values())
            compiled, loaded = compiled + len(each.signatures) - hits, loaded + hits
    print(json.dumps({"seconds": seconds, "compiled": compiled, "loaded": loaded, "folder": str(compilation._FOLDER)}))


if __name__ == "__main__":
    main()
