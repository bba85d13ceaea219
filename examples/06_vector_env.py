"""Step sixteen environments at once, in the threads of one process. Prints shapes, scenarios and speed."""

import time

import gymnasium

import scengen.envs.gym  # noqa: F401  (registers the tasks)

STEPS = 200

envs = gymnasium.make_vec("scengen/domino_single-v2", num_envs=16, observations=["object-state"])
observations, infos = envs.reset(
    seed=0, options={"labels": True}
)  # those that come with scengen, in turn; or pool=FOLDER
print(f"scenarios {', '.join(infos['scenario'][:6])} and so on")
print(f"object-state {observations['object-state'].shape}, actions {envs.action_space.shape}")

envs.action_space.seed(0)
started = time.perf_counter()
for _ in range(STEPS):
    observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
seconds = time.perf_counter() - started
print(f"{STEPS * envs.num_envs / seconds:.0f} control periods of 10 ms per second; bodies: see envs.metadata['names']")
envs.close()
