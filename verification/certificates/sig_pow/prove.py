"""Bounds of sig_pow's error for every exponent and every normal float, by Arb's ball arithmetic.

The argument, with |x| = 2^e X, X = 1 + m, b = a - 1 and the exact value E = X 2^(e + b log2|x|):

1. L, the C's log2|x| in Q24, is off by ``error_L`` units: what the quadratic is away from the
   function, enclosed piece by piece, and the roundings down.
2. The product b L is rounded down to z. By the exact value's exponent, z stands for ``eta``
   units too much, |eta| <= |error_L| 2^(23 - 24) + what was cut off.
3. The C's multiplier is 2^n (G + error_G 2^-23), with G = 2^f in [1, 2] and f the fraction of z.
4. The result is the multiplier times x, rounded to nearest. In units S 2^-23, S = 2^(e + n),
   the product before that is off by D = X (G theta + error_G), |theta| <= T = 2^23 (2^(|eta|
   2^-23) - 1).
5. The last place of the result y is one such unit where y is in [S, 2S), and two in [2S, 4S).
   That of E is the same but near a power of two: where E lies below it and y above, E's is half
   as large, and the rounding may be a whole one of these; then D > 0.

Pieces of x and of the multiplier are combined each with each, in integers with outward rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from flint import arb, ctx
from numpy.typing import NDArray

from verification.certificates.sig_pow.kernel import (
    MANTISSA_BITS,
    Correction,
    GeneratedKernel,
    Kernel,
)
from verification.evidence import Evidence

Integers = NDArray[np.int64]

PIECES = 1024
"""Of [0, 1), for m as for f; a segment has 16 or 8 of them."""

_PARTS = 4
"""Of a piece: a shorter interval makes a narrower enclosure."""

PER_UNIT = 4096
"""Bounds of the distance to the function are multiples of 1/4096 unit."""

_PRECISION_BITS = 100
_SCALE = 20
_ONE = 1 << _SCALE
_SLACK = 1
"""In units 2^-20: how far 2^(|eta| 2^-23), and X G beside what the C multiplies, are from 1."""
_LARGEST_ERROR = 4
"""Of a half, in units 2^-23: more would need more slack, and is beyond every use."""

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
LEAST_EXPONENT_UNCLAMPED = Fraction(1, 64)
"""From this exponent on the multiplier is never below 2^-126 (the header: 0.016)."""


@dataclass(frozen=True)
class Quadratic:
    """``constant + linear d + quadratic d^2`` in units of the last place, and the slope's bits."""

    constant: Fraction
    linear: Fraction
    quadratic: Fraction
    slope: int
    curvature: int

    def __call__(self, d: Fraction) -> Fraction:
        """The value at an offset."""
        return self.constant + d * (self.linear + d * self.quadratic)

    def plus_argument(self, origin: int) -> Quadratic:
        """The argument itself added: the corrected number."""
        return Quadratic(
            self.constant + origin, self.linear + 1, self.quadratic, self.slope, self.curvature
        )


@dataclass(frozen=True)
class Half:
    """One of the two integer halves: how far the quadratics are from the function.

    Attributes:
        low: for each piece, a bound from below of quadratic less function, in 1/4096 unit.
        high: the same from above.
    """

    low: tuple[int, ...]
    high: tuple[int, ...]


@dataclass(frozen=True)
class Composition:
    """The largest error of a result, and the pieces of m and f that it stems from.

    Attributes:
        ulp: in units of the result's last place.
        exact_ulp: in units of the exact value's last place.
        relative: in units 2^-24 of the exact value.
        ulp_piece: where the first one is.
        relative_piece: where the last one is.
    """

    ulp: Fraction
    exact_ulp: Fraction
    relative: Fraction
    ulp_piece: tuple[int, int]
    relative_piece: tuple[int, int]


@dataclass(frozen=True)
class Statement:
    """A claim about the kernel, and what it rests on.

    Attributes:
        name: an identifier.
        says: the claim, with its hypotheses.
        bound: the number that was found, with its unit, for people.
        evidence: proved, exhaustive or sampled.
        holds: whether it is so.
    """

    name: str
    says: str
    bound: str
    evidence: Evidence
    holds: bool


