"""Verifies a certificate of sig_pow's error against the generated C.

It shares no code with what made the certificate, and takes other ways: the functions come from
mpmath's intervals at the ends of pieces, between which a chord and the second derivative bound
them; the integers are those of the C, evaluated where they are extreme; and the result's error is
bounded on a tree of boxes that are split only where they must be.

Everything is an integer: a number with the suffix ``_u`` is in units 2^-40.
"""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from mpmath import iv

_U = 1 << 40
_PRECISION_BITS = 110
_DEEPEST = 6
"""A piece is halved so often at most before it counts as refuted."""
_LEAF_LEVEL = 10


@dataclass(frozen=True)
class _Half:
    """How one half of a kernel reads its words, written down from the C once more.

    Attributes:
        function: "log2" or "exp2".
        bits: of the argument's fraction.
        index: the leading bits that choose a segment.
        two_sided: odd segments count down from their right end.
        sign: of the curvature.
        curvature_bits: lowest bits of the slope.
        finer: bits of offset and sum behind the argument's last place.
        step: of the arguments that occur, in units 2^-finer of the last place.
    """

    function: str
    bits: int
    index: int
    two_sided: bool
    sign: int
    curvature_bits: int
    finer: int
    step: int

    @property
    def width(self) -> int:
        return 1 << (self.bits - self.index)

    def zero(self, segment: int) -> int:
        """The argument where a segment's offset is zero, in last places."""
        return self.width * (segment + segment % 2 if self.two_sided else segment)


@dataclass(frozen=True)
class _Kernel:
    """Both halves, what the product is cut off by at most, and the SHA-256 of the C's statements.

    ``cut_u`` is in units 2^-23; exp2's function is taken at its argument and ``shift_u`` more.
    """

    log2: _Half
    exp2: _Half
    cut_u: int
    shift_u: int
    body_sha256: str


_KERNELS = {
    "tdc_sig_pow": _Kernel(
        log2=_Half("log2", 24, 6, True, -1, 8, 0, 2),
        exp2=_Half("exp2", 23, 6, False, 1, 8, 0, 1),
        cut_u=_U,
        shift_u=_U // 2,
        body_sha256="7e68d4d3f0d838b8245fc8366e9ac6df8f086e19b1fc46717f9b835f25cf9d1c",
    ),
    "tdc_sig_pow_precise": _Kernel(
        log2=_Half("log2", 24, 7, True, -1, 12, 10, 2 << 10),
        exp2=_Half("exp2", 23, 7, True, 1, 12, 10, 1),
        cut_u=_U >> 10,
        shift_u=0,
        body_sha256="15a43592f63fa9c23eafa7dae7be682f120c222b987fafc139baccd593747d94",
    ),
}


def complaints(certificate: Mapping[str, Any], header: str, source: str) -> Iterator[str]:
    """Everything that is wrong with a certificate, one sentence each; none if it is verified.

    Args:
        certificate: as JSON has it.
        header: the text of the kernel's generated header.
        source: the text of the C file with its table.
    """
    name = certificate.get("function")
    if name not in _KERNELS:
        yield f"no kernel {name!r} is known"
        return
    kernel = _KERNELS[name]
    try:
        yield from _text_complaints(certificate, kernel, header, source)
        words = _words(source)
        halves = ((kernel.log2, certificate["log2"]), (kernel.exp2, certificate["exp2"]))
        for column, (half, claim) in enumerate(halves):
            own = [row[column] for row in words]
            if own != [int(word, 16) for word in claim["words"]]:
                yield f"{half.function}: the words are not those of the C"
            if len(own) != 1 << half.index:
                yield f"{half.function}: {len(own)} segments"
                return
            for key in ("low", "high"):
                if len(claim[key]) != 1 << _LEAF_LEVEL:
                    yield f"{half.function}: {len(claim[key])} bounds"
                    return
                if not all(isinstance(bound, int) for bound in claim[key]):
                    yield f"{half.function}: a bound is no integer"
                    return
        for column, (half, _) in enumerate(halves):
            yield from _range_complaints(half, [row[column] for row in words])
        yield from _composition_complaints(certificate, kernel)
        per_unit = int(certificate["per_unit"])
        for segment, row in enumerate(words):
            for column, (half, claim) in enumerate(halves):
                yield from _segment_complaints(half, segment, row[column], claim, per_unit)
    except (KeyError, TypeError, ValueError, IndexError, ZeroDivisionError) as error:
        yield f"not a certificate: {type(error).__name__} {error}"


