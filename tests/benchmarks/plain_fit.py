"""A plain fit of an arm's servos, which `joda improve` is to be better than.

Stiffness, damping, dry friction, armature and delay of each joint, robust least squares over whole
runs, open loop, the scene as it is.

python tests/benchmarks plain_fit arm.xml --runs A.csv B.csv --held C.csv
"""

import argparse
from copy import copy
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

from joda.measured.driven import joints_in
from joda.measured.run_files import read_signals, read_together
from joda.measured.runs import held

NUMBERS = ("stiffness", "damping", "friction", "armature", "delay")
STEP = 0.03
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS


class Arm:
    """A model and logs of it; every joint has one position servo."""

    def __init__(self, model: Path, logs: list[Path]) -> None:
        """Reads all of it."""
        self.model = mujoco.MjModel.from_xml_path(str(model))
        self.joints = joints_in(self.model, logs[0])
        self.dofs = np.array([self.model.joint(name).dofadr[0] for name in self.joints])
        ids = [int(self.model.joint(name).id) for name in self.joints]
        servos = [list(self.model.actuator_trnid[:, 0]).index(k) for k in ids]
        self.servos, self.h = np.array(servos), float(self.model.opt.timestep)
        self.names = [self.model.actuator(k).name for k in servos]
        self.logs = [self._read(path) for path in logs]
        m = self.model
        self.start = np.log(
            np.array(
                [
                    m.actuator_gainprm[self.servos, 0],
                    m.dof_damping[self.dofs] - m.actuator_biasprm[self.servos, 2] + 1e-3,
                    m.dof_frictionloss[self.dofs] + 1e-3,
                    m.dof_armature[self.dofs] + 1e-4,
                    np.full(len(ids), 1e-3),
                ]
            ).T
        )

    def _read(self, path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, positions (n, joints), commands (n, joints)."""
        run, others = read_together(path, self.joints[0], self.joints[1:])
        runs = np.stack([run.position, *(others[name] for name in self.joints[1:])], axis=1)
        commands = read_signals(path, [f"ctrl:{name}" for name in self.names])
        return run.time - run.time[0], runs, commands

    def changed(self, x: np.ndarray) -> mujoco.MjModel:
        """The model with these numbers, shape (joints, numbers), logarithms."""
        m = copy(self.model)
        kp, kd, friction, armature, _ = np.exp(x).T
        m.actuator_gainprm[self.servos, 0] = kp
        m.actuator_biasprm[self.servos, 1] = -kp
        m.actuator_biasprm[self.servos, 2] = 0.0
        m.dof_damping[self.dofs] = kd
        m.dof_frictionloss[self.dofs] = friction
        m.dof_armature[self.dofs] = armature
        return m

    def paths(self, x: np.ndarray, logs: list) -> list[np.ndarray]:
        """Positions at the times of logs, open loop, shapes (n, joints)."""
        model = self.changed(x)
        initial, controls = [], []
        late = np.exp(x[:, 4])
        longest = max(int(np.ceil(time[-1] / self.h)) + 1 for time, _, _ in logs)
        one = mujoco.MjData(model)
        for time, position, command in logs:
            mujoco.mj_resetData(model, one)
            one.qpos[[self.model.joint(n).qposadr[0] for n in self.joints]] = position[0]
            state = np.zeros(mujoco.mj_stateSize(model, FULL))
            mujoco.mj_getState(model, one, state, FULL)
            initial.append(state)
            edges = self.h * np.arange(longest + 1)
            control = np.zeros((longest, model.nu))
            for k, servo in enumerate(self.servos):
                control[:, servo] = held(time, command[:, k], edges - late[k])
            controls.append(control)
        data = [mujoco.MjData(model) for _ in range(2)]
        states, _ = rollout.rollout(model, data, np.array(initial), np.array(controls))
        columns = [1 + self.model.joint(n).qposadr[0] for n in self.joints]
        out = []
        for (time, position, _), state in zip(logs, states, strict=True):
            own = np.vstack([position[:1], state[:, columns]])
            steps = self.h * np.arange(len(own))
            out.append(np.stack([np.interp(time, steps, q) for q in own.T], axis=1))
        return out

    def misfit(self, x: np.ndarray, logs: list) -> np.ndarray:
        """Of all samples, shape (n, joints)."""
        found = self.paths(x, logs)
        return np.concatenate([p - log[1] for p, log in zip(found, logs, strict=True)])

    def rmse(self, x: np.ndarray | None, logs: list) -> np.ndarray:
        """Of each log and joint."""
        found = self.paths(self.start if x is None else x, logs)
        return np.array(
            [
                np.sqrt(np.mean((p - log[1]) ** 2, axis=0))
                for p, log in zip(found, logs, strict=True)
            ]
        )


def fitted(arm: Arm, logs: list, iterations: int) -> np.ndarray:
    """All numbers, each joint's by its own misfit; what one joint does to the next is left out of
    the derivatives, so that all joints are nudged at once."""
    x = arm.start.copy()
    damping = np.full(len(arm.joints), 1e-2)
    r = arm.misfit(x, logs)
    for number in range(iterations):
        J = []
        for k in range(len(NUMBERS)):
            y = x.copy()
            y[:, k] += STEP
            J.append((arm.misfit(y, logs) - r) / STEP)
        J = np.array(J)
        step = np.zeros_like(x)
        for j in range(len(arm.joints)):
            scale = np.median(np.abs(r[:, j])) * 3 + 1e-4
            w = 1 / (1 + (r[:, j] / scale) ** 2)
            A = (J[:, :, j] * w) @ J[:, :, j].T
            A += damping[j] * np.diag(np.diag(A)) + 1e-9 * np.eye(len(A))
            step[j] = np.clip(-np.linalg.solve(A, (J[:, :, j] * w) @ r[:, j]), -1, 1)
        trial = np.clip(x + step, np.log(1e-4), np.log(2e3))
        trial[:, 4] = np.minimum(trial[:, 4], np.log(0.15))
        new = arm.misfit(trial, logs)
        better = np.mean(np.abs(new), axis=0) < np.mean(np.abs(r), axis=0)
        x = np.where(better[:, None], trial, x)
        damping = np.where(better, damping / 4, damping * 8)
        r = arm.misfit(x, logs)
        print(number, np.round(1e3 * np.sqrt(np.mean(r**2, axis=0)), 2), flush=True)
    return x


def main() -> None:
    """Fits and tells."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("--runs", type=Path, nargs="+", required=True)
    parser.add_argument("--held", type=Path, nargs="+", required=True)
    parser.add_argument("--iterations", type=int, default=20)
    args = parser.parse_args()
    arm = Arm(args.model, [*args.runs, *args.held])
    train, held = arm.logs[: len(args.runs)], arm.logs[len(args.runs) :]
    x = fitted(arm, train, args.iterations)
    print("joint, numbers, held out as it is and fitted (mrad, median over runs)")
    before, after = (1e3 * np.median(arm.rmse(y, held), axis=0) for y in (None, x))
    for k, name in enumerate(arm.joints):
        told = ", ".join(f"{n} {v:.3g}" for n, v in zip(NUMBERS, np.exp(x[k]), strict=True))
        print(f"{name:12} {told}: {before[k]:.1f} -> {after[k]:.1f}")
