"""What the processor can do for which kernels are compiled."""

from typing import Any

from llvmlite import binding
from numba.core import config

_numba_config: Any = config


def has_feature(name: str) -> bool:
    """Whether kernels are compiled for a processor with a feature.

    Features have the names that LLVM gives them. None where Python runs the kernels.
    """
    if _numba_config.DISABLE_JIT:
        return False
    if _numba_config.CPU_NAME is not None or _numba_config.CPU_FEATURES is not None:
        return f"+{name}" in (_numba_config.CPU_FEATURES or "").split(",")
    if name.startswith("avx") and not _numba_config.ENABLE_AVX:
        return False
    return bool(binding.get_host_cpu_features().get(name, False))
