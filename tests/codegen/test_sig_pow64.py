"""The compiled sig_pow in double against mpmath and extended precision, and its special cases."""

from __future__ import annotations

import ctypes
import math
import platform
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from codegen import sig_pow64
from codegen.sig_pow import PAPER_EXPONENTS
from codegen.sig_pow64 import error_ulp, exponent64, tables
from tests.toolchain import WARNINGS, run
from verification.firmware import STUB, common_facts, emulator, load_board

Doubles = NDArray[np.float64]
Words = NDArray[np.uint64]
Kernel = Callable[[Doubles, Doubles], Doubles]
"""Of x and of pairs (high, low)."""

DRIVER = Path(__file__).with_name("sig_pow64_driver.c")
CORTEX_M7 = load_board("mps2-an500")
MAX_ULP = 2.0
MAX_INSTRUCTIONS = 100
MAX_TABLE_BYTES = 3072
INFINITY = 0x7FF0_0000_0000_0000
"""The bits of infinity."""
SIGN = np.uint64(1 << 63)
SMALLEST_NORMAL = 2.0**-1022
SMALLEST_SUBNORMAL = 2.0**-1074
LARGEST = float(np.finfo(np.float64).max)


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("sig_pow64")
    sig_pow64.render(directory)
    return directory


def build(sources: Path, output: str, compiler: str, *flags: str) -> Path:
    inputs = [str(sources / "tdc_sig_pow64.c"), str(DRIVER), f"-I{sources}"]
    command = [compiler, *flags, "-ffp-contract=off", *inputs, "-o", str(sources / output)]
    subprocess.run(command, check=True)
    return sources / output


@dataclass(frozen=True)
class Library:
    """The compiled driver: arrays of powers, and setting an exponent (status, high, low)."""

    power: Kernel
    set_exponent: Callable[[float], tuple[int, float, float]]


def load(path: Path) -> Library:
    library = ctypes.CDLL(str(path))
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    library.sig_pow64_batch.argtypes = (array, array, array, ctypes.c_size_t)
    library.sig_pow64_batch.restype = None
    library.exponent64_set.argtypes = (ctypes.c_void_p, ctypes.c_double)

    def power(x: Doubles, a: Doubles) -> Doubles:
        x = np.ascontiguousarray(x)
        pairs = np.ascontiguousarray(np.broadcast_to(a, (x.size, 2)))
        result = np.empty_like(x)
        library.sig_pow64_batch(x, pairs, result, x.size)
        return result

    def set_exponent(value: float) -> tuple[int, float, float]:
        pair = (ctypes.c_double * 2)(7.0, 9.0)
        status = library.exponent64_set(pair, value)
        return status, pair[0], pair[1]

    return Library(power, set_exponent)


@pytest.fixture(scope="session")
def library(sources: Path) -> Library:
    return load(build(sources, "plain.so", "gcc", *WARNINGS, "-O2", "-fPIC", "-shared"))


@pytest.fixture(scope="session")
def kernel(library: Library) -> Kernel:
    return library.power


def pair(a: float | Fraction | str) -> Doubles:
    return np.array([exponent64(Fraction(a))])


def bits(x: Doubles) -> Words:
    return x.view(np.uint64)


def doubles_between(rng: np.random.Generator, low: float, high: float, count: int) -> Doubles:
    """Positive doubles with uniformly distributed bits, so that every binade gets its share."""
    first, last = (int(np.float64(v).view(np.uint64)) for v in (low, high))
    return rng.integers(first, last, count, dtype=np.uint64).view(np.float64)


def short_exponents(rng: np.random.Generator, low: float, count: int) -> tuple[Doubles, Doubles]:
    """Random exponents of 46 bits, and as pairs: their sum is exact in any arithmetic."""
    high = np.floor(rng.uniform(low, 2.0, count) * 2.0**31) / 2.0**31 - 1
    low_part = rng.integers(0, 2**14, count) / 2.0**46
    return 1 + (high + low_part), np.stack([high, low_part], axis=1)


