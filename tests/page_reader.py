"""Reads pages of reports in the plainest way, without the front end."""

import base64
import json
import re
import struct
import zlib
from html.parser import HTMLParser

import numpy as np


class Scripts(HTMLParser):
    """What stands in the scripts of a page, by their ids, and the ids of nothing else."""

    def __init__(self, text):
        super().__init__()
        self.found, self.tags, self._name = {}, [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self._name = dict(attrs).get("id") if tag == "script" else None

    def handle_data(self, data):
        if self._name is not None:
            self.found[self._name] = self.found.get(self._name, "") + data


def page_data(path):
    """Return the content of a page."""
    return json.loads(Scripts(path.read_text(encoding="utf-8")).found["page-data"])


def replay_of_page(path, place=0):
    """Return header and streams of a replay of a page."""
    return unpacked(Scripts(path.read_text(encoding="utf-8")).found[f"replay-{place}"])


def unpacked(text):
    """Return header and streams of a packed text."""
    content = zlib.decompress(base64.b64decode(text))
    (size,) = struct.unpack("<I", content[:4])
    header, streams, place = json.loads(content[4 : 4 + size]), {}, 4 + size
    for name, length in header["streams"]:
        streams[name] = content[place : place + length]
        place += length
    assert place == len(content)
    return header, streams


def plain_numbers(stream):
    """Return the whole numbers of a stream."""
    numbers, value, shift = [], 0, 0
    for byte in stream:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            numbers.append(value)
            value, shift = 0, 0
    assert shift == 0
    return numbers


def signed_numbers(stream):
    return [number // 2 if number % 2 == 0 else -(number + 1) // 2 for number in plain_numbers(stream)]


def columns(stream, width, unit=1e-3):
    """Return rows of numbers that were packed as differences."""
    differences = np.array(signed_numbers(stream)).reshape(width, -1)
    return np.cumsum(differences, axis=1).T * unit


def maps_of(stream, rows, columns):
    """Return all samples of a layer, (samples, rows, columns)."""
    numbers = iter(plain_numbers(stream))
    levels, samples = np.zeros(rows * columns, np.uint8), []
    for runs in numbers:
        place = 0
        for _ in range(runs):
            place += next(numbers)
            length = next(numbers)
            levels[place : place + length] = next(numbers)
            place += length
        samples.append(levels.copy().reshape(rows, columns))
    return np.array(samples)


def outside_of(text):
    """Return the addresses that a page would fetch something from."""
    without_data = re.sub(r'<script type="[^"]*" id="[^"]*">.*?</script>', "", text, flags=re.DOTALL)
    return re.findall(r"(?:src|href|url)\s*[=(]\s*[\"']?(https?:[^\"')\s]+)", without_data)
