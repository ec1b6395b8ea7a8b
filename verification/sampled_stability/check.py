"""Verifies a certificate of stable intervals of the sampled law; the standard library is enough.

It shares no code with what made the certificate, and takes other ways. The characteristic
polynomial comes from transfer functions derived by hand, not from the law's graph. With y = 1/z,
D = (1 - y)/L, reference 0 and torques over M:

    torque      u = -r K q + T u,   K = (KD D + KP) (1 + lambda L y/(1-y)) + lambda D + D^2 y^a
    plant       q = P u,   P = L^2/2 y^(1+c) ((1-d)^2 + (1 + 2d - 2d^2) y + d^2 y^2) / (1-y)^2
    closed loop 1 - T + r P K = 0

a is 0 for the current acceleration and 1 for the delayed one, c whole samples and d parts of a
sample are the delays, lambda L y/(1-y) is the rectangle rule of (26), whose integral takes up a
sample only after it was used, and T = y is tau(t-L). A drive that reports its torque makes it
T = y^c ((1-d) y + d y^2); the low-pass (43) multiplies r by its ratio, which is (44).

Stability at a number is the Schur-Cohn recursion in fractions. Where roots reach the unit circle
is found by the angle and not by r: with x = z + 1/z, A(z)/B(z) is real there only at the zeros of a
polynomial in x, which Sturm's theorem isolates; each has its r = -A/B.
"""

from __future__ import annotations

import itertools
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

WIDEST = Fraction(1, 10**9)
"""Of the enclosure of an end."""
_HALVINGS = 600
"""So often is an angle halved at most before it counts as undecided."""

Polynomial = list[Fraction]
"""Coefficients from the lowest power; the last one is not zero."""
_Pair = tuple[Fraction, Fraction]


def complaints(certificate: Mapping[str, Any]) -> Iterator[str]:
    """Everything that is wrong with a certificate, one sentence each; none if it is verified.

    Verified means: the loop that it names is stable for every r inside the intervals that it
    claims, unstable for every other r > 0 outside the enclosures of their ends, and each enclosure
    holds an end.

    Args:
        certificate: as JSON has it.
    """
    try:
        yield from _complaints(certificate)
    except (KeyError, TypeError, ValueError, IndexError, ZeroDivisionError) as error:
        yield f"not a certificate: {type(error).__name__} {error}"


def _complaints(certificate: Mapping[str, Any]) -> Iterator[str]:
    if unknown := set(certificate) - {"loop", "characteristic", "boundaries", "cells", "intervals"}:
        yield f"unknown entries: {', '.join(sorted(unknown))}"
    constant, ratio = _closed_loop(certificate["loop"])
    claimed = certificate["characteristic"]
    if set(claimed) != {"constant", "ratio"} or any(
        _trimmed([_number(c) for c in claimed[name]]) != own
        for name, own in (("constant", constant), ("ratio", ratio))
    ):
        yield "the characteristic polynomial is not that of the loop"
    boundaries = [_pair(b) for b in certificate["boundaries"]]
    cells = certificate["cells"]
    if len(cells) != len(boundaries) + 1:
        yield f"{len(boundaries)} boundaries, but {len(cells)} cells"
        return
    lows = [Fraction(0), *(above for _, above in boundaries)]
    for (below, above), low in zip(boundaries, lows, strict=False):
        if not low < below < above <= below + WIDEST:
            yield f"the boundary [{below}, {above}] is not narrow or not in its place"
    for k, cell in enumerate(cells):
        test, high = _number(cell["test"]), boundaries[k][0] if k < len(boundaries) else None
        if not (lows[k] < test and (high is None or test < high)):
            yield f"the test {test} is not in its cell"
        if cell["stable"] is not _is_schur(_at(constant, ratio, test)):
            yield f"the loop at r = {test} is not as claimed"
    stable = [k for k, cell in enumerate(cells) if cell["stable"] is True]
    ends = [(Fraction(0), Fraction(0)), *boundaries, None]
    if [tuple(_pair(end) for end in i) for i in certificate["intervals"]] != [
        (ends[k], ends[k + 1]) for k in stable
    ]:
        yield "the intervals are not the stable cells"
    common = _gcd(constant, ratio)
    if not _is_schur(common):
        return  # unstable for every r; a cell that is claimed stable was refuted above
    constant, ratio = (_divided(p, common)[0] for p in (constant, ratio))
    needed = {k for cell in stable for k in (cell - 1, cell) if k >= 0}
    yield from _crossing_complaints(constant, ratio, boundaries, needed)


