"""The compiled power for integers against mpmath and extended precision, and its special cases."""

from __future__ import annotations

import ctypes
import math
import re
import shutil
import subprocess
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from codegen import sig_pow_fixed
from codegen.sig_pow import PAPER_EXPONENTS
from codegen.sig_pow_fixed import (
    EXP2,
    LOG2,
    MAGNITUDE_MAX,
    ZERO_GAIN,
    FixedPower,
    Form,
    fixed_power,
    magnitude_bound,
    tables,
)
from tests.toolchain import WARNINGS, run

Signed = NDArray[np.int32]
Unsigned = NDArray[np.uint32]
Extended = NDArray[np.longdouble]

DRIVER = Path(__file__).with_name("sig_pow_fixed_driver.c")
MAX_RELATIVE = 2.0**-21.5
HALF_A_UNIT = 0.5
REFERENCE_ERROR = 2.0**-50
"""More than extended precision loses in log2, product and exp2, relative to the result."""

INT32_MIN = -(2**31)
EXPONENTS = ("0", "1", *PAPER_EXPONENTS, "1.9", "1.999999")
GAINS = ("1e-9", "1e-5", "0.0125", "1", "3", "12.5", "400", "1e5", "1e9", "1e15")
CORES = ("cortex-m0plus", "cortex-m3")
DIGESTED = 300_000
"""Powers and products that each emulated core computes."""

SHORT_MULTIPLY = "-DTDC_NO_LONG_MULTIPLY"


@dataclass(frozen=True)
class Kernel:
    """The functions of one compiled driver, over arrays."""

    library: ctypes.CDLL

    def power(self, x: Signed, stored: FixedPower | tuple[Unsigned, Signed]) -> Signed:
        """gain |x|^a sgn(x)."""
        exponent, scale = stored
        exponents, scales = np.asarray(exponent, np.uint32), np.asarray(scale, np.int32)
        return self._call("power_batch", x, exponents, scales).view(np.int32)

    def scale(self, x: Signed, factor: Signed, shift: Unsigned) -> Signed:
        """x factor / 2^shift."""
        return self._call("scale_batch", x, factor, shift).view(np.int32)

    def multiply_high(self, a: Unsigned, b: Unsigned) -> Unsigned:
        """The high word of the product."""
        return self._call("multiply_high_batch", a, b)

    def leading_zeros(self, x: Unsigned) -> Unsigned:
        """The zero bits above the highest set bit."""
        return self._call("leading_zeros_batch", x)

    def _call(self, name: str, *arguments: Signed | Unsigned) -> Unsigned:
        columns = [np.ascontiguousarray(v) for v in np.broadcast_arrays(*arguments)]
        result = np.empty(columns[0].shape, np.uint32)
        pointers = [ctypes.c_void_p(v.ctypes.data) for v in (*columns, result)]
        getattr(self.library, name)(*pointers, ctypes.c_size_t(result.size))
        return result


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("sig_pow_fixed")
    sig_pow_fixed.render(directory)
    return directory


def build(sources: Path, output: str, compiler: str, *flags: str) -> Path:
    inputs = (sources / "tdc_fixed.c", DRIVER)
    run(compiler, *WARNINGS, *flags, f"-I{sources}", *inputs, "-o", sources / output)
    return sources / output


def shared(sources: Path, output: str, compiler: str, *flags: str) -> Kernel:
    library = build(sources, output, compiler, *flags, "-fPIC", "-shared")
    return Kernel(ctypes.CDLL(str(library)))


@pytest.fixture(scope="session")
def kernel(sources: Path) -> Kernel:
    return shared(sources, "plain.so", "cc", "-O2")


@pytest.fixture(scope="session")
def short_kernel(sources: Path) -> Kernel:
    """As a core has it that neither multiplies to 64 bits nor counts leading zeros."""
    return shared(sources, "short.so", "cc", "-O2", SHORT_MULTIPLY)


