"""Robot files: what a simulated robot is made of, every number with its source.

A robot file (``plant/robots/NAME.toml``) has one table for each part of the plant. A column such
as ``gear_ratio`` holds one value for each joint that the file does not lock, or one value for all.
Units are in the names of the keys; angles are in degrees where people write them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    StringConstraints,
    ValidationError,
    model_validator,
)

from codegen.problems import nearest
from plant.drive import Drive
from plant.encoder import COUNTS_PER_PULSE, Encoder, Mounting
from plant.flexibility import Flexibility
from plant.friction import (
    CoulombStribeck,
    CoulombStribeckJoint,
    FrictionModel,
    LuGre,
    LuGreJoint,
    StribeckCurve,
)
from plant.trajectory import RestToRest, to_and_fro

ROBOTS = Path(__file__).parent / "robots"

Source = Annotated[str, StringConstraints(min_length=1, strip_whitespace=True)]
Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Vector = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Pair = Annotated[list[FiniteFloat], Field(min_length=2, max_length=2)]
JointNumbers = list[Annotated[int, Field(ge=1)]]
Side = Literal["motor", "joint"]
FrictionName = Literal["lugre", "coulomb-stribeck"]


class RobotError(ValueError):
    """A robot that does not exist or cannot be used; the message says what to do."""


class _Table(BaseModel):
    # Strict: a number in quotes is a mistake, not a number.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class _SourcedTable(_Table):
    source: Source


class InertiaTensor(_Table):
    """Inertia about the centre of mass in the axes of the link's frame [kg m^2]."""

    xx: FiniteFloat
    yy: FiniteFloat
    zz: FiniteFloat
    xy: FiniteFloat = 0.0
    yz: FiniteFloat = 0.0
    xz: FiniteFloat = 0.0

    def matrix(self) -> NDArray[np.float64]:
        """The symmetric tensor, shape (3, 3)."""
        return np.array(
            [
                [self.xx, self.xy, self.xz],
                [self.xy, self.yy, self.yz],
                [self.xz, self.yz, self.zz],
            ]
        )


class Link(_Table):
    """One link with the revolute joint that moves it, in Denavit-Hartenberg form."""

    name: Source
    a_m: FiniteFloat
    alpha_deg: FiniteFloat
    d_m: FiniteFloat
    mass_kg: NotNegative
    center_of_mass_m: Vector
    inertia_kgm2: InertiaTensor
    range_deg: Pair | None = None


class LinksTable(_SourcedTable):
    """``[links]``: the rigid bodies, from the base outwards."""

    convention: Literal["standard-dh", "modified-dh"]
    gravity_m_per_s2: NotNegative
    wrist: JointNumbers = []
    chain: Annotated[list[Link], Field(min_length=1)]


class TransmissionTable(_SourcedTable):
    """``[transmission]``: gears, and what turns with the motors."""

    gear_ratio: FiniteFloat | list[FiniteFloat]
    motor_inertia_kgm2: NotNegative | list[NotNegative]


class StribeckTable(_SourcedTable):
    """``[friction.stribeck]``: the rise of friction towards standstill."""

    static_over_coulomb: Annotated[FiniteFloat, Field(ge=1)]
    velocity_rad_per_s: Positive


class BristleTable(_SourcedTable):
    """``[friction.bristle]``: LuGre's presliding, at the joint.

    sigma0 is the static level over ``presliding_rad``; ``damping_Nms_per_rad`` is sigma1.
    """

    presliding_rad: Positive | list[Positive]
    damping_Nms_per_rad: NotNegative | list[NotNegative]


class RegularisationTable(_SourcedTable):
    """``[friction.regularisation]``: Coulomb-Stribeck's tanh, at the joint."""

    width_rad_per_s: Positive


class RippleTable(_SourcedTable):
    """``[friction.ripple]``: how the level varies with the motor's angle."""

    amplitude: Annotated[FiniteFloat, Field(ge=0, lt=1)]
    cycles_per_motor_turn: Positive


class FlexibilityTable(_SourcedTable):
    """``[flexibility]``: springs and dampers between motors and links, at the joint."""

    stiffness_Nm_per_rad: Positive | list[Positive]
    damping_Nms_per_rad: NotNegative | list[NotNegative]


