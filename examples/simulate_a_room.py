"""A room from a few lines of YAML: simulated, stored as a capture file, and mapped by a detector.

Leaves ``simulate_a_room.png``: the true outlines, the robot's path, and the points that the detector ``paper`` puts
on the map.
"""

import sys
import tempfile
from pathlib import Path

import uwbbench

ROOM = """
schema: 1
description: A locker, a post and a crate in a room of 5 by 4 m; a robot drives up to each of them.
receivers:
  front: {mount_position_m: [0.0, 0.125], tx_position_m: [0.0, -0.125]}
trajectory: {kind: waypoints, points_m: [[-1.8, -1.0], [1.2, -1.0], [1.2, 0.8], [-0.9, 0.8]], speed_m_s: 0.5}
objects:
  - {id: locker, shape: box, center_m: [2.2, -1], yaw_deg: 180, width_m: 1, depth_m: 0.4, height_m: 1, material: metal}
  - {id: post, shape: rod, center_m: [1.2, 1.6], radius_m: 0.08, height_m: 1.5, material: metal}
  - {id: crate, shape: box, center_m: [-2, 0.8], yaw_deg: 0, width_m: 0.6, depth_m: 0.4, height_m: 0.8, material: metal}
  - {id: east, shape: wall, center_m: [2.5, 0], yaw_deg: 180, width_m: 4, material: plasterboard, thickness_m: 0.0125}
  - {id: north, shape: wall, center_m: [0, 2], yaw_deg: -90, width_m: 5, material: plasterboard, thickness_m: 0.0125}
  - {id: west, shape: wall, center_m: [-2.5, 0], yaw_deg: 0, width_m: 4, material: plasterboard, thickness_m: 0.0125}
  - {id: south, shape: wall, center_m: [0, -2], yaw_deg: 90, width_m: 5, material: plasterboard, thickness_m: 0.0125}
terms:
  - {use: direct, params: {isolation_db: 6.0}}
  - {use: antenna}
  - {use: occlusion}
  - {use: ringing, params: {level_db: -20.0, decay_ns: 1.5}}
  - {use: echo.plate}
  - {use: echo.cylinder}
  - {use: echo.wall}
  - {use: grid}
  - {use: frame_gain}
  - {use: noise, params: {snr_db: 45.0}}
"""


def main(folder: Path) -> None:
    """Simulate, store, open again, draw the map."""
    scratch = Path(tempfile.mkdtemp())
    (scratch / "room.yaml").write_text(ROOM)
    scenes = uwbbench.open_dataset("simulated", {"scenes": [str(scratch / "room.yaml")]})
    uwbbench.write_capture(scratch / "room.h5", scenes.open(scenes.names()[0]))
    capture = uwbbench.open_capture(scratch / "room.h5")
    print(capture)
    uwbbench.plot("map", capture, folder / "simulate_a_room.png", detector="paper")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent)
