"""Styles of SVG drawings: style sheets with their selectors, and how light colours are.

References
----------
W3C, Selectors Level 3 (types, classes, ids, descendants and children); CSS Color Module Level 4.
"""

import functools
import itertools
import re
from xml.etree.ElementTree import Element

_RULES = re.compile(r"([^{}]+)\{([^{}]*)\}")
_OTHER_MEDIA = re.compile(r"@media\s+(?!screen|all)[^{}]*\{(?:[^{}]*\{[^{}]*\})*[^{}]*\}")
_COMPOUND = re.compile(r"(\*|[\w-]+)?((?:[.#][\w-]+)*)")
_SIMPLE = re.compile(r"[.#][\w-]+")
_COMBINED = re.compile(r"\s*(>)\s*|\s+")

Declarations = dict[str, str]

_Part = tuple[str, frozenset[str], bool]
"""Part of a selector: name of an element or ``*``, the classes (``.a``) and the id (``#a``) that it has to have, and
whether it is directly in the element of the part before."""


def declared(text: str) -> Declarations:
    """Return the declarations of a style; important ones are there a second time, under ``!`` and their name."""
    found: Declarations = {}
    for declaration in text.split(";"):
        name, _, value = (part.strip() for part in declaration.partition(":"))
        plain = value.replace("!important", "").strip()
        found[name] = plain
        if plain != value:
            found[f"!{name}"] = plain
    return found


def settled(merged: Declarations) -> Declarations:
    """Return the values that count of declarations of which later ones took precedence: important ones, if any."""
    return {name: merged.get(f"!{name}", value) for name, value in merged.items() if not name.startswith("!")}


class StyleSheet:
    """The rules of a style sheet.

    Parameters
    ----------
    text : str
        All style elements of a drawing.

    Attributes
    ----------
    unread : int
        Rules whose selector is not understood, as those with states or attributes.
    """

    def __init__(self, text: str) -> None:
        text = _OTHER_MEDIA.sub("", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))
        self.unread = 0
        # By what their last part has to have, so that few are compared with an element.
        self._rules: dict[str, list[tuple[tuple[int, int, int, int], list[_Part], Declarations]]] = {}
        for order, (selectors, body) in enumerate(_RULES.findall(text)):
            found = declared(body)
            for selector in selectors.split(","):
                parts = _parsed(selector.strip())
                if parts is None:
                    self.unread += not selector.strip().startswith("@")
                    continue
                name, wanted, _ = parts[-1]
                self._rules.setdefault(min(wanted, default=name), []).append((_rank(parts, order), parts, found))

    @property
    def is_empty(self) -> bool:
        """Whether there are no rules."""
        return not self._rules

    def declared(self, path: tuple[Element, ...]) -> Declarations:
        """Return the declarations of the rules for an element, after its ancestors; the more specific ones last."""
        if not self._rules:
            return {}
        own = _features(path[-1])
        keys = ("*", *own)
        rules = itertools.chain.from_iterable(self._rules.get(key, ()) for key in keys)
        matching = [(rank, found) for rank, parts, found in rules if _matches(parts, path)]
        merged: Declarations = {}
        for _, found in sorted(matching, key=lambda rule: rule[0]):
            merged |= found
        return merged


def _parsed(selector: str) -> list[_Part] | None:
    """Return the parts of a selector; None if it is not understood."""
    parts: list[_Part] = []
    place, is_child = 0, False
    while place < len(selector):
        found = _COMPOUND.match(selector, place)
        if found is None or not found[0]:
            return None
        parts.append((found[1] or "*", frozenset(_SIMPLE.findall(found[2])), is_child))
        place = found.end()
        if place == len(selector):
            return parts
        between = _COMBINED.match(selector, place)
        if between is None:
            return None
        place, is_child = between.end(), between[1] is not None
    return None


def _rank(parts: list[_Part], order: int) -> tuple[int, int, int, int]:
    """Return how specific a selector is: ids, classes, names, and its place."""
    wanted = [each for _, features, _ in parts for each in features]
    ids = sum(each.startswith("#") for each in wanted)
    return ids, len(wanted) - ids, sum(name != "*" for name, *_ in parts), order


def _features(element: Element) -> tuple[str, ...]:
    """Return name, classes and id of an element, as selectors name them."""
    name = str(element.tag).rpartition("}")[2]
    classes = (f".{each}" for each in element.get("class", "").split())
    return (name, *classes, *([f"#{element.get('id')}"] if element.get("id") else []))


def _matches(parts: list[_Part], path: tuple[Element, ...]) -> bool:
    """Return whether a selector matches the last element of a path."""
    if not path:
        return False
    name, wanted, is_child = parts[-1]
    features = _features(path[-1])
    if name not in ("*", features[0]) or not wanted.issubset(features):
        return False
    rest = parts[:-1]
    if not rest or is_child:
        return not rest or _matches(rest, path[:-1])
    return any(_matches(rest, path[:end]) for end in range(len(path) - 1, 0, -1))


def share_of(text: str, otherwise: float) -> float:
    """Return a share as a number from 0 to 1; it may be given in percent."""
    try:
        value = float(text.strip().removesuffix("%"))
    except ValueError:
        return otherwise
    return min(max(value / 100.0 if text.strip().endswith("%") else value, 0.0), 1.0)


@functools.cache
def light_of(colour: str) -> tuple[float, float]:
    """Return lightness and opacity of a colour, 0 to 1; one that is not known is black."""
    from matplotlib.colors import to_rgba

    word = colour.strip().lower()
    if word in ("none", "transparent"):
        return 1.0, 0.0
    if found := re.fullmatch(r"(rgb|hsl)a?\(([^)]*)\)", word):
        parts = [part for part in re.split(r"[\s,/]+", found[2].strip()) if part]
        opacity = share_of(parts[3], 1.0) if len(parts) > 3 else 1.0
        if found[1] == "hsl":
            return share_of(parts[2], 0.0) if len(parts) > 2 else 0.0, opacity
        levels = [float(part[:-1]) / 100.0 if part.endswith("%") else float(part) / 255.0 for part in parts[:3]]
        red, green, blue = levels
    else:
        try:
            red, green, blue, opacity = to_rgba(word)
        except ValueError:
            return 0.0, 1.0
    return 0.299 * red + 0.587 * green + 0.114 * blue, opacity
