"""Captures of one description are one row, and what is their own is not lost."""

from uwbbench.show.text.captures_sheets import captures_sheet, each_capture_sheet


def capture(name: str, about: str, dataset: str = "plates") -> dict[str, object]:
    return {
        "dataset": dataset,
        "capture": name,
        "frames": 10,
        "source": "simulated",
        "license": "MIT",
        "description": about,
    }


ALIKE = [capture(f"run-{number}", f"A plate. | front: {number} dB") for number in range(5)]


def test_captures_of_one_description_are_one_row() -> None:
    sheet = captures_sheet([*ALIKE, capture("other", "A box.")])
    assert sheet.rows == (
        ("plates", "run-0 to run-4", "5", "50", "simulated", "MIT", "A plate."),
        ("plates", "other", "1", "10", "simulated", "MIT", "A box."),
    )


def test_captures_of_different_datasets_stay_apart() -> None:
    sheet = captures_sheet([capture("a", "A plate."), capture("b", "A plate.", "second")])
    assert [row[0] for row in sheet.rows] == ["plates", "second"]


def test_each_capture_keeps_its_own_details() -> None:
    sheet = each_capture_sheet(ALIKE)
    assert [row[-1] for row in sheet.rows] == [f"front: {number} dB" for number in range(5)]