@dataclass(frozen=True)
class Proof:
    """All that is proved of a kernel.

    Attributes:
        generated: the kernel.
        log2: bounds for the logarithm.
        exp2: bounds for the power of two.
        composition: the result's error.
        statements: what that proves.
    """

    generated: GeneratedKernel
    log2: Half
    exp2: Half
    composition: Composition
    statements: tuple[Statement, ...]

    @property
    def holds(self) -> bool:
        """Whether every statement does."""
        return all(s.holds for s in self.statements)


def prove(generated: GeneratedKernel) -> Proof:
    """Proves a kernel's bounds, or finds which statement does not hold; about a second."""
    kernel = generated.kernel
    precision = ctx.prec
    ctx.prec = _PRECISION_BITS
    try:
        log2 = enclose(kernel.log2, generated.log2, _Log2(kernel.log2))
        exp2 = enclose(kernel.exp2, generated.exp2, _Exp2(kernel.exp2))
        composition = compose(kernel, log2, exp2)
        statements = (
            *_integer_statements(generated),
            *_half_statements(kernel, log2, exp2),
            *_final_statements(generated, composition),
        )
    finally:
        ctx.prec = precision
    return Proof(generated, log2, exp2, composition, statements)


# --- The quadratics and their functions --------------------------------------------------------


def _signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) else value


def quadratic(stage: Correction, word: int) -> Quadratic:
    """The exact quadratic of a table's word, as if nothing were rounded."""
    high, low = _signed(word >> 32, 32), word % 2**32
    slope, curvature = _signed(low, 32), low % (1 << stage.curvature_bits)
    fraction = Fraction(low, 1 << 32) if stage.tied else Fraction(0)
    return Quadratic(
        constant=(high + fraction) / (1 << stage.extra_bits),
        linear=Fraction(slope, 1 << 32),
        quadratic=stage.sign * Fraction(curvature, 1 << stage.curvature_scale),
        slope=slope,
        curvature=curvature,
    )


def _offsets(stage: Correction, segment: int) -> tuple[Fraction, Fraction]:
    """The first and the last offset of a segment."""
    first = Fraction(segment * stage.width - stage.origin(segment))
    return first, first + stage.width - stage.step


def _extremes(q: Quadratic, first: Fraction, last: Fraction) -> tuple[Fraction, Fraction]:
    """The least and the largest value between two offsets, the vertex included."""
    values = [q(first), q(last)]
    if q.quadratic:
        vertex = -q.linear / (2 * q.quadratic)
        if first < vertex < last:
            values.append(q(vertex))
    return min(values), max(values)


def _ball(value: Fraction) -> arb:
    return arb(value.numerator) / value.denominator


def round_down(ball: arb) -> int:
    """The largest integer that no number of a ball is below.

    Raises:
        ValueError: the ball has no ends.
    """
    whole = ball.lower().floor().unique_fmpz()
    if whole is None:
        raise ValueError(f"not a bound: {ball}")
    return int(whole)


def round_up(ball: arb) -> int:
    """The least integer that no number of a ball is above."""
    return -round_down(-ball)


class _Log2:
    """2^24 (log2(1 + m) - m) and its derivatives by the argument, m = argument 2^-24."""

    def __init__(self, stage: Correction) -> None:
        self._unit = 1 << stage.fraction_bits
        self._added = stage.added
        self._ln2 = arb(2).log()

    def value(self, argument: arb) -> arb:
        m = argument / self._unit
        return ((1 + m).log() / self._ln2 - m) * self._unit + self._added

    def slope(self, argument: arb) -> arb:
        return 1 / (self._ln2 * (1 + argument / self._unit)) - 1

    def bend(self, argument: arb) -> arb:
        return -1 / (self._ln2 * (1 + argument / self._unit) ** 2) / self._unit


class _Exp2:
    """2^23 (2^f - 1) less the argument, and derivatives; f = (argument + shift) 2^-23."""

    def __init__(self, stage: Correction) -> None:
        self._unit = 1 << stage.fraction_bits
        self._shift = _ball(stage.argument_shift)
        self._added = stage.added
        self._ln2 = arb(2).log()

    def power(self, argument: arb) -> arb:
        return ((argument + self._shift) / self._unit * self._ln2).exp()

    def value(self, argument: arb) -> arb:
        return (self.power(argument) - 1) * self._unit - argument + self._added

    def slope(self, argument: arb) -> arb:
        return self._ln2 * self.power(argument) - 1

    def bend(self, argument: arb) -> arb:
        return self._ln2**2 * self.power(argument) / self._unit


