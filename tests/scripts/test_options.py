"""Options that commands share: policies, supervisor, films, the live view."""

import io
import json
import re
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path

import pytest

from lidarium.extras import install_command
from lidarium.scripts.main import main
from lidarium.scripts.options import (
    FilmFiles,
    FilmOptions,
    check_supervised,
    gathered,
    is_supervised,
    options_by_policy,
    policy_options,
    supervisor_options,
)

WORLD = ("--floor", "apartment:7", "--robots", "1", "--map-resolution", "0.1", "--horizon-s", "2")
SUITE = ("--floors", "srt_l_room", "--robots", "1", "--seeds", "1", "--horizon-s", "1", "--workers", "1")


def test_values_are_numbers_flags_or_text():
    found = policy_options(["kept=2.0", "shares-map=false", "weights=a/b=c.safetensors", " count = 3 "])
    assert found == {"kept": 2.0, "shares_map": False, "weights": "a/b=c.safetensors", "count": 3}


@pytest.mark.parametrize("assignment", ["kept", "=2", " =2", ""])
def test_what_sets_nothing_is_refused(assignment):
    with pytest.raises(ValueError, match="sets nothing; want KEY=VALUE"):
        policy_options([assignment])


def test_settings_of_several_policies_are_told_apart():
    policies = ("tour_frontier", "my.module:Mine")
    found = options_by_policy(
        ["tour_frontier.kept=1.0", "my.module:Mine.file=a.b=c", "tour_frontier.margin=0.5"], policies
    )
    assert found == {"tour_frontier": {"kept": 1.0, "margin": 0.5}, "my.module:Mine": {"file": "a.b=c"}}


@pytest.mark.parametrize("assignment", ["kept=1.0", "learned.kept=1.0", "tour_frontier=1.0", ".kept=1"])
def test_a_policy_that_is_not_evaluated_is_named(assignment):
    with pytest.raises(ValueError, match=r"names no policy that is evaluated; want POLICY\.KEY=VALUE"):
        options_by_policy([assignment], ["tour_frontier"])


@pytest.mark.parametrize("assignment", ["tour_frontier.kept", "tour_frontier. =1"])
def test_a_policy_whose_key_or_value_is_missing_is_refused(assignment):
    with pytest.raises(ValueError, match="sets nothing"):
        options_by_policy([assignment], ["tour_frontier"])


def refused(arguments, out, capsys, *words):
    assert main([*arguments, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    for word in words:
        assert word in captured.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("policy", "assignment", "words"),
    [
        ("tour_frontier", "kepd=1.0", ("'kepd'", "did you mean 'kept'", "known: minimum_size")),
        ("nearest_frontier", "share_map=1", ("'nearest_frontier'", "'share_map'", "known:")),
        ("tour_frontier", "kept=-1.0", ("kept",)),
        ("tour_frontier", "kept=much", ("kept", "much")),
        ("nearest_frontier", "kept", ("sets nothing",)),
        ("supervised", "kepd=1.0", ("policy 'supervised': there is no setting 'kepd'",)),
        ("supervised_learned", "weights=nowhere.safetensors", ("nowhere.safetensors",)),
        ("learned", "weights=nowhere.safetensors", ("nowhere.safetensors",)),
        ("learned", "weights=pyproject.toml", ("pyproject.toml", "no file of weights")),
        ("learned", "weights=3", ("weights is 3; want the name of a file",)),
        ("learned", "kepd=1.0", ("did you mean 'kept'",)),
    ],
)
def test_a_run_refuses_bad_settings_before_anything_is_written(policy, assignment, words, tmp_path, capsys):
    arguments = ["run", *WORLD, "--policy", policy, "--policy-set", assignment]
    refused(arguments, tmp_path / "out", capsys, *words)


def test_a_run_keeps_the_settings_with_its_result(tmp_path, capsys):
    arguments = ["run", *WORLD, "--policy", "tour_frontier", "--policy-set", "kept=2.5", "--json"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    assert json.loads((tmp_path / "result.json").read_text())["policy_settings"] == {"kept": 2.5}


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("kept=1.0", ("POLICY.KEY=VALUE", "tour_frontier")),
        ("learned.kept=1.0", ("'learned.kept=1.0'", "tour_frontier")),
        ("tour_frontier.kepd=1.0", ("kepd",)),
    ],
)
def test_an_evaluation_refuses_bad_settings_before_anything_is_written(assignment, words, tmp_path, capsys):
    arguments = ["evaluate", *SUITE, "--policies", "tour_frontier", "--policy-set", assignment]
    refused(arguments, tmp_path / "out", capsys, *words)


