"""The compiled sig_pow against mpmath and double precision, and its special cases."""

from __future__ import annotations

import ctypes
import math
import re
import shutil
import subprocess
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from codegen import sig_pow
from codegen.sig_pow import PAPER_EXPONENTS, exponent_q31, tables
from tests.toolchain import CORTEX_M4F, WARNINGS

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Integers = NDArray[np.int32]
Kernel = Callable[[Floats, Integers], Floats]

DRIVER = Path(__file__).with_name("sig_pow_driver.c")
MAX_ULP = 4.03
MAX_RELATIVE = 2.0**-21.5
SMALLEST_NORMAL = 2.0**-126
SMALLEST_SUBNORMAL = 2.0**-149
INFINITY = np.uint32(0x7F80_0000)
"""The bits of infinity."""
LAST_BINADES = 0x7E80_0000
"""The bits of 2^126."""
LARGEST = float(np.finfo(np.float32).max)
LINE_FROM = 2.0**126
"""From here on the smallest exponents follow the line x 2^-126."""


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("sig_pow")
    sig_pow.render(directory)
    return directory


def build(sources: Path, output: str, compiler: str, *flags: str) -> Path:
    inputs = [str(sources / "tdc_sig_pow.c"), str(DRIVER), f"-I{sources}"]
    command = [compiler, *flags, "-ffp-contract=off", *inputs, "-o", str(sources / output)]
    subprocess.run(command, check=True)
    return sources / output


def load(library: Path) -> Kernel:
    batch = ctypes.CDLL(str(library)).sig_pow_batch
    array = np.ctypeslib.ndpointer
    batch.argtypes = (
        array(np.float32, flags="C"),
        array(np.int32, flags="C"),
        array(np.float32, flags="C"),
        ctypes.c_size_t,
    )
    batch.restype = None

    def kernel(x: Floats, q31: Integers) -> Floats:
        x, q31 = (np.ascontiguousarray(v) for v in np.broadcast_arrays(x, q31))
        result = np.empty_like(x)
        batch(x, q31, result, x.size)
        return result

    return kernel


@pytest.fixture(scope="session")
def kernel(sources: Path) -> Kernel:
    return load(build(sources, "plain.so", "cc", *WARNINGS, "-O2", "-fPIC", "-shared"))


def q31(a: float | Fraction | str) -> Integers:
    return np.array([exponent_q31(Fraction(a))], dtype=np.int32)


def all_q31(a: Doubles) -> Integers:
    """`exponent_q31` for an array."""
    return np.minimum(np.rint((a - 1) * 2.0**31), 2.0**31 - 1).astype(np.int32)


def bits(x: Floats) -> NDArray[np.uint32]:
    return x.view(np.uint32)


def floats_between(rng: np.random.Generator, low: float, high: float, count: int) -> Floats:
    """Positive floats with uniformly distributed bits, so that every binade gets its share."""
    first, last = (int(np.float32(v).view(np.uint32)) for v in (low, high))
    return rng.integers(first, last, count, dtype=np.uint32).view(np.float32)


def ulp(exact: Doubles) -> Doubles:
    """The unit in the last place of a binary32 at `exact`, which is a normal number."""
    last_place: Doubles = np.ldexp(1.0, np.frexp(exact)[1] - 24)
    return last_place


def is_normal(exact: Doubles) -> NDArray[np.bool_]:
    return (exact >= SMALLEST_NORMAL) & (exact < 2.0**127)


def edges() -> Floats:
    """Both sides of every segment's boundary in every tenth binade; all are normal."""
    exponents = np.arange(-125, 20, 10)
    boundaries = np.ldexp(1 + np.arange(64) / 64, exponents[:, None]).astype(np.float32).ravel()
    around = np.concatenate([bits(boundaries) + np.uint32(k) for k in (0, 1)])
    below = bits(boundaries) - np.uint32(1)
    smallest = np.array([SMALLEST_NORMAL, np.nextafter(np.float32(SMALLEST_NORMAL), np.float32(1))])
    return np.concatenate([around.view(np.float32), below.view(np.float32), smallest], dtype="f4")