def corners() -> Signed:
    """All small integers, and both sides of every power of two."""
    powers = 2 ** np.arange(1, 32, dtype=np.int64)
    magnitudes = np.concatenate([np.arange(2000), powers - 1, powers, powers + 1])
    both = np.unique(np.concatenate([magnitudes, -magnitudes]))
    return both[(both >= INT32_MIN) & (both < 2**31)].astype(np.int32)


def any_integers(rng: np.random.Generator, count: int) -> Signed:
    """Integers of every size, so that every binade gets its share."""
    full = rng.integers(INT32_MIN, 2**31, count, dtype=np.int64)
    return (full >> rng.integers(0, 31, count)).astype(np.int32)


def any_powers(rng: np.random.Generator, x: Signed) -> tuple[Unsigned, Signed]:
    """Every exponent, with gains that bring most results into the integers' range."""
    exponent = rng.integers(0, 2**32, x.size, dtype=np.uint64).astype(np.uint32)
    wanted = rng.uniform(-2, 31.5, x.size)
    natural = exponent / 2.0**31 * np.log2(np.maximum(np.abs(x.astype(np.float64)), 1))
    return exponent, np.rint((wanted - natural) * 2.0**24).astype(np.int32)


def extended_power(x: Signed, exponent: Unsigned, scale: Signed) -> Extended:
    """The magnitude in extended precision."""
    magnitude = np.abs(x.astype(np.longdouble))
    with np.errstate(divide="ignore"):
        logarithm = np.log2(magnitude)
    logarithm[magnitude == 0] = 0
    total = exponent / np.longdouble(2**31) * logarithm + scale / np.longdouble(2**24)
    result: Extended = np.where(magnitude == 0, np.longdouble(0), np.exp2(total))
    return result


def excess(y: Signed, exact: Extended) -> Extended:
    """The relative error beyond half a unit, with the exact value saturated like the result."""
    clamped = np.minimum(exact, MAGNITUDE_MAX)
    error = np.abs(np.abs(y.astype(np.longdouble)) - clamped) - HALF_A_UNIT
    relative: Extended = error / np.maximum(clamped, 1e-3)
    return relative


# The tables


def test_the_bound_keeps_what_is_asked_for() -> None:
    assert tables().relative_bound <= 2 ** tables().log2_relative_bound <= MAX_RELATIVE
    assert tables().size + len(sig_pow_fixed.leading_zeros()) <= 1024