def edges() -> Doubles:
    """Both sides of all segments' boundaries and centres, and the edges of all there is."""
    exponents = np.array([-1022, -1021, -517, -64, -20, -1, 0, 1, 2, 63, 511, 1023])
    places = np.ldexp(1 + np.arange(128) / 128, exponents[:, None]).ravel()
    around = [bits(places) + np.uint64(k) for k in (0, 1)] + [bits(places) - np.uint64(1)]
    powers = np.ldexp(1.0, np.arange(-1074, 1024))
    ends = np.array([1, 2, 3, (1 << 52) - 1, 1 << 52, INFINITY - 1], np.uint64)
    beside = [bits(powers[53:]) - np.uint64(1), bits(powers) + np.uint64(1), bits(powers)]
    return np.concatenate([*around, *beside, ends]).view(np.float64)


# The tables and the exponent


def test_the_bound_keeps_what_is_asked_for() -> None:
    assert 1.5 < tables().ulp_bound <= MAX_ULP
    assert tables().table_bytes <= MAX_TABLE_BYTES


def test_the_docstring_states_the_budget() -> None:
    rows = re.findall(r"^(\S.*?)  +(\d\.\d{3})$", str(sig_pow64.__doc__), re.MULTILINE)
    assert [(name, float(units)) for name, units in rows] == [
        (term.name, term.units) for term in tables().budget
    ]


def test_the_polynomials_keep_their_error() -> None:
    """The first terms of the budget, looked at in a thousand places of every segment."""
    terms = {term.name: term.units for term in tables().budget}
    with mpmath.workprec(150):
        unit = mpmath.mpf(2) ** -53
        of_power = mpmath.log(2) / 64 / unit
        first = tables().segments[0].slope
        worst_log2 = worst_exp2 = mpmath.mpf(0)
        for k in range(-1000, 1001):
            z = mpmath.mpf(k) / 1000 / 128
            r = z * first
            log2 = r + sum(c * r ** (n + 2) for n, c in enumerate(tables().log2))
            worst_log2 = max(worst_log2, abs(log2 - 64 * mpmath.log(1 + z, 2)))
            f = mpmath.mpf(k) / 2000
            exp2 = sum(c * f ** (n + 1) for n, c in enumerate(tables().exp2))
            worst_exp2 = max(worst_exp2, abs(exp2 - mpmath.expm1(f * mpmath.log(2) / 64)))
        # The first coefficients' own roundings stand in other terms.
        log2_rounding, exp2_rounding = 64 / 128 * unit * of_power, mpmath.log(2) / 128
        assert 0.02 < worst_log2 * of_power < terms["polynomial for log2"] + 1.5 * log2_rounding
        assert 0.01 < worst_exp2 / unit < terms["polynomial for exp2"] + exp2_rounding


def test_tables_do_not_depend_on_the_precision_in_force() -> None:
    before = tables()
    with mpmath.workprec(20):
        assert sig_pow64.tables.__wrapped__() == before
        assert mpmath.mp.prec == 20


@pytest.mark.parametrize("a", ["95/105", "98/102", "0.95", "1/3", "1.999999999", "1e-20"])
def test_exponent_in_two_doubles(a: str) -> None:
    high, low = exponent64(Fraction(a))
    assert (high * 2**31).is_integer()
    assert abs(low) <= 2.0**-32
    assert abs(Fraction(high) + Fraction(low) - (Fraction(a) - 1)) <= Fraction(1, 2**84)


@pytest.mark.parametrize(
    ("a", "expected"),
    [(0, (-1.0, 0.0)), (1, (0.0, 0.0)), (1.5, (0.5, 0.0)), (2, (1.0, 0.0))],
)
def test_exponent_that_is_exact(a: Fraction | float, expected: tuple[float, float]) -> None:
    assert exponent64(a) == expected


@pytest.mark.parametrize("a", [-1e-9, 2.0000001, math.nan, math.inf, Fraction(-1, 10**9)])
def test_exponent_out_of_range_is_refused(a: Fraction | float) -> None:
    with pytest.raises(ValueError, match="from 0 to 2"):
        exponent64(a)


