"""A controller on an emulated microcontroller, asked for a step and answering with a torque.

The target runs `firmware_stub/pil/`; host and target talk in binary frames, through two FIFOs by
semihosting or through the serial port.
"""

from __future__ import annotations

import ctypes
import os
import re
import select
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from codegen.emit import identity
from plant.assembly import Floats
from plant.controller import GeneratedController, Structures
from verification.firmware import (
    SERIAL_ON_STDIO,
    STUB,
    Board,
    common_facts,
    emulator,
)

Link = Literal["semihosting", "uart"]
IMAGES: dict[Link, str] = {"semihosting": "pil", "uart": "pil_uart"}

# An emulated tick takes microseconds; a target that is silent for this long has crashed.
SILENCE_S = 20.0
_LOOK_AFTER_S = 0.2
_SPIN_S = 2e-4


class TargetError(Exception):
    """The target is silent, has ended, or holds another controller."""


def _protocol() -> dict[str, int]:
    """The numbers that `pil/protocol.h` defines, by name."""
    text = (STUB / "pil" / "protocol.h").read_text(encoding="utf-8")
    found = re.findall(r"^#define (PIL_\w+) (\w+?)u\b", text, flags=re.MULTILINE)
    return {name: int(value, 0) for name, value in found}


@dataclass(frozen=True)
class Reply:
    """What the target answers to a request.

    Attributes:
        status: of ``tdc_NAME_init`` or ``tdc_NAME_step``.
        stack_bytes: the controller's stack below its caller, 0 where it was not measured.
        torque: in the C's own numbers and unit, shape (n,).
    """

    status: int
    stack_bytes: int
    torque: NDArray[Any]


@dataclass(frozen=True)
class Frames:
    """The structures of `pil/protocol.h` for a controller.

    They lie in memory as the compilers of both sides lay them out; the hello tells their sizes.
    """

    reset: type[ctypes.Structure]
    request: type[ctypes.Structure]
    reply: type[ctypes.Structure]


def frames(types: Structures, joints: int) -> Frames:
    """The frames that hold a controller's structures."""

    def struct(name: str, **fields: Any) -> type[ctypes.Structure]:
        return type(name, (ctypes.Structure,), {"_fields_": list(fields.items())})

    torque = types.torque * joints
    reset = struct(
        "pil_reset", config=types.config, counts=ctypes.c_int32 * joints, holding_torque=torque
    )
    either = [("reset", reset), ("input", types.input)]
    payload = type("payload", (ctypes.Union,), {"_fields_": either})
    return Frames(
        reset,
        struct("pil_request", command=ctypes.c_uint32, payload=payload),
        struct("pil_reply", status=ctypes.c_int32, stack=ctypes.c_uint32, torque=torque),
    )


