"""Lessons in files."""

import numpy as np
import pytest
from drawn_decisions import drawn_decision

from lidarium.training.decisions import MOST_OPTIONS, MOST_TEAMMATES, PER_OPTION, stacked
from lidarium.training.teaching.samples import by_width, joined, read_samples, samples_of, write_samples
from lidarium.training.teaching.teacher import Lesson


def drawn(count, seed=0):
    generator = np.random.default_rng(seed)
    lessons = [Lesson(drawn_decision(generator, 4, 2), generator.uniform(0, 9, 4)) for _ in range(count)]
    return samples_of(lessons)


def test_what_was_written_is_read(tmp_path):
    samples = drawn(3)
    path = tmp_path / "a.npz"
    write_samples(path, samples)
    found = read_samples(path)
    for name in ("options", "crops", "teammates", "situation", "scores", "mask", "counts"):
        first, second = getattr(samples.narrowed(4).decisions, name), getattr(found.decisions, name)
        np.testing.assert_array_equal(first, second)
        assert first.dtype == second.dtype
    np.testing.assert_array_equal(found.regrets, samples.regrets[:, :4])
    assert len(found) == 3
    assert samples.regrets.shape == (3, MOST_OPTIONS)
    assert (samples.regrets[:, 4:] == 0.0).all()


def test_decisions_of_about_as_many_options_lie_together():
    generator = np.random.default_rng(1)
    counts = [2, 9, 4, 5, 2, 9, 2]
    lessons = [Lesson(drawn_decision(generator, n, 1), generator.uniform(0, 9, n)) for n in counts]
    parts = [samples_of(lessons[:4]), samples_of(lessons[4:]).narrowed(9)]
    groups = by_width(parts, (2, 5, 7, MOST_OPTIONS))
    assert [each.decisions.counts[:, 0].tolist() for each in groups] == [[2, 2, 2], [4, 5], [9, 9]]
    assert [each.regrets.shape[1] for each in groups] == [2, 5, MOST_OPTIONS]
    for k, group, row in ((2, 1, 0), (3, 1, 1), (5, 2, 1), (6, 0, 2)):
        found, n = groups[group], counts[k]
        np.testing.assert_array_equal(found.regrets[row, :n], lessons[k].regrets.astype(np.float32))
        for name in PER_OPTION:
            array = getattr(found.decisions, name)
            np.testing.assert_array_equal(array[row, :n], getattr(lessons[k].decision, name))
            assert not array[row, n:].any()
            assert array.shape[1] == found.regrets.shape[1]


@pytest.mark.parametrize("length", [0, 10, 1000])
def test_damaged_files_are_named(tmp_path, length):
    path = tmp_path / "a.npz"
    write_samples(path, drawn(2))
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(ValueError, match=r"a\.npz"):
        read_samples(path)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("options", lambda array: array[..., :-1]),  # of a version with other features
        ("options", lambda array: array.astype(np.float64)),
        ("mask", lambda array: array.astype(np.int8)),
        ("crops", lambda array: array[:1]),
        ("regrets", lambda array: np.full_like(array, np.nan)),
        ("counts", lambda array: array + 100),
        ("counts", lambda array: array[:, 0]),
    ],
)
def test_lessons_of_another_version_are_named(tmp_path, name, change):
    path = tmp_path / "a.npz"
    write_samples(path, drawn(2))
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays[name] = change(arrays[name])
    np.savez_compressed(path, **arrays)
    with pytest.raises(ValueError, match=rf"a\.npz is not lessons of a training: {name} .*; remove it"):
        read_samples(path)


def test_parts_are_joined():
    whole = joined([drawn(2, 0), drawn(3, 1)])
    assert len(whole) == 5
    np.testing.assert_array_equal(whole.decisions.options[2:], drawn(3, 1).decisions.options)
    with pytest.raises(ValueError, match="no lessons"):
        joined([])


def test_of_many_teammates_the_first_are_kept():
    decision = drawn_decision(np.random.default_rng(0), 3, 20)
    table = stacked([decision])
    assert table.counts.tolist() == [[3, MOST_TEAMMATES]]
    np.testing.assert_array_equal(table.teammates[0], decision.teammates[:MOST_TEAMMATES])
