"""A headless Chromium for pages: found on the system, driven by selenium (extra ``browser``)."""

import shutil
from collections.abc import Sequence
from typing import Any

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT = 1280, 800
"""Size of the screen [pixels]."""


PLAIN = ("--disable-gpu",)
SOLID = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Options for pages that draw in three dimensions: WebGL without a graphics card."""


def headless_chromium(graphics: Sequence[str] = PLAIN) -> Any:  # noqa: ANN401
    """Return a driver of a headless Chromium; the caller ends it with ``quit``.

    Parameters
    ----------
    graphics : sequence of str
        Options of how it draws: ``PLAIN`` or ``SOLID``.

    Raises
    ------
    ValueError
        Where selenium, Chromium or its driver is not installed.
    """
    try:
        from selenium import webdriver
    except ImportError as error:
        raise ValueError('selenium is not installed; pip install "lidarium[browser]"') from error
    browser = next((path for path in map(shutil.which, BROWSERS) if path), None)
    driver = shutil.which("chromedriver")
    if browser is None or driver is None:
        raise ValueError("no Chromium with its chromedriver; apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    # A container's root has no sandbox, and little shared memory.
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--hide-scrollbars",
        *graphics,
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    made = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    made.set_script_timeout(120)
    return made


def show_on_screen(driver: Any, theme: str, width: int = WIDTH, height: int = HEIGHT) -> None:  # noqa: ANN401
    """Set the size of the screen and whether the system is light or dark."""
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
    )
    features = [
        {"name": "prefers-color-scheme", "value": theme},
        {"name": "prefers-reduced-motion", "value": "reduce"},
    ]
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