@pytest.mark.parametrize("value", [0.0, -0.0, 5e-324, 1e-20, 0.1, 0.95, 1.0, 4 / 3, 2 - 2.0**-52])
def test_an_exponent_is_set_from_a_double(library: Library, value: float) -> None:
    status, high, low = library.set_exponent(value)
    assert status == 0
    assert (high * 2**31).is_integer()
    assert abs(low) < 2.0**-31
    assert abs(Fraction(high) + Fraction(low) - (Fraction(value) - 1)) <= Fraction(1, 2**84)


@pytest.mark.parametrize("value", [-5e-324, 2.0, math.nan, math.inf, -math.inf])
def test_setting_refuses_what_is_no_exponent(library: Library, value: float) -> None:
    assert library.set_exponent(value) == (-2, 7.0, 9.0)


# Accuracy


def test_the_error_is_measured_in_last_places() -> None:
    assert error_ulp(4.0, Fraction(1, 2), 2.0) == 0
    assert error_ulp(4.0, Fraction(1, 2), 2.0 + 2.0**-51) == 1
    assert error_ulp(4.0, Fraction(1, 2), 2.0 - 2.0**-52) == 0.5
    assert error_ulp(2.0, Fraction(1, 2), math.sqrt(2)) < 0.5
    assert error_ulp(2.0**-700, Fraction(3, 2), 3 * SMALLEST_SUBNORMAL) == 2.0**24 - 3
    assert error_ulp(2.0**800, Fraction(3, 2), math.inf) == 0
    assert error_ulp(2.0**800, Fraction(3, 2), LARGEST) == 0.5


@pytest.mark.parametrize("a", ["0", "1/1000", *PAPER_EXPONENTS, "1.999"])
def test_agrees_with_mpmath(kernel: Kernel, a: str) -> None:
    rng = np.random.default_rng(1)
    chosen = rng.choice(edges(), 1000)
    x = np.concatenate(
        [
            chosen,
            doubles_between(rng, SMALLEST_SUBNORMAL, SMALLEST_NORMAL, 200),
            doubles_between(rng, SMALLEST_SUBNORMAL, LARGEST, 1500),
            doubles_between(rng, 2.0**-30, 2.0**7, 500),
        ]
    )
    y = kernel(x, pair(a))
    for argument, result in zip(x.tolist(), y.tolist(), strict=True):
        assert error_ulp(argument, Fraction(a), result) <= tables().ulp_bound, argument


def test_agrees_with_mpmath_for_every_exponent(kernel: Kernel) -> None:
    rng = np.random.default_rng(2)
    x = doubles_between(rng, SMALLEST_SUBNORMAL, LARGEST, 4000)
    exponents = [Fraction(int(n), 2**63) for n in rng.integers(0, 2**63, x.size)]
    exponents = [2 * a for a in exponents]
    y = kernel(x, np.array([exponent64(a) for a in exponents]))
    for argument, a, result in zip(x.tolist(), exponents, y.tolist(), strict=True):
        assert error_ulp(argument, a, result) <= tables().ulp_bound, (argument, a)


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="long double is double here")
@pytest.mark.parametrize(
    ("low", "high"), [(SMALLEST_SUBNORMAL, LARGEST), (2.0**-30, 2.0**7), (0.98, 1.02)]
)
def test_agrees_with_extended_precision(kernel: Kernel, low: float, high: float) -> None:
    rng = np.random.default_rng(3)
    x = doubles_between(rng, low, high, 500_000)
    a, pairs = short_exponents(rng, 0.0, x.size)
    exact = np.power(x.astype(np.longdouble), a.astype(np.longdouble))
    normal = (exact >= SMALLEST_NORMAL) & (exact <= LARGEST)
    last_place = np.ldexp(np.longdouble(1), np.frexp(exact[normal])[1] - 53)
    error = (kernel(x, pairs)[normal] - exact[normal]) / last_place
    assert np.max(np.abs(error)) <= tables().ulp_bound + 0.001
    assert abs(np.mean(error)) < 0.01, "a rounding that isn't to nearest shows here first"
    assert np.count_nonzero(normal) > x.size // 2


def test_the_exponent_one_is_the_identity(kernel: Kernel) -> None:
    rng = np.random.default_rng(4)
    x = np.concatenate([edges(), doubles_between(rng, 0.0, LARGEST, 500_000)])
    x = np.concatenate([x, -x])
    np.testing.assert_array_equal(bits(kernel(x, pair(1))), bits(x))


