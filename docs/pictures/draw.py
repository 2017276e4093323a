"""Draw the pictures of the documentation and the README from simulated captures: ``make pictures``."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import bat_room
import champion
import coupling
import hard_rooms
import loops
import paper_next
import slam
import still
import still_robot
import walk
from PIL import Image

HERE = Path(__file__).parent
IMAGES = HERE.parent / "images"
WIDTH = 1200
"""Pixels across, enough for a page on a dense screen."""


def main(folder: Path) -> None:
    """Run the experiment and draw everything, for which the extra ``slam`` is needed; ``folder`` is emptied first."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for words in (
        ("run", HERE / "boxes.yaml", "--out", folder / "boxes"),
        ("report", folder / "boxes", "--figures", folder / "figures"),
        ("simulate", "approach-metal", "--set", "radar.channel=9", "-o", folder / "approach.h5"),
        ("plot", "radargram", folder / "approach.h5", "--detector", "paper", "-o", folder / "radargram.png"),
        ("simulate", "demonstration-lab", "-o", folder / "laboratory.h5"),
        ("plot", "map", folder / "laboratory.h5", "--detector", "paper", "-o", folder / "map.png"),
        ("tune", HERE / "tune.yaml", "-o", folder / "tuned", "--figure", folder / "stable-zone.png"),
    ):
        subprocess.run([sys.executable, "-m", "uwbbench.cli", *map(str, words)], check=True)  # noqa: S603 - fixed words
    shutil.copyfile(folder / "figures" / "pareto-1-frame-filtering-f1.svg", IMAGES / "speed-against-f1.svg")
    coupling.main(folder / "coupling.png")
    still_robot.main(folder / "still-robot.png")
    paper_next.main(folder / "paper-next.png")
    hard_rooms.main(folder / "hard-room.png")
    champion.main(folder / "champion.png")
    walk.main(folder)
    still.main(folder)
    bat_room.main(folder)
    slam.main(folder)
    loops.main(folder)
    subprocess.run([sys.executable, HERE / "segments.py"], check=True)  # noqa: S603 - our own
    names = ("radargram", "map", "stable-zone", "coupling", "still-robot", "paper-next", "walker-svd", "kalman-track")
    names += ("slam-points", "slam-lines", "slam-anchors", "slam-graph", "slam-particles", "still-walkers")
    names += ("still-measured", "hard-room", "champion")
    for name in (f"{name}.png" for name in names if (folder / f"{name}.png").is_file()):
        shrink(folder / name, IMAGES / name)
    (IMAGES / "examples").mkdir(exist_ok=True)
    for script in sorted((HERE.parents[1] / "examples").glob("*.py")):
        subprocess.run([sys.executable, script, folder], check=True)  # noqa: S603 - our own
        shrink(folder / f"{script.stem}.png", IMAGES / "examples" / f"{script.stem}.png")


def shrink(source: Path, target: Path) -> None:
    """Picture of at most :data:`WIDTH` pixels and 256 colours, chosen so that rare ones stay themselves."""
    with Image.open(source) as picture:
        scale = min(1.0, WIDTH / picture.width)
        size = round(picture.width * scale), round(picture.height * scale)
        small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
        small.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(target, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
