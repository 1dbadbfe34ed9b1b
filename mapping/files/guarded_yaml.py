"""Headers of YAML: short, flat, without aliases."""

from pathlib import Path
from typing import Any

import yaml

from lidarium.mapping.files.guarded_reading import read_text, reading

MOST_YAML_BYTES = 1 << 14
"""Longest header, some fifty times the usual one: parsing takes long."""


class _PlainLoader(yaml.SafeLoader):
    """Loads values alone: an alias could stand for more than there is memory for."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:  # noqa: ANN401
        if self.check_event(yaml.events.AliasEvent):
            raise ValueError("it has an alias (*); want values alone")
        return super().compose_node(parent, index)


def read_yaml(path: Path) -> Any:  # noqa: ANN401
    """Read a header.

    Raises
    ------
    FileNotFoundError
        If there is none.
    ValueError
        If it is no YAML, too long, or has aliases.
    """
    text = read_text(path, MOST_YAML_BYTES)
    with reading(path, "a yaml file"):
        try:
            return yaml.load(text, _PlainLoader)
        except yaml.YAMLError as error:
            raise ValueError(str(error)) from error
