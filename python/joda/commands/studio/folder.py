"""The project folder: the studio reads and writes nothing outside of it."""

from pathlib import Path

from joda.errors import JodaError


class Folder:
    """A project folder, with symbolic links resolved.

    Attributes:
        path: absolute.
    """

    def __init__(self, path: Path) -> None:
        """Raises JodaError if there is no such folder."""
        self.path = path.resolve()
        if not self.path.is_dir():
            raise JodaError(f"{path}: no such folder; give the project's folder.")

    def inside(self, name: str | Path) -> Path:
        """The file of that name, relative names from the folder on.

        Raises:
            JodaError: it lies outside, be it by "..", by an absolute name or by a symbolic link.
        """
        try:
            found = (self.path / name).resolve()
        except (OSError, RuntimeError, ValueError):
            raise JodaError(f"{str(name)!r}: is no file name.") from None
        if not found.is_relative_to(self.path):
            raise JodaError(
                f"{name}: lies outside the project folder {self.path}; the studio reads and writes "
                "only there (--folder chooses another one)."
            )
        return found

    def name(self, path: Path) -> str:
        """The file's name from the folder on."""
        return path.relative_to(self.path).as_posix()

    def listed(self, suffix: str, most: int = 200) -> list[str]:
        """Names of the files with a suffix in the folder and one level below, sorted."""
        found = (*self.path.glob(f"*{suffix}"), *self.path.glob(f"*/*{suffix}"))
        inside = (path for path in found if path.resolve().is_relative_to(self.path))
        return sorted(map(self.name, inside))[:most]
