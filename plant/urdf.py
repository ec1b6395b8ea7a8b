"""URDF files: the joints of a robot, and the part of the file that its dynamics depend on.

A URDF (http://wiki.ros.org/urdf/XML) is a tree of links and joints. Only masses, placements, axes
and limits are of use here: meshes are never opened, and what the file says of friction is left out,
because in most files it is a placeholder (friction belongs into the robot file, with its source).
"""

from __future__ import annotations

import importlib.metadata
import math
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TURNING = ("revolute", "continuous")
SUPPORTED = (*TURNING, "prismatic")

_OF_DYNAMICS = {
    "robot": ("link", "joint"),
    "link": ("inertial",),
    "joint": ("parent", "child", "origin", "axis", "limit", "mimic"),
}


class UrdfError(ValueError):
    """A URDF that can't be used; the message names the cause and the fix."""


@dataclass(frozen=True)
class UrdfJoint:
    """A joint that isn't fixed.

    Attributes:
        name: of the joint.
        kind: its type in the file.
        link: the link that it moves.
        range_deg: how far it may turn [deg]; None for joints that turn endlessly or don't turn.
        mimics: the joint that it follows, or None.
    """

    name: str
    kind: str
    link: str
    range_deg: tuple[float, float] | None
    mimics: str | None

    @property
    def problem(self) -> str | None:
        """Why it can't be a joint with a drive of its own, or None."""
        if self.kind not in SUPPORTED:
            return f"is {self.kind}, not one of {', '.join(SUPPORTED)}"
        return f"follows {self.mimics}" if self.mimics is not None else None


@dataclass(frozen=True)
class UrdfBody:
    """The rigid bodies of a URDF.

    Attributes:
        chain: its joints but for the fixed ones, depth first, siblings by name: as Pinocchio
            orders them.
        gravity_m_per_s2: along -z of the root link.
        wrist: numbers of the joints that may be locked together, from 1.
        xml: the file without all that dynamics don't depend on.
    """

    chain: tuple[UrdfJoint, ...]
    gravity_m_per_s2: float
    wrist: Sequence[int]
    xml: str

    def with_fixed(self, moving: Collection[int]) -> str:
        """The URDF in which all joints but those with these indices into ``chain`` are fixed.

        What turns endlessly is an ordinary turning joint in it: its position is one number. No
        joint has limits that could be reached: they are for whoever plans a motion.
        """
        robot = ET.fromstring(self.xml)
        kinds = {
            joint.name: ("prismatic" if joint.kind == "prismatic" else "revolute")
            for index, joint in enumerate(self.chain)
            if index in moving
        }
        for joint in robot.iter("joint"):
            joint.set("type", kinds.get(joint.get("name", ""), "fixed"))
            for part in [*joint.findall("limit"), *joint.findall("mimic")]:
                joint.remove(part)
            if joint.get("type") != "fixed":
                far = {"lower": "-1e9", "upper": "1e9", "effort": "1e9", "velocity": "1e9"}
                joint.append(ET.Element("limit", far))
        return ET.tostring(robot, encoding="unicode")


def package_file(package: str, file: str) -> Path:
    """A file of an installed Python package.

    Args:
        package: the distribution's name, such as ``example-robot-data``.
        file: the end of the file's path, such as ``ur_description/urdf/ur5_robot.urdf``.

    Raises:
        UrdfError: the package isn't installed, or not exactly one of its files has that path.
    """
    try:
        distribution = importlib.metadata.distribution(package)
    except importlib.metadata.PackageNotFoundError as error:
        raise UrdfError(f"package {package} isn't installed: pip install {package}") from error
    found = [f for f in distribution.files or () if f"/{f.as_posix()}".endswith(f"/{file}")]
    if len(found) != 1:
        raise UrdfError(f"{len(found)} files of package {package} are called {file}, not one")
    return Path(str(distribution.locate_file(found[0])))


def read_urdf(path: Path, gravity_m_per_s2: float, wrist: Sequence[int] = ()) -> UrdfBody:
    """The rigid bodies of a URDF file; of meshes, it need not have any.

    Args:
        path: the file.
        gravity_m_per_s2: along -z of the root link.
        wrist: see :class:`UrdfBody`.

    Raises:
        UrdfError: the file isn't there, is no URDF, or its joints form no tree.
    """
    try:
        robot = ET.fromstring(path.read_bytes())
    except OSError as error:
        raise UrdfError(f"no URDF {path}: {error.strerror}") from error
    except ET.ParseError as error:
        raise UrdfError(f"{path}: no valid XML: {error}") from error
    if robot.tag != "robot":
        raise UrdfError(f"{path}: its root element is <{robot.tag}>, a URDF's is <robot>")
    for element in [robot, *robot.iter("link"), *robot.iter("joint")]:
        for part in [part for part in element if part.tag not in _OF_DYNAMICS[element.tag]]:
            element.remove(part)
    try:
        chain = tuple(_joint(joint) for joint in _ordered(robot))
    except UrdfError as error:
        raise UrdfError(f"{path}: {error}") from error
    ET.indent(robot)
    return UrdfBody(chain, gravity_m_per_s2, tuple(wrist), ET.tostring(robot, encoding="unicode"))


def _ordered(robot: Any) -> Iterator[Any]:
    """The joints that aren't fixed, depth first, siblings by name."""
    below: dict[str, list[Any]] = {link.get("name"): [] for link in robot.findall("link")}
    roots = set(below)
    for joint in robot.findall("joint"):
        parent, child = (_attribute(joint, part, "link") for part in ("parent", "child"))
        for link in (parent, child):
            if link not in below:
                raise UrdfError(
                    f"joint {joint.get('name')} connects link {link}, which isn't there"
                )
        if child not in roots:
            raise UrdfError(f"link {child} is moved by two joints: a URDF is a tree")
        roots.remove(child)
        below[parent].append(joint)
    if len(roots) != 1:
        raise UrdfError(f"{len(roots)} links are moved by no joint, not one: {sorted(roots)}")
    yield from _beyond(roots.pop(), below)


def _beyond(link: str, below: dict[str, list[Any]]) -> Iterator[Any]:
    for joint in sorted(below[link], key=lambda joint: str(joint.get("name"))):
        if joint.get("type") != "fixed":
            yield joint
        yield from _beyond(_attribute(joint, "child", "link"), below)


def _joint(joint: Any) -> UrdfJoint:
    name, kind, limit, mimic = (
        joint.get("name"),
        joint.get("type"),
        *map(joint.find, ("limit", "mimic")),
    )
    range_deg = None
    if kind == "revolute" and limit is not None:
        # What a URDF doesn't give is 0.
        lower, upper = (_number(name, limit.get(key, "0")) for key in ("lower", "upper"))
        range_deg = math.degrees(lower), math.degrees(upper)
    return UrdfJoint(
        name=str(name),
        kind=str(kind),
        link=_attribute(joint, "child", "link"),
        range_deg=range_deg,
        mimics=None if mimic is None else str(mimic.get("joint")),
    )


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise UrdfError(f"joint {name} has the limit {text!r}, which is no number") from error


def _attribute(joint: Any, part: str, key: str) -> str:
    element = joint.find(part)
    value = None if element is None else element.get(key)
    if value is None:
        raise UrdfError(f"joint {joint.get('name')} has no <{part} {key}=...>")
    return str(value)