def enclose(stage: Correction, words: tuple[int, ...], function: _Log2 | _Exp2) -> Half:
    """Quadratic less function on every piece, by Taylor's formula of second order.

    Around a middle ``d0`` the distance is ``h(d0) + h'(d0) s + h''(d) s^2 / 2`` with a ``d``
    between, and all three are balls.
    """
    low, high = [], []
    per_segment = PIECES // stage.segments
    radius = Fraction(stage.width, 2 * _PARTS * per_segment)
    steps, half_square = arb(0, float(radius)), _ball(radius**2 / 4)
    squares = half_square + half_square * arb(0, 1)  # s^2 / 2
    for segment, word in enumerate(words):
        q, origin = quadratic(stage, word), stage.origin(segment)
        first = segment * stage.width - origin
        quadratic_term = 2 * _ball(q.quadratic)
        lows, highs = [], []
        for part in range(per_segment * _PARTS):
            d = first + (2 * part + 1) * radius
            argument = _ball(origin + d)
            distance = _ball(q(d)) - function.value(argument)
            tilt = _ball(q.linear + 2 * q.quadratic * d) - function.slope(argument)
            bend = quadratic_term - function.bend(argument + steps)
            range_ = (distance + tilt * steps + bend * squares) * PER_UNIT
            lows.append(round_down(range_))
            highs.append(round_up(range_))
        for start in range(0, len(lows), _PARTS):
            low.append(min(lows[start : start + _PARTS]))
            high.append(max(highs[start : start + _PARTS]))
    return Half(tuple(low), tuple(high))


# --- Integer ranges ----------------------------------------------------------------------------


def _floor(value: Fraction) -> int:
    return value.numerator // value.denominator


def corrected_range(stage: Correction, word: int, segment: int) -> tuple[int, int]:
    """The least and the largest corrected fraction of a segment, without what the table adds."""
    q = quadratic(stage, word).plus_argument(stage.origin(segment))
    least, largest = _extremes(q, *_offsets(stage, segment))
    below, above = stage.rounding
    # The integer is greater than least + below, and not greater than largest + above.
    return _floor(least + below) + 1 - stage.added, _floor(largest + above) - stage.added


def fits_its_words(stage: Correction, word: int, segment: int) -> bool:
    """Whether no intermediate value of a segment leaves the C's type."""
    q = quadratic(stage, word)
    first, last = _offsets(stage, segment)
    scale = 1 << stage.extra_bits
    bend = q.curvature * Fraction(scale, 1 << (stage.curvature_scale - 32 + stage.extra_bits))
    tilts = [q.slope + stage.sign * bend * d for d in (first, last)]
    in_int32 = all(INT32_MIN + 1 <= tilt <= INT32_MAX - 1 for tilt in tilts)
    if stage.tied:
        # 64-bit sums of less than 2^63: the constant's words are far from their ends.
        least, largest = _extremes(q, first, last)
        return in_int32 and least > INT32_MIN and largest < INT32_MAX
    least, largest = _extremes(q, first, last)
    sums = (least * scale - 2 * scale, largest * scale + 2 * scale)
    positive = q.curvature < 1 << (stage.curvature_bits - 1)  # shifted up, it is no sign
    return in_int32 and positive and sums[0] > INT32_MIN and sums[1] < INT32_MAX


