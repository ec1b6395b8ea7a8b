"""Robot files: what a simulated robot is made of, every number with its source.

A robot file (``plant/robots/NAME.toml``) has one table for each part of the plant. Its rigid bodies
are Denavit-Hartenberg links (``[links]``) or a URDF (``[urdf]``). A column such as ``gear_ratio``
holds one value for each joint that the file does not lock, or one value for all. Units are in the
names of the keys; angles are in degrees where people write them. What a file does not give is taken
from the robot that it is ``based_on``.
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
    dahl_joint,
)
from plant.trajectory import RestToRest, to_and_fro
from plant.urdf import TURNING, UrdfBody, UrdfError, UrdfJoint, package_file, read_urdf

ROBOTS = Path(__file__).parent / "robots"

Source = Annotated[str, StringConstraints(min_length=1, strip_whitespace=True)]
Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Vector = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Pair = Annotated[list[FiniteFloat], Field(min_length=2, max_length=2)]
JointNumber = Annotated[int, Field(ge=1)]
JointNumbers = list[JointNumber]
Side = Literal["motor", "joint"]
FrictionName = Literal["lugre", "dahl", "coulomb-stribeck"]


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


class UrdfTable(_SourcedTable):
    """``[urdf]``: the rigid bodies, as a URDF file describes them; it need not have meshes.

    ``file`` is seen from the robot file's folder; with ``package``, an installed Python package,
    it is the end of the path of one of that package's files.
    """

    package: Source | None = None
    file: Source | None = None
    gravity_m_per_s2: NotNegative
    wrist: JointNumbers = []


class TransmissionTable(_SourcedTable):
    """``[transmission]``: gears, and what turns with the motors."""

    gear_ratio: FiniteFloat | list[FiniteFloat]
    motor_inertia_kgm2: NotNegative | list[NotNegative]


class StribeckTable(_SourcedTable):
    """``[friction.stribeck]``: the rise of friction towards standstill."""

    static_over_coulomb: Annotated[FiniteFloat, Field(ge=1)]
    velocity_rad_per_s: Positive


class BristleTable(_SourcedTable):
    """``[friction.bristle]``: LuGre's and Dahl's presliding, at the joint.

    sigma0 is the static level over ``presliding_rad``; ``damping_Nms_per_rad`` is LuGre's sigma1.
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
    based_on: Source | None = None
    controller: Source | None = None
    locked: list[JointNumber | Source] = []
    links: LinksTable | None = None
    urdf: UrdfTable | None = None
    transmission: TransmissionTable | None = None
    flexibility: FlexibilityTable | None = None
    friction: FrictionTable | None = None
    friction_from: Source | None = None
    encoder: EncoderTable | None = None
    drive: DriveTable | None = None
    trajectory: TrajectoryTable | None = None

    @model_validator(mode="after")
    def _complete(self) -> RobotFile:
        if self.friction is not None and self.friction_from is not None:
            raise ValueError("give one of [friction] and friction_from, not both")
        if self.links is not None and self.urdf is not None:
            raise ValueError("give one of the tables [links] and [urdf], not both")
        if self.based_on is not None:
            return self
        if self.links is None and self.urdf is None:
            raise ValueError("give the table [links] or [urdf], or based_on, a robot that has one")
        if self.transmission is None:
            raise ValueError("give the table [transmission], or based_on, a robot that has one")
        return self


Body = LinksTable | UrdfBody
"""The rigid bodies: both have a ``chain`` of joints with name and range, gravity and a wrist."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot with n moving joints; locked joints stand at zero and carry their links rigidly.

    Arrays have shape (n,) and belong to the moving joints in order from the base.

    Attributes:
        name: the robot file's name.
        description: one line.
        body: the rigid bodies, with the joints that are locked, too.
        moving: indices (from 0) into ``chain`` of the joints that move.
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
    body: Body
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
    def chain(self) -> Sequence[Link | UrdfJoint]:
        """The joints from the base, locked ones too."""
        return self.body.chain

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the moving joints."""
        return tuple(self.chain[i].name for i in self.moving)

    @property
    def locked_names(self) -> tuple[str, ...]:
        """Names of the locked joints."""
        return tuple(x.name for i, x in enumerate(self.chain) if i not in self.moving)


def robot_names() -> list[str]:
    """Names of all robot files, sorted."""
    return sorted(path.stem for path in ROBOTS.glob("*.toml"))


