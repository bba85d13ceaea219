"""Judging: stages 1 and 3 of curation. A score from 1 to 5 and a verdict for each episode, written at once."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
import viser

from .. import compose
from ..control.loop import Loop
from ..demos.curate.curation import FOLDER, Curated, decided_again
from ..demos.curate.findings import EpisodeReport
from ..demos.curate.page import plot
from ..demos.curate.people import Decision, write_decision, write_score
from ..export.dataset import EpisodeData, Recording, rules_of
from ..export.recording import CONTROL_ACTIONS
from ..look.looks import ROOM
from ..pictures.page import template
from ..pool.untrusted import read_json
from ..samplers.split import ID
from ..sim.world import World
from ..validate.rebuilt import rebuild
from .player import Player
from .scene import FAULTS, SceneView, filmed, one_line

MAX_PICTURES = 5000
"""Largest number of recorded pictures of an episode that are shown: more than four minutes, and 1.2 GB of memory."""
MAX_LENGTH = 3.0
"""Largest length of an episode that is replayed, in time limits of its task: a person may take longer than that."""
SHRINK = 2
"""Step between the pixels of a recording's pictures that are shown: 320 x 240 of 640 x 480."""


@dataclass(frozen=True)
class Desk:
    """Recordings that can be judged."""

    recordings: Sequence[Recording]
    search: tuple[str, ...] = ()
    """Overrides that add folders of other packages, see `task_files.search_path`."""