def _crossing_complaints(
    constant: Polynomial, ratio: Polynomial, boundaries: Sequence[_Pair], needed: set[int]
) -> Iterator[str]:
    """Every r > 0 with a root on the circle is in a boundary, and the needed boundaries have one.

    Needed are those that end an interval; others may only hold zeros of the prover's polynomial.
    """
    found = set()
    for crossing in _crossings(constant, ratio):
        for low, high in crossing:
            if high <= 0:
                break
            inside = [k for k, (a, b) in enumerate(boundaries) if a <= low and high <= b]
            if inside:
                found.add(inside[0])
                break
            if low > 0 and all(high < a or b < low for a, b in boundaries):
                yield f"at r in [{float(low)}, {float(high)}] a root is on the circle"
                break
        else:
            yield "it stays open in which cell a root crosses the circle"
    for k in sorted(needed - found):
        yield f"no root crosses the circle in boundary {k}"


# --- What a certificate says -------------------------------------------------------------------


def _number(text: object) -> Fraction:
    # Fraction would also take exponents, and 1e999999999 fills the memory.
    if not isinstance(text, str) or re.fullmatch(r"-?[0-9]+(/[0-9]+)?", text) is None:
        raise TypeError(f"{text!r} is no text of a rational number")
    return Fraction(text)


def _pair(texts: Sequence[object]) -> _Pair:
    below, above = texts
    return _number(below), _number(above)


def _at(constant: Polynomial, ratio: Polynomial, r: Fraction) -> Polynomial:
    return _sum(constant, [r * c for c in ratio])


def _closed_loop(loop: Mapping[str, Any]) -> tuple[Polynomial, Polynomial]:
    """Both parts of the characteristic polynomial in z, without roots at 0."""
    known = {
        *("kd", "kp", "lambda", "sample_time_s", "acceleration", "velocity_error"),
        *("compute_delay", "torque_delay", "low_pass_ratio", "reports_torque"),
    }
    if set(loop) != known:
        raise ValueError(f"the loop has {sorted(loop)}")
    kd, kp, lam, dt, d = (
        _number(loop[key]) for key in ("kd", "kp", "lambda", "sample_time_s", "torque_delay")
    )
    filtered = Fraction(1) if loop["low_pass_ratio"] is None else _number(loop["low_pass_ratio"])
    whole, reports = loop["compute_delay"], loop["reports_torque"]
    late = {"current": 0, "delayed": 1}[loop["acceleration"]]
    sensible = (
        min(kd, kp, lam) >= 0 < dt <= 1 and 0 <= d <= 1 and 0 < filtered <= 1
        and type(whole) is int and whole in (0, 1) and type(reports) is bool
        # All three measure the loop's own motion by q(t) - q(t-L): the reference alone differs.
        and loop["velocity_error"] in ("reference-rate", "error-difference", "half-sample")
    )  # fmt: skip
    if not sensible:
        raise ValueError(f"the loop {dict(loop)} can't be")
    one, y = [Fraction(1)], [Fraction(0), Fraction(1)]
    back = [Fraction(1), Fraction(-1)]  # 1 - y
    delay = _power(y, whole)
    last = _product(delay, [Fraction(0), 1 - d, d]) if reports else y
    spring = _sum([kd * dt * c for c in back], [kp * dt**2])
    accelerated = _product(_power(back, 2), _power(y, late))
    # K L^2, times 1 - y where s is in the loop.
    if lam == 0:
        law, integrators = _sum(spring, accelerated), 2
    else:
        summed = _sum(back, [lam * dt * c for c in y])
        proportional = [lam * dt * c for c in _power(back, 2)]
        law = _sum(_product(spring, summed), proportional)
        law, integrators = _sum(law, _product(accelerated, back)), 3
    moved = _product(y, [(1 - d) ** 2, 1 + 2 * d - 2 * d**2, d**2])
    loop_gain = [filtered / 2 * c for c in _product(_product(delay, moved), law)]
    open_loop = _product(_sum(one, [-c for c in last]), _power(back, integrators))
    size = max(len(open_loop), len(loop_gain))
    in_z = [_trimmed([Fraction(0)] * (size - len(p)) + p[::-1]) for p in (open_loop, loop_gain)]
    return in_z[0], in_z[1]


