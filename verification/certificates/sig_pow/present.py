"""Every generated kernel of sig_pow with what is proved of it, and its certificate, checked."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from plant.native import GENERATED
from verification.certificates.sig_pow import check, exhaustive
from verification.certificates.sig_pow.kernel import KERNELS, GeneratedKernel, KernelError, read
from verification.certificates.sig_pow.prove import Proof, Statement, certificate, prove
from verification.evidence import Evidence, plain


@dataclass(frozen=True)
class Verdict:
    """A kernel's statements.

    Attributes:
        function: the kernel's name in C.
        controllers: the directories of `generated/` that ship it.
        statements: all that was found.
        certificate: as the checker took it.
    """

    function: str
    controllers: tuple[str, ...]
    statements: tuple[Statement, ...]
    certificate: dict[str, object]

    @property
    def holds(self) -> bool:
        """Whether every statement does."""
        return all(s.holds for s in self.statements)


def shipped(root: Path = GENERATED) -> Iterator[tuple[tuple[str, ...], GeneratedKernel]]:
    """Each kernel that is generated, once for each content, and whose it is.

    Raises:
        KernelError: the C is another one than the stages describe, or there is none.
    """
    none = True
    for kernel in KERNELS:
        contents: dict[GeneratedKernel, list[str]] = {}
        for header in sorted(root.glob(f"*/{kernel.header}")):
            generated = read(kernel, header.parent)
            # The directory does not tell them apart.
            key = next(
                (g for g in contents if replace(g, directory=header.parent) == generated), generated
            )
            contents.setdefault(key, []).append(header.parent.name)
        for generated, names in contents.items():
            none = False
            yield tuple(names), generated
    if none:
        raise KernelError(f"no generated sig_pow in {root.name}/")


def checked(proof: Proof) -> tuple[dict[str, object], Statement]:
    """The certificate as JSON has it, and whether the checker verifies it."""
    generated = proof.generated
    kernel = generated.kernel
    made: dict[str, object] = json.loads(json.dumps(plain(certificate(proof))))
    texts = (
        (generated.directory / name).read_text("utf-8") for name in (kernel.header, kernel.source)
    )
    wrong = list(check.complaints(made, *texts))
    return made, Statement(
        "certificate",
        "A checker with other formulas and other interval arithmetic verifies the certificate.",
        "; ".join(wrong[:3]) or "no complaint",
        Evidence.PROVED,
        not wrong,
    )


def verdict(controllers: tuple[str, ...], generated: GeneratedKernel, every: bool) -> Verdict:
    """Proves a kernel and checks the certificate.

    Args:
        controllers: whose it is.
        generated: the kernel.
        every: also run the compiled halves at every argument, where these are few enough.

    Raises:
        CompilerError: the compiler is missing or refuses the C.
    """
    proof = prove(generated)
    made, statement = checked(proof)
    found = [*proof.statements, statement]
    if every and exhaustive.can_try_all(proof):
        found += exhaustive.statements(proof, exhaustive.integers(proof))
    return Verdict(generated.kernel.function, controllers, tuple(found), made)
