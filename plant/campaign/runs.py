"""The runs of a campaign: pure functions of the campaign, the plant, the seed and the gain set."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from codegen.controller import Controller, load
from codegen.problems import Problem, SpecificationError
from plant.assembly import Floats, Plant, PlantError, build_plant
from plant.campaign import plants
from plant.campaign.specification import AS_SPECIFIED, CampaignSpecification
from plant.closed_loop import Beginning, ControllerError, Run, beginning, run_from, switch_on
from plant.compiled.loop import CompiledLoop
from plant.controller import GeneratedController
from plant.flight import check_encoders, default_robot
from plant.native import c_files, shared_library, sources_of
from plant.robot import (
    ROBOTS,
    Body,
    FrictionName,
    LinksTable,
    Robot,
    friction_table,
    load_robot,
    read_robot_file,
)
from plant.trajectory import RestToRest

Row = dict[str, Any]
"""The figures of a run by column, see :func:`plant.campaign.results.schema`."""


class CampaignError(Exception):
    """A campaign that can't run; the message says why and what to do."""


@dataclass(frozen=True)
class Campaign:
    """A campaign with all that its runs depend on, for any process on any machine.

    Campaigns with the same hashes are equal.

    Attributes:
        inputs_sha256: of the specification but for the number of plants, the gain sets and the
            robot.
        c_sha256: of the controller's generated C.
        libraries: the names of the compiled libraries, which end in a hash of their C, one for
            each friction model.
        specification: as written.
        shipped: the controller whose C is flown.
        gain_sets: the same controller by gain set, its configuration tuned.
        robots: by friction model.
        sources: the folder with the C; other machines may have none.
    """

    inputs_sha256: str
    c_sha256: str
    libraries: tuple[str, ...]
    specification: CampaignSpecification = field(compare=False)
    shipped: Controller = field(compare=False)
    gain_sets: dict[str, Controller] = field(compare=False)
    robots: dict[FrictionName, Robot] = field(compare=False)
    sources: Path = field(compare=False)

    @property
    def joint_names(self) -> list[str]:
        """The joints, from the base."""
        return [joint.name for joint in self.shipped.joints]

    @property
    def runs_per_plant(self) -> int:
        """Gain sets times seeds."""
        return len(self.gain_sets) * self.specification.plants.seeds

    @property
    def runs(self) -> int:
        """Number of all runs."""
        return self.runs_per_plant * self.specification.plants.count


def prepare(specification: CampaignSpecification, folder: Path) -> Campaign:
    """Resolves what a specification names, and compiles its C.

    Args:
        specification: of the campaign.
        folder: from which its file names are seen.

    Raises:
        SpecificationError: the controller, a gain set or a range can't be used.
        RobotError, PlantError: the robot can't be used, or doesn't fit the controller.
        CompilerError: the C can't be compiled.
    """
    path = folder / specification.controller
    shipped = load(path)
    gain_sets = {
        name: load(path, experiment=None if name == AS_SPECIFIED else name)
        for name in specification.experiments
    }
    file = _robot_file(specification.robot or default_robot(shipped), folder)
    robots = _robots(file, specification)
    for robot in robots.values():
        check_encoders(shipped, robot)
        _check_amplitude(robot, specification)
        _check_springs(robot, specification)
    friction = friction_table(file)
    sources = sources_of(shipped)
    workshop = Workshop(specification, shipped, robots, sources)
    _check_gains(workshop, gain_sets)
    parts = {
        "specification": specification.model_dump(mode="json", exclude={"plants": {"count"}}),
        "gain_sets": {name: gains.canonical() for name, gains in gain_sets.items()},
        "robot": read_robot_file(file).model_dump(mode="json", exclude={"controller", "urdf"}),
        "body": _plain(next(iter(robots.values())).body),
        # Which model is random; by its own file a robot may take the numbers from another.
        "friction": friction.model_dump(mode="json") if friction is not None else None,
    }
    return Campaign(
        inputs_sha256=hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest(),
        c_sha256=_sha256(c_files(sources)),
        libraries=workshop.libraries,
        specification=specification,
        shipped=shipped,
        gain_sets=gain_sets,
        robots=robots,
        sources=sources,
    )


def _plain(body: Body) -> dict[str, Any]:
    """The rigid bodies as plain data: a URDF by what it says, wherever the file is."""
    return body.model_dump(mode="json") if isinstance(body, LinksTable) else asdict(body)