def test_an_evaluation_takes_settings_of_each_policy(tmp_path, capsys):
    policies = ["--policies", "random_walk", "tour_frontier", "--policy-set", "tour_frontier.kept=2.5"]
    assert main(["evaluate", *SUITE, *policies, "--out", str(tmp_path), "--json"]) == 0
    capsys.readouterr()
    kept = json.loads((tmp_path / "suite.json").read_text())["policy_settings"]
    assert kept == {"tour_frontier": {"kept": 2.5}}


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


def test_films_are_those_that_are_asked_for():
    assert FilmFiles().films == []
    assert FilmFiles(gif=Path("a.gif"), video=Path("b.mp4")).films == [Path("a.gif"), Path("b.mp4")]


def test_settings_hold_what_the_options_say():
    settings = FilmOptions(film_speed=5.0, film_width=320).film_settings
    assert (settings.speed, settings.width) == (5.0, 320)
    with pytest.raises(ValueError, match="speed"):
        assert FilmOptions(film_speed=0.0).film_settings


def test_bad_names_of_films_leave_nothing(tmp_path):
    FilmFiles(gif=tmp_path / "a.gif").check_films()
    with pytest.raises(ValueError, match=r"a\.txt"):
        FilmFiles(gif=tmp_path / "a.txt").check_films()
    (tmp_path / "folder.mp4").mkdir()
    with pytest.raises(IsADirectoryError, match="it is a folder; want a new name"):
        FilmFiles(video=tmp_path / "folder.mp4").check_films()
    assert [path.name for path in tmp_path.iterdir()] == ["folder.mp4"]


pytest.importorskip("viser", reason="viser is not installed: extra [viewer]")

RUN = ["run", "--robots", "2", "--map-resolution", "0.05", "--seed", "4"]
SHORT = [*RUN, "--horizon-s", "3"]
PROGRAM = "import sys; from lidarium.scripts.main import main; sys.exit(main())"
PATIENCE_S = 120.0
ADDRESS = r"the run is shown at (http://127\.0\.0\.1:\d+/\S+/)"

OF_THE_MACHINE = {"steps_per_s", "decision_ms", "tick_ms", "peak_mb"}
"""What of a result is of the clock and the memory, and differs from run to run."""


def figures(folder):
    result = json.loads((folder / "result.json").read_text())
    return {key: value for key, value in result.items() if key not in OF_THE_MACHINE}