def test_the_exponent_zero_is_the_sign(kernel: Kernel) -> None:
    rng = np.random.default_rng(5)
    x = np.concatenate([edges(), doubles_between(rng, SMALLEST_SUBNORMAL, LARGEST, 500_000)])
    np.testing.assert_allclose(kernel(x, pair(0)), 1.0, rtol=2.0**-51, atol=0)
    powers_of_two = np.ldexp(1.0, np.arange(-1074, 1024))
    assert np.all(kernel(powers_of_two, pair(0)) == 1)


def every_exponent() -> Doubles:
    rng = np.random.default_rng(6)
    _, pairs = short_exponents(rng, 0.0, 5000)
    named = [exponent64(Fraction(a)) for a in ("0", "1", "2", "1e-12", *PAPER_EXPONENTS)]
    return np.concatenate([pairs, np.array(named)])


def test_one_stays_one(kernel: Kernel) -> None:
    pairs = every_exponent()
    for one in (1.0, -1.0):
        assert np.all(kernel(np.full(len(pairs), one), pairs) == one)


def test_odd_bit_for_bit(kernel: Kernel) -> None:
    rng = np.random.default_rng(7)
    x = np.concatenate([edges(), doubles_between(rng, 0.0, math.inf, 500_000)])
    pairs = rng.choice(every_exponent(), x.size)
    np.testing.assert_array_equal(bits(kernel(-x, pairs)), bits(kernel(x, pairs)) ^ SIGN)


@pytest.mark.parametrize("a", ["0", *PAPER_EXPONENTS, "1.999"])
def test_falls_by_no_more_than_three_ulp_where_x_grows(kernel: Kernel, a: str) -> None:
    starts = bits(np.concatenate([edges(), doubles_between(np.random.default_rng(12), 0, 1, 2000)]))
    x = np.minimum(starts[:, None] + np.arange(20, dtype=np.uint64), np.uint64(INFINITY))
    y = kernel(x.ravel().view(np.float64), pair(a))
    # The bits of positive doubles count their last places, and are ordered like them.
    assert np.min(np.diff(bits(y).astype(np.int64).reshape(x.shape), axis=1)) >= -3


# Zeros, infinities, NaN; underflow and overflow


@pytest.mark.parametrize("special", [0.0, -0.0, math.inf, -math.inf])
def test_zeros_and_infinities_stay(kernel: Kernel, special: float) -> None:
    pairs = every_exponent()
    x = np.full(len(pairs), special)
    np.testing.assert_array_equal(bits(kernel(x, pairs)), bits(x))


@pytest.mark.parametrize("payload", [INFINITY + 1, (1 << 63) - 1, (1 << 64) - 1, 0x7FF8 << 48])
def test_nan_stays_nan(kernel: Kernel, payload: int) -> None:
    pairs = every_exponent()
    x = np.full(len(pairs), payload, np.uint64).view(np.float64)
    assert np.all(np.isnan(kernel(x, pairs)))


def test_no_other_argument_gives_nan_or_the_wrong_sign(kernel: Kernel) -> None:
    rng = np.random.default_rng(8)
    x = rng.integers(0, 2**64, 1_000_000, dtype=np.uint64).view(np.float64)
    x = x[~np.isnan(x)]
    y = kernel(x, rng.choice(every_exponent(), x.size))
    assert not np.any(np.isnan(y))
    np.testing.assert_array_equal(np.signbit(y), np.signbit(x))


def test_overflows_to_infinity_and_not_before(kernel: Kernel) -> None:
    rng = np.random.default_rng(9)
    x = doubles_between(rng, 2.0**500, LARGEST, 300_000)
    a, pairs = short_exponents(rng, 1.0, x.size)
    power = a * np.log2(x)
    y = kernel(x, pairs)
    assert np.all(np.isinf(y[power > 1024 + 1e-9]))
    assert np.all(np.isfinite(y[power < 1024 - 1e-9]))
    assert 0.2 < np.mean(np.isinf(y)) < 0.8