def subnormals() -> Floats:
    """Powers of two, their neighbours below, and many between; both ends included."""
    rng = np.random.default_rng(14)
    ends = [1 << k for k in range(23)] + [(1 << k) - 1 for k in range(1, 24)]
    between = rng.integers(1, 1 << 23, 20_000)
    return np.concatenate([ends, between]).astype(np.uint32).view(np.float32)


def power(x: Floats, stored: Integers) -> Doubles:
    """x^a in double, and x 2^-126 where that is more: there the multiplier would be subnormal."""
    exact, a = x.astype(np.float64), 1 + stored * 2.0**-31
    larger: Doubles = np.maximum(np.power(exact, a), exact * 2.0**-126)
    return larger


# The tables and the exponent


def quadratic(word: int, offset: NDArray[np.int64], sign: int) -> Doubles:
    """The correction of the C before it is rounded down, in units of the last place."""
    signed = np.array(word, np.uint64).view(np.int64)
    slope = np.array(word & 0xFFFF_FFFF, np.uint32).view(np.int32).astype(np.int64)
    value: Doubles = (signed + offset * (slope + sign * (word & 0xFF) * offset)) / 2.0**32
    return value


def distance(value: Doubles, exact: Doubles) -> float:
    """The largest distance on the circle of 2^32 that the C's unsigned words live on."""
    return float(np.abs((value - exact + 2.0**31) % 2.0**32 - 2.0**31).max())


def test_fits_keep_their_error_at_every_offset_of_every_segment() -> None:
    """The error budget of the docstring, exhaustively: 25 million offsets, in double."""
    worst_log2 = worst_exp2 = 0.0
    sides = np.arange((1 << 18) + 1, dtype=np.int64), np.arange(-(1 << 18), 1, dtype=np.int64)
    up = np.arange((1 << 17) + 1, dtype=np.int64)
    for i, (log2_word, exp2_word) in enumerate(zip(tables().log2, tables().exp2, strict=True)):
        # Even segments are read from their left end, odd ones from their right end.
        odd = i % 2
        m = ((i + odd) * (1 << 18) + sides[odd]) / 2.0**24
        exact = (np.log1p(m) / math.log(2) - m) * 2.0**24 + 0.5 - (127 << 24)
        worst_log2 = max(worst_log2, distance(quadratic(log2_word, sides[odd], -1), exact))
        z = i * (1 << 17) + up
        exact = np.expm1((z + 0.5) / 2.0**23 * math.log(2)) * 2.0**23 - z + 0.5 + (1 << 23)
        worst_exp2 = max(worst_exp2, distance(quadratic(exp2_word, up, 1), exact))
    assert 1.25 < worst_log2 < 1.31
    assert 0.49 < worst_exp2 < 0.505


def test_tables_are_made_of_64_bit_words() -> None:
    made = tables()
    for words in (made.log2, made.exp2):
        assert len(words) == sig_pow.SEGMENTS
        assert all(isinstance(w, int) and 0 <= w < 2**64 for w in words)


def test_tables_do_not_depend_on_the_precision_in_force() -> None:
    before = tables()
    with mpmath.workprec(20):
        assert sig_pow.tables.__wrapped__() == before
        assert mpmath.mp.prec == 20


def test_the_bound_keeps_what_is_asked_for() -> None:
    assert tables().bounds.ulp <= MAX_ULP
    assert tables().bounds.relative <= MAX_RELATIVE


@pytest.mark.parametrize(
    ("a", "expected"),
    [
        (Fraction(1), 0),
        (1.0, 0),
        (0, -(2**31)),
        (Fraction(3, 2), 2**30),
        (0.5, -(2**30)),
        (2, 2**31 - 1),
        (Fraction(2) - Fraction(1, 2**33), 2**31 - 1),
        (Fraction(95, 105), -204522252),  # -10/105 2^31 = -204522252.19
        (Fraction(1) + Fraction(3, 2**32), 2),  # a tie goes to even
    ],
)
def test_exponent_in_q31(a: Fraction | float, expected: int) -> None:
    assert exponent_q31(a) == expected


@pytest.mark.parametrize("a", [-1e-9, 2.0000001, math.nan, math.inf, Fraction(-1, 10**9)])
def test_exponent_out_of_range_is_refused(a: Fraction | float) -> None:
    with pytest.raises(ValueError, match="from 0 to 2"):
        exponent_q31(a)


