"""TOML files with damage, for hypothesis: what a person or a disk may make of a good one."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import strategies as st

_VALUES = (
    *(b"= nan", b"= inf", b"= -inf", b"= 1e999999", b"= 1e-999999", b"= -0.0", b"= -1", b"= 0"),
    *(b"= []", b"= {}", b"= [[1]]", b'= ""', b'= "1/0"', b'= "1/3"', b"= true", b"= 1979-05-27"),
    *(b"= 0x7fffffffffffffff", b"= " + 500 * b"9", b"= " + 5000 * b"9"),
)
_STRUCTURE = (
    *(b"\n[law]\n", b"\n[[law]]\n", b"\n[safety.law]\n", b"\nlaw = 3\n", b"\r\n", b"\x00", b"#"),
    *(b"\xef\xbb\xbf", b"\xff", b"'''", b"\n[friction]\n", b"\n[[event]]\n", b"joints = 1"),
)

UNREADABLE = {
    "no UTF-8": b"\xff\xfe",
    "no TOML": b"name = ",
    "a key twice": b"a = 1\na = 1",
    "too many digits": b"a = " + 5000 * b"9",
    "too deep": b"a = " + 3000 * b"[",
}
"""Files that no TOML reader reads, each for another reason."""


@st.composite
def damaged_files(draw: st.DrawFn, texts: Sequence[bytes]) -> bytes:
    """One of the texts with some slices replaced: by bytes, by TOML, or by another's slice."""
    text = draw(st.sampled_from(texts))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = start + draw(st.integers(0, 24))
        other = draw(st.sampled_from(texts))
        at = draw(st.integers(0, len(other)))
        new = draw(
            st.one_of(
                st.binary(max_size=8),
                st.sampled_from(_VALUES),
                st.sampled_from(_STRUCTURE),
                st.just(other[at : at + draw(st.integers(0, 60))]),
            )
        )
        text = text[:start] + new + text[end:]
    return text