def test_underflows_gradually(kernel: Kernel) -> None:
    rng = np.random.default_rng(10)
    x = doubles_between(rng, 2.0**-1074, 2.0**-520, 200_000)
    a, pairs = short_exponents(rng, 1.0, x.size)
    y = kernel(x, pairs)
    power = a * np.log2(x)
    assert np.all(y[power < -1076] == 0)
    between = np.flatnonzero((power > -1076) & (power < -1021))
    assert between.size > 3000
    for i in between[:3000]:
        exponent = 1 + Fraction(pairs[i, 0]) + Fraction(pairs[i, 1])
        assert error_ulp(float(x[i]), exponent, float(y[i])) <= tables().ulp_bound


# The same bits everywhere, and no undefined behaviour


@pytest.fixture(scope="session")
def vectors() -> tuple[Doubles, Doubles]:
    """Any bits for x, any exponent, but no NaN: its payload may differ."""
    rng = np.random.default_rng(11)
    x = rng.integers(0, 2**64, 200_000, dtype=np.uint64).view(np.float64)
    x = np.concatenate([x, edges(), doubles_between(rng, 2.0**-30, 2.0**7, 100_000)])
    x = np.concatenate([x, -x, np.array([0.0, -0.0, math.inf, -math.inf])])
    x = x[~np.isnan(x)]
    return x, rng.choice(every_exponent(), x.size)


@pytest.mark.parametrize(
    ("compiler", "optimisation"),
    [
        ("gcc", "-O0"),
        ("gcc", "-O3 -march=native"),
        ("clang", "-O0"),
        ("clang", "-O2"),
        ("clang", "-O3 -march=native"),
    ],
)
def test_every_compiler_gives_the_same_bits(
    kernel: Kernel,
    sources: Path,
    vectors: tuple[Doubles, Doubles],
    compiler: str,
    optimisation: str,
) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    name = f"{compiler}{optimisation}.so".replace(" ", "")
    flags = (*WARNINGS, *optimisation.split(), "-fPIC", "-shared")
    other = load(build(sources, name, compiler, *flags)).power
    np.testing.assert_array_equal(bits(other(*vectors)), bits(kernel(*vectors)))