# Accuracy


@pytest.mark.parametrize("a", PAPER_EXPONENTS)
def test_agrees_with_mpmath(kernel: Kernel, a: str) -> None:
    rng = np.random.default_rng(1)
    x = np.concatenate(
        [
            edges(),
            floats_between(rng, SMALLEST_NORMAL, 1e6, 1000),
            floats_between(rng, 1e6, LARGEST, 200),
            floats_between(rng, 2.0**-30, 2.0**7, 300),
        ]
    )
    y = kernel(x, q31(a))
    exponent = Fraction(a)
    checked = 0
    with mpmath.workdps(60):
        power = mpmath.mpf(exponent.numerator) / exponent.denominator
        for argument, result in zip(x.tolist(), y.tolist(), strict=True):
            exact = mpmath.mpf(argument) ** power
            error = abs(result - exact)
            if exact >= mpmath.mpf(2) ** 128:
                assert result == math.inf, argument
            elif exact >= SMALLEST_NORMAL:
                last_place = mpmath.ldexp(1, mpmath.frexp(exact)[1] - 24)
                assert error <= MAX_ULP * last_place, argument
                assert error <= MAX_RELATIVE * exact, argument
                checked += 1
            else:
                assert error <= MAX_ULP * SMALLEST_SUBNORMAL, argument
    assert checked > 2000


@pytest.mark.parametrize(("low", "high"), [(SMALLEST_NORMAL, 1e6), (2.0**-30, 1e6), (1e6, LARGEST)])
def test_agrees_with_double_precision_for_every_exponent(
    kernel: Kernel, low: float, high: float
) -> None:
    rng = np.random.default_rng(2)
    x = floats_between(rng, low, high, 3_000_000)
    a = rng.uniform(0.2, 2.0, x.size)
    exact = np.power(x.astype(np.float64), a)
    normal = is_normal(exact)
    error = np.abs(kernel(x, all_q31(a)) - exact)
    assert np.max((error / ulp(exact))[normal]) <= MAX_ULP
    assert np.max((error / exact)[normal]) <= MAX_RELATIVE
    assert np.count_nonzero(normal) > x.size // 3


def test_the_stated_bound_holds_for_every_normal_float(kernel: Kernel) -> None:
    # Exponents down to zero, exact in Q31, and magnitudes up to the largest.
    rng = np.random.default_rng(3)
    x = floats_between(rng, SMALLEST_NORMAL, math.inf, 3_000_000)
    stored = rng.integers(-(2**31), 2**31, x.size, dtype=np.int64).astype(np.int32)
    exact = power(x, stored)
    normal = is_normal(exact)
    error = np.abs(kernel(x, stored) - exact)
    assert np.max((error / ulp(exact))[normal]) <= tables().bounds.ulp
    assert np.max((error / exact)[normal]) <= tables().bounds.relative


@pytest.mark.parametrize("a", ["0", "0.01", "0.4", "0.95", "0.999"])
def test_the_stated_bound_holds_for_all_floats_of_the_last_two_binades(
    kernel: Kernel, a: str
) -> None:
    x = np.arange(LAST_BINADES, int(INFINITY), dtype=np.uint32).view(np.float32)
    assert x[-1] == LARGEST
    exact = power(x, q31(a))
    assert np.max(np.abs(kernel(x, q31(a)) - exact) / exact) <= tables().bounds.relative


def test_the_largest_floats_are_no_special_case_for_any_exponent(kernel: Kernel) -> None:
    # Their logarithm is next to 2^31, from where on it would be negative.
    x = np.arange(int(INFINITY) - 300, int(INFINITY), dtype=np.uint32).view(np.float32)[:, None]
    exact = power(x, EVERY_EXPONENT)
    y = kernel(x, EVERY_EXPONENT)
    certain = exact > 2.0**128 * (1 + MAX_RELATIVE)
    assert np.all(np.isposinf(y[certain]))
    finite = exact < 2.0**128 * (1 - MAX_RELATIVE)
    assert np.count_nonzero(finite) > x.size * EVERY_EXPONENT.size // 3
    assert np.max(np.abs(y / exact - 1)[finite]) <= tables().bounds.relative