def quadratic(form: Form, word: int, offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """The value of the C before its last rounding, less the constant, in its fraction's units."""
    slope, curvature = word & 0xFFFF_FFFF, word & form.curvature_mask
    value: NDArray[np.int64] = (
        form.sign * offsets * ((slope << form.curvature_shift) - curvature * offsets)
    )
    return value


def test_fits_keep_their_error_in_every_segment() -> None:
    """The two quadratics' errors in units of the last place: 25 million offsets, in double."""
    worst = {1: 0.0, -1: 0.0}
    coarse = np.arange(0, 1 << 22, 16, dtype=np.int64)
    fine = np.arange(1 << 18, dtype=np.int64)
    for i, word in enumerate(tables().log2):
        # Less the constant, so that double precision has bits to spare.
        m = (i + (coarse + 7 / 16) / 2.0**22) / 64
        exact = np.log1p(m) / math.log(2) * 2.0**27 + 0.5
        rise = quadratic(LOG2, word, coarse) / 2.0**LOG2.fraction_bits
        error = ((word >> 32) - (31 << 27)) + rise - exact
        worst[1] = max(worst[1], float(np.abs(error).max()))
    for i, word in enumerate(tables().exp2):
        f = (i + (fine + 0.25) / 2.0**18) / 32
        exact = np.exp2(1 - f) * 2.0**31 - 0.5
        fall = quadratic(EXP2, word, fine) / 2.0**EXP2.fraction_bits
        error = (word >> 32) + fall - exact
        worst[-1] = max(worst[-1], float(np.abs(error / exact).max()) * 2**24)
    assert 8.3 < worst[1] < 8.43
    assert 1.2 < worst[-1] < 1.56


def test_tables_are_made_of_64_bit_words() -> None:
    for words in (tables().log2, tables().exp2):
        assert all(isinstance(w, int) and 0 <= w < 2**64 for w in words)


def test_tables_do_not_depend_on_the_precision_in_force() -> None:
    before = tables()
    with mpmath.workprec(20):
        assert sig_pow_fixed.tables.__wrapped__() == before
        assert mpmath.mp.prec == 20


# Gain and exponent as integers


@pytest.mark.parametrize(
    ("gain", "exponent", "expected"),
    [
        ("1", "1", (2**31, 0)),
        ("1", "0", (0, 0)),
        ("1/2", "3/2", (3 * 2**30, -(2**24))),
        # 95/105 2^31 = 1942961395.81, log2(3) 2^24 = 26591258.49
        ("3", "95/105", (1942961396, 26591258)),
        ("0", "0.5", (2**30, ZERO_GAIN)),
        ("1", f"{2**34 - 1}/{2**33}", (2**32 - 1, 0)),
    ],
)
def test_fixed_power(gain: str, exponent: str, expected: tuple[int, int]) -> None:
    assert fixed_power(Fraction(gain), Fraction(exponent)) == expected


@pytest.mark.parametrize("exponent", [Fraction(-1, 10**9), Fraction(2), Fraction(5, 2)])
def test_exponent_out_of_range_is_refused(exponent: Fraction) -> None:
    with pytest.raises(ValueError, match="exponent of a power must be at least 0"):
        fixed_power(Fraction(1), exponent)


def test_gain_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="must not be negative: -1"):
        fixed_power(Fraction(-1), Fraction(1))
    for gain in (Fraction(2) ** 128, Fraction(1, 2**128)):
        with pytest.raises(ValueError, match=r"not 2\^-?128.0: choose other units"):
            fixed_power(gain, Fraction(1))
    assert fixed_power(Fraction(2) ** 127, Fraction(1)).scale_q24 == 127 << 24
    assert fixed_power(Fraction(1, 2**127), Fraction(1)).scale_q24 == -127 << 24


# Accuracy


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_agrees_with_mpmath(kernel: Kernel, exponent: str) -> None:
    # Against the gain and the exponent as they were asked for, whose rounding is in MAX_RELATIVE.
    rng = np.random.default_rng(1)
    x = np.concatenate([corners()[::7], any_integers(rng, 300)])
    x = np.concatenate([x, rng.integers(2**30, 2**31, 100).astype(np.int32)])
    a = Fraction(exponent)
    inside = 0
    for gain in map(Fraction, GAINS):
        y = kernel.power(x, fixed_power(gain, a))
        with mpmath.workprec(80):
            power, factor = (mpmath.mpf(v.numerator) / v.denominator for v in (a, gain))
            for argument, result in zip(x.tolist(), y.tolist(), strict=True):
                exact = factor * mpmath.mpf(abs(argument)) ** power if argument else mpmath.mpf(0)
                clamped = min(exact, MAGNITUDE_MAX)
                assert abs(abs(result) - clamped) <= HALF_A_UNIT + MAX_RELATIVE * clamped
                assert result * argument >= 0
                inside += 1 < exact < MAGNITUDE_MAX
    assert inside > 1000


def test_the_stated_bound_holds_for_every_exponent_and_gain(kernel: Kernel) -> None:
    rng = np.random.default_rng(2)
    for _ in range(3):
        x = any_integers(rng, 1_000_000)
        stored = any_powers(rng, x)
        exact = extended_power(x, *stored)
        worst = np.max(excess(kernel.power(x, stored), exact))
        assert worst <= tables().relative_bound + REFERENCE_ERROR
        assert np.count_nonzero((exact > 2**22) & (exact < 2**31)) > x.size // 5


