"""Undo and redo of what cannot change itself."""

from dataclasses import dataclass
from typing import Generic, Self, TypeVar

State = TypeVar("State")


@dataclass(frozen=True)
class Timeline(Generic[State]):
    """A state, those before it, and those that were undone.

    Attributes:
        present: the state.
        past: the oldest first.
        future: what redo brings back, the next one first.
    """

    present: State
    past: tuple[State, ...] = ()
    future: tuple[State, ...] = ()

    def then(self, state: State) -> Self:
        """With a new state, after which nothing can be redone; itself if it is the present one."""
        if state == self.present:
            return self
        return type(self)(state, (*self.past, self.present))

    def undo(self) -> Self:
        """One state back; itself at the beginning."""
        if not self.past:
            return self
        return type(self)(self.past[-1], self.past[:-1], (self.present, *self.future))

    def redo(self) -> Self:
        """One state forth; itself at the end."""
        if not self.future:
            return self
        return type(self)(self.future[0], (*self.past, self.present), self.future[1:])