@pytest.mark.parametrize(("low", "high"), [(0.2, 0.9), (0.9, 1.1), (1.1, 2.0)])
def test_errors_are_centred(kernel: Kernel, low: float, high: float) -> None:
    # A rounding that isn't compensated shows here first: half a unit is 0.25 ulp or more.
    rng = np.random.default_rng(13)
    x = floats_between(rng, 2.0**-30, 2.0**7, 1_000_000)
    a = rng.uniform(low, high, x.size)
    exact = np.power(x.astype(np.float64), a)
    bias = np.mean((kernel(x, all_q31(a)) - exact) / ulp(exact))
    assert abs(bias) < 0.1


def test_the_exponent_one_is_the_identity(kernel: Kernel) -> None:
    rng = np.random.default_rng(4)
    x = np.concatenate([edges(), floats_between(rng, 0.0, math.inf, 1_000_000)])
    x = np.concatenate([x, subnormals(), np.array([LARGEST], np.float32)])
    x = np.concatenate([x, -x])
    np.testing.assert_array_equal(bits(kernel(x, q31(1))), bits(x))


def test_the_exponent_zero_is_the_sign(kernel: Kernel) -> None:
    rng = np.random.default_rng(5)
    x = np.concatenate([edges(), floats_between(rng, SMALLEST_NORMAL, LINE_FROM, 1_000_000)])
    np.testing.assert_allclose(kernel(x, q31(0)), 1.0, rtol=MAX_RELATIVE, atol=0)
    powers_of_two = np.ldexp(np.float32(1), np.arange(-126, 127)).astype(np.float32)
    assert np.all(kernel(powers_of_two, q31(0)) == 1)


def test_one_stays_one(kernel: Kernel) -> None:
    stored = np.arange(-(2**31), 2**31, 65_521, dtype=np.int64).astype(np.int32)
    assert np.all(kernel(np.array([1.0], np.float32), stored) == 1)
    assert np.all(kernel(np.array([-1.0], np.float32), stored) == -1)


def test_odd_bit_for_bit(kernel: Kernel) -> None:
    rng = np.random.default_rng(6)
    x = floats_between(rng, 0.0, math.inf, 1_000_000)
    stored = rng.integers(-(2**31), 2**31, x.size, dtype=np.int64).astype(np.int32)
    sign = np.uint32(1 << 31)
    np.testing.assert_array_equal(bits(kernel(-x, stored)), bits(kernel(x, stored)) ^ sign)


@pytest.mark.parametrize("a", ["0", "0.01", "0.2", *PAPER_EXPONENTS, "1.9", "2"])
def test_falls_by_no_more_than_three_ulp_where_x_grows(kernel: Kernel, a: str) -> None:
    rng = np.random.default_rng(7)
    starts = bits(floats_between(rng, SMALLEST_SUBNORMAL, math.inf, 2000))
    # Across all boundaries of segments and binades, and into infinity.
    boundaries = np.arange(1 << 17, int(INFINITY) + 1, 1 << 17, dtype=np.uint32)
    runs = (
        starts[:, None] + np.arange(200, dtype=np.uint32),
        boundaries[:, None] - np.arange(3, -3, -1, dtype=np.int64).astype(np.uint32),
    )
    for run in runs:
        x = np.minimum(run, INFINITY).view(np.float32)
        y = kernel(x.ravel(), q31(a)).reshape(x.shape)
        assert not np.any(np.isnan(y))
        # The bits of positive floats count their last places, and are ordered like them.
        assert np.min(np.diff(bits(y).astype(np.int64), axis=1)) >= -3


# Zeros, infinities, NaN; underflow and overflow

EVERY_EXPONENT = np.unique(
    np.concatenate(
        [
            np.linspace(-(2**31), 2**31 - 1, 4099).astype(np.int64),
            -(2**31) + np.arange(0, 2**26, 99_991),
            np.arange(-3, 4),
            2**31 - 1 - np.arange(4),
        ]
    )
).astype(np.int32)


@pytest.mark.parametrize("special", [0.0, -0.0, math.inf, -math.inf])
def test_zeros_and_infinities_stay(kernel: Kernel, special: float) -> None:
    x = np.full(EVERY_EXPONENT.shape, special, np.float32)
    np.testing.assert_array_equal(bits(kernel(x, EVERY_EXPONENT)), bits(x))