class FrictionTable(_SourcedTable):
    """``[friction]``: Coulomb levels [positive, negative motion] and viscous friction."""

    model: FrictionName
    given_at: Side
    coulomb_Nm: list[Pair]
    viscous_Nms_per_rad: NotNegative | list[NotNegative]
    stribeck: StribeckTable
    bristle: BristleTable
    regularisation: RegularisationTable
    ripple: RippleTable | None = None

    @model_validator(mode="after")
    def _signs(self) -> FrictionTable:
        if any(positive <= 0.0 or negative >= 0.0 for positive, negative in self.coulomb_Nm):
            raise ValueError("coulomb_Nm: each joint needs [a positive, a negative] level")
        return self


class EncoderTable(_SourcedTable):
    """``[encoder]``: incremental encoders on motor shafts or joints, all edges counted."""

    mounted: Mounting = "motor"
    pulses_per_rev: Annotated[int, Field(gt=0)]
    noise_counts: NotNegative | list[NotNegative] = 0.0
    phase: Annotated[FiniteFloat, Field(ge=0, lt=1)] = 0.0
    offset_counts: int = 0


class DriveTable(_SourcedTable):
    """``[drive]``: torque limits, delay (a fraction of the sample time), current loop's bandwidth.

    Without a bandwidth the torque is the command.
    """

    given_at: Side
    torque_limit_Nm: Positive | list[Positive]
    bandwidth_Hz: Positive | list[Positive] | None = None
    delay: Annotated[FiniteFloat, Field(ge=0, le=1)] = 0.0


class TrajectoryTable(_SourcedTable):
    """``[trajectory]``: rest to rest through start + via x amplitude."""

    start_deg: list[FiniteFloat]
    amplitude_deg: FiniteFloat | list[FiniteFloat]
    via: Annotated[list[FiniteFloat], Field(min_length=2)]
    segment_s: Positive


class RobotFile(_Table):
    """A robot file as it is written."""

    description: Source
    links_from: str | None = None
    locked: JointNumbers = []
    links: LinksTable | None = None
    transmission: TransmissionTable
    flexibility: FlexibilityTable | None = None
    friction: FrictionTable | None = None
    encoder: EncoderTable | None = None
    drive: DriveTable | None = None
    trajectory: TrajectoryTable | None = None

    @model_validator(mode="after")
    def _one_origin_of_links(self) -> RobotFile:
        if (self.links is None) == (self.links_from is None):
            raise ValueError("give either the table [links] or links_from, the robot to take them")
        return self


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot with n moving joints; locked joints stand at zero and carry their links rigidly.

    Arrays have shape (n,) and belong to the moving joints in order from the base.

    Attributes:
        name: the robot file's name.
        description: one line.
        links: the links and their conventions, locked ones too.
        moving: indices (from 0) into ``links.chain`` of the joints that move.
        gear_ratio: motor turns per joint turn; negative where they turn against each other.
        armature_kgm2: motor inertia at the joint, gear_ratio^2 x motor inertia.
        flexibility: None where joints are rigid.
        friction: None where the file has none; likewise the following.
        encoder: see :class:`plant.encoder.Encoder`.
        drive: see :class:`plant.drive.Drive`.
        trajectory: the motion that the file proposes.
        sources: (table, source) for each table of the file.
    """

    name: str
    description: str
    links: LinksTable
    moving: tuple[int, ...]
    gear_ratio: NDArray[np.float64]
    armature_kgm2: NDArray[np.float64]
    flexibility: Flexibility | None
    friction: FrictionModel | None
    encoder: Encoder | None
    drive: Drive | None
    trajectory: RestToRest | None
    sources: tuple[tuple[str, str], ...]

    @property
    def joints(self) -> int:
        """Number of moving joints."""
        return len(self.moving)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the moving joints."""
        return tuple(self.links.chain[i].name for i in self.moving)


def robot_names() -> list[str]:
    """Names of all robot files, sorted."""
    return sorted(path.stem for path in ROBOTS.glob("*.toml"))


def _path(robot: str | Path) -> Path:
    path = Path(robot)
    if path.suffix == ".toml":
        if not path.is_file():
            raise RobotError(f"no robot file {path}")
        return path
    path = ROBOTS / f"{robot}.toml"
    if str(robot) not in robot_names():
        likely = nearest(str(robot), robot_names())
        hint = f"did you mean {likely!r}?" if likely else f"there are {', '.join(robot_names())}"
        raise RobotError(f"unknown robot {str(robot)!r}; {hint}")
    return path