# --- The text of the C -------------------------------------------------------------------------


def _words(source: str) -> list[tuple[int, int]]:
    numbers = [int(n, 16) for n in re.findall(r"\b0x([0-9A-Fa-f]+)u\b", source)]
    return list(zip(numbers[::2], numbers[1::2], strict=True))


def _statements(header: str, name: str) -> str:
    """The function's body without comments and with single spaces."""
    body = header[header.index(f"{name}(const float x, const tdc_exponent a)\n{{") :]
    body = body[body.index("{") + 1 : body.index("\n}\n")]
    while "/*" in body:
        start = body.index("/*")
        body = body[:start] + " " + body[body.index("*/", start) + 2 :]
    return " ".join(body.split())


def _text_complaints(
    certificate: Mapping[str, Any], kernel: _Kernel, header: str, source: str
) -> Iterator[str]:
    name = certificate["function"]
    digest = hashlib.sha256(_statements(header, name).encode()).hexdigest()
    if not digest == kernel.body_sha256 == certificate["body_sha256"]:
        yield f"{name}: the C's statements are not those that were checked"
    declared = re.findall(r"\[(\d+)\] = \{", source)
    if [int(n) for n in declared] != [len(_words(source))]:
        yield "the table is not as long as it says"
    prose = " ".join(header.replace("*", " ").split())
    numbers = re.search(
        r"at most (\d+\.\d+) ulp of the result, 2\^(-\d+\.\d+) relative"
        r".*?at most (\d+\.\d+) \|log2 x\| ulp",
        prose,
    )
    if numbers is None:
        yield "the header states no bounds"
        return
    stated = certificate["stated"]
    claims = (stated["ulp"], stated["relative_log2"], stated["exponent_rounding"])
    if [Fraction(n) for n in numbers.groups()] != [Fraction(n) for n in claims]:
        yield "the header states other bounds"
    if Fraction(certificate["ulp_hundredths"], 100) > Fraction(stated["ulp"]):
        yield "the error is larger than the header's, in ulp"
    # r 2^-24 <= 2^s, to the hundredth power of both
    relative = Fraction(certificate["relative_hundredths_of_2^-24"], 100)
    hundredfold = Fraction(stated["relative_log2"]) * 100
    if hundredfold.denominator != 1:
        yield "the relative bound has more than two decimals"
    elif relative**100 > Fraction(2) ** (int(hundredfold) + 2400):
        yield "the relative error is larger than the header's"
    # ln 2 2^-8 (1 + 2^-20): the rounding of the exponent
    if Fraction(stated["exponent_rounding"]) * 256 < Fraction(_ln2_u()[1], _U) * (
        1 + Fraction(1, 1 << 20)
    ):
        yield "a rounded exponent adds more than the header says"


# --- Functions ---------------------------------------------------------------------------------


def _outward(value: Any) -> tuple[int, int]:
    """An mpmath interval in units 2^-40, rounded outward."""
    ends = []
    for sign, mantissa, exponent, _ in value._mpi_:
        number = Fraction(-mantissa if sign else mantissa) * Fraction(2) ** (exponent + 40)
        ends.append(number)
    return ends[0].__floor__(), ends[1].__ceil__()


@functools.cache
def _ln2_u() -> tuple[int, int]:
    iv.prec = _PRECISION_BITS
    return _outward(iv.log(iv.mpf(2)))


@functools.cache
def _at(function: str, bits: int, shift_u: int, argument: Fraction) -> tuple[int, int]:
    """The corrected number at an argument in last places: 2^24 log2(1 + m), or 2^23 2^f."""
    iv.prec = _PRECISION_BITS
    exact = argument + Fraction(shift_u, _U)
    place = iv.mpf(exact.numerator) / (exact.denominator << bits)
    scale = iv.mpf(1 << bits)
    if function == "log2":
        return _outward(iv.log(1 + place) / iv.log(iv.mpf(2)) * scale)
    return _outward(iv.exp(place * iv.log(iv.mpf(2))) * scale)


