"""Ways to damage a file: in its bytes, its numbers, its brackets, and within what is packed."""

import gzip
import io
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable

NUMBERS = (
    b"0 -1 1 1e-308 -1e308 1e308 1e18 1e9 -1e9 65536 4294967296 9223372036854775808 nan inf -inf NaN "
    b"Infinity -Infinity 0.0 -0.0 1e-9 100000 2147483647 true false null none [] {} \"\" '' 1_0 0x10 "
    b"99999999999999999999999"
).split()
PIECES = (
    b"[" * 5000,
    b'{"a":' * 3000,
    b"(" * 2000,
    b"\x00",
    b"\xff\xfe",
    b"\n",
    b"#",
    b"&a [*a]",
    b"1" * 5000,
    b"$\\frac{$",
    b"<script>",
    b"| ` |",
    b"\xed\xb3\xbf",
    b"\r\n\r\n",
    b'"',
    b",",
    b"-",
    b"e999",
)
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_]{3,}")


def mutated(content: bytes, name: str, chance: random.Random) -> bytes:
    """Return a file damaged in one or a few ways; packed ones mostly within."""
    if name.endswith(".gz") and chance.random() < 0.7:
        return gzip.compress(_damaged(gzip.decompress(content), chance), 1)
    if name.endswith(".npz") and chance.random() < 0.8:
        return _repacked(content, chance)
    if name.endswith(".smap") and chance.random() < 0.8:
        return _repacked_map(content, chance)
    return _damaged(content, chance)


def _damaged(content: bytes, chance: random.Random) -> bytes:
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8))):
        content = chance.choice(WAYS)(content, chance)
    return content[: 1 << 20]


def _repacked(content: bytes, chance: random.Random) -> bytes:
    """Damage a member of a zip, its name or its header, with a checksum that fits."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    chosen = chance.choice(sorted(members))
    way = chance.random()
    if way < 0.05:
        del members[chosen]
    elif way < 0.1:
        other = chance.choice(sorted(members))
        members[chosen], members[other] = members[other], members[chosen]
    elif way < 0.35 and chosen.endswith(".npy"):
        members[chosen] = _bad_header(members[chosen], chance)
    else:
        members[chosen] = _damaged(members[chosen], chance)
    packed = io.BytesIO()
    kind = chance.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2))
    with zipfile.ZipFile(packed, "w", kind) as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return packed.getvalue()


def _repacked_map(content: bytes, chance: random.Random) -> bytes:
    """Damage the numbers of a sparse map, or its header, with a length and checksum that fit."""
    header, body = bytearray(content[:40]), zlib.decompress(content[40:])
    body = _damaged(body, chance) if chance.random() < 0.7 else _number(body, chance)
    if chance.random() < 0.3:
        place = 12 + 4 * chance.randrange(4)
        header[place : place + 4] = struct.pack("<I", chance.choice((0, 1, 7, 40, 1000, 1 << 20, (1 << 32) - 1)))
    packed = zlib.compress(body)
    header[28:40] = struct.pack("<III", len(body), len(packed), zlib.crc32(packed))
    return bytes(header) + packed


def _bad_header(content: bytes, chance: random.Random) -> bytes:
    """Change shape, type or order in the header of an array."""
    size = int.from_bytes(content[8:10], "little")
    header, rest = content[10 : 10 + size], content[10 + size :]
    old, new = chance.choice(
        (
            (rb"'shape': \([^)]*\)", b"'shape': (%d,)" % chance.choice((0, 1, -1, 10**10, 10**18))),
            (rb"'shape': \([^)]*\)", b"'shape': (%d, 3)" % chance.choice((0, 1, 7, 10**9))),
            (rb"'descr': '[^']*'", chance.choice((b"'descr': '<f8'", b"'descr': '|O'", b"'descr': '<U9'"))),
            (rb"'descr': '[^']*'", chance.choice((b"'descr': '|b1'", b"'descr': '<c16'", b"'descr': '>f4'"))),
            (rb"False", b"True"),
            (rb"\}", b"}" + b"(" * 300),
            (rb"'descr'", b"'des\ncr'"),
        )
    )
    header = re.sub(old, new.replace(b"\\", b"\\\\"), header, count=1).strip()
    header = header + b" " * (-(10 + len(header) + 1) % 64) + b"\n"
    return content[:8] + len(header).to_bytes(2, "little") + header + rest


def _flip(content: bytes, chance: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.choice((1, 4, 32))):
        if changed:
            changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def _byte(content: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(content) + 1)
    return content[:place] + bytes([chance.choice((0, 255, 127, 128, 48, 10, 34))]) + content[place + 1 :]


def _cut(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randrange(len(content) + 1)]


def _without(content: bytes, chance: random.Random) -> bytes:
    first = chance.randrange(len(content) + 1)
    return content[:first] + content[first + chance.choice((1, 4, 64, 1024)) :]


def _twice(content: bytes, chance: random.Random) -> bytes:
    first = chance.randrange(len(content) + 1)
    piece = content[first : first + chance.choice((1, 16, 256))]
    return content[:first] + piece * chance.choice((2, 3, 200)) + content[first:]


def _piece(content: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(content) + 1)
    return content[:place] + chance.choice(PIECES) + content[place:]


def _number(content: bytes, chance: random.Random) -> bytes:
    found = list(_NUMBER.finditer(content[:200_000]))
    if not found:
        return _byte(content, chance)
    spot = chance.choice(found)
    return content[: spot.start()] + chance.choice(NUMBERS) + content[spot.end() :]


def _word(content: bytes, chance: random.Random) -> bytes:
    found = list(_WORD.finditer(content[:200_000]))
    if not found:
        return _flip(content, chance)
    spot, other = chance.choice(found), chance.choice(found)
    return content[: spot.start()] + other.group() + content[spot.end() :]


def _checksums(content: bytes, chance: random.Random) -> bytes:
    """Change a chunk of a PNG with a checksum that fits; anything else by its bytes."""
    if content[:8] != b"\x89PNG\r\n\x1a\n" or len(content) < 40:
        return _flip(content, chance)
    changed = bytearray(content)
    place = 16 + chance.randrange(13)
    changed[place] = chance.choice((0, 1, 16, 127, 255))
    changed[29:33] = zlib.crc32(bytes(changed[12:29])).to_bytes(4, "big")
    return bytes(changed)


WAYS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _flip,
    _byte,
    _cut,
    _without,
    _twice,
    _piece,
    _number,
    _number,
    _number,
    _word,
    _checksums,
)
