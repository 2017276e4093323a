"""The process that measures: reads what to measure from standard input, writes the result as JSON.

Run as ``python -m uwbbench.measure.latency.worker``. Threads of numerical libraries are limited by environment
variables, which the parent sets, as some libraries read them only when they are imported.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

if TYPE_CHECKING:
    from uwbbench.api.arrays import FloatArray
    from uwbbench.api.capture import Capture
    from uwbbench.api.drive import Drive
    from uwbbench.detect.mapping import MappingPipeline
    from uwbbench.detect.pipeline import Pipeline
    from uwbbench.measure.latency.loops import Pass
    from uwbbench.measure.latency.played import Played, Timed


def main() -> int:
    """Measure once."""
    from uwbbench.api.errors import UwbbenchError

    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever a plugin prints must not end up in the answer
    spec = yaml.safe_load(sys.stdin)
    core = _pin()
    try:
        result = _measured(spec, core)
    except UwbbenchError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    with answer:
        json.dump(result, answer)
    return 0


def _pin() -> int | None:
    """Keep this process on one core, so that it never moves to a cold cache; None where the system cannot."""
    if not hasattr(os, "sched_setaffinity"):
        return None
    core = max(os.sched_getaffinity(0))  # interrupts tend to be served by the first
    os.sched_setaffinity(0, {core})
    return core


def _measured(spec: dict[str, Any], core: int | None) -> dict[str, Any]:
    from uwbbench.api import registry
    from uwbbench.api.capture import Capture
    from uwbbench.api.errors import CaptureError
    from uwbbench.measure.latency import loops, memory
    from uwbbench.measure.latency.compilations import undisturbed
    from uwbbench.measure.latency.machine import load

    load_before = load()
    pipeline = _pipeline(spec["detector"])
    opening = perf_counter()
    capture, frames = _opened(spec)
    opening_s = perf_counter() - opening
    if len(frames) == 0:
        raise CaptureError(f"capture '{capture.name}' has no frames; there is nothing to time")
    _first_answer(pipeline, capture, frames)
    startup_s = perf_counter() - spec["started"] - opening_s

    warmed = loops.warm_up(pipeline, capture, frames, spec["warmup_windows"])
    notes = [] if warmed else ["warm-up windows never agreed within 5 %"]
    if len(capture) > len(frames):
        notes.append(f"timed the first {len(frames)} of {len(capture)} frames")
    calls, compiled_in_calls = _calls(pipeline, capture, frames)
    peak_memory_bytes = memory.peak_bytes()
    batch_us, compiled_in_batch = undisturbed(lambda: loops.batch_times_us(pipeline, capture, frames))
    paced, compiled_in_paced = _paced(pipeline, capture, frames, spec)
    preempted = calls["quality"].get("involuntary_switches", 0)
    if preempted > 0.01 * calls["n"]:
        notes.append(f"other processes took the core {preempted} times in {calls['n']} calls: tails are partly theirs")
    ratio, compiled_in_pair = _ratio(pipeline, capture, frames, spec)
    compilations = compiled_in_calls + compiled_in_batch + compiled_in_paced + compiled_in_pair
    if compilations:
        notes.append("code was compiled during the timed passes: some times hold that of the compiler")
    instructions, instructions_note = _instructions(pipeline, capture, frames)
    null = _pipeline({"schema": 1, "name": "idle", "pipeline": [{"use": registry.default("stage.idle")}]})
    single = frames if isinstance(frames, Capture) else frames.captures[0]
    loops.warm_up(null, single, single, spec["warmup_windows"])
    overhead_us = loops.stream_pass(null, single, single).times_us
    growth = memory.growth(pipeline, capture, frames)
    os_threads, threads = _os_threads(), _threads()
    age = _age(pipeline, capture, frames, np.array(calls["times_us"]))
    if threads > 1:
        notes.append(f"a numerical library would use {threads} threads")
    return {
        **calls,
        "age": age,
        "throughput_us": float(np.median(batch_us)),
        "throughput_best_us": float(batch_us.min()),
        "overhead_us": float(np.median(overhead_us)),
        "clock_us": loops.clock_us(),
        "startup_s": startup_s,
        "peak_memory_bytes": peak_memory_bytes,
        "ratio_to_reference": ratio,
        **paced,
        "instructions_per_frame": instructions,
        "instructions_note": instructions_note,
        **growth,
        "warmed": warmed,
        "threads": threads,
        **_surroundings(core),
        "quality": {
            **calls["quality"],
            "compilations": compilations,
            "load_before": load_before,
            "load_after": load(),
            "os_threads": os_threads,
        },
        "notes": notes,
    }


def _opened(spec: dict[str, Any]) -> tuple[Capture | Drive, Capture | Drive]:
    """What to measure on, a capture or a run, and its received frames."""
    from uwbbench.config.source import CaptureRef, RunRef
    from uwbbench.measure.latency.received import received, received_run

    given: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in spec["capture"].items()
    }
    if "captures" in given:
        drive = RunRef(**given).open()
        return drive, received_run(drive, spec["frames"])
    capture = CaptureRef(**given).open()
    return capture, received(capture, spec["frames"])


def _first_answer(pipeline: Timed, capture: Played, frames: Played) -> None:
    pipeline.open(capture).step(frames.frames(0, 1)).records()


def _calls(pipeline: Timed, capture: Capture | Drive, frames: Played) -> tuple[dict[str, Any], int]:
    """The stream, one frame a call, and how often something was compiled in it."""
    from uwbbench.measure.latency import latency, loops
    from uwbbench.measure.latency.compilations import undisturbed
    from uwbbench.measure.latency.counters import Usage

    def once() -> tuple[Pass, dict[str, int]]:
        before = Usage.now()
        passed = loops.stream_pass(pipeline, capture, frames)
        after = Usage.now()
        return passed, {} if before is None or after is None else after.since(before)

    (passed, usage), compilations = undisturbed(once)
    times_us = passed.times_us
    figures = {
        "timed": latency.ROWS,
        **latency.call_summary(times_us, 1e6 / capture.radar.frame_rate_hz),
        "step": latency.distribution(passed.step_us),
        **latency.kinds_summary(times_us, passed.clustered),
        "amortised_us": float(times_us.sum() + passed.flush_us) / len(times_us),
        "quality": usage,
        "times_us": times_us.tolist(),
        "step_us": passed.step_us.tolist(),
    }
    return figures, compilations


def _age(
    pipeline: Timed, capture: Capture | Drive, frames: Capture | Drive, times_us: FloatArray
) -> dict[str, Any] | None:
    """How late detections are handed out; a pass of its own, whose streams see the frames that were timed."""
    from uwbbench.api.capture import Capture
    from uwbbench.api.drive import Drive
    from uwbbench.detect.hand_out import driven
    from uwbbench.detect.mapping import MappingPipeline
    from uwbbench.detect.pipeline import Pipeline
    from uwbbench.measure.accuracy.age import age_summary

    if isinstance(pipeline, MappingPipeline):
        assert isinstance(capture, Drive)  # noqa: S101 - opened so
        return age_summary(pipeline.answers(capture, len(times_us)), capture.time_s[: len(times_us)], times_us)
    assert isinstance(pipeline, Pipeline) and isinstance(capture, Capture) and isinstance(frames, Capture)  # noqa: S101, PT018
    return age_summary(driven(pipeline.open(capture), frames), frames.trajectory.timestamp_s, times_us)


def _paced(
    pipeline: Timed, capture: Capture | Drive, frames: Played, spec: dict[str, Any]
) -> tuple[dict[str, Any], int]:
    """Frames at a fixed rate, where that was asked for, and how often something was compiled meanwhile."""
    from uwbbench.measure.latency import paced
    from uwbbench.measure.latency.compilations import undisturbed

    if spec["paced_s"] is None:
        return {}, 0
    rate_hz = spec["rate_hz"] or capture.radar.frame_rate_hz
    (times_us, lateness_us), compilations = undisturbed(
        lambda: paced.paced_pass(pipeline, capture, frames, rate_hz, spec["paced_s"]), tries=1
    )
    summary = paced.paced_summary(times_us, lateness_us, rate_hz)
    return {"paced": summary, "paced_times_us": times_us.tolist()}, compilations


def _ratio(
    pipeline: Pipeline | MappingPipeline, capture: Capture | Drive, frames: Capture | Drive, spec: dict[str, Any]
) -> tuple[dict[str, Any] | None, int]:
    """Alternating with the reference, where there is one, and how often something was compiled meanwhile."""
    from uwbbench.api.capture import Capture
    from uwbbench.detect.pipeline import Pipeline
    from uwbbench.measure.latency.compilations import undisturbed
    from uwbbench.measure.latency.player import Player, in_turns, turn_frames
    from uwbbench.measure.latency.ratio import ratio_summary

    reference = None if spec["reference"] is None else _pipeline(spec["reference"])
    if not (isinstance(pipeline, Pipeline) and isinstance(reference, Pipeline)):  # a reference is of single captures
        return None, 0
    assert isinstance(capture, Capture) and isinstance(frames, Capture)  # noqa: S101, PT018 - opened so
    players = [Player(timed, capture, frames) for timed in (pipeline, reference)]
    players[1].warm_up(spec["warmup_windows"])
    size = turn_frames([player.call_s() for player in players], len(frames))
    blocks = max(spec["blocks"], len(frames) // size)  # all frames count in the ratio of all time together
    times_s, compilations = undisturbed(lambda: in_turns(players, size, blocks))
    waited_s = np.reshape([player.waited_s for player in players], (-1, blocks, 2))
    disturbed = int(np.count_nonzero(waited_s.any(axis=(0, 2))))
    ratio = ratio_summary(times_s[:, 0], times_s[:, 1])
    return {"reference": reference.name, **ratio, "disturbed_blocks": disturbed}, compilations


def _instructions(pipeline: Timed, capture: Played, frames: Played) -> tuple[float | None, str]:
    """Instructions a frame, in a pass of its own."""
    from uwbbench.measure.latency import loops
    from uwbbench.measure.latency.counters import counted

    stream = pipeline.open(capture)
    step, receive, sts = stream.step, frames.frames, "sts" in stream.needs

    def work() -> None:
        for frame in range(len(frames)):
            step(receive(frame, frame + 1, sts=sts)).records()

    with loops.quiet():
        count, note = counted(work)
    return None if count is None else count / len(frames), note


def _pipeline(data: dict[str, Any]) -> Pipeline | MappingPipeline:
    from uwbbench.api.yaml_file import YamlFile
    from uwbbench.config.detector import check_detector
    from uwbbench.detect.mapping import MappingPipeline
    from uwbbench.detect.pipeline import Pipeline

    config = check_detector(data, YamlFile(f"detector '{data['name']}'", data, {}))
    return Pipeline(config) if config.mapper is None else MappingPipeline(config)


def _surroundings(core: int | None) -> dict[str, Any]:
    from uwbbench.measure.latency.machine import machine, versions

    about = machine()
    # The process may use one core by now; what is described is the machine.
    del about["usable_cores"]
    return {
        "pinned": core is not None,
        "cpu": about["cpu"],
        "machine": {**about, "core": core, "versions": versions()},
    }


def _threads() -> int:
    """Most threads that any loaded numerical library would use."""
    from threadpoolctl import threadpool_info

    counts = [int(pool["num_threads"]) for pool in threadpool_info()]
    if "numba" in sys.modules:
        import numba

        counts.append(int(numba.get_num_threads()))
    return max(counts, default=1)


def _os_threads() -> int | None:
    """Threads that this process really has; None where the system does not list them."""
    tasks = Path("/proc/self/task")
    return len(list(tasks.iterdir())) if tasks.is_dir() else None


if __name__ == "__main__":
    sys.exit(main())
