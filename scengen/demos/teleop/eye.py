"""Pictures of a take that is driven, drawn in a separate thread, so that the control loop does not wait."""

import threading
import time
from contextlib import closing

import mujoco
import numpy as np

from ...envs.observations import cameras_of
from ...errors import UnknownName
from ...look.looks import ROOM
from ...orientation import UPRIGHT
from ...pictures.render import Camera, Picture
from .session import Session

POLICY_CAMERA = "rgb_exo_right_cam"
"""Camera for scenarios whose pictures are turned: people see what a policy sees."""


class Eye:
    """Draws the latest state of a take, as a policy sees it if its camera is one of the robot's."""

    def __init__(self, session: Session, width: int, height: int, camera: str | None = None, rate: float = 100.0):
        """Draw the first picture, which takes seconds.

        Args:
            width, height: size of the pictures [pixels].
            camera: a camera of the robot by the paper's name; by default a view that is fitted to the scene, or the
                policy's camera if the scenario's pictures are turned.
            rate: largest number of pictures in a second.

        Raises:
            UnknownName: there is no such camera.
            ScengenError: pictures cannot be drawn.
        """
        known = cameras_of(session.stage.embodiment)
        if camera is not None and camera not in known:
            raise UnknownName("camera", camera, known)
        if camera is None and session.stage.scenario.orientation != UPRIGHT:
            camera = POLICY_CAMERA
        self._camera = known[camera] if camera else None
        self._size, self._least = (width, height), 1.0 / rate
        self.picture: Picture = np.zeros((height, width, 3), np.uint8)
        """The latest picture, RGB, shape (height, width, 3)."""
        self.drawn = 0
        """Number of pictures so far."""
        self._stage, self._state, self._fresh = session.stage, _pose(session), threading.Condition()
        self._fault: BaseException | None = None
        self._ready, self._open = threading.Event(), True
        self._thread = threading.Thread(target=self._draw, daemon=True)
        self._thread.start()
        self._ready.wait()
        self.check()

    def check(self) -> None:
        """Raise the error with which drawing has ended, if it has."""
        if self._fault is not None:
            raise self._fault

    def look(self, session: Session) -> None:
        """Draw the state of a take next; one that was not drawn yet is replaced.

        Raises:
            ScengenError: pictures cannot be drawn.
        """
        self.check()
        with self._fresh:
            self._stage, self._state = session.stage, _pose(session)
            self._fresh.notify()

    def close(self) -> None:
        """End the thread."""
        with self._fresh:
            self._open = False
            self._fresh.notify()
        self._thread.join()

    def _draw(self) -> None:
        try:
            while self._open:
                stage = self._stage
                held = stage.scenario.orientation if self._camera else UPRIGHT
                with closing(Camera(stage.world(ROOM), *self._size)) as eye:
                    while self._open and stage is self._stage:
                        begun = time.monotonic()
                        _place(eye, self._state)
                        self.picture = held.apply(eye.take(self._camera)).copy()
                        self.drawn += 1
                        self._ready.set()
                        with self._fresh:
                            self._fresh.wait(timeout=0.5)
                        time.sleep(max(0.0, begun + self._least - time.monotonic()))
        except BaseException as error:  # reported to the person at the page
            self._fault = error
            self._ready.set()


_Pose = tuple[np.ndarray, np.ndarray, np.ndarray]


def _pose(session: Session) -> _Pose:
    """Coordinates of everything that a picture shows: those of joints, and places of marks."""
    data = session.world.data
    return data.qpos.copy(), data.mocap_pos.copy(), data.mocap_quat.copy()


def _place(eye: Camera, pose: _Pose) -> None:
    model, data = eye.world.model, eye.world.data
    data.qpos[:], data.mocap_pos[:], data.mocap_quat[:] = pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