# --- Polynomials in fractions ------------------------------------------------------------------


def _trimmed(p: Sequence[Fraction]) -> Polynomial:
    size = len(p)
    while size and p[size - 1] == 0:
        size -= 1
    return list(p[:size])


def _sum(p: Sequence[Fraction], q: Sequence[Fraction]) -> Polynomial:
    size = max(len(p), len(q))
    padded = ([*side, *[Fraction(0)] * (size - len(side))] for side in (p, q))
    return _trimmed([a + b for a, b in zip(*padded, strict=True)])


def _product(p: Sequence[Fraction], q: Sequence[Fraction]) -> Polynomial:
    made = [Fraction(0)] * (len(p) + len(q))
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            made[i + j] += a * b
    return _trimmed(made)


def _power(p: Sequence[Fraction], exponent: int) -> Polynomial:
    return _product(_power(p, exponent - 1), p) if exponent else [Fraction(1)]


def _divided(p: Polynomial, q: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Quotient and remainder."""
    quotient, rest = [Fraction(0)] * max(len(p) - len(q) + 1, 0), list(p)
    for k in reversed(range(len(quotient))):
        quotient[k] = rest[k + len(q) - 1] / q[-1]
        for j, c in enumerate(q):
            rest[k + j] -= quotient[k] * c
    return _trimmed(quotient), _trimmed(rest)


def _gcd(p: Polynomial, q: Polynomial) -> Polynomial:
    while q:
        p, q = q, _divided(p, q)[1]
    return [c / p[-1] for c in p]


def _value(p: Polynomial, x: Fraction) -> Fraction:
    value = Fraction(0)
    for c in reversed(p):
        value = value * x + c
    return value


def _range(p: Polynomial, low: Fraction, high: Fraction) -> _Pair:
    """Bounds of the values between two numbers, by Horner's scheme for intervals."""
    least = most = Fraction(0)
    for c in reversed(p):
        products = [a * b for a in (least, most) for b in (low, high)]
        least, most = min(products) + c, max(products) + c
    return least, most


def _is_schur(p: Polynomial) -> bool:
    """Whether all roots lie inside the unit circle: the Schur-Cohn recursion."""
    while len(p) > 1:
        if abs(p[0]) >= abs(p[-1]):
            return False
        k = p[0] / p[-1]
        p = [a - k * b for a, b in zip(p, reversed(p), strict=True)][1:]
    return True


# --- Where roots reach the unit circle ---------------------------------------------------------


def _crossings(constant: Polynomial, ratio: Polynomial) -> Iterator[Iterator[_Pair]]:
    """For each root on the circle, ever narrower enclosures of the r where that happens."""
    for z in (Fraction(1), Fraction(-1)):
        slope = _value(ratio, z)
        if slope != 0:
            r = -_value(constant, z) / slope
            yield iter([(r, r)])
    real, odd = _on_circle(constant, ratio)
    square, _ = _on_circle(ratio, ratio)
    odd = _divided(odd, _gcd(odd, _derivative(odd)))[0]
    for low, high in _isolated(odd):
        yield _ratios(odd, low, high, real, square)


def _on_circle(p: Polynomial, q: Polynomial) -> tuple[Polynomial, Polynomial]:
    """p(z) q(1/z) on |z| = 1 as e(x) + (z - 1/z) o(x), with x = z + 1/z."""
    size = max(len(p), len(q))
    by_power = [Fraction(0)] * (2 * size - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            by_power[size - 1 + i - j] += a * b
    even: Polynomial = [by_power[size - 1]]
    odd: Polynomial = []
    # z^k + z^-k and (z^k - z^-k)/(z - 1/z) follow Chebyshev's recursion in x.
    x = [Fraction(0), Fraction(1)]
    sums: tuple[Polynomial, Polynomial] = ([Fraction(2)], x)
    differences: tuple[Polynomial, Polynomial] = ([], [Fraction(1)])
    for k in range(1, size):
        plus, minus = by_power[size - 1 + k], by_power[size - 1 - k]
        even = _sum(even, [(plus + minus) / 2 * c for c in sums[1]])
        odd = _sum(odd, [(plus - minus) / 2 * c for c in differences[1]])
        sums, differences = (
            (pair[1], _sum(_product(x, pair[1]), [-c for c in pair[0]]))
            for pair in (sums, differences)
        )
    return even, odd


def _derivative(p: Polynomial) -> Polynomial:
    return [k * c for k, c in enumerate(p)][1:]


def _isolated(p: Polynomial) -> Iterator[_Pair]:
    """Intervals (low, high] with one zero each, of all zeros in (-2, 2], by Sturm's theorem."""
    chain = [p, _derivative(p)]
    while len(chain[-1]) > 1:
        chain.append([-c for c in _divided(chain[-2], chain[-1])[1]])

    def changes(x: Fraction) -> int:
        signs = [v > 0 for v in (_value(q, x) for q in chain) if v != 0]
        return sum(a != b for a, b in itertools.pairwise(signs))

    waiting = [(Fraction(-2), Fraction(2))]
    while waiting:
        low, high = waiting.pop()
        zeros = changes(low) - changes(high)
        if zeros == 1:
            yield low, high
        elif zeros > 1:
            middle = (low + high) / 2
            waiting += [(low, middle), (middle, high)]


def _ratios(
    p: Polynomial, low: Fraction, high: Fraction, real: Polynomial, square: Polynomial
) -> Iterator[_Pair]:
    """Enclosures of r = -Re(A conj B)/|B|^2 at the one zero of p in (low, high]."""
    at_high = _value(p, high)
    for _ in range(_HALVINGS):
        if at_high == 0:
            low = high
        else:
            middle = (low + high) / 2
            at_middle = _value(p, middle)
            if at_middle == 0 or (at_middle > 0) == (at_high > 0):
                high, at_high = middle, at_middle
            else:
                low = middle
        top, bottom = _range(real, low, high), _range(square, low, high)
        if bottom[0] > 0:
            quotients = [-a / b for a in top for b in bottom]
            yield min(quotients), max(quotients)


def main(arguments: Sequence[str]) -> int:
    """Checks the files that are named; returns 0, 1 where one is not verified, 2 for no file."""
    if not arguments:
        print("usage: python -m verification.sampled_stability.check FILE...", file=sys.stderr)
        return 2
    worst = 0
    for name in arguments:
        try:
            found = list(complaints(json.loads(Path(name).read_text(encoding="utf-8"))))
        except (OSError, ValueError) as error:
            print(f"error: {name}: {error}: give a file of --certificate", file=sys.stderr)
            return 2
        print("\n".join([f"{name}: {'verified' if not found else 'NOT verified'}", *found]))
        worst = max(worst, 1 if found else 0)
    return worst


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
