"""An entry in, its files out: drawn by the program, then made small enough for a repository."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import imageio_ffmpeg
from drawn import FILM_BYTES, PICTURE_BYTES
from entries import Entry, option
from PIL import Image

# What is seen through pictures that are clear where nothing is drawn.
BEHIND = (11, 16, 28)
# Between two words about a film that is being drawn, s.
PROGRESS_S = 20
# Qualities that are tried, best first, until a file is small enough.
WEBP_QUALITIES = range(94, 50, -4)
H264_QUALITIES = range(22, 41, 2)


class Failed(Exception):
    """A command that failed, and what it said."""


class Artist:
    """Draws with one program, one folder of data."""

    def __init__(self, program: Path, data: Path, work: Path, root: Path, say: Callable[[str], None]) -> None:
        self.say = say
        self.program = program
        self.data = data
        self.work = work
        self.root = root
        self.ffmpeg = shutil.which("ffmpeg") or imageio_ffmpeg.get_ffmpeg_exe()
        work.mkdir(parents=True, exist_ok=True)

    def draw(self, entry: Entry, folder: Path, key: str) -> None:
        """Puts the files of an entry in a folder; an unfinished film of the same key goes on where it was left."""
        folder.mkdir(parents=True, exist_ok=True)
        if entry.film is None:
            png = self.work / f"{entry.name}.png"
            self.render(entry, png)
            small_picture(png, folder / entry.picture)
            return
        frames = self.work / f"{entry.name}-{key}"
        self.render(entry, frames)
        self.small_film(entry, frames, folder / entry.files[-1])
        still = round(entry.still_s * frames_per_second(entry))
        small_picture(frames / f"picture-{still:05}.png", folder / entry.picture)
        shutil.rmtree(frames)

    def forget(self, entry: Entry) -> None:
        """Removes what is left of an unfinished film."""
        for frames in self.work.glob(f"{entry.name}-*/"):
            shutil.rmtree(frames)

    def render(self, entry: Entry, output: Path) -> None:
        """The command itself, of a film into a folder of its frames; its talk is kept for the case that it fails."""
        environment = {**os.environ, "FLUXGLOBE_DATA": str(self.data)}
        words = [str(self.program), *entry.words, "-o", str(output)]
        with tempfile.TemporaryFile() as talk:
            program = subprocess.Popen(words, env=environment, cwd=self.root, stdout=talk, stderr=talk)
            try:
                self.watch(program, entry, output)
            finally:
                # Whoever stops this stops the program too.
                program.kill()
                program.wait()
            talk.seek(0)
            said = talk.read().decode(errors="replace").strip()
        if program.returncode != 0 or not output.exists():
            raise Failed(f"{entry.command}\n{said}")

    def watch(self, program: subprocess.Popen, entry: Entry, output: Path) -> None:
        """Waits for the program, and says now and then how many frames there are."""
        while True:
            try:
                program.wait(timeout=PROGRESS_S)
                return
            except subprocess.TimeoutExpired:
                frames = len(list(output.glob("*.png"))) if output.is_dir() else 0
                self.say(f"{entry.name}: {frames} frames so far" if entry.film else f"{entry.name}: still drawing")

    def small_film(self, entry: Entry, frames: Path, output: Path) -> None:
        """A film that browsers play, of few bytes: H.264 in steps of quality, until it fits."""
        fps, (width, height) = frames_per_second(entry), size_px(entry)
        sky = f"color=0x{BEHIND[0]:02x}{BEHIND[1]:02x}{BEHIND[2]:02x}:s={width}x{height}:r={fps}"
        pictures = ["-framerate", str(fps), "-i", str(frames / "picture-%05d.png")]
        over = ["-filter_complex", "[1][0]overlay=shortest=1:format=rgb,format=yuv420p"]
        for quality in H264_QUALITIES:
            words = ["-c:v", "libx264", "-preset", "slow", "-crf", str(quality), "-movflags", "+faststart"]
            self.encode(*pictures, "-f", "lavfi", "-i", sky, *over, *words, str(output))
            if output.stat().st_size <= FILM_BYTES:
                return
        raise Failed(f"{output.name} has {output.stat().st_size} bytes at the worst quality that is tried")

    def encode(self, *words: str) -> None:
        """Runs ffmpeg; the same frames make the same bytes."""
        quiet = [self.ffmpeg, "-hide_banner", "-loglevel", "error", "-nostdin", "-y"]
        exact = ["-fflags", "+bitexact", "-flags:v", "+bitexact", "-map_metadata", "-1"]
        done = subprocess.run([*quiet, *words[:-1], *exact, words[-1]], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise Failed(f"ffmpeg {' '.join(words)}\n{done.stderr.strip()}")


def small_picture(png: Path, output: Path) -> None:
    """A picture of few bytes: WebP in steps of quality, until it fits."""
    with Image.open(png) as picture:
        behind = Image.new("RGBA", picture.size, (*BEHIND, 255))
        behind.alpha_composite(picture.convert("RGBA"))
    pixels = behind.convert("RGB")
    for quality in WEBP_QUALITIES:
        pixels.save(output, "WEBP", quality=quality, method=6)
        if output.stat().st_size <= PICTURE_BYTES:
            return
    raise Failed(f"{output.name} has {output.stat().st_size} bytes at the worst quality that is tried")


def frames_per_second(entry: Entry) -> int:
    """Of a film."""
    return int(option(entry.words, "--fps") or 25)


def size_px(entry: Entry) -> tuple[int, int]:
    """Width and height that an entry is drawn with."""
    width, height = (option(entry.words, "--size") or "1280x960").split("x")
    return int(width), int(height)