def read_robot_file(path: Path) -> RobotFile:
    """Reads and validates one robot file.

    Raises:
        RobotError: it is no TOML or breaks a rule; all broken rules are listed.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise RobotError(f"{path.name}: no valid TOML: {error}") from error
    try:
        return RobotFile.model_validate(data)
    except ValidationError as error:
        lines = [
            f"{path.name}: {'.'.join(str(part) for part in problem['loc']) or 'the file'}: "
            f"{problem['msg']}"
            for problem in error.errors()
        ]
        raise RobotError("\n".join(lines)) from error


def load_robot(
    robot: str | Path, *, lock_wrist: bool = False, friction: FrictionName | None = None
) -> Robot:
    """The robot of a file.

    Args:
        robot: a name of :func:`robot_names`, or the path of a ``.toml`` file.
        lock_wrist: locks the joints that the links call their wrist, at zero.
        friction: another friction model than the file's, with the file's parameters.

    Raises:
        RobotError: unknown name or a file that cannot be used.
    """
    path = _path(robot)
    file = read_robot_file(path)
    try:
        return _resolve(path.stem, file, lock_wrist, friction)
    except RobotError as error:
        raise RobotError(f"{path.name}: {error}") from error


def _links(file: RobotFile) -> LinksTable:
    if file.links is not None:
        return file.links
    assert file.links_from is not None  # the validator's rule
    links = read_robot_file(_path(file.links_from)).links
    if links is None:
        raise RobotError(f"links_from: {file.links_from} has no [links] of its own")
    return links


@dataclass(frozen=True)
class _Columns:
    """Which of the values in a file's columns belong to joints that move."""

    in_file: int
    kept: tuple[int, ...]

    def pick(
        self, key: str, value: float | Sequence[float] | Sequence[Sequence[float]]
    ) -> NDArray[np.float64]:
        """A column's values of the moving joints, shape (n,) or (n, ...)."""
        column = np.asarray(value, dtype=np.float64)
        if column.ndim == 0:
            return np.full(len(self.kept), float(column))
        if len(column) != self.in_file:
            raise RobotError(
                f"{key} has {len(column)} values, {self.in_file} joints are not locked"
            )
        picked: NDArray[np.float64] = column[list(self.kept)]
        return picked


def _resolve(
    name: str, file: RobotFile, lock_wrist: bool, friction_name: FrictionName | None
) -> Robot:
    links = _links(file)
    count = len(links.chain)
    wrist = [*links.wrist] if lock_wrist else []
    if lock_wrist and not wrist:
        raise RobotError("the links name no wrist to lock")
    if unknown := [j for j in [*file.locked, *links.wrist] if j > count]:
        raise RobotError(f"there are no joints {unknown} to lock, only 1 to {count}")
    in_file = [i for i in range(count) if i + 1 not in file.locked]
    moving = [i for i in in_file if i + 1 not in wrist]
    if not moving:
        raise RobotError("all joints are locked")
    columns = _Columns(len(in_file), tuple(in_file.index(i) for i in moving))

    friction, encoder, drive, trajectory = file.friction, file.encoder, file.drive, file.trajectory
    transmission = file.transmission
    gear_ratio = columns.pick("transmission.gear_ratio", transmission.gear_ratio)
    if not np.all(gear_ratio):
        raise RobotError("transmission.gear_ratio must not be 0")
    motor_inertia = columns.pick("transmission.motor_inertia_kgm2", transmission.motor_inertia_kgm2)
    return Robot(
        name=name,
        description=file.description,
        links=links,
        moving=tuple(moving),
        gear_ratio=gear_ratio,
        armature_kgm2=gear_ratio**2 * motor_inertia,
        flexibility=_flexibility(file.flexibility, columns) if file.flexibility else None,
        friction=_friction(friction, columns, gear_ratio, friction_name) if friction else None,
        encoder=_encoder(encoder, columns, gear_ratio) if encoder else None,
        drive=_drive(drive, columns, gear_ratio) if drive else None,
        trajectory=_trajectory(trajectory, columns, [links.chain[i] for i in moving])
        if trajectory
        else None,
        sources=_sources("", file) + (() if file.links else (("links", links.source),)),
    )


def _sources(prefix: str, table: _Table) -> tuple[tuple[str, str], ...]:
    found: list[tuple[str, str]] = []
    for key in type(table).model_fields:
        part = getattr(table, key)
        if isinstance(part, _SourcedTable):
            found += [(prefix + key, part.source), *_sources(f"{prefix}{key}.", part)]
    return tuple(found)


