"""The command that installs an extra works where the package came from."""

import json
from importlib import metadata

import pytest

from lidarium import extras


class Distribution:
    requires = (
        "numpy>=2",
        'ezdxf>=1.3; extra == "dxf"',
        'mcap>=1.2; extra == "bags"',
        'pybullet>=3.2; python_version < "3.12" and extra == "bullet"',
        'shapely; extra == "bench"',
        'lidarium[bullet,dxf]; extra == "bench"',
    )

    def __init__(self, is_editable):
        self._text = json.dumps({"dir_info": {"editable": is_editable}}) if is_editable is not None else None

    def read_text(self, name):
        assert name == "direct_url.json"
        return self._text


@pytest.mark.parametrize("is_editable", [False, None])
def test_of_a_wheel_the_packages_are_listed(monkeypatch, is_editable):
    monkeypatch.setattr(extras, "distribution", lambda _: Distribution(is_editable))
    assert extras.install_command("dxf") == "pip install 'ezdxf>=1.3'"
    assert extras.install_command("bench") == "pip install 'shapely' 'pybullet>=3.2' 'ezdxf>=1.3'"


def test_a_checkout_is_installed_again(monkeypatch):
    monkeypatch.setattr(extras, "distribution", lambda _: Distribution(True))
    assert extras.install_command("dxf") == 'pip install -c constraints.txt -e ".[dxf]"'


def test_sources_that_are_not_installed_are_taken_for_a_checkout(monkeypatch):
    def missing(_):
        raise metadata.PackageNotFoundError

    monkeypatch.setattr(extras, "distribution", missing)
    assert extras.install_command("rl") == 'pip install -c constraints.txt -e ".[rl]"'
