"""Features of the processor for which kernels are compiled."""

import pytest
from numba.core import config

from lidarium.mapping.kernels.llvm import has_feature


@pytest.fixture
def host(monkeypatch):
    """A processor that LLVM names by itself."""
    monkeypatch.setattr(config, "DISABLE_JIT", 0)
    monkeypatch.setattr(config, "CPU_NAME", None)
    monkeypatch.setattr(config, "CPU_FEATURES", None)
    return monkeypatch


def test_an_unknown_feature_is_none(host):
    assert not has_feature("no-such-feature")


def test_named_features_alone_count_where_they_are_named(host):
    host.setattr(config, "CPU_FEATURES", "+avx2,-avx512f,+sse2")
    assert has_feature("avx2")
    assert not has_feature("avx512f")
    assert not has_feature("avx")
    host.setattr(config, "CPU_FEATURES", None)
    host.setattr(config, "CPU_NAME", "generic")
    assert not has_feature("sse2")


def test_vectors_can_be_forbidden_and_python_has_none(host):
    host.setattr(
        "lidarium.mapping.kernels.llvm.binding.get_host_cpu_features",
        lambda: {"avx2": True, "bmi": True},
    )
    assert has_feature("avx2")
    host.setattr(config, "ENABLE_AVX", 0)
    assert not has_feature("avx2")
    assert has_feature("bmi")
    host.setattr(config, "DISABLE_JIT", 1)
    assert not has_feature("bmi")
