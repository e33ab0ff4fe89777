"""The training environment: many fallen robots that learn to get up."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from humanoid_getup.policy.action import ActionSpec, choose_actions, next_target
from humanoid_getup.policy.observation import (
    SAME,
    Floats,
    Mirror,
    compute_torque_share,
    list_terms,
    mirror_of_observation,
    observe,
)
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from robots import Robot, load_robot
from robots.quaternion import Array
from sim2real.environment.action_head import ActionHead, DirectHead
from sim2real.environment.assistive_force import AssistiveForce
from sim2real.environment.initial_states import (
    StartPool,
    list_motion_starts,
    make_pool,
    pool_rng,
    sample_stands,
)
from sim2real.environment.privileged_state import (
    list_critic_terms,
    observe_privileged,
)
from sim2real.environment.randomization import RANDOMIZATIONS, DomainRandomization
from sim2real.environment.rewards import QUICK, REWARDS, Reward, RewardInputs, score
from sim2real.environment.style_task import StyleTask
from sim2real.environment.terrain import TerrainCurriculum
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import LONGEST_DELAY, build_training_world

PHYSICS_STEP = 0.006  # s; evaluation takes 0.002
# s; the stored motions rise in 1.6 to 4.6 s, so there is time for a second try and a stand.
EPISODE = 6.0
# s of standing that count as success: half of what a judge requires, since exploration noise
# disturbs a stand that would be held.
HELD = 1.5
STANDS = 64  # standing initial postures
FLOAT = np.float32


@dataclass(frozen=True, kw_only=True)
class EnvOptions:
    """Settings of a training environment."""

    robots: int = 512
    """Number of robots that are simulated side by side."""
    randomization: DomainRandomization | None = None
    """``None``: every robot has its nominal parameters."""
    rewards: tuple[Reward, ...] = QUICK
    falls: float = 0.8
    """Fraction of episodes that start with a settled fall."""
    motions: float = 0.1
    """Fraction that starts at a frame of a stored motion; the rest starts standing."""
    assistive_force: float = 0.0
    """Initial upper limit of the assistive force, as a fraction of the weight; fades with
    success."""
    restarts: float = 0.0
    """Fraction of episodes after a deviation from style curves that go on from where it led."""
    ends_early: float = 0.5
    """Fraction of episodes that end once the robot has stood for ``HELD``."""
    scene: str | Scene = "flat"
    origin: tuple[float, float] = (0.0, 0.0)
    """Where robots are placed that start along motions: on flat ground [m]."""
    physics_step: float = PHYSICS_STEP
    """[s]"""
    threads: int = 0
    """Threads that step physics; 0 for one per processor."""


@dataclass(eq=False)
class _Episodes:
    """State of each robot's episode."""

    age: NDArray[np.int_]
    """Policy steps so far."""
    length: NDArray[np.int_]
    """Policy steps at most."""
    held: NDArray[np.int_]
    """Policy steps of uninterrupted standing."""
    start: NDArray[np.int_]
    """Row in the pool of falls; -1 for other initial states."""
    ends_early: NDArray[np.bool_]


