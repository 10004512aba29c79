"""`Film`: a recorded run as pictures, in a window or in a file (PNG, GIF, MP4)."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.files import check_place, put
from flexarm_env.actions import TORQUE_LIMIT
from flexarm_env.envs.drawing import centre_lines
from flexarm_env.envs.rendering import SIZE_LIMITS, Renderer, Snapshot
from flexarm_env.envs.scene import MARGIN
from flexarm_env.extras import import_pygame, needs_extra
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.trajectory import Trajectory
from flexarm_env.validation import choice, integer, number

Tick = Callable[[], Any]
SUFFIXES = (".png", ".gif", ".mp4")
MOST_FPS = 100  # [1/s]
MOST_PICTURES = 100_000
GIF_CLOCK = 100  # GIF files count time in hundredths of a second
GIF_FPS = tuple(fps for fps in range(1, 51) if GIF_CLOCK % fps == 0)  # browsers slow down what is quicker
SENSOR = "sensor_position"  # in a run's notes: distance of the sensor from the elbow [m]
UNKNOWN = np.full(2, np.nan)  # a point that is not shown


def check_look(fps: int, speed: float, size: int) -> tuple[int, float, int]:
    """Check how a run is shown: pictures a second, seconds of the run in a second, side of a picture [px]."""
    return (
        integer("fps", fps, 1, MOST_FPS),
        number("speed", speed, least=0.01, most=100.0),
        integer("size", size, *SIZE_LIMITS),
    )


def check_pictures(fps: int, speed: float, duration: float) -> int:
    """Return how many pictures a run of a duration [s] has; refuse too many."""
    count = int(min(duration * fps / speed, 1e9)) + 1
    if count > MOST_PICTURES:
        raise ValueError(
            f"fps = {fps} at speed = {speed:g}: makes {count} pictures of {duration:g} s; at most {MOST_PICTURES}"
        )
    return count


def check_output(path: Path, fps: int, time: float | None) -> str:
    """Check that a film, or its picture at a time [s], can be written to a file; return the file's suffix."""
    suffix = choice("output's suffix", path.suffix.lower(), SUFFIXES)
    if suffix == ".gif" and fps not in GIF_FPS:
        raise ValueError(f"fps = {fps}: must be one of {', '.join(map(str, GIF_FPS))} for a .gif file")
    if time is not None:
        if suffix != ".png":
            raise ValueError(f"time = {time:g} s: is for .png files; {suffix} shows the whole run")
        number("time", time, "s", least=0.0)
    import_pygame()
    if suffix != ".png":
        (_pillow if suffix == ".gif" else _ffmpeg)()
    check_place("output", path)
    return suffix


def _pillow() -> Any:
    with needs_extra("gif", "video"):
        from PIL import Image
    return Image


def _ffmpeg() -> Any:
    with needs_extra("mp4", "video"):
        from moviepy.video.io.ffmpeg_writer import FFMPEG_VideoWriter
    return FFMPEG_VideoWriter


class Film:
    """A recorded run, played at a speed, by pictures of a size [px] at a rate [1/s]."""

    def __init__(self, run: Trajectory, fps: int = 25, speed: float = 1.0, size: int = 600) -> None:
        self.run = run
        self.fps, self.speed, self.size = check_look(fps, speed, size)
        self._arm = FlexibleArm(run.parameters)
        place = run.notes.get(SENSOR)
        self._place = None if place is None else number(SENSOR, place, "m", least=0.0)
        if not (np.isfinite(run.time).all() and (np.diff(run.time) >= 0.0).all()):
            raise ValueError("time: must be finite, and must not run backwards")
        self._count = check_pictures(self.fps, self.speed, float(run.time[-1] - run.time[0]))

    def __len__(self) -> int:
        return self._count

    def instants(self) -> list[int]:
        """Return the index of the run's instant that each picture shows."""
        times = self.run.time[0] + np.arange(len(self)) * self.speed / self.fps
        return [int(n) for n in np.searchsorted(self.run.time, times - 1e-9).clip(0, len(self.run) - 1)]

    def snapshot(self, n: int) -> Snapshot:
        """Return what the picture of an instant shows."""
        run, arm = self.run, self._arm
        q = np.nan_to_num(run.state[n, : arm.size], posinf=0.0, neginf=0.0)
        return Snapshot(
            time=float(run.time[n]),
            links=centre_lines(arm, q),
            path=np.empty((0, 2)) if run.reference is None else run.reference,
            trace=run.tip[: n + 1],
            reference=UNKNOWN if run.reference is None else run.reference[n],
            sensor=UNKNOWN if self._place is None else arm.position(q, 2, self._place),
            sensed=UNKNOWN if run.sensed is None else run.sensed[n],
            torque=run.torque[n],
            torque_scale=TORQUE_LIMIT,
            gain=None if run.gain is None else float(run.gain[n]),
            gain_limit=1.0 if run.gain is None else max(1.0, float(np.nanmax(run.gain))),
            reach=MARGIN * arm.parameters.reach,
        )

    def show(self) -> None:
        """Show the run in a window, which can be paused and closed (see `flexarm_env.envs.window`)."""
        renderer = Renderer("human", self.size, self.fps)
        for n in self.instants():
            renderer.draw(self.snapshot(n))
            if renderer.dismissed:
                break
        renderer.close()

    def write(self, path: Path, time: float | None = None, tick: Tick = lambda: None) -> None:
        """Write a .gif or .mp4, or as .png the picture of a time [s], None: the last one; complete or absent.

        `tick` is called after each picture.
        """
        suffix = check_output(path, self.fps, time)
        if suffix == ".png":
            n = len(self.run) - 1 if time is None else self._instant(time)
            put(path, lambda aside: self._write_png(aside, n))
            tick()
            return
        put(path, lambda aside: (self._write_gif if suffix == ".gif" else self._write_mp4)(aside, tick))

    def _instant(self, time: float) -> int:
        first, last = float(self.run.time[0]), float(self.run.time[-1])
        number("time", time, "s", least=first, most=last)
        return int(np.argmin(np.abs(self.run.time - time)))

    def _pictures(self, tick: Tick) -> Iterator[NDArray[np.uint8]]:
        renderer = Renderer("rgb_array", self.size)
        for n in self.instants():
            picture = renderer.draw(self.snapshot(n))
            assert picture is not None
            yield picture
            tick()

    def _write_png(self, path: Path, n: int) -> None:
        picture = Renderer("rgb_array", self.size).draw(self.snapshot(n))
        pygame = import_pygame()
        assert picture is not None
        pygame.image.save(pygame.surfarray.make_surface(picture.swapaxes(0, 1)), str(path))

    def _write_gif(self, path: Path, tick: Tick) -> None:
        image = _pillow()
        frames = [image.fromarray(one).quantize(64, dither=image.Dither.NONE) for one in self._pictures(tick)]
        duration = 1000 // self.fps  # [ms]
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=duration, loop=0, optimize=True)

    def _write_mp4(self, path: Path, tick: Tick) -> None:
        writer_of = _ffmpeg()
        even = self.size - self.size % 2  # the codec takes even sizes only
        with writer_of(str(path), (even, even), self.fps, preset="fast") as writer:
            for picture in self._pictures(tick):
                writer.write_frame(np.ascontiguousarray(picture[:even, :even]))
