"""Settings of the supervisor on the command line."""

import pytest

from lidarium.scripts.options.supervisor import check_supervised, gathered, is_supervised, supervisor_options


def test_settings_of_the_supervisor_are_one_option():
    words = ["run", "--supervisor.period-s", "5", "--robots", "2", "--supervisor.assignment=utility"]
    assert gathered(words) == [
        "run",
        "--robots",
        "2",
        "--supervisor",
        "period_s=5",
        "assignment=utility",
    ]
    assert gathered(["run", "--seed", "1"]) == ["run", "--seed", "1"]
    assert supervisor_options(["returns_home=true", "assignment=utility", "period_s=5"]) == {
        "returns_home": True,
        "assignment": "utility",
        "period_s": 5,
    }


@pytest.mark.parametrize("words", [["--supervisor.period_s"], ["--supervisor.period_s", "--seed", "1"]])
def test_a_setting_without_a_value_is_refused(words):
    with pytest.raises(ValueError, match=r"--supervisor.period_s has no value"):
        gathered(words)


def test_an_empty_value_and_more_equals_signs_are_kept():
    assert gathered(["--supervisor.a=", "--supervisor.b=c=d"]) == ["--supervisor", "a=", "b=c=d"]


def test_a_setting_that_there_is_not_is_refused_with_the_nearest_name():
    with pytest.raises(ValueError, match="did you mean 'period_s'"):
        supervisor_options(["perod_s=5"])
    with pytest.raises(ValueError, match="'period_s' sets nothing; want KEY=VALUE"):
        supervisor_options(["period_s"])


def test_policies_that_are_led_are_named():
    assert is_supervised("supervised")
    assert not is_supervised("nearest_frontier")
    check_supervised("supervised")
    with pytest.raises(ValueError, match=r"'nearest_frontier' has none; want one of .*supervised"):
        check_supervised("nearest_frontier")
