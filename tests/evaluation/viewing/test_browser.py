"""The page in a browser, used as a person uses it, while robots explore."""

import threading
import time

import cv2
import numpy as np
import pytest
from browsing import SOLID, Browser, chromium, show_on_screen

pytest.importorskip("viser", reason="viser is not installed: extra [viewer]")

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.viewing.live_view import LiveView
from lidarium.evaluation.viewing.server import address_of, view_server

SETTINGS = make_settings(robots=2, horizon_s=600.0, resolution=0.05)


@pytest.fixture(scope="module")
def driver():
    driver = chromium(SOLID)
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def page(driver):
    """The page of a run that goes on for as long as it is looked at."""
    policy = lidarium.policy("random_walk")
    with view_server(0) as server:
        env = WatchedExploration("apartment", SETTINGS, watchers=[LiveView(server, policy, "random_walk")])
        run = threading.Thread(target=run_episode, args=(policy, env, 0))
        run.start()
        show_on_screen(driver, "light", 960, 600)
        driver.get(address_of(server))
        page = Browser(driver)
        page.env = env
        page.wait(lambda: page.find_all("canvas") and says(page, "Pause"), 60.0)
        yield page
        env.stop("robot_0", "nobody looks any more")
        env.stop("robot_1", "nobody looks any more")
        if says(page, "Resume"):
            page.button("Resume").click()
        run.join(60.0)
    assert not run.is_alive()


def says(page, text):
    """Whether a button says something."""
    return text in page.run("return [...document.querySelectorAll('button')].map(each => each.innerText.trim())")


def picture(page):
    """What the browser shows of the scene, left of the panel and below notices, in blocks of 5 x 5 pixels."""
    content = np.frombuffer(page.driver.get_screenshot_as_png(), np.uint8)
    scene = cv2.imdecode(content, cv2.IMREAD_COLOR)[150:, :620]
    return cv2.resize(scene, (124, 90), interpolation=cv2.INTER_AREA).astype(np.int64)


def are_alike(one, other):
    """Whether two pictures show the same; a browser that is slow draws with fewer pixels."""
    return (np.abs(one - other).max(axis=2) > 30).sum() < 4


def still(page):
    """The picture once it does not change any more; without a graphics card a frame takes long."""
    before = picture(page)

    def is_still():
        nonlocal before
        time.sleep(0.5)
        last, before = before, picture(page)
        return are_alike(last, before)

    page.wait(is_still, 60.0)
    return before


LABEL = "let e = arguments[0]; while (!e.innerText.trim()) e = e.parentElement; return e.innerText.trim()"


def box(page, label):
    """Return the box of a label, which stands beside it."""
    fields = page.find_all("input[type=checkbox]")
    return fields[[page.run(LABEL, each) for each in fields].index(label)]


def test_the_page_says_how_far_the_run_is(page):
    text = page.run("return [...document.querySelectorAll('table')].map(each => each.innerText).join(' ')")
    assert "Explored" in text
    assert "%" in text
    assert {"robot_0", "robot_1"} <= set(text.split())


def test_a_pause_stops_the_run_and_layers_go_and_come_meanwhile(page):
    page.wait(lambda: page.env.scorer.time > 1.0, 60.0)
    page.button("Pause").click()
    page.wait(lambda: says(page, "Resume"), 20.0)
    whole, time_s = still(page), page.env.scorer.time
    assert whole.std() > 10.0  # something is drawn
    for label in ("True walls", "Robots"):
        field = box(page, label)
        page.run("arguments[0].click()", field)
        page.wait(lambda: not are_alike(still(page), whole), 30.0)
        page.run("arguments[0].click()", field)
        page.wait(lambda: are_alike(picture(page), whole), 30.0)
    assert page.env.scorer.time == time_s
    page.button("Resume").click()
    page.wait(lambda: page.env.scorer.time > time_s and says(page, "Pause"), 20.0)


def test_the_browser_asks_only_this_machine_and_has_no_errors(page):
    addresses = page.run("return performance.getEntriesByType('resource').map(each => each.name)")
    assert all(address.startswith(("http://127.0.0.1:", "blob:", "data:")) for address in addresses)
    errors = [entry for entry in page.driver.get_log("browser") if entry["level"] == "SEVERE"]
    assert errors == []
