"""Inputs to readers, and ways to damage them: bytes, and trees of tables, lists and values."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

Case = dict[str, bytes]
"""Files of an input by their path in its folder."""


class Target(NamedTuple):
    """A reader, and what it is given."""

    seeds: Callable[[], Sequence[Case]]
    """Valid inputs."""
    make: Callable[[Random], Case]
    """A structured input with hostile values."""
    read: Callable[[Path], Any]
    """Reads the input in a folder; raises what the reader does."""


HOSTILE_WORDS = [b"\0", b"\xff", b"\xef\xbb\xbf", b"\n", b"\r", b"nan", b"inf", b"1e999", b"-1", b"0", b"9" * 30, b"\\"]
HOSTILE_NUMBERS = [b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\xff\x7f", b"\0\x80"]


def damaged(data: bytes, random: Random, others: list[bytes]) -> bytes:
    """Bytes with one to eight faults: flipped, lost, doubled, moved, or mixed with another input."""
    result = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 3, 8))):
        at = random.randrange(len(result) + 1)
        end = min(len(result), at + random.choice((1, 1, 2, 4, 8, 16, 64, 1024)))
        match random.randrange(9):
            case 0 if at < len(result):
                result[at] ^= 1 << random.randrange(8)
            case 1:
                del result[at:end]
            case 2:
                result[at:at] = result[at:end] * random.choice((1, 1, 2, 50))
            case 3:
                del result[at:]
            case 4:
                result[at:at] = random.choice(HOSTILE_WORDS)
            case 5:
                word = random.choice(HOSTILE_NUMBERS)
                result[at : at + len(word)] = word
            case 6:
                part = bytes(result[at:end])
                del result[at:end]
                place = random.randrange(len(result) + 1)
                result[place:place] = part
            case 7:
                other = random.choice(others)
                begin = random.randrange(len(other) + 1)
                result[at:end] = other[begin : begin + random.choice((1, 4, 16, 256, 4096))]
            case _:
                result[at:end] = random.randbytes(end - at)
    return bytes(result[: 1 << 18])


def damaged_case(case: Case, random: Random, corpus: list[Case]) -> Case:
    """A case with one damaged file; now and then one that is missing or another's."""
    result = dict(case)
    name = random.choice(sorted(result))
    others = [other[name] for other in corpus if name in other]
    if len(result) > 1 and random.random() < 0.05:
        del result[name]
    elif random.random() < 0.05:
        result[name] = random.choice(list(random.choice(corpus).values()))
    else:
        result[name] = damaged(result[name], random, others)
    return result


def next_case(target: Target, corpus: list[Case], random: Random) -> Case:
    """A structured input, or one with damaged bytes, or both."""
    is_structured = random.random() < 0.6
    case = target.make(random) if is_structured else random.choice(corpus)
    return case if is_structured and random.random() < 0.8 else damaged_case(case, random, corpus)


def hostile_value(random: Random) -> Any:
    """A value that fits hardly anywhere, or is at the end of what numbers can be."""
    numbers = [0, 1, -1, 2, 3, 255, 2**16, 2**31 - 1, 2**31, 2**53, 2**63, 2**64, -(2**63), 10**40, 10**400]
    floats = [0.0, -0.0, 0.5, 1e-300, 5e-324, 1e-9, 1e9, 1e15, 1e154, 1e300, 1.7e308, -1e308, math.inf, math.nan]
    texts = ["", "x", " ", ".", "..", "/", "/dev/zero", "\0", "\n", "é\U0001f4e6", "\ufeff", "{}", "%s", "a" * 300]
    trees: list[Any] = [[], {}, [[]], [0] * 3, [0.0, 0.0, 1.0], [[0, 0, 0]], [None], {"kind": "x"}, {"": 0}, [1] * 300]
    scalars: list[Any] = [True, False, None]
    return copy.deepcopy(random.choice(random.choice((numbers, floats, floats, texts, trees, scalars))))


def damaged_tree(tree: Any, random: Random) -> Any:
    """A tree with one to four values that are changed, missing, doubled, or in another's place."""
    tree = copy.deepcopy(tree)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        places = list(_places(tree))
        if not places:
            return tree
        holder, key = random.choice(places)
        match random.randrange(8):
            case 0 | 1:
                holder[key] = hostile_value(random)
            case 2 | 3:
                holder[key] = _other_number(holder[key], random)
            case 4:
                del holder[key]
            case 5:
                other, name = random.choice(places)
                holder[key] = copy.deepcopy(other[name])
            case 6 if isinstance(holder, list):
                holder.insert(random.randrange(len(holder) + 1), copy.deepcopy(holder[key]))
            case 7 if isinstance(holder, dict):
                holder[random.choice(("", "x", key + "s", key.upper()))] = holder.pop(key)
    return tree


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """All values of a tree, as what holds them and the key."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        yield tree, key
        yield from _places(value)


def _other_number(value: Any, random: Random) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 1e300:
        return hostile_value(random)
    factor = random.choice((0, -1, 2, 0.5, 10, 1000, 1e-3, 1e6, 1e-6, 1e12, 1e-12, 1.0000001))
    changed = value * factor
    return int(changed) if isinstance(value, int) and random.random() < 0.7 else changed


def json_bytes(tree: Any) -> bytes:
    return json.dumps(tree).encode()


def write(case: Case, folder: Path) -> None:
    """Put the files of a case into a folder, and remove all others."""
    wanted = {folder / name for name in case}
    for path in folder.rglob("*"):
        if path not in wanted and not path.is_dir():
            path.unlink()
    for name, data in case.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def size_of(case: Case) -> int:
    return sum(map(len, case.values()))


def read_back(folder: Path) -> Case:
    """The case that a folder holds."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