def test_large_results_use_the_bound_up(kernel: Kernel) -> None:
    # Exponents near 2, where the logarithm's error doubles: a bound that is far off shows here.
    rng = np.random.default_rng(3)
    x = rng.integers(1, 2**31, 2_000_000, dtype=np.int64).astype(np.int32)
    exponent = rng.integers(2**32 - 2**26, 2**32, x.size, dtype=np.uint64).astype(np.uint32)
    natural = exponent / 2.0**31 * np.log2(x.astype(np.float64))
    wanted = rng.uniform(30, 31, x.size)
    scale = np.rint((wanted - natural) * 2.0**24).astype(np.int32)
    exact = extended_power(x, exponent, scale)
    y = kernel.power(x, (exponent, scale))
    error = (y - exact) / exact
    assert 0.6 * tables().relative_bound < np.max(np.abs(error)) <= tables().relative_bound + 2**-30
    # A rounding that isn't compensated shows as a bias.
    assert abs(np.mean(error)) < 0.05 * tables().relative_bound


@pytest.mark.parametrize(("binade", "step"), [(-2, 7), (0, 7), (12, 7), (30, 1)])
def test_every_fraction_of_a_power_of_two(kernel: Kernel, binade: int, step: int) -> None:
    # x = 1 leaves the second quadratic alone: with a step of 1, all its arguments.
    scale = ((binade << 24) + np.arange(0, 2**24, step, dtype=np.int64)).astype(np.int32)
    zero = np.zeros_like(scale, dtype=np.uint32)
    one = np.ones_like(scale)
    exact = extended_power(one, zero, scale)
    worst = np.max(excess(kernel.power(one, (zero, scale)), exact))
    assert worst <= tables().relative_bound + REFERENCE_ERROR


def test_the_exponent_one_is_the_identity_up_to_two_to_the_21(kernel: Kernel) -> None:
    x = np.arange(-(2**21), 2**21, dtype=np.int32)
    np.testing.assert_array_equal(kernel.power(x, fixed_power(Fraction(1), Fraction(1))), x)


def test_the_exponent_zero_is_the_gain(kernel: Kernel) -> None:
    x = corners()
    for k in range(31):
        y = kernel.power(x, fixed_power(Fraction(2**k), Fraction(0)))
        np.testing.assert_array_equal(y, np.sign(x) * 2**k)


def test_odd(kernel: Kernel) -> None:
    rng = np.random.default_rng(4)
    x = rng.integers(-(2**31) + 1, 2**31, 1_000_000, dtype=np.int64).astype(np.int32)
    stored = any_powers(rng, x)
    np.testing.assert_array_equal(kernel.power(-x, stored), -kernel.power(x, stored))


# Zeros, underflow, saturation


def every_power() -> tuple[Unsigned, Signed]:
    exponent = np.linspace(0, 2**32 - 1, 257).astype(np.uint32)
    extremes = np.array([ZERO_GAIN, ZERO_GAIN + 1, -1, 0, 1, 2**31 - 1])
    scale = np.concatenate([extremes, np.linspace(ZERO_GAIN, 2**31 - 1, 255)]).astype(np.int32)
    grid = np.meshgrid(exponent, scale)
    return grid[0].ravel(), grid[1].ravel()


def test_zero_stays_zero_for_every_exponent_and_gain(kernel: Kernel) -> None:
    exponent, scale = every_power()
    assert not np.any(kernel.power(np.zeros_like(scale), (exponent, scale)))


def test_a_gain_of_zero_gives_zero(kernel: Kernel) -> None:
    x = corners()
    for exponent in EXPONENTS:
        assert not np.any(kernel.power(x, fixed_power(Fraction(0), Fraction(exponent))))


def test_saturates_and_vanishes(kernel: Kernel) -> None:
    exponent, scale = every_power()
    for x in (1, 2, 3, 1000, 2**31 - 1, INT32_MIN):
        argument = np.full_like(scale, x)
        exact = extended_power(argument, exponent, scale)
        y = kernel.power(argument, (exponent, scale))
        above = exact >= 2.0**31 * (1 + tables().relative_bound)
        below = exact <= HALF_A_UNIT * (1 - tables().relative_bound)
        np.testing.assert_array_equal(y[above], math.copysign(MAGNITUDE_MAX, x))
        assert not np.any(y[below])
        assert np.all(y[~above & ~below] != 0)
        assert np.count_nonzero(above) > 10_000
        assert np.count_nonzero(below) > 10_000