def _sha256(files: dict[str, bytes]) -> str:
    digest = hashlib.sha256()
    for name, content in sorted(files.items()):
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _robot_file(robot: str, folder: Path) -> Path:
    return folder / robot if robot.endswith(".toml") else ROBOTS / f"{robot}.toml"


def _robots(file: Path, specification: CampaignSpecification) -> dict[FrictionName, Robot]:
    # By name where it has one: an unknown name is then told with the known ones.
    name = file.stem if file.parent == ROBOTS else file
    names = specification.plants.friction_models
    if names is not None:
        return {friction: load_robot(name, friction=friction) for friction in names}
    friction = friction_table(file)
    if friction is None:
        raise PlantError(f"robot {file.stem} has no [friction]: add one to its file")
    return {friction.model: load_robot(name)}


def _motion(robot: Robot) -> RestToRest:
    if robot.trajectory is None:
        raise PlantError(f"robot {robot.name} has no [trajectory]: add one to its file")
    return robot.trajectory


def _check_amplitude(robot: Robot, specification: CampaignSpecification) -> None:
    """The largest motion must stay within the joints' ranges."""
    ends = specification.plants.amplitude_deg
    if ends is None:
        return
    if plants.amplitude_deg(_motion(robot)) == 0.0:
        raise PlantError(f"robot {robot.name} stands still: there is no amplitude to change")
    reached = np.rad2deg(plants.scaled(_motion(robot), ends[1]).postures_rad)
    for index, low, high in zip(robot.moving, reached.min(0), reached.max(0), strict=True):
        joint = robot.chain[index]
        if joint.range_deg and not joint.range_deg[0] <= low <= high <= joint.range_deg[1]:
            within = f"{joint.range_deg[0]:g} to {joint.range_deg[1]:g} deg"
            rule = f"the {joint.name} stays within {within}; it gets from {low:g} to {high:g} deg"
            fix = "write a smaller upper end"
            problem = Problem("plants.amplitude_deg", str(list(ends)), rule, fix)
            raise SpecificationError("the campaign", [problem])


def _check_springs(robot: Robot, specification: CampaignSpecification) -> None:
    """Only springs can be stiffer."""
    ends = specification.plants.stiffness_factor
    if ends is None or robot.flexibility is not None:
        return
    rule = f"a robot with [flexibility]; the joints of {robot.name} are rigid"
    fix = "remove it, or name another robot, such as reference_flexible"
    problem = Problem("plants.stiffness_factor", str(list(ends)), rule, fix)
    raise SpecificationError("the campaign", [problem])


def _check_gains(workshop: Workshop, gain_sets: dict[str, Controller]) -> None:
    """Gains that the C itself refuses would only give rows without figures."""
    for name, gains in gain_sets.items():
        status = workshop.controller(gains).check_config()
        if status < 0:
            rule = f"gains that the generated C takes; it answers status {status}"
            problem = Problem("experiments", f'"{name}"', rule, "remove it")
            raise SpecificationError("the campaign", [problem])


class Workshop:
    """What a process needs for runs, made once: nominal plants and compiled C.

    Its methods may be called from several threads at once.

    Args:
        specification: of the campaign.
        shipped: the controller whose C is flown.
        robots: by friction model.
        sources: the folder with the C; generated if None.

    Raises:
        PlantError: a robot lacks a part, or has a joint that the backend can't do.
        CompilerError: the compiler is missing or reports an error.
    """

    def __init__(
        self,
        specification: CampaignSpecification,
        shipped: Controller,
        robots: dict[FrictionName, Robot],
        sources: Path | None,
    ) -> None:
        self._specification, self._shipped = specification, shipped
        self._nominal = {name: build_plant(robot) for name, robot in robots.items()}
        self._motion = {name: _motion(robot) for name, robot in robots.items()}
        self._loops: dict[FrictionName, CompiledLoop] = {}
        if specification.backend == "compiled":
            for name, plant in self._nominal.items():
                self._loops[name] = CompiledLoop(plant, shipped, sources)
            self._library = next(iter(self._loops.values())).path
        else:
            self._library = shared_library(sources or sources_of(shipped))

    @property
    def libraries(self) -> tuple[str, ...]:
        """File names of the compiled C."""
        if not self._loops:
            return (self._library.name,)
        return tuple(loop.path.name for loop in self._loops.values())

    def controller(self, gains: Controller) -> GeneratedController:
        """A controller of its own, tuned."""
        made = GeneratedController(self._shipped, self._library)
        made.set_gains(gains)
        return made

    def plant(self, drawn: plants.Draw) -> Plant:
        """The plant of a draw."""
        return plants.with_draw(self._nominal[drawn.friction_model], drawn)

    def motion(self, drawn: plants.Draw) -> RestToRest:
        """The motion of a draw, as fast as specified."""
        motion = self._motion[drawn.friction_model]
        if drawn.amplitude_deg is not None:
            motion = plants.scaled(motion, drawn.amplitude_deg)
        return motion.faster(self._specification.speed)

    def fly(self, drawn: plants.Draw, plant: Plant, gains: Controller) -> Run:
        """One run.

        Raises:
            ControllerError, PlantError: it did not get to its end.
        """
        tick, substep = float(self._shipped.sample_time), self._specification.substep_s
        begin = beginning(plant, self.motion(drawn), tick)
        controller = self.controller(gains)
        if self._loops:
            loop = self._loops[drawn.friction_model]
            return loop.run(plant, controller, begin, tick, substep)
        return _in_python(plant, controller, begin, tick, substep)