@pytest.mark.parametrize("payload", [0x7F80_0001, 0x7FC0_0000, 0x7FFF_FFFF, 0xFFFF_FFFF])
def test_nan_stays_nan(kernel: Kernel, payload: int) -> None:
    x = np.full(EVERY_EXPONENT.shape, payload, np.uint32).view(np.float32)
    assert np.all(np.isnan(kernel(x, EVERY_EXPONENT)))


def test_no_other_argument_gives_nan_or_the_wrong_sign(kernel: Kernel) -> None:
    rng = np.random.default_rng(8)
    x = rng.integers(0, 2**32, 3_000_000, dtype=np.uint32).view(np.float32)
    x = x[~np.isnan(x)]
    y = kernel(x, rng.choice(EVERY_EXPONENT, x.size))
    assert not np.any(np.isnan(y))
    np.testing.assert_array_equal(np.signbit(y), np.signbit(x))


def test_small_exponents_of_huge_x_follow_a_line(kernel: Kernel) -> None:
    x = floats_between(np.random.default_rng(9), LINE_FROM, math.inf, 10_000)
    np.testing.assert_array_equal(kernel(x, q31(0)), x * np.float32(2.0**-126))
    below = np.array([k for k in EVERY_EXPONENT if k < exponent_q31(Fraction(1, 64))], np.int32)
    y = kernel(x[:, None], below)
    assert np.all((y >= 1) & (y <= 4))
    np.testing.assert_allclose(y, power(x[:, None], below), rtol=MAX_RELATIVE)
    # From a = 0.016 on nothing is special about them.
    np.testing.assert_allclose(
        kernel(x, q31("0.016")), np.power(x.astype(np.float64), 0.016), rtol=MAX_RELATIVE
    )


@pytest.mark.parametrize("a", ["0", "0.001", "0.2", *PAPER_EXPONENTS, "1", "1.9", "2"])
def test_subnormals_lie_between_zero_and_the_power_of_the_smallest_normal(
    kernel: Kernel, a: str
) -> None:
    x = subnormals()
    y, end = kernel(x, q31(a)), kernel(np.array([SMALLEST_NORMAL], np.float32), q31(a))
    assert np.all((y >= 0) & (y <= end))
    # Their bits, read as a logarithm, are that of 2^-127 + x / 2, which 2^-126 ends.
    exponent = float(1 + q31(a)[0] * 2.0**-31)
    base = x.astype(np.float64)
    exact = base * np.maximum(np.power(2.0**-127 + base / 2, exponent - 1), 2.0**-126)
    error = np.abs(y - exact)
    assert np.all(error <= tables().bounds.relative * exact + 4 * SMALLEST_SUBNORMAL)
    # Never far from the chord itself.
    chord = base * 2.0**126 * float(end[0])
    factor = 2.0 ** abs(exponent - 1) * (1 + MAX_RELATIVE)
    far = 4 * SMALLEST_SUBNORMAL
    assert np.all(y <= factor * chord + far)
    assert np.all(y >= chord / factor - far)


def test_overflows_to_infinity(kernel: Kernel) -> None:
    rng = np.random.default_rng(10)
    x = floats_between(rng, 2.0**60, math.inf, 1_000_000)
    a = rng.uniform(1.0, 2.0, x.size)
    exact = np.power(x.astype(np.float64), a)
    y = kernel(x, all_q31(a))
    assert np.all(np.isinf(y[exact > 2.0**128 * (1 + MAX_RELATIVE)]))
    finite = exact < 2.0**128 * (1 - MAX_RELATIVE)
    np.testing.assert_allclose(y[finite], exact[finite], rtol=MAX_RELATIVE)


def test_underflows_gradually(kernel: Kernel) -> None:
    rng = np.random.default_rng(11)
    x = floats_between(rng, SMALLEST_NORMAL, 2.0**-60, 2_000_000)
    a = rng.uniform(1.0, 2.0, x.size)
    exact = np.power(x.astype(np.float64), a)
    small = exact < SMALLEST_NORMAL
    error = np.abs(kernel(x, all_q31(a)) - exact)[small]
    assert np.count_nonzero(small) > x.size // 2
    assert np.max(error) <= MAX_ULP * SMALLEST_SUBNORMAL


