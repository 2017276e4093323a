"""Bodies: their outlines and faces agree with each other and with their sizes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uwbbench.api.geometry import nearest_on_outline
from uwbbench_datasets.simulator.shapes import ObjectModel, faces

angle = st.floats(-360, 360)
size = st.floats(0.01, 3)


def area(outline: np.ndarray) -> float:
    x, y = outline.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


@settings(max_examples=40)
@given(yaw=angle, width=size, depth=size)
def test_a_box_has_its_area_whatever_its_heading(yaw: float, width: float, depth: float) -> None:
    body = ObjectModel(
        id="b", shape="box", center_m=[1, 2], yaw_deg=yaw, width_m=width, depth_m=depth, height_m=1
    ).body()
    assert area(body.obstacle.outline_m) == pytest.approx(width * depth, rel=1e-6)


@settings(max_examples=40)
@given(yaw=angle, width=size, depth=size)
def test_faces_lie_on_the_outline_and_look_outwards(yaw: float, width: float, depth: float) -> None:
    body = ObjectModel(
        id="b", shape="box", center_m=[1, 2], yaw_deg=yaw, width_m=width, depth_m=depth, height_m=0.5
    ).body()
    found = faces(body)
    assert len(found) == 4
    assert sum(face.width_m for face in found) == pytest.approx(2 * (width + depth))
    for face in found:
        for end in (-0.5, 0.5):
            corner = (face.center_m + end * face.width_m * face.across)[None, :2]
            gaps = np.linalg.norm(body.obstacle.outline_m - corner, axis=1)
            assert gaps.min() < 1e-9
        assert face.normal @ (face.center_m - body.center_m) > 0
        assert abs(face.normal @ face.across) < 1e-12


def test_the_front_of_a_plate_looks_along_its_yaw() -> None:
    body = ObjectModel(id="p", shape="plate", center_m=[0, 0], yaw_deg=90, width_m=1, height_m=1).body()
    front, back = faces(body)
    assert np.allclose(front.normal, [0, 1, 0])
    assert np.allclose(back.normal, [0, -1, 0])


def test_a_cylinder_is_round_to_half_a_percent() -> None:
    body = ObjectModel(id="r", shape="rod", center_m=[0, 0], radius_m=0.1, height_m=1).body()
    around = np.linspace(0, 2 * np.pi, 100)
    outside = 2 * np.stack([np.cos(around), np.sin(around)], axis=1)
    reached = nearest_on_outline(outside, body.obstacle.outline_m)
    assert np.all(np.abs(np.linalg.norm(reached, axis=1) - 0.1) < 0.0005)


def test_walls_are_structure_unless_told_otherwise() -> None:
    wall = ObjectModel(id="w", shape="wall", center_m=[0, 0], width_m=3).body()
    assert wall.structure
    assert (wall.depth_m, wall.height_m) == (0.1, 2.5)
    assert not ObjectModel(id="w", shape="wall", center_m=[0, 0], width_m=3, structure=False).body().structure


def test_a_point_has_one_vertex() -> None:
    body = ObjectModel(id="p", shape="point", center_m=[1, 2]).body()
    assert body.obstacle.outline_m.tolist() == [[1.0, 2.0]]