def _path(robot: str | Path, folder: Path = Path()) -> Path:
    path = folder / robot
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
    """Reads and validates one robot file; what it doesn't give is that of what it is based on.

    Names of other files in it are seen from the current folder.

    Raises:
        RobotError: it is no TOML or breaks a rule; all broken rules are listed.
    """
    return _read(path, ())


def friction_table(path: Path) -> FrictionTable | None:
    """The friction that a robot file gives, or that of the robot it names for it.

    Raises:
        RobotError: see :func:`read_robot_file`; or the robot that is named gives none itself.
    """
    file = read_robot_file(path)
    if file.friction_from is None:
        return file.friction
    table = read_robot_file(_path(file.friction_from)).friction
    if table is None:
        raise RobotError(f"friction_from: {file.friction_from} has no [friction] of its own")
    return table


def _read(path: Path, variants: tuple[Path, ...]) -> RobotFile:
    """A file that is the base of these variants, each based on the next."""
    own = _from_here(_as_written(path), path.parent)
    if own.based_on is None:
        return own
    base_path = _path_of_base(path, own.based_on)
    if base_path.resolve() in (variant.resolve() for variant in (*variants, path)):
        raise RobotError(f"{path.name}: based_on: {own.based_on} is based on {path.stem} itself")
    base, given = _read(base_path, (*variants, path)), own.model_fields_set
    known = given
    for alternatives in ({"links", "urdf"}, {"friction", "friction_from"}):
        known = known | alternatives if given & alternatives else known
    taken = {key: getattr(base, key) for key in RobotFile.model_fields if key not in known}
    return own.model_copy(update=taken)


def _path_of_base(path: Path, base: str) -> Path:
    try:
        return _path(base, path.parent)
    except RobotError as error:
        raise RobotError(f"{path.name}: based_on: {error}") from error


def _as_written(path: Path) -> RobotFile:
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        # Also bytes that aren't UTF-8, numbers of too many digits, and nests that are too deep.
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


def _from_here(file: RobotFile, folder: Path) -> RobotFile:
    """The file with the names of other files as the current folder sees them."""
    update: dict[str, object] = {}
    if file.controller is not None:
        update["controller"] = str(folder / file.controller)
    if file.friction_from is not None and file.friction_from.endswith(".toml"):
        update["friction_from"] = str(folder / file.friction_from)
    if file.urdf is not None and file.urdf.file is not None and file.urdf.package is None:
        update["urdf"] = file.urdf.model_copy(update={"file": str(folder / file.urdf.file)})
    return file.model_copy(update=update)


def load_robot(
    robot: str | Path,
    *,
    lock_wrist: bool = False,
    friction: FrictionName | None = None,
    urdf: Path | None = None,
) -> Robot:
    """The robot of a file.

    Args:
        robot: a name of :func:`robot_names`, or the path of a ``.toml`` file.
        lock_wrist: locks the joints that the file calls the wrist, at zero.
        friction: another friction model than the file's, with the file's parameters.
        urdf: another URDF than the file's.

    Raises:
        RobotError: unknown name or a file that cannot be used.
    """
    path = _path(robot)
    file = read_robot_file(path)
    try:
        friction_table(path)
        return _resolve(path.stem, file, _body(file, urdf), lock_wrist, friction)
    except (RobotError, UrdfError) as error:
        raise RobotError(f"{path.name}: {error}") from error


def _body(file: RobotFile, urdf: Path | None) -> Body:
    if file.links is not None:
        if urdf is not None:
            raise RobotError("has [links]: only the URDF of a file with [urdf] can be replaced")
        return file.links
    table = file.urdf
    assert table is not None  # the validator's rule
    if urdf is None and table.file is None:
        raise RobotError("urdf.file: name the URDF here, or with --urdf")
    if urdf is None and table.package is not None:
        urdf = package_file(table.package, str(table.file))
    return read_urdf(urdf or Path(str(table.file)), table.gravity_m_per_s2, table.wrist)