def test_no_undefined_behaviour(
    kernel: Kernel, sources: Path, vectors: tuple[Doubles, Doubles]
) -> None:
    sanitise = ("-fsanitize=undefined", "-fno-sanitize-recover=all", "-O1", "-DSIG_POW64_FILTER")
    program = build(sources, "sanitised", "gcc", *WARNINGS, *sanitise)
    x, pairs = vectors
    nan = np.array([INFINITY + 1, (1 << 63) - 1, (1 << 64) - 1], np.uint64).view(np.float64)
    # Nor where nobody has checked the exponent.
    wild = np.array([[v, v] for v in (math.nan, math.inf, -math.inf, 1e300, -5.0)])
    rows = [
        np.column_stack([x, pairs]),
        np.column_stack([nan, np.repeat(pair("0.95"), nan.size, axis=0)]),
        np.column_stack([x[: 100 * len(wild)], np.repeat(wild, 100, axis=0)]),
    ]
    asked = np.concatenate(rows).tobytes()
    done = subprocess.run([str(program)], input=asked, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    results = np.frombuffer(done.stdout)[: x.size]
    np.testing.assert_array_equal(bits(results), bits(kernel(x, pairs)))


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="no x87 here")
def test_refuses_to_compile_for_wider_registers(sources: Path) -> None:
    command = ["gcc", "-std=c99", "-mfpmath=387", "-fsyntax-only", str(sources / "tdc_sig_pow64.c")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "the x87 computes in a wider format" in done.stderr


def cortex_m7_program(sources: Path) -> Path:
    facts = common_facts()
    flags = [
        word for k in ("C_FLAGS", "FREESTANDING_FLAGS", "LINK_FLAGS") for word in facts[k].split()
    ]
    elf = sources / "target.elf"
    run(
        f"{CORTEX_M7.toolchain}gcc",
        *(*CORTEX_M7.cpu_flags, *flags, "-DSIG_POW64_TARGET", "-DTICK_CLOCK_HZ=25000000u"),
        # GCC would make a call of memcpy out of memcpy's own loop.
        "-fno-tree-loop-distribute-patterns",
        *(f"-I{folder}" for folder in (STUB, STUB / "include", sources)),
        *(f"-L{CORTEX_M7.folder}", "-T", STUB / "cores" / "sections.ld"),
        f"-Wl,--defsym=STACK_BYTES={facts['STACK_BYTES']}",
        *(STUB / "cores" / "cortex-m" / "core.c", STUB / "runtime" / "start.c"),
        *(STUB / "runtime" / "memory.c", STUB / "pil" / "link_semihosting.c"),
        *(sources / "tdc_sig_pow64.c", DRIVER),
        *("-lgcc", "-o", elf),
    )
    return elf


def test_an_emulated_cortex_m7_gives_the_same_bits(
    kernel: Kernel, sources: Path, vectors: tuple[Doubles, Doubles], tmp_path: Path
) -> None:
    x, pairs = (v[-150_000:] for v in vectors)
    elf = cortex_m7_program(sources)
    (tmp_path / "from_host").write_bytes(np.column_stack([x, pairs]).tobytes())
    command = emulator(CORTEX_M7, elf, common_facts()["QEMU_SEMIHOSTING"].split())
    subprocess.run(command, cwd=tmp_path, check=True, timeout=60, stdin=subprocess.DEVNULL)
    results = np.frombuffer((tmp_path / "to_host").read_bytes())
    np.testing.assert_array_equal(bits(results), bits(kernel(x, pairs)))


@pytest.fixture(scope="session")
def cortex_m7_object(sources: Path) -> Path:
    flags = ("-std=c99", "-O2", *CORTEX_M7.cpu_flags, "-DSIG_POW64_ALONE", "-r", "-nostdlib")
    return build(sources, "driver.o", f"{CORTEX_M7.toolchain}gcc", *flags)


def test_straight_line_on_a_cortex_m7(cortex_m7_object: Path) -> None:
    tool = f"{CORTEX_M7.toolchain}objdump"
    listing = run(tool, "-d", "--no-show-raw-insn", cortex_m7_object)
    body = listing.split("<sig_pow64_alone>:")[1].split("\n\n")[0]
    mnemonics = [m for m in re.findall(r"^\s+[0-9a-f]+:\t(\S+)", body, re.MULTILINE) if m[0] != "."]
    mnemonics = [m for m in mnemonics if not m.startswith("nop")]
    assert mnemonics[-1] in ("pop", "bx", "ldmia.w")
    branches = [m for m in mnemonics[:-1] if re.match(r"(b|bl|bx|cb|it)", m) and m[:3] != "bic"]
    assert branches == []
    assert not [m for m in mnemonics if m.startswith(("vfma", "vfms", "vfnm", "vdiv", "vsqrt"))]
    assert len(mnemonics) <= MAX_INSTRUCTIONS


def test_needs_nothing_but_memcpy(cortex_m7_object: Path) -> None:
    undefined = run(f"{CORTEX_M7.toolchain}nm", "--undefined-only", cortex_m7_object)
    assert {line.split()[-1] for line in undefined.splitlines()} <= {"memcpy"}


# The sample on the command line


def test_a_sample_of_random_doubles() -> None:
    (row,) = sig_pow64.sample(["0.4"], 500)
    assert (row.exponent, row.count) == ("0.4", 500)
    assert 0.5 < row.ulp <= tables().ulp_bound
    assert 0 < row.ulp_at < math.inf


def test_command_line_states_bound_and_sample(capsys: pytest.CaptureFixture[str]) -> None:
    assert sig_pow64.main(["--count", "10", "--exponents", "95/105"]) == 0
    out = capsys.readouterr().out
    assert f"bound: {tables().ulp_bound:.2f} ulp" in out
    assert "95/105" in out


@pytest.mark.parametrize("exponent", ["2.1", "1/0", "half"])
def test_command_line_refuses_what_is_no_exponent(
    exponent: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        sig_pow64.main(["--exponents", exponent])
    assert f"{exponent}: write a number from 0 to 2" in capsys.readouterr().err