class Judge:
    """The tab with which one person judges episodes."""

    def __init__(self, client: viser.ClientHandle, desk: Desk):
        self._client, self._desk, self._busy = client, desk, threading.RLock()
        self._view = SceneView(client.scene, "/episode")
        self._curated: Curated | None = None
        self._episode: EpisodeData | None = None
        self._pictures: list[np.ndarray] = []
        gui = client.gui
        labels = [f"{number}. {each.folder}" for number, each in enumerate(desk.recordings, 1)]
        self._data = gui.add_dropdown("recording", labels)
        self._number = gui.add_number("episode", 0, min=0, max=max(0, len(desk.recordings[0].episodes) - 1), step=1)
        self._steps = gui.add_button_group("", ("previous episode", "next episode", "next undecided"))
        self._scores = gui.add_button_group("score", ("1", "2", "3", "4", "5"))
        self._who = gui.add_text("your code", "p1")
        self._why = gui.add_text("reason", "")
        self._verdicts = gui.add_button_group("verdict", ("accept", "reject"))
        self._jump: viser.GuiDropdownHandle[str] = gui.add_dropdown("go to finding", list("-"))
        self.player = Player(client, self._view, self._at)
        """The controls of the film."""
        self._image = gui.add_image(np.zeros((12, 16, 3), np.uint8), visible=False)
        self._about = gui.add_html("")
        self._data.on_update(lambda _: self._run(self._open))
        self._number.on_update(lambda _: self._run(self._show))
        self._steps.on_click(lambda event: self.step(event.target.value))
        self._scores.on_click(lambda event: self.score(int(event.target.value)))
        self._verdicts.on_click(lambda event: self.decide(event.target.value))
        self._jump.on_update(lambda event: self._run(self._to_finding) if event.client is not None else None)
        self._run(self._open)

    @property
    def recording(self) -> Recording:
        """The chosen recording."""
        return self._desk.recordings[self._data.options.index(self._data.value)]

    def close(self) -> None:
        self.player.close()

    def hide(self) -> None:
        """Show no robot."""
        self.player.unload()
        self._view.clear()

    def step(self, where: str) -> None:
        """Go to another episode: previous episode, next episode or next undecided."""
        here, count = int(self._number.value), len(self.recording.episodes)
        if where == "next undecided":
            undecided = [one.episode for one in (self._curated.undecided if self._curated else ())]
            found = next((number for number in undecided if number > here), undecided[0] if undecided else here)
        else:
            found = min(max(0, here + (1 if where == "next episode" else -1)), count - 1)
        self._number.value = found

    def score(self, score: int) -> None:
        """Write a score of the episode."""
        self._run(lambda: self._write(lambda folder, count: write_score(folder, self._here, score, count)))

    def decide(self, verdict: str) -> None:
        """Write a verdict about the episode."""
        decision = Decision(verdict, str(self._who.value).strip(), str(self._why.value).strip())
        self._run(lambda: self._write(lambda folder, count: write_decision(folder, self._here, decision, count)))

    @property
    def _here(self) -> int:
        return self._episode.number if self._episode else 0

    def _write(self, write: Callable[..., None]) -> None:
        recording = self.recording
        write(recording.folder / FOLDER, len(recording.episodes))
        self._curated = decided_again(recording)
        self._describe()

    def _run(self, work: Callable[[], None]) -> None:
        """Do some work after the previous one; show a fault on the page."""
        with self._busy:
            try:
                work()
            except FAULTS as error:
                self._about.content = template("studio_fault.html").render(fault=one_line(error))

    def _open(self) -> None:
        self._number.max = max(0, len(self.recording.episodes) - 1)
        self._curated = decided_again(self.recording)
        self._episode = None
        if int(self._number.value) == 0:
            self._show()
        else:
            self._number.value = 0

    def _show(self) -> None:
        """Show the chosen episode: its report, its film, its pictures."""
        recording, number = self.recording, int(self._number.value)
        if self._episode is not None and self._episode.number == number:
            return
        self.player.unload()
        episode = next(each for each in recording.read() if each.number == number)
        self._episode, self._pictures = episode, []
        if recording.cameras:
            frames = islice(recording.frames(episode, recording.cameras[0]), min(len(episode), MAX_PICTURES))
            self._pictures = [picture[::SHRINK, ::SHRINK].copy() for picture in frames]
        self._image.visible = bool(self._pictures)
        self._why.value = ""
        self._describe()
        try:
            self._load(episode)
        except FAULTS as error:  # its report must still be seen
            told = f"it cannot be replayed: {one_line(error)}"
            self.player.outcome.content = template("studio_fault.html").render(fault=told)

    def _load(self, episode: EpisodeData) -> None:
        """Replay the episode's actions in the scene of its parameters."""
        task = compose.load_task(episode.task, self._desk.search)
        split = str(episode.about.get("scengen/split", ID))
        scenario = task.scenario(read_json(str(episode.about["scengen/params"])), split)
        world = World.load(rebuild(scenario), task.embodiment, look=ROOM)
        with self._client.atomic():
            self._view.show(world)
        periods = episode.columns[CONTROL_ACTIONS]
        actions = periods.reshape(-1, periods.shape[-1])[: round(MAX_LENGTH * task.horizon / Loop.PERIOD)]
        made = filmed(world, scenario, actions, task.horizon, rules_of(episode.about))
        self.player.load(made, play=False)
        self.player.outcome.content = template("studio_fault.html").render(note=f"replayed: {made.outcome}")

    @property
    def _report(self) -> EpisodeReport:
        assert self._curated is not None
        return self._curated.reports[self._here]

    def _describe(self) -> None:
        report, curated, episode = self._report, self._curated, self._episode
        assert curated is not None and episode is not None
        fps = self.recording.fps
        self._jump.options = (
            "-",
            *(
                f"{number}. {finding.check} at {finding.frames[0] / fps:.2f} s"
                for number, finding in enumerate(report.findings, 1)
                if finding.frames
            ),
        )
        self._about.content = template("studio_episode.html").render(
            report=report,
            decision=curated.decisions.get(report.episode),
            kept=report.episode in curated.kept,
            funnel=curated.funnel,
            undecided=len(curated.undecided),
            about=episode.about,
            plot=plot(episode, report, self.recording),
            fps=fps,
        )

    def _to_finding(self) -> None:
        number = str(self._jump.value).partition(".")[0]
        if number.isdecimal():
            self.player.seek(self._report.findings[int(number) - 1].frames[0] / self.recording.fps)

    def _at(self, seconds: float) -> None:
        """Show the recorded picture of a time."""
        if self._pictures:
            self._image.image = self._pictures[min(round(seconds * self.recording.fps), len(self._pictures) - 1)]