def _numbers(key: str, joints: Sequence[int | str], names: Sequence[str]) -> list[int]:
    """The numbers of joints that are given by number or by name."""
    unknown = [j for j in joints if (j > len(names) if isinstance(j, int) else j not in names)]
    if unknown:
        raise RobotError(
            f"{key}: there are no joints {unknown} to lock, only 1 to {len(names)}: "
            f"{', '.join(names)}"
        )
    return [j if isinstance(j, int) else names.index(j) + 1 for j in joints]


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
    name: str, file: RobotFile, body: Body, lock_wrist: bool, friction_name: FrictionName | None
) -> Robot:
    chain: Sequence[Link | UrdfJoint] = body.chain
    names = [joint.name for joint in chain]
    locked, wrist = _numbers("locked", file.locked, names), _numbers("wrist", body.wrist, names)
    if lock_wrist and not wrist:
        raise RobotError("the file names no wrist to lock")
    in_file = [i for i in range(len(names)) if i + 1 not in locked]
    moving = [i for i in in_file if not (lock_wrist and i + 1 in wrist)]
    if not moving:
        raise RobotError("all joints are locked")
    _check_joints(body, moving, file.trajectory is not None)
    columns = _Columns(len(in_file), tuple(in_file.index(i) for i in moving))

    friction, encoder, drive, trajectory = file.friction, file.encoder, file.drive, file.trajectory
    transmission = file.transmission
    assert transmission is not None  # the validator's rule
    gear_ratio = columns.pick("transmission.gear_ratio", transmission.gear_ratio)
    if not np.all(gear_ratio):
        raise RobotError("transmission.gear_ratio must not be 0")
    motor_inertia = columns.pick("transmission.motor_inertia_kgm2", transmission.motor_inertia_kgm2)
    return Robot(
        name=name,
        description=file.description,
        body=body,
        moving=tuple(moving),
        gear_ratio=gear_ratio,
        armature_kgm2=gear_ratio**2 * motor_inertia,
        flexibility=_flexibility(file.flexibility, columns) if file.flexibility else None,
        friction=_friction(friction, columns, gear_ratio, friction_name)
        if friction
        else _friction_of(file.friction_from, len(moving), friction_name),
        encoder=_encoder(encoder, columns, gear_ratio) if encoder else None,
        drive=_drive(drive, columns, gear_ratio) if drive else None,
        trajectory=_trajectory(trajectory, columns, [chain[i] for i in moving])
        if trajectory
        else None,
        sources=_sources("", file) + _sources_of_friction(file.friction_from),
    )


def _check_joints(body: Body, moving: Sequence[int], planned: bool) -> None:
    """A URDF may have joints that no drive of one torque can move."""
    if not isinstance(body, UrdfBody):
        return
    for joint in (body.chain[i] for i in moving):
        fix = f'lock it with locked = ["{joint.name}"]'
        if joint.problem is not None:
            raise RobotError(f"joint {joint.name} {joint.problem}: {fix}")
        if planned and joint.kind not in TURNING:
            raise RobotError(
                f"joint {joint.name} slides, but [trajectory] and controllers are of joints that "
                f"turn: {fix}, or leave [trajectory] out"
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
    model = name or table.model
    if model == "dahl":
        return LuGre(
            tuple(
                dahl_joint(curve, float(z), float(b))
                for curve, z, b in zip(curves, presliding, viscous, strict=True)
            )
        )
    if model == "lugre":
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


def _friction_of(robot: str | None, joints: int, name: FrictionName | None) -> FrictionModel | None:
    """The friction at the joints of another robot, its wrist locked where that makes it fit."""
    if robot is None:
        return None
    candidates = [load_robot(robot, friction=name)]
    if candidates[0].joints != joints and candidates[0].body.wrist:
        candidates.append(load_robot(robot, lock_wrist=True, friction=name))
    for other in candidates:
        if other.joints == joints and other.friction is not None:
            return other.friction
    raise RobotError(f"friction_from: {robot} has no friction of {joints} joints")


def _sources_of_friction(robot: str | None) -> tuple[tuple[str, str], ...]:
    """The sources of friction that another robot's file gives."""
    if robot is None:
        return ()
    return tuple(x for x in load_robot(robot).sources if x[0].split(".")[0] == "friction")


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


def _trajectory(
    table: TrajectoryTable, columns: _Columns, joints: Sequence[Link | UrdfJoint]
) -> RestToRest:
    motion = to_and_fro(
        start_rad=np.deg2rad(columns.pick("trajectory.start_deg", table.start_deg)),
        amplitude_rad=np.deg2rad(columns.pick("trajectory.amplitude_deg", table.amplitude_deg)),
        via=np.asarray(table.via, dtype=np.float64),
        segment_s=float(table.segment_s),
    )
    lowest = np.rad2deg(motion.postures_rad.min(axis=0))
    highest = np.rad2deg(motion.postures_rad.max(axis=0))
    for joint, low, high in zip(joints, lowest, highest, strict=True):
        if joint.range_deg and not joint.range_deg[0] <= low <= high <= joint.range_deg[1]:
            raise RobotError(
                f"trajectory takes the {joint.name} from {low:g} to {high:g} deg, "
                f"its range is {joint.range_deg[0]:g} to {joint.range_deg[1]:g} deg"
            )
    return motion
