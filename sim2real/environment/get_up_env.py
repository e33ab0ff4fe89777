"""The training environment: many fallen robots that learn to get up."""

from __future__ import annotations

import copy
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from humanoid_getup.policy.action import ActionSpec, next_target
from humanoid_getup.policy.observation import (
    SAME,
    Floats,
    Mirror,
    compute_torque_share,
    list_terms,
    mirror_of_observation,
    observe,
)
from humanoid_getup.style.curves import SavedState
from robots import Robot
from robots.quaternion import Array
from sim2real.environment.action_heads import DirectHead
from sim2real.environment.env_options import EnvOptions
from sim2real.environment.episodes import (
    HELD,
    LONGEST,
    AssistiveForce,
    EndedEpisodes,
    Episodes,
    LevelCurriculum,
)
from sim2real.environment.rewards import RewardInputs, list_critic_terms, score
from sim2real.environment.starts import StartPool, list_motion_starts, sample_stands
from sim2real.environment.style_task import StyleTask
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import (
    LONGEST_DELAY,
    build_training_world,
    fit_step,
)

STANDS = 64  # standing initial postures
FLOAT = np.float32


class GetUpEnv(VectorEnv):
    """Fallen robots that learn to stand up, as a Gymnasium vector environment.

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
        self.head = style.head if style else DirectHead(robot, action)
        randomization = options.randomization
        has_delays = randomization is not None and randomization.disturbance.split_delay != 0.0
        world = build_training_world(
            robot,
            options.scene,
            fit_step(options.physics_step, robot.control_period * action.cycles),
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
            physics=options.physics,
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
        self._levels = LevelCurriculum(pool.level)
        self._rng = np.random.default_rng(0)
        self.target = np.zeros((n, robot.n))
        self.memory = np.zeros((n, outputs))
        """Memory of each policy about its last actions, (N, m)."""
        self.episodes = Episodes.of(n, round(LONGEST / self.step_time))

    @property
    def longest(self) -> int:
        """Return the maximum length of an episode in policy steps."""
        return int(self.episodes.length[0])

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
            self._levels = LevelCurriculum(self.pool.level)
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
        terminated = np.zeros(self.num_envs, dtype=bool)
        if self.style is not None and inputs.style is not None:  # those that deviate too much
            terminated = self.style.find_terminated(inputs.style, inputs, self.step_time)
        over = self.episodes.advance(
            inputs.standing, terminated, self.sim.diverged, round(HELD / self.step_time)
        )
        report = self._note(over, state.height)
        ended = over.ended
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
            "level": self._levels.open,
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

    def _note(self, over: EndedEpisodes, height: Array) -> dict[str, Any]:
        """Count how episodes from falls ended, and how high (N,); the curricula follow all."""
        self.pool.note(over.starts, over.stood)
        self._force.note(over.stood)
        self._levels.note(over.starts, over.stood)
        fell = self.pool.fallen[over.starts]
        alone = fell & over.alone
        return {
            "falls": int(fell.sum()),
            "stood": int((over.stood & fell).sum()),
            "alone": int(alone.sum()),
            "stood_alone": int((over.stood & alone).sum()),
            "height_alone": float(height[over.from_pool][alone].sum()),
        }

    def _begin(self, ids: NDArray[np.int_]) -> None:
        """Place some robots for their next episode."""
        rng, o, count = self._rng, self.options, len(ids)
        kind = rng.random(count)
        start = np.where(kind < o.falls, self.pool.draw(count, rng, self._levels.open), -1)
        stands = self._stands.qpos[self._stands.draw(count, rng, self._levels.open)]
        qpos = np.where((start >= 0)[:, None], self.pool.qpos[start], stands)
        along = (kind >= o.falls) & (kind < o.falls + o.motions) & (len(self._motions) > 0)
        states = rng.integers(0, max(len(self._motions), 1), count)
        qpos[along] = self._motions[states[along]]
        layout = self.robot.layout(self.sim.model)
        qpos[along, layout.root_qpos : layout.root_qpos + 2] += o.origin
        if o.randomization:
            drawn = o.randomization.disturbance.draw(self.sim.world, count, rng)
            self.sim.set_parameters(ids, drawn)
        self.sim.place(ids, qpos)
        force = rng.uniform(0.0, self._force.lift, count)
        self.sim.set_assistive_force(ids, force)
        self.target[ids] = qpos[:, layout.qpos] + self.sim.parameters.joint_offset[ids]
        self.memory[ids] = 0.0  # as on a robot that lies
        self.episodes.begin(ids, start, rng.random(count) < o.ends_early, force)
        self.sensed = self.sim.sense(rng if o.randomization else None)
        if self.style is not None:
            library = self.style.library
            # A robot that stands has followed any curve to its end.
            rows = np.where(along, library.state_curve[states], -1)
            share = np.where(along, library.state_share[states], np.where(start >= 0, 0.0, 1.0))
            left = self.style.begin(ids, rows, share, self.sensed, rng)
            self.episodes.limit(ids, left / self.step_time)
            on_the_way = ids[start < 0]
            self.memory[on_the_way] = self.style.remember(on_the_way, self.target[on_the_way])

    def _draw_restarting(
        self, ended: NDArray[np.int_], terminated: NDArray[np.bool_]
    ) -> NDArray[np.int_]:
        """Draw the robots that restart among those whose episodes have ended, (m,)."""
        if self.style is None or not self.options.restarts:
            return ended[:0]
        drawn = self._rng.random(len(ended)) < self.options.restarts
        ids = ended[drawn & (terminated & ~self.sim.diverged)[ended]]
        return ids[self.style.library.find_near(self.style.tracker.features[ids])]

    def _restart(self, ids: NDArray[np.int_]) -> None:
        """Start episodes of some robots on new curves from their present state, as on a robot."""
        if self.style is None or not len(ids):
            return
        self.episodes.restart(ids)
        self.memory[ids] = 0.0
        rows, begun = np.full(len(ids), -1), np.zeros(len(ids))
        left = self.style.begin(ids, rows, begun, self.sensed, self._rng)
        self.episodes.limit(ids, left / self.step_time)

    def _observe(self) -> Floats:
        share = compute_torque_share(self.robot, self.action, self.sim.parameters.torque_limit)
        more = self.style.observe(self.sim) if self.style else ()
        return observe(self.robot, self.sensed, self.target, self.memory, share, more)

    @property
    def mirrors(self) -> tuple[Mirror, Mirror, Mirror]:
        """Return the mirrors of observation, critic's observation, and the head's outputs."""
        style = self.style.input if self.style else None
        seen = mirror_of_observation(self.robot, self.head.mirror, style)
        critic = Mirror.join((seen, *(term.mirror for term in self._critic_terms), SAME))
        return seen, critic, self.head.mirror

    def save_state(self) -> SavedState:
        """Return the complete state, for :meth:`restore_state`."""
        return {
            "sim": self.sim.save_state(),
            "rng": self._rng.bit_generator.state,
            "success": self.pool.success.copy(),
            "help": copy.copy(self._force),
            "levels": self._levels.save_state(),
            "target": self.target.copy(),
            "memory": self.memory.copy(),
            "sensed": self.sensed,
            "episodes": copy.deepcopy(self.episodes),
            "style": self.style.save_state() if self.style else None,
        }

    def restore_state(self, state: SavedState) -> None:
        """Restore a state of :meth:`save_state`."""
        self.sim.restore_state(state["sim"])
        self._rng.bit_generator.state = state["rng"]
        self.pool.success[:] = state["success"]
        self._force = copy.copy(state["help"])
        self._levels.restore_state(state["levels"])
        self.target, self.memory = state["target"].copy(), state["memory"].copy()
        self.sensed = state["sensed"]
        self.episodes = copy.deepcopy(state["episodes"])
        if self.style is not None:
            self.style.restore_state(state["style"])

    def _observe_privileged(self, observation: Floats) -> Floats:
        """Add each term, and the time of standing [s], to the policies' observations, (N, size)."""
        state, parameters = self.sim.measure_privileged_state(), self.sim.parameters
        parts = [term.read(state, parameters) for term in self._critic_terms]
        parts.append(self.episodes.held * self.step_time)
        columns = [observation, *(part.reshape(self.num_envs, -1) for part in parts)]
        return np.concatenate(columns, axis=1, dtype=FLOAT, casting="same_kind")