# The same bits from every compiler, and no undefined behaviour


@pytest.fixture(scope="session")
def vectors() -> tuple[Floats, Integers]:
    """Any bits for x, any exponent, but no NaN: its payload may differ."""
    rng = np.random.default_rng(12)
    x = rng.integers(0, 2**32, 300_000, dtype=np.uint32).view(np.float32)
    x = np.concatenate([x, edges(), subnormals(), np.array([0, math.inf], np.float32)])
    x = np.concatenate([x, -x])
    x = x[~np.isnan(x)]
    return x, rng.choice(EVERY_EXPONENT, x.size)


@pytest.mark.parametrize(
    ("compiler", "optimisation"),
    [("gcc", "-O0"), ("gcc", "-O3 -march=native"), ("clang", "-O0"), ("clang", "-O3")],
)
def test_every_compiler_gives_the_same_bits(
    kernel: Kernel,
    sources: Path,
    vectors: tuple[Floats, Integers],
    compiler: str,
    optimisation: str,
) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    name = f"{compiler}{optimisation}.so".replace(" ", "")
    other = load(
        build(sources, name, compiler, *WARNINGS, *optimisation.split(), "-fPIC", "-shared")
    )
    np.testing.assert_array_equal(bits(other(*vectors)), bits(kernel(*vectors)))


def test_no_undefined_behaviour(
    kernel: Kernel, sources: Path, vectors: tuple[Floats, Integers]
) -> None:
    sanitise = ("-fsanitize=undefined", "-fno-sanitize-recover=all", "-O1", "-DSIG_POW_FILTER")
    program = build(sources, "sanitised", "gcc", *WARNINGS, *sanitise)
    x, stored = vectors
    nan = np.array([0x7F80_0001, 0x7FFF_FFFF, 0xFFFF_FFFF], np.uint32).view(np.float32)
    pairs = np.stack(
        [
            np.concatenate([bits(x), np.repeat(bits(nan), EVERY_EXPONENT.size)]),
            np.concatenate([stored, np.tile(EVERY_EXPONENT, nan.size)]).view(np.uint32),
        ],
        axis=1,
    )
    run = subprocess.run([str(program)], input=pairs.tobytes(), capture_output=True, check=False)
    assert run.returncode == 0, run.stderr.decode()
    results = np.frombuffer(run.stdout, np.uint32)[: x.size]
    np.testing.assert_array_equal(results, bits(kernel(x, stored)))


def test_straight_line_on_a_cortex_m4f(sources: Path) -> None:
    objects = build(
        sources, "driver.o", "arm-none-eabi-gcc", "-std=c99", "-O2", *CORTEX_M4F, "-r", "-nostdlib"
    )
    listing = subprocess.run(
        ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", str(objects)],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    body = listing.split("<sig_pow_alone>:")[1].split("\n\n")[0]
    mnemonics = [m for m in re.findall(r"^\s+[0-9a-f]+:\t(\S+)", body, re.MULTILINE) if m[0] != "."]
    assert mnemonics[-1] in ("pop", "bx", "ldmia.w")
    branches = [m for m in mnemonics[:-1] if re.match(r"(b|bl|bx|cb|it)", m) and m[:3] != "bic"]
    assert branches == []
    assert len(mnemonics) <= 33


# The measurement of all floats


def test_exhaustive_measurement_of_a_binade() -> None:
    (survey,) = sig_pow.exhaustive(["0.5"], 1.0, 2.0)
    assert survey.exponent == "0.5"
    assert 1.0 < survey.ulp <= MAX_ULP
    assert 1.0 <= survey.ulp_at < 2.0
    assert 2.0**-24 < survey.relative <= MAX_RELATIVE
    assert survey.drop_ulp <= 3


def test_command_line_states_the_bound(capsys: pytest.CaptureFixture[str]) -> None:
    assert sig_pow.main([]) == 0
    assert f"{tables().bounds.ulp:.2f} ulp" in capsys.readouterr().out


@pytest.mark.parametrize("exponent", ["2.1", "1/0", "half"])
def test_command_line_refuses_what_is_no_exponent(
    exponent: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        sig_pow.main(["--exponents", exponent])
    assert f"{exponent}: write a number from 0 to 2" in capsys.readouterr().err