def _friction(
    table: FrictionTable,
    columns: _Columns,
    gear_ratio: NDArray[np.float64],
    name: FrictionName | None,
) -> FrictionModel:
    # At the joint, Coulomb torque of the motor is |G| times as large, viscous friction G^2 times.
    # The published levels belong to the sign of the joint velocity, so G's sign changes nothing.
    gear = np.abs(gear_ratio) if table.given_at == "motor" else np.ones_like(gear_ratio)
    coulomb = gear[:, np.newaxis] * np.abs(columns.pick("friction.coulomb_Nm", table.coulomb_Nm))
    viscous = gear**2 * columns.pick("friction.viscous_Nms_per_rad", table.viscous_Nms_per_rad)
    ripple = table.ripple
    curves = [
        StribeckCurve(
            coulomb_positive_Nm=float(positive),
            coulomb_negative_Nm=float(negative),
            static_over_coulomb=float(table.stribeck.static_over_coulomb),
            velocity_rad_per_s=float(table.stribeck.velocity_rad_per_s),
            ripple_amplitude=float(ripple.amplitude) if ripple else 0.0,
            ripple_rad_per_rad=float(ripple.cycles_per_motor_turn * ratio) if ripple else 0.0,
        )
        for (positive, negative), ratio in zip(coulomb, gear_ratio, strict=True)
    ]
    presliding = columns.pick("friction.bristle.presliding_rad", table.bristle.presliding_rad)
    damping = columns.pick(
        "friction.bristle.damping_Nms_per_rad", table.bristle.damping_Nms_per_rad
    )
    if (name or table.model) == "lugre":
        return LuGre(
            tuple(
                LuGreJoint(curve, curve.mean_static_level / float(z), float(sigma1), float(sigma2))
                for curve, z, sigma1, sigma2 in zip(
                    curves, presliding, damping, viscous, strict=True
                )
            )
        )
    width = float(table.regularisation.width_rad_per_s)
    return CoulombStribeck(
        tuple(
            CoulombStribeckJoint(curve, float(b), width)
            for curve, b in zip(curves, viscous, strict=True)
        )
    )


def _flexibility(table: FlexibilityTable, columns: _Columns) -> Flexibility:
    return Flexibility(
        columns.pick("flexibility.stiffness_Nm_per_rad", table.stiffness_Nm_per_rad),
        columns.pick("flexibility.damping_Nms_per_rad", table.damping_Nms_per_rad),
    )


def _encoder(table: EncoderTable, columns: _Columns, gear_ratio: NDArray[np.float64]) -> Encoder:
    n = len(gear_ratio)
    return Encoder.on_shaft(
        gear_ratio if table.mounted == "motor" else np.ones(n),
        counts_per_rev=np.full(n, float(COUNTS_PER_PULSE * table.pulses_per_rev)),
        phase=np.full(n, float(table.phase)),
        offset_counts=np.full(n, table.offset_counts, dtype=np.int64),
        mounted=table.mounted,
        noise_counts=columns.pick("encoder.noise_counts", table.noise_counts),
    )


def _drive(table: DriveTable, columns: _Columns, gear_ratio: NDArray[np.float64]) -> Drive:
    limit = columns.pick("drive.torque_limit_Nm", table.torque_limit_Nm)
    at_joint = np.abs(gear_ratio) * limit if table.given_at == "motor" else limit
    if table.bandwidth_Hz is None:
        return Drive(at_joint, delay=float(table.delay))
    bandwidth = columns.pick("drive.bandwidth_Hz", table.bandwidth_Hz)
    return Drive(at_joint, delay=float(table.delay), bandwidth_Hz=bandwidth)


def _trajectory(table: TrajectoryTable, columns: _Columns, links: Sequence[Link]) -> RestToRest:
    motion = to_and_fro(
        start_rad=np.deg2rad(columns.pick("trajectory.start_deg", table.start_deg)),
        amplitude_rad=np.deg2rad(columns.pick("trajectory.amplitude_deg", table.amplitude_deg)),
        via=np.asarray(table.via, dtype=np.float64),
        segment_s=float(table.segment_s),
    )
    lowest = np.rad2deg(motion.postures_rad.min(axis=0))
    highest = np.rad2deg(motion.postures_rad.max(axis=0))
    for link, low, high in zip(links, lowest, highest, strict=True):
        if link.range_deg and not link.range_deg[0] <= low <= high <= link.range_deg[1]:
            raise RobotError(
                f"trajectory takes the {link.name} from {low:g} to {high:g} deg, "
                f"its range is {link.range_deg[0]:g} to {link.range_deg[1]:g} deg"
            )
    return motion
