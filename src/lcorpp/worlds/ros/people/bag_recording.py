"""Recordings of people from bags: one bag, or a folder of bags with a label each."""

from __future__ import annotations

import logging
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from lcorpp.camera.bags import is_bag
from lcorpp.errors import DataError, LcorppError, expected_one_of
from lcorpp.learning import Recording, Track
from lcorpp.learning.data.cleaning import MAX_GAP
from lcorpp.learning.data.labels import class_of_label, normalize_id, read_labels
from lcorpp.notebook import join_some
from lcorpp.values import GAZE_CHANNELS, GROUP_SEPARATOR
from lcorpp.worlds.ros.people.people_bag import read_people_bag
from lcorpp.worlds.ros.sensor_messages import Sample

LOG = logging.getLogger("lcorpp.robot")

Progress = Callable[[int, int], None]
"""Callback (bags read, number of bags)."""


def find_bags(path: Path) -> list[Path]:
    """Return the bags of a path: itself, or those in a folder, by name; none if it is neither."""
    if is_bag(path):
        return [path]
    return sorted(filter(is_bag, path.iterdir())) if path.is_dir() else []


def read_bags(
    path: Path,
    *,
    labels: Mapping[str, str] | None = None,
    label_file: Path | None = None,
    groups: str | None = None,
    topic: str | None = None,
    frame: str | None = None,
    gap: float = MAX_GAP,
    progress: Progress | None = None,
) -> Recording:
    """Read the tracks of the people in a bag, or in all bags of a folder.

    The ids of tracks are those of the people; in a folder of bags BAG/PERSON, with BAG the name of the bag.
    In a folder, bags that cannot be read are left out with a warning.

    Args:
        labels: label -> class. A bag whose name has such a label, between other signs than letters and
            digits, has this class; without labels and `label_file` there are no classes.
        label_file: a CSV of ids and labels, instead of the names; an id is a track's or a bag's. Other tracks
            are left out.
        groups: regular expression. The people of a bag are what it finds in the bag's name; None takes the
            id of each person.
        topic, frame: as of `read_people_bag`.
        gap: maximum number of seconds between two samples of one track.
        progress: called after each bag.

    Raises:
        FileError, DataError: as `read_people_bag`; no bag can be read, a bag's name has no label or two, or
            the regular expression is wrong or finds nothing.
        ParseError: `label_file` has a fault.
    """
    bags, pattern = find_bags(path), _compile(groups)
    if not bags:
        raise DataError(
            f"{path}: is no bag, and has none; expected a .bag file, or a folder with a ROS 2 bag"
        )
    classes = None if label_file is None else read_labels(label_file, labels or None)
    is_folder = bags != [path]
    # What names state comes first: it is wrong at once, and bags take a while.
    label_of = {bag: None if classes is not None or not labels else _find_label(bag, labels) for bag in bags}
    group_of = {bag: None if pattern is None else _find_group(bag, pattern) for bag in bags}
    tracks, notes, faults, used = list[Track](), list[str](), list[LcorppError](), set[str]()
    for done, bag in enumerate(bags, start=1):
        try:
            own, without = collect_tracks(read_people_bag(bag, topic, frame=frame), gap=gap)
        except LcorppError as fault:
            if not is_folder:
                raise
            faults.append(fault if str(bag) in str(fault) else DataError(f"{bag}: {fault}"))
            continue
        prefix = f"{name_bag(bag)}/" if is_folder else ""
        notes += [f"{prefix.rstrip('/')}: {note}" if prefix else note for note in without]
        for track in own:
            label = label_of[bag]
            if classes is not None:
                ids = (f"{name_bag(bag)}/{track.id}", f"{name_bag(bag)}/{track.group}", track.id, track.group)
                key = next((id for id in map(normalize_id, (*ids, name_bag(bag))) if id in classes), None)
                if key is None:
                    continue
                used.add(key)
                label = classes[key]
            tracks.append(
                Track(prefix + track.id, track.times, track.columns, label, group_of[bag] or track.group)
            )
        if progress is not None:
            progress(done, len(bags))
    if len(faults) == len(bags):
        raise faults[0]
    for each in faults:
        LOG.warning("%s; the bag is left out", each)
    if not tracks:
        what = "no person is seen twice" if classes is None else f"no track has its label in {label_file}"
        raise DataError(f"{path}: has no tracks: {what}")
    if classes is not None and len(used) < len(classes):
        unknown = sorted(classes.keys() - used)
        notes.append(
            f"{len(unknown)} of {len(classes)} ids of {label_file} have no tracks: {join_some(unknown)}"
        )
    if faults:
        notes.append(f"{len(faults)} of {len(bags)} bags cannot be read and are left out")
    return Recording(tuple(tracks), path.name, tuple(notes))


