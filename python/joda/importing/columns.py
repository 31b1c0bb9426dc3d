"""Which signal of a log is which column of a run: matched to a model's joints and actuators."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from joda.errors import JodaError
from joda.importing.log import ROLES, Log, Role, Signal, listed
from joda.importing.model_names import Names
from joda.importing.names import normal, read_name
from joda.scenes.model import find_joint, joint_name


@dataclass(frozen=True)
class Pick:
    """A column of the runs.

    Attributes:
        role: position, velocity, force or ctrl.
        of: the joint, or of ctrl the actuator, by the model's name.
        joint: id of the joint; of an actuator, the one it acts on; -1 where there are several.
        actuator: id; -1 where it is a joint's.
        signal: what of the log becomes this column.
    """

    role: Role
    of: str
    joint: int
    actuator: int
    signal: Signal

    @property
    def target(self) -> str:
        """The column's name in a run of several joints."""
        return f"{self.role}:{self.of}"


@dataclass(frozen=True)
class Unused:
    """A signal that becomes no column: why, and the option that would make it one."""

    name: str
    why: str


def columns_given(texts: Sequence[str]) -> dict[str, str]:
    """The options --column TARGET=NAME by target; raises JodaError for what is none."""
    given: dict[str, str] = {}
    for text in texts:
        target, is_pair, name = (part.strip() for part in text.partition("="))
        role = target.partition(":")[0]
        if not is_pair or not name or role not in (*ROLES, "time"):
            raise JodaError(
                f"--column {text}: must be TARGET=NAME, where TARGET is time, position:JOINT, "
                "velocity:JOINT, force:JOINT or ctrl:ACTUATOR, and NAME a column of the log."
            )
        if target in given:
            raise JodaError(f"--column {target} is there twice; give it one column.")
        given[target] = name
    return given


def picked(
    log: Log, names: Names, given: Mapping[str, str], only: int | None
) -> tuple[list[Pick], list[Unused]]:
    """Which signals become columns.

    Args:
        log: what was read.
        names: of the model.
        given: by the user: names of signals by target.
        only: the joint, by id, whose columns are wanted; None means all.

    Returns:
        the columns: positions, velocities, forces and commands in the order of the joints; and the
        signals that become none.

    Raises:
        JodaError: a name given is not there, or one that the log has may be several.
    """
    picks, used = {}, set()
    for target, name in given.items():
        pick = _given(log, names, target, name, only)
        if pick.signal.name in used:
            raise JodaError(f"--column {target}={name}: is another column already.")
        picks[pick.target] = pick
        used.add(pick.signal.name)
        if pick.role == "position" and pick.signal.of:
            names.aliases[normal(pick.signal.of)] = pick.joint
        elif pick.role == "position" and (stem := read_name(pick.signal.short)[1]):
            names.aliases[normal(stem)] = pick.joint
    unused = []
    for signal in log.signals:
        if signal.name in used:
            continue
        found = _matched(names, signal, only)
        if isinstance(found, Unused):
            unused.append(found)
        elif only is None or found.joint == only:
            other = picks.get(found.target)
            if other and other.target not in _canonical(names, given, only):
                raise JodaError(
                    f"{log.path}: {found.target} may be '{other.signal.name}' or '{signal.name}'; "
                    f"say --column {found.target}=NAME{_by_topic(log)}."
                )
            if not other:
                picks[found.target] = found
    order = {role: k for k, role in enumerate(ROLES)}
    chosen = sorted(picks.values(), key=lambda p: (order[p.role], p.joint, p.actuator))
    if not any(pick.role == "position" for pick in chosen):
        whose = f"joint '{joint_name(names.model, only)}'" if only is not None else "any joint"
        joints = listed(names.joints)
        raise JodaError(
            f"{log.path}: no column is the position of {whose}; it has "
            f"{listed(one.name for one in log.signals)}, and the model's joints are {joints}. Say "
            "--column position:JOINT=NAME."
        )
    return chosen, unused


def _by_topic(log: Log) -> str:
    return ", or --topic of the one to read" if log.format == "ROS bag" else ""


def _canonical(names: Names, given: Mapping[str, str], only: int | None) -> set[str]:
    """The targets that the user gave, with the model's own names."""
    return {f"{role}:{of}" for role, of in (_target(names, target, only)[:2] for target in given)}


def _target(names: Names, target: str, only: int | None) -> tuple[Role, str, int, int]:
    """Role, name, joint and actuator of a target such as "position:elbow"; raises JodaError."""
    role, _, of = (part.strip() for part in target.partition(":"))
    if role == "ctrl":
        if of not in names.actuators:
            raise JodaError(
                f"--column {target}: no actuator '{of}'; the model's are {listed(names.actuators)}."
            )
        actuator = names.actuators[of]
        return "ctrl", of, names.moved_by(actuator), actuator
    if not of and only is None:
        raise JodaError(f"--column {target}: of which joint? Write {role}:JOINT.")
    joint = find_joint(names.model, of) if of else int(only or 0)
    return role, joint_name(names.model, joint), joint, -1  # type: ignore[return-value]


def _given(log: Log, names: Names, target: str, name: str, only: int | None) -> Pick:
    role, of, joint, actuator = _target(names, target, only)
    if only is not None and joint != only:
        wanted = joint_name(names.model, only)
        raise JodaError(f"--column {target}: is not of joint '{wanted}', which --joint names.")
    return Pick(role, of, joint, actuator, log.named(name, role))


def _matched(names: Names, signal: Signal, only: int | None) -> Pick | Unused:
    """The column that a signal's own name tells."""
    if not signal.role:
        return Unused(signal.name, _hint(names, signal))
    if signal.role == "ctrl":
        actuator = names.actuator(signal.of)
        if actuator is None:
            joint = names.joint(signal.of)
            if joint is not None and names.driven[joint]:
                what = f"the actuator on joint '{joint_name(names.model, joint)}' has no name"
            elif joint is not None:
                what = f"the model has no actuator on joint '{joint_name(names.model, joint)}'"
            else:
                what = f"no actuator and no joint is called '{signal.of}'"
            return Unused(signal.name, f"{what}; --column 'ctrl:ACTUATOR={signal.name}'")
        own = names.model.actuator(actuator).name
        return Pick("ctrl", own, names.moved_by(actuator), actuator, signal)
    joint = names.joint(signal.of) if signal.of else only
    if joint is None:
        told = f"no joint is called '{signal.of}'" if signal.of else "it tells no joint"
        return Unused(signal.name, f"{told}; --column '{signal.role}:JOINT={signal.name}'")
    return Pick(signal.role, joint_name(names.model, joint), joint, -1, signal)


def _hint(names: Names, signal: Signal) -> str:
    """What to say of a signal whose name does not tell what it is."""
    joint = names.joint(signal.of or read_name(signal.short)[1])
    of = "JOINT" if joint is None else joint_name(names.model, joint)
    if signal.of:
        return (
            "a run's force is what acts on the joint from outside, which this may not be; if it "
            f"is: --column 'force:{of}={signal.name}'"
        )
    return f"its name does not say what it is; --column 'position:{of}={signal.name}'"