def begin(*arguments):
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def test_files_are_the_same_with_and_without_a_view(tmp_path, capsys):
    assert main([*SHORT, "--out", str(tmp_path / "without")]) == 0
    assert main([*SHORT, "--view", "--view-port", "0", "--json", "--out", str(tmp_path / "with")]) == 0
    captured = capsys.readouterr()
    assert re.search(r"the run is shown at http://127\.0\.0\.1:\d+", captured.err)
    assert json.loads(captured.out[captured.out.index("{") :])["seed"] == 4
    files = sorted(path.name for path in (tmp_path / "with").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "without").iterdir())
    for name in files:
        if name.endswith(".pgm"):
            assert (tmp_path / "with" / name).read_bytes() == (tmp_path / "without" / name).read_bytes()
    assert figures(tmp_path / "with") == figures(tmp_path / "without")


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--view", "--view-port", "70000"], "--view-port is 70000; want 0 to 65535"),
        (["--view-stay"], "--view-stay keeps the page of --view; want --view as well"),
    ],
)
def test_bad_options_are_refused_before_anything_is_written(tmp_path, capsys, options, complaint):
    assert main([*SHORT, *options, "--out", str(tmp_path / "out")]) == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_port_in_use_is_refused_before_anything_is_written(tmp_path, capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        arguments = [*SHORT, "--view", "--view-port", str(port), "--out", str(tmp_path / "out")]
        assert main(arguments) == 2
    assert f"port {port} of 127.0.0.1 cannot be used: Address already in use" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_missing_extra_is_named_before_anything_is_written(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main([*SHORT, "--view", "--out", str(tmp_path / "out")]) == 2
    assert install_command("viewer") in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


class Heard(io.StringIO):
    """Standard error that acts once it is told some words."""

    def __init__(self, words, act):
        super().__init__()
        self.words, self.act = words, act

    def write(self, text):
        count = super().write(text)
        if self.act and self.words in self.getvalue():
            act, self.act = self.act, None
            act()
        return count


@pytest.fixture
def interruptible():
    """A test run in the background may ignore the signal."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_ends_a_viewed_run_and_keeps_what_it_found(tmp_path, capsys, monkeypatch, number, code):
    errors = Heard("explored", lambda: signal.raise_signal(number))
    monkeypatch.setattr(sys, "stderr", errors)
    assert main([*RUN, "--horizon-s", "600", "--view", "--view-port", "0", "--out", str(tmp_path)]) == code
    assert re.search(ADDRESS, errors.getvalue())
    assert "Traceback" not in errors.getvalue()
    assert "interrupted" in capsys.readouterr().out
    assert json.loads((tmp_path / "result.json").read_text())["interrupted"] is True


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_page_that_stays_is_there_until_an_interrupt(tmp_path, capsys, monkeypatch, number):
    is_over, seen = threading.Event(), []

    def visit():
        with urllib.request.urlopen(re.search(ADDRESS, errors.getvalue()).group(1), timeout=PATIENCE_S) as answer:
            seen.extend([answer.status, (tmp_path / "result.json").exists(), is_over.is_set()])
        signal.pthread_kill(threading.main_thread().ident, number)

    visitor = threading.Thread(target=visit)
    errors = Heard("stays until Ctrl-C", visitor.start)
    monkeypatch.setattr(sys, "stderr", errors)
    arguments = [*SHORT, "--view", "--view-port", "0", "--view-stay", "--json", "--out", str(tmp_path)]
    assert main(arguments) == 0
    is_over.set()
    visitor.join(PATIENCE_S)
    assert seen == [200, True, False]
    assert "Traceback" not in errors.getvalue()
    assert json.loads(capsys.readouterr().out)["interrupted"] is False


def test_an_interrupt_ends_the_process_of_a_page_that_stays(tmp_path):
    process = begin(*SHORT, "--view", "--view-port", 0, "--view-stay", "--json", "--out", tmp_path)
    while "stays until Ctrl-C" not in process.stderr.readline():
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    out, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    assert json.loads(out)["interrupted"] is False


def test_options_of_several_words_may_be_given_again():
    lists = {"--set", "--policy-set", "--supervisor"}
    words = ["--set", "a=1", "b=2", "--robots", "2", "--policy_set=c=3", "--set=d=-4", "--set", "e=5", "--json"]
    words += ["--supervisor", "f=6", "--supervisor.g-h", "7", "--supervisor", "i=8"]
    assert " ".join(gathered(words, lists)) == (
        "--robots 2 --json --set a=1 b=2 d=-4 e=5 --policy-set c=3 --supervisor f=6 g_h=7 i=8"
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--set robots=2", "--set robots=2 sets what --robots does; want --robots alone"),
        ("--set realism=lab", "want --realism alone"),
        ("--set resolution=0.1", "want --map-resolution alone"),
        ("--horizon-s 2 --set horizon_s=4", "want --horizon-s alone"),
        ("--localization truth --set localization=slam", "want --localization alone"),
        ("--map-resolution 0.05 --set occupancy.resolution=0.1", "want --map-resolution alone"),
        ("--set kinds=[service]", "'[service]' is not a valid TOML list or table; put names in quotes"),
        ("--film-shows maps", "--film-shows is given, but no film is asked for; leave it out"),
    ],
)
def test_options_that_contradict_each_other_or_have_no_effect_are_refused(words, message, tmp_path, capsys):
    assert main(["run", "--policy", "random_walk", *words.split(), "--out", str(tmp_path)]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not list(tmp_path.iterdir())


def test_all_settings_count_if_the_option_is_repeated(tmp_path, capsys):
    words = ["run", "--policy", "random_walk", "--set", "people=2", "--set", "horizon_s=1", "--robots", "1"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    assert "0 contacts by robots, 0 by people" in capsys.readouterr().out
    result = json.loads((tmp_path / "result.json").read_text())
    assert (result["robots"], result["horizon_s"], result["contacts_by_robot"]) == (1, 1.0, 0)