def _in_python(
    plant: Plant,
    controller: GeneratedController,
    begin: Beginning,
    tick: float,
    substep: float | None,
) -> Run:
    switch_on(controller, begin)
    # A motion that diverges overflows before it is found to be non-finite.
    with np.errstate(over="ignore", invalid="ignore"):
        return run_from(plant, controller, begin, tick, substep, progress=False)


# A process that flies many batches makes its workshop once; equal campaigns share one.
@lru_cache(maxsize=4)
def _workshop(campaign: Campaign) -> Workshop:
    sources = campaign.sources if campaign.sources.is_dir() else None
    made = Workshop(campaign.specification, campaign.shipped, campaign.robots, sources)
    if made.libraries != campaign.libraries:
        raise CampaignError(
            f"a worker compiles {', '.join(made.libraries)}, the campaign is of "
            f"{', '.join(campaign.libraries)}: give it the same repository and compiler"
        )
    return made


def fly_plants(campaign: Campaign, indices: range) -> list[Row]:
    """The rows of all runs of some plants, ordered by plant, seed and gain set.

    Raises:
        CampaignError: this process would compile other C than the campaign's.
    """
    workshop = _workshop(campaign)
    return [row for index in indices for row in _rows(campaign, workshop, index)]


def _rows(campaign: Campaign, workshop: Workshop, index: int) -> Iterator[Row]:
    table = campaign.specification.plants
    joints = len(campaign.shipped.joints)
    drawn = plants.draw(table, tuple(campaign.robots), joints, index)
    plant = workshop.plant(drawn)
    told = {
        "plant": index,
        "friction_model": drawn.friction_model,
        "torque_delay_ticks": plant.drive.delay,
        "amplitude_deg": plants.amplitude_deg(workshop.motion(drawn)),
        "stiffness_factor": drawn.stiffness_factor,
        **_by_joint("friction_factor", drawn.friction_factor),
        **_by_joint("inertia_factor", drawn.inertia_factor),
    }
    for seed in range(table.seeds):
        seeded = plants.with_phase(plant, plants.encoder_phase(table, joints, index, seed))
        phase = _by_joint("encoder_phase_counts", seeded.encoder.phase)
        for name, gains in campaign.gain_sets.items():
            outcome = _outcome(workshop, drawn, seeded, gains)
            yield told | phase | {"seed": seed, "gain_set": name} | outcome


def _outcome(workshop: Workshop, drawn: plants.Draw, plant: Plant, gains: Controller) -> Row:
    """The figures of a run; of one that did not get to its end only why."""
    try:
        return {"diverged": False, **figures(workshop.fly(drawn, plant, gains))}
    except (ControllerError, PlantError) as error:
        return {"diverged": True, "reason": str(error)}


def figures(run: Run) -> Row:
    """The figures of merit of a run, by column."""
    steps = np.diff(run.torque_applied_Nm, axis=0)
    return {
        "ticks": len(run.time_s),
        "saturated_ticks": run.saturated_ticks,
        "lost_ticks": run.lost_ticks,
        **_by_joint("rms_error_deg", run.rms_error_deg()),
        **_by_joint("rms_true_error_deg", run.rms_true_error_deg()),
        **_by_joint("peak_error_deg", np.rad2deg(np.abs(run.error_rad).max(axis=0))),
        **_by_joint("peak_torque_Nm", np.abs(run.torque_applied_Nm).max(axis=0)),
        **_by_joint("rms_torque_step_Nm", np.sqrt(np.mean(steps**2, axis=0))),
    }


def _by_joint(figure: str, values: Floats) -> Row:
    return {f"joint{i}_{figure}": x for i, x in enumerate(values.tolist(), start=1)}