@functools.cache
def _bend(half: _Half, argument: Fraction) -> tuple[Fraction, Fraction]:
    """Bounds of the function's second derivative, which is monotone, by the argument."""
    low, high = (Fraction(n, _U) for n in _ln2_u())
    unit = 1 << half.bits
    if half.function == "log2":
        square = (1 + argument / unit) ** 2 * unit
        return -1 / (low * square), -1 / (high * square)
    value = _at("exp2", half.bits, _shift_u(half), argument)
    return (
        low**2 * Fraction(value[0], _U) / unit**2,
        high**2 * Fraction(value[1], _U) / unit**2,
    )


# --- The integers of the C ---------------------------------------------------------------------


def _two(word: int, bits: int) -> int:
    return (word ^ (1 << (bits - 1))) - (1 << (bits - 1))


def _implied(half: _Half) -> int:
    """What the words of the table without extra bits contain besides the function."""
    if half.finer:
        return 0
    return -127 << 24 if half.function == "log2" else 1 << 23


def _computed(half: _Half, word: int, d: int, segment: int) -> int:
    """The corrected fraction by the C's steps, for an offset in units 2^-finer."""
    slope, curvature = _two(word % 2**32, 32), word % (1 << half.curvature_bits)
    argument = (half.zero(segment) << half.finer) + d
    if half.finer == 0:
        total = _two(word, 64) + d * (slope + half.sign * curvature * d)
        return (total >> 32) + argument - _implied(half)
    bend = (d * (curvature << (32 - half.curvature_bits))) >> 32
    total = _two(word >> 32, 32) + ((d * (slope + half.sign * bend)) >> 32)
    return (total + argument) >> half.finer


def _range_complaints(half: _Half, words: Sequence[int]) -> Iterator[str]:
    """The corrected fraction stays in range, and no step of the C leaves its type."""
    largest = (1 << half.bits) - (1 if half.function == "log2" else 0)
    for segment, word in enumerate(words):
        start = (segment * half.width - half.zero(segment)) << half.finer
        ends = (start, start + (half.width << half.finer) - half.step)
        slope, curvature = _two(word % 2**32, 32), word % (1 << half.curvature_bits)
        scaled = Fraction(curvature << (32 - half.curvature_bits), 1 << 32)
        bend = scaled if half.finer else Fraction(curvature)
        # The corrected number grows: its rate 1 + (w + 2 s bend d) / 2^32 is linear in d.
        rates = [2**32 + slope + 2 * half.sign * bend * d for d in ends]
        tilts = [slope + half.sign * bend * d for d in ends]
        if min(rates) <= 0 or not all(abs(tilt) < 2**31 - 1 for tilt in tilts):
            yield f"{half.function}: segment {segment} may fall or overflow"
        if half.finer and curvature >= 1 << (half.curvature_bits - 1):
            yield f"{half.function}: the curvature of segment {segment} is negative"
        if abs(_two(word >> 32, 32) - _implied(half)) > 2**31 - 2**28:
            yield f"{half.function}: the constant of segment {segment} is out of range"
        # Products that are rounded down on their own may be one less than they would be together.
        spare = 0 if half.finer == 0 else 1
        first, last = (_corrected(half, word, d, segment, spare) for d in ends)
        if first[0] < 0 or last[1] > largest:
            yield f"{half.function}: segment {segment} leaves its binade"


def _corrected(half: _Half, word: int, d: int, segment: int, spare: int) -> tuple[int, int]:
    """The corrected fraction at an end, and what monotony up to ``spare`` 2^-finer leaves of it."""
    if spare == 0:
        value = _computed(half, word, d, segment)
        return value, value
    slope, curvature = _two(word % 2**32, 32), word % (1 << half.curvature_bits)
    bend = Fraction(curvature << (32 - half.curvature_bits), 1 << 32)
    exact = _two(word >> 32, 32) + d * (slope + half.sign * bend * d) / 2**32
    exact += (half.zero(segment) << half.finer) + d
    # 1 for the outer product; the inner one is below 1, times an offset below 2^28, by 2^32.
    low, high = exact - 1 - Fraction(1, 16), exact + Fraction(1, 16)
    return low.__ceil__() >> half.finer, high.__floor__() >> half.finer