class GetUpEnv(VectorEnv):
    """Fallen robots that are rewarded for standing up, as a Gymnasium vector environment.

    Actions are those of an :class:`ActionSpec`, from -1 to 1. Observations are computed by
    :func:`humanoid_getup.policy.observation.observe`; ``info["critic"]`` adds privileged state.
    Episodes end by time alone, so all ends are truncations. A robot is reset in the same step;
    ``info["final_obs"]`` is the last observation of its episode.
    """

    metadata: ClassVar = {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        robot: Robot,
        action: ActionSpec,
        pool: StartPool,
        options: EnvOptions,
        style: StyleTask | None = None,
        stands: StartPool | None = None,
    ) -> None:
        """Build the robots; the pool holds settled falls in a training world of theirs.

        With style curves they are rewarded for following these. ``stands`` are initial states
        that are neither falls nor along motions; ``None`` for standing robots on flat ground.
        """
        self.robot, self.action, self.options, self.pool = robot, action, options, pool
        self.style = style
        self.head: ActionHead = style.head if style else DirectHead(robot, action)
        randomization = options.randomization
        has_delays = randomization is not None and randomization.delay[1] > 0.0
        scene = options.scene
        world = build_training_world(
            robot,
            load_scene(scene, robot) if isinstance(scene, str) else scene,
            options.physics_step,
            LONGEST_DELAY if has_delays else 0.0,
        )
        noise = randomization.noise if randomization else None
        n = self.num_envs = options.robots
        self.sim = TrainingSim(
            world,
            n,
            cycles=action.cycles,
            pwm_limit=action.pwm_limit,
            threads=options.threads,
            noise=noise,
        )
        self._motions = (
            style.library.state_qpos if style else list_motion_starts(robot, world.model)
        )
        self._stands = stands or StartPool.of(
            sample_stands(robot, world.model, STANDS, np.random.default_rng(0))
        )
        self.step_time = robot.control_period * action.cycles
        self.terms = list_terms(robot, action, style.input if style else None)
        self._critic_terms = list_critic_terms(robot)
        size = sum(term.size for term in self.terms)
        space = gymnasium.spaces.Box
        self.single_observation_space = space(-np.inf, np.inf, (size,), FLOAT)
        outputs, limit = len(self.head.names), self.head.limit
        self.single_action_space = space(-limit, limit, (outputs,), FLOAT)
        self.observation_space = batch_space(self.single_observation_space, n)
        self.action_space = batch_space(self.single_action_space, n)
        self._force = AssistiveForce(options.assistive_force, options.assistive_force)
        self._terrain = TerrainCurriculum(pool.level)
        self._rng = np.random.default_rng(0)
        self.target = np.zeros((n, robot.n))
        self.memory = np.zeros((n, outputs))
        """What each policy remembers of its last actions, (N, m)."""
        self._episodes = _Episodes(
            age=np.zeros(n, dtype=int),
            length=np.full(n, round(EPISODE / self.step_time)),
            held=np.zeros(n, dtype=int),
            start=np.full(n, -1),
            ends_early=np.zeros(n, dtype=bool),
        )

    @property
    def ages(self) -> NDArray[np.int_]:
        """Return the age of each episode in policy steps, (N,), writable."""
        return self._episodes.age

    @property
    def longest(self) -> int:
        """Return the maximum length of an episode in policy steps."""
        return int(self._episodes.length[0])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start new episodes; a seed makes them reproducible on every machine."""
        del options
        super().reset(seed=seed)
        if seed is not None:
            self._rng = self.np_random
            self.pool.success[:] = 0.0
            self._force = AssistiveForce(self.options.assistive_force, self.options.assistive_force)
            self._terrain = TerrainCurriculum(self.pool.level)
        self._begin(np.arange(self.num_envs))
        observation = self._observe()
        return observation, {"critic": self._observe_privileged(observation)}

    def step(
        self, actions: Array
    ) -> tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Step all robots by one policy step."""
        requested = np.asarray(actions, dtype=float)
        tracker = self.style.tracker if self.style else None
        action, memory = self.head.act(requested, self.memory, tracker)
        measured, gravity = self.sensed.joint_pos, self.sensed.gravity
        following = next_target(self.robot, self.action, self.target, measured, gravity, action)
        self.sim.follow(self.target, following)
        self.target = following
        state = self.sim.measure_privileged_state()
        self.sensed = self.sim.sense(self._rng if self.options.randomization else None)
        inputs = RewardInputs(
            **vars(state),
            requested=requested / self.head.limit,
            action=memory,
            last_action=self.memory,
            away=self.sensed.joint_pos - self.robot.standing.joint_pos,
            style=self.style.follow(self.sim, self.sensed, memory) if self.style else None,
        )
        self.memory = memory
        reward, parts = score(self.options.rewards, inputs, self._force.cost_share)
        reward[self.sim.diverged] = 0.0
        self._push()
        terminated = self._find_terminated(inputs)
        ended, report = self._end(inputs, terminated)
        truncated = np.zeros(self.num_envs, dtype=bool)
        truncated[ended] = True
        truncated &= ~terminated
        if len(ended):
            report |= {"final_obs": self._observe(), "_final_obs": truncated | terminated}
            restarting = self._draw_restarting(ended, terminated)
            self._restart(restarting)
            self._begin(np.setdiff1d(ended, restarting))
        observation = self._observe()
        info = {
            "critic": self._observe_privileged(observation),
            "assistive_force": self._force.lift,
            "level": self._terrain.open,
            "task_reward": float(inputs.style.task.mean()) if inputs.style else 0.0,
            "rewards": {name: float(part.mean()) for name, part in parts.items()},
            **report,
        }
        return observation, reward.astype(FLOAT), terminated, truncated, info

    def _push(self) -> None:
        randomization = self.options.randomization
        if randomization is None or not randomization.push_speed:
            return
        pushed = self._rng.random(self.num_envs) < self.step_time / randomization.push_interval
        ids = np.flatnonzero(pushed)
        speed = randomization.push_speed
        self.sim.push(ids, self._rng.uniform(-speed, speed, (len(ids), 3)))

    def _find_terminated(self, inputs: RewardInputs) -> NDArray[np.bool_]:
        """Find the robots whose episode is terminated because they deviate too much, (N,)."""
        if self.style is None or inputs.style is None:
            return np.zeros(self.num_envs, dtype=bool)
        return self.style.find_terminated(inputs.style, inputs, self.step_time)

    def _end(
        self, inputs: RewardInputs, terminated: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int_], dict[str, Any]]:
        """Find the episodes that are over; count the outcomes of those from falls."""
        e = self._episodes
        e.age += 1
        e.held = np.where(inputs.standing, e.held + 1, 0)
        succeeded = e.held >= round(HELD / self.step_time)
        succeeded &= ~self.sim.diverged
        is_over = (e.age >= e.length) | (succeeded & e.ends_early) | self.sim.diverged | terminated
        ended = np.flatnonzero(is_over)
        from_fall = ended[e.start[ended] >= 0]
        self.pool.note(e.start[from_fall], succeeded[from_fall])
        self._force.note(succeeded[from_fall])
        self._terrain.note(e.start[from_fall], succeeded[from_fall])
        return ended, {"falls": len(from_fall), "stood": int(succeeded[from_fall].sum())}

    def _begin(self, ids: NDArray[np.int_]) -> None:
        """Place some robots for their next episode."""
        rng, o, count = self._rng, self.options, len(ids)
        kind = rng.random(count)
        start = np.where(kind < o.falls, self.pool.draw(count, rng, self._terrain.open), -1)
        stands = self._stands.qpos[self._stands.draw(count, rng, self._terrain.open)]
        qpos = np.where((start >= 0)[:, None], self.pool.qpos[start], stands)
        along = (kind >= o.falls) & (kind < o.falls + o.motions) & (len(self._motions) > 0)
        states = rng.integers(0, max(len(self._motions), 1), count)
        qpos[along] = self._motions[states[along]]
        layout = self.robot.layout(self.sim.model)
        qpos[along, layout.root_qpos : layout.root_qpos + 2] += o.origin
        if o.randomization:
            drawn = o.randomization.sample(self.sim.world, count, rng)
            self.sim.set_parameters(ids, drawn)
        self.sim.place(ids, qpos)
        self.sim.set_assistive_force(ids, rng.uniform(0.0, self._force.lift, count))
        self.target[ids] = qpos[:, layout.qpos] + self.sim.parameters.joint_offset[ids]
        self.memory[ids] = 0.0  # as on a robot that lies
        e = self._episodes
        e.age[ids] = e.held[ids] = 0
        e.start[ids] = start
        e.ends_early[ids] = rng.random(count) < o.ends_early
        self.sensed = self.sim.sense(rng if o.randomization else None)
        if self.style is not None:
            library = self.style.library
            # A robot that stands has followed any curve to its end.
            rows = np.where(along, library.state_curve[states], -1)
            share = np.where(along, library.state_share[states], np.where(start >= 0, 0.0, 1.0))
            left = self.style.begin(ids, rows, share, self.sensed, rng)
            e.length[ids] = np.ceil(left / self.step_time)
            on_the_way = ids[start < 0]
            self.memory[on_the_way] = self.style.remember(on_the_way, self.target[on_the_way])

    def _draw_restarting(
        self, ended: NDArray[np.int_], terminated: NDArray[np.bool_]
    ) -> NDArray[np.int_]:
        """Draw those that restart of the robots whose episodes have ended, (m,)."""
        if self.style is None or not self.options.restarts:
            return ended[:0]
        drawn = self._rng.random(len(ended)) < self.options.restarts
        ids = ended[drawn & (terminated & ~self.sim.diverged)[ended]]
        return ids[self.style.library.find_near(self.style.tracker.features[ids])]

    def _restart(self, ids: NDArray[np.int_]) -> None:
        """Start episodes of some robots on new curves from where they are, as on a robot."""
        if self.style is None or not len(ids):
            return
        e = self._episodes
        e.age[ids] = e.held[ids] = 0
        self.memory[ids] = 0.0
        left = self.style.begin(
            ids, np.full(len(ids), -1), np.zeros(len(ids)), self.sensed, self._rng
        )
        e.length[ids] = np.ceil(left / self.step_time)

    def _observe(self) -> Floats:
        share = compute_torque_share(self.robot, self.action, self.sim.parameters.torque_limit)
        more = self.style.observe(self.sim) if self.style else ()
        return observe(self.robot, self.sensed, self.target, self.memory, share, more)

    @property
    def mirrors(self) -> tuple[Mirror, Mirror, Mirror]:
        """Return the mirrors of observation, critic's observation, and the head's outputs."""
        return self.mirror_of_observation(), self.mirror_of_critic(), self.head.mirror

    def mirror_of_observation(self) -> Mirror:
        """Return how left and right are exchanged in the policy's observation."""
        style = self.style.input if self.style else None
        return mirror_of_observation(self.robot, self.head.mirror, style)

    def mirror_of_critic(self) -> Mirror:
        """Return how left and right are exchanged in the critic's observation."""
        seen = self.mirror_of_observation()
        return Mirror.join((seen, *(term.mirror for term in self._critic_terms), SAME))

    def save_state(self) -> dict[str, Any]:
        """Return the complete state, for :meth:`restore_state`."""
        return {
            "sim": self.sim.save_state(),
            "rng": self._rng.bit_generator.state,
            "success": self.pool.success.copy(),
            "help": copy.copy(self._force),
            "terrain": self._terrain.save_state(),
            "target": self.target.copy(),
            "memory": self.memory.copy(),
            "sensed": self.sensed,
            "episodes": copy.deepcopy(self._episodes),
            "style": self.style.save_state() if self.style else None,
        }

    def restore_state(self, state: dict[str, Any]) -> None:
        """Restore a state of :meth:`save_state`."""
        self.sim.restore_state(state["sim"])
        self._rng.bit_generator.state = state["rng"]
        self.pool.success[:] = state["success"]
        self._force = copy.copy(state["help"])
        self._terrain.restore_state(state["terrain"])
        self.target, self.memory = state["target"].copy(), state["memory"].copy()
        self.sensed = state["sensed"]
        self._episodes = copy.deepcopy(state["episodes"])
        if self.style is not None:
            self.style.restore_state(state["style"])

    def _observe_privileged(self, observation: Floats) -> Floats:
        state, held = self.sim.measure_privileged_state(), self._episodes.held * self.step_time
        return observe_privileged(self._critic_terms, observation, state, self.sim.parameters, held)


