"""MJX and MuJoCo Warp, whose versions go with MuJoCo's: which of them joda takes.

What is told to install leaves the MuJoCo that is there where it is.
"""

from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version

from joda.errors import JodaError

Version = tuple[int, int]
"""Major and minor."""


@dataclass(frozen=True)
class Companion:
    """A package beside MuJoCo.

    Attributes:
        package: its name.
        versions: of it that joda takes.
        newest_goes_on: whether its newest goes with newer MuJoCos too.
    """

    package: str
    versions: tuple[Version, ...]
    newest_goes_on: bool = False

    def load(self, user: str, *modules: str) -> None:
        """Imports the modules for the part of joda that uses them.

        Raises:
            JodaError: there is none, or it does not go with MuJoCo or joda.
        """
        try:
            for module in modules:
                import_module(module)
        except ImportError as error:
            raise JodaError(
                f"{user} needs {self.package} (no module {error.name}); {self.remedy()}."
            ) from None
        except AttributeError as error:  # of a MuJoCo that it was not made for
            raise JodaError(
                f"{self.package} {version(self.package)} does not go with mujoco "
                f"{version('mujoco')} ({error}); {self.remedy()}."
            ) from None
        found = minor(self.package)
        if found not in self.versions or not (self.newest_goes_on or found == minor("mujoco")):
            raise JodaError(
                f"{user} does not take {self.package} {version(self.package)} beside mujoco "
                f"{version('mujoco')}; {self.remedy()}."
            )

    def fitting(self, mujoco: Version) -> Version | None:
        """The version that goes with a MuJoCo; None: there is none."""
        if self.newest_goes_on:
            mujoco = min(mujoco, self.versions[-1])
        return mujoco if mujoco in self.versions else None

    def pins(self) -> tuple[str, ...]:
        """What pip is to be told, for the MuJoCo that is installed; empty: nothing goes with it."""
        fitting = self.fitting(minor("mujoco"))
        if fitting is None:
            return ()
        return f"{self.package}=={dotted(fitting)}.*", f"mujoco=={version('mujoco')}"

    def remedy(self) -> str:
        """How to get one that fits, a clause."""
        if pins := self.pins():
            return "run: pip install " + " ".join(f"'{one}'" for one in pins)
        return f"{self.elsewhere()}; use another environment for it"

    def elsewhere(self) -> str:
        """That nothing goes with the MuJoCo that is installed, a clause."""
        listed = [dotted(one) for one in self.versions]
        told = f"{', '.join(listed[:-1])} and {listed[-1]}"
        if self.newest_goes_on:
            told = f"{listed[0]} and newer"
        return f"it goes with MuJoCo {told}, and here is {version('mujoco')}"


MJX = Companion("mujoco-mjx", tuple((3, k) for k in range(11, 18)), newest_goes_on=True)
WARP = Companion("mujoco-warp", ((3, 11), (3, 17), (4, 0)))


def minor(package: str) -> Version:
    """Major and minor version of a package that is installed."""
    major, small = version(package).split(".")[:2]
    return int(major), int(small)


def dotted(one: Version) -> str:
    """As it is written."""
    return ".".join(map(str, one))
