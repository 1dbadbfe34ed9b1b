"""Where trainings take place."""

from collections import Counter
from dataclasses import replace

from lidarium.envs.floors.catalogue.names import SETS, load_floor
from lidarium.envs.floors.floor import Floor
from lidarium.training.places import first_number, place_of
from lidarium.training.settings import Round, TrainingSettings


def test_floors_are_those_of_the_training_set_alone():
    training = TrainingSettings(seed=1, rounds=(Round(kinds={"building": 1.0, "office": 1.0}),))
    first, count = SETS["train"]
    for number in (0, 5, 9_999, 10_000, 123_456):
        place = place_of(training, training.rounds[0], number)
        kind, seed = place.floor.split(":")
        assert kind in ("building", "office")
        assert first <= int(seed) < first + count
        assert place.seed == number


def test_kinds_and_teams_come_as_often_as_is_asked():
    stage = Round(kinds={"apartment": 3.0, "office": 1.0, "corridors": 0.0}, robots=(1, 1, 3))
    training = TrainingSettings(rounds=(stage,))
    places = [place_of(training, stage, number) for number in range(600)]
    kinds = Counter(place.floor.split(":")[0] for place in places)
    assert set(kinds) == {"apartment", "office"}
    assert 0.7 < kinds["apartment"] / 600 < 0.8
    robots = Counter(place.settings.robots for place in places)
    assert 0.6 < robots[1] / 600 < 0.73
    assert set(robots) == {1, 3}


def test_bare_floors_are_the_same_rooms_without_furniture():
    stage = Round(kinds={"apartment": 1.0, "building": 1.0}, bare_share=0.4)
    training = TrainingSettings(rounds=(stage,))
    furnished = TrainingSettings(rounds=(replace(stage, bare_share=0.0),))
    pairs = [(place_of(training, stage, n), place_of(furnished, furnished.rounds[0], n)) for n in range(60)]
    bare = [pair for pair in pairs if isinstance(pair[0].floor, Floor)]
    assert 12 <= len(bare) <= 36
    assert all(place == usual for place, usual in pairs if isinstance(place.floor, str))
    for place, usual in bare[:6]:
        floor = load_floor(usual.floor)
        assert place.floor.bounds == floor.bounds
        assert len(place.floor.solids) < len(floor.solids)
        assert place.name.endswith(" without furniture")
        assert (place.settings, place.seed) == (usual.settings, usual.seed)


def test_a_place_depends_on_its_number_and_the_seed_alone():
    stage = Round(kinds={"apartment": 1.0, "office": 1.0}, robots=(1, 2, 3))
    training, other = TrainingSettings(seed=1, rounds=(stage,)), TrainingSettings(seed=2, rounds=(stage,))
    places = [place_of(training, stage, number) for number in range(30)]
    assert places == [place_of(training, stage, number) for number in range(30)]
    assert places != [place_of(other, stage, number) for number in range(30)]


def test_rounds_follow_each_other():
    training = TrainingSettings(rounds=(Round(floors=5), Round(floors=7)))
    assert [first_number(training, number) for number in range(3)] == [0, 5, 12]


def test_dungeons_are_drawn_by_the_same_seeds():
    training = TrainingSettings(rounds=(Round(kinds={"dungeon": 1.0}, bare_share=1.0),), predictor="network")
    place = place_of(training, training.rounds[0], 3)
    assert place.name == f"dungeon of seed {SETS['train'][0] + 3}"
    assert place.predictor == "network"
    again = place_of(training, training.rounds[0], 3)
    assert place.floor.sha256 == again.floor.sha256
