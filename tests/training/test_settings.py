"""What a training is asked for."""

from pathlib import Path

import pytest

from lidarium.training.settings import TrainingSettings, ValueSettings, read_training, training_of

WHOLE = """
seed = 3
[settings]
resolution = 0.05
[[rounds]]
floors = 4
kinds = { apartment = 1.0, office = 0.5 }
robots = [1, 2]
teaching_share = 0.5
[[rounds]]
floors = 3
[fit]
epochs = 5
[ppo]
decisions = 100
[validation]
floors = ["apartment"]
robots = [1]
"""


def test_a_predictor_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="did you mean 'network'"):
        training_of({"predictor": "netwrok"})
    assert training_of({"predictor": "network"}).predictor == "network"


def test_a_network_to_begin_with_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="begin is 'learned'; want 'tours', 'shipped' or a file of weights"):
        training_of({"begin": "learned"})


def test_a_file_says_what_to_train(tmp_path):
    path = tmp_path / "training.toml"
    path.write_text(WHOLE)
    training = read_training(path)
    assert training.seed == 3
    assert [each.floors for each in training.rounds] == [4, 3]
    assert training.rounds[0].kinds == {"apartment": 1.0, "office": 0.5}
    assert training.fit.epochs == 5
    assert training.ppo.decisions == 100
    assert training.validation.floors == ("apartment",)
    team = training.team(2)
    assert (team.robots, team.occupancy.resolution, team.stop_coverage) == (2, 0.05, 0.99)


@pytest.mark.parametrize(("recipe", "predictor"), [("learned_tours", "nothing"), ("learned", "network")])
def test_recipes_of_weights_can_be_used(recipe, predictor, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first = Path("runs", "learned_tours", "weights.safetensors")  # which the second recipe begins with
    first.parent.mkdir(parents=True)
    first.touch()
    training = read_training(Path(__file__).parents[2] / "docs" / "tutorials" / f"{recipe}.toml")
    assert training.predictor == predictor
    assert len(training.rounds) >= 2
    assert all(floor.startswith("set:validation") for floor in training.validation.floors)


def test_all_has_defaults():
    assert training_of({}) == TrainingSettings()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("sed = 1", "a training has no 'sed'"),
        ("[fit]\nepoch = 1", "fit has no 'epoch'"),
        ("[fit]\nepochs = 0", "epochs"),
        ("[fit]\nepochs = '3'", "epochs"),
        ("[fit]\nheld_out = 0.0", "held_out of fit is 0.0; want a share above 0 and below 1"),
        ("[fit]\nheld_out = 1.0", "held_out of fit is 1.0; want a share above 0 and below 1"),
        ("[ppo]\ndecisions = -1", "decisions"),
        ("[ppo]\ndiscount = 0.0", "discount"),
        ("rounds = []", "one or more tables"),
        ("rounds = 3", "one or more tables"),
        ("[[rounds]]\nfloors = 1", "floors"),
        ("[[rounds]]\nteaching_share = 2.0", "teaching_share"),
        ("[[rounds]]\nkinds = { castle = 1.0 }", "castle"),
        ("[[rounds]]\nkinds = { office = 0.0 }", "at least one above 0"),
        ("[[rounds]]\nkinds = { office = true }", "kinds.office is True"),
        ("[[rounds]]\nrobots = []", "sizes of teams"),
        ("[[rounds]]\nrobots = [0]", "sizes of teams"),
        ("settings = 3", "want a table"),
        ("[settings]\nresolutoin = 0.05", "resolutoin"),
        ("[settings]\nresolution = -1.0", "resolution"),
        ("[settings]\nrobots = 2", r"want them in \[\[rounds\]\]"),
        ("[ppo]\nenvironments = 0", "environments of ppo is 0"),
        ("[ppo]\nenvironments = 2\nsteps = 8\ncheckpoint = 24", "environments times steps, 16"),
        ("[validation]\nfloors = []", "names of floors"),
        ("[validation]\nfloors = [3]", "names of floors"),
        ("[validation]\nrobots = [true]", "sizes of teams"),
        ("seed = -1", "seed"),
        ("fit = 3", "fit is 3; want a table"),
        ("[[rounds]]\nrobots = 2", "robots of a round is 2; want a list"),
        ("[[rounds]]\nkinds = 'building'", "kinds of a round is 'building'; want a table"),
        ("[[rounds]]\nkinds = ['building']", "want a table"),
        ("[validation]\nfloors = 'set:validation:16'", "floors of validation is 'set:validation:16'; want a list"),
        ("[ppo]\nenvironments = 2\nsteps = 8\nbatch = 15\ncheckpoint = 16", "leave a batch of one"),
        ("x = [", "TOML"),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path, change, message):
    path = tmp_path / "training.toml"
    path.write_text(change)
    with pytest.raises(ValueError, match=message) as raised:
        read_training(path)
    assert str(path) in str(raised.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.toml"):
        read_training(tmp_path / "nowhere.toml")


def test_chances_go_from_the_first_to_the_last_one_whichever_is_higher():
    for first, last in ((0.3, 0.05), (0.05, 0.3), (0.0, 0.8)):
        value = ValueSettings(decisions=100, checkpoint=100, environments=2, first_chance=first, last_chance=last)
        found = [value.chance(decisions) for decisions in (0, 25, 50, 100)]
        assert found == pytest.approx([first, 0.5 * (first + last), last, last])