class Target:
    """A controller on an emulated board; a context manager that leaves no process behind.

    Args:
        board: the board.
        image: the ELF file of `pil.elf` or `pil_uart.elf`.
        controller: the host's side of the same controller.
        link: how the image talks.

    Raises:
        ToolError: the emulator is missing.
        TargetError: the image does not run, or holds another controller.
    """

    def __init__(
        self,
        board: Board,
        image: Path,
        controller: GeneratedController,
        link: Link = "semihosting",
    ) -> None:
        self._board, self._image, self._link = board, image, link
        self._numbers = _protocol()
        self._torque = controller.units.torque
        self._frames = frames(controller.types, controller.joints)
        self.reply = np.dtype(self._frames.reply)
        self._hello = np.array(
            [
                self._numbers["PIL_MAGIC"],
                identity(controller.specification),
                controller.joints,
                ctypes.sizeof(controller.types.config),
                ctypes.sizeof(controller.types.input),
                ctypes.sizeof(self._frames.request),
                self.reply.itemsize,
            ],
            dtype="<u4",
        )
        self._scratch = tempfile.TemporaryDirectory(prefix="tdc-pil-")
        self._files: list[int] = []
        self._process: subprocess.Popen[bytes] | None = None
        try:
            self._start()
            self._check_hello()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """The target itself, already running."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Ends the emulator."""
        self.close()

    def _start(self) -> None:
        scratch = Path(self._scratch.name)
        with (scratch / "messages").open("wb") as messages:
            if self._link == "semihosting":
                self._start_on_fifos(scratch, messages.fileno())
            else:
                self._start_on_pipes(messages.fileno())
        for file in self._files:
            os.set_blocking(file, False)

    def _start_on_fifos(self, scratch: Path, messages: int) -> None:
        for name in ("from_host", "to_host"):
            os.mkfifo(scratch / name)
        # Opened for both directions, the FIFO needs no reader yet, so that nobody waits here.
        self._files.append(os.open(scratch / "from_host", os.O_RDWR | os.O_CLOEXEC))
        self._files.append(os.open(scratch / "to_host", os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC))
        options = tuple(common_facts()["QEMU_SEMIHOSTING"].split())
        self._process = subprocess.Popen(
            emulator(self._board, self._image.resolve(), options),
            cwd=scratch,
            stdin=subprocess.DEVNULL,
            stdout=messages,
            stderr=messages,
        )

    def _start_on_pipes(self, messages: int) -> None:
        self._process = subprocess.Popen(
            emulator(self._board, self._image.resolve(), SERIAL_ON_STDIO),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=messages,
            bufsize=0,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        # Our own copies: Popen closes its ends with the process.
        self._files.append(os.dup(self._process.stdin.fileno()))
        self._files.append(os.dup(self._process.stdout.fileno()))
        self._process.stdin.close()
        self._process.stdout.close()

    def _check_hello(self) -> None:
        hello = np.frombuffer(self.exchange(b"", self._hello.nbytes), "<u4")
        if not np.array_equal(hello, self._hello):
            raise TargetError(
                f"{self._image} holds another controller than the host: it says {hello.tolist()}, "
                f"the host expects {self._hello.tolist()} (pil_hello in pil/protocol.h)"
            )

    def exchange(self, requests: bytes, reply_bytes: int) -> bytes:
        """Sends requests, and reads meanwhile until so many bytes have come back.

        Raises:
            TargetError: the target ended or fell silent.
        """
        to_target, from_target = self._files
        to_send, received = memoryview(requests), bytearray()
        deadline = time.monotonic() + SILENCE_S
        waiting = select.poll()
        waiting.register(from_target, select.POLLIN)
        if to_send:
            waiting.register(to_target, select.POLLOUT)
        while to_send or len(received) < reply_bytes:
            events = dict(self._soon(waiting) or waiting.poll(_LOOK_AFTER_S * 1e3))
            if events:
                deadline = time.monotonic() + SILENCE_S
            elif self._has_ended() or time.monotonic() > deadline:
                raise self._silent()
            if events.get(to_target, 0) & select.POLLOUT:
                to_send = to_send[self._write(to_target, to_send) :]
                if not to_send:
                    waiting.unregister(to_target)
            if from_target in events:
                part = os.read(from_target, max(reply_bytes - len(received), 1))
                if not part:
                    raise self._silent()
                received += part
        return bytes(received)

    @staticmethod
    def _soon(waiting: select.poll) -> list[tuple[int, int]]:
        """Events within the time that a tick takes: a core that sleeps wakes up more slowly."""
        until = time.monotonic() + _SPIN_S
        while not (events := waiting.poll(0)) and time.monotonic() < until:
            pass
        return events

    def _write(self, file: int, data: memoryview) -> int:
        try:
            return os.write(file, data)
        except BlockingIOError:  # a pipe takes a small write whole or not at all
            return 0
        except BrokenPipeError:
            raise self._silent() from None

    def _has_ended(self) -> bool:
        return self._process is None or self._process.poll() is not None

    def _silent(self) -> TargetError:
        # The end of its output comes a moment before the end of a process.
        with suppress(subprocess.TimeoutExpired):
            if self._process is not None:
                self._process.wait(timeout=_LOOK_AFTER_S)
        messages = (Path(self._scratch.name) / "messages").read_text(errors="replace").strip()
        how = "ended" if self._has_ended() else f"said nothing for {SILENCE_S:g} s"
        return TargetError(
            f"the target {self._board.name} ({self._image}) {how}"
            + (f"; the emulator says:\n{messages}" if messages else "")
        )

    def _request(self, command: str, payload: bytes) -> bytes:
        request = self._frames.request
        number = self._numbers[command].to_bytes(4, "little")
        start = number.ljust(request.payload.offset, b"\0")
        return (start + payload).ljust(ctypes.sizeof(request), b"\0")

    def _ask(self, command: str, payload: bytes) -> Reply:
        answer = self.exchange(self._request(command, payload), self.reply.itemsize)
        record = np.frombuffer(answer, self.reply)[0]
        return Reply(int(record["status"]), int(record["stack"]), record["torque"].copy())

    def reset(
        self, config: ctypes.Structure, counts: NDArray[np.int32], torque_Nm: Floats
    ) -> Reply:
        """Calls ``tdc_NAME_init`` on the target, with this configuration."""
        payload = self._frames.reset(config=config)
        payload.counts[:] = counts.tolist()
        payload.holding_torque[:] = self._torque.stored(torque_Nm).tolist()
        return self._ask("PIL_RESET", bytes(payload))

    def step(self, given: bytes, *, measured: bool = False) -> Reply:
        """Calls ``tdc_NAME_step`` on the target.

        Args:
            given: the bytes of a ``tdc_NAME_input``.
            measured: whether the target also measures the step's stack.
        """
        return self._ask("PIL_MEASURED_STEP" if measured else "PIL_STEP", given)

    def replay(self, inputs: Sequence[bytes], *, measured: bool = False) -> NDArray[Any]:
        """Streams recorded inputs without waiting for each reply; records of type ``reply``."""
        command = "PIL_MEASURED_STEP" if measured else "PIL_STEP"
        requests = b"".join(self._request(command, given) for given in inputs)
        return np.frombuffer(self.exchange(requests, len(inputs) * self.reply.itemsize), self.reply)

    def close(self) -> None:
        """Ends the emulator and removes its files; may be called again."""
        # The end of its FIFO is what the target takes for the end of the run.
        for file in self._files:
            os.close(file)
        self._files.clear()
        if self._process is not None:
            if self._link == "uart":
                self._process.terminate()
            try:
                self._process.wait(timeout=2.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._scratch.cleanup()
