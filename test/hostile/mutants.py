"""Damage to files: bytes, numbers, words and lines, and the values inside of JSON."""

import json
import random
import re
import struct

MOST_BYTES = 100_000

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]{2,}")
_NUMBERS = (
    *(b"0", b"-1", b"1", b"2147483647", b"-2147483648", b"4294967295", b"9223372036854775808"),
    *(b"1e308", b"-1e308", b"1e-320", b"1e20", b"nan", b"inf", b"-inf", b"0.5", b"9" * 400, b""),
    *(b"100000000000000000000", b"1e400", b"-9223372036854775808", b"65536", b"1000000"),
)
_WORDS = (
    *(
        b"",
        b"a\nb",
        b"\x00",
        b"\xff\xfe",
        b"x" * 50_000,
        b"*a",
        b"&a [*a]",
        b"!!int x",
        b"'",
        b'"',
    ),
    *(
        "\N{ARABIC-INDIC DIGIT ONE}".encode(),
        "\u2028".encode(),
        b"true",
        b"null",
        b"../x",
        b"/dev",
    ),
)
_FLOATS = (
    *(0.0, -0.0, 1.0, float("nan"), float("inf"), -float("inf"), 1e300, -1e300, 1e-320),
    *(1e6, -1e6, 999_999.0, 1e9, 2.0**53),
)
_VALUES = (
    *(None, True, 0, -1, 0.5, 2**31, 2**63, 10**30, 1e308, 1e-320, "", "a\nb", "x" * 50_000),
    *([], {}, [[]], [0], [0.5, "x"], {"a": {}}, "\ud800", list(range(1000)), [1e300] * 3),
)


def mutant(data: bytes, seed: int) -> bytes:
    """The file with some damage; the same for the same seed."""
    rng = random.Random(seed)
    kinds = [_bytes, _bytes, _span, _numbers, _numbers, _words, _lines, _binary_numbers]
    if data[:1] == b"{":
        kinds += [_json] * 6
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(kinds)(data, rng) or data
    return data[:MOST_BYTES]


def binary_mutant(data: bytes, seed: int) -> bytes:
    """The same for a message: bytes, spans, counts and float64."""
    rng = random.Random(seed)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = (
            rng.choice((_bytes, _span, _binary_numbers, _floats, _floats, _floats))(data, rng)
            or data
        )
    return data[:MOST_BYTES]


def _floats(data: bytes, rng: random.Random) -> bytes:
    """Some float64 of a message are others."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 5))):
        if len(data) < 12:
            break
        count = (len(data) - 4) // 8
        # Names, which damage breaks as a whole, come first.
        first = rng.choice((0, max(0, count - 40)))
        place = 4 + 8 * rng.randrange(first, count) + rng.choice((0, 0, 4))
        value = rng.choice((*_FLOATS, rng.gauss(0.0, 1.0), rng.gauss(0.0, 1e3)))
        changed[place : place + 8] = struct.pack("<d", value)
    return bytes(changed)


def _bytes(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 20))):
        changed[rng.randrange(len(changed))] = rng.choice((0, 255, 10, 32, rng.randrange(256)))
    return bytes(changed)


def _span(data: bytes, rng: random.Random) -> bytes:
    """Cut off, cut out, doubled, moved, or repeated until the file is large."""
    a, b = sorted((rng.randrange(len(data) + 1), rng.randrange(len(data) + 1)))
    if rng.random() < 0.5:
        b = min(b, a + rng.choice((1, 4, 30, 300)))
    piece = data[a:b]
    copies = (MOST_BYTES - len(data)) // max(len(piece), 1)
    return rng.choice(
        (
            data[:a],
            data[:a] + data[b:],
            data[:b] + piece + data[b:],
            data[:a] + data[b:] + piece,
            data[:b] + piece * max(copies, 0) + data[b:],
            data[:a] + rng.randbytes(len(piece)) + data[b:],
        )
    )


def _numbers(data: bytes, rng: random.Random) -> bytes:
    return _replaced(data, _NUMBER, _NUMBERS, rng)


def _words(data: bytes, rng: random.Random) -> bytes:
    return _replaced(data, _WORD, _WORDS, rng)


def _replaced(data: bytes, what: re.Pattern, by: tuple, rng: random.Random) -> bytes:
    found = list(what.finditer(data))
    if not found:
        return data
    match = rng.choice(found)
    new = rng.choice(by)
    if rng.random() < 0.3:  # another one of the file's own
        new = rng.choice(found)[0]
    if rng.random() < 0.2:
        return data.replace(match[0], new)
    return data[: match.start()] + new + data[match.end() :]


def _lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif kind == 1:
        lines.insert(a, lines[b])
    elif kind == 2:
        del lines[a]
    else:
        room = (MOST_BYTES - len(data)) // (len(lines[a]) + 1)
        lines[a:a] = [lines[a]] * max(room, 0)
    return b"\n".join(lines)


def _binary_numbers(data: bytes, rng: random.Random) -> bytes:
    width = rng.choice((1, 2, 4, 8))
    if len(data) < width:
        return data
    place = rng.randrange(len(data) - width + 1)
    value = rng.choice((0, 1, -1, 2**31 - 1, 2**62, 2**20, rng.getrandbits(60)))
    new = (value % 256**width).to_bytes(width, rng.choice(("little", "big")))
    return data[:place] + new + data[place + width :]


def _json(data: bytes, rng: random.Random) -> bytes:
    """One value replaced, left out, or put in the place of another."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return data
    places = []
    stack = [content]
    while stack:
        value = stack.pop()
        keys = list(value) if isinstance(value, dict) else range(min(len(value), 40))
        for key in keys:
            places.append((value, key))
            if isinstance(value[key], dict | list):
                stack.append(value[key])
    if not places:
        return data
    owner, key = rng.choice(places)
    kind = rng.randrange(5)
    if kind == 0:
        del owner[key]
    elif kind == 1:
        other, at = rng.choice(places)
        owner[key] = json.loads(json.dumps(other[at])) if _has(other, at) else None
    elif kind == 2 and isinstance(owner[key], list) and owner[key]:
        owner[key] = (owner[key] * 4000)[: 10_000 // len(json.dumps(owner[key][0])) + 1]
    elif kind == 3 and isinstance(owner, dict):
        owner[rng.choice(("a\nb", "x" * 50_000, "", "\udfff"))] = owner.pop(key)
    else:
        owner[key] = rng.choice(_VALUES)
    return json.dumps(content).encode()


def _has(owner: dict | list, key: object) -> bool:
    return key in owner if isinstance(owner, dict) else 0 <= key < len(owner)