def make_get_up(
    num_envs: int = 512,
    *,
    robot: str = "op3",
    rewards: str = "robust",
    randomization: str = "all",
    wide: bool = True,
    falls: int = 128,
    seed: int = 0,
    threads: int = 0,
) -> GetUpEnv:
    """Build a training environment from names and numbers.

    Args:
        num_envs: Number of robots side by side.
        robot: Name of a robot, or a folder with a robot.toml.
        rewards: Name of the rewards.
        randomization: Name of the domain randomization.
        wide: Whether mirrored joints may also move in opposite directions, and limbs spread.
        falls: Number of settled falls in the pool; their mirror images double it.
        seed: Seed of the falls; that of the episodes goes to ``reset``.
        threads: Threads that step physics; 0 for one per processor.

    Raises:
        ValueError: if there is no such robot, reward or randomization.
    """
    if rewards not in REWARDS:
        raise ValueError(f"unknown rewards '{rewards}', expected {', '.join(REWARDS)}")
    if randomization not in RANDOMIZATIONS:
        expected = ", ".join(RANDOMIZATIONS)
        raise ValueError(f"unknown randomization '{randomization}', expected {expected}")
    loaded = load_robot(robot)
    options = EnvOptions(
        robots=num_envs,
        randomization=RANDOMIZATIONS[randomization],
        rewards=REWARDS[rewards],
        threads=threads,
    )
    world = build_training_world(loaded, FLAT_SCENE, PHYSICS_STEP)
    pool = make_pool(world, falls, pool_rng(seed))
    return GetUpEnv(loaded, choose_actions(loaded, wide), pool, options)
