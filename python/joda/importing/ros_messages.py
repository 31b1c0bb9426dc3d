"""A bag opened by rosbags, and its messages, also of bags that do not define them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from joda.errors import JodaError

JOINTS, CONTROLLER = "sensor_msgs/msg/JointState", "control_msgs/msg/JointTrajectoryControllerState"
POINT = "trajectory_msgs/JointTrajectoryPoint"
MULTI = "trajectory_msgs/MultiDOFJointTrajectoryPoint"
PLACES = ("reference", "feedback", "error", "output", "desired", "actual")
HUMBLE = "std_msgs/Header header\nstring[] joint_names\n" + "".join(
    [f"{POINT} {name}\n" for name in PLACES]
    + ["string[] multi_dof_joint_names\n"]
    + [f"{MULTI} multi_dof_{name}\n" for name in PLACES]
)
FIRST = "std_msgs/Header header\nstring[] joint_names\n" + "".join(
    f"{POINT} {name}\n" for name in ("desired", "actual", "error")
)
"""The controller's message in bags that do not have its definition, as those of Humble."""


@contextmanager
def opened(path: Path) -> Iterator[tuple[Any, Callable[[bytes, str], Any]]]:
    """The opened bag, and what makes messages of its bytes."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    stores = []
    for text in (HUMBLE, FIRST):
        store = get_typestore(Stores.ROS2_HUMBLE)
        if CONTROLLER not in store.fielddefs:
            store.register(get_types_from_msg(text, CONTROLLER))
        stores.append(store)
    with AnyReader([path], default_typestore=stores[0]) as bag:
        told = any(one.msgdef.data for one in bag.connections if one.msgtype == CONTROLLER)

        def deserialize(raw: bytes, kind: str) -> Any:
            if kind != CONTROLLER or told or not bag.is2:
                return bag.deserialize(raw, kind)
            try:
                return stores[0].deserialize_cdr(raw, kind)
            except Exception:  # the message has another form
                return stores[1].deserialize_cdr(raw, kind)

        yield bag, deserialize


@contextmanager
def library_errors(path: Path) -> Iterator[None]:
    """What rosbags and the libraries below it raise of a damaged bag, which may be anything."""
    try:
        yield
    except JodaError:
        raise
    except ImportError:
        raise JodaError('ROS bags need rosbags; run: pip install ".[import]"') from None
    except Exception as error:
        told = str(error).partition("\n")[0].rstrip(".") or type(error).__name__
        raise JodaError(
            f"{path}: cannot be read as a ROS bag ({told}); record or convert it anew."
        ) from None