def test_the_most_negative_integer_is_what_it_is(kernel: Kernel) -> None:
    lowest = np.array([INT32_MIN], np.int32)
    stored = fixed_power(Fraction(1, 2**10), Fraction(1))
    assert kernel.power(lowest, stored)[0] == -(2**21)


def test_falls_by_no_more_than_its_error_where_x_grows(kernel: Kernel) -> None:
    x = np.arange(1, 2**20, dtype=np.int32)
    for exponent in PAPER_EXPONENTS:
        y = kernel.power(x, fixed_power(Fraction(100), Fraction(exponent))).astype(np.int64)
        assert np.all(np.diff(y) >= -np.ceil(2 * MAX_RELATIVE * y[1:]))


# The bound of a result


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_no_result_exceeds_its_bound(kernel: Kernel, exponent: str) -> None:
    rng = np.random.default_rng(5)
    for gain in GAINS:
        stored = fixed_power(Fraction(gain), Fraction(exponent))
        for x_max in (1, 2, 77, 4096, 10**6, 2**31 - 1):
            x = np.append(rng.integers(0, x_max, 1000, endpoint=True), x_max).astype(np.int32)
            bound = magnitude_bound(stored, x_max)
            largest = int(kernel.power(x, stored).max())
            assert largest <= bound
            # And not by far, at the end of the range.
            assert bound <= int(kernel.power(x[-1:], stored)[0]) * (1 + 2 * MAX_RELATIVE) + 1


def test_bounds_at_the_ends() -> None:
    one = fixed_power(Fraction(1), Fraction(1))
    assert magnitude_bound(one, 0) == 0
    assert magnitude_bound(one, 2**31) == MAGNITUDE_MAX
    assert magnitude_bound(fixed_power(Fraction(0), Fraction(1)), 2**31) == 0
    assert magnitude_bound(FixedPower(2**32 - 1, 2**31 - 1), 2**31) == MAGNITUDE_MAX
    for x_max in (-1, 2**31 + 1):
        with pytest.raises(ValueError, match=r"from 0 to 2\^31"):
            magnitude_bound(one, x_max)


# Scaling, and the helpers


def scaled(x: int, factor: int, shift: int) -> int:
    """Ties away from zero, saturated."""
    magnitude = (abs(x * factor) + (1 << (shift - 1))) >> shift
    return int(math.copysign(min(magnitude, MAGNITUDE_MAX), x * factor))


def scale_vectors() -> tuple[Signed, Signed, Unsigned]:
    rng = np.random.default_rng(6)
    x, factor = (np.concatenate([rng.permutation(corners()) for _ in range(8)]) for _ in "xf")
    x = np.concatenate([x, any_integers(rng, 100_000), np.full(62, INT32_MIN, np.int32)])
    factor = np.concatenate([factor, any_integers(rng, 100_000), np.full(62, INT32_MIN, np.int32)])
    shift = rng.integers(1, 63, x.size, dtype=np.uint32)
    shift[-62:] = np.arange(1, 63)
    return x, factor, shift


def test_scale_is_exact(kernel: Kernel) -> None:
    vectors = scale_vectors()
    expected = [scaled(*v) for v in zip(*(v.tolist() for v in vectors), strict=True)]
    np.testing.assert_array_equal(kernel.scale(*vectors), expected)
    assert len(set(expected)) > 10_000
    assert min(expected) == -MAGNITUDE_MAX