def collect_tracks(samples: Iterable[Sample], *, gap: float = MAX_GAP) -> tuple[list[Track], list[str]]:
    """Return the tracks of some samples, by person, and notes about samples that are left out.

    Of equal times the first sample counts, as in a stream. A track has the columns of all its samples; of a
    person with a face those without one are left out. After a pause longer than `gap` another track
    PERSON#2 begins, of the same group.
    """
    of_person = defaultdict[str, dict[float, Sample]](dict)
    for sample in samples:
        of_person[str(sample.person)].setdefault(sample.time, sample)
    tracks, notes, names = list[Track](), list[str](), set(of_person)
    for person in sorted(of_person):
        own = [of_person[person][time] for time in sorted(of_person[person])]
        faced = [sample for sample in own if GAZE_CHANNELS[0] in sample.columns]
        if 0 < len(faced) < len(own):
            notes.append(f"{len(own) - len(faced)} of {len(own)} samples of {person} have no gaze: left out")
            own = faced
        ends = np.flatnonzero(np.diff([sample.time for sample in own]) > gap) + 1
        pieces = [own[rows[0] : rows[-1] + 1] for rows in np.split(np.arange(len(own)), ends)]
        pieces = [piece for piece in pieces if len(piece) > 1]
        number = 1
        for piece in pieces:
            name = person if number == 1 else f"{person}#{number}"
            while number > 1 and name in names:  # another person's id
                number += 1
                name = f"{person}#{number}"
            names.add(name)
            number += 1
            tracks.append(_make_track(name, person, piece))
    return tracks, notes


def _make_track(name: str, person: str, samples: Sequence[Sample]) -> Track:
    known = [column for column in samples[0].columns if all(column in sample.columns for sample in samples)]
    columns = {column: np.array([sample.columns[column] for sample in samples]) for column in known}
    columns |= {
        "x": np.array([sample.x for sample in samples]),
        "y": np.array([sample.y for sample in samples]),
    }
    return Track(name, np.array([sample.time for sample in samples]), columns, group=person)


def _compile(groups: str | None) -> re.Pattern[str] | None:
    try:
        return None if groups is None else re.compile(groups)
    except re.error as error:
        raise DataError(f"groups {groups!r}: {error}; expected a regular expression") from None


def _find_group(bag: Path, pattern: re.Pattern[str]) -> str:
    """Return the people of a bag by its name."""
    found = [match[0] for match in pattern.finditer(name_bag(bag)) if match[0]]
    if not found:
        raise DataError(f"{bag}: its name has no people: {pattern.pattern!r} finds nothing in it")
    return GROUP_SEPARATOR.join(dict.fromkeys(found))


def _find_label(bag: Path, labels: Mapping[str, str]) -> str:
    """Return the class of a bag by the labels in its name, between other signs than letters and digits.

    A label within a longer one does not count, e.g. "engaged" in "not_engaged".
    """
    known, rest, found = dict.fromkeys((*labels, *labels.values())), name_bag(bag), dict[str, str]()
    for label in sorted(filter(None, known), key=len, reverse=True):
        pattern = rf"(?<![^\W_]){re.escape(label)}(?![^\W_])"
        if re.search(pattern, rest):
            found.setdefault(str(class_of_label(label, labels)), label)
            rest = re.sub(pattern, "/", rest)
    if len(found) != 1:
        what = "no label" if not found else f"labels of {len(found)} classes: {', '.join(found.values())}"
        raise DataError(f"{bag}: its name has {what}; {expected_one_of(list(known))} in it")
    return next(iter(found))


def name_bag(bag: Path) -> str:
    """Return the name of a bag without the suffix of a file; bytes that are no text are escaped."""
    path = bag if bag.name not in ("", "..") else bag.resolve()
    name = path.name if path.is_dir() else path.stem
    return name.encode("utf-8", "backslashreplace").decode()