def _integer_statements(generated: GeneratedKernel) -> Iterator[Statement]:
    kernel = generated.kernel
    log2, exp2 = kernel.log2, kernel.exp2
    fits = all(
        fits_its_words(stage, word, segment)
        for stage, words in ((log2, generated.log2), (exp2, generated.exp2))
        for segment, word in enumerate(words)
    )
    ranges = [corrected_range(log2, word, i) for i, word in enumerate(generated.log2)]
    least, largest = min(r[0] for r in ranges), max(r[1] for r in ranges)
    unit = 1 << log2.fraction_bits
    log2_good = least >= 0 and largest <= unit - 1
    yield Statement(
        "log2_range",
        "The logarithm of 2^e (1 + m) is an integer in [e, e + 1) 2^24, an int32 for every normal "
        "x; no product or sum before it leaves its type.",
        f"fraction {least} to {largest} of {unit}",
        Evidence.PROVED,
        fits and log2_good,
    )
    # b L at the corners: L from -126 2^24 to 128 2^24 - 1, b from -2^31 to 2^31 - 1.
    logarithms = (-126 * unit, 128 * unit - 1)
    products = [b * logarithm for b in (INT32_MIN, INT32_MAX) for logarithm in logarithms]
    fields = [(p >> 32) + (126 << MANTISSA_BITS) for p in products]
    lowest_unclamped = min(
        INT32_MIN * (126 * unit - 1),
        int((LEAST_EXPONENT_UNCLAMPED - 1) * 2**31) * (128 * unit - 1),
    )
    yield Statement(
        "product_range",
        "The product is an int64 and the exponent field an int32, at most 254 2^23.",
        f"product up to 2^{math.log2(max(abs(p) for p in products)):.0f}",
        Evidence.PROVED,
        log2_good
        and all(abs(p) < 2**63 for p in products)
        and all(INT32_MIN <= f <= 254 << MANTISSA_BITS for f in fields),
    )
    yield Statement(
        "not_clamped",
        f"The field is never clamped at zero for |x| < 2^126, nor for a >= "
        f"{LEAST_EXPONENT_UNCLAMPED}.",
        f"least field {(lowest_unclamped >> 32) + (126 << MANTISSA_BITS)}",
        Evidence.PROVED,
        log2_good and (lowest_unclamped >> 32) + (126 << MANTISSA_BITS) >= 0,
    )
    exp2_implicit = (1 << MANTISSA_BITS) - exp2.added
    ranges = [corrected_range(exp2, word, i) for i, word in enumerate(generated.exp2)]
    least, largest = min(r[0] for r in ranges), max(r[1] for r in ranges)
    whole = 1 << MANTISSA_BITS
    yield Statement(
        "exp2_carry",
        "The corrected fraction is from 0 to 2^23: a carry into the exponent leaves a mantissa of "
        "zero and is exact. The multiplier is a normal float wherever the exact value is one.",
        f"fraction {least} to {largest} of {whole}",
        Evidence.PROVED,
        fits and least >= 0 and largest <= whole and exp2_implicit in (0, whole),
    )
    # Where the clamp holds the field is zero; bits behind it may be any.
    q, rest = quadratic(exp2, generated.exp2[0]), 1 - exp2.step
    below, above = exp2.rounding
    clamped = _extremes(q.plus_argument(0), Fraction(0), rest)
    excess = (
        _floor(clamped[0] + (below if exp2.step < 1 else 0)) + (1 if exp2.step < 1 else 0),
        _floor(clamped[1] + above),
    )
    excess = (excess[0] - exp2.added, excess[1] - exp2.added)
    yield Statement(
        "clamped",
        "Where the field is clamped, the result is x 2^-126, rounded; it is from 1 to 4.",
        f"multiplier from {excess[0]} to {excess[1]} ulp above 2^-126",
        Evidence.PROVED,
        excess[0] == 0 and excess[1] <= 1,
    )


# --- Error bounds ------------------------------------------------------------------------------


def _half_statements(kernel: Kernel, log2: Half, exp2: Half) -> Iterator[Statement]:
    for name, stage, half in (("log2", kernel.log2, log2), ("exp2", kernel.exp2, exp2)):
        low, high = Fraction(min(half.low), PER_UNIT), Fraction(max(half.high), PER_UNIT)
        below, above = stage.rounding
        meaning = "log2|x| in Q24" if name == "log2" else "the multiplier's bits"
        yield Statement(
            f"{name}_error",
            f"The error of {meaning}: quadratic {float(low):.4f} to {float(high):.4f}, and the "
            f"rounding down {float(below):.4f} to {float(above):.4f}.",
            f"{float(low + below):.4f} to {float(high + above):.4f} units",
            Evidence.PROVED,
            max(-low - below, high + above) <= _LARGEST_ERROR,
        )
        if name == "log2":
            cut, centre = _product_cut(kernel)
            yield Statement(
                "product_error",
                f"(a - 1) log2|x| is cut off after {kernel.product.fraction_bits} bits.",
                f"{float(-cut):.4f} to 0 units 2^-23, centred by {float(centre):.4f}",
                Evidence.PROVED,
                0 <= centre <= cut <= 1,
            )


def _product_cut(kernel: Kernel) -> tuple[Fraction, Fraction]:
    """What the product's rounding down takes off at most, and what the table puts on for it."""
    return Fraction(1, 1 << (kernel.product.fraction_bits - MANTISSA_BITS)), (
        kernel.exp2.argument_shift
    )