def test_ties_go_away_from_zero(kernel: Kernel) -> None:
    x = np.arange(-9, 10, 2, dtype=np.int32)
    halves = kernel.scale(x, np.ones_like(x), np.ones_like(x, np.uint32))
    np.testing.assert_array_equal(halves, (x + np.sign(x)) // 2)


def words(rng: np.random.Generator, count: int) -> Unsigned:
    """Words of every size, and the corners of 16-bit products."""
    edges = [0, 1, 2, 0x7FFF, 0x8000, 0xFFFE, 0xFFFF, 0x10000, 0x10001, 0x7FFF_FFFF, 0x8000_0000]
    edges += [0xFFFE_FFFF, 0xFFFF_0000, 0xFFFF_0001, 0xFFFF_FFFE, 0xFFFF_FFFF]
    full = rng.integers(0, 2**32, count, dtype=np.uint64) >> rng.integers(
        0, 32, count, dtype=np.uint64
    )
    full[rng.random(count) < 0.3] = rng.choice(edges, 1)
    corner = np.array(edges, np.uint64)
    return np.concatenate([np.repeat(corner, corner.size), full]).astype(np.uint32)


def test_both_multiplications_give_the_high_word(kernel: Kernel, short_kernel: Kernel) -> None:
    rng = np.random.default_rng(7)
    a = words(rng, 1_000_000)
    b = words(rng, 1_000_000)
    b[:256] = a[:256].reshape(16, 16).T.ravel()
    expected = (a.astype(np.uint64) * b.astype(np.uint64)) >> np.uint64(32)
    np.testing.assert_array_equal(kernel.multiply_high(a, b), expected)
    np.testing.assert_array_equal(short_kernel.multiply_high(a, b), expected)


def test_both_counts_of_leading_zeros(kernel: Kernel, short_kernel: Kernel) -> None:
    rng = np.random.default_rng(8)
    powers = 2 ** np.arange(32, dtype=np.uint64)
    x = np.concatenate([powers, powers - 1, powers + 1, words(rng, 100_000)]).astype(np.uint32)
    x = x[x > 0]
    expected = 32 - np.frexp(x.astype(np.float64))[1]
    np.testing.assert_array_equal(kernel.leading_zeros(x), expected)
    np.testing.assert_array_equal(short_kernel.leading_zeros(x), expected)


# The same bits from every compiler, and no undefined behaviour


@pytest.fixture(scope="session")
def vectors() -> tuple[Signed, tuple[Unsigned, Signed]]:
    """Any x, any exponent, any gain; the usual ones, too."""
    rng = np.random.default_rng(9)
    x = np.concatenate([corners(), any_integers(rng, 300_000)])
    exponent, scale = any_powers(rng, x)
    some = rng.random(x.size) < 0.2
    exponent[some], scale[some] = (
        v[rng.integers(0, v.size, np.count_nonzero(some))] for v in every_power()
    )
    return x, (exponent, scale)


@pytest.mark.parametrize(
    ("compiler", "flags"),
    [
        ("gcc", "-O0"),
        ("gcc", "-O3 -march=native"),
        ("clang", "-O2"),
        ("clang", "-O3"),
        ("gcc", f"-O2 {SHORT_MULTIPLY}"),
        ("clang", f"-O3 {SHORT_MULTIPLY}"),
    ],
)
def test_every_compiler_gives_the_same_bits(
    kernel: Kernel,
    sources: Path,
    vectors: tuple[Signed, tuple[Unsigned, Signed]],
    compiler: str,
    flags: str,
) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    other = shared(sources, f"{compiler}{flags}.so".replace(" ", ""), compiler, *flags.split())
    np.testing.assert_array_equal(other.power(*vectors), kernel.power(*vectors))
    scaling = scale_vectors()
    np.testing.assert_array_equal(other.scale(*scaling), kernel.scale(*scaling))


@pytest.mark.parametrize("variant", ["-DTDC_LONG_MULTIPLY", SHORT_MULTIPLY])
def test_no_undefined_behaviour(
    kernel: Kernel, sources: Path, vectors: tuple[Signed, tuple[Unsigned, Signed]], variant: str
) -> None:
    sanitise = ("-fsanitize=undefined", "-fno-sanitize-recover=all", "-O1", "-DFIXED_FILTER")
    program = build(sources, f"sanitised{variant}", "gcc", *sanitise, variant)
    x, (exponent, scale) = vectors
    _, factors, shifts = scale_vectors()
    factor = factors[np.arange(x.size) % factors.size]
    shift = shifts[np.arange(x.size) % shifts.size]
    columns = (x, exponent, scale, factor, shift)
    records = np.stack([v.view(np.uint32) for v in columns], axis=1)
    done = subprocess.run([program], input=records.tobytes(), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    results = np.frombuffer(done.stdout, np.int32).reshape(-1, 2)
    np.testing.assert_array_equal(results[:, 0], kernel.power(x, (exponent, scale)))
    np.testing.assert_array_equal(results[:, 1], kernel.scale(x, factor, shift))


# On the cores that it is for


def target_object(sources: Path, core: str, optimisation: str) -> Path:
    if shutil.which("arm-none-eabi-gcc") is None:
        pytest.skip("arm-none-eabi-gcc is not installed")
    flags = (f"-mcpu={core}", "-mthumb", "-mfloat-abi=soft", optimisation)
    return build(sources, f"{core}{optimisation}.o", "arm-none-eabi-gcc", *flags, "-r", "-nostdlib")


@pytest.mark.parametrize("optimisation", ["-O2", "-Os", "-O3"])
@pytest.mark.parametrize("core", CORES)
def test_calls_no_library(sources: Path, core: str, optimisation: str) -> None:
    undefined = run("arm-none-eabi-nm", "-u", target_object(sources, core, optimisation))
    assert set(undefined.replace("U ", "").split()) <= {"memcpy"}


@pytest.mark.parametrize(
    ("core", "machine"), [("cortex-m0", "microbit"), ("cortex-m3", "mps2-an385")]
)
def test_emulated_cores_give_the_same_bits(
    kernel: Kernel, sources: Path, core: str, machine: str
) -> None:
    for tool in ("arm-none-eabi-gcc", "qemu-system-arm"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")
    flags = (
        f"-mcpu={core}",
        "-mthumb",
        "-mfloat-abi=soft",
        "-O2",
        f"-DFIXED_BARE_METAL={DIGESTED}u",
    )
    places = ("-Wl,--section-start=.vectors=0", "-Wl,-Ttext=0x100", "-Wl,-e,reset", "-nostdlib")
    program = build(sources, f"{core}.elf", "arm-none-eabi-gcc", *flags, *places)
    emulator = ("qemu-system-arm", "-M", machine, "-display", "none", "-monitor", "none")
    semihosting = ("-semihosting-config", "enable=on,target=native")
    done = subprocess.run(
        [*emulator, "-serial", "none", *semihosting, "-kernel", str(program)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    digest = kernel.library.digest
    digest.restype = ctypes.c_uint32
    assert (done.stdout + done.stderr).strip() == f"{digest(ctypes.c_uint32(DIGESTED)):08x}"


def mnemonics(sources: Path, core: str, function: str) -> list[str]:
    listing = run(
        "arm-none-eabi-objdump", "-d", "--no-show-raw-insn", target_object(sources, core, "-O2")
    )
    body = listing.split(f"<{function}>:")[1].split("\n\n")[0]
    found = re.findall(r"^\s+[0-9a-f]+:\t(\S+)", body, re.MULTILINE)
    return [m for m in found if m != "nop" and not m.startswith(".")]


def branches(instructions: list[str]) -> list[str]:
    return [m for m in instructions if re.match(r"(b|bl|bx|cb|it)", m) and m[:3] != "bic"]


def test_straight_line_on_a_cortex_m3(sources: Path) -> None:
    instructions = mnemonics(sources, "cortex-m3", "power_alone")
    assert branches(instructions) == []
    assert instructions.count("umull") == 3
    assert len(instructions) <= 46


def test_no_loop_and_no_call_on_a_cortex_m0plus(sources: Path) -> None:
    # Called more than once, it is not inlined there.
    instructions = mnemonics(sources, "cortex-m0plus", "tdc_fixed_sig_pow")
    assert len(branches(instructions)) <= 2
    assert not any(m in ("bl", "blx") for m in instructions)
    assert instructions.count("muls") == 15
    assert len(instructions) <= 190


def test_command_line_states_the_bound(capsys: pytest.CaptureFixture[str]) -> None:
    assert sig_pow_fixed.main([]) == 0
    printed = capsys.readouterr().out
    assert f"2^{tables().log2_relative_bound:.2f}" in printed
    assert f"{tables().size} bytes" in printed