def _segment_complaints(
    half: _Half, segment: int, word: int, claim: Mapping[str, Any], per_unit: int
) -> Iterator[str]:
    """The bounds of quadratic less function hold on every piece of a segment."""
    pieces = 1 << (_LEAF_LEVEL - half.index)
    width = Fraction(half.width, pieces)
    for piece in range(pieces):
        k = segment * pieces + piece
        bounds = tuple(Fraction(int(claim[key][k]), per_unit) for key in ("low", "high"))
        start = segment * half.width + piece * width
        ends = tuple(_end(half, word, segment, a) for a in (start, start + width))
        if not _within(half, word, segment, ends, bounds, _DEEPEST):
            yield f"{half.function}: the bounds of piece {k} do not hold"


_End = tuple[Fraction, Fraction, Fraction]
"""An argument, and bounds of the distance there."""


def _end(half: _Half, word: int, segment: int, argument: Fraction) -> _End:
    """Quadratic less function, both with the argument added."""
    d = argument - half.zero(segment)
    slope, curvature = _two(word % 2**32, 32), word % (1 << half.curvature_bits)
    constant = (
        Fraction(_two(word, 64), 2**32) if half.finer == 0 else Fraction(_two(word >> 32, 32))
    )
    fine = constant / (1 << half.finer) - _implied(half)
    value = fine + d * (slope + half.sign * d * _curved(half, curvature)) / 2**32 + argument
    low, high = _at(half.function, half.bits, _shift_u(half), argument)
    if half.function == "exp2":
        value += 1 << half.bits
    return argument, value - Fraction(high, _U), value - Fraction(low, _U)


def _shift_u(half: _Half) -> int:
    return _U // 2 if half.function == "exp2" and half.finer == 0 else 0


def _curved(half: _Half, curvature: int) -> Fraction:
    """The curvature by which an offset in last places is multiplied."""
    if half.finer == 0:
        return Fraction(curvature)
    return Fraction(curvature << (32 - half.curvature_bits + half.finer), 1 << 32)


def _within(
    half: _Half,
    word: int,
    segment: int,
    ends: tuple[_End, ...],
    bounds: tuple[Fraction, ...],
    halvings: int,
) -> bool:
    """Whether the distance stays in the bounds between two ends."""
    (start, *first), (end, *last) = ends
    least, largest = min(first[0], last[0]), max(first[1], last[1])
    if least < bounds[0] or largest > bounds[1]:
        return False
    curved = 2 * half.sign * _curved(half, word % (1 << half.curvature_bits)) / 2**32
    bends = [b for argument in (start, end) for b in _bend(half, argument)]
    steepest = max(abs(curved - bend) for bend in bends)
    bulge = (end - start) ** 2 / 8 * steepest  # off the chord between the ends
    if least - bulge >= bounds[0] and largest + bulge <= bounds[1]:
        return True
    if halvings == 0:
        return False
    middle = _end(half, word, segment, (start + end) / 2)
    return all(
        _within(half, word, segment, part, bounds, halvings - 1)
        for part in ((ends[0], middle), (middle, ends[1]))
    )


# --- The result --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Node:
    """A dyadic interval of mantissas with the worst error in it, in units 2^-40.

    Attributes:
        low: of the mantissa, from 1 to 2.
        high: of the mantissa.
        error: for x, 2^23 (2^(eta 2^-23) - 1); for the multiplier, its error in 2^-23.
        above: the multiplier's error upward.
    """

    low: int
    high: int
    error: int
    above: int