def _up(value: Fraction | arb, scale: int = _ONE) -> int:
    """In units 1 / scale, rounded up."""
    if isinstance(value, Fraction):
        return -_floor(-value * scale)
    return round_up(value * scale)


def compose(kernel: Kernel, log2: Half, exp2: Half) -> Composition:
    """The result's error over all pairs of pieces, in integers, in units 2^-20, rounded up."""
    cut, centre = _product_cut(kernel)
    ln2 = arb(2).log()
    below, above = kernel.log2.rounding
    per_unit = Fraction(1 << MANTISSA_BITS, 1 << kernel.log2.fraction_bits)
    theta = []
    for low, high in zip(log2.low, log2.high, strict=True):
        error = max(abs(Fraction(low, PER_UNIT) + below), abs(Fraction(high, PER_UNIT) + above))
        eta = error * per_unit + max(centre, cut - centre)
        # 2^23 (2^(eta 2^-23) - 1); expm1 keeps the leading digits.
        exponent = _ball(eta) * ln2 / (1 << MANTISSA_BITS)
        theta.append(_up(exponent.expm1() * (1 << MANTISSA_BITS)))
    below, above = kernel.exp2.rounding
    upper = [_up(Fraction(h, PER_UNIT) + above) for h in exp2.high]
    lower = [_up(-Fraction(v, PER_UNIT) - below) for v in exp2.low]
    if max(theta + upper + lower) > _LARGEST_ERROR * _ONE:
        worst = Fraction(1 << MANTISSA_BITS)
        return Composition(worst, worst, 2 * worst, (0, 0), (0, 0))
    T = np.array(theta, dtype=np.int64)[:, None]
    U = np.array(upper, dtype=np.int64)[None, :]
    W = np.maximum(U, np.array(lower, dtype=np.int64)[None, :])

    steps = np.arange(PIECES, dtype=np.int64)
    X_low, X_high = ((PIECES + steps) << 10)[:, None], ((PIECES + steps + 1) << 10)[:, None]
    power = _Exp2(kernel.exp2).power
    width = 1 << (MANTISSA_BITS - 10)
    G_low = np.array(
        [round_down(power(arb(k * width)) * _ONE) for k in range(PIECES)],
        dtype=np.int64,
    )[None, :]
    G_high = np.array([_up(power(arb((k + 1) * width))) for k in range(PIECES)], dtype=np.int64)[
        None, :
    ]

    def units(product: Integers) -> Integers:
        """A product of two such numbers in the same units, rounded up."""
        return -(-product // _ONE)

    two, half = 2 * _ONE, _ONE // 2
    slack = 2 * _SLACK
    P_low, P_high = X_low * G_low // _ONE, units(X_high * G_high)
    # Results in [S, 2S): X G is below 2 but for the slack.
    P = np.minimum(P_high, two + slack)
    X = np.minimum(X_high, -(-((two + slack) << _SCALE) // G_low))
    low_ulp = units(P * T) + units(X * W) + half
    low_ulp = np.where(P_low < two + slack, low_ulp, 0)
    # Results in [2S, 4S]: twice the unit.
    high_ulp = units((P_high * T + X_high * W) // 2 + 1) + half
    high_ulp = np.where(P_high > two - slack, high_ulp, 0)
    ulp = np.maximum(low_ulp, high_ulp)
    # E below 2S and the result above: the rounding is a whole unit.
    across = units(P * T) + np.maximum(units(X * U), 0) + _ONE
    across = np.where((P_high >= two - slack) & (P_low < two + slack), across, 0)
    # E below S, where X and G are 1 but for the slack: half the unit.
    one = _ONE + slack
    under = 2 * (units(one * T) + np.maximum(units(one * U), 0)) + _ONE
    under = np.where(P_low <= one, under, 0)
    exact_ulp = max(int(errors.max()) for errors in (ulp, across, under))

    # Relative to E, in units 2^-23, with (1 + slack) for E in place of S X G.
    base = T + -(-(W << _SCALE) // G_low)
    low_rounding = -(-(half << _SCALE) // np.maximum(_ONE, P_low))
    high_rounding = -(-(_ONE << _SCALE) // np.maximum(two, P_low))
    rounding = np.maximum(
        np.where(P_low < two + slack, low_rounding, 0),
        np.where(P_high > two - slack, high_rounding, 0),
    )
    relative = units((base + rounding) * (_ONE + slack)) * 2
    return Composition(
        ulp=Fraction(int(ulp.max()), _ONE),
        exact_ulp=Fraction(exact_ulp, _ONE),
        relative=Fraction(int(relative.max()), _ONE),
        ulp_piece=_place(ulp),
        relative_piece=_place(relative),
    )


def _place(errors: Integers) -> tuple[int, int]:
    i, j = np.unravel_index(int(errors.argmax()), errors.shape)
    return int(i), int(j)


def at_most_power_of_two(value: Fraction, exponent: Fraction) -> bool:
    """``value <= 2^exponent``, exactly, for a rational exponent."""
    power = value**exponent.denominator
    n = exponent.numerator
    return power <= (Fraction(1 << n) if n >= 0 else Fraction(1, 1 << -n))


def _final_statements(generated: GeneratedKernel, found: Composition) -> Iterator[Statement]:
    stated = generated.stated
    yield Statement(
        "ulp",
        "For every a in [0, 2) that is exact in Q31, every normal x and every normal exact value, "
        f"the error is at most {float(stated.ulp):.2f} units of the result's last place; but where "
        "the field is clamped, and where the result overflows.",
        f"{float(found.ulp):.4f} ulp",
        Evidence.PROVED,
        found.ulp <= stated.ulp,
    )
    relative = found.relative / (1 << 24)
    yield Statement(
        "relative",
        f"There, too, the relative error is at most 2^{float(stated.relative_log2):.2f}.",
        f"2^{math.log2(relative):.4f}",
        Evidence.PROVED,
        at_most_power_of_two(relative, stated.relative_log2),
    )
    yield Statement(
        "exact_ulp",
        "In units of the exact value's last place it may be half a unit more: the last place is "
        "half as large where the exact value lies just below a power of two and the result above.",
        f"{float(found.exact_ulp):.4f} ulp",
        Evidence.PROVED,
        found.exact_ulp <= stated.ulp + Fraction(1, 2),
    )
    reach = math.ceil(found.ulp)
    yield Statement(
        "no_early_overflow",
        f"The result is finite where the exact value is at most 2^128 - {reach} 2^104.",
        f"before rounding {float(found.ulp - Fraction(1, 2)):.4f} 2^104 more at most",
        Evidence.PROVED,
        # From 2^128 - 2^103 on, a product is rounded to infinity.
        found.ulp - Fraction(1, 2) < reach - Fraction(1, 2),
    )
    # |a - q| <= 2^-32 turns the exact value by 2^(2^-32 |log2 x|) at most, |log2 x| <= 128.
    turn = arb(2).log() / 2**32
    each = (turn * 128).expm1() / 128 * 2**24
    yield Statement(
        "exponent_rounding",
        "An exponent that was rounded to Q31 by 2^-32 changes the exact value by at most "
        f"{float(stated.exponent_rounding):.4f} |log2 x| ulp.",
        f"{float(each.upper()):.7f} |log2 x| ulp",
        Evidence.PROVED,
        bool(each <= _ball(stated.exponent_rounding)),
    )


# --- The certificate ---------------------------------------------------------------------------


def certificate(proof: Proof) -> dict[str, object]:
    """What the checker verifies: words, bounds of every piece, and the result's error."""
    generated = proof.generated

    def half(words: tuple[int, ...], bounds: Half) -> dict[str, object]:
        return {
            "words": [f"{word:016X}" for word in words],
            "low": list(bounds.low),
            "high": list(bounds.high),
        }

    def hundredths(value: Fraction) -> int:
        return _up(value, 100)

    stated = generated.stated
    return {
        "function": generated.kernel.function,
        "body_sha256": generated.body_sha256,
        "per_unit": PER_UNIT,
        "log2": half(generated.log2, proof.log2),
        "exp2": half(generated.exp2, proof.exp2),
        "ulp_hundredths": hundredths(proof.composition.ulp),
        "exact_ulp_hundredths": hundredths(proof.composition.exact_ulp),
        "relative_hundredths_of_2^-24": hundredths(proof.composition.relative),
        "stated": {
            "ulp": str(stated.ulp),
            "relative_log2": str(stated.relative_log2),
            "exponent_rounding": str(stated.exponent_rounding),
        },
    }