def _up(numerator: int, denominator: int) -> int:
    return -(-numerator // denominator)


def _trees(
    certificate: Mapping[str, Any], kernel: _Kernel
) -> tuple[list[list[_Node]], list[list[_Node]]]:
    """For x and for the multiplier, the nodes of every level; level 10 are the pieces."""
    per_unit = int(certificate["per_unit"])
    count = 1 << _LEAF_LEVEL

    def in_u(value: int) -> int:
        return _up(value * _U, per_unit)

    def extra(half: _Half) -> int:
        """The products that are rounded on their own add this besides one unit."""
        return 0 if half.finer == 0 else half.width * (_U >> 32)

    leaves_x, leaves_g = [], []
    claim = certificate["log2"]
    ln2 = _ln2_u()[1]
    for k in range(count):
        worst = max(in_u(claim["high"][k]), in_u(-claim["low"][k]) + _U) + extra(kernel.log2)
        # Q24 to 2^-23: a half. Then the product's cut, off or on its centre.
        eta = _up(worst, 2) + max(kernel.shift_u, kernel.cut_u - kernel.shift_u)
        exponent = _up(eta * ln2, _U)
        error = exponent + _up(exponent * exponent, _U << 23)  # e^y - 1 <= y + y^2 for y < 1
        leaves_x.append(_Node(_U + k * _U // count, _U + (k + 1) * _U // count, error, 0))
    claim = certificate["exp2"]
    step = 1 << (23 - _LEAF_LEVEL)
    for k in range(count):
        ends = [_at("exp2", 23, kernel.shift_u, Fraction(step * n)) for n in (k, k + 1)]
        above = in_u(claim["high"][k]) + extra(kernel.exp2)
        below = in_u(-claim["low"][k]) + _U + extra(kernel.exp2)
        low, high = ends[0][0] >> 23, _up(ends[1][1], 1 << 23)
        leaves_g.append(_Node(low, high, max(above, below), max(above, 0)))
    return _levels(leaves_x), _levels(leaves_g)


def _levels(leaves: list[_Node]) -> list[list[_Node]]:
    levels = [leaves]
    while len(levels[0]) > 1:
        pairs = zip(levels[0][::2], levels[0][1::2], strict=True)
        levels.insert(
            0,
            [_Node(a.low, b.high, max(a.error, b.error), max(a.above, b.above)) for a, b in pairs],
        )
    return levels


_NEAR = _U >> 20
"""2^(eta 2^-23) is nearer to one than this, and so is the multiplier's error 2^-23."""


def _errors(x: _Node, g: _Node) -> tuple[int, int, int]:
    """The result's error in a box: in its own ulp, in the exact value's, and relative in 2^-24."""
    least, most = x.low * g.low // _U, _up(x.high * g.high, _U)
    own = exact = relative = 0
    per_exact = x.error + _up(g.error * _U, g.low)
    if least < 2 * (_U + _NEAR):
        product = min(most, 2 * (_U + _NEAR))
        mantissa = min(x.high, _up(product * _U, g.low))
        before = _up(product * x.error + mantissa * g.error, _U)
        own = before + _U // 2
        if most > 2 * (_U - _NEAR):
            exact = _up(product * x.error + mantissa * g.above, _U) + _U
        if least < _U + _NEAR:
            exact = max(exact, 2 * _up((_U + _NEAR) * (x.error + g.above), _U) + _U)
        relative = per_exact + _up(_U * _U, 2 * max(least, _U))
    if most > 2 * (_U - _NEAR):
        own = max(own, _up(most * x.error + x.high * g.error, 2 * _U) + _U // 2)
        relative = max(relative, per_exact + _up(_U * _U, max(least, 2 * _U)))
    return own, max(own, exact), 2 * _up(relative * (_U + _NEAR), _U)


def _composition_complaints(certificate: Mapping[str, Any], kernel: _Kernel) -> Iterator[str]:
    """The certificate's bounds hold in every box of mantissas."""
    tree_x, tree_g = _trees(certificate, kernel)
    if max(tree_x[0][0].error, tree_g[0][0].error) > _NEAR << 22:
        yield "the halves' errors are too large to be composed"
        return
    keys = ("ulp_hundredths", "exact_ulp_hundredths", "relative_hundredths_of_2^-24")
    claims = [int(certificate[key]) * _U // 100 for key in keys]
    todo = [(0, 0, 0)]
    while todo:
        level, i, j = todo.pop()
        errors = _errors(tree_x[level][i], tree_g[level][j])
        if all(error <= claim for error, claim in zip(errors, claims, strict=True)):
            continue
        if level == _LEAF_LEVEL:
            wrong = next(k for k, e, c in zip(keys, errors, claims, strict=True) if e > c)
            yield f"{wrong}: more in pieces {i} of x and {j} of the multiplier"
            return
        todo += [(level + 1, 2 * i + a, 2 * j + b) for a in (0, 1) for b in (0, 1)]
